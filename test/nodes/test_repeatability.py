"""One scene gives one bag: undisturbed, killed and started again, stalled, or stopped."""

import signal
import threading
import time

import pytest

pytestmark = pytest.mark.ros


def assert_same(found, expected):
    assert found.keys() == expected.keys()
    for topic, messages in expected.items():
        assert len(found[topic]) == len(messages), topic
        assert found[topic] == messages, topic


@pytest.mark.long  # as the stalled run shows too
def test_two_runs_are_equal_byte_by_byte(ros_domain, rig, short_scene, undisturbed, tmp_path):
    """Every payload on every topic, in order: nothing depends on scheduling."""
    rig.run(short_scene, tmp_path / "bag")
    assert len(undisturbed) == 11
    assert_same(rig.payloads(tmp_path / "bag"), undisturbed)


def test_killed_nodes_are_started_again_and_leave_no_trace(
    ros_domain, rig, short_scene, undisturbed, tmp_path
):
    """kill -9 of each node in turn: the bag is the undisturbed one, and /dev/shm is left clean."""
    victims = ["follower", "microphone", "law_server", "cam_drive", "recorder"]
    killed, logged, names, before = [], [], set(), rig.unused()

    def kill(graph, tick):
        alive = not any(node.has_ended for node in graph.processes.values())
        if tick > 6 and victims and alive and len(logged) == len(killed):
            names.update(rig.mapped(*(node.process.pid for node in graph.processes.values())))
            killed.append(victims.pop(0))
            graph.processes[killed[-1]].process.kill()
            graph.processes[killed[-1]].process.wait(timeout=100)

    rig.run(short_scene, tmp_path / "bag", kill, respawn=True, logged=logged)
    assert [line.split()[1] for line in logged] == killed
    assert len(killed) == 5
    assert all("was ended by signal 9 after tick" in line for line in logged)
    assert_same(rig.payloads(tmp_path / "bag"), undisturbed)
    assert len(names) > 10
    assert (rig.unused() - before) & names == set()


@pytest.mark.long
def test_a_recorder_killed_after_the_drives_end_changes_no_message(
    ros_domain, rig, short_scene, undisturbed, tmp_path
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
@pytest.mark.parametrize(
    "victims", [("follower", "cam_drive"), ("recorder", "follower", "microphone")]
)
def test_a_second_node_is_killed_while_the_first_returns(
    ros_domain, wait_for, rig, short_scene, undisturbed, tmp_path, victims
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


def resident_mb(process):
    with open(f"/proc/{process.pid}/status", encoding="utf-8") as lines:
        return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS")) / 1024


def test_a_stalled_consumer_holds_all_and_loses_nothing(
    ros_domain, rig, short_scene, undisturbed, tmp_path
):
    """The slowest consumer is suspended for 5 s: no node's memory grows, then it goes on."""
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
