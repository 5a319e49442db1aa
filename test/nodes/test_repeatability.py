"""Tests of runs with a stalled or a killed node, and of runs on a full disk."""

import signal
import sys
import threading
import time

import pytest

from cam_rig.bag.files import is_unclosed
from cam_rig.errors import RunError
from cam_rig.live.flow_control import MAX_TICKS_IN_FLIGHT
from cam_rig.runner.graph import Graph
from cam_rig.runner.node_process import stop_all
from cam_rig.studies.simulate.recorded import read_recording

from ..cli.conftest import call
from ..processes import ended
from .conftest import (
    SLOW,
    TICKS,
    OneProcess,
    has_ticks,
    mapped,
    node_processes,
    patient,
    payloads_of,
    unused,
    wait_until,
)

pytestmark = [pytest.mark.ros, pytest.mark.usefixtures("forked", "domain")]
NODES = ("follower", "microphone", "law_server", "cam_drive", "recorder")


def test_a_stalled_consumer_stops_the_drive_and_no_message_is_lost(
    short_scene, undisturbed, tmp_path
):
    """While a consumer node is stalled, the drive stops after 4 ticks, then continues.

    A tick is the interval between two published cam states. The bag equals that of an undisturbed
    run.
    """
    stalled, resume = threading.Event(), threading.Event()
    with OneProcess(patient(short_scene, tmp_path / "bag", autostart=False)) as here:
        microphone, drive = here.nodes["microphone"], here.nodes["cam_drive"]
        listen = microphone._source.listen

        def stall(*block):
            if microphone.ticks == 10 and not stalled.is_set():
                stalled.set()
                assert resume.wait(200.0)
            return listen(*block)

        microphone._source.listen = stall
        drive.program.run(True)
        assert stalled.wait(200.0)
        wait_until(lambda: drive.program.flow.in_flight == MAX_TICKS_IN_FLIGHT)
        assert here.nodes["follower"].ticks <= 10 + MAX_TICKS_IN_FLIGHT
        resume.set()
        for _ in here.progress():
            pass
    assert payloads_of(tmp_path / "bag") == undisturbed


def resident_mb(process):
    """Return the resident memory of a process in MB, 0 if it has ended."""
    with open(f"/proc/{process.pid}/status", encoding="utf-8") as lines:
        sizes = (int(line.split()[1]) for line in lines if line.startswith("VmRSS"))
        return next(sizes, 0) / 1024


@pytest.mark.long
def test_memory_does_not_grow_while_a_consumer_is_suspended(short_scene, undisturbed, tmp_path):
    """While the microphone is suspended, no other node grows by over 5 MB.

    The bag equals that of an undisturbed run.
    """
    with Graph(patient(short_scene, tmp_path / "bag"), log=print) as graph:
        for report in graph.progress():
            if report["tick"] == 30:
                others = [p.process for name, p in graph.processes.items() if name != "microphone"]
                stalled = graph.processes["microphone"].process
                stalled.send_signal(signal.SIGSTOP)
                time.sleep(1.0)
                before = [resident_mb(process) for process in others]
                time.sleep(4.0)
                grown = [resident_mb(p) - mb for p, mb in zip(others, before, strict=True)]
                stalled.send_signal(signal.SIGCONT)
    assert max(grown) < 5.0
    assert payloads_of(tmp_path / "bag") == undisturbed


# Killed nodes and other failures.


@pytest.mark.variants(1)
@pytest.mark.parametrize("victim", NODES)
def test_a_killed_node_ends_the_run_and_is_named(short_scene, tmp_path, victim):
    """A killed node ends the run with an error that contains node and last tick.

    A tick is the interval between two published cam states. The bag is closed and readable, and no
    temporary file remains.
    """
    bag, logged, before = tmp_path / "bag", [], unused()
    text = rf"node {victim} was ended by signal 9 after tick \d+ \(\w+, \d+ rpm\)"
    graph = Graph(patient(short_scene, bag, pacing=SLOW), log=logged.append)
    with pytest.raises(RunError, match=text), graph:
        started = list(graph.processes.values())
        names = mapped(*(node.process.pid for node in started))
        for _ in graph.progress():
            if has_ticks(bag):
                graph.processes[victim].process.kill()
    assert all(node.has_ended for node in started)
    assert any(line.startswith("bag ") for line in logged)
    assert not is_unclosed(bag) and 0 < len(read_recording(bag).ticks) < TICKS
    assert (unused() - before) & names == set()


@pytest.mark.long
def test_a_recorder_killed_at_the_end_of_the_run_is_named(short_scene, tmp_path, monkeypatch):
    """If the recorder is killed at its end, the run has code 1 and a recovered bag."""

    def kill_recorder(nodes):
        for node in nodes:
            if node.name == "recorder":
                node.process.kill()
                node.process.wait(timeout=100)
        stop_all(nodes)

    monkeypatch.setattr("cam_rig.runner.graph.stop_all", kill_recorder)
    bag = tmp_path / "bag"
    result = call("run", short_scene, "--bag", bag)
    assert result.exit_code == 1
    assert f"node recorder was ended by signal 9 after tick {TICKS}" in result.stderr
    assert "saved" in result.stderr
    assert 0 < len(read_recording(bag).ticks) <= TICKS


@pytest.mark.long
def test_a_full_disk_ends_the_run_with_an_error(short_scene, tmp_path):
    """A run whose recorder cannot write ends with code 1 and the cause.

    A limit of the file size of 50 kB acts like a full disk. No process remains.
    """
    limit = "import resource as r; r.setrlimit(r.RLIMIT_FSIZE, (50_000, 50_000))"
    # otherwise incomplete .pyc files would remain
    no_bytecode = "import os; os.environ['PYTHONDONTWRITEBYTECODE'] = '1'"
    start = f"{no_bytecode}; {limit}; import signal; signal.signal(signal.SIGXFSZ, signal.SIG_IGN)"
    arguments = ["cam-rig", "run", str(short_scene), "--bag", str(tmp_path / "bag")]
    code = (
        f"{start}; import sys; sys.argv = {arguments!r}; from cam_rig.cli.main import main; main()"
    )
    run = ended(sys.executable, "-c", code)
    assert run.returncode == 1
    assert "cannot be written (File too large) after" in run.stderr
    assert "Traceback" not in run.stderr
    assert node_processes(tmp_path) == []
