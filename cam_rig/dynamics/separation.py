"""The two-mass follower as it rides the cam, lifts off, flies and lands (eq. 14-19).

Phases are closed forms, events are roots; nothing is stepped. A landing stops the roller mass on
the cam (ż := ṡ, the paper's plastic re-contact) or throws it back with Newton's restitution; the
end mass goes on with the velocity it had.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from cam_rig.dynamics.block import Event, EventKind
from cam_rig.dynamics.exponential import free_motion
from cam_rig.dynamics.linear import LinearResponse, Run
from cam_rig.dynamics.scan import first_negative
from cam_rig.dynamics.two_mass import TwoMassParameters, contact_response, force_output
from cam_rig.dynamics.uniform import polynomial_part
from cam_rig.errors import DynamicsError
from cam_rig.laws import TURN, Law, bernstein
from cam_rig.laws.bernstein import FloatArray

#: A gap or a force this many rounding errors below zero is below zero.
ROUNDING_ERRORS = 64.0
#: Fewest grid points of a scan over one turn: the slow part of force and gap.
LEAST_PER_TURN = 512
#: More events in one call than any physical series has.
MOST_EVENTS = 20_000
EPS = float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class Phase:
    """Contact, state (η, η̇), or flight, state (z, ż, y, ẏ), from ``begin`` to ``end`` s."""

    begin: float
    end: float
    contact: bool
    state: FloatArray


@dataclass
class Separation:
    """The follower's course on one law at one speed.

    Parameters
    ----------
    speed : rad/s
    angle : cam angle in rad at t = 0
    """

    law: Law
    parameters: TwoMassParameters
    speed: float
    angle: float = 0.0
    phases: list[Phase] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._response: LinearResponse = contact_response(self.law, self.parameters, self.speed)
        self._contact = True
        self._force = force_output(self.parameters)
        # a flight is free motion about where all springs would rest
        p = self.parameters
        self._rest = -np.linalg.solve(p.flight_matrix, p.flight_load)

    def run(self, duration: float, state: FloatArray | None = None, contact: bool = True) -> None:
        """Find all phases and events up to ``duration`` s, from rest on the cam by default."""
        if state is None:
            state, contact = np.zeros(2), True
        now = 0.0
        while now < duration:
            if len(self.events) > MOST_EVENTS:
                raise DynamicsError(
                    f"{len(self.events)} events in {now:g} s; allowed: {MOST_EVENTS} a run"
                )
            if contact:
                event = self._lift_off(now, duration, state)
                end = duration if event is None else event
                self.phases.append(Phase(now, end, True, state))
                if event is not None:
                    self._note("lift-off", end)
                    state, contact = self._full(state, now, end), False
            else:
                event = self._landing(now, duration, state)
                end = duration if event is None else event
                self.phases.append(Phase(now, end, False, state))
                if event is not None:
                    state, contact = self._meet(end, self.fly(state, np.array([end - now]))[:, 0])
            now, self._contact = end, contact

    @property
    def ends_in_contact(self) -> bool:
        """Whether the roller is on the cam after the last phase and its event, if it had one."""
        return self._contact

    @property
    def final_state(self) -> FloatArray:
        """(η, η̇) or (z, ż, y, ẏ) at the end of the run, exact as it is handed on."""
        last = self.phases[-1]
        if last.contact:
            angle = self.angle + self.speed * last.begin
            return self._response.end(last.state, angle, last.end - last.begin)
        return self.fly(last.state, np.array([last.end - last.begin]))[:, 0]

    def fly(self, state: FloatArray, times: FloatArray) -> FloatArray:
        """(z, ż, y, ẏ) at times (s) of a flight, ``(4, len(times))``."""
        moved = free_motion(self.parameters.flight_matrix, state - self._rest, times)
        return np.asarray(self._rest[:, None] + moved)

    def cam(self, time: FloatArray) -> FloatArray:
        """S, ṡ and s̈ at times in s, ``(3, len(time))``."""
        angle = self.angle + self.speed * time
        return np.stack([self.law(angle, order) * self.speed**order for order in range(3)])

    def force(self, state: FloatArray, time: FloatArray) -> FloatArray:
        """Contact force (N) of vibrations (η, η̇), ``(2, n)``, at times in s."""
        out = self._force
        total = out.state @ state + out.law @ self.cam(time) + out.constant[:, None]
        return np.asarray(total[0])

    def _full(self, state: FloatArray, begin: float, end: float) -> FloatArray:
        """(z, ż, y, ẏ) at the end of a contact phase."""
        vibration = self._response.end(state, self.angle + self.speed * begin, end - begin)
        cam = self.cam(np.array([end]))[:, 0]
        return np.concatenate([cam[:2], self.parameters.static_place(cam) + vibration])

    def _lift_off(self, begin: float, end: float, state: FloatArray) -> float | None:
        """When the contact force turns negative, looked for run by run."""
        start = self.angle + self.speed * begin
        for run in self._response.walk(state, start, end - begin):
            found = self._force_root(run)
            if found is not None:
                return begin + run.begin + found
        return None

    def _force_root(self, run: Run) -> float | None:
        p, part = self.parameters, run.part
        ordinates = polynomial_part(self._response, part, self._force)[0][0]
        stiffness = (p.stem_stiffness + p.spring_stiffness) / p.end_mass
        energy = stiffness * run.free[0] ** 2 + run.free[1] ** 2
        vibration = (p.stem_stiffness / np.sqrt(stiffness) + p.stem_damping) * np.sqrt(energy)
        rounding = ROUNDING_ERRORS * EPS * float(np.abs(ordinates).max())
        if ordinates.min() > vibration:
            return None

        def force(time: FloatArray) -> FloatArray:
            forced = bernstein.evaluate(ordinates, (run.local + time) / part.length)
            free = free_motion(self._response.matrix, run.free, time)
            return np.asarray(forced + self._force.state[0] @ free + rounding)

        if force(np.zeros(1))[0] <= 0.0:
            return 0.0
        fastest = np.sqrt(stiffness)
        return first_negative(force, run.end - run.begin, fastest, self._least(run.end - run.begin))

    def _landing(self, begin: float, end: float, state: FloatArray) -> float | None:
        """When the gap between roller and cam closes."""
        size = float(np.abs(self.law.ordinates).max() + np.abs(state[[0, 2]]).max())
        reach = TURN + self.speed * (end - begin)
        size += reach * float(np.abs(self.law.motion[1]).max())
        rounding = ROUNDING_ERRORS * EPS * size + self.law.largest_step

        def gap(time: FloatArray) -> FloatArray:
            angle = self.angle + self.speed * (begin + time)
            return np.asarray(self.fly(state, time)[0] - self.law(angle) + rounding)

        span = end - begin
        found = first_negative(gap, span, self.parameters.fastest_rate, self._least(span))
        return None if found is None else begin + found

    def _least(self, span: float) -> int:
        return 8 + int(LEAST_PER_TURN * span * self.speed / TURN)

    def _meet(self, time: float, state: FloatArray) -> tuple[FloatArray, bool]:
        """After a landing: what flies on, or the end mass's state in contact."""
        p = self.parameters
        cam = self.cam(np.array([time]))[:, 0]
        approach, vibration = float(cam[1] - state[1]), state[2:] - p.static_place(cam)
        force = float(self.force(vibration[:, None], np.array([time]))[0])
        rebound = p.restitution * approach
        restitution = p.restitution if self._rises(rebound, force) else 0.0
        impulse = p.roller_mass * (1.0 + restitution) * approach
        lost = 0.5 * p.roller_mass * (1.0 - restitution**2) * approach**2
        self._note("landing", time, impulse, lost)
        if restitution > 0.0:
            return np.array([cam[0], cam[1] + rebound, *state[2:]]), False
        return vibration, True

    def _rises(self, rebound: float, force: float) -> bool:
        """Whether a rebound rises above rounding; the rest of an endless series is contact."""
        if rebound <= 0.0 or force <= 0.0:
            return rebound > 0.0
        return 0.5 * rebound**2 * self.parameters.roller_mass / force > 1e-12 * self.law.lift

    def _note(self, kind: EventKind, time: float, impulse: float = 0.0, lost: float = 0.0) -> None:
        self.events.append(Event(kind, time, self.angle + self.speed * time, impulse, lost))
