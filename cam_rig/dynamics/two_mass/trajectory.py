"""The two-mass follower in contact, at lift-off, in flight and landing (eq. 14-19).

Phases are closed forms, events are roots; nothing is stepped. A landing stops the roller mass on
the cam (ż := ṡ, the paper's plastic re-contact) or rebounds with Newton's restitution; the
end mass goes on with the velocity it had. The same holds where the law's velocity jumps: up is an
impact on the roller mass, m₁ (1 + e) ω Δs', down lifts it off with the velocity it had.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.dynamics.impacts import least_bounce, rises
from cam_rig.dynamics.input_limits import require_angle, require_number, state_of
from cam_rig.dynamics.interval import Event, EventKind
from cam_rig.dynamics.linear.free_system import Flight
from cam_rig.dynamics.linear.response import LinearResponse
from cam_rig.dynamics.one_mass.trajectory import NO_IMPACT
from cam_rig.dynamics.two_mass.events import landing, lift_off
from cam_rig.dynamics.two_mass.flight import free_masses, from_inner, to_inner
from cam_rig.dynamics.two_mass.parameters import TwoMassParameters, contact_response, force_output
from cam_rig.dynamics.velocity_jumps import VelocityJumpsAhead, short_of_velocity_jump
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law

#: More events in one call than any physical series has.
MAX_EVENTS = 20_000


@dataclass(frozen=True, eq=False)
class TwoMassPhase:
    """Contact, ``vibration`` (η, η̇), or a flight, from ``begin`` to ``end`` s."""

    begin: float
    end: float
    vibration: FloatArray
    flight: Flight | None = None

    @property
    def contact(self) -> bool:
        """Whether the roller is in contact."""
        return self.flight is None


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
    phases: list[TwoMassPhase] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)

    def __post_init__(self) -> None:
        require_angle(self.angle)
        self._response: LinearResponse = contact_response(self.law, self.parameters, self.speed)
        self._system = free_masses(self.parameters)
        self._force = force_output(self.parameters)
        #: What the roller is after the last phase: a vibration (η, η̇) on the cam, or a flight.
        self.last: FloatArray | Flight = np.zeros(2)

    def run(self, duration: float, state: FloatArray | None = None, contact: bool = True) -> None:
        """Find all phases and events up to ``duration`` s, from rest on the cam by default.

        ``state`` is (η, η̇) in contact, else (z, ż, y, ẏ).
        """
        if state is None:
            state, contact = np.zeros(2), True
        state = state_of(state, 2 if contact else 4)
        self.go(duration, state if contact else self.lifted_off(to_inner(self.parameters, state)))

    def go(self, duration: float, start: FloatArray | Flight, step: float = 0.0) -> None:
        """The same from (η, η̇) or a flight, where ṡ has gained ``step`` m/s."""
        require_number("duration", duration, "> 0")
        require_angle(self.angle + self.speed * duration, "angle at the end")
        joints = VelocityJumpsAhead(self.law, self.angle, self.speed, duration)
        step += joints.take(0.0)
        now, state = 0.0, self._velocity_step(0.0, step, start)
        while now < duration:
            if len(self.events) > MAX_EVENTS:
                raise DynamicsError(
                    f"{len(self.events)} events in {now:g} s; allowed: {MAX_EVENTS} a run"
                )
            if isinstance(state, Flight):
                now, state = self._flight_phase(now, state, joints)
            else:
                now, state = self._contact_phase(now, state, joints)
        self.last = state

    def _contact_phase(
        self, now: float, vibration: FloatArray, joints: VelocityJumpsAhead
    ) -> tuple[float, FloatArray | Flight]:
        """A phase of contact: its end, and what the roller is then."""
        limit, angle = (
            min(joints.bound, joints.clear),
            self.angle + self.speed * now,
        )
        loss = lift_off(self.law, self.parameters, self.speed, angle, vibration, limit - now)
        end = joints.bound if loss is None else joints.no_later(now + loss[0])
        self.phases.append(TwoMassPhase(now, end, vibration))
        impact, step = joints.at(end), joints.take(end)
        if loss is not None and not impact:
            cam = self._cam_at(end)
            vibration = self._continued(loss[1], cam, (end - now) - loss[0])
            return end, self._lift_off_at(end, vibration, cam, 0.0)
        vibration = self._response.end(vibration, angle, end - now)
        return end, self._velocity_step(end, step, vibration)

    def _continued(self, vibration: FloatArray, cam: FloatArray, time: float) -> FloatArray:
        """(η, η̇) a rounding of time (s) later: what follows begins at a time that is a float."""
        model = self._response
        return np.asarray(vibration + time * (model.matrix @ vibration + model.drive @ cam))

    def _flight_phase(
        self, now: float, flight: Flight, joints: VelocityJumpsAhead
    ) -> tuple[float, FloatArray | Flight]:
        """A phase of flight, at most to the next velocity jump: its end, and the roller's state."""
        angle, limit = self.angle + self.speed * now, joints.bound - now
        gap = landing(self.law, self.parameters, self.speed, angle, flight, limit)
        end = joints.no_later(now + gap.time) if gap.landed else joints.bound
        self.phases.append(TwoMassPhase(now, end, np.zeros(2), flight))
        inner, opening = flight.at(end - now), gap.rate - joints.take(end)
        if gap.landed and opening <= 0.0:
            return end, self._meet(end, inner[:2], opening)
        return end, self.lifted_off(inner, gap.gap, opening)

    def _velocity_step(
        self, time: float, step: float, state: FloatArray | Flight
    ) -> FloatArray | Flight:
        """Where ṡ gains ``step`` (m/s): an impact on a roller in contact, or its lift-off.

        ``state`` is that before; the end mass has the same velocity after it.
        """
        if abs(step) <= NO_IMPACT * self.speed * self.law.lift:
            return state
        if isinstance(state, Flight):
            opening = None if state.opening is None else state.opening - step
            return self.lifted_off(state.start, state.gap, opening)
        before = self._cam_at(time) - np.array([0.0, step, 0.0])
        if step < 0.0:
            return self._lift_off_at(time, state, before, -step)
        return self._meet(time, self._stretch(state, before), -step)

    @property
    def ends_in_contact(self) -> bool:
        """Whether the roller is on the cam after the last phase and its event, if it had one."""
        return not isinstance(self.last, Flight)

    def lifted_off(
        self, inner: FloatArray, gap: float | None = None, opening: float | None = None
    ) -> Flight:
        """The flight from a state (w, ẇ, Y, Ẏ); the rest as in `Flight`."""
        return Flight(self._system, inner, gap, opening)

    def fly(self, flight: Flight, times: FloatArray) -> FloatArray:
        """(z, ż, y, ẏ) at times (s) of a flight, ``(4, len(times))``."""
        way, _ = self._system.moved(flight.start, times)
        return from_inner(self.parameters, flight.start[:, None] + way)

    def cam(self, time: FloatArray) -> FloatArray:
        """S, ṡ and s̈ at times in s, ``(3, len(time))``."""
        angle = self.angle + self.speed * time
        return self.law.motion_at(angle) * (self.speed ** np.arange(3.0))[:, None]

    def _cam_at(self, time: float) -> FloatArray:
        """S, ṡ and s̈ at one time in s, ``(3,)``."""
        return self._cam_to(self.angle + self.speed * time)

    def cam_at_end(self, time: float) -> FloatArray:
        """The same where an interval ends: before a velocity jump that begins the next one."""
        return self._cam_to(short_of_velocity_jump(self.law, self.angle + self.speed * time))

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

    def _stretch(self, vibration: FloatArray, cam: FloatArray) -> FloatArray:
        """(w, ẇ) of the stem of a roller on the cam: a small difference, without its rounding."""
        p = self.parameters
        left = p.spring_stiffness / p.stiffness
        return np.asarray(vibration - left * cam[:2] - np.array([p.preload / p.stiffness, 0.0]))

    def _lift_off_at(
        self, time: float, vibration: FloatArray, cam: FloatArray, opening: float
    ) -> Flight:
        """What flies off a cam with (s, ṡ, s̈), which then falls back by ``opening`` m/s."""
        self._note("lift-off", time)
        return self._flight_from(cam[:2], self._stretch(vibration, cam), opening)

    def _flight_from(self, roller: FloatArray, stretch: FloatArray, opening: float) -> Flight:
        """The flight of a roller with (z, ż) on the cam, from which it opens at ``opening`` m/s."""
        p = self.parameters
        centre = roller + p.end_mass / (p.roller_mass + p.end_mass) * stretch
        return self.lifted_off(np.concatenate([stretch, centre]), 0.0, opening)

    def _meet(self, time: float, stretch: FloatArray, rate: float) -> FloatArray | Flight:
        """After a landing at ``rate`` (m/s, not above 0): what flies on, or (η, η̇) in contact.

        ``stretch`` is (w, ẇ) before it; the end mass goes on with the velocity it had.
        """
        p, cam = self.parameters, self._cam_at(time)
        approach, on_cam = -rate, stretch + np.array([0.0, rate])
        vibration = np.asarray(on_cam - self._stretch(np.zeros(2), cam))
        rebound = p.restitution * approach
        pull = self.force_of(vibration, cam) / p.roller_mass
        bounces = rises(rebound, pull, least_bounce(self.law))
        restitution = p.restitution if bounces else 0.0
        impulse = p.roller_mass * (1.0 + restitution) * approach
        lost = 0.5 * p.roller_mass * (1.0 - restitution**2) * approach**2
        self._note("landing", time, impulse, lost)
        if not bounces:
            return vibration
        rising = np.array([0.0, rebound])
        return self._flight_from(cam[:2] + rising, on_cam - rising, rebound)

    def _note(self, kind: EventKind, time: float, impulse: float = 0.0, lost: float = 0.0) -> None:
        self.events.append(Event(kind, time, self.angle + self.speed * time, impulse, lost))
