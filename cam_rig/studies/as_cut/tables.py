"""Cams as they were cut: as tables and as plain data."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from cam_rig.studies.as_cut.comparison import AsCut
from cam_rig.tables import Column, DataTable, number, tabulate
from cam_rig.units import RPM


def cams_table(found: Mapping[str, AsCut], titles: Mapping[str, str]) -> DataTable:
    """One row for each cam, at its own radii."""
    errors = max((float(row.error[0]) for row in found.values()), default=0.0)
    return tabulate(
        "A roller on the contour that a polar plot of s + R_b gives",
        found.items(),
        (
            (Column("cam"), lambda row: titles.get(row[0], row[0])),
            (Column("roller above s by", "mm", ".3f"), lambda row: 1e3 * row[1].too_high.value),
            (Column("smallest s″", "mm/rad²", ".2f"), lambda row: 1e3 * row[1].deceleration[0]),
            (Column("of the roller", "mm/rad²", ".2f"), lambda row: 1e3 * row[1].deceleration[1]),
            (Column("jump speed of s", "rpm", ".2f"), lambda row: row[1].drawn.jump / RPM),
            (Column("as cut", "rpm", ".2f"), lambda row: row[1].cut.jump / RPM),
            (Column("level changes from", "dB", "+.3f"), lambda row: row[1].level_change.min()),
            (Column("to", "dB", "+.3f"), lambda row: row[1].level_change.max()),
            (
                Column("s lands from", "rpm", ".0f", "–"),
                lambda row: _rpm(row[1].drawn.lands_from),
            ),
            (Column("as cut", "rpm", ".0f", "–"), lambda row: _rpm(row[1].cut.lands_from)),
        ),
        *_radii(found.values()),
        "Jump speeds are those of two masses, from rest; levels and landings those of the scene's "
        "own rig.",
        f"The roller's law is fitted to its closed form within {number(errors, '.0e')} m.",
    )


def sizes_table(found: Iterable[AsCut], title: str) -> DataTable:
    """One cam over base and roller radius."""
    rows = list(found)
    law = f" (s itself: {rows[0].drawn.jump / RPM:.2f} rpm)" if rows else ""
    return tabulate(
        f"{title} as cut, over base and roller radius{law}",
        rows,
        (
            (Column("base radius", "mm", "g"), lambda row: 1e3 * row.base_radius),
            (Column("roller radius", "mm", "g"), lambda row: 1e3 * row.roller),
            (Column("roller above s by", "mm", ".3f"), lambda row: 1e3 * row.too_high.value),
            (Column("smallest s″", "mm/rad²", ".2f"), lambda row: 1e3 * row.deceleration[1]),
            (Column("jump speed", "rpm", ".2f"), lambda row: row.cut.jump / RPM),
            (Column("level changes from", "dB", "+.3f"), lambda row: row.level_change.min()),
            (Column("to", "dB", "+.3f"), lambda row: row.level_change.max()),
        ),
    )


def _rpm(speed: float | None) -> float | None:
    return None if speed is None else speed / RPM


def _radii(found: Iterable[AsCut]) -> list[str]:
    """A note on the radii, where all cams have the same."""
    radii = {(row.base_radius, row.roller) for row in found}
    if len(radii) != 1:
        return []
    base, roller = radii.pop()
    return [f"Base radius {1e3 * base:g} mm, roller radius {1e3 * roller:g} mm."]


def to_json(found: Mapping[str, AsCut]) -> dict[str, Any]:
    """As plain data, by cam."""
    return {cam: _plain(row) for cam, row in found.items()}


def _plain(row: AsCut) -> dict[str, Any]:
    return {
        "base_radius_m": row.base_radius,
        "roller_radius_m": row.roller,
        "above_law_m": row.too_high.value,
        "above_law_at_deg": math.degrees(row.too_high.angle),
        "smallest_acceleration_m_per_rad2": list(row.deceleration),
        "jump_rpm": [row.drawn.jump / RPM, row.cut.jump / RPM],
        "lands_from_rpm": [_rpm(row.drawn.lands_from), _rpm(row.cut.lands_from)],
        "level_change_db": row.level_change.tolist(),
        "fit_error": row.error.tolist(),
    }
