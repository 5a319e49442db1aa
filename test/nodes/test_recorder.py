"""The recorder's end: it takes what is in transit, and does not wait for an endless publisher."""

from itertools import count

import pytest

from cam_rig.bag.files import mcap_files
from cam_rig.bag.split import Split
from cam_rig.nodes.convert import MAX_DRAIN_S, take_rest
from cam_rig.runner.graph import Graph
from cam_rig.runner.node_process import NodeProcess

pytestmark = pytest.mark.ros


class Spinning:
    """Stands in for the executor and the clock: each spin takes its time, and may write one."""

    def __init__(self, writes):
        self.writes, self.written, self.time, self.spins = iter(writes), 0, 0.0, 0

    def spin_once(self, timeout_sec):
        self.time, self.spins = self.time + timeout_sec, self.spins + 1
        self.written += next(self.writes, 0)

    def rest(self):
        take_rest(self.spin_once, lambda: self.written, lambda: self.time)


def test_the_rest_is_taken():
    """Messages with gaps between them, then none: all are written, and the end comes soon."""
    spinning = Spinning([1, 1, 0, 0, 0, 1, 0, 1])
    spinning.rest()
    assert spinning.written == 4 and spinning.spins == 8 + 5


def test_an_endless_publisher_is_not_waited_for():
    """Something to write every 40 ms, for ever: the recorder ends before it is killed."""
    spinning = Spinning(number % 2 for number in count())
    spinning.rest()
    assert MAX_DRAIN_S <= spinning.time < MAX_DRAIN_S + 0.1 < 5.0


def test_a_second_recorder_is_refused_and_disturbs_nothing(
    rig, short_scene, undisturbed, tmp_path, wait_for
):
    """It names the other one and makes no bag; the first one's is that of an undisturbed run."""
    bag, second = tmp_path / "bag", tmp_path / "second"
    with Graph(rig.live(short_scene, bag, pacing="2x")) as graph:
        reports = graph.progress()
        next(report for report in reports if report["tick"] == 4)
        arguments = {"scene": str(short_scene), "bag": str(second)}
        node = NodeProcess("recorder", arguments, False, lambda _line: None)
        for _ in reports:
            pass
        wait_for(lambda: node.has_ended)
    words = "this rig has a recorder already, in ROS domain"
    assert words in node.last_stderr_line()
    assert node.code == 1 and not second.exists()
    assert rig.payloads(bag) == undisturbed


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
