"""Continuation of periodic motions, stable or unstable, and their bifurcations.

A motion of period n is a root of Pⁿ(x) − x, where P maps the state x at cam angle 0 to the state
one turn later. Newton's iteration with the exact derivative finds it. The eigenvalues of the
derivative are its multipliers, the growth factors of small changes per period. Periodic motions
form curves over a swept quantity such as the speed, called branches. A branch is followed by its
arc length (Keller 1977), so it passes a fold, where it turns back. A bifurcation is a root of a
test function along the branch. Lengths are scaled by the magnitudes of the state and of the swept
value.
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

#: Newton step below which the iteration for a periodic motion has converged, relative to the
#: magnitudes of state and swept value.
NEWTON_RTOL = 1e-13
#: Largest number of Newton iterations for a periodic motion.
MAX_ITERATIONS = 20
#: Largest Newton step that counts as rounding when the steps no longer halve, relative to the
#: magnitudes of state and swept value. Motions that amplify small changes strongly do not reach
#: `NEWTON_RTOL`.
ROUNDING_RESIDUAL = 1e-10
#: First step along a branch of periodic motions, relative to the magnitudes of state and swept
#: value.
FIRST_STEP = 1e-3
#: Step along a branch of periodic motions below which the branch ends, relative to the magnitudes
#: of state and swept value.
MIN_STEP = 1e-9
#: Longest step along a branch of periodic motions, relative to the magnitudes of state and swept
#: value.
MAX_STEP = 5e-3
#: Largest number of steps along a branch of periodic motions.
MAX_STEPS = 20_000
#: Step of the swept value for difference quotients, relative to its magnitude. It affects the
#: convergence of the Newton iteration, not its result.
VALUE_STEP = 1e-7
#: Largest difference between the states after the first and the second half of a period at which
#: the motion repeats after half a period already, as a fraction of lift times speed.
HALF_PERIOD_RTOL = 1e-3
#: Distances beyond the end of a branch of periodic motions at which a motion is computed, relative
#: to the magnitudes of state and swept value. It shows whether the number of landings or the
#: derivative changes at the end.
DISTANCES_BEYOND = (1e-8, 1e-7, 1e-6, 1e-5)
#: Largest relative difference between the swept values of two bifurcations that count as the same.
BIFURCATION_RTOL = 1e-6
#: Largest relative difference between the fastest landings of two motions at the same swept value
#: that count as the same motion.
LANDING_RTOL = 1e-3
#: Relative change of a motion's derivative just beyond the end of a branch above which the
#: derivative counts as discontinuous.
JUMP_RTOL = 1e-2
#: Largest value of a bifurcation's test function (no unit) at its computed root for which a
#: multiplier passes ±1 continuously. At a larger value the multiplier jumps. A multiplier is the
#: growth factor of a small change of the state per period.
PASS_ATOL = 1e-5

# Kinds of bifurcation, as written in tables and JSON. `DESCRIPTIONS` explains each.

LIFT_OFF = "first lift-off"
FLIP = "period doubling"
FOLD = "fold"
SPIRAL = "Neimark-Sacker"
GRAZE = "grazing"
CORNER = "corner"
LOST = "undetermined"
#: Explanation of each kind of bifurcation, printed as a note below the table of bifurcations.
DESCRIPTIONS = {
    LIFT_OFF: "on one side the follower stays on the cam; on the other it flies and bounces, and "
    "at first comes to rest in each turn",
    FLIP: "a multiplier is −1: beyond, the motion of this period is unstable, and a motion of "
    "twice the period starts or ends",
    FOLD: "a multiplier is +1: a stable and an unstable motion meet here, and neither exists "
    "beyond",
    SPIRAL: "two conjugate multipliers have the magnitude 1: beyond, the motion is unstable, and "
    "the turns move around it on a closed curve; only two masses can do so",
    GRAZE: "a landing of zero velocity: beyond, a turn has another number of landings",
    CORNER: "a landing is on a joint at which the law's acceleration jumps: the multipliers jump "
    "with it, and a motion may end or change its stability",
    LOST: "no motion is found beyond",
}


@dataclass(frozen=True, eq=False)
class PeriodicMotion:
    """Motion that repeats after a whole number of turns, for one follower and speed."""

    point: OperatingPoint
    states: FloatArray  #: state at the end of each turn, ``(turns, n)``, as in `TurnsRun.states`
    #: derivative of the state after a period by the state before, ``(n, n)``: n = 2 for one mass, 4
    #: for two
    derivative: FloatArray
    landings: int  #: number of landings in the period
    max_landing_speed: float  #: speed of the fastest landing relative to the cam, m/s
    min_landing_speed: float  #: speed of the slowest landing relative to the cam, m/s

    @property
    def period(self) -> int:
        """Period of the motion in turns."""
        return len(self.states)

    @property
    def state(self) -> State:
        """State at cam angle 0, at the start and end of a period.

        Its numbers are those of `TurnsRun.states`.
        """
        return tuple(self.states[-1].tolist())

    @property
    def multipliers(self) -> NDArray[np.complex128]:
        """Multipliers, ``(n,)``: growth factors of small changes of the state per period."""
        return np.linalg.eigvals(self.derivative).astype(np.complex128)

    @property
    def leading(self) -> complex:
        """Multiplier of the largest magnitude, which decides the stability of a motion.

        A multiplier is the growth factor of a small change of the state per period.
        """
        return complex(max(self.multipliers.tolist(), key=abs))

    @property
    def stable(self) -> bool:
        """True if small changes of the state of a periodic motion decay."""
        return abs(self.leading) < 1.0

    @property
    def flip(self) -> float:
        """Test function of a period doubling, which is zero if a multiplier is −1.

        A multiplier is the growth factor of a small change of the state per period.
        """
        return float(np.linalg.det(np.eye(len(self.derivative)) + self.derivative))

    @property
    def fold(self) -> float:
        """Test function of a fold, which is zero if a multiplier is +1.

        A fold is a bifurcation at which two periodic motions meet. A multiplier is the growth
        factor of a small change of the state per period.
        """
        return float(np.linalg.det(np.eye(len(self.derivative)) - self.derivative))

    @property
    def spiral(self) -> float:
        """Test function of a Neimark-Sacker bifurcation.

        It is zero if two multipliers have the product 1. A complex conjugate pair then has the
        magnitude 1.
        """
        pairs = combinations(self.multipliers.tolist(), 2)
        return float(np.prod([1.0 - a * b for a, b in pairs]).real)


@dataclass(frozen=True)
class Bifurcation:
    """Follower and speed at which a periodic motion appears, ends or becomes unstable.

    ``kind`` is one of the keys of `DESCRIPTIONS`. ``period`` is the period of the motion in turns,
    or None for the first lift-off.
    """

    kind: str
    point: OperatingPoint
    period: int | None
    landings: int  #: number of landings in the period before the bifurcation

    def same_as(self, other: Bifurcation, sweep: Sweep) -> bool:
        """Return True if two results are the same bifurcation, found from two branches.

        Their swept values must agree within `BIFURCATION_RTOL`. ``sweep`` defines the swept
        quantity.
        """
        value, other_value = sweep.value(self.point), sweep.value(other.point)
        same_kind = self.kind == other.kind and self.period == other.period
        return same_kind and abs(value - other_value) < BIFURCATION_RTOL * sweep.size(value)


class MotionNotFoundError(DynamicsError):
    """Error of a Newton iteration that does not converge to a periodic motion."""


#: Function that returns the periodic motion at a distance along a branch, with its scaled vector of
#: state and swept value.
Ahead = Callable[[float], tuple[PeriodicMotion, FloatArray]]


@dataclass
class Family:
    """Periodic motions of one period (in turns), as functions of the swept quantity.

    The swept quantity is, for example, the cam speed. Vectors ``(n + 1,)`` of the n numbers of a
    state and of the swept value are scaled by their magnitudes.
    """

    law: Law
    sweep: Sweep
    period: int
    #: Magnitudes by which the state and the swept value are scaled, ``(n + 1,)``.
    _scale: FloatArray = field(init=False)

    def at(self, value: float, state: State) -> PeriodicMotion:
        """Return the periodic motion at a swept value (SI) near a state.

        It is found by Newton's iteration from this state.

        Raises
        ------
        MotionNotFoundError
            If the iteration does not converge.
        """
        self._scale = self._scale_of(value, state)
        start = np.array([*state, value]) / self._scale
        along = np.eye(start.size)[-1]
        return self._corrected(start, along, np.zeros(len(state)))[0]

    def follow(
        self, start: PeriodicMotion, low: float, high: float, up: bool
    ) -> tuple[list[PeriodicMotion], list[Bifurcation]]:
        """Follow a branch of periodic motions in one direction to its end.

        The branch starts at the motion ``start`` and ends at the swept values ``low`` or ``high``
        (SI) at the latest. ``up`` selects the direction of the first step. The result is the
        motions in order along the branch, ``start`` first, and the bifurcations.
        """
        value = self.sweep.value(start.point)
        self._scale = self._scale_of(value, start.state)
        motions, bifurcations = [start], list[Bifurcation]()
        point, length = np.array([*start.state, value]) / self._scale, FIRST_STEP
        by_value = self._by_value(point)
        along = self._tangent(start, by_value, np.eye(point.size)[-1] * (1.0 if up else -1.0))
        for _ in range(MAX_STEPS):
            ahead = partial(self._ahead, point, along, by_value)
            try:
                motion, next_point = ahead(length)
                same_landings = motion.landings == motions[-1].landings
                new = list(self._between(motions[-1], motion, ahead, length))
            except DynamicsError:
                same_landings, new = False, []
            if not same_landings:
                length *= 0.5
                if length < MIN_STEP:
                    bifurcations += self._end(motions[-1], point, along)
                    break
                continue
            motions.append(motion)
            bifurcations += new
            if not low <= self.sweep.value(motion.point) <= high:
                break
            point = next_point
            # With a shorter step, the difference quotient could include a discontinuity of the law.
            if length > 10.0 * VALUE_STEP:
                by_value = self._by_value(next_point)
            along = self._tangent(motion, by_value, along)
            length = min(1.5 * length, MAX_STEP)
        else:  # `MAX_STEPS` was reached
            bifurcations += self._end(motions[-1], point, along)
        return motions, bifurcations

    def _scale_of(self, value: float, state: State) -> FloatArray:
        """Return the magnitudes by which state and swept value are scaled, ``(n + 1,)``.

        ``value`` is a swept value (SI), and ``state`` a state with n numbers.
        """
        point = self.sweep.at(value)
        usual = StroboscopicMap(self.law, point.parameters, point.speed).scale
        return np.append(np.maximum(usual, np.abs(state)), self.sweep.size(value))

    def _run(self, vector: FloatArray) -> tuple[FloatArray, PeriodicMotion]:
        """Run one period from a scaled vector of state and swept value, ``(n + 1,)``.

        Returns the scaled state at the end of the period, ``(n,)``, and the motion of the run. This
        motion is periodic only if both states agree.
        """
        gap, *others, value = (vector * self._scale).tolist()
        point = self.sweep.at(value)
        turn_map = StroboscopicMap(self.law, point.parameters, point.speed)
        run = turn_map.run(self.period, (max(gap, 0.0), *others))
        motion = PeriodicMotion(
            point=point,
            states=run.states,
            derivative=run.derivative(),
            landings=int(run.landings.sum()),
            max_landing_speed=float(run.max_landing_speeds.max()),
            min_landing_speed=float(run.min_landing_speeds.min()),
        )
        return run.states[-1] / self._scale[:-1], motion

    def _by_value(self, vector: FloatArray) -> FloatArray:
        """Return the derivative of the state after a period by the swept value, ``(n,)``.

        It is a difference quotient at ``vector``, the state and swept value scaled by their
        magnitudes. Points with another number of landings are not used, because the state is not
        smooth there.
        """
        step = np.eye(vector.size)[-1] * VALUE_STEP
        vectors = [vector - step if vector[-1] > VALUE_STEP else vector, vector, vector + step]
        reached, motions = zip(*map(self._run, vectors), strict=True)
        first, last = (i if motions[i].landings == motions[1].landings else 1 for i in (0, 2))
        distance = max(vectors[last][-1] - vectors[first][-1], VALUE_STEP)
        return np.asarray((reached[last] - reached[first]) / distance)

    def _matrix(self, motion: PeriodicMotion, by_value: FloatArray) -> FloatArray:
        """Return the scaled derivative of Pᵏ(x) − x, ``(n, n + 1)``.

        P maps the state x with n numbers to the state one turn later, and the period is k turns.
        The columns are the derivatives by the state and, last, by the swept value (``by_value``).
        """
        scale = self._scale[:-1]
        block = motion.derivative * scale / scale[:, None] - np.eye(scale.size)
        return np.column_stack([block, by_value])

    def _tangent(
        self, motion: PeriodicMotion, by_value: FloatArray, along: FloatArray
    ) -> FloatArray:
        """Return the unit vector along the branch, ``(n + 1,)``, in scaled units.

        Of the two directions it is the one closer to ``along``. ``by_value`` is the derivative of
        the state after a period by the swept value.
        """
        vector = np.linalg.svd(self._matrix(motion, by_value))[2][-1]
        return np.asarray(vector if vector @ along >= 0.0 else -vector)

    def _corrected(
        self, start: FloatArray, along: FloatArray, by_value: FloatArray
    ) -> tuple[PeriodicMotion, FloatArray]:
        """Correct an approximate vector of state and swept value to a periodic motion.

        Newton's iteration starts at the scaled vector ``start`` and stays in the plane through it
        that is normal to ``along``. ``by_value`` is the derivative of the state after a period by
        the swept value. Returns the motion and its scaled vector, ``(n + 1,)``. Raises
        `MotionNotFoundError` without convergence.
        """
        vector, last = start, math.inf
        for _ in range(MAX_ITERATIONS):
            reached, motion = self._run(vector)
            residual = np.array([*(reached - vector[:-1]), along @ (vector - start)])
            matrix = np.vstack([self._matrix(motion, by_value), along])
            try:
                step = np.linalg.solve(matrix, -residual)
            except np.linalg.LinAlgError:
                break
            size = float(np.abs(step).max())
            if size <= NEWTON_RTOL or (size <= ROUNDING_RESIDUAL and size >= 0.5 * last):
                return motion, vector
            if not size < 1.0:
                break
            vector, last = vector + step, size
        position = self.sweep.words(float(start[-1] * self._scale[-1]))
        raise MotionNotFoundError(
            f"no motion of period {self.period} was found near {position}; use a start nearer to "
            "a motion"
        )

    def _ahead(
        self, point: FloatArray, along: FloatArray, by_value: FloatArray, length: float
    ) -> tuple[PeriodicMotion, FloatArray]:
        """Return the periodic motion at a distance along the branch, with its vector.

        The scaled distance ``length`` is measured from the vector ``point`` in the direction
        ``along``. Vectors contain state and swept value, scaled, ``(n + 1,)``.
        """
        return self._corrected(point + length * along, along, by_value)

    def _between(
        self, before: PeriodicMotion, after: PeriodicMotion, ahead: Ahead, length: float
    ) -> Iterator[Bifurcation]:
        """Yield the bifurcations between two consecutive motions of a branch.

        ``before`` and ``after`` are the two motions. ``ahead`` returns the motions between them, at
        distances from 0 to ``length`` along the branch.
        """
        for kind, name in ((FLIP, "flip"), (FOLD, "fold"), (SPIRAL, "spiral")):
            test: Callable[[PeriodicMotion], float] = attrgetter(name)
            if test(before) * test(after) < 0.0:
                root = brentq(lambda part, f=test: f(ahead(part)[0]), 0.0, length, xtol=1e-15)
                motion, _ = ahead(root)
                if kind == SPIRAL and not motion.leading.imag:
                    # two real multipliers have the product 1, so this is not a bifurcation
                    continue
                reported = kind if abs(test(motion)) < PASS_ATOL else CORNER
                yield Bifurcation(reported, motion.point, self.period, motion.landings)
                if reported == CORNER:
                    return  # the other test functions may jump there too, without a bifurcation

    def _end(
        self, last: PeriodicMotion, point: FloatArray, along: FloatArray
    ) -> Iterator[Bifurcation]:
        """Yield the bifurcation at which a branch of periodic motions ends.

        ``last`` is the last motion, ``point`` the vector of its state and swept value (scaled by
        their magnitudes), and ``along`` the direction of the branch in this scale.
        """
        kind, (half_period, remainder) = LOST, divmod(self.period, 2)
        if (
            remainder == 0
            and np.abs(last.states[:half_period] - last.states[half_period:]).max()
            < HALF_PERIOD_RTOL * self._scale[1]
        ):
            yield Bifurcation(FLIP, last.point, half_period, last.landings // 2)
            return
        for distance in DISTANCES_BEYOND:
            try:
                motion = self._run(point + distance * along)[1]
            except DynamicsError:
                return
            if motion.landings != last.landings:
                kind = GRAZE
                break
            change = np.abs(motion.derivative - last.derivative).max()
            if change > JUMP_RTOL * np.abs(last.derivative).max():
                kind = CORNER
                break
        yield Bifurcation(kind, last.point, self.period, last.landings)


@dataclass(frozen=True, eq=False)
class Branch:
    """Periodic motions that form one curve over the swept quantity, in order.

    ``bifurcations`` are those on the curve and at its ends.
    """

    motions: tuple[PeriodicMotion, ...]
    bifurcations: tuple[Bifurcation, ...]
    sweep: Sweep

    def contains(self, motion: PeriodicMotion) -> bool:
        """Return True if a motion lies on this branch.

        It does if its swept value lies between those of two neighbouring motions, and its fastest
        landing agrees with the interpolated one.
        """
        if motion.period != self.motions[0].period:
            return False
        value = self.sweep.value(motion.point)
        for a, b in pairwise(self.motions):
            low, high = self.sweep.value(a.point), self.sweep.value(b.point)
            if (low - value) * (high - value) <= 0.0 and low != high:
                fraction = (value - low) / (high - low)
                first, last = a.max_landing_speed, b.max_landing_speed
                speed = first + fraction * (last - first)
                if abs(speed - motion.max_landing_speed) < LANDING_RTOL * speed:
                    return True
        return False


def branch_through(
    law: Law, sweep: Sweep, start: PeriodicMotion, low: float, high: float
) -> Branch:
    """Return the branch through a motion, followed in both directions.

    The branch is followed between the swept values ``low`` and ``high`` (SI).
    """
    family = Family(law, sweep, start.period)
    down, bifurcations_below = family.follow(start, low, high, up=False)
    up, bifurcations_above = family.follow(start, low, high, up=True)
    return Branch((*down[:0:-1], *up), (*bifurcations_below[::-1], *bifurcations_above), sweep)


def branches(
    law: Law,
    sweep: Sweep,
    starts: Sequence[tuple[float, State, int]],
    low: float,
    high: float,
) -> tuple[Branch, ...]:
    """Return all branches of periodic motions between two swept values (SI).

    ``starts`` lists the swept value (SI), a state and the period in turns of each known motion.
    Motions that Newton's iteration does not find, or that lie on an earlier branch, are skipped.
    """
    result = list[Branch]()
    for value, state, period in starts:
        try:
            motion = Family(law, sweep, period).at(value, state)
        except MotionNotFoundError:
            continue
        if not any(branch.contains(motion) for branch in result):
            result.append(branch_through(law, sweep, motion, low, high))
    return tuple(result)
