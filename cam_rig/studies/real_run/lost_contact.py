"""When the follower leaves its cam and lands, as readings show it: the same rule for both."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cam_rig.arrays import FloatArray
from cam_rig.laws import Law
from cam_rig.simulation.flights import OFF_THE_CAM
from cam_rig.studies.real_run.departure import mean_over_turns, scatter
from cam_rig.studies.real_run.pairs import PairedSignal, PairedStep
from cam_rig.units import RPM, TURN

#: A force counts as lost below so many standard deviations of its noise,
SIGMAS = 4.0
#: and below this part of its mean: a load cell's zero is not exact.
PART_OF_MEAN = 0.02
#: Where no force was measured: m, the follower is off by more than this part of the lift.
PART_OF_LIFT = 2e-3
#: Neighbours whose mean tells a lost contact from noise.
NEIGHBOURS = 5
#: A measured and a modelled event this far apart (rad) are not the same one.
NEAR = TURN / 12.0


@dataclass(frozen=True)
class LostContact:
    """Lift-offs and landings of one speed.

    Parameters
    ----------
    measured, model : lift-offs a turn
    shift : s, median of measured less modelled time of the events that both have; None: no such
    degrees : the same as cam angle, °
    rule : in words, what counts as lost
    """

    measured: float
    model: float
    shift: float | None
    degrees: float | None
    rule: str


def lost_contact(step: PairedStep, law: Law) -> LostContact | None:
    """The events of a step; None where neither force nor lift was measured."""
    clear = 0.0
    if step.force is not None and step.lift is not None and step.exact:
        pair, rule = step.force, "F = 0, gap > 0"
        lost = (
            _exactly(pair.measured, step.lift.measured, step.lift.angle, law),
            _exactly(pair.model, step.lift.model, step.lift.angle, law),
        )
    elif step.force is not None:
        pair, limit, zero, rule = _of_force(step.force)
        clear = limit - zero
        lost = (pair.measured - limit, pair.model - limit)
    elif step.lift is not None:
        pair, rise = step.lift, law(np.remainder(step.lift.angle, TURN))
        noise = 0.0 if step.exact else scatter(pair.angle, pair.difference)
        limit = max(SIGMAS * noise, PART_OF_LIFT * law.lift)
        lost = (limit + rise - pair.measured, limit + rise - pair.model)
        rule = f"gap > {1e3 * limit:.3g} mm"
    else:
        return None
    here, there = (_events(pair.time, above, step.exact, clear) for above in lost)
    speed = step.rpm * RPM
    shift = _median_shift(here, there, NEAR / speed)
    counts = [found[0].size / step.turns for found in (here, there)]
    degrees = None if shift is None else float(np.degrees(shift * speed))
    return LostContact(counts[0], counts[1], shift, degrees, rule)


def _exactly(force: FloatArray, lift: FloatArray, angle: FloatArray, law: Law) -> FloatArray:
    """The force where it is above 0 or the follower off the cam; else it rests on a dwell."""
    off = lift - law(np.remainder(angle, TURN)) > OFF_THE_CAM * law.lift
    return np.where((force <= 0.0) & ~off, 1.0, force)


def _of_force(pair: PairedSignal) -> tuple[PairedSignal, float, float, str]:
    """The force below which contact may be lost, and that below which the mean of some is none."""
    places, means = mean_over_turns(pair.angle, pair.measured)
    lowest = places[np.argsort(means)[: max(1, means.size // 20)]]
    part = np.remainder(np.degrees(pair.angle), 360.0)
    near = np.abs(part[:, None] - lowest).min(axis=1) <= 360.0 / means.size
    noise = scatter(pair.angle[near], pair.difference[near]) if near.sum() > 2 else 0.0
    error = PART_OF_MEAN * float(pair.measured.mean())
    limit, zero = max(SIGMAS * noise, error), max(noise, 0.5 * error)
    return pair, limit, zero, f"F < {limit:.3g} N"


def _events(
    time: FloatArray, above: FloatArray, exact: bool, clear: float
) -> tuple[FloatArray, FloatArray]:
    """Times of lift-offs and of landings; where ``above`` is not positive, contact is lost.

    Of readings with noise, a loss counts if the mean of some neighbours is ``clear`` below that:
    on a dwell a small force may fall below the limit now and then.
    """
    lost = above <= 0.0
    if not exact:
        lost = _without_single(lost)
    changes = np.flatnonzero(lost[1:] != lost[:-1])
    edges = np.r_[0, changes + 1, lost.size]
    for begin, end in pairwise(edges.tolist()):
        if lost[begin] and _lowest_mean(above[begin:end]) > -clear:
            lost[begin:end] = False
    changes = np.flatnonzero(lost[1:] != lost[:-1])
    if not changes.size:
        return np.empty(0), np.empty(0)
    before, after = above[changes], above[changes + 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        part = np.clip(np.nan_to_num(before / (before - after), nan=0.5), 0.0, 1.0)
    at = time[changes] + part * (time[changes + 1] - time[changes])
    rises = lost[changes + 1]
    return at[rises], at[~rises]


def _lowest_mean(values: FloatArray) -> float:
    """The lowest mean of neighbours."""
    count = min(NEIGHBOURS, values.size)
    return float(np.convolve(values, np.full(count, 1.0 / count), mode="valid").min())


def _without_single(lost: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The majority of each reading and its neighbours: noise alone changes nothing."""
    padded = np.pad(lost.astype(np.intp), 1, mode="edge")
    return padded[:-2] + padded[1:-1] + padded[2:] >= 2


def _median_shift(
    measured: tuple[FloatArray, FloatArray], model: tuple[FloatArray, FloatArray], near: float
) -> float | None:
    shifts: list[float] = []
    for here, there in zip(measured, model, strict=True):
        if not there.size:
            continue
        for time in here:
            shift = float(time - there[np.argmin(np.abs(there - time))])
            shifts += [shift] if abs(shift) <= near else []
    return float(np.median(shifts)) if shifts else None
