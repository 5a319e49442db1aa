"""A node that cannot go on: its error reaches the user, with a code."""

import signal
import subprocess
import sys

import pytest

from cam_rig.nodes.__main__ import start

pytestmark = pytest.mark.ros
MISSING = "follower, law_server, microphone, recorder"


def arguments(*parameters):
    return ["--ros-args", *(part for parameter in parameters for part in ("-p", parameter))]


@pytest.fixture
def run_here(monkeypatch, capfd):
    """Run a node's entry point in this process; its code and what it wrote to stderr."""

    def run(name, *parameters):
        monkeypatch.setattr(sys, "argv", [name, *arguments(*parameters)])
        with pytest.raises(SystemExit) as ended:
            start(name)
        return ended.value.code, capfd.readouterr().err

    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield run
    for number, handler in handlers.items():
        signal.signal(number, handler)


@pytest.mark.parametrize(
    ("node", "parameter", "code", "words"),
    [
        ("cam_drive", "consumers:=['bogus']", 2, "consumers: has bogus; allowed: recorder, "),
        ("law_server", "scene:=5", 2, "scene: is 5; allowed: a text"),
        ("follower", "scene:=none.yaml", 2, "none.yaml: no such file"),
        ("follower", "scene:=quik", 2, "did you mean 'quick'?"),
        ("microphone", "frequency_weighting:=B", 2, "frequency_weighting: has B; allowed: A, C, Z"),
        (
            "cam_drive",
            "patience:=1.0",
            1,
            "not ready after 1 s: follower, law_server, microphone, recorder; is it",
        ),
    ],
)
def test_a_node_reports_why_it_ends(ros_domain, run_here, node, parameter, code, words):
    """One line on stderr and the error's code, no traceback."""
    ended, logged = run_here(node, parameter)
    assert ended == code
    assert words in logged
    assert "Traceback" not in logged


def test_the_code_is_the_processs(ros_domain):
    """As any shell sees it."""
    command = [sys.executable, "-m", "cam_rig.nodes", "microphone", *arguments("time_weighting:=X")]
    ended = subprocess.run(command, capture_output=True, text=True, check=False, timeout=100)
    assert ended.returncode == 2
    assert ended.stderr == "cam_rig: time_weighting: has X; allowed: F, S\n"
