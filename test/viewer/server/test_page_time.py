"""How far a page is behind the drive, in wall time, from what both have said."""

from __future__ import annotations

from threading import Thread

import pytest

from cam_rig.viewer import page as page_time
from cam_rig.viewer.page import PageTime


class Wall:
    """A clock that a test sets."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.mark.parametrize("factor", [0.5, 1.0, 20.0])
def test_the_delay_is_wall_time_at_any_pace(factor: float) -> None:
    """A page that shows what the drive did a second ago is a second behind, however fast it is."""
    wall = Wall()
    page = PageTime(wall)
    for i in range(40):
        wall.now = 0.25 * i
        page.driven(factor * wall.now)
        if i >= 4:
            page.take(f"ns={round(factor * (wall.now - 1.0) * 1e9)}")
            assert page.behind() == pytest.approx(1.0)
    assert page.longest == pytest.approx(1.0)


def test_a_page_that_shows_nothing_is_not_late() -> None:
    """It is open, but has no rig time; nor has one whose words are none."""
    page = PageTime()
    page.driven(1.0)
    page.take("ns=-1")
    waiting = Thread(target=page.wait, daemon=True)
    waiting.start()
    waiting.join(timeout=60)
    assert not waiting.is_alive()
    for words in ("", "ns=", "ns=x", "other=3"):
        page.take(words)
    assert page.behind() is None


def test_a_page_ahead_of_the_last_report_is_not_behind() -> None:
    """The drive reports now and then; what it has not reported yet may be shown already."""
    page = PageTime(Wall())
    page.driven(1.0)
    page.take("ns=2000000000")
    assert page.behind() == 0.0


def test_an_overdue_report_counts() -> None:
    """A page that hangs says nothing: its delay grows all the same."""
    wall = Wall()
    page = PageTime(wall)
    page.driven(1.0)
    wall.now = 0.5
    page.take("ns=500000000")
    wall.now += page_time.REPORT_EVERY_S
    assert page.behind() == pytest.approx(0.5)
    wall.now += 7.0
    assert page.behind() == pytest.approx(7.5)
