"""Vibration as a table, as JSON, and what the paper says of it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from rich.box import SIMPLE
from rich.table import Table

from cam_rig.cli.common.console import console
from cam_rig.studies.vibration.claims import vibration_claims

if TYPE_CHECKING:
    from cam_rig.studies.cam_set import CamSet
    from cam_rig.studies.vibration.claims import Claim
    from cam_rig.studies.vibration.comparison import VibrationTable
    from cam_rig.studies.vibration.steady_state import Vibration


def show(table: VibrationTable, cam_set: CamSet) -> None:
    """A table for each speed, then the paper's words."""
    for rpm in table.rpm:
        title = f"{rpm:g} rpm on {cam_set.rig.name}, steady state"
        console.print(_one(table.at(rpm), title, table.left(rpm)))
    for claim in vibration_claims(table):
        console.print(f"{claim.words} ({claim.source}): {claim.told}", soft_wrap=True)
    if left_out := len(table.rpm) - len(table.in_contact):
        console.print(f"not asked at {left_out} of {len(table.rpm)} speeds: a cam is left there")


def _one(measures: dict[str, Vibration], title: str, left: list[str]) -> Table:
    """One row a cam; those of ``left`` are marked."""
    out = Table(title=title, box=SIMPLE, padding=(0, 1, 0, 0), pad_edge=False)
    out.add_column("cam", no_wrap=True)
    heads = ("ringing\nµm", "swing\nµm", "acceleration\nm/s²", "law's own\nm/s²", "twist\n°")
    for head in heads:
        out.add_column(head, justify="right", no_wrap=True)
    for cam, v in measures.items():
        out.add_row(
            cam + ("" if v.window.dwell else " *") + (" †" if cam in left else ""),
            f"{1e6 * v.ringing:.3g}",
            f"{1e6 * v.swing:.3g}",
            f"{v.acceleration:.1f}",
            f"{v.rigid_acceleration:.1f}",
            "" if v.twist is None else f"{math.degrees(v.twist):.4f}",
        )
    notes = []
    if not all(v.window.dwell for v in measures.values()):
        notes.append("* no low dwell: read within 31.25° of the lowest lift, where it moves")
    if left:
        notes.append("† has left the cam below this speed; the model holds it on")
    out.caption = "\n".join(notes)
    return out


def to_json(table: VibrationTable) -> dict[str, Any]:
    """The table as plain data, by cam, lists over the speeds; and the paper's words."""
    return {
        "rpm": list(table.rpm),
        "cams": {
            cam: {
                "low_dwell": row[0].window.dwell,
                "leaves_rpm": table.leaves[cam] if math.isfinite(table.leaves[cam]) else None,
                "left": [table.leaves[cam] < rpm for rpm in table.rpm],
                "ringing_m": [v.ringing for v in row],
                "swing_m": [v.swing for v in row],
                "acceleration": [v.acceleration for v in row],
                "rigid_acceleration": [v.rigid_acceleration for v in row],
                "twist_deg": [None if v.twist is None else math.degrees(v.twist) for v in row],
            }
            for cam, row in table.measures.items()
        },
        "claims": [_claim(claim) for claim in vibration_claims(table)],
    }


def _claim(claim: Claim) -> dict[str, Any]:
    otherwise = None if claim.otherwise is None else _claim(claim.otherwise)
    return vars(claim) | {"verdict": claim.verdict, "otherwise": otherwise}
