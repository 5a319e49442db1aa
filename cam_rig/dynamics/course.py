"""The follower's course through one interval: phases of contact and flight, and their events."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from cam_rig.dynamics.block import Event, EventKind, FollowerState, Interval
from cam_rig.dynamics.bounce import least_bounce, rises
from cam_rig.dynamics.contact import loss_intervals
from cam_rig.dynamics.flight import Flight
from cam_rig.dynamics.kinetostatic import state_at
from cam_rig.dynamics.kinks import KinksAhead, short_of_kink
from cam_rig.dynamics.landing import gap_rounding, landing_time
from cam_rig.dynamics.parameters import FollowerParameters
from cam_rig.errors import DynamicsError
from cam_rig.laws import TURN, Law

#: A relative speed below this fraction of (cam speed x lift) is rounding, not a separation.
STILL = 1e-12
#: Angle (rad) of a loss interval too short to lift anything but a rounding error.
GRAZE = 1e-9
#: More events in one interval than any physical bounce series has.
MOST_EVENTS = 10_000


@dataclass(frozen=True)
class Phase:
    """Contact (no flight) or flight from ``begin`` to ``end``, in s since the interval's start."""

    begin: float
    end: float
    flight: Flight | None


@dataclass
class Course:
    """Finds phase after phase of an interval at constant speed; times since its start, in s.

    Nothing is stepped: contact ends where the force polynomial turns negative, flight ends
    where the gap closes, and between these the motion is known in closed form. Both also end at a
    joint where the law's velocity jumps: there the cam strikes a follower that rides it, or throws
    it off with the velocity it had.
    """

    law: Law
    parameters: FollowerParameters
    interval: Interval
    phases: list[Phase] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)

    def __post_init__(self) -> None:
        # Angles are kept within the turn they start in: a law's value is lost to rounding
        # with the size of the angle.
        self._turns = float(np.floor(self.interval.angle / TURN)) * TURN
        self._start = self.interval.angle - self._turns
        speed, duration = self.interval.speed, self.interval.duration
        self._kinks = KinksAhead(self.law, self._start, speed, duration)

    def run(self, state: FollowerState | None) -> None:
        """Find all phases of the interval; ``state`` None puts the follower on the cam."""
        time, flight = 0.0, self._begin(state)
        while time < self.interval.duration:
            time, flight = self._ride(time) if flight is None else self._fly(time, flight)

    def _ride(self, time: float) -> tuple[float, Flight | None]:
        """A phase of contact: its end, and what flies on then."""
        lift_off, bound = self._lift_off(time), self._kinks.bound
        end = self._kinks.no_later(lift_off) if lift_off < self._kinks.clear else bound
        self.phases.append(Phase(time, end, None))
        return end, self._leave(end) if end < bound else self._strike(end)

    def _fly(self, time: float, flight: Flight) -> tuple[float, Flight | None]:
        """A phase of flight, at most to the next kink: its end, and what flies on then."""
        angle, bound = self.angle(time), self._kinks.bound
        landing = landing_time(flight, self.law, angle, self.interval.speed, bound - time)
        end = bound if landing is None else self._kinks.no_later(time + landing)
        self.phases.append(Phase(time, end, flight))
        y, velocity = (float(x[0]) for x in flight.state(np.array([end - time])))
        self._kinks.take(end)
        if landing is None:
            return end, Flight(self.parameters, y, velocity)
        self._require_progress()
        return end, self._meet(end, velocity)

    def _strike(self, time: float) -> Flight | None:
        """The law's velocity jumps under a follower that rides it, if there is a kink here."""
        step = self._kinks.take(time)
        return self._meet(time, self.on_cam(time).velocity - step) if step else None

    def _require_progress(self) -> None:
        """An endless series of events would be a fault of the model: say so, do not hang."""
        if len(self.events) > MOST_EVENTS:
            raise DynamicsError(
                f"{len(self.events)} events in {self.interval.duration:g} s at "
                f"{self.interval.speed:g} rad/s; allowed: {MOST_EVENTS} an interval"
            )

    def angle(self, time: float) -> float:
        """Cam angle (rad) at a time since the interval's start, less its whole turns there."""
        return self._start + self.interval.speed * time

    def on_cam(self, time: float) -> FollowerState:
        """The follower as it would be on the cam at a time since the interval's start."""
        return state_at(self.law, self.parameters, self.angle(time), self.interval.speed)

    @property
    def end(self) -> FollowerState:
        """The follower at the end of the interval, before a kink that begins the next one."""
        last = self.phases[-1]
        if last.flight is not None:
            y, v = last.flight.state(np.array([last.end - last.begin]))
            return FollowerState(float(y[0]), float(v[0]), 0.0, in_contact=False)
        angle = short_of_kink(self.law, self.angle(last.end))
        return state_at(self.law, self.parameters, angle, self.interval.speed)

    def _begin(self, state: FollowerState | None) -> Flight | None:
        if state is None:
            return self._strike(0.0)
        self._kinks.take(0.0)
        if not state.in_contact:
            return Flight(self.parameters, state.displacement, state.velocity)
        # A jump of the cam's velocity where two intervals join, by a change of speed or by the law,
        # throws the follower off or strikes it.
        return self._meet(0.0, state.velocity)

    def _lift_off(self, time: float) -> float:
        """Time of the next lift-off, infinity when the cam never has to pull."""
        losses = loss_intervals(self.law, self.parameters, self.interval.speed)
        angle = self.angle(time)
        turn = float(np.floor(angle / TURN)) * TURN
        for start, stop in (*losses, *((a + TURN, b + TURN) for a, b in losses)):
            if turn + stop - angle > GRAZE:
                return time + max(0.0, (turn + start - angle) / self.interval.speed)
        return float("inf")

    def _leave(self, time: float) -> Flight:
        cam = self.on_cam(time)
        self.events.append(self._event("lift-off", time))
        return Flight(self.parameters, cam.displacement, cam.velocity)

    def _meet(self, time: float, velocity: float) -> Flight | None:
        """The follower comes to the cam with ``velocity``: what flies on, or None for contact."""
        cam = self.on_cam(time)
        approach = cam.velocity - velocity
        if abs(approach) <= STILL * self.interval.speed * self.law.lift:
            return None
        if approach < 0.0:
            self.events.append(self._event("lift-off", time))
            return Flight(self.parameters, cam.displacement, velocity)
        p = self.parameters
        rebound = p.restitution * approach
        least = least_bounce(self.law, p.restitution, gap_rounding(self.law, cam.displacement))
        if rises(rebound, cam.contact_force / p.mass, least):
            self._land(time, approach, p.restitution)
            return Flight(p, cam.displacement, cam.velocity + rebound)
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
        return Event(kind, time, self._turns + self.angle(time), impulse, lost)
