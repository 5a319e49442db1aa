"""Distance of the paper's laws from the best of their class."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec

from cam_rig.laws.cam import CamSet
from cam_rig.studies.design.request import DesignRequest, LawClass
from cam_rig.studies.design.result import LawDesign
from cam_rig.studies.design.study import search_design
from examples.paper.common import Table, titles

#: Class of one Bézier curve, as the paper's.
CURVE = LawClass(1, 3, 15)
#: Class of B-splines with few pieces.
SPLINE = LawClass(8, 3)
#: Class of B-splines with more pieces.
FINE_SPLINE = LawClass(16, 3)
#: Sound level over all speeds of the paper's figures.
SOUND = "sound_level_rigid@200-400rpm"
#: Residual vibration over all speeds of the paper's figures.
VIBRATION = "residual_vibration@200-400rpm"
#: No law has a higher peak acceleration than its start.
LIMITS = ("peak_acceleration<=start",)
#: Cams that are designed, with the goals.
REQUESTS = (
    ("bezier15", DesignRequest.of(maximise="jump_speed", limits=LIMITS, law_class=CURVE)),
    ("bezier15", DesignRequest.of(minimise=SOUND, limits=LIMITS, law_class=CURVE)),
    ("poly345", DesignRequest.of(maximise="jump_speed", limits=LIMITS, law_class=SPLINE)),
    ("poly345", DesignRequest.of(minimise=VIBRATION, limits=LIMITS, law_class=FINE_SPLINE)),
    ("poly345", DesignRequest.of(minimise=SOUND, limits=LIMITS, law_class=FINE_SPLINE)),
)


def paper_designs(cam_set: CamSet) -> list[LawDesign]:
    """Return the best laws for the cams of the set.

    The result is empty if the extra `design` is missing.
    """
    if find_spec("clarabel") is None:
        return []
    cams, rig = cam_set.cams, cam_set.rig
    return [search_design(cams[cam], rig, request) for cam, request in REQUESTS if cam in cams]


def table(designs: Sequence[LawDesign]) -> Table:
    """Return one row per law: the start, the result, and the bound of its class."""
    rows, names = [], titles(design.start.name for design in designs)
    for design in designs:
        goal, class_text = design.goal, design.request.law_class.words
        numbers = map(goal.in_table_unit, (goal.start, goal.result, goal.bound))
        unit = goal.term.quantity.typeset
        rows.append((names[design.start.name], class_text, goal.term.words, unit, *numbers))
    return Table(
        "The best laws of their classes, at no higher peak acceleration than the start's",
        "start | class | quantity | unit | start value :.5g | best law :.5g | bound :.5g",
        rows,
        "Events, dwells and lift are the start's. Bound: no law of the class is better.",
    )
