"""Stems of more and more masses as tables."""

from __future__ import annotations

import math
from collections.abc import Mapping

from cam_rig.studies.stem.comparison import StemRow, StemStudy
from cam_rig.tables import Column, DataTable, number, tabulate


def stem_tables(studies: list[StemStudy], titles: Mapping[str, str], cam: str) -> list[DataTable]:
    """One cam on each stem, and the jump speeds of all cams on each."""
    return [
        table
        for study in studies
        for table in (_over_masses(study, cam, titles[cam]), _jumps(study, titles))
    ]


def _over_masses(study: StemStudy, cam: str, title: str) -> DataTable:
    return tabulate(
        f"A stem of {number(study.stiffness, '.3g')} N/m in more and more masses, {title}",
        study.rows,
        (
            (Column("masses"), _masses),
            (Column("first natural frequency", "Hz", ".1f"), lambda row: row.frequency),
            (Column("off", "%", "+.2f"), lambda row: _off(row.frequency, study.bar.frequency)),
            (Column("jump speed", "rpm", ".1f"), lambda row: row.jump[cam]),
            (
                Column(f"residual vibration at {study.rpm:g} rpm", "µm", ".3g"),
                lambda row: 1e6 * row.vibration[cam],
            ),
            (Column("level", "dB", ".2f"), lambda row: row.level[cam]),
        ),
        f"Steady state. {study.stem_mass:.3g} kg of the follower are the stem's (assumed: the most "
        "that the mass split allows); total mass, stiffness and preload stay.",
    )


def _jumps(study: StemStudy, titles: Mapping[str, str]) -> DataTable:
    two, bar, matched = study.two_masses.jump, study.bar.jump, study.matched.jump
    return tabulate(
        f"Two masses and a bar: jump speeds on a stem of {number(study.stiffness, '.3g')} N/m",
        two,
        (
            (Column("law"), lambda cam: titles[cam]),
            (Column("two masses", "rpm", ".1f"), lambda cam: two[cam]),
            (Column("bar", "rpm", ".1f"), lambda cam: bar[cam]),
            (Column("two masses off", "%", "+.2f"), lambda cam: _off(two[cam], bar[cam])),
            (
                Column("force off from", "rpm", ".0f", missing="never"),
                lambda cam: study.off_from[cam],
            ),
            (Column("level off", "dB", ".2f"), lambda cam: study.level_off[cam]),
            (
                Column(f"bar of {number(study.matched_stiffness, '.3g')} N/m", "rpm", ".1f"),
                lambda cam: matched[cam],
            ),
        ),
        "Force off from: the least contact force misses the bar's by a tenth of the preload. "
        "Level off: at most, from 100 rpm to the jump.",
        "The last bar has the first natural frequency of the two masses.",
    )


def _masses(row: StemRow) -> str:
    return f"{row.elements + 1.0:g}" if math.isfinite(row.elements) else "bar"


def _off(value: float, limit: float) -> float:
    return 100.0 * (value / limit - 1.0)
