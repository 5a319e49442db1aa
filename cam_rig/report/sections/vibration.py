"""Residual and torsional vibration: figs. 4-6 and 9, and what the paper says of them."""

from __future__ import annotations

import math

from cam_rig.report.blocks import Block, Grid, Picture, Section, Words
from cam_rig.report.figures import STEADY_RPM
from cam_rig.report.results import Findings
from cam_rig.report.words import number
from cam_rig.studies.vibration.claims import PROPOSED, Claim, jump_claims, vibration_claims
from cam_rig.studies.vibration.comparison import VibrationTable
from cam_rig.studies.vibration.dwell import STAND_IN


def section(results: Findings) -> Section:
    """One table for each stem, then the paper's claims."""
    elastic, stiff = results.sources.cam_set.rig, results.sources.stiff
    blocks: list[Block] = [
        Words(
            "Eq. 5 and eq. 10 in steady state: periodic states by one linear solve (residual) and "
            "by Newton's method on a turn (torsional), not by waiting. Ringing is free vibration, "
            "what the joints of a law have kicked; in a dwell it is all there is, and the swing is "
            "twice the ringing. Bézier 15 has no low dwell: it is read within 31.25° of θ = 0, as "
            f"wide as the others' dwell. It moves there by {100.0 * _moves(results):.1f} % of its "
            "lift, and its swing is the stem's give under that motion."
        ),
        Picture(
            "fig4",
            f"Figs. 4, 5, 6 and 9 at {STEADY_RPM:g} rpm. The paper does not print its speed. Grey: "
            "the low dwell of the four laws that have one.",
        ),
        _table(results.vibration, f"Vibration at {STEADY_RPM:g} rpm, {elastic.title}", results),
        _table(results.stiff_vibration, f"Vibration at {STEADY_RPM:g} rpm, {stiff.title}", results),
        _claims(results),
    ]
    return Section("vibration", "Residual and torsional vibration", tuple(blocks))


def _moves(results: Findings) -> float:
    """Lift of Bézier 15 at the edge of the stand-in for its low dwell, as a fraction."""
    law = results.sources.cam_set.laws[PROPOSED]
    return float(law(0.5 * STAND_IN)) / results.sources.cam_set.cams[PROPOSED].lift.si


def _table(table: VibrationTable, caption: str, results: Findings) -> Grid:
    titles, rows = results.sources.cam_set.titles, []
    left = table.left(STEADY_RPM)
    for cam, v in table.at(STEADY_RPM).items():
        twist = "" if v.twist is None else f"{math.degrees(v.twist):.4f}"
        rows.append(
            (
                titles[cam] + ("" if v.window.dwell else " *") + (" †" if cam in left else ""),
                _small(1e6 * v.ringing),
                _small(1e6 * v.swing),
                f"{v.acceleration:.1f}",
                f"{v.rigid_acceleration:.1f}",
                twist,
            )
        )
    head = ("law", "ringing [µm]", "swing [µm]", "peak ẍ [m/s²]", "law's own [m/s²]", "twist [°]")
    note = "* no low dwell."
    if left:
        note += " † has left the cam below this speed; the model holds it on."
    if not rows[0][-1]:
        note += " This rig has no shaft."
    return Grid(caption, head, tuple(rows), note=note)


def _small(value: float) -> str:
    return number(value, 3 if value >= 1e-3 else 2)


def _claims(results: Findings) -> Grid:
    stiff = vibration_claims(results.stiff_vibration)
    by_words = {claim.words: claim for claim in stiff}
    rows = [
        (claim.words, claim.source, _verdict(claim), _verdict(by_words.get(claim.words)))
        for claim in (*vibration_claims(results.vibration), *jump_claims(results.jumps))
    ]
    rpm = ", ".join(f"{speed:g}" for speed in results.vibration.rpm)
    return Grid(
        "What the paper says, tried",
        (
            "claim",
            "where",
            f"rig {results.sources.cam_set.rig.name}",
            f"rig {results.sources.stiff.name}",
        ),
        tuple(rows),
        left=4,
        note=f"Vibration at {rpm} rpm, those among them at which no cam is left. The paper does "
        "not say how residual vibration is measured: ringing is what joints have kicked, swing "
        "all that moves.",
    )


def _verdict(claim: Claim | None) -> str:
    if claim is None:
        return "not asked"
    return claim.told
