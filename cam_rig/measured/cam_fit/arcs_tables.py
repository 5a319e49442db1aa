"""What the fit of tangent arcs found, as tables and as plain data."""

from __future__ import annotations

import math
from typing import Any

from cam_rig.measured.cam_fit.arcs import ANGLE, COORDINATES, ArcColumn
from cam_rig.measured.cam_fit.arcs_fit import ArcsFit
from cam_rig.measured.cam_fit.arcs_intervals import Told
from cam_rig.show.tables import DataTable, Head, tabulate
from cam_rig.units import rounded_to_error


def arcs_tables(fit: ArcsFit) -> list[DataTable]:
    """The numbers of the contour with their intervals, and the columns."""
    numbers = tabulate(
        "Tangent arcs: what the readings tell",
        COORDINATES,
        (
            (Head("number"), lambda i: fit.told[i].name),
            (Head("value"), lambda i: shown_value(fit.told[i], *unit_of(i))),
            (Head("with 95 %"), lambda i: shown_interval(fit.told[i], *unit_of(i)) or "-"),
            (Head("told"), lambda i: _how_well(fit.told[i], i)),
        ),
    )
    return [numbers, _column_table(fit)]


def unit_of(index: int) -> tuple[float, str]:
    """Factor from SI, and the unit, of a number."""
    return (math.degrees(1.0), "deg") if index == ANGLE else (1e3, "mm")


def shown_value(told: Told, factor: float, unit: str) -> str:
    """A number to the digits of its error, four of one that is hardly told."""
    if not math.isfinite(told.value):
        return "straight"
    if math.isfinite(told.error):
        return f"{rounded_to_error(factor * told.value, factor * told.error)} {unit}"
    return f"{factor * told.value:.{6 if told.held else 4}g} {unit}"


def shown_interval(told: Told, factor: float = 1e3, unit: str = "mm") -> str:
    """An interval in words, empty of a number that is held."""
    if told.held:
        return ""
    low, high = (_rounded(factor * end, factor * told.error) for end in (told.low, told.high))
    if told.over_straight:
        convex = f"{low} {unit} convex" if told.low > 0.0 and math.isfinite(told.low) else ""
        concave = f"{high.lstrip('-')} {unit} concave" if told.high < 0.0 else ""
        return f"{convex or 'any'} over straight to {concave or 'any'}"
    if not math.isfinite(told.high):
        return f"above {low} {unit}" if math.isfinite(told.low) else "any"
    return f"{low} to {high} {unit}" if math.isfinite(told.low) else f"below {high} {unit}"


def _rounded(value: float, error: float) -> str:
    return rounded_to_error(value, error) if math.isfinite(error) else f"{float(f'{value:.3g}'):g}"


def hardly_told(told: Told, index: int) -> bool:
    """Whether a number is as good as unknown; an angle may well be 0."""
    return told.poorly and (index != ANGLE or not math.isfinite(told.error))


def _how_well(told: Told, index: int) -> str:
    """A warning beside a number that the readings hardly tell."""
    if told.held:
        return told.held
    if told.over_straight or (not math.isfinite(told.value) and not told.held):
        return "straight within the readings"
    if not math.isfinite(told.error):
        return "not told"
    return "poorly" if hardly_told(told, index) else ""


def _column_table(fit: ArcsFit) -> DataTable:
    def at(column: ArcColumn) -> int:
        return int(abs(column.away).argmax())

    return tabulate(
        "Residuals of the readings from the arcs",
        fit.columns,
        (
            (Head("readings"), lambda column: column.readings.name),
            (Head("count", "", "d"), lambda column: column.away.size),
            (Head("follower"), lambda column: column.kind),
            (Head("read"), lambda column: "reversed" if column.reverse else "as turned"),
            (Head("r.m.s.", "mm", ".4f"), lambda column: column.rms * 1e3),
            (Head("largest", "mm", ".4f"), lambda column: abs(column.away).max() * 1e3),
            (
                Head("at", "deg", ".6g"),
                lambda column: math.degrees(column.readings.angles[at(column)]),
            ),
            (Head("in line", "", "d"), lambda column: int(column.readings.lines[at(column)])),
            (Head("outliers", "", "d"), lambda column: len(column.readings.outliers)),
        ),
    )


def arcs_json(fit: ArcsFit) -> dict[str, Any]:
    """All numbers of a contour of tangent arcs, m and rad; None for what is infinite or held."""

    def finite(value: float) -> float | None:
        return value if math.isfinite(value) else None

    return {
        "shape": "arcs",
        "base_radius_m": fit.arcs.base_radius,
        "lift_m": fit.arcs.lift,
        "flank": fit.arcs.flank,
        "flank_radius_m": fit.arcs.flank_radius,
        "nose_radius_m": fit.arcs.nose_radius,
        "nose_angle_rad": fit.arcs.nose_angle,
        "roller_radius_m": fit.roller_radius,
        "known": fit.known,
        "told": {
            told.name: {
                "value": finite(told.value),
                "low_95": None if told.held else finite(told.low),
                "high_95": None if told.held else finite(told.high),
                "standard_error": finite(told.error),
                "told": _how_well(told, i) or "well",
            }
            for i, told in enumerate(fit.told)
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
        "others": [{"columns": one.name, "rms_m": one.rms} for one in fit.others],
        "cannot_tell": list(fit.cannot_tell),
    }
