"""A spline with exact dwells through readings, within the error that the gauge has or shows."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from cam_rig.errors import ConfigError, LawError
from cam_rig.laws import Law
from cam_rig.laws.bernstein import joined
from cam_rig.laws.law import extremes, peak
from cam_rig.laws.segments import SAME_LIFT, SAME_LIFT_TOLERANCES
from cam_rig.laws.spline import Rest, Smoothed, least_tolerance, smooth
from cam_rig.measured.cam_fit.dwells import FoundDwell, find_dwells, likely_range
from cam_rig.measured.cam_fit.gauge import Readings, bridges, without_outliers
from cam_rig.schema.segment_base import MAX_TOLERANCE, WIDEST_GAP_DEG

#: Without a gauge's error the scatter is allowed, and so many of its standard errors: one that was
#: found too small makes a spline of many knots, one found too large hardly another one.
MARGIN = 2.0

#: Where no spline comes near enough, it is allowed so many times the distance, and again.
WIDER = 2.0


@dataclass(frozen=True, eq=False)
class SplineFit:
    """What a spline through readings is, and how far it is from them; lengths in m.

    Parameters
    ----------
    readings : those that were used, above the lowest lift
    zero : what the gauge showed there
    scatter : standard deviation of the readings about a smooth law, by themselves
    asked : the gauge's error as it was given, None where it was not
    tolerance : r.m.s. distance that the spline was allowed
    widened : whether that had to be more than was asked for, or than the scatter: nearer, the
        spline would need nearly a knot a reading
    """

    readings: Readings
    zero: float
    scatter: float
    asked: float | None
    tolerance: float
    widened: bool
    dwells: tuple[FoundDwell, ...]
    smoothed: Smoothed
    law: Law

    @property
    def followed(self) -> bool:
        """Whether the tolerance is the one asked for."""
        return self.asked is not None and self.tolerance == self.asked

    @property
    def worst(self) -> int:
        """Which reading is farthest from the spline."""
        away = self.law(self.readings.angles) - self.readings.lifts
        return int(np.argmax(np.abs(away)))

    @property
    def peaks(self) -> tuple[float, float]:
        """Largest |s'| (m/rad) and |s''| (m/rad²)."""
        return abs(peak(self.law, 1).value), abs(peak(self.law, 2).value)


def fit_spline(readings: Readings, asked: float | None = None) -> SplineFit:
    """Fit readings in order; ``asked`` is the gauge's error (m), else their scatter is taken."""
    kept = without_outliers(readings)
    scatter = kept.scatter
    tolerance = _tolerance(kept, scatter, asked)
    dwells = find_dwells(kept, scatter)
    _require_no_gap(kept, dwells)
    rests = [dwell.rest for dwell in dwells]
    allowed, smoothed = _smoothed(kept, tolerance, rests)
    law = _law(smoothed)
    _require_same_lift(kept, law, allowed)
    zero = _zero(law, rests, likely_range(kept.angles.size) * scatter)
    columns = [column - zero for column in smoothed.pieces[1]]
    smoothed = replace(smoothed, pieces=(smoothed.pieces[0], columns))
    return SplineFit(
        replace(kept, lifts=kept.lifts - zero),
        zero,
        scatter,
        asked,
        allowed,
        allowed > tolerance,
        tuple(_above(dwell, zero) for dwell in dwells),
        smoothed,
        _law(smoothed),
    )


def _smoothed(readings: Readings, tolerance: float, rests: list[Rest]) -> tuple[float, Smoothed]:
    """The spline, and the tolerance (m) that it took: a wider one where none is so near."""
    most = MAX_TOLERANCE * float(np.ptp(readings.lifts))
    while True:
        try:
            return tolerance, smooth(readings.angles, readings.lifts, tolerance, rests)
        except LawError as error:
            if tolerance * WIDER > most:
                raise LawError(f"{readings.name}: {error}") from None
            tolerance *= WIDER


def _tolerance(readings: Readings, scatter: float, asked: float | None) -> float:
    """The one asked for, unless it lies below the scatter; the scatter and its error else."""
    most = MAX_TOLERANCE * float(np.ptp(readings.lifts))
    if asked is not None and not 0.0 < asked <= most:
        raise ConfigError(
            f"--tolerance: is {asked * 1e3:g} mm; allowed: above 0, at most {most * 1e3:.4g} mm, "
            f"{MAX_TOLERANCE:g} of the lift"
        )
    if asked is not None and asked >= least_tolerance(scatter, readings.angles.size):
        return asked
    found = scatter * (1.0 + MARGIN * readings.scatter_error)
    if found > most:
        raise ConfigError(
            f"{readings.name}: readings scatter by {scatter * 1e3:.3g} mm about a smooth law; "
            f"allowed: at most {most * 1e3:.3g} mm, {MAX_TOLERANCE:g} of the lift, so read finer "
            "or check the columns"
        )
    return found


def _require_no_gap(readings: Readings, dwells: tuple[FoundDwell, ...]) -> None:
    start, span = readings.gap
    if bridges(readings) and not any(dwell.covers(start, span) for dwell in dwells):
        raise ConfigError(
            f"{readings.name}: no reading for {math.degrees(span):.4g} deg after "
            f"{math.degrees(start):.4g} deg, and the cam does not rest at its ends; allowed: gaps "
            f"of at most {WIDEST_GAP_DEG:g} deg, or a gap between two readings of one level"
        )


def _zero(law: Law, rests: list[Rest], near: float) -> float:
    """The level (m) of the lowest dwell, or the law's lowest where that is not near it."""
    lowest = extremes(law, 0)[0].value
    level = min((rest.level for rest in rests), default=lowest)
    return level if level - lowest < near else lowest


def _require_same_lift(readings: Readings, law: Law, allowed: float) -> None:
    """Refuse a spline that goes far beyond its readings, or stays far below."""
    height = float(np.ptp(readings.lifts))
    if abs(law.lift - height) > SAME_LIFT * height + SAME_LIFT_TOLERANCES * allowed:
        raise LawError(
            f"{readings.name}: the spline rises by {law.lift * 1e3:.4g} mm, the readings by "
            f"{height * 1e3:.4g} mm; allowed: the same within {SAME_LIFT:g} of it, so read finer "
            "where the cam is steep"
        )


def _above(dwell: FoundDwell, zero: float) -> FoundDwell:
    return replace(dwell, rest=dwell.rest._replace(level=dwell.rest.level - zero))


def _law(smoothed: Smoothed) -> Law:
    breaks, columns = smoothed.pieces
    return Law("fitted", np.array(breaks), joined(columns))
