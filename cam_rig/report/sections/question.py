"""The question the paper leaves open: continuity, or gentler slopes."""

from __future__ import annotations

import math

from cam_rig.experiment.advantage import advantages
from cam_rig.experiment.answer import answer
from cam_rig.experiment.factorial import EFFECTS, Design
from cam_rig.report.blocks import Grid, Picture, Points, Section, Words
from cam_rig.report.figures import STEADY_RPM
from cam_rig.report.results import Results
from cam_rig.report.words import number

RPM = 30.0 / math.pi


def section(results: Results) -> Section:
    """The answer first, then what it rests on."""
    found = results.factorial
    designs = [d for both in (found.same_angles, found.same_acceleration) for d in _both(both)]
    return Section(
        "question",
        "Continuity or gentle slopes",
        (
            Words(
                "The paper: “…resolve whether the improvement observed is due to the continuity of "
                "the equation and/or to the gentler slopes.” Laws of every class of continuity, "
                "from a jump of acceleration (C1) to four continuous derivatives (C4), are built "
                "over the same event angles; then over the angles at which all have the same peak "
                "acceleration, so that continuity is all that differs."
            ),
            Points(tuple(answer(found))),
            Picture(
                "factorial",
                "Each effect by law and angle, and the shares of its variance. With the same "
                "acceleration all laws of C2 and above lie nearly on one line, but for residual "
                "vibration. Dotted: Bézier 15 as it is.",
            ),
            *(_variance(design) for design in designs),
            _advantage(results),
            _squeezed(results),
            Words(_reach(results)),
        ),
    )


def _reach(results: Results) -> str:
    soft, stiff = (
        results.sources.lineup.rig.follower.stem_stiffness.si,
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


def _both(design: Design) -> tuple[Design, Design]:
    return design, design.from_class(2)


def _variance(design: Design) -> Grid:
    rows = []
    for effect in EFFECTS:
        found = design.analysis(effect)
        law, angle, both = found.shares
        total = found.total or 1.0
        parts = (law, found.classes / total, angle, both)
        sums = (found.rows, found.columns, found.interaction)
        rows.append(
            (
                effect.name,
                *(f"{100.0 * part:.1f}" for part in parts),
                *(number(value, 3) for value in sums),
            )
        )
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
    )
    return Grid(
        f"Analysis of variance, {design.name}: {a} laws × {b} angles",
        head,
        tuple(rows),
        note=f"Degrees of freedom: {a - 1}, {b - 1}, {(a - 1) * (b - 1)}. Sums of squares in dB²: "
        "20 lg of amplitudes and speeds, levels as they are.",
    )


def _advantage(results: Results) -> Grid:
    rows = tuple(
        (
            results.sources.lineup.titles[row.cam],
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


def _squeezed(results: Results) -> Grid:
    rows = tuple(
        (
            f"{math.degrees(span):.4g}°",
            f"{m.jump * RPM:.1f}",
            f"{m.rigid_jump * RPM:.1f}",
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
