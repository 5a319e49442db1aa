"""Uniform sampling of a law along a turning cam, as matrix products.

A run of samples inside one piece is cut into chunks of equal length. About the middle of a
chunk the polynomial is written as its (finite, exact) Taylor series; one product with the
fixed matrix of powers then gives all samples of all chunks. No Python loop touches a sample.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.laws import bernstein
from cam_rig.laws.law import Law
from cam_rig.units import TURN

#: Samples in a chunk. Longer ones make the products cheaper and the series longer in range.
CHUNK = 64
#: A chunk may cover this fraction of its piece: beyond it the series would lose digits.
WIDEST_CHUNK = 0.125
#: Middle of a chunk, in chunks from its first sample.
MIDDLE = 0.5 * (CHUNK - 1) / CHUNK
#: A sample this near a joint or an event, in parts of the time between two, is at it. Rounding,
#: which differs with where an interval begins, would else choose the side, and with it the force.
AT_SAMPLE = 1e-6


def samples_before(place: float) -> int:
    """How many of the samples 0, 1, 2, … come before a place among them; one at it does not."""
    return max(0, math.ceil(place - AT_SAMPLE))


@lru_cache(maxsize=64)
def chunk_powers(degree: int) -> FloatArray:
    """``(degree + 1, CHUNK)`` powers of the chunk's local abscissa in [-1, 1]."""
    x = np.linspace(-1.0, 1.0, CHUNK)
    return np.asarray(x[None, :] ** np.arange(degree + 1)[:, None])


def sample(
    law: Law, start: float, step: float, count: int, weights: FloatArray, offsets: FloatArray
) -> FloatArray:
    """Linear combinations of s, s', s'' at the angles ``start + j·step``, j = 0 … count − 1.

    Parameters
    ----------
    start, step : rad; the angle is unwrapped, the step positive
    weights : ``(k, 3)`` row by row the weights of s, s', s''
    offsets : ``(k,)`` constants added to each row

    Returns
    -------
    ``(k, count)``
    """
    out = np.empty((weights.shape[0], count))
    turn = np.floor(start / TURN)
    piece = int(np.searchsorted(law.breaks, start - turn * TURN, side="right")) - 1
    begin = 0
    while begin < count:
        index = piece % law.spans.size
        low = law.breaks[index] + (turn + piece // law.spans.size) * TURN
        span = law.spans[index]
        end = min(count, max(begin, samples_before((low + span - start) / step)))
        if end > begin:
            run = _Run((start + begin * step - low) / span, step / span, end - begin)
            fill = _fill_directly if run.short else _fill_in_chunks
            fill(law, index, run, weights, out[:, begin:end])
        begin = end
        piece += 1
    out += offsets[:, None]
    return out


@dataclass(frozen=True)
class _Run:
    """Samples inside one piece, at u = first + j·step."""

    first: float
    step: float
    count: int

    @property
    def short(self) -> bool:
        return self.count < 2 * CHUNK or self.step * CHUNK > WIDEST_CHUNK


def _fill_directly(law: Law, index: int, run: _Run, weights: FloatArray, out: FloatArray) -> None:
    at = bernstein.basis(law.degree, run.first + run.step * np.arange(run.count, dtype=np.float64))
    np.matmul(weights @ law.motion[:, :, index], at.T, out=out)


def _fill_in_chunks(law: Law, index: int, run: _Run, weights: FloatArray, out: FloatArray) -> None:
    degree, span = law.degree, law.spans[index]
    chunks, full = -(-run.count // CHUNK), run.count // CHUNK
    middles = run.first + run.step * CHUNK * (np.arange(chunks, dtype=np.float64) + MIDDLE)
    series = np.zeros((3, chunks, degree + 1))
    series[0] = bernstein.basis(degree, middles) @ law.taylor[index]
    order = np.arange(1, degree + 1) / span
    series[1, :, :-1] = series[0, :, 1:] * order
    series[2, :, :-1] = series[1, :, 1:] * order
    series *= (0.5 * run.step * (CHUNK - 1)) ** np.arange(degree + 1)
    for row, terms in zip(out, np.tensordot(weights, series, axes=1), strict=True):
        body = row[: full * CHUNK].reshape(full, CHUNK)
        np.matmul(terms[:full], chunk_powers(degree), out=body)
        if chunks > full:
            row[full * CHUNK :] = (terms[full] @ chunk_powers(degree))[: run.count - full * CHUNK]
