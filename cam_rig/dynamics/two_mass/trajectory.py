"""The two-mass follower in contact, at lift-off, in flight and landing (eq. 14-19).

Phases are closed forms, events are roots; nothing is stepped. A landing stops the roller mass on
the cam (ż := ṡ, the paper's plastic re-contact) or rebounds with Newton's restitution; the
end mass goes on with the velocity it had. The same holds where the law's velocity jumps: up is an
impact on the roller mass, m₁ (1 + e) ω Δs', down lifts it off with the velocity it had.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from cam_rig.dynamics.events.contact import (
    ROUNDING_ERRORS,
    contact_loss,
    contact_table,
    free_table,
    jumps_table,
    law_table,
    loss_in_part,
    table_of,
)
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
from cam_rig.dynamics.events.runs import TwoMassTable, run_two_mass
from cam_rig.dynamics.events.search import at_start, call, search
from cam_rig.dynamics.interval import NO_IMPACT, Event, EventKind, least_bounce
from cam_rig.dynamics.linear.exponential import Flight
from cam_rig.dynamics.linear.response import LinearResponse
from cam_rig.dynamics.linear.sampling import polynomial_parts
from cam_rig.dynamics.parameters import require_angle, require_number, state_of
from cam_rig.dynamics.two_mass.masses import (
    TwoMassParameters,
    contact_response,
    force_output,
    free_masses,
    from_inner,
    to_inner,
)
from cam_rig.dynamics.velocity_jumps import short_of_velocity_jump
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law, bernstein
from cam_rig.laws.bernstein import EPS
from cam_rig.units import TURN, FloatArray

# What ends contact in the two-mass model: the force falls to zero.


def fly(parameters: TwoMassParameters, state: FloatArray, times: FloatArray) -> FloatArray:
    """(z, ż, y, ẏ) of free motion at times (s) after ``state``, ``(4, len(times))``."""
    start = to_inner(parameters, state)
    way, _ = free_masses(parameters).moved(start, times)
    return from_inner(parameters, start[:, None] + way)


def lift_off(
    law: Law,
    parameters: TwoMassParameters,
    speed: float,
    angle: float,
    state: FloatArray,
    limit: float,
) -> tuple[float, FloatArray] | None:
    """Time (s) after which the contact force is negative, and (η, η̇) then.

    None when not within ``limit``; ``state`` is (η, η̇) at cam angle ``angle`` (rad).
    """
    require_angle(angle)
    require_number("limit", limit, "≥ 0")
    response, output = contact_response(law, parameters, speed), force_output(parameters)
    place, velocity = state_of(state, 2).tolist()
    found, *vibration = call(
        contact_loss,
        lambda arrays: contact_table(response, output, arrays),
        speed,
        float(angle),
        (place, velocity),
        float(limit),
    )
    return None if found < 0.0 else (found, np.array(vibration))


def first_lift_off(
    law: Law, parameters: TwoMassParameters, speed: float, state: FloatArray, limit: float
) -> float | None:
    """Time (s) of the first lift-off of a run from θ = 0 on, None when not within ``limit``.

    As `lift_off`, but all parts of all turns are bounded at once, and the root is sought only in
    those that the bound leaves.
    """
    response, output = contact_response(law, parameters, speed), force_output(parameters)
    turns = max(1, math.ceil(limit * speed / TURN))
    free = response.free_starts(state, turns)
    for turn, i in np.argwhere(may_fall(response, parameters, free)).tolist():
        part = response.parts[i]
        begin = (turn * TURN + part.low) / speed
        left = min(part.length, limit - begin)
        if left <= 0.0:
            break
        table = partial(contact_table, response, output, only=part)
        found = float(call(loss_in_part, table, *free[turn, i].tolist(), left))
        if found >= 0.0:
            return begin + found
    return None


def may_fall(
    response: LinearResponse, parameters: TwoMassParameters, free: FloatArray
) -> NDArray[np.bool_]:
    """Whether the force may fall to zero in each part of each turn, ``(turns, parts)``.

    It is no lower than at the lower end of a part less what a curve of so much bend may sag, nor
    than the polynomial's least ordinate less the vibration, whose energy does not grow.
    """
    output, matrix = force_output(parameters), response.matrix
    ordinates = polynomial_parts(response, output)
    width = max(rows.shape[1] for rows in ordinates)
    forced = np.stack([bernstein.elevate(rows[0], width - 1) for rows in ordinates])
    lengths = np.array([part.length for part in response.parts])
    change = np.abs(np.diff(forced, n=2, axis=1)).max(axis=1)
    bend = (width - 1) * (width - 2) * change / lengths**2
    row, rate = output.state[0], math.sqrt(-matrix[1, 0])
    reach = abs(float(row[0])) / rate + abs(float(row[1]))
    flows = np.stack([part.flow for part in response.parts])
    ends = np.einsum("pij,tpj->tpi", flows, free)
    acceleration = free @ (matrix @ matrix).T
    bend = bend + reach * np.hypot(rate * acceleration[..., 0], acceleration[..., 1])
    vibration = reach * np.hypot(rate * free[..., 0], free[..., 1])
    lower = np.minimum(forced[:, 0] + free @ row, forced[:, -1] + ends @ row)
    noise = ROUNDING_ERRORS * EPS * np.abs(forced).max(axis=1)
    above = np.maximum(lower - bend * lengths**2 / 8.0, forced.min(axis=1) - vibration)
    return np.asarray(above <= noise)


def force_noise(law: Law, p: TwoMassParameters, speed: float) -> float:
    """By how much the roller's acceleration may be wrong where the force falls to zero, m/s²."""
    lift, slope, bend = law.bounds
    force = p.roller_mass * (speed**2 * bend) + p.share * p.preload
    force += p.spring_stiffness * lift + (p.stem_damping + p.damping) * speed * slope
    return ROUNDING_ERRORS * EPS * force / p.roller_mass


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
    events: list[Event] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._rows: list[list[float]] = []
        self._phases: list[TwoMassPhase] = []
        require_angle(self.angle)
        self._response: LinearResponse = contact_response(self.law, self.parameters, self.speed)
        self._system = free_masses(self.parameters)
        self._force = force_output(self.parameters)
        #: What the roller is after the last phase: a vibration (η, η̇) on the cam, or a flight.
        self.last: FloatArray | Flight = np.zeros(2)

    def run(self, duration: float, state: FloatArray | None = None, contact: bool = True) -> None:
        """Find all phases and events up to ``duration`` s, from rest on the cam by default.

        From rest is without vibration (η = η̇ = 0): the end mass goes with the turning cam.
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
        now = at_start(4, [], step)
        if isinstance(start, Flight):
            now[STATE:] = start.start.tolist()
            gap, opening = start.known or (0.0, 0.0)
            fly_from(now, bool(start.known), gap, opening)
        else:
            now[STATE : STATE + 2] = state_of(start, 2).tolist()
        for found in search(run_two_mass, partial(self._table, duration), now, duration):
            self._rows += found.phases
            self.events += [self._event(*row) for row in found.events]
            if len(self.events) > MAX_EVENTS:
                raise DynamicsError(
                    f"more than {MAX_EVENTS} events in {now[TIME]:g} s; allowed: {MAX_EVENTS} a run"
                )
        self.last = self._state(now)

    def _table(self, duration: float, arrays: bool) -> TwoMassTable:
        law, p, speed = self.law, self.parameters, self.speed
        return table_of(
            TwoMassTable,
            arrays,
            Cam(law_table(law, arrays), speed, self.angle),
            free_table(self._system, arrays),
            jumps_table(law, self.angle, speed, duration, arrays),
            contact_table(self._response, self._force, arrays),
            np.append(self._force.law[0], self._force.constant),
            self._response.drive[1],
            p.roller_mass,
            p.end_mass / (p.roller_mass + p.end_mass),
            p.spring_stiffness / p.stiffness,
            p.preload / p.stiffness,
            p.restitution,
            force_noise(law, p, speed),
            least_bounce(law),
            NO_IMPACT * speed * law.lift,
        )

    @property
    def phases(self) -> list[TwoMassPhase]:
        """All phases so far, in order; each is made when it is asked for first."""
        self._phases += [self._phase(row) for row in self._rows[len(self._phases) :]]
        return self._phases

    def _phase(self, row: list[float]) -> TwoMassPhase:
        state = self._state(row)
        if isinstance(state, Flight):
            return TwoMassPhase(row[TIME], row[END], np.zeros(2), state)
        return TwoMassPhase(row[TIME], row[END], state)

    def _state(self, row: list[float]) -> FloatArray | Flight:
        """What the roller is in a row of a run's numbers: a vibration on the cam, or a flight."""
        if not row[FLYING]:
            return np.array(row[STATE : STATE + 2])
        known = (row[GAP], row[OPENING]) if row[KNOWN] else ()
        return self.lifted_off(np.array(row[STATE : STATE + 4]), *known)

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

    def cam_at_end(self, time: float) -> FloatArray:
        """The same where an interval ends: before a velocity jump that begins the next one."""
        angle = short_of_velocity_jump(self.law, self.angle + self.speed * time)
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

    def _event(self, landing: float, time: float, impulse: float, lost: float) -> Event:
        kind: EventKind = "landing" if landing else "lift-off"
        return Event(kind, time, self.angle + self.speed * time, impulse, lost)
