"""Models of the comparison as linear phases, with the changes between phases.

In flight the gap g between cam and follower is the state, instead of the follower's position. It
starts at exactly zero, so that rounding is not a landing for a peer.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np

from cam_rig.laws import Law
from cam_rig.units import TURN, FloatArray

# -- phase of a model: a linear differential equation, and the guard that ends it

#: A float, or a number with more digits.
Number = Any

Vector = Sequence[Number]


@dataclass(frozen=True)
class BenchPhase:
    """Linear phase of m positions. Its state q has length 2m.

    Parameters ----------
    rows : ``(m, 2m)`` accelerations of the positions by q
    drive : ``(m, 4)`` accelerations by s, ṡ, s̈ and 1
    show : ``(k, m)`` output displacements by the positions, also for output velocities
    show_lift : ``(k,)`` weight of the lift in the outputs
    guard, guard_drive : ``(2m,)`` and ``(4,)``, or None for a phase without an end
    on_cam : True for contact, which can also end by a jump of the law's acceleration
    """

    rows: Sequence[Vector]
    drive: Sequence[Vector]
    show: Sequence[Vector]
    show_lift: Vector
    guard: Vector | None = None
    guard_drive: Vector = (0, 0, 0, 0)
    on_cam: bool = False

    @property
    def size(self) -> int:
        """Length of q."""
        return 2 * len(self.rows)

    def guard_value(self, q: Vector, motion: Vector) -> Number:
        """Return the guard at state q and at (s, ṡ, s̈, 1)."""
        assert self.guard is not None
        return dot(self.guard, q) + dot(self.guard_drive, motion)

    def outputs(self, q: Vector, motion: Vector) -> tuple[list[Number], list[Number]]:
        """Return the compared displacements and velocities."""
        m = self.size // 2
        pairs = list(zip(self.show, self.show_lift, strict=True))
        return (
            [dot(row, q[:m]) + lift * motion[0] for row, lift in pairs],
            [dot(row, q[m:]) + lift * motion[1] for row, lift in pairs],
        )


def dot(first: Vector, second: Vector) -> Number:
    """Return the scalar product, in the type of the numbers."""
    total: Number = 0
    for a, b in zip(first, second, strict=True):
        total = total + a * b
    return total


CONTACT = "contact"
FLIGHT = "flight"
LIFT_OFF = "lift-off"
LANDING = "landing"

#: Next phase, its state, and the events at the change.
Switch = tuple[str, Vector, tuple[str, ...]]


@dataclass(frozen=True)
class BenchModel:
    """Model that consists of linear phases, in SI units."""

    def typed(self, number: Callable[[float], Number]) -> Self:
        """Return the model with another type of numbers."""
        return replace(self, **{f.name: number(getattr(self, f.name)) for f in fields(self)})

    def phases(self) -> Mapping[str, BenchPhase]:
        """Return the phases by name."""
        raise NotImplementedError

    def begin(self) -> tuple[str, Vector]:
        """Return the first phase and its state, at rest on the low dwell."""
        raise NotImplementedError

    def switch(self, name: str, q: Vector, motion: Vector) -> Switch:
        """Return the change of phase at a zero of the guard, at state q and (s, ṡ, s̈, 1)."""
        raise NotImplementedError


@dataclass(frozen=True)
class Oscillator(BenchModel):
    """Elastic stem in contact: m ẍ + c ẋ + (k_spring + k_stem) x = k_stem s.

    This is eq. 5.
    """

    mass: Number
    damping: Number
    spring_stiffness: Number
    stem_stiffness: Number

    def phases(self) -> Mapping[str, BenchPhase]:
        """Return the only phase, which does not end."""
        m = self.mass
        row = (-(self.spring_stiffness + self.stem_stiffness) / m, -self.damping / m)
        return {CONTACT: BenchPhase((row,), ((self.stem_stiffness / m, 0, 0, 0),), ((1,),), (0,))}

    def begin(self) -> tuple[str, Vector]:
        """Return the state at rest."""
        return CONTACT, (0 * self.mass, 0 * self.mass)


@dataclass(frozen=True)
class TwoMasses(BenchModel):
    """Roller mass m₁ and stem mass m₂ (eq. 14-19) with plastic landings.

    The outputs are z and y. The preload pulls m₂ towards the cam: m₂ÿ + (c₁+c₂)ẏ + (k₁+k₂)y = c₁ṡ +
    k₁s − preload in contact, where F = m₁s̈ + c₁(ṡ−ẏ) + k₁(s−y). If F is negative after a landing,
    a lift-off follows at the same time.
    """

    roller_mass: Number
    stem_mass: Number
    stem_stiffness: Number
    spring_stiffness: Number
    stem_damping: Number
    spring_damping: Number
    preload: Number

    def phases(self) -> Mapping[str, BenchPhase]:
        """Return contact with q = (y, ẏ) and flight with q = (g, y, ġ, ẏ)."""
        m1, m2, k1, c1 = self.roller_mass, self.stem_mass, self.stem_stiffness, self.stem_damping
        k, c = k1 + self.spring_stiffness, c1 + self.spring_damping
        pull = (k1 / m2, c1 / m2, 0, -self.preload / m2)
        contact = BenchPhase(
            rows=((-k / m2, -c / m2),),
            drive=(pull,),
            show=((0,), (1,)),
            show_lift=(1, 0),
            guard=(-k1, -c1),
            guard_drive=(k1, c1, m1, 0),
            on_cam=True,
        )
        flight = BenchPhase(
            rows=((-k1 / m1, k1 / m1, -c1 / m1, c1 / m1), (k1 / m2, -k / m2, c1 / m2, -c / m2)),
            drive=((-k1 / m1, -c1 / m1, -1, 0), pull),
            show=((1, 0), (0, 1)),
            show_lift=(1, 0),
            guard=(1, 0, 0, 0),
        )
        return {CONTACT: contact, FLIGHT: flight}

    def begin(self) -> tuple[str, Vector]:
        """Return the static equilibrium on the cam."""
        y = -self.preload / (self.stem_stiffness + self.spring_stiffness)
        return CONTACT, (y, 0 * y)

    def switch(self, name: str, q: Vector, motion: Vector) -> Switch:
        """Return a lift-off, or a landing with ż := ṡ.

        If F is then negative, a lift-off follows at the same time.
        """
        if name == CONTACT:
            return FLIGHT, (0 * q[0], q[0], 0 * q[0], q[1]), (LIFT_OFF,)
        on_cam = (q[1], q[3])
        if self.phases()[CONTACT].guard_value(on_cam, motion) < 0:
            return FLIGHT, (0 * q[1], q[1], 0 * q[1], q[3]), (LANDING, LIFT_OFF)
        return CONTACT, on_cam, (LANDING,)


@dataclass(frozen=True)
class OneMass(BenchModel):
    """One mass on a rigid stem with Newton's restitution.

    A rebound lower than ``least_bounce`` is contact. It ends a series of infinitely many bounces.
    """

    mass: Number
    damping: Number
    stiffness: Number
    preload: Number
    restitution: Number
    least_bounce: Number

    def phases(self) -> Mapping[str, BenchPhase]:
        """Return contact, which has no state (it is the law), and flight with q = (g, ġ)."""
        m, c, k = self.mass, self.damping, self.stiffness
        force = (k, c, m, self.preload)
        contact = BenchPhase((), (), ((),), (1,), (), force, on_cam=True)
        drive = tuple(-weight / m for weight in force)
        flight = BenchPhase(((-k / m, -c / m),), (drive,), ((1,),), (1,), (1, 0))
        return {CONTACT: contact, FLIGHT: flight}

    def begin(self) -> tuple[str, Vector]:
        """Return contact with the cam."""
        return CONTACT, ()

    def switch(self, name: str, q: Vector, motion: Vector) -> Switch:
        """Return a lift-off, or a landing with ġ := −e ġ.

        After the last bounce ġ := 0.
        """
        zero = 0 * self.mass
        if name == CONTACT:
            return FLIGHT, (zero, zero), (LIFT_OFF,)
        force = self.phases()[CONTACT].guard_value((), motion)
        rebound = -self.restitution * q[1]
        if rebound > 0 and (force <= 0 or self.mass * rebound**2 > 2 * force * self.least_bounce):
            return FLIGHT, (zero, rebound), (LANDING,)
        if force < 0:
            return FLIGHT, (zero, zero), (LANDING, LIFT_OFF)
        return CONTACT, (), (LANDING,)


@dataclass(frozen=True)
class Twist:
    """Parameters of the torsional model.

    Parameters
    ----------
    inertia : inertia of the cam, kg·m²
    shaft_stiffness : N·m/rad
    mass, damping, stiffness, preload : those of the follower, SI units
    """

    inertia: float
    shaft_stiffness: float
    mass: float
    damping: float
    stiffness: float
    preload: float


# -- case of the comparison, and its solution by any solver


@dataclass(frozen=True, eq=False)
class Case:
    """Model with a law at a speed.

    Parameters ----------
    model : parameters, which determine the equations
    speed : rad/s
    turns : turns of the cam, from angle 0
    times : ``(n,)`` output times in s
    quick_turns : turns in a quick comparison
    """

    name: str
    title: str
    law: Law
    model: BenchModel | Twist
    speed: float
    turns: int
    quick_turns: int
    times: FloatArray

    @property
    def duration(self) -> float:
        """Duration (s) of the case."""
        return self.turns * TURN / self.speed

    def first_turns(self, turns: int) -> Case:
        """Return the first turns of the case, with their output times."""
        short = replace(self, turns=min(turns, self.turns))
        return replace(short, times=self.times[self.times <= short.duration])

    def lasting(self, turns: int) -> Case:
        """Return the case with another number of turns, and as many outputs per turn."""
        times = output_times(self.speed, turns, self.times.size // self.turns)
        return replace(self, turns=turns, quick_turns=turns, times=times)

    def fresh(self) -> Case:
        """Return the case with a copy of its law that has no cached results."""
        return replace(self, law=Law(self.law.name, self.law.breaks, self.law.ordinates))


def output_times(speed: float, turns: int, per_turn: int) -> FloatArray:
    """Return ``per_turn`` times in each turn, except its start and its end."""
    count = turns * per_turn
    return np.asarray((np.arange(count) + 0.5) * (turns * TURN / speed / count))


@dataclass(frozen=True, eq=False)
class Solution:
    """Compared outputs and events of a solver.

    Parameters ----------
    displacement, velocity : ``(k, n)`` at the output times of the case, SI units
    events : type and time (s), in order
    """

    displacement: FloatArray
    velocity: FloatArray
    events: tuple[tuple[str, float], ...] = ()

    def error(self, reference: Solution) -> float:
        """Return the larger of the errors of displacement and velocity.

        Each is the largest difference relative to the largest value.
        """
        pairs = ((self.displacement, reference.displacement), (self.velocity, reference.velocity))
        return max(float(np.abs(x - y).max() / np.abs(y).max()) for x, y in pairs)

    def event_error(self, reference: Solution) -> float | None:
        """Return the largest time (s) from an event to the nearest event of the same type.

        Thus missing and additional events also have an error. The result is None without events,
        and infinite if only one solution has events of a type.
        """
        kinds = {kind for kind, _ in (*self.events, *reference.events)}
        return max((self._apart(reference, kind) for kind in kinds), default=None)

    def _apart(self, reference: Solution, kind: str) -> float:
        mine, other = (
            np.array([time for k, time in events if k == kind])
            for events in (self.events, reference.events)
        )
        if not (mine.size and other.size):
            return float("inf")
        distance = np.abs(mine[:, None] - other[None, :])
        return float(max(distance.min(axis=0).max(), distance.min(axis=1).max()))
