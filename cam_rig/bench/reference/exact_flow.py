"""A phase on one piece of the law in closed form, and the first crossing of its guard.

q(t) = X(t) + Σ vᵢ e^{λᵢt}, X a polynomial. Guards are scanned finer than the fastest mode, dips
between two scanned points included, and their crossings polished to the last digit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mpmath as mp  # type: ignore[import-untyped]

from cam_rig.bench.cases.phase import BenchPhase, Number, Vector, dot
from cam_rig.bench.reference.exact_law import ExactPiece, polynomial
from cam_rig.errors import CamRigError

#: Scanned points in a period of the fastest mode, and at least in a piece.
SCAN = 24
FEWEST = 32
#: A rate with an imaginary part smaller than this share is real but for rounding at 60 digits.
REAL = 1e-40
#: A guard that rises from zero is positive after this time, s.
MIN_BRACKET = 1e-30


@dataclass(frozen=True)
class Flow:
    """One phase on one piece from local time ``begin`` and state ``start``."""

    phase: BenchPhase
    piece: ExactPiece
    begin: Number
    forced: list[list[Number]]
    rates: list[Number]
    modes: list[list[Number]]

    def state(self, time: Number) -> list[Number]:
        """The state at a local time."""
        growth = self._growth(time)
        free = [mp.re(dot(row, growth)) for row in self.modes]
        return [polynomial(x, time) + y for x, y in zip(self.forced, free, strict=True)]

    def guard(self) -> tuple[Callable[[Number], Number], Callable[[Number], Number]]:
        """The guard and its rate as functions of the local time."""
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
    """Solve one phase on one piece: (n+1) X_{n+1} = A X_n + F_n from the highest power down."""
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
    rest = mp.matrix([x - polynomial(p, begin) for x, p in zip(start, forced, strict=True)])
    weights = mp.lu_solve(vectors, rest)
    rates = [mp.re(r) if abs(mp.im(r)) < REAL * abs(r) else r for r in rates]
    kept = [i for i in range(size) if mp.im(rates[i]) >= 0]  # of a conjugate pair one, twice
    twice = {i: 1 if mp.im(rates[i]) == 0 else 2 for i in kept}
    modes = [[twice[i] * vectors[j, i] * weights[i] for i in kept] for j in range(size)]
    return Flow(phase, piece, begin, forced, [rates[i] for i in kept], modes)


def first_crossing(run: Flow, end: Number) -> Number | None:
    """Local time of the first crossing of the guard from above, None when not before ``end``."""
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
    """Where the value is positive, and where it no longer is: it may begin at zero and rise."""
    begin = low
    while low == begin or value(low) <= 0:
        low = (begin + high) / 2
        if value(low) <= 0:
            high, low = low, begin
        if high - begin < MIN_BRACKET:
            raise CamRigError(f"a guard is not positive after {float(begin)!r} s: no phase begins")
    return low, high


def _root(value: Callable[[Number], Number], low: Number, high: Number) -> Number:
    """Root between a positive and a negative value (Anderson-Björck)."""
    if value(high) == 0:
        return high
    return mp.findroot(value, (low, high), solver="anderson", tol=mp.mpf(10) ** -100, verify=False)
