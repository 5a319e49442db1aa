"""What a fit found, as tables and as plain data."""

from __future__ import annotations

import math
from typing import Any

from cam_rig.studies.cam_fit.arcs_fit import NUMBERS, ArcColumn, ArcsFit
from cam_rig.studies.cam_fit.dwells import FoundDwell
from cam_rig.studies.cam_fit.readings import Outlier
from cam_rig.studies.cam_fit.spline_fit import SplineFit
from cam_rig.tables import Cell, Column, DataTable, tabulate

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
        ("distance allowed, r.m.s.", fit.tolerance * 1e3, "mm"),
        ("distance, r.m.s.", found.rms * 1e3, "mm"),
        ("distance, largest", found.largest * 1e3, "mm"),
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


def arcs_tables(fit: ArcsFit) -> list[DataTable]:
    """The numbers of the contour with their standard errors, and the columns."""

    def shown(i: int) -> tuple[float, float, str]:
        scale, unit = (math.degrees(1.0), "deg") if i == len(NUMBERS) - 1 else (1e3, "mm")
        return fit.numbers[i] * scale, fit.errors[i] * scale, unit

    def error(i: int) -> Cell:
        return shown(i)[1] if math.isfinite(shown(i)[1]) else None

    numbers = tabulate(
        "Tangent arcs: what the readings tell",
        range(len(NUMBERS)),
        (
            (Column("number"), lambda i: NUMBERS[i]),
            (Column("value", "", ".5g"), lambda i: shown(i)[0]),
            (Column("standard error", "", ".2g", "not told"), error),
            (Column("unit"), lambda i: shown(i)[2]),
        ),
    )
    return [numbers, _column_table(fit)]


def _column_table(fit: ArcsFit) -> DataTable:
    def at(column: ArcColumn) -> int:
        return int(abs(column.away).argmax())

    return tabulate(
        "Distance of the readings from the arcs",
        fit.columns,
        (
            (Column("readings"), lambda column: column.readings.name),
            (Column("count", "", "d"), lambda column: column.away.size),
            (Column("follower"), lambda column: column.kind),
            (Column("read"), lambda column: "reversed" if column.reverse else "as turned"),
            (Column("r.m.s.", "mm", ".4f"), lambda column: column.rms * 1e3),
            (Column("largest", "mm", ".4f"), lambda column: abs(column.away).max() * 1e3),
            (
                Column("at", "deg", ".6g"),
                lambda column: math.degrees(column.readings.angles[at(column)]),
            ),
            (Column("outliers", "", "d"), lambda column: len(column.readings.outliers)),
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
                "line": outlier.line,
                "angle_deg": math.degrees(outlier.angle),
                "off_m": outlier.beside,
            }
            for outlier in fit.readings.outliers
        ],
    }


def arcs_json(fit: ArcsFit) -> dict[str, Any]:
    """All numbers of a contour of tangent arcs, m and rad; None for what is not told."""

    def finite(value: float) -> float | None:
        return value if math.isfinite(value) else None

    return {
        "shape": "arcs",
        "base_radius_m": fit.arcs.base_radius,
        "lift_m": fit.arcs.lift,
        "flank_radius_m": fit.arcs.flank_radius,
        "nose_radius_m": fit.arcs.nose_radius,
        "nose_angle_rad": fit.arcs.nose_angle,
        "roller_radius_assumed_m": fit.roller_radius,
        "told": {
            name: {"value": finite(value), "standard_error": finite(error)}
            for name, value, error in zip(NUMBERS, fit.numbers, fit.errors, strict=True)
        },
        "rms_m": fit.rms,
        "columns": [
            {
                "readings": column.readings.name,
                "follower": column.kind,
                "reversed": column.reverse,
                "rms_m": column.rms,
                "largest_m": float(abs(column.away).max()),
            }
            for column in fit.columns
        ],
        "others": [{"columns": name, "rms_m": distance} for name, distance in fit.others],
        "cannot_tell": list(fit.cannot_tell),
    }
