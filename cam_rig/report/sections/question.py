"""The question the paper leaves open: continuity, or gentler slopes."""

from __future__ import annotations

import math

from cam_rig.report.blocks import Grid, Picture, Points, Section, Words
from cam_rig.report.figures import STEADY_RPM
from cam_rig.report.results import Findings
from cam_rig.report.words import number
from cam_rig.schema import FactorialConfig
from cam_rig.studies.factorial.conclusions import answer
from cam_rig.studies.factorial.decomposition import advantages
from cam_rig.studies.factorial.design import EFFECTS, Design, Effect
from cam_rig.studies.factorial.in_contact import left, staying
from cam_rig.units import RPM_PER_RAD_S


def section(results: Findings) -> Section:
    """The answer first, then what it rests on."""
    found = results.factorial
    classes = found.same_angles.classes
    return Section(
        "question",
        "Continuity or gentle slopes",
        (
            Words(
                "The paper: “…resolve whether the improvement observed is due to the continuity of "
                "the equation and/or to the gentler slopes.” Laws that join their dwells "
                f"C{min(classes)} to C{max(classes)} (Ck: k continuous derivatives) are built over "
                "the same event angles; then over the angles at which all have the same peak "
                "acceleration, so that slopes do not tell them apart."
            ),
            Points(tuple(answer(found))),
            Picture(
                "factorial",
                "Each effect by law and angle, and the shares of its variance. Hollow: the "
                "follower leaves the cam below the fastest speed of that effect, where the model "
                f"holds it on. Dotted: {found.config.proposed} as it is.",
            ),
            *(_variance(design, found.config) for design in found.designs),
            _advantage(results),
            _squeezed(results),
            Words(_reach(results)),
        ),
    )


def _reach(results: Findings) -> str:
    soft, stiff = (
        results.sources.cam_set.rig.follower.stem_stiffness.si,
        results.sources.stiff.follower.stem_stiffness.si,
    )
    pairs = zip(
        results.vibration.at(STEADY_RPM).values(),
        results.stiff_vibration.at(STEADY_RPM).values(),
        strict=True,
    )
    least = min(one.ringing / other.ringing for one, other in pairs)
    return (
        "How far this goes: the stem is the one identified from Table 2 "
        f"({number(soft)} N/m). On the stem the paper prints ({number(stiff)} N/m) ringing is at "
        f"least {least:.0f} times smaller, and slopes alone are left. The runs have no scatter, so "
        "shares of variance are given "
        "and no test of significance; they depend on the levels chosen, which stand in the "
        "study's file."
    )


def _variance(design: Design, config: FactorialConfig) -> Grid:
    rows = []
    for effect in EFFECTS:
        gone = int(left(design, effect, config).sum())
        rows.append((effect.name, *_parts(design, effect), str(gone) if effect.speeds else ""))
        stay = staying(design, effect, config)
        if gone and stay is not None:
            size = f"… {len(stay.rises)} laws × {stay.angles.size} angles that stay"
            rows.append((size, *_parts(stay, effect), "0"))
    a, b = len(design.rises), design.angles.size
    head = (
        "effect",
        "law [%]",
        "of it between classes [%]",
        "angle [%]",
        "interaction [%]",
        "SS law",
        "SS angle",
        "SS interaction",
        "cells left",
    )
    return Grid(
        f"Analysis of variance, {design.name}: {a} laws × {b} angles",
        head,
        tuple(rows),
        note=f"Degrees of freedom: {a - 1}, {b - 1}, {(a - 1) * (b - 1)}. Sums of squares in dB²: "
        "20 lg of amplitudes and speeds, levels as they are. Cells left: their follower leaves the "
        "cam below the fastest speed of the effect, where the model holds it on; the row below has "
        "the laws and angles that all stay. Noise of the rigid follower has flights and landings "
        "in it, and no ringing.",
    )


def _parts(design: Design, effect: Effect) -> tuple[str, ...]:
    found = design.analysis(effect)
    law, angle, both = found.shares
    parts = (law, found.classes / (found.total or 1.0), angle, both)
    sums = (found.rows, found.columns, found.interaction)
    return (*(f"{100.0 * part:.1f}" for part in parts), *(number(value, 3) for value in sums))


def _advantage(results: Findings) -> Grid:
    rows = tuple(
        (
            results.sources.cam_set.titles[row.cam],
            f"{100.0 * math.expm1(row.jump):+.1f} %",
            f"{100.0 * row.jump_share:.0f} %",
            f"{100.0 * math.expm1(-row.acceleration):+.1f} %",
            f"{100.0 * row.acceleration_share:.0f} %",
            f"÷ {math.exp(row.residual):.1f}",
            f"{-row.noise:+.1f} dB",
        )
        for row in advantages(results.factorial)
    )
    head = (
        "Bézier 15 over",
        "jump speed",
        "of it in the slopes",
        "peak acceleration",
        "of it in the slopes",
        "residual vibration",
        "noise",
    )
    return Grid(
        "Bézier 15's advantage, as the cams are, and what of it a rigid follower has too",
        head,
        rows,
        note="A rigid follower cannot ring: it feels the slopes alone. In logarithms slopes and "
        "ringing add up exactly. Above 100 %: at its own, higher jump speed Bézier 15 rings more "
        "than the other cam at its.",
    )


def _squeezed(results: Findings) -> Grid:
    rows = tuple(
        (
            f"{math.degrees(span):.4g}°",
            f"{m.jump * RPM_PER_RAD_S:.1f}",
            f"{m.rigid_jump * RPM_PER_RAD_S:.1f}",
            f"{m.acceleration:.1f}",
            f"{1e6 * m.residual:.2f}",
            f"{m.noise:.1f}",
        )
        for span, m in sorted(results.factorial.squeezed.items(), reverse=True)
    )
    head = (
        "Bézier 15 in",
        "jump [rpm]",
        "rigid jump [rpm]",
        "peak ẍ [m/s²]",
        "residual [µm]",
        "noise [dB]",
    )
    return Grid("Bézier 15 squeezed into less than the turn", head, rows)
