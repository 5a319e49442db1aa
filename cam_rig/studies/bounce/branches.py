"""Periodic bouncing, stable or not, followed over what is swept, and where it changes.

A motion of period n is a root of Pⁿ(x) − x of the turn's map P, found by Newton's iteration with
the exact derivative, whose eigenvalues are its multipliers. A branch is followed by its arc length
(Keller 1977), so it goes round a fold; what happens on it is a root along it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import combinations, pairwise
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from cam_rig.dynamics.turn_map import State, StroboscopicMap
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.studies.bounce.sweep import OperatingPoint, Sweep
from cam_rig.units import FloatArray

#: A root is one where an iteration moves by no more than this part of lift and speed; what is not
#: so after so many is none.
CONVERGED, ITERATIONS = 1e-13, 20
#: Rounding leaves a residual below this where a motion is strongly stretched.
LEFT = 1e-10
#: First, shortest and longest step along a branch, in parts of lift and speed; and most of them.
FIRST, SHORTEST, LONGEST, MOST_STEPS = 1e-3, 1e-9, 5e-3, 20_000
#: Relative step of what is swept for the derivative by it, which an iteration takes, and no result.
NUDGE = 1e-7
#: Halves of a period are alike to this part of the lift times the speed where it is born; and so
#: far beyond an end of a branch another number of landings is looked for.
ALIKE, BEYOND = 1e-3, (1e-8, 1e-7, 1e-6, 1e-5)
#: To this part of itself the place of a bifurcation is told.
TOLD = 1e-6
#: Motions at one place whose hardest landings differ by no more than this part are one.
SAME = 1e-3
#: A derivative that changes by more than this part of itself so near to an end leaps there.
LEAP = 1e-2
#: A multiplier that is nearer to ±1 than this at a root passes it; else it jumps over it.
PASSES = 1e-5

LIFT_OFF, FLIP, FOLD = "first lift-off", "period doubling", "fold"
SPIRAL, GRAZE, CORNER, LOST = "Neimark-Sacker", "grazing", "corner", "not told"
WORDS = {
    LIFT_OFF: "on one side the follower stays on the cam; on the other it flies and bounces, and "
    "at first comes to rest in each turn",
    FLIP: "a multiplier is −1: beyond, the motion of this period is unstable, and one of twice the "
    "period begins or ends",
    FOLD: "a multiplier is +1: a stable and an unstable motion meet here, and beyond there is "
    "neither",
    SPIRAL: "two conjugate multipliers have the size 1: beyond, the motion is unstable, and turns "
    "go round it on a closed curve, which of two masses alone they can",
    GRAZE: "a landing of zero velocity: beyond, a turn has another number of landings",
    CORNER: "a landing is on a joint where the law's acceleration jumps: the multipliers jump with "
    "it, and a motion may end or change its stability",
    LOST: "the motion is not found beyond",
}


@dataclass(frozen=True, eq=False)
class PeriodicMotion:
    """A periodic motion."""

    point: OperatingPoint
    states: FloatArray  #: at the end of each turn, as `TurnsRun.states` has them
    derivative: FloatArray  #: ``(n, n)`` over the period, n = 2 for one mass, 4 for two
    landings: int  #: in the period
    hardest: float  #: m/s against the cam
    softest: float  #: m/s

    @property
    def period(self) -> int:
        """In turns."""
        return len(self.states)

    @property
    def state(self) -> State:
        """Where a period begins and ends."""
        return tuple(self.states[-1].tolist())

    @property
    def multipliers(self) -> NDArray[np.complex128]:
        """``(n,)`` what a small change is multiplied by in a period."""
        return np.linalg.eigvals(self.derivative).astype(np.complex128)

    @property
    def leading(self) -> complex:
        """The multiplier that is largest."""
        return complex(max(self.multipliers.tolist(), key=abs))

    @property
    def stable(self) -> bool:
        """Whether small changes die out."""
        return abs(self.leading) < 1.0

    @property
    def flip(self) -> float:
        """Zero where a multiplier is −1."""
        return float(np.linalg.det(np.eye(len(self.derivative)) + self.derivative))

    @property
    def fold(self) -> float:
        """Zero where a multiplier is +1."""
        return float(np.linalg.det(np.eye(len(self.derivative)) - self.derivative))

    @property
    def spiral(self) -> float:
        """Zero where two multipliers have a product of 1: a conjugate pair's size is 1 there."""
        pairs = combinations(self.multipliers.tolist(), 2)
        return float(np.prod([1.0 - a * b for a, b in pairs]).real)


@dataclass(frozen=True)
class Bifurcation:
    """Where a periodic motion changes its kind."""

    kind: str
    point: OperatingPoint
    period: int | None
    landings: int  #: in the period, before it

    def same_as(self, other: Bifurcation, sweep: Sweep) -> bool:
        """Whether both are one, come upon twice."""
        here, there = sweep.value(self.point), sweep.value(other.point)
        alike = self.kind == other.kind and self.period == other.period
        return alike and abs(here - there) < TOLD * sweep.size(here)


class UnfoundMotionError(DynamicsError):
    """No periodic motion is near: the iteration does not come to rest."""


#: The motion so far along a branch, and it scaled.
Ahead = Callable[[float], tuple[PeriodicMotion, FloatArray]]


@dataclass
class Family:
    """The periodic motions of a period, at any value of what is swept."""

    law: Law
    sweep: Sweep
    period: int
    _scale: FloatArray = field(init=False)  #: of the state's numbers and the value

    def at(self, value: float, state: State) -> PeriodicMotion:
        """The motion at a value (SI) near a state by Newton; an `UnfoundMotionError` for none."""
        self._scale = self._scale_of(value, state)
        start = np.array([*state, value]) / self._scale
        along = np.eye(start.size)[-1]
        return self._corrected(start, along, np.zeros(len(state)))[0]

    def followed(
        self, begin: PeriodicMotion, low: float, high: float, up: bool
    ) -> tuple[list[PeriodicMotion], list[Bifurcation]]:
        """From a motion on, first up or down, to an end of the branch or of the values (SI)."""
        value = self.sweep.value(begin.point)
        self._scale = self._scale_of(value, begin.state)
        motions, found = [begin], list[Bifurcation]()
        here, length = np.array([*begin.state, value]) / self._scale, FIRST
        by_value = self._by_value(here)
        along = self._tangent(begin, by_value, np.eye(here.size)[-1] * (1.0 if up else -1.0))
        for _ in range(MOST_STEPS):
            ahead = partial(self._ahead, here, along, by_value)
            try:
                motion, there = ahead(length)
                whole = motion.landings == motions[-1].landings
                met = list(self._between(motions[-1], motion, ahead, length))
            except DynamicsError:
                whole, met = False, []
            if not whole:
                length *= 0.5
                if length < SHORTEST:
                    found += self._end(motions[-1], here, along)
                    break
                continue
            motions.append(motion)
            found += met
            if not low <= self.sweep.value(motion.point) <= high:
                break
            here = there
            if length > 10.0 * NUDGE:  # else differences would reach over a corner
                by_value = self._by_value(there)
            along = self._tangent(motion, by_value, along)
            length = min(1.5 * length, LONGEST)
        else:  # nothing says how much further it goes
            found += self._end(motions[-1], here, along)
        return motions, found

    def _scale_of(self, value: float, state: State) -> FloatArray:
        """``(n + 1,)`` the sizes of a state's numbers and of what is swept."""
        point = self.sweep.at(value)
        usual = StroboscopicMap(self.law, point.parameters, point.speed).scale
        return np.append(np.maximum(usual, np.abs(state)), self.sweep.size(value))

    def _run(self, at: FloatArray) -> tuple[FloatArray, PeriodicMotion]:
        """Where a scaled (state, value) comes to in a period, scaled, and as a motion."""
        gap, *others, value = (at * self._scale).tolist()
        point = self.sweep.at(value)
        turn_map = StroboscopicMap(self.law, point.parameters, point.speed)
        run = turn_map.run(self.period, (max(gap, 0.0), *others))
        motion = PeriodicMotion(
            point=point,
            states=run.states,
            derivative=run.derivative(),
            landings=int(run.landings.sum()),
            hardest=float(run.max_landing_speeds.max()),
            softest=float(run.min_landing_speeds.min()),
        )
        return run.states[-1] / self._scale[:-1], motion

    def _by_value(self, at: FloatArray) -> FloatArray:
        """``(n,)`` derivative of `_run` by the scaled value, by differences short of a graze."""
        ahead = np.eye(at.size)[-1] * NUDGE
        places = [at - ahead if at[-1] > NUDGE else at, at, at + ahead]
        reached, motions = zip(*map(self._run, places), strict=True)
        first, last = (i if motions[i].landings == motions[1].landings else 1 for i in (0, 2))
        apart = max(places[last][-1] - places[first][-1], NUDGE)
        return np.asarray((reached[last] - reached[first]) / apart)

    def _matrix(self, motion: PeriodicMotion, by_value: FloatArray) -> FloatArray:
        """``(n, n + 1)`` derivative of Pⁿ(x) − x, scaled."""
        size = self._scale[:-1]
        own = motion.derivative * size / size[:, None] - np.eye(size.size)
        return np.column_stack([own, by_value])

    def _tangent(
        self, motion: PeriodicMotion, by_value: FloatArray, along: FloatArray
    ) -> FloatArray:
        """``(n + 1,)`` the branch's unit vector on the side of ``along``."""
        found = np.linalg.svd(self._matrix(motion, by_value))[2][-1]
        return np.asarray(found if found @ along >= 0.0 else -found)

    def _corrected(
        self, start: FloatArray, along: FloatArray, by_value: FloatArray
    ) -> tuple[PeriodicMotion, FloatArray]:
        """The motion on the plane through a start, normal to ``along``; and it scaled."""
        at, last = start, math.inf
        for _ in range(ITERATIONS):
            reached, motion = self._run(at)
            residual = np.array([*(reached - at[:-1]), along @ (at - start)])
            matrix = np.vstack([self._matrix(motion, by_value), along])
            try:
                step = np.linalg.solve(matrix, -residual)
            except np.linalg.LinAlgError:
                break
            size = float(np.abs(step).max())
            if size <= CONVERGED or (size <= LEFT and size >= 0.5 * last):
                return motion, at
            if not size < 1.0:
                break
            at, last = at + step, size
        near = self.sweep.words(float(start[-1] * self._scale[-1]))
        raise UnfoundMotionError(
            f"no motion of period {self.period} is found near {near}; allowed: a start nearer to "
            "one"
        )

    def _ahead(
        self, here: FloatArray, along: FloatArray, by_value: FloatArray, length: float
    ) -> tuple[PeriodicMotion, FloatArray]:
        """The motion so far along the branch; and it scaled."""
        return self._corrected(here + length * along, along, by_value)

    def _between(
        self, before: PeriodicMotion, after: PeriodicMotion, ahead: Ahead, length: float
    ) -> Iterator[Bifurcation]:
        """What happens between two motions of a branch, a step apart."""
        for kind, name in ((FLIP, "flip"), (FOLD, "fold"), (SPIRAL, "spiral")):
            test: Callable[[PeriodicMotion], float] = attrgetter(name)
            if test(before) * test(after) < 0.0:
                at = brentq(lambda part, f=test: f(ahead(part)[0]), 0.0, length, xtol=1e-15)
                motion, _ = ahead(at)
                if kind == SPIRAL and not motion.leading.imag:
                    continue  # a real pair, of which one grows on either side
                told = kind if abs(test(motion)) < PASSES else CORNER
                yield Bifurcation(told, motion.point, self.period, motion.landings)
                if told == CORNER:
                    return  # both may leap there

    def _end(
        self, last: PeriodicMotion, here: FloatArray, along: FloatArray
    ) -> Iterator[Bifurcation]:
        """Why a branch ends: its halves have become alike, or a landing is new or gone beyond.

        Nothing where what is swept has its own end, as a restitution of 0 or 1.
        """
        kind, (one, half) = LOST, divmod(self.period, 2)
        if (
            half == 0
            and np.abs(last.states[:one] - last.states[one:]).max() < ALIKE * self._scale[1]
        ):
            yield Bifurcation(FLIP, last.point, one, last.landings // 2)
            return
        for beyond in BEYOND:
            try:
                motion = self._run(here + beyond * along)[1]
            except DynamicsError:
                return
            if motion.landings != last.landings:
                kind = GRAZE
                break
            change = np.abs(motion.derivative - last.derivative).max()
            if change > LEAP * np.abs(last.derivative).max():
                kind = CORNER
                break
        yield Bifurcation(kind, last.point, self.period, last.landings)


@dataclass(frozen=True, eq=False)
class Branch:
    """The periodic motions that are one curve over what is swept, in order along it."""

    motions: tuple[PeriodicMotion, ...]
    bifurcations: tuple[Bifurcation, ...]
    sweep: Sweep

    def holds(self, motion: PeriodicMotion) -> bool:
        """Whether a motion is on it: between two of its own, and as hard."""
        if motion.period != self.motions[0].period:
            return False
        at = self.sweep.value(motion.point)
        for a, b in pairwise(self.motions):
            low, high = self.sweep.value(a.point), self.sweep.value(b.point)
            if (low - at) * (high - at) <= 0.0 and low != high:
                part = (at - low) / (high - low)
                hardest = a.hardest + part * (b.hardest - a.hardest)
                if abs(hardest - motion.hardest) < SAME * hardest:
                    return True
        return False


def branch_through(
    law: Law, sweep: Sweep, begin: PeriodicMotion, low: float, high: float
) -> Branch:
    """The branch of a motion, both ways, as far as it is between two values (SI)."""
    family = Family(law, sweep, begin.period)
    down, found_below = family.followed(begin, low, high, up=False)
    up, found_above = family.followed(begin, low, high, up=True)
    return Branch((*down[:0:-1], *up), (*found_below[::-1], *found_above), sweep)


def branches(
    law: Law, sweep: Sweep, seen: Sequence[tuple[float, State, int]], low: float, high: float
) -> tuple[Branch, ...]:
    """Every branch between two values (SI) that has one of some motions.

    Of each its value, a state and its period; those that an iteration does not find, and that are
    on a branch already, begin none.
    """
    found = list[Branch]()
    for value, state, period in seen:
        try:
            motion = Family(law, sweep, period).at(value, state)
        except UnfoundMotionError:
            continue
        if not any(branch.holds(motion) for branch in found):
            found.append(branch_through(law, sweep, motion, low, high))
    return tuple(found)
