"""How far the paper's laws are from the best of their class: its ordinates, its events."""

from __future__ import annotations

from importlib.util import find_spec

from cam_rig.studies.cam_set import CamSet
from cam_rig.studies.design.design import design
from cam_rig.studies.design.law_class import LawClass
from cam_rig.studies.design.request import DesignRequest
from cam_rig.studies.design.results.law_design import LawDesign
from cam_rig.studies.design.results.tables import in_words
from cam_rig.tables import Column, DataTable, tabulate

#: One Bézier curve as the paper's, and B-splines between dwells, few pieces and more.
CURVE, SPLINE, FINE = LawClass(1, 3, 15), LawClass(8, 3), LawClass(16, 3)
#: What is designed: the cam, the class, the goal.
ASKED = (
    ("bezier15", CURVE, "jump_speed"),
    ("bezier15", CURVE, "sound_level_rigid@200-400rpm"),
    ("poly345", SPLINE, "jump_speed"),
    ("poly345", FINE, "residual_vibration@200-400rpm"),
    ("poly345", FINE, "sound_level_rigid@200-400rpm"),
)
#: None has a higher peak acceleration than its start.
LIMIT = "peak_acceleration<=start"


def paper_designs(cam_set: CamSet) -> list[LawDesign]:
    """The best laws beside the paper's, of those that are in the set.

    Nothing where the solver of the extra ``design`` is not installed.
    """
    if find_spec("clarabel") is None:
        return []
    found = []
    for cam, law_class, goal in ASKED:
        if cam in cam_set.cams:
            most = goal.startswith("jump_speed")
            request = DesignRequest.of(
                minimise=None if most else goal,
                maximise=goal if most else None,
                limits=[LIMIT],
                law_class=law_class,
            )
            found.append(design(cam_set.cams[cam], cam_set.rig, request))
    return found


def designs_table(designs: list[LawDesign], titles: dict[str, str]) -> DataTable:
    """One row a design: start, best law, and the bound that no law of its class passes."""

    def bound(row: LawDesign) -> float:
        assert row.goal.bound is not None
        return row.goal.bound / row.goal.term.quantity.shown

    return tabulate(
        "The best laws of their classes, at no higher peak acceleration than the start's",
        designs,
        (
            (Column("start"), lambda row: titles[row.start.name]),
            (Column("class"), lambda row: row.request.law_class.words),
            (Column("quantity"), lambda row: row.goal.term.words),
            (Column("unit"), lambda row: in_words(row.goal.term)),
            (Column("start", "", ".5g"), lambda row: row.goal.start / _shown(row)),
            (Column("best law", "", ".5g"), lambda row: row.goal.result / _shown(row)),
            (Column("bound", "", ".5g"), bound),
        ),
        "Events, dwells and lift are the start's. Bound: no law of the class is better.",
    )


def _shown(row: LawDesign) -> float:
    return row.goal.term.quantity.shown
