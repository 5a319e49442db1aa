"""Vibration of cams, and the paper's claims of it: as tables and as plain data."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from cam_rig.studies.vibration.claims import Claim, vibration_claims
from cam_rig.studies.vibration.comparison import VibrationTable
from cam_rig.tables import Column, DataTable, tabulate


def speed_table(
    table: VibrationTable, rpm: float, rig: str, titles: Mapping[str, str] | None = None
) -> DataTable:
    """One speed, one row per cam; ``titles`` are what cams are called, where not by name."""
    called, lost, measures = titles or {}, table.lost_contact(rpm), table.at(rpm)
    moving = [cam for cam, v in measures.items() if not v.window.dwell]

    def marked(cam: str) -> str:
        marks = (" *" if cam in moving else "") + (" †" if cam in lost else "")
        return called.get(cam, cam) + marks

    return tabulate(
        f"Steady-state vibration at {rpm:g} rpm, {rig}",
        measures.items(),
        (
            (Column("cam"), lambda row: marked(row[0])),
            (
                Column("residual amplitude", "µm", ".3g"),
                lambda row: 1e6 * row[1].residual_amplitude,
            ),
            (Column("peak to peak", "µm", ".3g"), lambda row: 1e6 * row[1].peak_to_peak),
            (Column("peak acceleration", "m/s²", ".1f"), lambda row: row[1].acceleration),
            (Column("of the law", "m/s²", ".1f"), lambda row: row[1].rigid_acceleration),
            (
                Column("twist", "°", ".4f"),
                lambda row: None if row[1].twist is None else math.degrees(row[1].twist),
            ),
            (Column("flywheel", "%", ".2f"), lambda row: _percent(row[1].fluctuation)),
        ),
        "* No low dwell: read within 31.25° of the lowest lift, where the follower still moves."
        if moving
        else "",
        "† Contact is lost below this speed; the model holds the follower on." if lost else "",
        "Flywheel: (fastest − slowest)/mean speed, driven by a constant torque."
        if any(v.fluctuation is not None for v in measures.values())
        else "",
    )


def _percent(share: float | None) -> float | None:
    return None if share is None else 100.0 * share


def claims_table(by_rig: Mapping[str, list[Claim]], rpm: tuple[float, ...]) -> DataTable:
    """The claims of the first rig, one row for each measure, and each rig's verdict."""
    verdicts = {
        rig: {(c.words, c.measure): _verdict(c) for c in _each(claims)}
        for rig, claims in by_rig.items()
    }
    speeds = ", ".join(f"{speed:g}" for speed in rpm)
    return tabulate(
        "The paper's claims, tested",
        _each(next(iter(by_rig.values()), [])),
        (
            (Column("claim"), lambda claim: claim.words),
            (Column("in the paper"), lambda claim: claim.source),
            (Column("measured by"), lambda claim: claim.measure),
            *(
                (
                    Column(rig, missing="not tested"),
                    lambda claim, known=known: known.get((claim.words, claim.measure)),
                )
                for rig, known in verdicts.items()
            ),
        ),
        f"Cases: those of {speeds} rpm at which every follower keeps contact.",
        "The paper does not say how residual vibration is measured.",
    )


def _each(claims: list[Claim]) -> list[Claim]:
    """Every claim, and after it the same by the other measure."""
    return [c for claim in claims for c in (claim, claim.otherwise) if c is not None]


def _verdict(claim: Claim) -> str:
    cases = f", {claim.holds} of {claim.cases}" if claim.cases > 1 else ""
    return f"{claim.verdict}{cases}"


def to_json(table: VibrationTable) -> dict[str, Any]:
    """The measures as plain data, by cam, lists over the speeds; and the claims."""
    return {
        "rpm": list(table.rpm),
        "cams": {
            cam: {
                "low_dwell": row[0].window.dwell,
                "contact_lost_rpm": table.contact_lost_rpm[cam]
                if math.isfinite(table.contact_lost_rpm[cam])
                else None,
                "contact_lost": [table.contact_lost_rpm[cam] < rpm for rpm in table.rpm],
                "residual_amplitude_m": [v.residual_amplitude for v in row],
                "peak_to_peak_m": [v.peak_to_peak for v in row],
                "acceleration": [v.acceleration for v in row],
                "rigid_acceleration": [v.rigid_acceleration for v in row],
                "twist_deg": [None if v.twist is None else math.degrees(v.twist) for v in row],
                "fluctuation": [v.fluctuation for v in row],
            }
            for cam, row in table.measures.items()
        },
        "claims": [_claim(claim) for claim in vibration_claims(table)],
    }


def _claim(claim: Claim) -> dict[str, Any]:
    otherwise = None if claim.otherwise is None else _claim(claim.otherwise)
    return vars(claim) | {"verdict": claim.verdict, "otherwise": otherwise}
