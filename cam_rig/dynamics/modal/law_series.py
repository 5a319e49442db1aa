"""Derivatives and harmonics of a cam law, as arrays for the search in `first_zero`.

The search finds the lowest cam speed at which the least output of a vibration mode (for example the
contact force) is zero. It needs upper bounds of the derivatives s⁽ᵏ⁾(θ) in each polynomial piece of
the law, and of the Fourier coefficients (harmonics) of s(θ).

Numbers in brackets are those of docs/proofs.md, part 2.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from cam_rig.dynamics.modal.harmonic_error import BLOCK_RATIO
from cam_rig.dynamics.modal.motion import LawSeries
from cam_rig.laws import Law, bernstein
from cam_rig.units import TURN, FloatArray

#: Smallest number of polynomial pieces of a law per turn. A piece that spans more than 1/8 of a
#: turn is cut into equal parts.
MIN_PIECES = 8
#: Smallest number of groups of adjacent pieces per turn: a group spans at most 1/64 of a turn, or
#: is a single longer piece.
MIN_GROUPS = 64
#: Relative difference below which the cam angles that two pieces span count as equal.
SPAN_RTOL = 1e-12
#: Number of polynomial pieces of a law above which the second number of `HARMONICS` applies.
MANY_PIECES = 600
#: Number of harmonics of a law that each have a separate bound: for a law of up to `MANY_PIECES`
#: pieces, and of more. The law is sampled at twice as many angles per turn.
HARMONICS = (256, 512)
#: Number of blocks into which the higher harmonics of a law are divided. Each block has one bound
#: for all its harmonics. The first harmonics of successive blocks have the ratio `BLOCK_RATIO`.
BLOCKS = 100
#: Factor that bounds the aliasing error of a Fourier transform of N samples. The sum of |c| over
#: the harmonics that alias to harmonic k is at most this factor times the bound of |c| at harmonic
#: N − k, by (28) of docs/proofs.md.
ALIASING = math.pi**2 / 3.0
#: Rounding error of harmonics from the fast Fourier transform, relative to the largest sample.
SAMPLE_EPS = 2.0**-50


@lru_cache(maxsize=64)
def law_series(law: Law) -> LawSeries:
    """Return the derivatives and harmonics of a law, and their bounds, as arrays.

    `LawSeries` describes the arrays. The result is cached.
    """
    degree = max(law.degree, 1)  # so that a law of degree 0, without motion, has a row for s'' too
    derivative, ordinates = law.ordinates, np.empty((degree + 1, degree + 2, law.spans.size))
    for order in range(degree + 2):
        ordinates[:, order] = bernstein.elevate(derivative, degree)
        derivative = bernstein.derivative(derivative) / law.spans
    ordinates, jumps, breaks = _cut_long_pieces(law, ordinates)
    spans, absolute, jump_sizes = np.diff(breaks), np.abs(ordinates), np.abs(jumps)
    maxima, variations = absolute.max(axis=0), absolute.mean(axis=0) @ spans
    first_pieces, ends = [0], np.searchsorted(breaks, breaks[:-1] + TURN / MIN_GROUPS, "right")
    while first_pieces[-1] < spans.size:
        first_pieces.append(max(first_pieces[-1] + 1, int(ends[first_pieces[-1]]) - 1))
    starts = first_pieces[:-1]
    start_jumps = jump_sizes[:, starts]
    inner_jumps = np.maximum(np.add.reduceat(jump_sizes, starts, axis=1) - start_jumps, 0.0)
    ascending = np.argsort(spans, kind="stable")
    is_new = np.append(True, np.diff(spans[ascending]) > SPAN_RTOL * spans[ascending][1:])
    span_index = np.empty_like(ascending)
    span_index[ascending] = np.cumsum(is_new) - 1
    piece_maxima = np.zeros((spans.size, 5))
    piece_maxima[:, : len(maxima)] = maxima[:5].T
    harmonics, tails, block_maxima = _bound_harmonics(law, jump_sizes.sum(axis=1), variations)
    return LawSeries(
        derivatives=np.ascontiguousarray(ordinates),
        jumps=np.ascontiguousarray(jumps),
        breaks=np.ascontiguousarray(breaks),
        spans=spans[ascending][is_new],
        span_index=span_index,
        first_pieces=np.array(first_pieces),
        max_derivatives=maxima.max(axis=1),
        groups=np.stack([np.maximum.reduceat(maxima, starts, axis=1), start_jumps, inner_jumps]),
        piece_maxima=piece_maxima,
        harmonics=harmonics,
        tails=np.ascontiguousarray(tails),
        block_maxima=np.ascontiguousarray(block_maxima),
    )


def _cut_long_pieces(law: Law, ordinates: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Cut the pieces of a law that span more than 1/`MIN_PIECES` of a turn.

    ``ordinates`` are the Bernstein ordinates of s and its derivatives in each piece of degree p.
    Returns three arrays for the resulting m pieces: the ordinates ``(p + 1, p + 2, m)``, the jumps
    of s⁽ᵏ⁾ at the start of each piece ``(p + 2, m)``, and the cam angles of the joints ``(m + 1,)``
    in rad.
    """
    joints = ordinates[0].copy()
    joints[:, 1:] -= ordinates[-1, :, :-1]
    joints[:, 0] -= ordinates[-1, :, -1]
    counts = np.ceil(law.spans * (MIN_PIECES / TURN) * (1.0 - SPAN_RTOL)).astype(int)
    if counts.max() == 1:
        # Return a copy of the breaks, because compiled code accepts only writable arrays.
        return ordinates, joints, law.breaks.copy()
    pieces, breaks = bernstein.cut(ordinates, law.breaks, counts)
    jumps = np.zeros((ordinates.shape[1], counts.sum()))
    jumps[:, np.cumsum(counts) - counts] = joints
    return pieces, jumps, breaks


@lru_cache(maxsize=64)
def _inverse_powers(degree: int, count: int) -> FloatArray:
    """Return 1/kʳ⁺¹ for r = 1 … ``degree`` and m harmonics k, shape ``(degree, m)``.

    The m harmonics are 1 … ``count``, then N − k for each of them with N = 2 ``count`` samples per
    turn, then the first harmonic of each block of higher harmonics.
    """
    k = np.arange(1.0, count + 1.0)
    blocks = (count + 1.0) * BLOCK_RATIO ** np.arange(BLOCKS)
    inverse = 1.0 / np.concatenate([k, 2.0 * count - k, blocks])
    return np.asarray(inverse ** (1.0 + np.arange(1.0, degree + 1.0)[:, None]))


def _bound_harmonics(
    law: Law, jumps: FloatArray, variations: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return upper bounds of the harmonics of a law by (28) of docs/proofs.md.

    They are the fields ``harmonics``, ``tails`` and ``block_maxima`` of `LawSeries`. ``jumps`` are
    the sums of |jump of s⁽ᵏ⁾| per turn, and ``variations`` are upper bounds of ∫|s⁽ᵏ⁾| dθ over a
    turn, for k = 0 … p + 1, shape ``(p + 2,)`` each.
    """
    count = HARMONICS[law.spans.size > MANY_PIECES]
    degree = len(jumps) - 2
    terms = np.tril(np.broadcast_to(jumps[1:-1], (degree, degree))) + np.diag(variations[2:])
    by_parts = (terms / TURN @ _inverse_powers(degree, count)).min(axis=0)
    angles = np.arange(2 * count) * (0.5 * TURN / count)
    piece = np.searchsorted(law.breaks[1:-1], angles, side="right")
    weights = bernstein.basis(law.degree, (angles - law.breaks[piece]) / law.spans[piece])
    samples = (weights.T * law.ordinates[:, piece]).sum(axis=0)
    aliased = ALIASING * by_parts[count : 2 * count]
    sampled = np.abs(np.fft.rfft(samples)[1:]) / (2 * count) + aliased
    harmonics = np.minimum(sampled + SAMPLE_EPS * np.abs(samples).max(), by_parts[:count])
    over_k, block_maxima = harmonics / np.arange(1.0, count + 1.0), by_parts[2 * count :]
    tails = over_k[::-1].cumsum()[::-1] + block_maxima[0]
    return harmonics, tails, block_maxima
