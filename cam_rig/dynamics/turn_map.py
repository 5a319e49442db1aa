"""The map of a turn: from the follower at cam angle 0 to where it is a turn later.

One mass is two numbers, the gap and its rate; two masses are two more, the stretch of the stem
between them and its rate. Between two landings the motion is known in closed form and a landing is
a root, so the map and its derivative are exact to rounding: nothing is stepped and nothing is read
off a time series.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cam_rig.dynamics.events import turns as kernel
from cam_rig.dynamics.events.backend import dispatch
from cam_rig.dynamics.events.contact import Vibration
from cam_rig.dynamics.events.law_table import CamMotion
from cam_rig.dynamics.events.run_table import RUN_STATE, Mode
from cam_rig.dynamics.events.runs import compute_stem_stretch, start_flight
from cam_rig.dynamics.events.trajectory import EndlessEventsError, record_of
from cam_rig.dynamics.free_masses import TwoMassParameters
from cam_rig.dynamics.interval import FollowerState, Interval
from cam_rig.dynamics.one_mass import OneMassTrajectory
from cam_rig.dynamics.parameters import FollowerParameters, require_number, require_turning
from cam_rig.dynamics.two_mass import Separation
from cam_rig.dynamics.velocity_jumps import require_continuous, short_of_velocity_jump
from cam_rig.laws import Law
from cam_rig.units import NS, TURN, FloatArray

#: Phases that one call of the search may find, and turns that are run before the search is asked
#: again whether it is compiled by now.
ROOM, CHUNK = 64, 100
#: The follower on the cam: no gap, and none that opens.
ON_THE_CAM = (0.0, 0.0)
#: The numbers at cam angle 0, SI, two of one mass and four of two.
State = tuple[float, ...]


@dataclass(frozen=True, eq=False)
class TurnsRun:
    """What turns gave, in order, of a follower that is n numbers."""

    rows: FloatArray  #: ``(turns, 5 + 2 n + n²)``, as in `cam_rig.dynamics.events.turns`
    size: int  #: n

    @property
    def states(self) -> FloatArray:
        """``(turns, n)`` gap (m) and the speed at which it opens (m/s) at each turn's end.

        Of two masses the stretch of the stem (m) and its rate (m/s) too.
        """
        return self.rows[:, kernel.ENDS : kernel.ENDS + self.size]

    @property
    def flies(self) -> FloatArray:
        """``(turns,)`` 1 where the follower is in the air at the turn's end, else 0."""
        return self.rows[:, kernel.FLIES]

    @property
    def landings(self) -> FloatArray:
        """``(turns,)`` landings of each turn."""
        return self.rows[:, kernel.LANDINGS]

    @property
    def hardest(self) -> FloatArray:
        """``(turns,)`` speed (m/s) against the cam of the fastest landing; 0 without one."""
        return self.rows[:, kernel.HARDEST]

    @property
    def softest(self) -> FloatArray:
        """``(turns,)`` that of its slowest landing; infinite without one."""
        return self.rows[:, kernel.SOFTEST]

    @property
    def on_cam(self) -> FloatArray:
        """``(turns,)`` seconds of contact in each turn."""
        return self.rows[:, kernel.ON_CAM]

    @property
    def growth(self) -> FloatArray:
        """``(turns, n)`` logarithm by which each of n directions of change grows in a turn.

        Their sum is the logarithm of the contraction of volumes: r² a landing, and what dampers
        take. A turn with contact has two of −∞: what meets the cam has no freedom there.
        """
        return self.rows[:, kernel.ENDS + self.size : kernel.ENDS + 2 * self.size]

    @property
    def derivatives(self) -> FloatArray:
        """``(turns, n, n)`` derivative of each turn's end by its beginning, SI."""
        return self.rows[:, kernel.ENDS + 2 * self.size :].reshape(-1, self.size, self.size)

    def derivative(self) -> FloatArray:
        """``(n, n)``: that of the last end by the first beginning."""
        product = np.eye(self.size)
        for one in self.derivatives:
            product = one @ product
        return product


class StroboscopicMap:
    """One rigid mass, or two on an elastic stem, turn after turn from cam angle 0.

    The parameters have a restitution; the speed (rad/s) is one for all turns.
    """

    def __init__(
        self, law: Law, parameters: FollowerParameters | TwoMassParameters, speed: float
    ) -> None:
        require_turning(speed)
        require_continuous(law)
        self.law, self.parameters, self.speed = law, parameters, float(speed)
        # A velocity jump at angle 0 is the next turn's: this one ends a rounding before it.
        self.duration = short_of_velocity_jump(law, TURN) / self.speed
        self._course: Separation | OneMassTrajectory
        if isinstance(parameters, TwoMassParameters):
            self.size, self._course = 4, Separation(law, parameters, speed)
        else:
            interval = Interval(0, max(1, round(NS * self.duration)), 0.0, speed)
            self.size, self._course = 2, OneMassTrajectory(law, parameters, interval)
        self._table = self._course.run_table(self.duration)

    @property
    def scale(self) -> FloatArray:
        """``(n,)`` sizes of a state's numbers; of the stem's what all forces together make."""
        p, (lift, slope, curvature) = self.parameters, self.law.bounds
        sizes = [self.law.lift, self.law.lift * self.speed]
        if isinstance(p, TwoMassParameters):
            force = (p.roller_mass + p.end_mass) * curvature * self.speed**2 + p.preload
            force += p.damping * slope * self.speed + p.spring_stiffness * lift
            most = force / p.stem_stiffness
            sizes += [most, most * math.sqrt(p.stiffness / p.end_mass)]
        return np.array(sizes)

    def run(self, turns: int, state: State = ON_THE_CAM) -> TurnsRun:
        """So many turns from a state as `TurnsRun.states` has it; by default on the cam.

        A gap and a rate alone are of two masses whose end mass goes with the turning cam. A turn
        with more landings than any series has that dies out is an `EndlessEventsError`.
        """
        now = self._begin(state)
        # The end mass's directions first: those that are left on the cam.
        frame = np.roll(np.eye(self.size), 2, axis=0)[: self.size - 1]
        rows, begun = np.zeros((turns, kernel.ENDS + self.size * (2 + self.size))), 0
        while begun < turns:
            part = rows[begun : begun + CHUNK]
            if self._turn(now, frame, part) < len(part):
                raise EndlessEventsError(
                    f"more than {self._course.most_events} landings in a turn at "
                    f"{self.speed:g} rad/s; allowed: {self._course.most_events}"
                )
            begun += len(part)
        rows.setflags(write=False)
        return TurnsRun(rows, self.size)

    def follower(self, state: State) -> FollowerState:
        """The follower at cam angle 0, as its model takes it."""
        first = self._begin(state)[0]
        flies = first["mode"] == Mode.FLIGHT
        place, velocity = (a + b for a, b in zip(self._cam(), state, strict=False))
        stem = first["vector"][: 4 if flies else 2] if self.size == 4 else []
        known = state[:2] if flies else ()
        return FollowerState(place, velocity, 0.0, not flies, inner=(*stem, *known))

    def _cam(self) -> tuple[float, float]:
        """S (m) and ṡ (m/s) where a turn begins, before a velocity jump at angle 0."""
        s, slope = self.law.motion[:2, -1, -1].tolist()
        return s, slope * self.speed

    def _begin(self, state: State) -> NDArray[np.void]:
        gap, opening, *stem = state
        require_number("gap", gap, "≥ 0")
        require_number("opening", opening, "of either sign")
        records, (s, velocity) = np.zeros(1, RUN_STATE), self._cam()
        vector, flies = records[0]["vector"], (gap, opening) != ON_THE_CAM
        if flies:
            vector[:2] = s + gap, velocity + opening
            start_flight(records[0], True, gap, opening)
        if self.size == 2:
            return records
        run = self._table
        rest = compute_stem_stretch(run, Vibration(0.0, 0.0), CamMotion(s, velocity, 0.0))
        w, rate = stem or rest
        if flies:
            y = s + gap + run.end_share * w, velocity + opening + run.end_share * rate
            vector[:] = w, rate, *y
        else:
            vector[:2] = w - rest.length, rate - rest.rate
        return records

    def _turn(self, now: NDArray[np.void], frame: FloatArray, rows: FloatArray) -> int:
        """Fill the rows from a place that goes on."""
        most = float(self._course.most_events)
        return int(dispatch(kernel.run_turns, self._table, record_of(now, ROOM), frame, rows, most))
