"""How far behind a run a browser's page is: it says once in a while which rig time it shows."""

from __future__ import annotations

import time
from bisect import bisect_left
from collections.abc import Callable
from threading import Event
from urllib.parse import parse_qs

from cam_rig.interrupts import interruptible
from cam_rig.units import NS
from cam_rig.viewer.server.scripts import REPORT_EVERY_S


class PageTime:
    """What pages have said so far; one thread says it, another asks.

    Parameters
    ----------
    clock : wall time, s
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._open = clock, Event()
        self._driven, self._when = list[float](), list[float]()
        self._reported: tuple[float, float] | None = None
        #: The longest delay (s) that a page has reported; None before the first.
        self.longest: float | None = None

    def take(self, query: str) -> None:
        """What a page asked: ``ns=…``, its rig time; anything else is passed over."""
        (words, *_) = parse_qs(query).get("ns", [""])
        try:
            shown = int(words) / NS
        except ValueError:
            return
        self._open.set()
        if shown < 0.0 or not self._driven:
            return
        at, now = bisect_left(self._driven, shown), self._clock()
        late = 0.0 if at == len(self._driven) else now - self._when[at]
        self._reported, self.longest = (now, late), max(late, self.longest or 0.0)

    @interruptible
    def wait(self) -> None:
        """Wait until a page shows the viewer."""
        self._open.wait()

    def driven(self, rig_time: float) -> None:
        """The drive has come to a rig time (s) now."""
        self._when.append(self._clock())  # first, for another thread looks it up by the other
        self._driven.append(rig_time)

    def behind(self) -> float | None:
        """Wall time (s) since the drive was where the page is; None while neither is known.

        As the page has reported last; a report that is overdue adds to it.

        Examples
        --------
        >>> wall = iter([10.0, 11.0, 11.5, 12.0, 15.0])
        >>> page = PageTime(lambda: next(wall))
        >>> page.driven(2.0), page.driven(3.0), page.take("ns=2000000000")
        (None, None, None)
        >>> page.behind(), page.behind()
        (1.5, 4.0)
        """
        if self._reported is None:
            return None
        when, late = self._reported
        return late + max(0.0, self._clock() - when - REPORT_EVERY_S)
