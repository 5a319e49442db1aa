"""The torsional reference: Taylor series of high order with 45 digits, joint after joint.

The series of φ̈ follows order by order from (I + m s'²) φ̈ = N: products of series are Cauchy
sums. A step ends at the joint of the law where θ = ωt + αt²/2 + φ reaches it.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import mpmath as mp  # type: ignore[import-untyped]
import numpy as np

from cam_rig.bench.cases.case import Case, Solution
from cam_rig.bench.cases.models import Twist
from cam_rig.bench.cases.phase import Number
from cam_rig.bench.reference.exact_law import derivative, polynomial, powers
from cam_rig.units import TURN

DIGITS = 45
ORDER = 40
#: Steps in a period of the shaft: the last terms then are below the last digit.
STEPS = 5

Series = list[Number]


def _times(one: Series, other: Series, n: int) -> Number:
    """Coefficient n of a product."""
    return mp.fdot((one[i], other[n - i]) for i in range(n + 1))


class _Taylor:
    """Series of θ about one instant, with the law's piece as polynomials of θ − low."""

    def __init__(self, model: Twist, ramp: Number, laws: list[Series]) -> None:
        self.model, self.ramp, self.laws = model, ramp, laws

    def expand(self, angle: Number, speed: Number, twist: Number, rate: Number) -> Series:
        """Series of φ in time; ``angle`` is θ less the piece's beginning, ``speed`` without φ̇."""
        p = self.model
        phi, turn = [twist, rate], [angle, speed + rate]
        degree = len(self.laws[0]) - 1
        lift_powers: list[Series] = [[] for _ in range(degree + 1)]
        lists: list[Series] = [[] for _ in range(9)]
        s, s1, s2, turning, square, mass, force, rates, acceleration = lists
        for n in range(ORDER - 1):
            lift_powers[0].append(mp.mpf(n == 0))
            for k in range(1, degree + 1):
                lift_powers[k].append(_times(lift_powers[k - 1], turn, n))
            for row, law in zip((s, s1, s2), self.laws, strict=True):
                row.append(mp.fdot((a, x[n]) for a, x in zip(law, lift_powers, strict=True)))
            turning.append((n + 1) * turn[n + 1])
            square.append(_times(turning, turning, n))
            mass.append(p.mass * _times(s1, s1, n) + (p.inertia if n == 0 else 0))
            rates.append(_times(s1, turning, n))
            force.append(
                p.mass * _times(s2, square, n)
                + p.damping * rates[n]
                + p.stiffness * s[n]
                + (p.preload if n == 0 else 0)
            )
            numerator = -p.shaft_stiffness * phi[n] - _times(force, s1, n)
            acceleration.append(mp.mpf(0))
            acceleration[n] = (numerator - _times(mass, acceleration, n)) / mass[0]
            turn.append(acceleration[n] / ((n + 1) * (n + 2)))
            phi.append(turn[-1] - (self.ramp / 2 if n == 0 else 0))
        return phi


def solve(case: Case, ramp: float = 0.0) -> Solution:
    """The torsional case to 40 digits, rounded to doubles at the end.

    ``ramp`` is α in rad/s²: the flywheel begins with the case's speed and gains it evenly.
    """
    assert isinstance(case.model, Twist)
    with mp.workdps(DIGITS):
        return _solve(case, _typed(case.model), mp.mpf(ramp))


def _typed(model: Twist) -> Twist:
    return Twist(*(mp.mpf(x) for x in vars(model).values()))


def _solve(case: Case, model: Twist, ramp: Number) -> Solution:
    shown: list[tuple[float, float]] = []
    times = [mp.mpf(float(time)) for time in case.times]
    for begin, length, phi, slope in _steps(case, model, ramp):
        while len(shown) < len(times) and times[len(shown)] - begin <= length:
            since = times[len(shown)] - begin
            shown.append((float(polynomial(phi, since)), float(polynomial(slope, since))))
        if len(shown) == len(times):
            break
    table = np.array(shown).T
    return Solution(table[:1], table[1:])


def _steps(
    case: Case, model: Twist, ramp: Number
) -> Iterator[tuple[Number, Number, Series, Series]]:
    """Beginning (s), length (s), φ and φ̇ of step after step, none across a joint."""
    speed, ends = mp.mpf(case.speed), [mp.mpf(float(x)) for x in case.law.breaks]
    longest = 2 * mp.pi / mp.sqrt(model.shaft_stiffness / model.inertia) / STEPS
    time, twist, rate = mp.mpf(0), mp.mpf(0), mp.mpf(0)
    columns = case.law.ordinates.T.tolist()
    # One turn more: a twist may bring the last joint before the last output time.
    for turn, i in product(range(case.turns + 1), range(len(columns))):
        span = ends[i + 1] - ends[i]
        lift = [a / span**j for j, a in enumerate(powers(columns[i]))]
        taylor = _Taylor(model, ramp, [lift, derivative(lift), derivative(derivative(lift))])
        low, high = (turn * mp.mpf(TURN) + end for end in (ends[i], ends[i + 1]))
        joint = False
        while not joint:
            line = [speed * time + ramp * time**2 / 2, speed + ramp * time, ramp / 2]
            phi = taylor.expand(line[0] + twist - low, line[1], twist, rate)
            slope = derivative(phi)
            step, joint = _step(_sum(line, phi), high, longest)
            yield time, step, phi, slope
            time += step
            twist, rate = polynomial(phi, step), polynomial(slope, step)


def _sum(line: Series, phi: Series) -> Series:
    return [a + b for a, b in zip(line, phi, strict=False)] + phi[len(line) :]


def _step(angle: Series, high: Number, longest: Number) -> tuple[Number, bool]:
    """Length of the next step, and whether it ends where θ is ``high``, at the joint."""
    if polynomial(angle, longest) < high:
        return longest, False
    step, speed = longest, derivative(angle)
    for _ in range(9):
        step -= (polynomial(angle, step) - high) / polynomial(speed, step)
    return step, True
