"""What a node says when it cannot go on: the words reach the user, with a code."""

import subprocess
import sys

import pytest

pytestmark = pytest.mark.ros
MISSING = "follower, law_server, microphone, recorder"


def run_node(name, *parameters):
    arguments = [part for parameter in parameters for part in ("-p", parameter)]
    command = [sys.executable, "-m", "cam_rig.nodes", name, "--ros-args", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.parametrize(
    ("node", "parameter", "code", "words"),
    [
        ("cam_drive", "consumers:=['bogus']", 2, "consumers: has bogus; allowed: follower"),
        ("law_server", "scene:=5", 2, "parameter: "),
        ("follower", "scene:=none.yaml", 2, "none.yaml: no such file"),
        ("microphone", "frequency_weighting:=B", 2, "frequency_weighting: has B; allowed: A, C, Z"),
        (
            "cam_drive",
            "patience:=1.0",
            1,
            "not ready after 1 s: follower, law_server, microphone, recorder; is it",
        ),
    ],
)
def test_a_node_says_why_it_ends(ros_domain, node, parameter, code, words):
    """One line on stderr and the error's code, no traceback."""
    ended = run_node(node, parameter)
    assert ended.returncode == code
    assert words in ended.stderr
    assert "Traceback" not in ended.stderr
