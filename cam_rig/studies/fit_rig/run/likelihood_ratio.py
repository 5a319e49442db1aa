"""Comparison of two fits by the logarithm of their likelihood ratio.

A search leaves out the force samples next to landings. A model that bounces through the whole turn
would thereby leave out nearly all forces, including those that contradict it. The comparison of two
fits therefore includes these samples. The computed angle of a landing may have a small error. The
residual of such a sample is therefore its distance from the range of the computed forces within
that error of the angle.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cam_rig.studies.fit_rig.run.noise_model import update_noise
from cam_rig.studies.fit_rig.run.search import GUARD, FitSolution, continue_from
from cam_rig.units import FloatArray

#: Largest increase of the sum of squared residuals, in squared standard deviations, that is
#: attributed to chance when two fits are compared. With twenty parameters χ² exceeds it once in 140
#: 000 cases.
MAX_CHANCE_SSE = 60.0


def contradicts(partial: FitSolution, complete: FitSolution) -> bool:
    """Return True if the fit of all speeds does not explain some of the speeds.

    ``partial`` is the fit to these speeds alone, ``complete`` that to all. The sum of squared
    residuals of these speeds is compared between both fits. If one follower explains all speeds, it
    is larger in ``complete`` by about the number of parameters. Case: a stem that a rigid mass
    cannot fit in flight (``test_parameters_of_all_speeds_may_contradict_some``).
    """
    partial_likelihood, complete_likelihood = partial.likelihood, complete.likelihood
    order = [
        complete_likelihood.segments.index(segment)
        for segment in partial_likelihood.segments
        if segment in complete_likelihood.segments
    ]
    if len(order) < len(partial_likelihood.segments):
        return False
    moved = continue_from(complete, complete_likelihood.free, complete.values, indices=order)
    new = replace(
        moved.likelihood,
        force_masks=partial_likelihood.force_masks,
        pressing=partial_likelihood.pressing,
    )
    new.lift_noise, new.force_noise, new.relative_force_noise = partial_likelihood.noise
    moved_sse, sse = (float(off @ off) for off in (new.residuals(moved.x), partial.residuals))
    return moved_sse - sse > MAX_CHANCE_SSE


def log_ratio(first: FitSolution, other: FitSolution) -> float:
    """Return the log of the likelihood of the first fit relative to the other fit.

    A positive value favours ``first``. The ratio uses the steady-speed segments and the samples
    that both fits include.
    """
    common = [
        (i, other.segments.index(h)) for i, h in enumerate(first.segments) if h in other.segments
    ]
    both = [first.likelihood.force_masks[i] & other.likelihood.force_masks[k] for i, k in common]
    logs = []
    for side, solution in enumerate((first, other)):
        indices = [pair[side] for pair in common]
        like = replace(solution.likelihood, force_masks=list(solution.likelihood.force_masks))
        for i, mask in zip(indices, both, strict=True):
            like.force_masks[i] = mask
        update_noise(like, like.residuals(solution.x))
        total = 0.0
        for i in indices:
            total -= like.segments[i].lift.value.size * math.log(like.lift_noise)
            total -= float(np.log(like.force_deviation(i)).sum())
        logs.append(total)
    return logs[0] - logs[1]


#: Largest squared residual of one sample in a comparison of restitutions: the square of six
#: standard deviations. It limits the effect of a sample that falls on the wrong side of a landing.
MAX_SQUARE = 36.0


def log_ratio_of_all(first: FitSolution, other: FitSolution) -> float:
    """Return the log likelihood ratio of two fits, including samples near landings.

    A positive value favours ``first``. See `log_ratio` for the ratio without these samples.
    """
    ratio = log_ratio(first, other)
    for i, segment in enumerate(first.segments):
        if segment in other.segments:
            ratio += 0.5 * _square_difference(first, i, other, other.segments.index(segment))
    return ratio


def _square_difference(first: FitSolution, i: int, other: FitSolution, k: int) -> float:
    """Return the sum of squares of the other fit minus that of the first fit.

    It covers the force samples near landings that at least one of the fits excludes. ``i`` and
    ``k`` are the indices of the same steady-speed segment in ``first`` and ``other``.
    """
    samples = np.flatnonzero(~(first.likelihood.force_masks[i] & other.likelihood.force_masks[k]))
    if not samples.size:
        return 0.0
    widths = (
        s.likelihood.landing_errors(s.x, index, GUARD)[samples]
        for s, index in ((first, i), (other, k))
    )
    width = np.maximum(GUARD, np.maximum(*widths))
    return float(
        (
            _squared_distances(other, k, samples, width)
            - _squared_distances(first, i, samples, width)
        ).sum()
    )


def _squared_distances(
    fit: FitSolution, i: int, samples: NDArray[np.intp], width: FloatArray
) -> FloatArray:
    """Return the squared distances of force samples from the computed forces nearby.

    The computed forces are those at cam angles within ``width`` (rad) of the sample. A distance is
    that of the sample from their range, in standard deviations. It is 0 inside this range, and its
    square is at most `MAX_SQUARE`. ``i`` is the index of the steady-speed segment, ``samples`` are
    indices into it.
    """
    like = fit.likelihood
    low, high = like.force_range_near(fit.x, i, samples, width)
    value = like.segments[i].force.value[samples]
    nearest = np.clip(value, low, high)
    deviation = np.hypot(like.force_noise, like.relative_force_noise * nearest)
    return np.asarray(np.minimum(((value - nearest) / deviation) ** 2, MAX_SQUARE))
