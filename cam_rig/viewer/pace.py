"""How often a live picture is sent: as often as a screen shows it, less while a page is behind.

A page takes what it was sent in the order sent, so what it cannot draw in time makes it late. It
is sent fewer pictures of cam and follower then, and larger blocks of curves: nothing is left out
of the curves and the results.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

#: Pictures a second of wall time at most, as a screen shows, and at least.
MAX_RATE, MIN_RATE = 30.0, 0.6
#: A page so much (s) behind, beside the time from picture to picture, is late; one less is not.
LATE_S, IN_TIME_S = 0.8, 0.5
#: Factors of the rate: of a page that is just late, less for one that is later; of one in time.
SLOWER, FASTER = 0.5, 2.0
#: Wall time (s) that a slower rate has to show, and that a page must be in time for a faster one.
SETTLE_S, CALM_S = 2.0, 5.0


class FramePace:
    """How many pictures a second of wall time are worth sending; the newest always is.

    Between 0.6 a second, with which a page begins, and 30: doubled when the page has been in time
    for 5 s, halved or less when it is late. In between the rate stays.

    Parameters
    ----------
    behind : how far (s) the page that shows them is behind, None while it is not known; without
        it every picture that a screen can show is sent
    clock : wall time, s
    """

    def __init__(
        self,
        behind: Callable[[], float | None] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._behind, self._clock = behind, clock
        self._sent = self._changed = self._late = clock()
        #: Pictures a second that are sent now.
        self.rate = MAX_RATE if behind is None else MIN_RATE

    def is_due(self) -> bool:
        """Whether the next picture is to be sent, at the rate that fits the page now."""
        now = self._clock()
        if self._behind is not None:
            self._adapt(self._behind(), now)
        return now - self._sent >= 1.0 / self.rate

    def chosen(self, count: int) -> NDArray[np.intp]:
        """Which of so many pictures to send, evenly among them; the newest always."""
        now = self._clock()
        most = max(1, int((now - self._sent) * self.rate))
        self._sent = now
        return np.unique(np.linspace(count - 1, 0, min(most, count)).astype(np.intp))

    def _adapt(self, behind: float | None, now: float) -> None:
        """Take how far (s) the page is behind now."""
        if behind is None:
            return
        delay = behind - 1.0 / self.rate
        if delay > IN_TIME_S:
            self._late = now
        if delay > LATE_S and now - self._changed >= SETTLE_S:
            self._change(SLOWER * LATE_S / delay, now)
        elif now - max(self._late, self._changed) >= CALM_S:
            self._change(FASTER, now)

    def _change(self, factor: float, now: float) -> None:
        self.rate = min(max(factor * self.rate, MIN_RATE), MAX_RATE)
        self._changed = now
