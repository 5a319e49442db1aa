"""The one-mass follower through one interval: phases of contact and flight, and their events."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from cam_rig.dynamics.events.contact import free_table, jumps_table, law_table, table_of
from cam_rig.dynamics.events.law_table import (
    END,
    FLYING,
    GAP,
    KNOWN,
    OPENING,
    STATE,
    TIME,
    Cam,
    fly_from,
)
from cam_rig.dynamics.events.runs import OneMassTable, run_one_mass
from cam_rig.dynamics.events.search import at_start, search
from cam_rig.dynamics.interval import (
    NO_IMPACT,
    Block,
    Event,
    EventKind,
    FollowerState,
    Interval,
    SampleGrid,
    Samples,
    least_bounce,
    show_impulses,
)
from cam_rig.dynamics.kinetostatic import (
    contact_samples,
    force_rounding,
    loss_intervals,
    state_at,
)
from cam_rig.dynamics.linear.exponential import Flight, FreeSystem, Pairs
from cam_rig.dynamics.parameters import FollowerParameters, require_turning, told
from cam_rig.dynamics.speed_ramp import with_ramps
from cam_rig.dynamics.velocity_jumps import short_of_velocity_jump
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.units import NS, FloatArray

# One mass in the air: m ÿ + c ẏ + k y + preload = 0.


@lru_cache(maxsize=64)
def free_mass(parameters: FollowerParameters) -> FreeSystem:
    """The follower without the cam; its state is (y, ẏ) in m and m/s."""
    p = parameters
    stiffness, damping = p.spring_stiffness / p.mass, p.damping / p.mass
    return FreeSystem(
        matrix=np.array([[0.0, 1.0], [-stiffness, -damping]]),
        load=np.array([0.0, -p.preload / p.mass]),
        row=np.array([1.0, 0.0]),
        energy=np.diag([np.sqrt(stiffness), 1.0]),
        pairs=Pairs(np.eye(2), np.eye(2), np.array([damping]), np.array([stiffness])),
    )


def lifted_off(
    parameters: FollowerParameters,
    start: float,
    velocity: float,
    gap: float | None = None,
    opening: float | None = None,
) -> Flight:
    """The flight from a displacement (m) and a velocity (m/s); the rest as in `Flight`."""
    return Flight(free_mass(parameters), np.array([start, velocity]), gap, opening)


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
    it off with the velocity it had. The search itself is `cam_rig.dynamics.events.runs`.
    """

    law: Law
    parameters: FollowerParameters
    interval: Interval
    events: list[Event] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._rows: list[list[float]] = []
        self._phases: list[OneMassPhase] = []
        self._system = free_mass(self.parameters)
        self._last: Flight | None = None

    def run(self, state: FollowerState | None, step: float = 0.0) -> None:
        """Find all phases of the interval; ``state`` None puts the follower on the cam.

        ``step`` is by how much the cam's velocity is more than where the state ended, m/s.
        """
        now = at_start(2, [], step)
        if step == 0.0 and (state is None or state.in_contact) and self._stays:
            self._rows.append([*now, 0.0, 0.0, self.interval.duration])
            return
        if state is not None and not state.in_contact:
            now[STATE:] = state.displacement, state.velocity
            gap, opening = state.inner or (0.0, 0.0)
            fly_from(now, bool(state.inner), gap, opening)
        for found in search(run_one_mass, self._table, now, self.interval.duration):
            self._rows += found.phases
            self.events += [self._event(*row) for row in found.events]
            self._require_progress()
        self._last = self._flight(now)

    @property
    def _stays(self) -> bool:
        """Whether nothing in a turn takes a follower off the cam."""
        losses = loss_intervals(self.law, self.parameters, self.interval.speed)
        return not (losses or self.law.velocity_jumps)

    def _table(self, arrays: bool) -> OneMassTable:
        law, p, interval = self.law, self.parameters, self.interval
        angle, speed = interval.angle, interval.speed
        losses = np.array(loss_intervals(law, p, speed)).reshape(-1, 2)
        return table_of(
            OneMassTable,
            arrays,
            Cam(law_table(law, arrays), speed, angle),
            free_table(self._system, arrays),
            jumps_table(law, angle, speed, interval.duration, arrays),
            losses,
            np.array([p.spring_stiffness, p.damping, p.mass, p.preload]),
            p.mass,
            told("restitution", p.restitution),
            force_rounding(law, p, speed) / p.mass,
            least_bounce(law),
            NO_IMPACT * speed * law.lift,
        )

    def _require_progress(self) -> None:
        """An endless series of events would be a fault of the model: say so, do not hang."""
        if len(self.events) > MAX_EVENTS:
            raise DynamicsError(
                f"more than {MAX_EVENTS} events in {self.interval.duration:g} s at "
                f"{self.interval.speed:g} rad/s; allowed: {MAX_EVENTS} an interval"
            )

    @property
    def phases(self) -> list[OneMassPhase]:
        """All phases so far, in order; each is made when it is asked for first."""
        self._phases += [self._phase(row) for row in self._rows[len(self._phases) :]]
        return self._phases

    def _phase(self, row: list[float]) -> OneMassPhase:
        return OneMassPhase(row[TIME], row[END], self._flight(row))

    def _flight(self, row: list[float]) -> Flight | None:
        """The flight that begins with a row of a run's numbers, None in contact."""
        if not row[FLYING]:
            return None
        known = (row[GAP], row[OPENING]) if row[KNOWN] else ()
        return Flight(self._system, np.array(row[STATE : STATE + 2]), *known)

    def _event(self, landing: float, time: float, impulse: float, lost: float) -> Event:
        kind: EventKind = "landing" if landing else "lift-off"
        return Event(kind, time, self.interval.unwrapped_at(time), impulse, lost)

    def on_cam(self, time: float) -> FollowerState:
        """The follower as it would be on the cam at a time since the interval's start."""
        angle = self.interval.angle + self.interval.speed * time
        return state_at(self.law, self.parameters, angle, self.interval.speed)

    @property
    def end(self) -> FollowerState:
        """The follower at the end of the interval, before a velocity jump of the next one."""
        last = self._last
        if last is not None:
            y, v = last.start.tolist()
            return FollowerState(y, v, 0.0, in_contact=False, inner=last.known)
        at = self.interval.angle + self.interval.speed * self.phases[-1].end
        angle = short_of_velocity_jump(self.law, at)
        return state_at(self.law, self.parameters, angle, self.interval.speed)


# One mass on a rigid stem: contact, lift-off, flight, landing.


@with_ramps
def advance(
    law: Law,
    parameters: FollowerParameters,
    state: FollowerState | None,
    interval: Interval,
    sample_rate: int,
    step: float,
) -> tuple[FollowerState, Block]:
    """Take the follower through the interval, exactly.

    Parameters
    ----------
    state : where the interval before it ended; None puts the follower down on the cam
    sample_rate : Hz
    step : by how much ṡ is more than where ``state`` ended, m/s
    """
    require_turning(interval.speed)
    course = OneMassTrajectory(law, parameters, interval)
    course.run(state, step)
    rows = contact_samples(law, parameters, interval, sample_rate)
    grid = interval.grid(sample_rate)
    for phase in course.phases:
        if phase.flight is not None:
            _show_flight(rows, grid, phase)
    pending = state.pending_impulse if state is not None else 0.0
    pending = show_impulses(rows, grid, course.events, pending)
    end = replace(course.end, pending_impulse=pending)
    begun = interval.start_ns / NS
    events = tuple(replace(event, time=begun + event.time) for event in course.events)
    return end, Block(interval, rows, events)


def _show_flight(rows: FloatArray, grid: SampleGrid, phase: OneMassPhase) -> None:
    """Put the free motion in place of the law where the follower flies."""
    assert phase.flight is not None
    first, end = grid.index_after(phase.begin), min(grid.index_after(phase.end), grid.count)
    if first < end:
        times = grid.offset + np.arange(first, end) / grid.sample_rate - phase.begin
        shown = Samples(rows)
        shown.motion[:, first:end] = phase.flight.motion(times)
        shown.force[first:end] = 0.0
