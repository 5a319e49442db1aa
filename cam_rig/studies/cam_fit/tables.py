"""What the fit of a spline found, as tables and as plain data."""

from __future__ import annotations

import math
from typing import Any

from cam_rig.studies.cam_fit.dwells import FoundDwell
from cam_rig.studies.cam_fit.readings import Outlier
from cam_rig.studies.cam_fit.spline_fit import SplineFit
from cam_rig.tables import Column, DataTable, tabulate

Row = tuple[str, float, str]


def spline_tables(fit: SplineFit) -> list[DataTable]:
    """How near the spline is to the readings, its dwells, and the readings left out."""
    tables = [
        tabulate(
            f"{fit.readings.name}: spline",
            _spline_rows(fit),
            (
                (Column(""), lambda row: row[0]),
                (Column("value", "", ".5g"), lambda row: row[1]),
                (Column("unit"), lambda row: row[2]),
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
            (Column("from", "deg", ".2f"), lambda dwell: math.degrees(dwell.rest.start)),
            (Column("span", "deg", ".2f"), lambda dwell: math.degrees(dwell.rest.span)),
            (Column("level", "mm", ".4f"), lambda dwell: dwell.rest.level * 1e3),
            (Column("readings", "", "d"), lambda dwell: dwell.count),
            (Column("their scatter", "mm", ".2g"), lambda dwell: dwell.scatter * 1e3),
        ),
    )


def _outlier_table(outliers: tuple[Outlier, ...]) -> DataTable:
    return tabulate(
        "Readings that look like outliers",
        outliers,
        (
            (Column("line", "", "d"), lambda outlier: outlier.line),
            (Column("at", "deg", ".6g"), lambda outlier: math.degrees(outlier.angle)),
            (Column("reading", "mm", ".6g"), lambda outlier: outlier.lift * 1e3),
            (Column("off its neighbours", "mm", ".3g"), lambda outlier: outlier.beside * 1e3),
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
