"""One scene gives one bag: with nodes that are killed and started again, or stalled."""

import os
import signal
import subprocess
import sys
import threading
import time

import pytest
from typer.testing import CliRunner

from cam_rig.bag.files import is_unclosed, mcap_files
from cam_rig.bag.reader import read_recording
from cam_rig.bag.split import Split
from cam_rig.cli.main import app
from cam_rig.errors import RunError
from cam_rig.live.flow_control import MAX_TICKS_IN_FLIGHT
from cam_rig.runner.graph import Graph
from cam_rig.runner.node_process import stop_all

pytestmark = [pytest.mark.ros, pytest.mark.usefixtures("forked", "domain")]
NODES = ("follower", "microphone", "law_server", "cam_drive", "recorder")


def assert_same(found, expected):
    assert found.keys() == expected.keys()
    for topic, messages in expected.items():
        assert len(found[topic]) == len(messages), topic
        assert found[topic] == messages, topic


def test_killed_nodes_are_started_again_and_leave_no_trace(rig, short_scene, undisturbed, tmp_path):
    """kill -9 of each node in turn: the bag is the undisturbed one, and /dev/shm is left clean."""
    victims, before = list(NODES), rig.unused()
    killed, logged, names = [], [], set()

    def kill(graph, tick):
        alive = not any(node.has_ended for node in graph.processes.values())
        if tick > 6 and victims and alive and len(logged) == len(killed):
            names.update(rig.mapped(*(node.process.pid for node in graph.processes.values())))
            killed.append(victims.pop(0))
            graph.processes[killed[-1]].process.kill()
            graph.processes[killed[-1]].process.wait(timeout=100)

    rig.run(short_scene, tmp_path / "bag", kill, respawn=True, logged=logged, pacing="2x")
    assert [line.split()[1] for line in logged] == killed
    assert len(killed) == 5
    assert all("was ended by signal 9 after tick" in line for line in logged)
    assert_same(rig.payloads(tmp_path / "bag"), undisturbed)
    assert len(names) > 10
    assert (rig.unused() - before) & names == set()


@pytest.mark.long
def test_a_recorder_killed_after_the_drives_end_changes_no_message(
    rig, short_scene, undisturbed, tmp_path
):
    """It had answered for what it had not flushed: the bag is the undisturbed one all the same."""
    logged, once = [], [rig.ticks]

    def kill(graph, tick):
        if tick in once:
            once.clear()
            assert graph.processes["cam_drive"].process.wait(timeout=100) == 0
            graph.processes["recorder"].process.kill()
            graph.processes["recorder"].process.wait(timeout=100)

    rig.run(short_scene, tmp_path / "bag", kill, respawn=True, logged=logged)
    assert [line.split()[1] for line in logged] == ["recorder"]
    assert_same(rig.payloads(tmp_path / "bag"), undisturbed)


@pytest.mark.long
def test_a_recorder_that_is_killed_goes_on_with_a_split_bag(
    rig, short_scene, undisturbed, tmp_path
):
    """The files that were closed are kept; together they are the bag of an undisturbed run."""
    bag, kept = tmp_path / "bag", []

    def kill(graph, _tick):
        if not kept and len(files := mcap_files(bag)) > 2:
            graph.processes["recorder"].process.kill()
            kept.extend((file, file.read_bytes()) for file in files[:-2])

    rig.run(short_scene, bag, kill, respawn=True, split=Split(duration=1.0), pacing="2x")
    assert kept and all(file.read_bytes() == data for file, data in kept)
    found = rig.payloads(bag)
    assert {t: sorted(m) for t, m in found.items()} == {
        t: sorted(m) for t, m in undisturbed.items()
    }


@pytest.mark.long
@pytest.mark.parametrize(
    "victims", [("follower", "cam_drive"), ("recorder", "follower", "microphone")]
)
def test_a_second_node_is_killed_while_the_first_returns(
    wait_for, rig, short_scene, undisturbed, tmp_path, victims
):
    """Each when the one before has been started again, so that no process has received all: the
    bag is the undisturbed one."""
    logged, once = [], [20]

    def in_turn(processes):
        for dead, process in enumerate(processes):
            wait_for(lambda dead=dead: len(logged) >= dead)
            process.kill()

    def kill(graph, tick):
        if tick in once:  # a drive that returns sends it again
            once.clear()
            processes = [graph.processes[name].process for name in victims]
            threading.Thread(target=in_turn, args=[processes]).start()

    rig.run(short_scene, tmp_path / "bag", kill, respawn=True, logged=logged)
    assert sorted(line.split()[1] for line in logged) == sorted(victims)
    assert_same(rig.payloads(tmp_path / "bag"), undisturbed)


def test_a_consumer_that_is_held_holds_all_and_loses_nothing(
    rig, short_scene, undisturbed, wait_for, tmp_path
):
    """The drive sends no more than may be in flight, so no queue grows; then it goes on."""
    held, go_on = threading.Event(), threading.Event()
    with rig.here(rig.live(short_scene, tmp_path / "bag", autostart=False)) as here:
        microphone, drive = here.nodes["microphone"], here.nodes["cam_drive"]
        listen = microphone._source.listen

        def hold(*block):
            if microphone.ticks == 10 and not held.is_set():
                held.set()
                assert go_on.wait(200.0)
            return listen(*block)

        microphone._source.listen = hold
        drive._program.run(True)
        assert held.wait(200.0)
        wait_for(lambda: drive._program.flow.in_flight == MAX_TICKS_IN_FLIGHT)
        assert here.nodes["follower"].ticks <= 10 + MAX_TICKS_IN_FLIGHT
        go_on.set()
        for _ in here.progress():
            pass
    assert_same(rig.payloads(tmp_path / "bag"), undisturbed)


def resident_mb(process):
    with open(f"/proc/{process.pid}/status", encoding="utf-8") as lines:
        return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS")) / 1024


@pytest.mark.long
def test_a_suspended_consumer_lets_no_memory_grow(rig, short_scene, undisturbed, tmp_path):
    """For 5 s by SIGSTOP, as processes."""
    grown = []

    def stall(graph, tick):
        if tick != 30:
            return
        others = [p.process for name, p in graph.processes.items() if name != "microphone"]
        stalled = graph.processes["microphone"].process
        stalled.send_signal(signal.SIGSTOP)
        time.sleep(1.0)
        before = [resident_mb(process) for process in others]
        time.sleep(4.0)
        grown.extend(resident_mb(p) - mb for p, mb in zip(others, before, strict=True))
        stalled.send_signal(signal.SIGCONT)

    rig.run(short_scene, tmp_path / "bag", stall)
    assert max(grown) < 5.0
    assert_same(rig.payloads(tmp_path / "bag"), undisturbed)


# Without --respawn a killed node ends the run, which names it and the tick, and keeps what it has.


def test_a_killed_node_ends_the_run_and_is_named(rig, short_scene, tmp_path):
    """With the last tick; the bag is closed, no process is left."""
    bag = tmp_path / "bag"
    with Graph(rig.live(short_scene, bag)) as graph:
        with pytest.raises(RunError, match=r"node follower was ended by signal 9 after tick \d+"):
            for report in graph.progress():
                if report["tick"] == 3:
                    graph.processes["follower"].process.kill()
        started = list(graph.processes.values())
    assert all(node.has_ended for node in started)
    assert not is_unclosed(bag)


@pytest.mark.long
@pytest.mark.parametrize("victim", NODES)
def test_a_killed_node_ends_the_command(wait_for, rig, short_scene, tmp_path, victim):
    """Code 1, the node and the last tick named, the bag readable, nothing left behind."""
    bag, before = tmp_path / "bag", rig.unused()
    command = [sys.executable, "-m", "cam_rig.cli.main", "run", str(short_scene)]
    command += ["--bag", str(bag), "--pacing", "0.3x"]  # no end before the node's
    run = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=dict(os.environ))
    wait_for(lambda: rig.size(bag) > 100_000)
    found = subprocess.run(
        ["pgrep", "-f", f"cam_rig.nodes.{victim} .*{short_scene}"],
        capture_output=True, text=True, check=True, timeout=100,
    )  # fmt: skip
    names = rig.mapped(*rig.processes(short_scene))
    subprocess.run(["kill", "-9", *found.stdout.split()], check=True, timeout=100)
    _, words = run.communicate(timeout=100)
    assert run.returncode == 1
    line = words.strip().splitlines()[-1]
    assert f"cam-rig: node {victim} was ended by signal 9 after tick " in line
    assert "rpm)" in line
    assert "what was recorded so far is in" in words
    assert 0 < len(read_recording(bag).ticks) < rig.ticks
    assert rig.processes(bag) == []
    assert (rig.unused() - before) & names == set()


@pytest.mark.long
def test_a_recorder_killed_while_all_are_ended_is_named(rig, short_scene, tmp_path, monkeypatch):
    """After the drive's end, before the bag is closed: code 1, its name, the bag recovered."""

    def kill_recorder(nodes):
        for node in nodes:
            if node.name == "recorder":
                node.process.kill()
                node.process.wait(timeout=100)
        stop_all(nodes)

    monkeypatch.setattr("cam_rig.runner.graph.stop_all", kill_recorder)
    bag = tmp_path / "bag"
    result = CliRunner().invoke(app, ["run", str(short_scene), "--bag", str(bag)])
    assert result.exit_code == 1
    assert f"node recorder was ended by signal 9 after tick {rig.ticks}" in result.stderr
    assert "what was recorded so far is in" in result.stderr and "saved" in result.stderr
    assert 0 < len(read_recording(bag).ticks) <= rig.ticks


@pytest.mark.long
def test_a_full_disk_ends_the_run_with_its_name(rig, short_scene, tmp_path):
    """A file may grow to 50 kB here: the recorder reports what it could not write."""
    limited = "import resource as r; r.setrlimit(r.RLIMIT_FSIZE, (50_000, 50_000))"
    whole = "import os; os.environ['PYTHONDONTWRITEBYTECODE'] = '1'"  # else half a module's stays
    start = f"{whole}; {limited}; import signal; signal.signal(signal.SIGXFSZ, signal.SIG_IGN)"
    arguments = ["cam-rig", "run", str(short_scene), "--bag", str(tmp_path / "bag")]
    code = (
        f"{start}; import sys; sys.argv = {arguments!r}; from cam_rig.cli.main import main; main()"
    )
    run = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=100
    )
    assert run.returncode == 1
    assert "cannot be written (File too large) after" in run.stderr
    assert "Traceback" not in run.stderr
    assert rig.processes(tmp_path) == []
