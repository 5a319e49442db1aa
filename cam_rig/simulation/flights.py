"""Flights of the follower as its samples show them: lift-offs, and the longest time off the cam."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from cam_rig.arrays import FloatArray

#: A force of zero is a flight where the follower is off the cam by more than this part of the
#: lift; else a follower without preload rests on the cam's dwell.
OFF_THE_CAM = 1e-9


@dataclass
class FlightCount:
    """Counts flights, block after block: times are known to one sample.

    Parameters
    ----------
    least_gap : m; a follower that comes no farther from the cam has not left it

    Examples
    --------
    Two flights, of which the second bounces once:

    >>> import numpy as np
    >>> force = np.array([5.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 0.0, 3.0])
    >>> gap = np.array([0.0, 1.0, 1.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0])
    >>> impulse = np.array([0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0, 0.5])
    >>> count = FlightCount(1e-9)
    >>> count.take(force, gap, impulse, settled=True)
    >>> count.lift_offs, count.longest
    (2, 3)
    """

    least_gap: float
    lift_offs: int = field(default=0, init=False)
    #: Samples of the longest flight, from lift-off or bounce to the next landing.
    longest: int = field(default=0, init=False)
    _length: int = field(default=0, init=False)
    _gap: float = field(default=0.0, init=False)
    _counts: bool = field(default=False, init=False)

    def take(self, force: FloatArray, gap: FloatArray, impulse: FloatArray, settled: bool) -> None:
        """Go on with the next samples ``(n,)``: force (N), follower less cam (m), impulse (N·s).

        A flight is of the step's settled part where it ends there, a lift-off where it is there.
        """
        flying = force == 0.0
        bounced = flying & (impulse > 0.0)
        changes = np.flatnonzero((flying[1:] != flying[:-1]) | bounced[1:]) + 1
        edges = [0, *changes.tolist(), force.size]
        for begin, end in pairwise(edges):
            if not flying[begin]:
                self.end(settled)
                continue
            if bounced[begin]:
                self.end(settled)
            elif not self._length:
                self._counts = settled
            self._length += end - begin
            self._gap = max(self._gap, float(gap[begin:end].max()))

    def end(self, settled: bool) -> None:
        """The follower is on the cam, or the step is over."""
        if self._length and self._gap > self.least_gap:
            self.lift_offs += self._counts
            self.longest = max(self.longest, self._length * settled)
        self._length, self._gap, self._counts = 0, 0.0, False
