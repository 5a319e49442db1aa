"""A factorial study as tables, as JSON, and in words."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from rich.box import SIMPLE
from rich.table import Table

from cam_rig.cli.console import console
from cam_rig.experiment.advantage import advantages
from cam_rig.experiment.answer import answer
from cam_rig.experiment.factorial import EFFECTS

if TYPE_CHECKING:
    from cam_rig.experiment.factorial import Design, Effect, Factorial


def show(found: Factorial) -> None:
    """Shares of variance by design, the advantage split, and the answer."""
    for design in designs(found):
        console.print(_shares(design))
    console.print(_split(found))
    for sentence in answer(found):
        console.print(f"- {sentence}", soft_wrap=False, markup=False)


def designs(found: Factorial) -> list[Design]:
    """Both designs, with all laws and with those of C2 and above."""
    both = (found.same_angles, found.same_acceleration)
    return [d for design in both for d in (design, design.from_class(2))]


def _shares(design: Design) -> Table:
    out = Table(title=f"Variance, {design.name}", box=SIMPLE, padding=(0, 1, 0, 0), pad_edge=False)
    out.add_column("effect", no_wrap=True)
    for head in ("law\n%", "between\nclasses %", "angle\n%", "inter-\naction %"):
        out.add_column(head, justify="right")
    for effect in EFFECTS:
        found = design.analysis(effect)
        law, angle, both = found.shares
        between = found.classes / (found.total or 1.0)
        out.add_row(effect.name, *(f"{100 * share:.1f}" for share in (law, between, angle, both)))
    return out


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
        "designs": {design.name: _design(design) for design in designs(found)},
        "cams": {cam: vars(measures) for cam, measures in found.cams.items()},
        "squeezed": {
            f"{math.degrees(span):.6g}": vars(measures) for span, measures in found.squeezed.items()
        },
        "advantage": {row.cam: vars(row) for row in advantages(found)},
    }


def _design(design: Design) -> dict[str, Any]:
    return {
        "laws": list(design.rises),
        "continuity": design.classes,
        "angle_deg": [round(math.degrees(angle), 9) for angle in design.angles.tolist()],
        "effects": {effect.key: _effect(design, effect) for effect in EFFECTS},
    }


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
