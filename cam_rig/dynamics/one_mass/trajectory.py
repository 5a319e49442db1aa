"""The one-mass follower through one interval: phases of contact and flight, and their events."""

from __future__ import annotations

from dataclasses import dataclass, field

from cam_rig.dynamics.contact_force import force_rounding
from cam_rig.dynamics.impacts import least_bounce, rises
from cam_rig.dynamics.interval import Event, EventKind, FollowerState, Interval
from cam_rig.dynamics.kinetostatic import state_at
from cam_rig.dynamics.landing import Approach
from cam_rig.dynamics.linear.free_system import Flight
from cam_rig.dynamics.one_mass.events import next_lift_off
from cam_rig.dynamics.one_mass.flight import lifted_off
from cam_rig.dynamics.parameters import FollowerParameters
from cam_rig.dynamics.velocity_jumps import VelocityJumpsAhead, short_of_velocity_jump
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law

#: A change of the cam's velocity below this fraction of (cam speed x lift) is rounding: no step.
NO_IMPACT = 1e-12
#: More events in one interval than any physical bounce series has.
MAX_EVENTS = 10_000


@dataclass(frozen=True)
class OneMassPhase:
    """Contact (no flight) or flight from ``begin`` to ``end``, in s since the interval's start."""

    begin: float
    end: float
    flight: Flight | None


@dataclass
class OneMassTrajectory:
    """Finds phase after phase of an interval at constant speed; times since its start, in s.

    Nothing is stepped: contact ends where the force polynomial turns negative, flight ends
    where the gap closes, and between these the motion is known in closed form. Both also end at a
    joint where the law's velocity jumps: up is an impact on a follower in contact, down lifts
    it off with the velocity it had.
    """

    law: Law
    parameters: FollowerParameters
    interval: Interval
    phases: list[OneMassPhase] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)

    def __post_init__(self) -> None:
        interval, speed = self.interval, self.interval.speed
        self._joints = VelocityJumpsAhead(self.law, interval.angle, speed, interval.duration)
        rounding = force_rounding(self.law, self.parameters, speed)
        self._force_noise = rounding / self.parameters.mass
        self._last: Flight | None = None

    def run(self, state: FollowerState | None, step: float = 0.0) -> None:
        """Find all phases of the interval; ``state`` None puts the follower on the cam.

        ``step`` is by how much the cam's velocity is more than where the state ended, m/s.
        """
        time, flight = 0.0, self._begin(state, step)
        while time < self.interval.duration:
            time, flight = (
                self._contact_phase(time) if flight is None else self._flight_phase(time, flight)
            )
        self._last = flight

    def _contact_phase(self, time: float) -> tuple[float, Flight | None]:
        """A phase of contact: its end, and what flies on then."""
        bound, speed = self._joints.bound, self.interval.speed
        lift_off = next_lift_off(self.law, self.parameters, speed, self.angle(time), time)
        end = self._joints.no_later(lift_off) if lift_off < self._joints.clear else bound
        self.phases.append(OneMassPhase(time, end, None))
        return end, self._lift_off_at(end) if end < bound else self._impact(end)

    def _flight_phase(self, time: float, flight: Flight) -> tuple[float, Flight | None]:
        """A phase of flight, at most to the next velocity jump: its end, and what flies on then."""
        angle, bound = self.angle(time), self._joints.bound
        approach = Approach(flight, self.law, angle, self.interval.speed, self._force_noise)
        last = approach.run(bound - time)
        end = self._joints.no_later(time + last.time) if last.landed else bound
        self.phases.append(OneMassPhase(time, end, flight))
        opening = last.rate - self._joints.take(end)
        if last.landed and opening <= 0.0:
            self._require_progress()
            return end, self._meet(end, -opening)
        y, velocity = flight.at(end - time).tolist()
        return end, lifted_off(self.parameters, y, velocity, last.gap, opening)

    def _impact(self, time: float, step: float = 0.0) -> Flight | None:
        """The velocity of the cam under a follower gains ``step`` (m/s), and what a joint adds."""
        step += self._joints.take(time)
        if abs(step) <= NO_IMPACT * self.interval.speed * self.law.lift:
            return None
        return self._meet(time, step) if step > 0.0 else self._lift_off_at(time, -step)

    def _require_progress(self) -> None:
        """An endless series of events would be a fault of the model: say so, do not hang."""
        if len(self.events) > MAX_EVENTS:
            raise DynamicsError(
                f"{len(self.events)} events in {self.interval.duration:g} s at "
                f"{self.interval.speed:g} rad/s; allowed: {MAX_EVENTS} an interval"
            )

    def angle(self, time: float) -> float:
        """Cam angle (rad) at a time since the interval's start, from the turn it starts in."""
        return self.interval.angle + self.interval.speed * time

    def on_cam(self, time: float) -> FollowerState:
        """The follower as it would be on the cam at a time since the interval's start."""
        return state_at(self.law, self.parameters, self.angle(time), self.interval.speed)

    @property
    def end(self) -> FollowerState:
        """The follower at the end of the interval, before a velocity jump of the next one."""
        last = self._last
        if last is not None:
            y, v = last.start.tolist()
            return FollowerState(y, v, 0.0, in_contact=False, inner=last.known)
        angle = short_of_velocity_jump(self.law, self.angle(self.phases[-1].end))
        return state_at(self.law, self.parameters, angle, self.interval.speed)

    def _begin(self, state: FollowerState | None, step: float) -> Flight | None:
        if state is None or state.in_contact:
            return self._impact(0.0, step)
        gap, opening = state.inner or (None, None)
        at_joint = self._joints.take(0.0)
        if opening is not None:
            opening -= step + at_joint
        return lifted_off(self.parameters, state.displacement, state.velocity, gap, opening)

    def _lift_off_at(self, time: float, opening: float = 0.0) -> Flight:
        """The follower lifts off, faster than the cam by ``opening`` m/s."""
        self.events.append(self._event("lift-off", time))
        return self._flight_from(self.on_cam(time), opening)

    def _flight_from(self, cam: FollowerState, opening: float) -> Flight:
        velocity = cam.velocity + opening
        return lifted_off(self.parameters, cam.displacement, velocity, 0.0, opening)

    def _meet(self, time: float, approach: float) -> Flight | None:
        """The follower meets the cam at ``approach`` m/s: what flies on, or None for contact."""
        cam, p = self.on_cam(time), self.parameters
        rebound = p.restitution * approach
        if rises(rebound, cam.contact_force / p.mass, least_bounce(self.law)):
            self._land(time, approach, p.restitution)
            return self._flight_from(cam, rebound)
        self._land(time, approach, 0.0)
        return None

    def _land(self, time: float, approach: float, restitution: float) -> None:
        mass = self.parameters.mass
        impulse = mass * (1.0 + restitution) * approach
        lost = 0.5 * mass * (1.0 - restitution**2) * approach**2
        self.events.append(self._event("landing", time, impulse, lost))

    def _event(
        self, kind: EventKind, time: float, impulse: float = 0.0, lost: float = 0.0
    ) -> Event:
        return Event(kind, time, self.interval.unwrapped_at(time), impulse, lost)
