"""A factorial study as tables, as JSON, and in words."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from rich.box import SIMPLE
from rich.table import Table

from cam_rig.cli.common.console import console
from cam_rig.studies.factorial.conclusions import answer
from cam_rig.studies.factorial.decomposition import advantages
from cam_rig.studies.factorial.design import EFFECTS
from cam_rig.studies.factorial.in_contact import fastest, left, staying
from cam_rig.units import RPM_PER_RAD_S

if TYPE_CHECKING:
    from cam_rig.schema import FactorialConfig
    from cam_rig.studies.factorial.design import Design, Effect, Factorial


def show(found: Factorial) -> None:
    """Shares of variance by design, the advantage split, and the answer."""
    for design in found.designs:
        console.print(_shares(design, found.config))
    console.print(_split(found))
    for sentence in answer(found):
        console.print(f"- {sentence}", soft_wrap=False, markup=False)


def _shares(design: Design, config: FactorialConfig) -> Table:
    out = Table(title=f"Variance, {design.name}", box=SIMPLE, padding=(0, 1, 0, 0), pad_edge=False)
    out.add_column("effect", no_wrap=True)
    for head in ("law\n%", "between\nclasses %", "angle\n%", "inter-\naction %", "cells\nleft"):
        out.add_column(head, justify="right")
    for effect in EFFECTS:
        gone = int(left(design, effect, config).sum())
        out.add_row(effect.name, *_parts(design, effect), str(gone) if effect.speeds else "")
        stay = staying(design, effect, config)
        if gone and stay is not None:
            size = f"{len(stay.rises)} × {stay.angles.size}"
            out.add_row(f"  {size} that stay", *_parts(stay, effect), "0")
    out.caption = (
        "cells left: the follower leaves the cam below the fastest speed of the effect, where the "
        "model holds it on; below, the laws × angles that all stay"
    )
    return out


def _parts(design: Design, effect: Effect) -> list[str]:
    found = design.analysis(effect)
    law, angle, both = found.shares
    between = found.classes / (found.total or 1.0)
    return [f"{100 * share:.1f}" for share in (law, between, angle, both)]


def _split(found: Factorial) -> Table:
    out = Table(
        title=f"Advantage of {found.config.proposed}, and the share of its slopes in it",
        box=SIMPLE,
        padding=(0, 1, 0, 0),
        pad_edge=False,
    )
    out.add_column("over", no_wrap=True)
    for head in ("jump\nspeed", "slopes'\nshare", "acceler-\nation", "slopes'\nshare", "noise\ndB"):
        out.add_column(head, justify="right")
    for row in advantages(found):
        out.add_row(
            row.cam,
            f"{100 * math.expm1(row.jump):+.0f} %",
            f"{100 * row.jump_share:.0f} %",
            f"{100 * math.expm1(-row.acceleration):+.0f} %",
            f"{100 * row.acceleration_share:.0f} %",
            f"{-row.noise:+.1f}",
        )
    return out


def to_json(found: Factorial) -> dict[str, Any]:
    """Everything measured and analysed, in the units of the tables, and the answer."""
    return {
        "answer": answer(found),
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
        "angle_deg": [round(math.degrees(angle), 9) for angle in design.angles.tolist()],
        "effects": {
            effect.key: _effect(design, effect)
            | {
                "cells_left": left(design, effect, config).tolist(),
                "left_below_rpm": _rpm(fastest(effect, config)),
                "in_contact": _in_contact(staying(design, effect, config), effect),
            }
            for effect in EFFECTS
        },
    }


def _rpm(speed: float | None) -> float | None:
    return None if speed is None else round(speed * RPM_PER_RAD_S, 9)


def _in_contact(stay: Design | None, effect: Effect) -> dict[str, Any] | None:
    """The same effect over the laws and angles that stay on the cam; None for too few."""
    if stay is None or not effect.speeds:
        return None
    angles = [round(math.degrees(angle), 9) for angle in stay.angles.tolist()]
    return {"laws": list(stay.rises), "angle_deg": angles} | _effect(stay, effect)


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
