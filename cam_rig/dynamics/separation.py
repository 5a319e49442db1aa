"""The two-mass follower as it rides the cam, lifts off, flies and lands (eq. 14-19).

Phases are closed forms, events are roots; nothing is stepped. A landing stops the roller mass on
the cam (ż := ṡ, the paper's plastic re-contact) or throws it back with Newton's restitution; the
end mass goes on with the velocity it had. So it is where the law's velocity jumps: up is a blow on
the roller mass, m₁ (1 + e) ω Δs', down throws it off with the velocity it had.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from cam_rig.dynamics.block import Event, EventKind
from cam_rig.dynamics.bounce import least_bounce, rises
from cam_rig.dynamics.kinks import KinksAhead, short_of_kink
from cam_rig.dynamics.linear import LinearResponse
from cam_rig.dynamics.numbers import require_angle, require_number, state_of
from cam_rig.dynamics.two_mass import TwoMassParameters, contact_response, force_output
from cam_rig.dynamics.two_mass_guards import fly, gap_rounding, landing, lift_off
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.laws.bernstein import FloatArray

#: More events in one call than any physical series has.
MOST_EVENTS = 20_000


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
        require_angle(self.angle)
        self._response: LinearResponse = contact_response(self.law, self.parameters, self.speed)
        self._contact, self._reach = True, 0.0
        self._force = force_output(self.parameters)

    def run(self, duration: float, state: FloatArray | None = None, contact: bool = True) -> None:
        """Find all phases and events up to ``duration`` s, from rest on the cam by default."""
        require_number("duration", duration, "> 0")
        require_angle(self.angle + self.speed * duration, "angle at the end")
        if state is None:
            state, contact = np.zeros(2), True
        state = state_of(state, 2 if contact else 4)
        kinks = KinksAhead(self.law, self.angle, self.speed, duration)
        now, self._reach = 0.0, self.speed * duration
        state, contact = self._cross(now, kinks.take(now), state, contact)
        while now < duration:
            if len(self.events) > MOST_EVENTS:
                raise DynamicsError(
                    f"{len(self.events)} events in {now:g} s; allowed: {MOST_EVENTS} a run"
                )
            limit = min(kinks.bound, kinks.clear) if contact else kinks.bound
            event = self._next_event(now, limit - now, state, contact)
            end = kinks.bound if event is None else kinks.no_later(now + event[0])
            phase = Phase(now, end, contact, state)
            self.phases.append(phase)
            struck, step = kinks.at(end), kinks.take(end)
            if event is None or (contact and struck):
                if end < duration:
                    state, contact = self._cross(end, step, self._end_of(phase), contact)
            else:
                change = self._leave if contact else self._meet
                state, contact = change(end, event[1])
            now, self._contact = end, contact

    def _next_event(
        self, now: float, limit: float, state: FloatArray, contact: bool
    ) -> tuple[float, FloatArray] | None:
        guard = lift_off if contact else landing
        return guard(
            self.law, self.parameters, self.speed, self.angle + self.speed * now, state, limit
        )

    def _cross(
        self, time: float, step: float, state: FloatArray, contact: bool
    ) -> tuple[FloatArray, bool]:
        """Where ṡ jumps by ``step`` (m/s): a blow on a roller in contact, or it is thrown off.

        ``state`` is that before the jump; the end mass has the same velocity after it.
        """
        if step == 0.0 or not contact:
            return state, contact
        cam = self._cam_at(time) - np.array([0.0, step, 0.0])
        both = np.concatenate([cam[:2], self.parameters.static_place(cam) + state])
        if step > 0.0:
            return self._meet(time, both)
        self._note("lift-off", time)
        return both, False

    @property
    def ends_in_contact(self) -> bool:
        """Whether the roller is on the cam after the last phase and its event, if it had one."""
        return self._contact

    @property
    def final_state(self) -> FloatArray:
        """(η, η̇) or (z, ż, y, ẏ) at the end of the run, exact as it is handed on."""
        return self._end_of(self.phases[-1])

    def _end_of(self, phase: Phase) -> FloatArray:
        """(η, η̇) or (z, ż, y, ẏ) at the end of a phase, before its event."""
        if phase.contact:
            angle = self.angle + self.speed * phase.begin
            return self._response.end(phase.state, angle, phase.end - phase.begin)
        return self.fly(phase.state, np.array([phase.end - phase.begin]))[:, 0]

    def fly(self, state: FloatArray, times: FloatArray) -> FloatArray:
        """(z, ż, y, ẏ) at times (s) of a flight, ``(4, len(times))``."""
        return fly(self.parameters, state, times)

    def cam(self, time: FloatArray) -> FloatArray:
        """S, ṡ and s̈ at times in s, ``(3, len(time))``."""
        angle = self.angle + self.speed * time
        return self.law.motion_at(angle) * (self.speed ** np.arange(3.0))[:, None]

    def _cam_at(self, time: float) -> FloatArray:
        """S, ṡ and s̈ at one time in s, ``(3,)``."""
        return self._cam_to(self.angle + self.speed * time)

    def cam_at_end(self, time: float) -> FloatArray:
        """The same where an interval ends: before a kink that begins the next one."""
        return self._cam_to(short_of_kink(self.law, self.angle + self.speed * time))

    def _cam_to(self, angle: float) -> FloatArray:
        s, slope, bend = self.law.at(angle)
        return np.array([s, slope * self.speed, bend * self.speed**2])

    def force(self, state: FloatArray, time: FloatArray) -> FloatArray:
        """Contact force (N) of vibrations (η, η̇), ``(2, n)``, at times in s."""
        out = self._force
        total = out.state @ state + out.law @ self.cam(time) + out.constant[:, None]
        return np.asarray(total[0])

    def force_of(self, vibration: FloatArray, cam: FloatArray) -> float:
        """Contact force (N) of one vibration (η, η̇) where the cam has (s, ṡ, s̈)."""
        out = self._force
        return float((out.state @ vibration + out.law @ cam + out.constant)[0])

    def _leave(self, time: float, vibration: FloatArray) -> tuple[FloatArray, bool]:
        """(z, ż, y, ẏ) that flies off at the end of a contact phase."""
        self._note("lift-off", time)
        cam = self._cam_at(time)
        end_mass = self.parameters.static_place(cam) + vibration
        return np.concatenate([cam[:2], end_mass]), False

    def _meet(self, time: float, state: FloatArray) -> tuple[FloatArray, bool]:
        """After a landing: what flies on, or the end mass's state in contact."""
        p = self.parameters
        cam = self._cam_at(time)
        approach, vibration = max(0.0, float(cam[1] - state[1])), state[2:] - p.static_place(cam)
        force = self.force_of(vibration, cam)
        rebound = p.restitution * approach
        least = least_bounce(
            self.law, p.restitution, gap_rounding(self.law, p, state, abs(self.angle) + self._reach)
        )
        bounces = rises(rebound, force / p.roller_mass, least)
        restitution = p.restitution if bounces else 0.0
        impulse = p.roller_mass * (1.0 + restitution) * approach
        lost = 0.5 * p.roller_mass * (1.0 - restitution**2) * approach**2
        self._note("landing", time, impulse, lost)
        if restitution > 0.0:
            return np.array([cam[0], cam[1] + rebound, *state[2:]]), False
        return vibration, True

    def _note(self, kind: EventKind, time: float, impulse: float = 0.0, lost: float = 0.0) -> None:
        self.events.append(Event(kind, time, self.angle + self.speed * time, impulse, lost))
