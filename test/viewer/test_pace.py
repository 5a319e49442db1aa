"""How much is sent to a page that can draw so much: never late for long, never needlessly slow."""

from __future__ import annotations

import numpy as np
import pytest

from cam_rig.viewer.timeline import (
    CALM_S,
    IN_TIME_S,
    LATE_S,
    MAX_RATE,
    MIN_RATE,
    SETTLE_S,
    FramePace,
)

STEP_S = 0.25


class Page:
    """A page that draws so many pictures a second, its clock, and what waits for it."""

    def __init__(self, speed: float) -> None:
        self.speed, self.now, self.waiting = speed, 0.0, 0.0
        self.pace = FramePace(self.behind, lambda: self.now)

    def behind(self) -> float:
        return self.waiting / self.speed

    def go_on(self) -> None:
        """So many pictures come in a step of wall time, and so many are drawn."""
        self.now += STEP_S
        if self.pace.is_due():
            self.waiting += self.pace.chosen(1000).size
        self.waiting = max(0.0, self.waiting - self.speed * STEP_S)


@pytest.mark.parametrize("speed", [1.5, 3.0, 7.0, 20.0])
def test_a_slow_page_is_never_late_for_long(speed: float) -> None:
    """Whatever it can draw: two seconds at most in a quarter of an hour; and it is used."""
    page, late, rates = Page(speed), 0.0, list[float]()
    for _ in range(int(900 / STEP_S)):
        page.go_on()
        late = max(late, page.behind())
        rates.append(page.pace.rate)
    assert late <= 2.0 + STEP_S
    assert min(rates) >= MIN_RATE and max(rates) <= MAX_RATE
    assert np.mean(rates) >= 0.5 * speed


def test_a_page_that_becomes_slower_is_sent_less_and_more_again() -> None:
    """Another program takes its time away for a minute; two pictures a second are left."""
    page = Page(60.0)
    slow = dict.fromkeys(range(60, 120), 2.0)
    rates = {}
    for i in range(int(240 / STEP_S)):
        page.speed = slow.get(int(i * STEP_S), 60.0)
        page.go_on()
        rates[i * STEP_S] = page.pace.rate
    assert rates[59.0] == MAX_RATE
    assert max(rate for at, rate in rates.items() if 80.0 < at < 120.0) <= 5.0
    assert rates[239.0] == MAX_RATE


def test_between_late_and_in_time_the_rate_stays() -> None:
    """A page that is neither is left alone, however long."""
    now = [0.0]
    pace = FramePace(lambda: 0.5 * (LATE_S + IN_TIME_S) + 1.0 / MIN_RATE, lambda: now[0])
    for now[0] in np.arange(0.0, 20.0 * CALM_S, 0.25):
        pace.is_due()
        assert pace.rate == MIN_RATE


def test_a_late_page_is_given_time_to_show_a_slower_rate() -> None:
    """Its delay is of what was sent before: once it is late, the rate falls once per while."""
    page = Page(60.0)
    while page.pace.rate < MAX_RATE:
        page.go_on()
    page.waiting = 60.0 * (LATE_S + 0.5)
    page.speed, changes = 60.0, list[tuple[float, float]]()
    for _ in range(int(SETTLE_S / STEP_S)):
        before = page.pace.rate
        page.go_on()
        page.waiting = 60.0 * (LATE_S + 0.5)
        if page.pace.rate != before:
            changes.append((before, page.pace.rate))
    assert len(changes) == 1
    assert changes[0][1] <= 0.5 * changes[0][0]


@pytest.mark.parametrize("answer", [None, "nobody"])
def test_where_nobody_knows_the_delay_the_rate_stays(answer: str | None) -> None:
    """A page that shows nothing yet keeps its first rate; a window gets every picture."""
    now = [0.0]
    pace = FramePace(None if answer else lambda: None, lambda: now[0])
    first = pace.rate
    for now[0] in np.arange(0.0, 100.0, 0.25):
        pace.is_due()
    assert pace.rate == first == (MAX_RATE if answer else MIN_RATE)


def test_no_more_pictures_are_sent_than_a_screen_shows() -> None:
    """Of many as many as fit into the time since the last, evenly, the newest always."""
    now = iter([0.0, 0.1, 0.1, 10.0])
    pace = FramePace(None, lambda: next(now))
    assert pace.chosen(100).size == 3
    assert pace.chosen(100).tolist() == [99]
    assert pace.chosen(100).tolist() == list(range(100))
