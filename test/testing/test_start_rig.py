"""Tests of `cam_rig.testing`, the pytest plugin that starts a rig for a test.

Other packages use it in their tests. Some of these tests run in a separate pytest process.
"""

import os
import signal
import subprocess
import sys
from importlib.metadata import entry_points

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.task import Future
from std_srvs.srv import Trigger

from cam_rig.errors import RunError
from cam_rig.messages.codec import stamp_ns
from cam_rig.testing import client, running_rig
from cam_rig.testing.running_rig import isolated_domain

from ..docs.conftest import DOCS, blocks
from ..processes import ended, is_running, until

pytestmark = pytest.mark.ros
pytest_plugins = ["pytester"]
#: Options of the separate pytest run. Naming the plugin is allowed although pytest also loads it
#: through its entry point.
PLUGINS = ("-p", "cam_rig.testing", "-p", "no:cacheprovider", "-p", "no:xdist")


def test_plugin_is_an_entry_point_of_the_package():
    """The package declares its pytest plugin as an entry point, for pytest to load it."""
    (entry,) = entry_points(group="pytest11", name="cam_rig.testing")
    assert entry.value == entry.name


@pytest.mark.usefixtures("forked")
def test_rig_takes_commands_and_is_independent_of_another(start_rig, monkeypatch):
    """A rig that a test starts obeys its commands, while a second rig runs.

    It reports ticks (intervals between cam states) and messages, the end of its run, and its bag.
    The environment variables are restored.
    """
    before = dict(os.environ)
    with start_rig("quick", autostart=False) as rig, start_rig("quick") as other:
        assert rig.scene.name == "quick.yaml"
        assert rig.domain != other.domain and rig.bag != other.bag
        pressures = rig.listen("/microphone/pressure")
        with pytest.raises(RunError, match="cam_drive: rpm: "):
            rig.set_parameter("cam_drive", "rpm", 1e9)
        assert "the cam turns" in rig.call("/cam_drive/start")
        reported = rig.wait_for_tick(3)
        assert (reported["tick"], reported["cam"]) == (3, "tm21")
        lost = rig.wait_for_message("/diagnostics", says_contact_lost)
        assert lost.header.stamp.sec >= 0
        rig.wait_until_done()
        other.wait_until_done()
        with pytest.raises(RunError, match="tick 99: the run was over after tick 16"):
            rig.wait_for_tick(99)
        monkeypatch.setattr(running_rig, "AFTER_RUN_S", 0.5)
        with pytest.raises(RunError, match="a message on /cam/law: the run is over"):
            rig.wait_for_message("/cam/law", lambda _: False)
        run, same = rig.read_bag(), other.read_bag()
        with pytest.raises(RunError, match="another tick: the rig has been ended"):
            rig.wait_for(lambda: False, "another tick")
    assert run.complete and rig.bag.is_dir()
    stamps = {stamp_ns(message.header.stamp) for message in pressures}  # stamps can be repeated
    assert stamps == {tick.stop_ns for tick in run.ticks}
    assert len(run.ticks) == 16
    assert rig.ticks[-1]["cam"] == "bezier15"
    assert [tick.pressure for tick in run.ticks] == [tick.pressure for tick in same.ticks]
    assert dict(os.environ) == before


def says_contact_lost(message):
    return any((s.name, s.level) == ("follower", DiagnosticStatus.WARN) for s in message.status)


@pytest.mark.usefixtures("forked")
def test_failed_node_is_reported_with_its_last_line(start_rig, tmp_path):
    """If a node fails, a waiting test receives its last line as error.

    Here the recorder fails, because the folder of the bag exists.
    """
    (tmp_path / "occupied").mkdir()
    rig = start_rig("quick", bag=tmp_path / "occupied")
    with pytest.raises(RunError, match=r"node recorder ended with code \d.*occupied"):
        rig.wait_for_tick(3)


@pytest.mark.usefixtures("forked")
def test_failed_program_is_reported_with_its_last_line(start_rig):
    """If a program of the test fails, a waiting test receives its last line as error."""
    rig = start_rig("quick", autostart=False)
    rig.start_program(sys.executable, "-c", "raise SystemExit('no lathe found')")
    with pytest.raises(RunError, match=r"ended with code 1: no lathe found"):
        rig.wait_for_tick(1)


#: Script that starts a program with a child, prints the process ids of both, and sleeps.
ABANDONED = """
import os, sys, time
from cam_rig.testing.running_rig import StartedProgram
program = StartedProgram(["sh", "-c", "sleep 1000 & echo $$ $!; wait"], dict(os.environ))
while len(program.output.split()) < 2:
    time.sleep(0.01)
print(program.output, flush=True)
time.sleep(1000)
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_program_ends_with_a_terminated_pytest(number):
    """If the test process is killed, a started program and its child end."""
    command = [sys.executable, "-c", ABANDONED]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as tests:
        pids = [int(pid) for pid in tests.stdout.readline().split()]
        assert len(pids) == 2 and all(map(is_running, pids))
        tests.send_signal(number)
    until(lambda: not any(map(is_running, pids)))


@pytest.mark.long
@pytest.mark.usefixtures("forked")
def test_examples_of_the_page_on_nodes_run(start_rig):
    """The three example tests on the page nodes.md pass."""
    example = next(c for lang, _, c in blocks(DOCS / "nodes.md") if "def test_" in c)
    module = {}
    exec(compile(example, "nodes.md", "exec"), module)
    tests = [value for name, value in module.items() if name.startswith("test_")]
    assert len(tests) == 3
    for test in tests:
        test(start_rig)


@pytest.mark.long
def test_failures_are_reported_and_all_processes_end(pytester):
    """pytest reports a failed test and a killed node, and no process remains."""
    pytester.makepyfile(
        """
        import os
        from contextlib import suppress

        def test_fails(start_rig):
            rig = start_rig("quick", pacing="real_time")
            rig.wait_for_tick(1)
            raise AssertionError("failure of the test")

        def test_kills_a_node(start_rig):
            rig = start_rig("quick", pacing="real_time")
            rig.wait_for_tick(1)
            pid = rig.pids["follower"]
            os.kill(pid, 9)
            with suppress(FileNotFoundError):
                while " Z " not in open(f"/proc/{pid}/stat").read():
                    pass
        """
    )
    done = pytester.runpytest_subprocess(*PLUGINS)
    done.assert_outcomes(failed=1, passed=1, errors=1)
    text = done.stdout.str()
    assert "failure of the test" in text
    assert "node follower was ended by signal 9" in text
    assert "[cam_drive]" in text
    assert ended("pgrep", "-f", pytester.path).stdout == ""


# -- client of a rig whose requests or answers DDS loses


class LossyClient:
    """Fake client of a service that does not receive the first `lost` answers."""

    def __init__(self, lost):
        self.lost, self.requests = lost, 0

    def service_is_ready(self):
        return True

    def call_async(self, _request):
        self.requests += 1
        future = Future()
        if self.requests > self.lost:
            future.set_result(self.requests)
        return future


def test_request_is_repeated_after_a_lost_answer(monkeypatch):
    """A client repeats its request until it receives an answer.

    An answer is lost if the service has not yet discovered the client.
    """
    monkeypatch.setattr(client, "ANSWER_TIMEOUT_S", 0.05)
    with isolated_domain() as domain, client.RigClient(domain) as rig:
        for lost in (0, 1, 3):
            lossy = LossyClient(lost)
            monkeypatch.setattr(rig.node, "create_client", lambda *_, lossy=lossy: lossy)
            monkeypatch.setattr(rig.node, "destroy_client", lambda _: None)
            assert rig.ask(Trigger, "/any", Trigger.Request()) == lost + 1
