"""Speed fluctuation and twist over the flywheel's inertia, as tables."""

from __future__ import annotations

import math
from collections.abc import Mapping

from cam_rig.studies.flywheel.fluctuation import SHOWN, FlywheelStudy
from cam_rig.tables import Column, DataTable, tabulate


def flywheel_tables(
    study: FlywheelStudy | None, titles: Mapping[str, str], cam: str
) -> list[DataTable]:
    """One cam over the inertia, and all cams behind one flywheel; nothing without a shaft."""
    if study is None:
        return []
    return [_over_inertia(study, cam, titles[cam]), _over_cams(study, titles)]


def _over_inertia(study: FlywheelStudy, cam: str, title: str) -> DataTable:
    return tabulate(
        f"Fluctuation of the speed over the flywheel's inertia, {title}, {study.rpm:g} rpm",
        study.turns[cam],
        (
            (Column("inertia of the flywheel", "kg·m²"), lambda row: _inertia(row.inertia)),
            (Column("flywheel", "%", ".2f"), lambda row: 100.0 * row.fluctuation),
            (Column("by ΔE/(Iω²)", "%", ".2f"), lambda row: 100.0 * row.formula),
            (Column("cam", "%", ".2f"), lambda row: 100.0 * row.cam_fluctuation),
            (Column("twist", "°", ".4f"), lambda row: math.degrees(row.twist)),
            (Column("motor torque", "N·m", ".4f"), lambda row: row.torque),
        ),
        "Fluctuation: (fastest − slowest)/mean speed. The last row is eq. 10 of the paper.",
        "ΔE/(Iω²): the handbook's formula, shaft rigid, I of flywheel and cam.",
    )


def _over_cams(study: FlywheelStudy, titles: Mapping[str, str]) -> DataTable:
    def held(cam: str) -> float:
        return math.degrees(study.at(cam, math.inf).twist)

    return tabulate(
        f"All laws behind a flywheel of {SHOWN:g} kg·m² (assumed), {study.rpm:g} rpm",
        study.turns,
        (
            (Column("law"), lambda cam: titles[cam]),
            (Column("flywheel", "%", ".2f"), lambda cam: 100.0 * study.at(cam, SHOWN).fluctuation),
            (Column("twist", "°", ".4f"), lambda cam: math.degrees(study.at(cam, SHOWN).twist)),
            (Column("twist at held speed", "°", ".4f"), held),
            (
                Column("the same without preload", "°", ".4f"),
                lambda cam: math.degrees(study.without_preload[cam]),
            ),
        ),
        "Held speed without preload is eq. 10 as it is printed; the rig adds its preload to it.",
    )


def _inertia(value: float) -> str:
    return f"{value:g}" if math.isfinite(value) else "∞"
