"""Nodes whose drive leaves without saying that the run is over."""

import pytest

from cam_rig.nodes.run_end import ABSENT_S, POLL_S, DriveAbsence
from cam_rig.runner.node_table import RECORDER

pytestmark = pytest.mark.ros
LONG = int(ABSENT_S / POLL_S) + 1


@pytest.mark.parametrize("name", ["microphone", RECORDER])
def test_a_node_ends_when_the_drive_has_left_without_a_word(make, monkeypatch, capfd, name):
    """It was killed, or the node was suspended while it gave up; not one that was never there,
    nor one that is discovered again."""
    node = make(name)
    absence = DriveAbsence(node)

    def poll(drives, times):
        monkeypatch.setattr(node, "count_publishers", lambda _topic: drives)
        for _ in range(times):
            absence.poll()

    poll(0, 2 * LONG)
    for _ in range(3):
        poll(1, 1)
        poll(0, LONG - 2)
    assert not node.done.done()
    poll(0, 2)
    assert node.done.done()
    assert node.failure is None
    assert "the drive has left without saying that the run is over" in capfd.readouterr().err


def test_a_node_of_which_the_drive_comes_back_waits(make, monkeypatch, tmp_path):
    """With a checkpoint folder it is started again."""
    node = make("microphone")
    node.given["checkpoint"] = str(tmp_path)
    absence = DriveAbsence(node)
    for drives in (1, 0):
        monkeypatch.setattr(node, "count_publishers", lambda _topic, drives=drives: drives)
        for _ in range(3 * LONG):
            absence.poll()
    assert not node.done.done()
