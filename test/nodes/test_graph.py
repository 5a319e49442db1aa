"""The live graph: five processes, one bag, the same numbers as without ROS."""

import os
import shutil
import signal
import subprocess
import sys
import time

import pytest

from cam_rig.bag.completeness import require_complete
from cam_rig.bag.files import is_unclosed
from cam_rig.bag.reader import read_counts, read_recording
from cam_rig.errors import RunError
from cam_rig.runner.graph import Graph
from cam_rig.schema.load import config_root
from cam_rig.simulation.simulate import simulate, step_levels

pytestmark = pytest.mark.ros
LONG = pytest.mark.long
QUICK = config_root() / "scenes" / "quick.yaml"


def test_the_graph_gives_the_numbers_of_the_core(rig, undisturbed_bag):
    """Levels from the live graph's bag and from simulate agree to 1e-9 dB; no tick is missing."""
    recording = read_recording(undisturbed_bag)
    assert len(recording.ticks) == rig.ticks
    require_complete(undisturbed_bag, recording.loaded.scene)
    settle = recording.loaded.scene.program.settle_turns.si
    heard = step_levels(recording.ticks, settle)
    alone = step_levels(simulate(recording.loaded), settle)
    for cam in ("tm21", "bezier15"):
        assert heard[cam] == pytest.approx(alone[cam], abs=1e-9)
    assert rig.processes(undisturbed_bag) == []


def test_ramps_give_the_numbers_of_the_core_too(ros_domain, rig, tmp_path):
    """From rest along ramps, two cams: every tick from the first is in the bag, as simulated."""
    ramp = '  ramp: {assumed: 0.4, unit: s, source: "a test"}\n  ticks_per_turn: 3\n'
    require_as_simulated(rig, tmp_path, "published:", ramp + "published:")


@pytest.mark.long
def test_cams_of_fewer_ticks_than_are_in_flight(ros_domain, rig, tmp_path):
    """Each turns in its turn: a report on one is not taken for the next."""
    cams = "cams: [tm21, cycloidal, poly345, bezier15]"
    require_as_simulated(
        rig, tmp_path, "cams: [tm21, bezier15]", cams, "[200, 300, 350, 400]", "[300]"
    )


def require_as_simulated(rig, folder, *changes):
    """Run the quick scene with some of its text changed; the bag is what `simulate` gives."""
    text = QUICK.read_text(encoding="utf-8")
    for old, new in zip(changes[::2], changes[1::2], strict=True):
        assert old in text
        text = text.replace(old, new)
    scene, bag = folder / "scenes" / "quick.yaml", folder / "bag"
    scene.parent.mkdir()
    scene.write_text(text, encoding="utf-8")
    with Graph(rig.live(scene, bag)) as graph:
        ticks = [report["tick"] for report in graph.progress()]
    assert ticks == list(range(len(ticks)))
    recording = read_recording(bag)
    require_complete(bag, recording.loaded.scene)
    alone = list(simulate(recording.loaded))
    assert [tick.start for tick in recording.ticks] == [tick.start for tick in alone]
    assert [tick.pressure for tick in recording.ticks] == [tick.pressure for tick in alone]


def test_a_killed_node_ends_the_run_and_is_named(ros_domain, rig, tmp_path):
    """kill -9 of the follower: the run names the node, and no process is left."""
    bag = tmp_path / "bag"
    with Graph(rig.live(config_root() / "scenes" / "tm21_sweep.yaml", bag)) as graph:
        with pytest.raises(RunError, match=r"node follower was ended by signal 9 after tick \d+"):
            for report in graph.progress():
                if report["tick"] == 3:
                    graph.processes["follower"].process.kill()
        started = list(graph.processes.values())
    assert all(node.has_ended for node in started)
    assert not is_unclosed(bag)


def start_run(rig, wait_for, tmp_path):
    """A sweep under way, of a scene file of its own, by which its nodes are found."""
    scene = tmp_path / "scenes" / "tm21_sweep.yaml"
    scene.parent.mkdir()
    shutil.copy(config_root() / "scenes" / "tm21_sweep.yaml", scene)
    bag = tmp_path / "bag"
    command = [sys.executable, "-m", "cam_rig.cli.main", "run", str(scene), "--bag", str(bag)]
    command += ["--pacing", "real_time"]  # no end before the test's
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=dict(os.environ))
    wait_for(lambda: rig.size(bag) > 1_000_000)
    assert len(rig.processes(scene)) > 5  # the runner and its five nodes
    return process, scene, bag


@LONG
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_signal_ends_all_and_closes_the_bag(ros_domain, rig, wait_for, tmp_path, name):
    """Ctrl-C, kill, a closed terminal: code 128 + signal, a closed bag, no process left."""
    process, scene, bag = start_run(rig, wait_for, tmp_path)
    number = getattr(signal, name)
    process.send_signal(number)
    _, words = process.communicate(timeout=100)
    assert process.returncode == 128 + number
    assert f"interrupted by {name}" in words
    assert read_recording(bag).ticks
    assert rig.processes(scene) == []


def test_a_killed_runner_leaves_no_node(ros_domain, wait_for, rig, tmp_path):
    """kill -9 of the runner: the nodes end by themselves."""
    process, scene, _ = start_run(rig, wait_for, tmp_path)
    process.kill()
    process.communicate(timeout=100)
    wait_for(lambda: not rig.processes(scene))


def test_nothing_is_sent_before_every_node_is_ready(ros_domain, rig, short_scene, tmp_path):
    """The recorder stands while it starts: no state goes out; then it goes on, and all goes out."""
    with Graph(rig.live(short_scene, tmp_path / "bag")) as graph:
        recorder = graph.processes["recorder"]
        recorder.process.send_signal(signal.SIGSTOP)
        reports = graph._progress
        drive = graph.processes["cam_drive"]
        while "follower is ready" not in "".join(drive.stderr_lines):
            time.sleep(0.02)
        assert reports.empty() and not drive.has_ended
        recorder.process.send_signal(signal.SIGCONT)
        assert [report["tick"] for report in graph.progress()][-1] == 160
    assert read_counts(tmp_path / "bag")["/cam/state"] == 161
