"""Map of the follower's state at cam angle 0 to the state one turn later.

The state of a follower of one mass is the gap to the cam and its rate. Two masses have two more
numbers, the stretch of the stem between them and its rate. Between two landings the motion is known
in closed form, and a landing is a root of an equation. The map and its derivative are therefore
exact to rounding. They determine if the follower bounces periodically, and if such a motion is
stable.
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
from cam_rig.dynamics.events.trajectory import EndlessEventsError, new_record
from cam_rig.dynamics.events.turns import TURN_RESULT, run_turns
from cam_rig.dynamics.free_masses import TwoMassParameters
from cam_rig.dynamics.interval import FollowerState, Interval
from cam_rig.dynamics.one_mass import OneMassTrajectory
from cam_rig.dynamics.parameters import FollowerParameters, require_number, require_turning
from cam_rig.dynamics.two_mass import Separation
from cam_rig.dynamics.velocity_jumps import require_continuous, step_before_velocity_jump
from cam_rig.laws import Law
from cam_rig.units import NS, TURN, FloatArray

#: Largest number of phases (contact or flight) that the event search records at once.
MAX_PHASES = 64
#: Number of turns per call of the event search. After each call plain Python or compiled code is
#: selected again.
TURNS_PER_CALL = 100
#: State of a follower on the cam: gap 0 m and gap rate 0 m/s.
ON_THE_CAM = (0.0, 0.0)
#: State of a follower at cam angle 0: the gap to the cam (m) and its rate (m/s), for two masses
#: also the stretch of the stem (m) and its rate (m/s).
State = tuple[float, ...]


@dataclass(frozen=True, eq=False)
class TurnsRun:
    """Results of successive turns of a follower whose state has n numbers.

    n is 2 for one mass and 4 for two masses.
    """

    #: One record per turn, of the type `cam_rig.dynamics.events.turns.TURN_RESULT`.
    records: NDArray[np.void]
    size: int  #: number n of numbers in a state

    @property
    def states(self) -> FloatArray:
        """State of the follower at the end of each turn, ``(turns, n)``.

        It is the gap to the cam (m) and its rate (m/s). Two masses also have the stretch of the
        stem (m) and its rate (m/s).
        """
        return self._columns("state")

    @property
    def is_flying(self) -> FloatArray:
        """1 if the follower is in flight at the end of the turn, else 0, ``(turns,)``."""
        return np.asarray(self.records["is_flying"], dtype=np.float64)

    @property
    def landings(self) -> FloatArray:
        """Number of landings in each turn, ``(turns,)``."""
        return np.asarray(self.records["landings"], dtype=np.float64)

    @property
    def max_landing_speeds(self) -> FloatArray:
        """Speed of the fastest landing relative to the cam, m/s, ``(turns,)``.

        It is 0 in a turn without a landing.
        """
        return np.asarray(self.records["max_landing_speed"])

    @property
    def min_landing_speeds(self) -> FloatArray:
        """Speed of the slowest landing relative to the cam, m/s, ``(turns,)``.

        It is infinite in a turn without a landing.
        """
        return np.asarray(self.records["min_landing_speed"])

    @property
    def contact_times(self) -> FloatArray:
        """Duration of contact in each turn, s, ``(turns,)``."""
        return np.asarray(self.records["contact_time"])

    @property
    def growth(self) -> FloatArray:
        """Logarithms of the growth of n perturbations in each turn, ``(turns, n)``.

        Their means over many turns are the Lyapunov exponents per turn. The sum of the n numbers is
        the logarithm of the change of a volume of states. A landing with restitution r contributes
        the factor r² to this change, and the dampers contribute the rest. In a turn with contact
        two logarithms are −∞, because the contact mass cannot move freely on the cam.
        """
        return self._columns("growth")

    @property
    def derivatives(self) -> FloatArray:
        """Derivative of the follower's state after each turn by that before it.

        The shape is ``(turns, n, n)`` for states with n numbers.
        """
        return np.ascontiguousarray(self.records["derivative"][:, : self.size, : self.size])

    def derivative(self) -> FloatArray:
        """Return the derivative of the last state of the run by its first, ``(n, n)``.

        It is the product of the derivatives of all turns.
        """
        product = np.eye(self.size)
        for turn in self.derivatives:
            product = turn @ product
        return product

    def _columns(self, name: str) -> FloatArray:
        """Return the first n numbers of an array field of the records, ``(turns, n)``.

        The arrays have room for two masses, and the other numbers are unused.
        """
        return np.ascontiguousarray(self.records[name][:, : self.size])


class StroboscopicMap:
    """Map of the follower's state by one turn of the cam.

    The follower is one rigid mass, or two masses with an elastic stem.

    Parameters
    ----------
    law : Law
        The motion law of the cam. Its lift must not jump.
    parameters : FollowerParameters or TwoMassParameters
        The follower, with a coefficient of restitution.
    speed : float
        Cam speed in all turns, rad/s, > 0.

    Raises
    ------
    ConfigError
        If the restitution is None.
    DynamicsError
        If the speed is out of range or the lift of the law jumps.
    """

    def __init__(
        self, law: Law, parameters: FollowerParameters | TwoMassParameters, speed: float
    ) -> None:
        require_turning(speed)
        require_continuous(law)
        self.law, self.parameters, self.speed = law, parameters, float(speed)
        # A velocity jump at angle 0 belongs to the next turn. The turn ends just before it.
        self.duration = step_before_velocity_jump(law, TURN) / self.speed
        self._trajectory: Separation | OneMassTrajectory
        if isinstance(parameters, TwoMassParameters):
            self.size, self._trajectory = 4, Separation(law, parameters, speed)
        else:
            interval = Interval(0, max(1, round(NS * self.duration)), 0.0, speed)
            self.size, self._trajectory = 2, OneMassTrajectory(law, parameters, interval)
        self._table = self._trajectory.run_table(self.duration)

    @property
    def scale(self) -> FloatArray:
        """Typical magnitudes of the n numbers in a state of the map, ``(n,)``, in SI units.

        They are the lift for the gap and lift × speed for its rate. For two masses they are also
        the stretch of the stem by the largest forces, and this stretch times the frequency of the
        stem.
        """
        p, (lift, slope, curvature) = self.parameters, self.law.bounds
        sizes = [self.law.lift, self.law.lift * self.speed]
        if isinstance(p, TwoMassParameters):
            force = (p.roller_mass + p.end_mass) * curvature * self.speed**2 + p.preload
            force += p.damping * slope * self.speed + p.spring_stiffness * lift
            stretch = force / p.stem_stiffness
            sizes += [stretch, stretch * math.sqrt(p.stiffness / p.end_mass)]
        return np.array(sizes)

    def run(self, turns: int, state: State = ON_THE_CAM) -> TurnsRun:
        """Run the follower over successive turns of the cam.

        Parameters
        ----------
        turns : int
            Number of turns.
        state : tuple of float
            State at the start, as in `TurnsRun.states` (default: on the cam). If it has only a gap
            and a rate, the end mass of two masses follows the turning cam.

        Returns
        -------
        TurnsRun
            Results of all turns.

        Raises
        ------
        EndlessEventsError
            If a turn has more landings than any finite series of bounces.
        """
        first = self._start(state)
        # The directions of the end mass come first, because they remain free on the cam.
        frame = np.roll(np.eye(self.size), 2, axis=0)[: self.size - 1]
        records, done = np.zeros(turns, TURN_RESULT), 0
        max_landings = float(self._trajectory.max_events)
        while done < turns:
            part = records[done : done + TURNS_PER_CALL]
            record = new_record(first, MAX_PHASES)  # `first` is updated to the last state
            done_now = int(dispatch(run_turns, self._table, record, frame, part, max_landings))
            if done_now < len(part):
                raise EndlessEventsError(
                    f"more than {self._trajectory.max_events} landings in a turn at "
                    f"{self.speed:g} rad/s; allowed: {self._trajectory.max_events}"
                )
            done += len(part)
        records.setflags(write=False)
        return TurnsRun(records, self.size)

    def follower(self, state: State) -> FollowerState:
        """Convert a state of the map, at cam angle 0, to a state of the follower model.

        The result can be the initial state of the models `one_mass` and `two_mass`.
        """
        first = self._start(state)[0]
        is_flying = first["mode"] == RunMode.FLIGHT
        lift, velocity = (a + b for a, b in zip(self._cam(), state, strict=False))
        stem = first["vector"][: 4 if is_flying else 2] if self.size == 4 else []
        gap_state = state[:2] if is_flying else ()
        return FollowerState(lift, velocity, 0.0, not is_flying, inner=(*stem, *gap_state))

    def _cam(self) -> tuple[float, float]:
        """Return the lift s (m) and velocity ṡ (m/s) of the cam at angle 0.

        If the velocity of the law jumps at angle 0, it is the velocity before the jump.
        """
        s, slope = self.law.motion[:2, -1, -1].tolist()
        return s, slope * self.speed

    def _start(self, state: State) -> NDArray[np.void]:
        """Return the initial state of the event search, one record of `RUN_STATE`.

        ``state`` is a state of the map, at cam angle 0.
        """
        gap, gap_rate, *stem = state
        require_number("gap", gap, "≥ 0")
        require_number("opening", gap_rate, "of either sign")
        records, (s, velocity) = np.zeros(1, RUN_STATE), self._cam()
        vector, is_flying = records[0]["vector"], (gap, gap_rate) != ON_THE_CAM
        if is_flying:
            vector[:2] = s + gap, velocity + gap_rate
            start_flight(records[0], True, gap, gap_rate)
        if self.size == 2:
            return records
        run = self._table
        static = compute_stem_stretch(run, StemVibration(0.0, 0.0), CamMotion(s, velocity, 0.0))
        w, rate = stem or static
        if is_flying:
            centre = s + gap + run.end_share * w, velocity + gap_rate + run.end_share * rate
            vector[:] = w, rate, *centre
        else:
            vector[:2] = w - static.length, rate - static.rate
        return records
