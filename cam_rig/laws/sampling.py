"""Uniform sampling of a law along a turning cam, as matrix products.

A run of samples inside one piece is cut into chunks of equal length. About the middle of a
chunk the polynomial is written as its (finite, exact) Taylor series; one product with the
fixed matrix of powers then gives all samples of all chunks. No Python loop touches a sample.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import as_strided

from cam_rig.errors import LawError
from cam_rig.laws import bernstein
from cam_rig.laws.bernstein import Pieces
from cam_rig.laws.law import Law
from cam_rig.units import TURN, FloatArray

#: Samples in a chunk: long ones, of which there are fewer to prepare, where a piece has many.
CHUNKS = (256, 64)
#: A chunk may cover this fraction of its piece: beyond it the series would lose digits, ...
WIDEST_CHUNK = 0.125
#: ... and there must be so many in a run to pay.
MIN_CHUNKS = 2
#: Runs without chunks that are reckoned in one go, of turns one after another.
TOGETHER = 4
#: What this part of a row's size is not worth a power of a chunk's series.
NEGLIGIBLE = 2.0**-56
#: Runs that begin within this part of a piece of each other begin alike: rounding of many turns.
SAME_START = 2.0**-46
#: A sample this near a joint or an event, in parts of the time between two, is at it. Rounding,
#: which differs with where an interval begins, would else choose the side, and with it the force.
AT_SAMPLE = 1e-6


def samples_before(place: float) -> int:
    """How many of the samples 0, 1, 2, … come before a place among them; one at it does not."""
    return max(0, math.ceil(place - AT_SAMPLE))


@lru_cache(maxsize=64)
def chunk_powers(degree: int, chunk: int) -> FloatArray:
    """``(degree + 1, chunk)`` powers of the local abscissa of so many samples in [-1, 1]."""
    x = np.linspace(-1.0, 1.0, chunk)
    return np.asarray(x[None, :] ** np.arange(degree + 1)[:, None])


def sample(
    law: Law,
    start: float,
    step: float,
    count: int,
    weights: FloatArray,
    offsets: FloatArray,
    out: FloatArray | None = None,
) -> FloatArray:
    """``(k, count)`` combinations of s, s', s'' at the angles ``start + j·step`` (rad).

    start, step : the angle is unwrapped, the step positive
    weights, offsets : ``(k, 3)`` of s, s', s'' and ``(k,)``, row by row
    out : where to write the samples, each row without gaps; None for a new array
    """
    out = np.empty((weights.shape[0], count)) if out is None else out
    turn = math.floor(start / TURN)
    piece = int(np.searchsorted(law.breaks, start - turn * TURN, side="right")) - 1
    begin = 0
    runs_of: dict[tuple[int, int], list[SampleRun]] = {}
    while begin < count:
        index = piece % law.spans.size
        low = law.joints[index] + (turn + piece // law.spans.size) * TURN
        span = float(law.spans[index])
        end = min(count, max(begin, samples_before((low + span - start) / step)))
        if end > begin:
            run = SampleRun.of(begin, end, (start + begin * step - low) / span, step / span)
            runs_of.setdefault((index, run.chunk), []).append(run)
        begin = end
        piece += 1
    for (index, chunk), runs in runs_of.items():
        if not chunk:
            _fill_each(runs, law.degree, weights @ law.motion[:, :, index], offsets, out)
            continue
        series = _piece_series(law, index, runs[0].width, chunk, weights.tobytes())
        trains = repeated(runs)
        terms = series.at([train[0] for train in trains])
        terms[:, :, 0] += offsets[:, None]
        at = 0
        for train in trains:
            chunks = train[0].chunks
            fill_in_chunks(train, terms[:, None, at : at + chunks], series.powers[None], out)
            at += chunks
    return out


class SampleRun(NamedTuple):
    """Samples in one piece: at u = ``first``, ``width`` apart; chunk 0: chunks do not pay."""

    begin: int
    end: int
    first: float
    width: float
    chunk: int

    @classmethod
    def of(cls, begin: int, end: int, first: float, width: float) -> SampleRun:
        """With the longest chunks that lose no digits."""
        most = min((end - begin) / MIN_CHUNKS, WIDEST_CHUNK / width)
        chunk = next((chunk for chunk in CHUNKS if chunk <= most), 0)
        return cls(begin, end, first, width, chunk)

    @property
    def length(self) -> int:
        """How many they are."""
        return self.end - self.begin

    @property
    def chunks(self) -> int:
        """How many chunks; the last may be too long."""
        return -(-self.length // self.chunk)

    def at(self) -> FloatArray:
        """U of each sample."""
        return self.first + self.width * np.arange(self.length, dtype=np.float64)


def repeated(runs: list[SampleRun]) -> list[list[SampleRun]]:
    """Runs of one piece in order, those together that are the same, as turns are, evenly apart."""
    found: list[list[SampleRun]] = []
    for run in runs:
        train = found[-1] if found else [run]
        same = run.length == train[0].length and abs(run.first - train[0].first) < SAME_START
        apart = train[-1].begin - train[-2].begin if len(train) > 1 else run.begin - train[0].begin
        if found and same and run.begin - train[-1].begin == apart:
            train.append(run)
        else:
            found.append([run])
    return found


@dataclass(frozen=True, eq=False)
class ChunkSeries:
    """What takes basis values at a chunk's middle to the series of k polynomials about it.

    table : ``(k, p + 1, q)`` with no more powers q than change a last digit
    powers : ``(q, chunk)`` of the local abscissa at the chunk's samples, ``width`` u apart
    """

    table: FloatArray
    powers: FloatArray
    width: float

    @classmethod
    def of(cls, taylor: FloatArray, width: float, chunk: int) -> ChunkSeries:
        """The series of polynomials with the Taylor maps ``(k, p + 1, p + 1)``."""
        scaled = taylor * (0.5 * width * (chunk - 1)) ** np.arange(taylor.shape[2])
        sizes = np.abs(scaled).max(axis=1)  # a basis is an average: no coefficient is larger
        needed = np.cumsum(sizes[:, ::-1], axis=1)[:, ::-1] > NEGLIGIBLE * sizes[:, :1]
        count = max(1, int(np.max(np.count_nonzero(needed, axis=1))))
        table = np.ascontiguousarray(scaled[:, :, :count])
        return cls(table, chunk_powers(count - 1, chunk), width)

    def at(self, runs: list[SampleRun]) -> FloatArray:
        """The series of all chunks of these runs, ``(k, chunks, q)``."""
        counts = np.array([run.chunks for run in runs])
        inner = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        firsts = np.repeat([run.first for run in runs], counts)
        chunk = self.powers.shape[1]
        middles = firsts + self.width * (chunk * inner + 0.5 * (chunk - 1))
        at = bernstein.basis(self.table.shape[1] - 1, middles)
        return np.asarray(np.matmul(at, self.table))


def _fill_each(
    runs: list[SampleRun], degree: int, rows: FloatArray, offsets: FloatArray, out: FloatArray
) -> None:
    """Write the samples of runs of one piece, sample by sample, of ordinates ``(k, p + 1)``."""
    for begin in range(0, len(runs), TOGETHER):
        some = runs[begin : begin + TOGETHER]
        found = rows @ bernstein.basis(degree, np.concatenate([run.at() for run in some])).T
        found += offsets[:, None]
        at = 0
        for run in some:
            out[:, run.begin : run.end] = found[:, at : at + run.length]
            at += run.length


def fill_in_chunks(
    runs: list[SampleRun], terms: FloatArray, over: FloatArray, out: FloatArray
) -> None:
    """Write the samples of runs as `repeated` gives them into ``out`` ``(k, count)``.

    They are ``terms`` ``(k, runs or 1, chunks, q)`` times ``over`` ``(k or 1, q, chunk)``.
    """
    first, chunk = runs[0], runs[0].chunk
    full, left = divmod(first.length, chunk)
    last = first.end - left
    if len(runs) == 1:
        terms = terms[:, 0]
        np.matmul(terms[:, :full], over, out=out[:, first.begin : last].reshape(-1, full, chunk))
        if left:
            out[:, last : first.end] = np.matmul(terms[:, full:], over)[:, 0, :left]
        return
    apart, size = (runs[-1].begin - first.begin) // (len(runs) - 1), out.itemsize
    # Row by row: where numpy cannot tell that nothing overlaps it works elsewhere and copies.
    for row, term, matrix in zip(out, terms, itertools.cycle(over), strict=False):
        shape, strides = (len(runs), full, chunk), (apart * size, chunk * size, size)
        body = as_strided(row[first.begin :], shape, strides)
        np.matmul(term[:, :full], matrix, out=body[: len(term)])
        body[len(term) :] = body[0]  # where all runs are one
        if left:
            rest = as_strided(row[last:], (len(runs), left), (apart * size, size))
            rest[:] = (term[:, full] @ matrix)[:, :left]


@lru_cache(maxsize=1024)
def _piece_series(law: Law, index: int, width: float, chunk: int, weights: bytes) -> ChunkSeries:
    """The series of rows of s, s', s'' in a piece; ``weights`` are those of `sample`."""
    series = np.zeros((3, *law.taylor.shape[1:]))
    series[0] = law.taylor[index]
    order = np.arange(1, law.degree + 1) / law.spans[index]
    series[1, :, :-1] = series[0, :, 1:] * order
    series[2, :, :-1] = series[1, :, 1:] * order
    taylor = np.tensordot(np.frombuffer(weights).reshape(-1, 3), series, axes=1)
    return ChunkSeries.of(taylor, width, chunk)


# Analytic curves turned into Bernstein pieces with derivatives as good as the values.

#: Degree of the interpolant of the third derivative; the curve itself has three more.
THIRD_DEGREE = 22
#: Relative tail of the third derivative's Chebyshev series that is accepted ...
TAIL = 1e-13
#: ... or what the tail may add to the curve itself, relative: rounding of the formula.
ROUNDING = 1e-17
#: Pieces are not made shorter than this fraction of the curve.
SHORTEST = 1e-5
Curve = Callable[[FloatArray, int], FloatArray]
#: A curve on the stretch from its first to its second abscissa.
Section = tuple[float, float, Curve]


@lru_cache(maxsize=4)
def _nodes(degree: int) -> tuple[FloatArray, FloatArray]:
    """Chebyshev nodes on [0, 1] and the Bernstein collocation matrix there."""
    nodes = 0.5 - 0.5 * np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
    return nodes, bernstein.basis(degree, nodes)


def fit(
    curve: Curve, start: float, stop: float, degree: int = THIRD_DEGREE, accepted_tail: float = TAIL
) -> Pieces:
    """Bernstein pieces of ``curve(x, order)``, order 0 to 3, on [start, stop].

    The third derivative is interpolated, and integrated from exact values at the piece's start:
    differencing an interpolant of s would lose six digits of it. A piece is halved until the
    Chebyshev tail of this derivative is accepted. Where pieces come out short against a period of
    the stem, a lower degree of it keeps the vibration's polynomial solution small.
    """
    breaks, pieces, todo = [start], [], [(start, stop)]
    while todo:
        a, b = todo.pop()
        third = _third_derivative(curve, a, b, degree, accepted_tail)
        if third is None:
            if b - a < SHORTEST * (stop - start):
                raise LawError(
                    f"the curve turns too sharply at {a:.6g} to be followed; allowed: a third "
                    f"derivative that is smooth over {SHORTEST:g} of its span"
                )
            mid = 0.5 * (a + b)
            todo += [(mid, b), (a, mid)]
            continue
        ordinates = third
        for order in (2, 1, 0):
            at_start = curve(np.array([a]), order)[0]
            ordinates = (b - a) * bernstein.antiderivative(ordinates) + at_start
        pieces.append(ordinates)
        breaks.append(b)
    return breaks, pieces


def fit_sections(sections: list[Section]) -> Pieces:
    """Bernstein pieces of curves that follow one another; raises as ``fit``."""
    breaks, pieces = [sections[0][0]], []
    for start, stop, curve in sections:
        steps, fitted = fit(curve, start, stop)
        breaks += steps[1:]
        pieces += fitted
    return breaks, pieces


def _third_derivative(
    curve: Curve, a: float, b: float, degree: int, accepted_tail: float
) -> FloatArray | None:
    """Ordinates of the third derivative on [a, b], or None when the degree does not do."""
    nodes, collocation = _nodes(degree)
    values = curve(a + (b - a) * nodes, 3)
    series = np.polynomial.chebyshev.chebfit(2.0 * nodes - 1.0, values, degree)
    tail = np.abs(series[-2:]).max()
    size = float(np.abs(curve(np.array([a, b]), 0)).max())
    accepted = max(accepted_tail * np.abs(series).max(), ROUNDING * size / (b - a) ** 3)
    return np.asarray(np.linalg.solve(collocation, values)) if tail <= accepted else None
