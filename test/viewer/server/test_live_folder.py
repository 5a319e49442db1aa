"""A live picture between two processes: the newest recording alone, and the page's delay."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from cam_rig.errors import CamRigError
from cam_rig.viewer import live_folder
from cam_rig.viewer import page as page_module
from cam_rig.viewer.live_folder import (
    new_recording,
    newest_recording,
    next_part,
    page_delay,
    part_after,
    write_delay,
)


def test_a_run_takes_the_place_of_the_one_before(tmp_path: Path) -> None:
    """The folder has one recording, the newest; what reads the old one has it still open."""
    assert newest_recording(tmp_path) is None
    first = new_recording(tmp_path)
    first.write_bytes(b"one")
    with first.open("rb") as reader:
        second = new_recording(tmp_path)
        second.write_bytes(b"two")
        assert reader.read() == b"one"
    assert second > first
    assert newest_recording(tmp_path) == second
    assert not first.exists()


def test_a_long_run_keeps_its_beginning_and_its_newest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However long: the first part, of which the others are the going on, and some of the last."""
    monkeypatch.setattr(live_folder, "MAX_PART", 10)
    first = part = new_recording(tmp_path)
    assert next_part(part) is None
    for i in range(40):
        part.write_bytes(bytes(9))
        assert next_part(part) is None
        part.write_bytes(bytes([i]) * 10)
        following = next_part(part)
        assert following is not None
        following.touch()
        part = following
        there = sorted(tmp_path.glob("*.rrd"))
        assert there[0] == first == newest_recording(tmp_path)
        assert there[-1] == part
        assert len(there) <= live_folder.KEPT_PARTS + 1
    assert part_after(first) == there[1]
    assert part_after(there[1]) == there[2]
    assert part_after(part) is None
    (other,) = (new_recording(tmp_path),)
    assert part_after(first) is None
    assert not first.exists()
    assert other > first


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    """Its server has ended, or it never was one."""
    with pytest.raises(CamRigError, match="gone: no page reads it"):
        new_recording(tmp_path / "gone")


def test_the_delay_is_the_last_one_written(tmp_path: Path) -> None:
    """Nothing while none is, or it is being written; nothing when the folder is gone."""
    assert page_delay(tmp_path) is None
    write_delay(tmp_path, None)
    assert page_delay(tmp_path) is None
    write_delay(tmp_path, 1.5)
    assert page_delay(tmp_path) == pytest.approx(1.5)
    (tmp_path / live_folder.BEHIND).write_text("")
    assert page_delay(tmp_path) is None
    assert page_delay(tmp_path / "gone") is None


@pytest.mark.parametrize("silent_s", [3.0, 60.0])
def test_a_page_that_hangs_is_later_and_later(tmp_path: Path, silent_s: float) -> None:
    """What it has not reported for longer than it should adds to its delay."""
    write_delay(tmp_path, 0.5)
    then = time.time() - silent_s
    os.utime(tmp_path / live_folder.BEHIND, (then, then))
    late = page_delay(tmp_path)
    assert late is not None
    overdue = silent_s - page_module.REPORT_EVERY_S
    assert 0.5 + overdue <= late + 1e-2 <= 0.5 + overdue + 5.0
