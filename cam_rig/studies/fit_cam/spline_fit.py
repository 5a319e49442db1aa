"""Fit of a spline with exact dwells to readings, within the error of the gauge."""

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
from cam_rig.studies.fit_cam.dwells import (
    FARTHEST,
    FoundDwell,
    beside_others,
    farthest,
    find_dwells,
    left_out,
    likely_range,
)
from cam_rig.studies.fit_cam.gauge import Readings, bridges
from cam_rig.studies.fit_cam.outliers import OUTLIER, is_summit, without_outliers
from cam_rig.studies.fit_cam.valve_events import (
    ValveTrain,
    explain_missing_events,
    valve_events,
)
from cam_rig.units import FloatArray

#: Number of standard errors of the scatter that are added to it if the error of the gauge is not
#: given. A tolerance that is too small gives many knots. One that is too large has little effect.
MARGIN = 2.0
#: Factor by which the tolerance is widened repeatedly, until there is a spline within it.
WIDER = 2.0


#: Largest median distance of readings (deg) that determine the law between them.
WIDE_DEG = 5.0
#: Smallest distance of a reading from its neighbours, in scatters, above which its residual is
#: compared with the scatter, and not only with the other residuals.
CONTRADICTED = 2.5


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
    asked
        Given error of the gauge in m, None if it is not given.
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
    valve_train
        Valve train of the valve events.
    """

    schema = "cam_rig.fit_spline.1"
    plot_function = "cam_rig.studies.fit_cam.figures:spline_figure"
    columns: ClassVar = {
        "spline": (
            Column("count", "", "d", "readings used", of="readings.angles.size"),
            Column(
                "left_out", "", "d", "readings left out", lambda fit: len(fit.readings.outliers)
            ),
            Column("scatter", "mm", ".5g", "scatter of the readings"),
            Column("scatter_error", "mm", ".5g", "its standard error"),
            Column("asked", "mm", hidden=True, doc="the gauge's error as it was given"),
            Column("tolerance", "mm", ".5g", "residual allowed, r.m.s."),
            Column("followed", hidden=True, doc="whether that is the one asked for"),
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
            Column(
                "crank_duration",
                "°",
                ".2f",
                "duration, crank",
                lambda event: 2.0 * event.duration,
            ),
            Column("lobe_centre", "°", ".2f"),
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
            Column("off", "mm", ".3g", "off its neighbours", "beside"),
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
    asked: float | None
    tolerance: float
    widened: bool
    dwells: tuple[FoundDwell, ...]
    smoothed: Smoothed
    law: Law
    notes: tuple[str, ...] = ()
    assumed: tuple[str, ...] = ()
    base_radius: float | None = None
    valve_train: ValveTrain = field(default_factory=ValveTrain)

    @property
    def scatter_error(self) -> float:
        """Standard error of the scatter, m."""
        return self.scatter * self.readings.scatter_error

    @property
    def followed(self) -> bool:
        """True if the tolerance is the given error of the gauge."""
        return self.asked is not None and self.tolerance == self.asked

    @property
    def worst(self) -> int:
        """Index of the reading with the largest residual."""
        return int(np.argmax(np.abs(self._residuals)))

    @property
    def _residuals(self) -> FloatArray:
        return self.readings.lifts - self.law(self.readings.angles)

    @cached_property
    def peaks(self) -> tuple[float, float]:
        """Largest |s'| (m/rad) and |s''| (m/rad²)."""
        return abs(peak(self.law, 1).value), abs(peak(self.law, 2).value)

    def tables(self) -> list[Records]:
        """Return the tables of the spline, its dwells, the outliers and the valve events."""
        name, outliers = self.readings.name, "Readings that look like outliers"
        return [
            self.table("spline", f"{name}: spline", [self], single=True, transposed=True),
            self.table("dwells", "Dwells, exact in the law", self.dwells),
            self.table("outliers", outliers, self.readings.outliers),
            self.table("valve", self._valve_caption(), valve_events(self.law, self.valve_train)),
            self.table("fit", "The fit", [self], single=True, hidden=True),
        ]

    def _valve_caption(self) -> str:
        train = self.valve_train
        return (
            f"Valve events, rocker ratio {train.rocker_ratio:g}, lash {train.lash * 1e3:g} mm, "
            "angles of the cam"
        )

    def summary(self) -> list[str]:
        """Return the notes on the readings, then the conclusions."""
        return [*self.notes, *self.conclusions()]

    def conclusions(self) -> Iterator[str]:
        """Yield sentences on the result, the residuals first."""
        found, readings = self.smoothed, self.readings
        yield (
            f"The law is {found.rms * 1e3:.3g} mm r.m.s. and {found.largest * 1e3:.3g} mm at most "
            f"from {readings.angles.size} readings, with {found.knots} knots."
        )
        yield from warn_of_unusual_lift(self.law.lift)
        yield from explain_missing_events(self.law, self.valve_train)
        if self.widened:
            yield (
                f"The residual allowed is {self.tolerance * 1e3:.3g} mm, more than the readings' "
                "scatter: a spline nearer to them would need almost as many knots as there are "
                "readings. Read the cam finer, or check the readings farthest from the law."
            )
        elif self.asked is not None and not self.followed:
            yield (
                f"Not followed: {self.asked * 1e3:.3g} mm were asked, the readings scatter by "
                f"{self.scatter * 1e3:.3g} mm. A spline so near would follow their noise; allowed: "
                f"{min_tolerance(self.scatter, readings.angles.size) * 1e3:.3g} mm or more."
            )
        step = math.degrees(float(np.median(np.diff(readings.angles))))
        if step > WIDE_DEG:
            yield (
                f"Readings stand {step:.3g} deg apart: what the law does between them counts as "
                "scatter, and peaks of acceleration are rough."
            )
        yield (
            "A spline knows no jumps of acceleration between readings: for a cam of arcs take the "
            "shape arcs."
        )
        if not self.dwells:
            yield "No dwell is found: nowhere do enough readings rest within their scatter."
        sizes, top = self._suspects(), int(np.argmax(readings.lifts))
        if sizes[top] > FARTHEST and is_summit(readings, top):
            height = float(np.ptp(readings.lifts))
            yield (
                f"The nose, line {readings.lines[top]} ({math.degrees(readings.angles[top]):.6g} "
                "deg), is sharper than the readings stand apart: the spline rises by "
                f"{self.law.lift * 1e3:.4g} mm, the readings by {height * 1e3:.4g} mm. Read it "
                "finer there, or take the shape arcs."
            )
        else:  # near a sharp nose the spline oscillates, so good readings are far from it
            yield from farthest(readings, self._residuals, sizes)
        if readings.outliers or sizes.max() <= OUTLIER:
            yield left_out(readings)

    def _suspects(self) -> FloatArray:
        """Return the relative sizes of the residuals, shape ``(n,)``.

        The unit is the r.m.s. of the other residuals. If a reading is also contradicted by its
        neighbours, the unit is the scatter of the readings, if that gives a larger size. An outlier
        attracts the spline, which increases the residuals around it but not the scatter. A spline
        that is too smooth has large residuals at many good readings in a row, and their neighbours
        do not contradict them.
        """
        readings, residuals = self.readings, self._residuals
        bent, counts = differences(readings.angles, readings.lifts)
        contradicted = counts & (np.abs(bent) > CONTRADICTED * self.scatter)
        scatters = np.where(contradicted, np.abs(residuals) / self.scatter, 0.0)
        return np.maximum(scatters, beside_others(readings, residuals))


def fit_spline(readings: Readings, asked: float | None = None) -> SplineFit:
    """Fit a spline with exact dwells to readings in rising order of the angle.

    `asked` is the error of the gauge in m (default: the scatter of the readings). Outliers are left
    out. Raises ConfigError or LawError if no spline fits the readings.
    """
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
    kept = replace(kept, lifts=kept.lifts - zero)
    dwells = tuple(dwell.at_level(dwell.rest.level - zero) for dwell in dwells)
    how_near = scatter, asked, allowed, allowed > tolerance
    return SplineFit(kept, zero, *how_near, dwells, smoothed, _law(smoothed))


def _smoothed(readings: Readings, tolerance: float, rests: list[Rest]) -> tuple[float, Smoothed]:
    """Return the tolerance (m) and the spline.

    The tolerance is widened if no spline is within it.
    """
    most = MAX_TOLERANCE * float(np.ptp(readings.lifts))
    while True:
        try:
            return tolerance, smooth(readings.angles, readings.lifts, tolerance, rests)
        except LawError as error:
            if tolerance * WIDER > most:
                raise LawError(f"{readings.name}: {error}") from None
            tolerance *= WIDER


def _tolerance(readings: Readings, scatter: float, asked: float | None) -> float:
    """Return the tolerance (m): `asked`, or the scatter plus a margin.

    The scatter is also used instead of a given error that would make the spline follow the noise.
    """
    most = MAX_TOLERANCE * float(np.ptp(readings.lifts))
    if asked is not None and not 0.0 < asked <= most:
        raise ConfigError(
            f"--tolerance: is {asked * 1e3:g} mm; allowed: above 0, at most {most * 1e3:.4g} mm, "
            f"{MAX_TOLERANCE:g} of the lift"
        )
    if asked is not None and asked >= min_tolerance(scatter, readings.angles.size):
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
            f"of at most {MAX_GAP_DEG:g} deg, or a gap between two readings of one level"
        )


def _zero(law: Law, rests: list[Rest], near: float) -> float:
    """Return the zero (m): the level of the lowest dwell, or the lowest lift.

    The dwell is used if its level is less than `near` (m) above the lowest lift.
    """
    lowest = extremes(law, 0)[0].value
    level = min((rest.level for rest in rests), default=lowest)
    return level if level - lowest < near else lowest


def _require_same_lift(readings: Readings, law: Law, allowed: float) -> None:
    """Raise LawError if the lift of the spline is far from the lift of its readings."""
    height = float(np.ptp(readings.lifts))
    if abs(law.lift - height) > LIFT_RTOL * height + MAX_LIFT_TOLERANCES * allowed:
        raise LawError(
            f"{readings.name}: the spline rises by {law.lift * 1e3:.4g} mm, the readings by "
            f"{height * 1e3:.4g} mm; allowed: the same within {LIFT_RTOL:g} of it, so read finer "
            "where the cam is steep"
        )


def _law(smoothed: Smoothed) -> Law:
    breaks, columns = smoothed.pieces
    return Law("fitted", np.array(breaks), join_pieces(columns))
