"""A factorial study as tables and as plain data."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from cam_rig.paper.anova import TwoWay
from cam_rig.paper.factorial.conclusions import (
    advantages,
    conclusions,
    contact_lost,
    fastest,
    governed_by,
    mean_jumps,
    staying,
)
from cam_rig.paper.factorial.study import EFFECTS, Design, Effect, Factorial, FactorialConfig
from cam_rig.show.tables import DataTable, Head, tabulate
from cam_rig.units import RPM_PER_RAD_S


def tables(found: Factorial, titles: Mapping[str, str] | None = None) -> list[DataTable]:
    """Every table; ``titles`` are what cams are called, where that is not their names."""
    return [
        *(variance_table(design, found.config) for design in found.designs),
        laws_table(found),
        advantage_table(found, titles),
        compressed_table(found),
    ]


def variance_table(design: Design, config: FactorialConfig) -> DataTable:
    """The analysis of variance of each effect, and again over what keeps contact."""
    rows: list[tuple[str, TwoWay, str, int | None]] = []
    for effect in EFFECTS:
        count = int(contact_lost(design, effect, config).sum())
        verdict = governed_by(design, effect)
        lost = count if effect.speeds else None
        rows.append((effect.name, design.analysis(effect), verdict, lost))
        stay = staying(design, effect, config)
        if count and stay is not None:
            size = f"… {len(stay.rises)} × {stay.angles.size} in contact"
            rows.append((size, stay.analysis(effect), governed_by(stay, effect), 0))
    a, b = len(design.rises), design.angles.size
    return tabulate(
        f"Analysis of variance, {design.name}: {a} laws × {b} angles",
        rows,
        (
            (Head("effect"), lambda row: row[0]),
            (Head("law", "%", ".1f"), lambda row: 100.0 * row[1].shares[0]),
            (
                Head("between classes", "%", ".1f"),
                lambda row: 100.0 * (row[1].classes / (row[1].total or 1.0)),
            ),
            (Head("angle", "%", ".1f"), lambda row: 100.0 * row[1].shares[1]),
            (Head("interaction", "%", ".1f"), lambda row: 100.0 * row[1].shares[2]),
            (Head("sum of squares", "dB²", ".1f"), lambda row: row[1].total),
            (Head("cells without contact", "", "d"), lambda row: row[3]),
            (Head("governed by"), lambda row: row[2]),
        ),
        f"Shares of the sum of squares. Degrees of freedom: {a - 1}, {b - 1}, {(a - 1) * (b - 1)}.",
        "Cells without contact: contact is lost below the effect's fastest speed, where the model "
        "holds the follower on. The row below has the laws and angles that all keep contact.",
    )


def laws_table(found: Factorial) -> DataTable:
    """The jump speed of each law in both designs."""
    same, alike = found.same_angles, found.same_acceleration
    rows = zip(same.rises, same.classes, mean_jumps(same), mean_jumps(alike), strict=True)
    return tabulate(
        "Jump speed by law, geometric mean over the angles",
        rows,
        (
            (Head("law"), lambda row: row[0]),
            (Head("continuity"), lambda row: f"C{row[1]}"),
            (Head(same.name, "rpm", ".0f"), lambda row: row[2]),
            (Head(alike.name, "rpm", ".0f"), lambda row: row[3]),
        ),
    )


def advantage_table(found: Factorial, titles: Mapping[str, str] | None = None) -> DataTable:
    """The proposed cam over each other, and how much of that a rigid follower has too."""
    called = titles or {}
    proposed = called.get(found.config.proposed, found.config.proposed)
    return tabulate(
        f"Advantage of {proposed}, and the part of it that comes from the slopes",
        advantages(found),
        (
            (Head("over"), lambda row: called.get(row.cam, row.cam)),
            (Head("jump speed", "%", "+.1f"), lambda row: 100.0 * math.expm1(row.jump)),
            (Head("from slopes", "%", ".0f"), lambda row: 100.0 * row.jump_share),
            (
                Head("peak acceleration", "%", "+.1f"),
                lambda row: 100.0 * math.expm1(-row.acceleration),
            ),
            (Head("from slopes", "%", ".0f"), lambda row: 100.0 * row.acceleration_share),
            (
                Head("residual vibration, divided by", "", ".1f"),
                lambda r: math.exp(r.residual),
            ),
            (Head("noise", "dB", "+.1f"), lambda row: -row.noise),
        ),
        "From slopes: what a rigid follower has too, in logarithms; the rest is vibration.",
        "Above 100 %: at its own, higher jump speed the cam excites more vibration.",
    )


def compressed_table(found: Factorial) -> DataTable:
    """The proposed cam with its whole turn in less than the turn."""
    return tabulate(
        f"{found.config.proposed} compressed, with a low dwell for the rest of the turn",
        sorted(found.squeezed.items(), reverse=True),
        (
            (Head("span", "°", ".4g"), lambda row: math.degrees(row[0])),
            (Head("jump speed", "rpm", ".1f"), lambda row: row[1].jump * RPM_PER_RAD_S),
            (
                Head("rigid follower", "rpm", ".1f"),
                lambda row: row[1].rigid_jump * RPM_PER_RAD_S,
            ),
            (Head("peak acceleration", "m/s²", ".1f"), lambda row: row[1].acceleration),
            (Head("residual vibration", "µm", ".2f"), lambda row: 1e6 * row[1].residual),
            (Head("noise", "dB", ".1f"), lambda row: row[1].noise),
        ),
    )


def to_json(found: Factorial) -> dict[str, Any]:
    """Everything measured and analysed, in the units of the tables, and the conclusions."""
    return {
        "conclusions": asdict(conclusions(found)),
        "designs": {design.name: _design(design, found.config) for design in found.designs},
        "cams": {cam: vars(measures) for cam, measures in found.cams.items()},
        "squeezed": {
            f"{math.degrees(span):.6g}": vars(measures) for span, measures in found.squeezed.items()
        },
        "advantage": {row.cam: vars(row) for row in advantages(found)},
    }


def _design(design: Design, config: FactorialConfig) -> dict[str, Any]:
    return {
        "laws": list(design.rises),
        "continuity": design.classes,
        "angle_deg": _degrees(design),
        "effects": {
            effect.key: _effect(design, effect)
            | {
                "cells_left": contact_lost(design, effect, config).tolist(),
                "left_below_rpm": _rpm(fastest(effect, config)),
                "in_contact": _in_contact(staying(design, effect, config), effect),
            }
            for effect in EFFECTS
        },
    }


def _degrees(design: Design) -> list[float]:
    return [round(math.degrees(angle), 9) for angle in design.angles.tolist()]


def _rpm(speed: float | None) -> float | None:
    return None if speed is None else round(speed * RPM_PER_RAD_S, 9)


def _in_contact(stay: Design | None, effect: Effect) -> dict[str, Any] | None:
    """The same effect over the laws and angles that keep contact; None for too few."""
    if stay is None or not effect.speeds:
        return None
    return {"laws": list(stay.rises), "angle_deg": _degrees(stay)} | _effect(stay, effect)


def _effect(design: Design, effect: Effect) -> dict[str, Any]:
    found = design.analysis(effect)
    law, angle, interaction = found.shares
    return {
        "unit": effect.unit,
        "values": effect.values(design.cells).tolist(),
        "shares": {"law": law, "angle": angle, "interaction": interaction},
        "between_classes": found.classes / (found.total or 1.0),
        "sums_of_squares": [found.rows, found.columns, found.interaction],
        "law_effects": found.row_effects.tolist(),
        "angle_effects": found.column_effects.tolist(),
        "effects_in": "dB (20 lg)" if effect.decibels else effect.unit,
    }
