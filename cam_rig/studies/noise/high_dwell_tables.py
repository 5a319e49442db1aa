"""The factorial of lift, high dwell and joints as tables and plain data."""

from __future__ import annotations

import math
from typing import Any

from cam_rig.studies.noise.high_dwell import FACTORS, HighDwellStudy, Variant
from cam_rig.tables import Column, DataTable, tabulate


def high_dwell_tables(study: HighDwellStudy | None, rpm: list[float]) -> list[DataTable]:
    """The cams and the shares; nothing where the study could not be made."""
    return [] if study is None else [_cams(study, rpm), _shares(study)]


def _cams(study: HighDwellStudy, rpm: list[float]) -> DataTable:
    reference, middle = study.reference, len(rpm) // 2
    differences = {cam: level - reference for cam, level in study.levels_db.items()}

    def lowest(cam: Variant) -> float:
        return float(differences[cam].min())

    def highest(cam: Variant) -> float:
        return float(differences[cam].max())

    return tabulate(
        "Lift, high dwell and joints: level of the reference cam changed in each",
        study.levels_db,
        (
            (Column("lift", "mm", ".2f"), lambda cam: 1e3 * cam.lift),
            (Column("high dwell", "°", ".1f"), lambda cam: math.degrees(cam.high_dwell)),
            (Column("rise"), lambda cam: cam.rise),
            *(
                (
                    Column(f"{rpm[i]:g} rpm", "dB", ".1f"),
                    lambda cam, i=i: float(study.levels_db[cam][i]),
                )
                for i in (0, middle, -1)
            ),
            (Column("change from", "dB", "+.1f"), lowest),
            (Column("to", "dB", "+.1f"), highest),
        ),
    )


def _shares(study: HighDwellStudy) -> DataTable:
    return tabulate(
        "Shares of the variation of the mean level",
        study.shares,
        (
            (Column("by"), lambda axes: " × ".join(FACTORS[axis] for axis in axes)),
            (Column("share", "%", ".1f"), lambda axes: 100.0 * study.shares[axes]),
        ),
        "Joints: with the reference's rise, or with one whose acceleration jumps at each dwell.",
    )


def high_dwell_json(study: HighDwellStudy | None) -> dict[str, Any] | None:
    """As plain data."""
    if study is None:
        return None
    return {
        "cams": [
            cam._asdict() | {"level_db": level.tolist()} for cam, level in study.levels_db.items()
        ],
        "shares": {
            " × ".join(FACTORS[i] for i in axes): share for axes, share in study.shares.items()
        },
    }
