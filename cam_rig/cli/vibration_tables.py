"""Vibration as a table, as JSON, and what the paper says of it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from rich.box import SIMPLE
from rich.table import Table

from cam_rig.cli.console import console
from cam_rig.experiment.vibration_table import vibration_claims

if TYPE_CHECKING:
    from cam_rig.experiment.lineup import Lineup
    from cam_rig.experiment.vibration import Vibration
    from cam_rig.experiment.vibration_table import VibrationTable


def show(table: VibrationTable, lineup: Lineup) -> None:
    """A table for each speed, then the paper's words."""
    for rpm in table.rpm:
        console.print(_one(table.at(rpm), f"{rpm:g} rpm on {lineup.rig.name}, steady state"))
    for claim in vibration_claims(table):
        said = f"{claim.words} ({claim.source}): {claim.verdict}"
        console.print(f"{said}, {claim.holds} of {claim.cases} speeds", soft_wrap=True)


def _one(measures: dict[str, Vibration], title: str) -> Table:
    out = Table(title=title, box=SIMPLE, padding=(0, 1, 0, 0), pad_edge=False)
    out.add_column("cam", no_wrap=True)
    heads = ("ringing\nµm", "swing\nµm", "acceleration\nm/s²", "law's own\nm/s²", "twist\n°")
    for head in heads:
        out.add_column(head, justify="right", no_wrap=True)
    for cam, v in measures.items():
        out.add_row(
            cam if v.window.dwell else f"{cam} *",
            f"{1e6 * v.ringing:.3g}",
            f"{1e6 * v.swing:.3g}",
            f"{v.acceleration:.1f}",
            f"{v.rigid_acceleration:.1f}",
            "" if v.twist is None else f"{math.degrees(v.twist):.4f}",
        )
    if not all(v.window.dwell for v in measures.values()):
        out.caption = "* no low dwell: read within 31.25° of θ = 0, where it moves"
    return out


def to_json(table: VibrationTable) -> dict[str, Any]:
    """The table as plain data, by cam, lists over the speeds; and the paper's words."""
    return {
        "rpm": list(table.rpm),
        "cams": {
            cam: {
                "low_dwell": row[0].window.dwell,
                "ringing_m": [v.ringing for v in row],
                "swing_m": [v.swing for v in row],
                "acceleration": [v.acceleration for v in row],
                "rigid_acceleration": [v.rigid_acceleration for v in row],
                "twist_deg": [None if v.twist is None else math.degrees(v.twist) for v in row],
            }
            for cam, row in table.measures.items()
        },
        "claims": [vars(claim) | {"verdict": claim.verdict} for claim in vibration_claims(table)],
    }
