"""Map of a turn, from the state of the follower at cam angle 0 to the state one turn later.

The state of one mass is the gap and its rate. Two masses have two more numbers, the stretch of the
stem between them and its rate. Between two landings the motion is known in closed form, and a
landing is a root, so the map and its derivative are exact to rounding.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cam_rig.dynamics.events.backend import dispatch
from cam_rig.dynamics.events.contact import StemVibration
from cam_rig.dynamics.events.law_table import CamMotion
from cam_rig.dynamics.events.run_table import RUN_STATE, RunMode
from cam_rig.dynamics.events.runs import compute_stem_stretch, start_flight
from cam_rig.dynamics.events.trajectory import EndlessEventsError, record_of
from cam_rig.dynamics.events.turns import TURN_RESULT, run_turns
from cam_rig.dynamics.free_masses import TwoMassParameters
from cam_rig.dynamics.interval import FollowerState, Interval
from cam_rig.dynamics.one_mass import OneMassTrajectory
from cam_rig.dynamics.parameters import FollowerParameters, require_number, require_turning
from cam_rig.dynamics.two_mass import Separation
from cam_rig.dynamics.velocity_jumps import require_continuous, short_of_velocity_jump
from cam_rig.laws import Law
from cam_rig.units import NS, TURN, FloatArray

#: Room for phases in one call of the search.
ROOM = 64
#: Turns per call, after which the backend is selected again.
TURNS_PER_CALL = 100
#: The follower on the cam: no gap, and no gap rate.
ON_THE_CAM = (0.0, 0.0)
#: The numbers at cam angle 0, SI, two of one mass and four of two.
State = tuple[float, ...]


@dataclass(frozen=True, eq=False)
class TurnsRun:
    """Results of successive turns of a follower with n numbers."""

    records: NDArray[np.void]  #: records of `cam_rig.dynamics.events.turns.TURN_RESULT`
    size: int  #: n

    @property
    def states(self) -> FloatArray:
        """Gap (m) and its rate (m/s) at the end of each turn, ``(turns, n)``.

        For two masses also the stretch of the stem (m) and its rate (m/s).
        """
        return self._columns("state")

    @property
    def is_flying(self) -> FloatArray:
        """1 if the follower is in flight at the end of the turn, else 0, ``(turns,)``."""
        return np.asarray(self.records["is_flying"], dtype=np.float64)

    @property
    def landings(self) -> FloatArray:
        """Landings of each turn, ``(turns,)``."""
        return np.asarray(self.records["landings"], dtype=np.float64)

    @property
    def max_landing_speeds(self) -> FloatArray:
        """Speed (m/s) against the cam of the fastest landing, ``(turns,)``; 0 without a landing."""
        return np.asarray(self.records["max_landing_speed"])

    @property
    def min_landing_speeds(self) -> FloatArray:
        """Speed (m/s) of the slowest landing, ``(turns,)``; infinite without a landing."""
        return np.asarray(self.records["min_landing_speed"])

    @property
    def contact_times(self) -> FloatArray:
        """Time (s) of contact in each turn, ``(turns,)``."""
        return np.asarray(self.records["contact_time"])

    @property
    def growth(self) -> FloatArray:
        """Logarithm of the growth of n directions in each turn, ``(turns, n)``.

        Their sum is the logarithm of the contraction of volumes: r² per landing, and the share of
        the dampers. A turn with contact has two of −∞, because the contact mass is not free there.
        """
        return self._columns("growth")

    @property
    def derivatives(self) -> FloatArray:
        """Derivative of each turn's last state by its first, ``(turns, n, n)``."""
        return np.ascontiguousarray(self.records["derivative"][:, : self.size, : self.size])

    def derivative(self) -> FloatArray:
        """Return the derivative of the last state by the first one, ``(n, n)``."""
        product = np.eye(self.size)
        for turn in self.derivatives:
            product = turn @ product
        return product

    def _columns(self, name: str) -> FloatArray:
        """Return the first n numbers of a field, ``(turns, n)``."""
        return np.ascontiguousarray(self.records[name][:, : self.size])


class StroboscopicMap:
    """Map of one rigid mass, or of two on an elastic stem, from cam angle 0 on.

    The parameters have a restitution. The speed (rad/s) is the same in all turns.
    """

    def __init__(
        self, law: Law, parameters: FollowerParameters | TwoMassParameters, speed: float
    ) -> None:
        require_turning(speed)
        require_continuous(law)
        self.law, self.parameters, self.speed = law, parameters, float(speed)
        # A velocity jump at angle 0 belongs to the next turn: this one ends a rounding before it.
        self.duration = short_of_velocity_jump(law, TURN) / self.speed
        self._trajectory: Separation | OneMassTrajectory
        if isinstance(parameters, TwoMassParameters):
            self.size, self._trajectory = 4, Separation(law, parameters, speed)
        else:
            interval = Interval(0, max(1, round(NS * self.duration)), 0.0, speed)
            self.size, self._trajectory = 2, OneMassTrajectory(law, parameters, interval)
        self._table = self._trajectory.run_table(self.duration)

    @property
    def scale(self) -> FloatArray:
        """Sizes of the numbers of a state, ``(n,)``; for the stem its stretch by all forces."""
        p, (lift, slope, curvature) = self.parameters, self.law.bounds
        sizes = [self.law.lift, self.law.lift * self.speed]
        if isinstance(p, TwoMassParameters):
            force = (p.roller_mass + p.end_mass) * curvature * self.speed**2 + p.preload
            force += p.damping * slope * self.speed + p.spring_stiffness * lift
            most = force / p.stem_stiffness
            sizes += [most, most * math.sqrt(p.stiffness / p.end_mass)]
        return np.array(sizes)

    def run(self, turns: int, state: State = ON_THE_CAM) -> TurnsRun:
        """Run turns from a state as in `TurnsRun.states`, by default from the cam.

        A gap and a rate alone describe two masses whose end mass follows the turning cam.

        Raises
        ------
        EndlessEventsError : a turn has more landings than any series that ends
        """
        first = self._begin(state)
        # The directions of the end mass first: they remain on the cam.
        frame = np.roll(np.eye(self.size), 2, axis=0)[: self.size - 1]
        records, done = np.zeros(turns, TURN_RESULT), 0
        while done < turns:
            part = records[done : done + TURNS_PER_CALL]
            if self._turn(first, frame, part) < len(part):
                raise EndlessEventsError(
                    f"more than {self._trajectory.max_events} landings in a turn at "
                    f"{self.speed:g} rad/s; allowed: {self._trajectory.max_events}"
                )
            done += len(part)
        records.setflags(write=False)
        return TurnsRun(records, self.size)

    def follower(self, state: State) -> FollowerState:
        """Return the state of the follower at cam angle 0, as its model takes it."""
        first = self._begin(state)[0]
        flies = first["mode"] == RunMode.FLIGHT
        place, velocity = (a + b for a, b in zip(self._cam(), state, strict=False))
        stem = first["vector"][: 4 if flies else 2] if self.size == 4 else []
        known = state[:2] if flies else ()
        return FollowerState(place, velocity, 0.0, not flies, inner=(*stem, *known))

    def _cam(self) -> tuple[float, float]:
        """Return s (m) and ṡ (m/s) at the start of a turn, before a velocity jump at angle 0."""
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
        rest = compute_stem_stretch(run, StemVibration(0.0, 0.0), CamMotion(s, velocity, 0.0))
        w, rate = stem or rest
        if flies:
            y = s + gap + run.end_share * w, velocity + opening + run.end_share * rate
            vector[:] = w, rate, *y
        else:
            vector[:2] = w - rest.length, rate - rest.rate
        return records

    def _turn(self, state: NDArray[np.void], frame: FloatArray, turns: NDArray[np.void]) -> int:
        """Fill records of turns from a state, which is updated; return the number filled."""
        max_landings = float(self._trajectory.max_events)
        record = record_of(state, ROOM)
        return int(dispatch(run_turns, self._table, record, frame, turns, max_landings))
