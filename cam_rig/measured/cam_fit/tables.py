"""What the fit of a spline found, as tables and as plain data."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from cam_rig.errors import ConfigError
from cam_rig.laws.spline import differences, least_tolerance
from cam_rig.measured.cam_fit.arcs import FLANK, PRIME
from cam_rig.measured.cam_fit.arcs_fit import ArcsFit
from cam_rig.measured.cam_fit.arcs_tables import hardly_told, shown_interval, unit_of
from cam_rig.measured.cam_fit.dwells import FoundDwell, likely_range
from cam_rig.measured.cam_fit.gauge import Outlier, Readings
from cam_rig.measured.cam_fit.spline_fit import SplineFit
from cam_rig.show.tables import DataTable, Head, tabulate
from cam_rig.units import FloatArray

Row = tuple[str, float, str]


def spline_tables(fit: SplineFit) -> list[DataTable]:
    """How near the spline is to the readings, its dwells, and the readings left out."""
    tables = [
        tabulate(
            f"{fit.readings.name}: spline",
            _spline_rows(fit),
            (
                (Head(""), lambda row: row[0]),
                (Head("value", "", ".5g"), lambda row: row[1]),
                (Head("unit"), lambda row: row[2]),
            ),
        )
    ]
    if fit.dwells:
        tables.append(_dwell_table(fit.dwells))
    if fit.readings.outliers:
        tables.append(_outlier_table(fit.readings.outliers))
    return tables


def _spline_rows(fit: SplineFit) -> list[Row]:
    found, readings, worst = fit.smoothed, fit.readings, fit.worst
    velocity, acceleration = fit.peaks
    return [
        ("readings used", readings.angles.size, ""),
        ("readings left out", len(readings.outliers), ""),
        ("scatter of the readings", fit.scatter * 1e3, "mm"),
        ("its standard error", fit.scatter * readings.scatter_error * 1e3, "mm"),
        ("residual allowed, r.m.s.", fit.tolerance * 1e3, "mm"),
        ("residual, r.m.s.", found.rms * 1e3, "mm"),
        ("residual, largest", found.largest * 1e3, "mm"),
        ("at", math.degrees(readings.angles[worst]), "deg"),
        ("in line", int(readings.lines[worst]), ""),
        ("knots", found.knots, ""),
        ("dwells", len(fit.dwells), ""),
        ("gauge at the lowest lift", fit.zero * 1e3, "mm"),
        ("lift", fit.law.lift * 1e3, "mm"),
        ("peak velocity", velocity * 1e3, "mm/rad"),
        ("peak acceleration", acceleration * 1e3, "mm/rad²"),
    ]


def _dwell_table(dwells: tuple[FoundDwell, ...]) -> DataTable:
    return tabulate(
        "Dwells, exact in the law",
        dwells,
        (
            (Head("from", "deg", ".2f"), lambda dwell: math.degrees(dwell.rest.start)),
            (Head("span", "deg", ".2f"), lambda dwell: math.degrees(dwell.rest.span)),
            (Head("level", "mm", ".4f"), lambda dwell: dwell.rest.level * 1e3),
            (Head("readings", "", "d"), lambda dwell: dwell.count),
            (Head("their scatter", "mm", ".2g"), lambda dwell: dwell.scatter * 1e3),
        ),
    )


def _outlier_table(outliers: tuple[Outlier, ...]) -> DataTable:
    return tabulate(
        "Readings that look like outliers",
        outliers,
        (
            (Head("line", "", "d"), lambda outlier: outlier.line),
            (Head("at", "deg", ".6g"), lambda outlier: math.degrees(outlier.angle)),
            (Head("reading", "mm", ".6g"), lambda outlier: outlier.lift * 1e3),
            (Head("off its neighbours", "mm", ".3g"), lambda outlier: outlier.beside * 1e3),
        ),
    )


def spline_json(fit: SplineFit) -> dict[str, Any]:
    """All numbers of a spline fit, SI; angles in degrees where the key says so."""
    velocity, acceleration = fit.peaks
    return {
        "shape": "spline",
        "readings": fit.readings.name,
        "count": fit.readings.angles.size,
        "scatter_m": fit.scatter,
        "asked_m": fit.asked,
        "tolerance_m": fit.tolerance,
        "followed": fit.followed,
        "rms_m": fit.smoothed.rms,
        "largest_m": fit.smoothed.largest,
        "knots": fit.smoothed.knots,
        "zero_m": fit.zero,
        "lift_m": fit.law.lift,
        "peak_velocity_m_per_rad": velocity,
        "peak_acceleration_m_per_rad2": acceleration,
        "dwells": [
            {
                "start_deg": math.degrees(dwell.rest.start),
                "span_deg": math.degrees(dwell.rest.span),
                "level_m": dwell.rest.level,
                "readings": dwell.count,
            }
            for dwell in fit.dwells
        ],
        "outliers": [
            {
                "line": one.line,
                "angle_deg": math.degrees(one.angle),
                "off_m": one.beside,
            }
            for one in fit.readings.outliers
        ],
    }


# What a fit found, in sentences: what was assumed, not followed, left out, or cannot be told.

#: Readings wider apart than this (deg) leave the law between them to the spline.
WIDE_DEG = 5.0

#: Residuals of more than so many scatters, or r.m.s. of the others, are named, the farthest so many
#: of them, ...
FARTHEST, MOST_NAMED = 3.0, 3

#: ... beside a spline where neighbours too contradict them by so many scatters.
CONTRADICTED = 2.5


def spline_conclusions(fit: SplineFit) -> Iterator[str]:
    """The answer first: how far the law is from the readings."""
    found, readings = fit.smoothed, fit.readings
    yield (
        f"The law is {found.rms * 1e3:.3g} mm r.m.s. and {found.largest * 1e3:.3g} mm at most from "
        f"{readings.angles.size} readings, with {found.knots} knots."
    )
    if fit.widened:
        yield (
            f"The residual allowed is {fit.tolerance * 1e3:.3g} mm, more than the readings' "
            "scatter: a spline nearer to them would need almost as many knots as there are "
            "readings, for the cam bends more sharply than they stand apart. Read it finer."
        )
    elif fit.asked is not None and not fit.followed:
        yield (
            f"Not followed: {fit.asked * 1e3:.3g} mm were asked, the readings scatter by "
            f"{fit.scatter * 1e3:.3g} mm. A spline so near would follow their noise; allowed: "
            f"{least_tolerance(fit.scatter, readings.angles.size) * 1e3:.3g} mm or more."
        )
    step = math.degrees(float(np.median(np.diff(readings.angles))))
    if step > WIDE_DEG:
        yield (
            f"Readings stand {step:.3g} deg apart: what the law does between them counts as "
            "scatter, and peaks of acceleration are rough."
        )
    yield (
        "A spline knows no jumps of acceleration between readings: for a cam of arcs take --shape "
        "arcs."
    )
    if not fit.dwells:
        yield "No dwell is found: nowhere do enough readings rest within their scatter."
    away = readings.lifts - fit.law(readings.angles)
    yield from _farthest(readings, away, _suspects(fit, away))
    yield _left_out(readings)


def _left_out(readings: Readings) -> str:
    """The outliers, or that there are none."""
    named = ", ".join(f"line {one.line} by {one.beside * 1e3:.3g} mm" for one in readings.outliers)
    return (
        f"Left out, for they look like outliers: {named}."
        if named
        else ("No reading looks like an outlier.")
    )


def _suspects(fit: SplineFit, residuals: FloatArray) -> FloatArray:
    """``(n,)`` sizes of residuals, in r.m.s. of all others, or in scatters if that is more.

    The scatter is that of the readings alone: one that is off raises the spline's r.m.s. around it.
    It measures only those that their neighbours contradict: a spline that is too smooth somewhere
    is off whole rows of good readings.
    """
    readings = fit.readings
    bent, counts = differences(readings.angles, readings.lifts)
    contradicted = counts & (np.abs(bent) > CONTRADICTED * fit.scatter)
    scatters = np.where(contradicted, np.abs(residuals) / fit.scatter, 0.0)
    return np.maximum(scatters, _beside_others(readings, residuals))


def _beside_others(readings: Readings, residuals: FloatArray) -> FloatArray:
    """``(n,)`` sizes of residuals, in r.m.s. of all others."""
    others = (np.sum(residuals**2) - residuals**2) / (residuals.size - 1)
    return np.abs(residuals) / np.maximum(np.sqrt(others), readings.rounding)


def _farthest(readings: Readings, residuals: FloatArray, sizes: FloatArray) -> Iterator[str]:
    """The readings that are far from the law, by their lines; ``sizes`` in scatters."""
    likely = max(FARTHEST, 0.5 * likely_range(sizes.size))  # of many, one is so far by chance
    far = [i for i in np.argsort(-sizes)[:MOST_NAMED] if sizes[i] > likely]
    named = ", ".join(
        f"line {readings.lines[i]} ({math.degrees(readings.angles[i]):.6g} deg) by "
        f"{residuals[i] * 1e3:+.3g} mm, {sizes[i]:.2g} times the others' scatter"
        for i in far
    )
    if named:
        yield f"{readings.name}: farthest from the law {named}: look at them again."


def arcs_conclusions(fit: ArcsFit) -> Iterator[str]:
    """Which column is which, in which sense it was read, and what cannot be told."""
    free = fit.best.x.size
    readings = sum(column.away.size for column in fit.columns)
    yield f"{free} numbers of tangent arcs: {fit.rms * 1e3:.3g} mm r.m.s. from {readings} readings."
    yield from _flanks(fit)
    yield from _poorly(fit)
    flat = [column.readings.name for column in fit.columns if column.kind == "flat"]
    if flat and len(flat) < len(fit.columns):
        yield f"The flat follower's readings are {' and '.join(flat)}."
    reverse = [column.readings.name for column in fit.columns if column.reverse]
    if reverse:
        apart = abs(math.degrees(2.0 * fit.arcs.nose_angle) + 180.0) % 360.0 - 180.0
        yield (
            f"{' and '.join(reverse)} fits as read in the other turning sense, or from a zero "
            f"{abs(apart):.2g} deg apart."
        )
    for column in fit.columns:
        sizes = _beside_others(column.readings, column.away)
        yield from _farthest(column.readings, -column.away, sizes)
        if column.readings.outliers:
            yield f"{column.readings.name}: {_left_out(column.readings)}"
    if fit.others and fit.as_near(fit.others[0]):
        near = fit.others[0]
        yield f"As near, and not told apart: {near.name}, {near.rms * 1e3:.3g} mm r.m.s."
    elif fit.others:
        best = fit.others[0]
        yield f"The next best reading of the columns is {best.name}: {best.rms * 1e3:.3g} mm r.m.s."
    yield from fit.cannot_tell


def _flanks(fit: ArcsFit) -> Iterator[str]:
    """That flanks were taken as straight, and what is told if they are."""
    flank, straight = fit.told[FLANK], fit.arcs.flank_radius is None
    if fit.flank == "straight":
        yield "Flanks are straight as asked: a tangent cam."
    elif straight:
        yield (
            f"Flanks are straight within the readings, `flank: straight`, a tangent cam: taken, "
            f"for {fit.rms * 1e3:.3g} mm r.m.s. are left and {fit.curved.rms * 1e3:.3g} mm of the "
            f"best curved ones. With 95 % {flank.name} is {shown_interval(flank)}."
        )
        if fit.prime_if_straight is not None:
            yield (
                f"If you know that they are straight, --flank straight: {fit.told[PRIME].name} is "
                f"then {shown_interval(fit.prime_if_straight)} with 95 %."
            )
    elif flank.over_straight:
        yield "Flanks are straight within the readings too: without --flank curved they are taken."


def _poorly(fit: ArcsFit) -> Iterator[str]:
    """Which numbers hardly mean anything."""
    free = fit.without_radii
    if free is not None and free.away(fit.best.squares) > free.line(PRIME).limit:
        low, high = free.interval(PRIME)
        yield (
            f"Warning: the readings contradict the radii given: {free.rms * 1e3:.3g} mm r.m.s. are "
            f"left without them, and base and roller radius together are then {low * 1e3:.3g} to "
            f"{high * 1e3:.3g} mm with 95 %."
        )
    poor = [
        f"{told.name} {shown_interval(told, *unit_of(i))}"
        for i, told in enumerate(fit.told)
        if i != FLANK and hardly_told(told, i)
    ]
    if poor:
        named = ", ".join(poor)
        yield f"Warning: the readings hardly tell {named} (95 %)."


def require_told(fit: ArcsFit, named: bool) -> None:
    """Refuse to write what no reading tells and nobody has given.

    Parameters
    ----------
    named : whether the kinds of followers are given
    """
    unclear = fit.unclear_kinds
    if unclear is not None and not named:
        found, several = fit.best.search.named(), len(fit.columns) > 1
        raise ConfigError(
            f"the readings do not tell the follower: {found} leaves {fit.rms * 1e3:.3g} mm r.m.s., "
            f"{unclear.name} {unclear.rms * 1e3:.3g} mm; allowed: --follower roller, flat or point"
            f"{', once for each column' if several else ''}"
        )
    if not fit.base_is_told:
        prime = fit.told[PRIME]
        rolling = " and --roller-radius" if fit.roller_radius else ""
        raise ConfigError(
            f"lifts alone do not tell the base radius: {prime.name} is {shown_interval(prime)} "
            f"with 95 %; allowed: --base-radius{rolling}, or readings of a flat follower too"
        )
