"""Uniform samples of a law on a turning cam, and polynomial fits of curves.

A run of samples inside one piece is divided into chunks of equal length. In each chunk the
polynomial is written as its finite, exact Taylor series about the middle. One product with a fixed
matrix of powers then gives all samples of all chunks, without a Python loop over samples.
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

#: Numbers of samples per chunk, tried in this order. Long chunks need fewer preparations.
CHUNK_SIZES = (256, 64)
#: Largest fraction of a piece that a chunk covers. The series of a longer chunk loses digits.
MAX_CHUNK_FRACTION = 0.125
#: Smallest number of chunks of a run of samples for which chunks are faster. A chunk is a part of
#: the run whose samples are one matrix product; otherwise each sample is evaluated by itself.
MIN_CHUNKS = 2
#: Number of runs without chunks that are evaluated together. The runs are of successive turns.
RUNS_PER_BLOCK = 4
#: Largest relative size of the powers that are omitted from the series of a chunk.
POWER_RTOL = 2.0**-56
#: Largest difference of the starts (u, no unit) of runs that count as equal. It is the rounding of
#: many turns.
START_ATOL = 2.0**-46
#: Largest distance of a sample from a joint or an event at which the sample counts as on it, as a
#: fraction of the sampling interval. Without this tolerance, rounding, which depends on the start
#: of an interval, would select the side of the joint and with it the force.
AT_SAMPLE = 1e-6


def samples_before(index: float) -> int:
    """Return the number of samples 0, 1, 2, … before a fractional index.

    A sample at the index does not count.
    """
    return max(0, math.ceil(index - AT_SAMPLE))


@lru_cache(maxsize=64)
def chunk_powers(degree: int, chunk: int) -> FloatArray:
    """Return the powers of the local abscissa in [-1, 1] at ``chunk`` samples.

    The shape is ``(degree + 1, chunk)``.
    """
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
    """Compute weighted sums of s, s', s'' at the angles ``start + j·step`` (rad).

    Parameters
    ----------
    law : Law
        Law of the cam.
    start : float
        Angle of the first sample, rad, not reduced to one turn.
    step : float
        Angle between two samples, rad, positive.
    count : int
        Number of samples.
    weights : ndarray, shape (k, 3)
        Factors of s, s', s''.
    offsets : ndarray, shape (k,)
        Constants that are added.
    out : ndarray, shape (k, count), optional
        Array for the samples, contiguous along a row (None: a new array).

    Returns
    -------
    ndarray, shape (k, count)
        Samples.
    """
    out = np.empty((weights.shape[0], count)) if out is None else out
    turn = math.floor(start / TURN)
    piece = int(np.searchsorted(law.breaks, start - turn * TURN, side="right")) - 1
    first = 0
    runs_of: dict[tuple[int, int], list[SampleRun]] = {}
    while first < count:
        index = piece % law.spans.size
        low = law.joints[index] + (turn + piece // law.spans.size) * TURN
        span = float(law.spans[index])
        end = min(count, max(first, samples_before((low + span - start) / step)))
        if end > first:
            run = SampleRun.of(first, end, (start + first * step - low) / span, step / span)
            runs_of.setdefault((index, run.chunk), []).append(run)
        first = end
        piece += 1
    for (index, chunk), runs in runs_of.items():
        if not chunk:
            _fill_without_chunks(runs, law.degree, weights @ law.motion[:, :, index], offsets, out)
            continue
        series = _piece_series(law, index, runs[0].width, chunk, weights.tobytes())
        groups = group_repeated_runs(runs)
        terms = series.at([group[0] for group in groups])
        terms[:, :, 0] += offsets[:, None]
        i = 0
        for group in groups:
            chunks = group[0].chunks
            fill_in_chunks(group, terms[:, None, i : i + chunks], series.powers[None], out)
            i += chunks
    return out


class SampleRun(NamedTuple):
    """Run of equally spaced samples in one piece of a law.

    The first sample is at u = ``first``, and the samples are ``width`` apart. ``begin`` and ``end``
    are sample indices. ``chunk`` is the number of samples per chunk, 0 without chunks.
    """

    begin: int
    end: int
    first: float
    width: float
    chunk: int

    @classmethod
    def of(cls, begin: int, end: int, first: float, width: float) -> SampleRun:
        """Return a run of samples with the longest chunks that lose no digits."""
        max_chunk = min((end - begin) / MIN_CHUNKS, MAX_CHUNK_FRACTION / width)
        chunk = next((chunk for chunk in CHUNK_SIZES if chunk <= max_chunk), 0)
        return cls(begin, end, first, width, chunk)

    @property
    def length(self) -> int:
        """Number of samples in the run."""
        return self.end - self.begin

    @property
    def chunks(self) -> int:
        """Number of chunks in the run. The last chunk may extend beyond it."""
        return -(-self.length // self.chunk)

    def at(self) -> FloatArray:
        """Return the position u of each sample in the piece, ``(length,)``."""
        return self.first + self.width * np.arange(self.length, dtype=np.float64)


def group_repeated_runs(runs: list[SampleRun]) -> list[list[SampleRun]]:
    """Group runs of samples of one piece that are equal and evenly spaced.

    Such are the runs of successive turns. The runs are in order, and so are the groups.
    """
    groups: list[list[SampleRun]] = []
    for run in runs:
        group = groups[-1] if groups else [run]
        same = run.length == group[0].length and abs(run.first - group[0].first) < START_ATOL
        gap = group[-1].begin - group[-2].begin if len(group) > 1 else run.begin - group[0].begin
        if groups and same and run.begin - group[-1].begin == gap:
            group.append(run)
        else:
            groups.append([run])
    return groups


@dataclass(frozen=True, eq=False)
class ChunkSeries:
    """Map from basis values at the middle of a chunk of samples to k Taylor series.

    Parameters
    ----------
    table : ndarray, shape (k, p + 1, q)
        Map, with only the q powers that change a digit.
    powers : ndarray, shape (q, chunk)
        Powers of the local abscissa at the samples of a chunk.
    width : float
        Distance of two samples in u.
    """

    table: FloatArray
    powers: FloatArray
    width: float

    @classmethod
    def of(cls, taylor: FloatArray, width: float, chunk: int) -> ChunkSeries:
        """Return the series for polynomials with the Taylor maps ``(k, p + 1, p + 1)``.

        ``width`` is the distance of two samples in u, and ``chunk`` the number of samples.
        """
        scaled = taylor * (0.5 * width * (chunk - 1)) ** np.arange(taylor.shape[2])
        sizes = np.abs(scaled).max(axis=1)  # bounds, because the basis functions sum to 1
        needed = np.cumsum(sizes[:, ::-1], axis=1)[:, ::-1] > POWER_RTOL * sizes[:, :1]
        count = max(1, int(np.max(np.count_nonzero(needed, axis=1))))
        table = np.ascontiguousarray(scaled[:, :, :count])
        return cls(table, chunk_powers(count - 1, chunk), width)

    def at(self, runs: list[SampleRun]) -> FloatArray:
        """Return the Taylor series of all chunks of the runs, ``(k, chunks, q)``."""
        counts = np.array([run.chunks for run in runs])
        chunk_index = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        firsts = np.repeat([run.first for run in runs], counts)
        chunk = self.powers.shape[1]
        middles = firsts + self.width * (chunk * chunk_index + 0.5 * (chunk - 1))
        basis_values = bernstein.basis(self.table.shape[1] - 1, middles)
        return np.asarray(np.matmul(basis_values, self.table))


def _fill_without_chunks(
    runs: list[SampleRun], degree: int, rows: FloatArray, offsets: FloatArray, out: FloatArray
) -> None:
    """Write the samples of some runs to ``out`` by direct evaluation, without chunks.

    Each run of samples lies within one piece of a law of degree p. ``rows`` are the Bernstein
    ordinates of k curves on this piece, ``(k, p + 1)``, and ``offsets`` are added to the curves.
    """
    for start in range(0, len(runs), RUNS_PER_BLOCK):
        block = runs[start : start + RUNS_PER_BLOCK]
        samples = rows @ bernstein.basis(degree, np.concatenate([run.at() for run in block])).T
        samples += offsets[:, None]
        column = 0
        for run in block:
            out[:, run.begin : run.end] = samples[:, column : column + run.length]
            column += run.length


def fill_in_chunks(
    runs: list[SampleRun], terms: FloatArray, over: FloatArray, out: FloatArray
) -> None:
    """Write the samples of a group of runs from `group_repeated_runs` into ``out``.

    The shape of ``out`` is ``(k, count)``. The samples are the products of ``terms``, ``(k, runs or
    1, chunks, q)``, and ``over``, ``(k or 1, q, chunk)``.
    """
    first, chunk = runs[0], runs[0].chunk
    full, remainder = divmod(first.length, chunk)
    last = first.end - remainder
    if len(runs) == 1:
        terms = terms[:, 0]
        np.matmul(terms[:, :full], over, out=out[:, first.begin : last].reshape(-1, full, chunk))
        if remainder:
            out[:, last : first.end] = np.matmul(terms[:, full:], over)[:, 0, :remainder]
        return
    spacing, size = (runs[-1].begin - first.begin) // (len(runs) - 1), out.itemsize
    # Row by row: if numpy cannot determine that nothing overlaps, it computes in a temporary array.
    for row, term, matrix in zip(out, terms, itertools.cycle(over), strict=False):
        shape, strides = (len(runs), full, chunk), (spacing * size, chunk * size, size)
        body = as_strided(row[first.begin :], shape, strides)
        np.matmul(term[:, :full], matrix, out=body[: len(term)])
        body[len(term) :] = body[0]  # a single term if all runs are equal
        if remainder:
            tail = as_strided(row[last:], (len(runs), remainder), (spacing * size, size))
            tail[:] = (term[:, full] @ matrix)[:, :remainder]


@lru_cache(maxsize=1024)
def _piece_series(law: Law, index: int, width: float, chunk: int, weights: bytes) -> ChunkSeries:
    """Return the Taylor series of weighted sums of s, s', s'' in a piece of a law.

    ``weights`` are the bytes of the weights of `sample`.
    """
    series = np.zeros((3, *law.taylor.shape[1:]))
    series[0] = law.taylor[index]
    order = np.arange(1, law.degree + 1) / law.spans[index]
    series[1, :, :-1] = series[0, :, 1:] * order
    series[2, :, :-1] = series[1, :, 1:] * order
    taylor = np.tensordot(np.frombuffer(weights).reshape(-1, 3), series, axes=1)
    return ChunkSeries.of(taylor, width, chunk)


# Bernstein pieces of analytic curves, whose derivatives are as accurate as the values.

#: Degree of the interpolant of the third derivative. The degree of the curve is higher by 3.
THIRD_DEGREE = 22
#: Largest accepted tail of the Chebyshev series of the third derivative, relative to its largest
#: coefficient.
TAIL_RTOL = 1e-13
#: Largest relative contribution of that tail to the curve that is accepted in any case. It is the
#: rounding of the formula.
CURVE_RTOL = 1e-17
#: Shortest piece into which a curve is divided, as a fraction of the curve.
MIN_PIECE_FRACTION = 1e-5
#: Function of abscissae ``(n,)`` and an order, which returns that derivative, ``(n,)``.
Curve = Callable[[FloatArray, int], FloatArray]
#: Start, end, and the curve between them.
Section = tuple[float, float, Curve]


def wave(constant: float, slope: float, size: float, frequency: float, phase: float) -> Curve:
    """Return the function constant + slope·u − size·sin(frequency·u + phase).

    The function also returns its derivatives.
    """

    def curve(u: FloatArray, order: int) -> FloatArray:
        sine = size * frequency**order * np.sin(frequency * u + phase + 0.5 * np.pi * order)
        line = (constant + slope * u, np.full_like(u, slope))
        return np.asarray((line[order] if order < 2 else 0.0) - sine)

    return curve


@lru_cache(maxsize=4)
def _nodes(degree: int) -> tuple[FloatArray, FloatArray]:
    """Return Chebyshev nodes on [0, 1], and the Bernstein basis values at them.

    The shapes are ``(degree + 1,)`` and ``(degree + 1, degree + 1)``.
    """
    nodes = 0.5 - 0.5 * np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
    return nodes, bernstein.basis(degree, nodes)


def fit_curve(
    curve: Curve,
    start: float,
    stop: float,
    degree: int = THIRD_DEGREE,
    accepted_tail: float = TAIL_RTOL,
) -> Pieces:
    """Fit pieces in Bernstein form to a curve on [start, stop].

    The third derivative is interpolated, and integrated from exact values at the start of the
    piece. Differences of an interpolant of s would lose six digits of the third derivative. A piece
    is halved until the Chebyshev tail of the third derivative is accepted.

    Parameters
    ----------
    curve : Curve
        Function of abscissae and order, which returns the derivative of order 0 to 3.
    start, stop : float
        Interval.
    degree : int, optional
        Degree of the third derivative. If pieces are short compared with a period of the stem, a
        lower degree keeps the polynomial solution of the vibration small.
    accepted_tail : float, optional
        Relative tail of the Chebyshev series that is accepted.

    Returns
    -------
    Pieces
        Breakpoints and ordinates.

    Raises
    ------
    LawError
        If the third derivative is not smooth.
    """
    breaks, pieces, intervals = [start], [], [(start, stop)]
    while intervals:
        a, b = intervals.pop()
        third = _third_derivative(curve, a, b, degree, accepted_tail)
        if third is None:
            if b - a < MIN_PIECE_FRACTION * (stop - start):
                raise LawError(
                    f"the curve turns too sharply at {a:.6g} to be followed; allowed: a third "
                    f"derivative that is smooth over {MIN_PIECE_FRACTION:g} of its span"
                )
            middle = 0.5 * (a + b)
            intervals += [(middle, b), (a, middle)]
            continue
        ordinates = third
        for order in (2, 1, 0):
            at_start = curve(np.array([a]), order)[0]
            ordinates = (b - a) * bernstein.antiderivative(ordinates) + at_start
        pieces.append(ordinates)
        breaks.append(b)
    return breaks, pieces


def fit_sections(sections: list[Section], degree: int = THIRD_DEGREE) -> Pieces:
    """Fit pieces in Bernstein form to consecutive curves, each as by `fit_curve`."""
    breaks, pieces = [sections[0][0]], []
    for start, stop, curve in sections:
        section_breaks, section_pieces = fit_curve(curve, start, stop, degree)
        breaks += section_breaks[1:]
        pieces += section_pieces
    return breaks, pieces


def _third_derivative(
    curve: Curve, a: float, b: float, degree: int, accepted_tail: float
) -> FloatArray | None:
    """Return the ordinates of a curve's third derivative on [a, b].

    The result is None if the degree is too low.
    """
    nodes, collocation = _nodes(degree)
    values = curve(a + (b - a) * nodes, 3)
    series = np.polynomial.chebyshev.chebfit(2.0 * nodes - 1.0, values, degree)
    tail = np.abs(series[-2:]).max()
    size = float(np.abs(curve(np.array([a, b]), 0)).max())
    accepted = max(accepted_tail * np.abs(series).max(), CURVE_RTOL * size / (b - a) ** 3)
    return np.asarray(np.linalg.solve(collocation, values)) if tail <= accepted else None
