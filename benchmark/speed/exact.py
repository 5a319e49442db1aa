"""Reference solutions: every linear phase in closed form, with at least 50 digits.

The code is independent of the models of cam_rig.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import product

import mpmath as mp
import numpy as np

from benchmark.speed.models import (
    BenchModel,
    BenchPhase,
    Case,
    Number,
    Solution,
    Twist,
    Vector,
    dot,
)
from cam_rig.errors import CamRigError
from cam_rig.laws import Law
from cam_rig.units import TURN

# -- pieces of a law as power series of time, with 50 digits


@dataclass(frozen=True)
class ExactPiece:
    """Piece of a law at one speed.

    Parameters
    ----------
    start, duration : s
    series : s, ṡ, s̈ and 1 as coefficients of the powers of the time since the start
    """

    start: Number
    duration: Number
    series: tuple[list[Number], ...]

    @property
    def degree(self) -> int:
        """Degree of the series."""
        return len(self.series[0]) - 1

    def motion(self, time: Number) -> list[Number]:
        """Return (s, ṡ, s̈, 1) at a time since the start."""
        return [polynomial(row, time) for row in self.series]

    def combined(self, weights: Vector) -> list[Number]:
        """Return the coefficients of a weighted sum of s, ṡ, s̈ and 1."""
        return [
            sum((w * a for w, a in zip(weights, column, strict=True)), mp.mpf(0))
            for column in zip(*self.series, strict=True)
        ]


def polynomial(coefficients: list[Number], x: Number) -> Number:
    """Return the value of a polynomial (Horner's rule)."""
    total = mp.mpf(0)
    for a in reversed(coefficients):
        total = total * x + a
    return total


def powers(ordinates: list[float]) -> list[Number]:
    """Return the coefficients in powers of u of a polynomial in Bernstein form."""
    degree = len(ordinates) - 1
    b = [mp.mpf(float(x)) for x in ordinates]
    return [
        mp.binomial(degree, j)
        * sum(((-1) ** (j - i) * mp.binomial(j, i) * b[i] for i in range(j + 1)), mp.mpf(0))
        for j in range(degree + 1)
    ]


def exact_pieces(law: Law, speed: float) -> list[ExactPiece]:
    """Return the pieces of a turn."""
    breaks = [mp.mpf(float(x)) for x in law.breaks]
    omega = mp.mpf(speed)
    pieces = []
    for i, ordinates in enumerate(law.ordinates.T.tolist()):
        span = breaks[i + 1] - breaks[i]
        lift = [a * (omega / span) ** j for j, a in enumerate(powers(ordinates))]
        rate, acceleration = derivative(lift), derivative(derivative(lift))
        constant = [mp.mpf(j == 0) for j in range(len(lift))]
        pieces.append(
            ExactPiece(breaks[i] / omega, span / omega, (lift, rate, acceleration, constant))
        )
    return pieces


def derivative(coefficients: list[Number]) -> list[Number]:
    """Return the coefficients of the derivative, padded to the same length."""
    return [*(j * a for j, a in enumerate(coefficients) if j), mp.mpf(0)]


# -- a phase on one piece of the law in closed form, and the first zero of its guard

#: Scanned points per period of the fastest mode.
SCAN = 24

FEWEST = 32

#: Largest imaginary part, relative, of a rate that is real except for rounding at 60 digits.
REAL = 1e-40

#: Time (s) after which a guard that rises from zero must be positive.
MIN_BRACKET = 1e-30


@dataclass(frozen=True)
class Flow:
    """Solution of a phase on a piece, from local time ``begin`` and state ``start``.

    The phase ends when its guard, a linear function of state and law, becomes zero.
    """

    phase: BenchPhase
    piece: ExactPiece
    begin: Number
    forced: list[list[Number]]
    rates: list[Number]
    modes: list[list[Number]]

    def state(self, time: Number) -> list[Number]:
        """Return the state at a local time."""
        growth = self._growth(time)
        free = [mp.re(dot(row, growth)) for row in self.modes]
        return [polynomial(x, time) + y for x, y in zip(self.forced, free, strict=True)]

    def guard(self) -> tuple[Callable[[Number], Number], Callable[[Number], Number]]:
        """Return the guard and its rate as functions of the local time."""
        assert self.phase.guard is not None
        smooth = self.piece.combined(self.phase.guard_drive)
        for weight, row in zip(self.phase.guard, self.forced, strict=True):
            smooth = [a + weight * b for a, b in zip(smooth, row, strict=True)]
        weights = [dot(self.phase.guard, column) for column in zip(*self.modes, strict=True)]
        slope = [i * a for i, a in enumerate(smooth)][1:] or [mp.mpf(0)]

        def value(time: Number) -> Number:
            return polynomial(smooth, time) + mp.re(dot(weights, self._growth(time)))

        def rate(time: Number) -> Number:
            grown = [r * g for r, g in zip(self.rates, self._growth(time), strict=True)]
            return polynomial(slope, time) + mp.re(dot(weights, grown))

        return value, rate

    def _growth(self, time: Number) -> list[Number]:
        return [mp.exp(rate * (time - self.begin)) for rate in self.rates]


def flow(phase: BenchPhase, piece: ExactPiece, begin: Number, start: Vector) -> Flow:
    """Solve a phase on a piece of the law.

    The series of the forced motion follows from (n+1) X_{n+1} = A X_n + F_n, from the highest power
    down.
    """
    size = phase.size
    if size == 0:
        return Flow(phase, piece, begin, [], [], [])
    half = size // 2
    drift = [[mp.mpf(j == i + half) for j in range(size)] for i in range(half)]
    matrix = mp.matrix(drift + [list(row) for row in phase.rows])
    zero = [mp.mpf(0)] * (piece.degree + 1)
    forcing = [zero] * half + [piece.combined(row) for row in phase.drive]
    forced: list[list[Number]] = [[] for _ in range(size)]
    above = mp.zeros(size, 1)
    for n in range(piece.degree, -1, -1):
        push = mp.matrix([row[n] for row in forcing])
        above = mp.lu_solve(matrix, (n + 1) * above - push)
        for row, x in zip(forced, above, strict=True):
            row.insert(0, x)
    rates, vectors = mp.eig(matrix)
    free_part = mp.matrix([x - polynomial(p, begin) for x, p in zip(start, forced, strict=True)])
    weights = mp.lu_solve(vectors, free_part)
    rates = [mp.re(r) if abs(mp.im(r)) < REAL * abs(r) else r for r in rates]
    indices = [i for i in range(size) if mp.im(rates[i]) >= 0]  # one of a conjugate pair, twice
    twice = {i: 1 if mp.im(rates[i]) == 0 else 2 for i in indices}
    modes = [[twice[i] * vectors[j, i] * weights[i] for i in indices] for j in range(size)]
    return Flow(phase, piece, begin, forced, [rates[i] for i in indices], modes)


def first_crossing(run: Flow, end: Number) -> Number | None:
    """Return the local time of the first zero of the guard, from positive to negative.

    It is None if there is no such zero before ``end``.
    """
    value, rate = run.guard()
    fastest = max((abs(r) for r in run.rates), default=mp.mpf(0))
    steps = max(FEWEST, int(SCAN * fastest * (end - run.begin) / (2 * mp.pi)) + 1)
    low, falling = run.begin, False
    for i in range(1, steps + 1):
        high = run.begin + (end - run.begin) * i / steps
        if value(high) <= 0:
            return _root(value, *_bracket(value, low, high))
        rising = rate(high) > 0
        if falling and rising:
            bottom = _root(lambda t: -rate(t), low, high)
            if value(bottom) < 0:
                return _root(value, low, bottom)
        low, falling = high, not rising
    return None


def _bracket(value: Callable[[Number], Number], low: Number, high: Number) -> tuple[Number, Number]:
    """Return a time with a positive value, and a later time with a value ≤ 0.

    The value may rise from zero at the start.
    """
    begin = low
    while low == begin or value(low) <= 0:
        low = (begin + high) / 2
        if value(low) <= 0:
            high, low = low, begin
        if high - begin < MIN_BRACKET:
            raise CamRigError(f"a guard is not positive after {float(begin)!r} s: no phase begins")
    return low, high


def _root(value: Callable[[Number], Number], low: Number, high: Number) -> Number:
    """Return the root between a positive and a negative value (Anderson-Björck)."""
    if value(high) == 0:
        return high
    return mp.findroot(value, (low, high), solver="anderson", tol=mp.mpf(10) ** -100, verify=False)


DIGITS = 60


@dataclass
class _Course:
    """Run of a case: outputs at the output times so far, and events."""

    case: Case
    model: BenchModel
    displacement: list[list[float]] = field(default_factory=list)
    velocity: list[list[float]] = field(default_factory=list)
    events: list[tuple[str, float]] = field(default_factory=list)

    def show(self, run: Flow, start: Number, end: Number) -> None:
        """Store the output times up to local time ``end``."""
        while len(self.displacement) < self.case.times.size:
            time = mp.mpf(float(self.case.times[len(self.displacement)])) - start
            if time > end:
                return
            x, v = run.phase.outputs(run.state(time), run.piece.motion(time))
            self.displacement.append([float(a) for a in x])
            self.velocity.append([float(a) for a in v])

    def through(self, piece: ExactPiece, start: Number, name: str, q: Vector) -> tuple[str, Vector]:
        """Solve a piece of a turn, phase after phase. It starts at ``start`` (s)."""
        phases, time = self.model.phases(), mp.mpf(0)
        if phases[name].on_cam and phases[name].guard_value(q, piece.motion(time)) < 0:
            name, q = self._switch(name, q, piece, time, start)
        while True:
            run = flow(phases[name], piece, time, q)
            crossing = first_crossing(run, piece.duration) if run.phase.guard is not None else None
            time = piece.duration if crossing is None else crossing
            self.show(run, start, time)
            q = run.state(time)
            if crossing is None:
                return name, q
            name, q = self._switch(name, q, piece, time, start)

    def _switch(
        self, name: str, q: Vector, piece: ExactPiece, time: Number, start: Number
    ) -> tuple[str, Vector]:
        name, q, kinds = self.model.switch(name, q, piece.motion(time))
        self.events += [(kind, float(start + time)) for kind in kinds]
        return name, q


def solve(case: Case) -> Solution:
    """Solve the case with at least 50 digits, and round the result to floats."""
    assert isinstance(case.model, BenchModel)
    with mp.workdps(DIGITS):
        course = _Course(case, case.model.typed(mp.mpf))
        pieces = exact_pieces(case.law, case.speed)
        name, q = course.model.begin()
        for turn in range(case.turns):
            for piece in pieces:
                start = turn * mp.mpf(TURN) / mp.mpf(case.speed) + piece.start
                name, q = course.through(piece, start, name, q)
        return Solution(
            np.array(course.displacement).T, np.array(course.velocity).T, tuple(course.events)
        )


# -- the torsional reference: Taylor series of high order with 45 digits, between joints of the law

TWIST_DIGITS = 45

ORDER = 40

#: Steps per period of the shaft. The last terms of a series are then below the last digit.
STEPS = 5

Series = list[Number]


def _times(first: Series, second: Series, n: int) -> Number:
    """Return coefficient n of the product of two series."""
    return mp.fdot((first[i], second[n - i]) for i in range(n + 1))


class _Taylor:
    """Taylor series of the cam angle θ about a time.

    The piece of the law is a polynomial of the angle since the start of the piece.
    """

    def __init__(self, model: Twist, ramp: Number, laws: list[Series]) -> None:
        self.model, self.ramp, self.laws = model, ramp, laws

    def expand(self, angle: Number, speed: Number, twist: Number, rate: Number) -> Series:
        """Return the series of the twist φ in time.

        ``angle`` is θ since the start of the piece, and ``speed`` is that of the flywheel.
        """
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


def solve_twist(case: Case, ramp: float = 0.0) -> Solution:
    """Solve the torsional case to 40 digits, and round the result to floats.

    ``ramp`` is the angular acceleration (rad/s²) of the flywheel, which starts with the case's
    speed.
    """
    assert isinstance(case.model, Twist)
    with mp.workdps(TWIST_DIGITS):
        return _solve(case, _typed(case.model), mp.mpf(ramp))


def _typed(model: Twist) -> Twist:
    return Twist(*(mp.mpf(x) for x in vars(model).values()))


def _solve(case: Case, model: Twist, ramp: Number) -> Solution:
    outputs: list[tuple[float, float]] = []
    times = [mp.mpf(float(time)) for time in case.times]
    for begin, length, phi, slope in _steps(case, model, ramp):
        while len(outputs) < len(times) and times[len(outputs)] - begin <= length:
            since = times[len(outputs)] - begin
            outputs.append((float(polynomial(phi, since)), float(polynomial(slope, since))))
        if len(outputs) == len(times):
            break
    table = np.array(outputs).T
    return Solution(table[:1], table[1:])


def _steps(
    case: Case, model: Twist, ramp: Number
) -> Iterator[tuple[Number, Number, Series, Series]]:
    """Yield start (s), length (s), φ and φ̇ of each step. A step ends at each joint."""
    speed, ends = mp.mpf(case.speed), [mp.mpf(float(x)) for x in case.law.breaks]
    longest = 2 * mp.pi / mp.sqrt(model.shaft_stiffness / model.inertia) / STEPS
    time, twist, rate = mp.mpf(0), mp.mpf(0), mp.mpf(0)
    columns = case.law.ordinates.T.tolist()
    # An additional turn, because the twist can move the last joint before the last output time.
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
    """Return the length of a step, and True if it ends at the joint θ = ``high``."""
    if polynomial(angle, longest) < high:
        return longest, False
    step, speed = longest, derivative(angle)
    for _ in range(9):
        step -= (polynomial(angle, step) - high) / polynomial(speed, step)
    return step, True
