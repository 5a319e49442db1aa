"""The map of a turn: from the gap and its rate at cam angle 0 to those a turn later.

Between two landings the motion is known in closed form and a landing is a root, so the map and its
derivative are exact to rounding: nothing is stepped and nothing is read off a time series.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from cam_rig.dynamics.events import law_table as at
from cam_rig.dynamics.events import turns as kernel
from cam_rig.dynamics.events.course import EndlessEventsError
from cam_rig.dynamics.events.law_table import RunRecord
from cam_rig.dynamics.events.rows import zero_rows, zeros
from cam_rig.dynamics.events.runs import RunTable
from cam_rig.dynamics.events.search import form_of, plain_time
from cam_rig.dynamics.interval import Interval
from cam_rig.dynamics.one_mass import OneMassTrajectory
from cam_rig.dynamics.parameters import FollowerParameters, require_number, require_turning
from cam_rig.dynamics.velocity_jumps import short_of_velocity_jump
from cam_rig.laws import Law
from cam_rig.units import NS, TURN, FloatArray

#: Phases that one call of the search may find, and turns that are run before the search is asked
#: again whether it is compiled by now.
ROOM, CHUNK = 64, 100
#: The follower on the cam: no gap, and none that opens.
ON_THE_CAM = (0.0, 0.0)


@dataclass(frozen=True, eq=False)
class TurnsRun:
    """What n turns gave, in order."""

    rows: FloatArray  #: ``(n, 15)``, as in `cam_rig.dynamics.events.turns`

    @property
    def states(self) -> FloatArray:
        """``(n, 2)`` gap (m) and the speed at which it opens (m/s) at each turn's end."""
        return self.rows[:, kernel.ENDS : kernel.ENDS + 2]

    @property
    def flies(self) -> FloatArray:
        """``(n,)`` 1 where the follower is in the air at the turn's end, else 0."""
        return self.rows[:, kernel.FLIES]

    @property
    def landings(self) -> FloatArray:
        """``(n,)`` landings of each turn."""
        return self.rows[:, kernel.LANDINGS]

    @property
    def hardest(self) -> FloatArray:
        """``(n,)`` speed (m/s) against the cam of each turn's fastest landing; 0 without one."""
        return self.rows[:, kernel.HARDEST]

    @property
    def softest(self) -> FloatArray:
        """``(n,)`` that of its slowest landing; infinite without one."""
        return self.rows[:, kernel.SOFTEST]

    @property
    def on_cam(self) -> FloatArray:
        """``(n,)`` seconds of contact in each turn."""
        return self.rows[:, kernel.ON_CAM]

    @property
    def growth(self) -> FloatArray:
        """``(n, 2)`` logarithm by which each of two directions of change grows in a turn.

        Their sum is the logarithm of the contraction of areas, r² a landing and e^{−cT/m}; −∞ for
        a turn with contact, in which every change dies out.
        """
        return self.rows[:, kernel.GROWTH : kernel.GROWTH + 2]

    @property
    def derivatives(self) -> FloatArray:
        """``(n, 2, 2)`` derivative of each turn's end by its beginning, SI."""
        return self.rows[:, kernel.DERIVATIVE :].reshape(-1, 2, 2)

    def derivative(self) -> FloatArray:
        """``(2, 2)``: that of the last end by the first beginning."""
        product = np.eye(2)
        for one in self.derivatives:
            product = one @ product
        return product


class StroboscopicMap:
    """One rigid mass on a law at one cam speed, turn after turn from cam angle 0.

    Parameters
    ----------
    law : the cam's
    parameters : with a restitution
    speed : of the cam, rad/s

    Raises
    ------
    DynamicsError : a speed that is none
    """

    def __init__(self, law: Law, parameters: FollowerParameters, speed: float) -> None:
        require_turning(speed)
        self.law, self.parameters, self.speed = law, parameters, speed
        # A velocity jump at angle 0 is the next turn's: this one ends a rounding before it.
        self.duration = short_of_velocity_jump(law, TURN) / speed
        interval = Interval(0, max(1, round(NS * self.duration)), 0.0, speed)
        self._course = OneMassTrajectory(law, parameters, interval)
        self._table = lru_cache(self._made)

    def _made(self, arrays: bool) -> RunTable:
        return self._course.run_table(self.duration, arrays)

    def run(self, turns: int, state: tuple[float, float] = ON_THE_CAM) -> TurnsRun:
        """So many turns from a gap (m) and its rate (m/s); without either, from the cam.

        Raises
        ------
        EndlessEventsError : a turn with more landings than any series has that dies out
        DynamicsError : a start below the cam
        """
        now, frame = self._begin(*state), [1.0, 0.0]
        rows, begun = np.zeros((turns, kernel.TURN_SIZE)), 0
        while begun < turns:
            part = rows[begun : begun + CHUNK]
            if self._turn(now, frame, part) < len(part):
                raise EndlessEventsError(
                    f"more than {self._course.most_events} landings in a turn at "
                    f"{self.speed:g} rad/s; allowed: {self._course.most_events}"
                )
            begun += len(part)
        rows.setflags(write=False)
        return TurnsRun(rows)

    def _begin(self, gap: float, opening: float) -> list[float]:
        require_number("gap", gap, "≥ 0")
        require_number("opening", opening, "of either sign")
        now = [0.0] * (at.STATE + 2)
        if (gap, opening) != ON_THE_CAM:
            # A turn begins before a velocity jump at angle 0: left limits.
            s, slope = self.law.motion[:2, -1, -1]
            now[at.STATE :] = [float(s) + gap, float(slope) * self.speed + opening]
            at.fly_from(now, True, gap, opening)
        return now

    def _turn(self, now: list[float], frame: list[float], rows: FloatArray) -> int:
        """Fill the rows ``(n, 15)`` from a place that goes on, plain or compiled."""
        most, compiled = float(self._course.most_events), form_of(kernel.run_turns)
        if compiled is None:
            phases, events = zero_rows(ROOM, at.PHASE_SIZE), zero_rows(2 * ROOM, at.EVENT_SIZE)
            lists = rows.tolist()
            with plain_time():
                record = RunRecord(now, phases, events, zeros(2))
                done = kernel.run_turns(self._table(False), record, frame, lists, most)
            rows[:] = lists
            return done
        place, turned = np.array(now), np.array(frame)
        made = np.empty((ROOM, at.PHASE_SIZE)), np.empty((2 * ROOM, at.EVENT_SIZE))
        numbers: Any = (place, *made, np.zeros(2))
        found: int = compiled(self._table(True), RunRecord(*numbers), turned, rows, most)
        now[:], frame[:] = place.tolist(), turned.tolist()
        return found
