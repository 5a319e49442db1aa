"""Fit of a spline with exact dwells to gauge readings, within the error of the gauge."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from cam_rig.errors import ConfigError, LawError
from cam_rig.laws import Law
from cam_rig.laws.bernstein import join_pieces
from cam_rig.laws.law import extremes, peak
from cam_rig.laws.segments import LIFT_RTOL, MAX_LIFT_TOLERANCES
from cam_rig.laws.spline import Rest, Smoothed, differences, min_tolerance, smooth
from cam_rig.profile.cam_checks import warn_of_unusual_lift
from cam_rig.schema.segment_base import MAX_GAP_DEG, MAX_TOLERANCE
from cam_rig.show.result import Column, Records, Result
from cam_rig.studies.fit_cam.dwells import FoundDwell, find_dwells, likely_range
from cam_rig.studies.fit_cam.gauge import Readings
from cam_rig.studies.fit_cam.outliers import MIN_OUTLIER_SCATTERS, exclude_outliers, is_sharp_nose
from cam_rig.studies.fit_cam.recognition import RecognisedLaw, describe
from cam_rig.studies.fit_cam.suspects import (
    MIN_REPORTED_SCATTERS,
    list_farthest,
    list_outliers,
    relative_residuals,
)
from cam_rig.studies.fit_cam.valve_events import ValveTrain, explain_missing_events, valve_events
from cam_rig.units import FloatArray

#: Margin that is added to the scatter of the readings to obtain the tolerance of the spline if the
#: error of the gauge is not given, in standard errors of the scatter. A tolerance that is too small
#: gives many knots. A tolerance that is too large has little effect.
SCATTER_MARGIN_ERRORS = 2.0
#: Factor by which the tolerance of the spline is multiplied, repeatedly, until a spline exists
#: within it.
WIDENING_FACTOR = 2.0
#: Largest median distance of readings (deg) without a warning that the readings do not determine
#: the law between them. For the laws of this project, the peak acceleration is within 2 % at 5 deg,
#: and within 5 % at 10 deg.
MAX_CLOSE_STEP_DEG = 5.0
#: Largest excess of the fitted law over the highest or below the lowest reading without a warning,
#: as a fraction of the lift. An excess up to the tolerance of the fit is allowed in any case.
MAX_BEYOND_READINGS = 0.01
#: Smallest distance of a reading from its neighbours, in scatters, at which its residual is
#: compared with the scatter, and not only with the other residuals. It is below the limit of an
#: outlier, because the residual of the reading is evaluated as well.
MIN_CONTRADICTION_SCATTERS = 2.5


@dataclass(frozen=True, eq=False, repr=False)
class SplineFit(Result):
    """Spline through readings, and its residuals.

    Attributes
    ----------
    readings
        Readings that the spline is fitted to, without outliers.
    zero
        Reading of the gauge in m at the lowest lift.
    scatter
        Standard deviation in m of the readings about a smooth law, estimated without the spline.
    requested_tolerance
        Error of the gauge in m that was given, None if it was not given.
    tolerance
        Allowed residual of the spline in m, r.m.s.
    widened
        True if the tolerance had to be larger than the given error, or than the scatter with its
        margin. A spline within a smaller tolerance would need almost as many knots as there are
        readings.
    dwells
        Dwells in the order of the cam angle. They are exact in the law.
    smoothed
        Pieces of the spline, number of its knots and residuals.
    law
        Fitted law, with the lowest lift 0.
    notes
        Sentences about the interpretation of the table.
    assumed
        Assumptions in the written cam file that no reading supports.
    base_radius
        Base radius in m from an option or from the table, otherwise None.
    roller_radius
        Radius of the roller in m from an option or from the table, otherwise None.
    valve_train
        Valve train of the valve events.
    recognised
        Named laws by likelihood, if they were requested.
    """

    schema = "cam_rig.fit_spline.2"
    plot_function = "cam_rig.studies.fit_cam.figures:spline_figure"
    columns: ClassVar = {
        "spline": (
            Column("count", "", "d", "readings used", of="readings.angles.size"),
            Column("excluded", "", "d", "readings excluded", lambda f: len(f.readings.outliers)),
            Column("scatter", "mm", ".5g", "scatter of the readings"),
            Column("scatter_error", "mm", ".5g", "its standard error"),
            Column("requested_tolerance", "mm", hidden=True, doc="error of the gauge as given"),
            Column("tolerance", "mm", ".5g", "residual allowed, r.m.s."),
            Column("followed", hidden=True, doc="true if it is the requested tolerance"),
            Column("rms", "mm", ".5g", "residual, r.m.s.", of="smoothed.rms"),
            Column("largest", "mm", ".5g", "residual, largest", of="smoothed.largest"),
            Column("largest_at", "°", ".5g", "at", lambda f: f.readings.angles[f.worst]),
            Column("largest_line", "", "d", "in line", lambda f: int(f.readings.lines[f.worst])),
            Column("knots", "", "d", of="smoothed.knots"),
            Column("dwells", "", "d", of=lambda fit: len(fit.dwells)),
            Column("zero", "mm", ".5g", "gauge at the lowest lift"),
            Column("lift", "mm", ".5g", of="law.lift"),
            Column("peak_velocity", "mm/rad", ".5g", of="peaks.0"),
            Column("peak_acceleration", "mm/rad²", ".5g", of="peaks.1"),
            Column("base_radius", "mm", hidden=True, doc="as stated, else empty"),
        ),
        "valve": (
            Column("height", "mm", ".4g", "checking height"),
            Column("opening", "°", ".2f", "opens at"),
            Column("closing", "°", ".2f", "closes at"),
            Column("duration", "°", ".2f"),
            Column("crank_duration", "°", ".2f", "duration, crank", lambda e: 2.0 * e.duration),
            Column("lobe_centre", "°", ".2f"),
        ),
        "recognised": (
            Column("event", "", "d"),
            Column("law"),
            Column("start", "°", ".3f", "from"),
            Column("start_error", "°", ".2g", "±"),
            Column("span", "°", ".3f"),
            Column("span_error", "°", ".2g", "±"),
            Column("rise", "mm", ".5g"),
            Column("rise_error", "mm", ".2g", "±"),
            Column("rms", "mm", ".2g", "residual, r.m.s."),
            Column("worse", "", ".3g", doc="log-likelihood of the best law less that of this law"),
            Column("explains", hidden=True, doc="true if the residual is the scatter"),
        ),
        "dwells": (
            Column("start", "°", ".2f", "from", "rest.start"),
            Column("span", "°", ".2f", of="rest.span"),
            Column("level", "mm", ".4f", of="rest.level"),
            Column("readings", "", "d", of="count"),
            Column("scatter", "mm", ".2g", "their scatter"),
        ),
        "outliers": (
            Column("line", "", "d"),
            Column("angle", "°", ".6g", "at"),
            Column("reading", "mm", ".6g", of="lift"),
            Column("distance", "mm", ".3g", "from its neighbours"),
        ),
        "fit": (
            Column("readings", of="readings.name"),
            Column("notes", doc="how they were read"),
            Column("conclusions", of=lambda fit: [*fit.conclusions()]),
        ),
    }

    readings: Readings
    zero: float
    scatter: float
    requested_tolerance: float | None
    tolerance: float
    widened: bool
    dwells: tuple[FoundDwell, ...]
    smoothed: Smoothed
    law: Law
    notes: tuple[str, ...] = ()
    assumed: tuple[str, ...] = ()
    base_radius: float | None = None
    roller_radius: float | None = None
    valve_train: ValveTrain = field(default_factory=ValveTrain)
    recognised: tuple[RecognisedLaw, ...] = ()

    @property
    def scatter_error(self) -> float:
        """Standard error of the estimated scatter of the readings, m."""
        return self.scatter * self.readings.scatter_error

    @property
    def followed(self) -> bool:
        """True if the tolerance of the spline is the given error of the gauge."""
        return self.tolerance == self.requested_tolerance

    @property
    def worst(self) -> int:
        """Index of the reading that is farthest from the fitted spline."""
        return int(np.argmax(np.abs(self._residuals)))

    @property
    def _residuals(self) -> FloatArray:
        """Residuals of the gauge readings (reading minus fitted law) in m, ``(n,)``."""
        return self.readings.lifts - self.law(self.readings.angles)

    @cached_property
    def peaks(self) -> tuple[float, float]:
        """Largest |s'| (m/rad) and |s''| (m/rad²) of the fitted law."""
        return abs(peak(self.law, 1).value), abs(peak(self.law, 2).value)

    def tables(self) -> list[Records]:
        """Return the tables of the spline, its dwells, the outliers and the valve events."""
        name, train = self.readings.name, self.valve_train
        valve = (
            f"Valve events, rocker ratio {train.rocker_ratio:g}, lash {train.lash * 1e3:g} mm, "
            "angles of the cam"
        )
        outliers = "Readings that look like outliers"
        laws = self.table("recognised", "Named laws, by likelihood", self.recognised)
        return [
            self.table("spline", f"{name}: spline", [self], single=True, transposed=True),
            self.table("dwells", "Dwells, exact in the law", self.dwells),
            *([laws] if self.recognised else []),
            self.table("outliers", outliers, self.readings.outliers),
            self.table("valve", valve, valve_events(self.law, train)),
            self.table("fit", "The fit", [self], single=True, hidden=True),
        ]

    def summary(self) -> list[str]:
        """Return the sentences under the tables: how the table was read, then conclusions."""
        return [*self.notes, *self.conclusions()]

    def conclusions(self) -> Iterator[str]:
        """Yield sentences on the fit, its residuals, and suspicious readings."""
        smoothed, angles = self.smoothed, self.readings.angles
        yield (
            f"The law is {smoothed.rms * 1e3:.3g} mm r.m.s. and {smoothed.largest * 1e3:.3g} mm at "
            f"most from {angles.size} readings, with {smoothed.knots} knots."
        )
        yield from describe(self.recognised)
        yield from warn_of_unusual_lift(self.law.lift)
        yield from explain_missing_events(self.law, self.valve_train)
        yield from self._explain_tolerance()
        yield from self._explain_range()
        step = math.degrees(float(np.median(np.diff(angles))))
        if step > MAX_CLOSE_STEP_DEG:
            yield (
                f"Readings are {step:.3g} deg apart: what the law does between them counts as "
                "scatter, and peaks of acceleration are inaccurate."
            )
        yield from self._list_suspects()

    def _explain_tolerance(self) -> Iterator[str]:
        """Yield a sentence if the tolerance is not the requested one or was increased."""
        if self.widened:
            yield (
                f"The residual allowed is {self.tolerance * 1e3:.3g} mm, more than the readings' "
                "scatter: a spline nearer to them would need almost as many knots as there are "
                "readings. Read the cam finer, or check the readings farthest from the law."
            )
        elif self.requested_tolerance is not None and not self.followed:
            lowest = min_tolerance(self.scatter, self.readings.angles.size)
            yield (
                f"Not followed: the requested tolerance is {self.requested_tolerance * 1e3:.3g} "
                f"mm, the readings scatter by {self.scatter * 1e3:.3g} mm. A closer spline would "
                f"follow their noise; allowed: {lowest * 1e3:.3g} mm or more."
            )

    def _explain_range(self) -> Iterator[str]:
        """Yield a sentence if the law goes far beyond the range of its readings."""
        lifts, lift = self.readings.lifts, self.law.lift
        low, high = float(lifts.min()), float(lifts.max())
        if max(low, lift - high) > max(MAX_BEYOND_READINGS * lift, self.tolerance):
            yield (
                f"The law goes from {self.zero * 1e3:.4g} to {(self.zero + lift) * 1e3:.4g} mm of "
                f"the gauge, the readings from {(self.zero + low) * 1e3:.4g} to "
                f"{(self.zero + high) * 1e3:.4g} mm: it swings between them, so read the cam finer."
            )

    def _list_suspects(self) -> Iterator[str]:
        """Yield sentences on a sharp nose, on readings far from the law, and on outliers."""
        readings, law = self.readings, self.law
        sizes, top = self._relative_residuals(), int(np.argmax(readings.lifts))
        if sizes[top] > MIN_REPORTED_SCATTERS and is_sharp_nose(readings, top):
            yield (
                f"The nose, line {readings.lines[top]} ({math.degrees(readings.angles[top]):.6g} "
                "deg), is sharper than the distance of the readings: the spline rises by "
                f"{law.lift * 1e3:.4g} mm, the readings by {np.ptp(readings.lifts) * 1e3:.4g} mm. "
                "Read it finer there, or use the shape arcs."
            )
        else:  # not near a sharp nose, where the spline oscillates and misses good readings
            yield from list_farthest(readings, self._residuals, sizes)
        if readings.outliers or sizes.max() <= MIN_OUTLIER_SCATTERS:
            yield list_outliers(readings)

    def _relative_residuals(self) -> FloatArray:
        """Return absolute residuals as multiples of a typical deviation, shape ``(n,)``.

        The typical deviation is the r.m.s. of the other residuals. For a reading that its
        neighbours contradict, it is the scatter of the readings instead, if that gives a larger
        value: an outlier attracts the spline, which increases the residuals around it but not the
        scatter. A spline that is too smooth has large residuals at many successive readings, but
        their neighbours do not contradict them.
        """
        readings, residuals = self.readings, self._residuals
        values, is_valid = differences(readings.angles, readings.lifts)
        contradicted = is_valid & (np.abs(values) > MIN_CONTRADICTION_SCATTERS * self.scatter)
        scatters = np.where(contradicted, np.abs(residuals) / self.scatter, 0.0)
        return np.maximum(scatters, relative_residuals(readings, residuals))


def fit_spline(readings: Readings, requested_tolerance: float | None = None) -> SplineFit:
    """Fit a spline with exact dwells to readings in rising order of the angle.

    `requested_tolerance` is the error of the gauge in m (default: the scatter of the readings).
    Outliers are excluded. Raises ConfigError or LawError if no spline fits the readings.
    """
    kept = exclude_outliers(readings)
    scatter = kept.scatter
    tolerance = _choose_tolerance(kept, scatter, requested_tolerance)
    dwells = find_dwells(kept, scatter)
    _require_dwell_in_gap(kept, dwells)
    rests = [dwell.rest for dwell in dwells]
    used_tolerance, smoothed = _smooth_within(kept, tolerance, rests)
    law = _build_law(smoothed)
    _require_same_lift(kept, law, used_tolerance)
    lowest = extremes(law, 0)[0].value
    level = min((rest.level for rest in rests), default=lowest)
    is_lowest = level - lowest < likely_range(kept.angles.size) * scatter
    zero = level if is_lowest else lowest
    columns = [column - zero for column in smoothed.pieces[1]]
    smoothed = replace(smoothed, pieces=(smoothed.pieces[0], columns))
    return SplineFit(
        readings=replace(kept, lifts=kept.lifts - zero),
        zero=zero,
        scatter=scatter,
        requested_tolerance=requested_tolerance,
        tolerance=used_tolerance,
        widened=used_tolerance > tolerance,
        dwells=tuple(dwell.at_level(dwell.rest.level - zero) for dwell in dwells),
        smoothed=smoothed,
        law=_build_law(smoothed),
    )


def _choose_tolerance(readings: Readings, scatter: float, requested: float | None) -> float:
    """Return the requested tolerance (m), or the scatter plus a margin.

    The scatter plus a margin is also used if the requested tolerance is so small that the spline
    would follow the noise. Raises ConfigError if the tolerance or the scatter is too large.
    """
    limit = MAX_TOLERANCE * float(np.ptp(readings.lifts))
    if requested is not None and not 0.0 < requested <= limit:
        raise ConfigError(
            f"--tolerance: is {requested * 1e3:g} mm; allowed: above 0, at most "
            f"{limit * 1e3:.4g} mm, {MAX_TOLERANCE:g} of the lift"
        )
    if requested is not None and requested >= min_tolerance(scatter, readings.angles.size):
        return requested
    tolerance = scatter * (1.0 + SCATTER_MARGIN_ERRORS * readings.scatter_error)
    if tolerance > limit:
        raise ConfigError(
            f"{readings.name}: readings scatter by {scatter * 1e3:.3g} mm about a smooth law; "
            f"allowed: at most {limit * 1e3:.3g} mm, {MAX_TOLERANCE:g} of the lift, so read finer "
            "or check the columns"
        )
    return tolerance


def _smooth_within(
    readings: Readings, tolerance: float, rests: list[Rest]
) -> tuple[float, Smoothed]:
    """Return the tolerance (m) and a spline whose residual is within it.

    ``rests`` are the dwells. The tolerance is increased until such a spline exists. Raises LawError
    if it would become too large.
    """
    limit = MAX_TOLERANCE * float(np.ptp(readings.lifts))
    while True:
        try:
            return tolerance, smooth(readings.angles, readings.lifts, tolerance, rests)
        except LawError as error:
            if tolerance * WIDENING_FACTOR > limit:
                raise LawError(f"{readings.name}: {error}") from None
            tolerance *= WIDENING_FACTOR


def _require_dwell_in_gap(readings: Readings, dwells: tuple[FoundDwell, ...]) -> None:
    """Raise ConfigError if a wide gap in the readings is not inside a dwell.

    See `Readings.has_wide_gap`.
    """
    start, span = readings.gap
    if readings.has_wide_gap and not any(dwell.covers(start, span) for dwell in dwells):
        raise ConfigError(
            f"{readings.name}: no reading for {math.degrees(span):.4g} deg after "
            f"{math.degrees(start):.4g} deg, and the cam does not rest at its ends; allowed: gaps "
            f"of at most {MAX_GAP_DEG:g} deg, or a gap between two readings of one level"
        )


def _require_same_lift(readings: Readings, law: Law, tolerance: float) -> None:
    """Raise LawError if the lift of the spline differs much from that of its readings."""
    height = float(np.ptp(readings.lifts))
    if abs(law.lift - height) > LIFT_RTOL * height + MAX_LIFT_TOLERANCES * tolerance:
        raise LawError(
            f"{readings.name}: the spline rises by {law.lift * 1e3:.4g} mm, the readings by "
            f"{height * 1e3:.4g} mm; allowed: the same within {LIFT_RTOL:g} of it, so read finer "
            "where the cam is steep"
        )


def _build_law(smoothed: Smoothed) -> Law:
    """Return the law that consists of the polynomial pieces of a spline."""
    breaks, columns = smoothed.pieces
    return Law("fitted", np.array(breaks), join_pieces(columns))
