"""The cams and their laws: figs. 1, 2 and 12, and Table 1."""

from __future__ import annotations

from cam_rig.laws.continuity import SMOOTHEST, joints
from cam_rig.laws.peaks import extremes
from cam_rig.report.blocks import Grid, Picture, Section
from cam_rig.report.results import Findings
from cam_rig.report.words import number


def section(results: Findings) -> Section:
    """The five laws, the TM21's own cam, and the follower's numbers."""
    return Section(
        "cams",
        "Cams and laws",
        (
            _table_1(results),
            _laws(results),
            Picture(
                "fig1",
                "Fig. 1 of the paper: the TM21's own cam, circular arcs tangent to each other. The "
                "acceleration jumps at every joint. No source prints a dimension of that cam: lift "
                "and angles are identified from its published noise, and are not TM21 data.",
            ),
            Picture(
                "fig2",
                "Fig. 2: Bézier of degree 15 with its control polygon, over the whole turn. Its "
                "high dwell is a ripple.",
            ),
            Picture(
                "fig12",
                "Fig. 12: the cam of Bézier 15 with a roller follower. Base circle and roller are "
                "assumed; no source prints them.",
            ),
        ),
    )


def _table_1(results: Findings) -> Grid:
    follower = results.sources.stiff.follower
    names = {
        "spring_stiffness_N_per_m": ("closing spring [N/m]", follower.spring_stiffness.si),
        "stem_stiffness_N_per_m": ("follower's stem [N/m]", follower.stem_stiffness.si),
        "damping_N_s_per_m": ("damping [N·s/m]", follower.damping.si),
        "mass_kg": ("mass [kg]", follower.mass.si),
        "lift_m": ("lift [m]", results.sources.cam_set.cams["bezier15"].lift.si),
    }
    elastic = results.sources.cam_set.rig.follower
    other = {
        "spring_stiffness_N_per_m": elastic.spring_stiffness.si,
        "stem_stiffness_N_per_m": elastic.stem_stiffness.si,
        "damping_N_s_per_m": elastic.damping.si,
        "mass_kg": elastic.mass.si,
    }
    rows = tuple(
        (
            name,
            number(results.sources.tables.table_1[key]),
            number(value),
            number(other.get(key, value)),
        )
        for key, (name, value) in names.items()
    )
    return Grid(
        "Table 1. Parameters",
        (
            "",
            "paper",
            f"rig {results.sources.stiff.name}",
            f"rig {results.sources.cam_set.rig.name}",
        ),
        rows,
        note="The paper prints the mass as 13 kg, a misprint. Its jump speeds do not come out with "
        "the stem it prints; the second rig's stem is identified from them.",
    )


def _laws(results: Findings) -> Grid:
    cam_set = results.sources.cam_set
    rows = []
    for cam, law in cam_set.laws.items():
        inside = [j.continuity for j in joints(law) if j.continuity < SMOOTHEST]
        low, high = extremes(law, 2)
        speed = max(abs(e.value) for e in extremes(law, 1))
        worst = f"C{min(inside)}" if inside else f"C{SMOOTHEST} or smoother"
        peaks = f"{high.value / law.lift:.2f} / {low.value / law.lift:.2f}"
        rows.append((cam_set.titles[cam], worst, f"{speed / law.lift:.3f}", peaks))
    return Grid(
        "The laws at their event angles",
        ("law", "continuity", "peak s′ / lift", "peak s″ / lift, up / down"),
        tuple(rows),
        left=2,
        note="Bézier 15 over the whole turn is smoother at its one joint than its ordinates ask "
        "for: it is its own mirror image, so that even derivatives meet. And it decelerates less "
        "than it accelerates, which a jump speed rewards.",
    )
