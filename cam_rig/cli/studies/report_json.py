"""A report's results as plain data, each part as its own command writes it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from cam_rig.cli.studies import factorial_tables, jump_tables, noise_json, vibration_tables

if TYPE_CHECKING:
    from cam_rig.report.results import Findings


def to_json(results: Findings) -> dict[str, Any]:
    """Every part by the name of its command."""
    return {
        "jump": jump_tables.to_json(results.jumps),
        "vibration": vibration_tables.to_json(results.vibration),
        "noise": noise_json.to_json(results.noise),
        "factorial": factorial_tables.to_json(results.factorial),
    }
