"""Comparison of the paper's laws with the best laws of their class.

A class is a set of laws of the same form. A design is the best law of a class for a goal.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec

from cam_rig.laws.cam import CamSet
from cam_rig.studies.design.request import DesignRequest, LawClass
from cam_rig.studies.design.result import LawDesign
from cam_rig.studies.design.study import search_design
from examples.paper.common import Table, titles

#: Class of a single Bézier curve, as in the paper.
CURVE = LawClass(1, 3, 15)
#: Class of B-splines with few pieces.
SPLINE = LawClass(8, 3)
#: Class of B-splines with more pieces.
FINE_SPLINE = LawClass(16, 3)
#: Goal: sound level over all speeds of the figures of the paper.
SOUND = "sound_level_rigid@200-400rpm"
#: Goal: residual vibration over all speeds of the figures of the paper.
VIBRATION = "residual_vibration@200-400rpm"
#: Limit: the peak acceleration is not higher than that of the start.
LIMITS = ("peak_acceleration<=start",)
#: Cams from which a design starts, with goals and classes.
REQUESTS = (
    ("bezier15", DesignRequest.of(maximise="jump_speed", limits=LIMITS, law_class=CURVE)),
    ("bezier15", DesignRequest.of(minimise=SOUND, limits=LIMITS, law_class=CURVE)),
    ("poly345", DesignRequest.of(maximise="jump_speed", limits=LIMITS, law_class=SPLINE)),
    ("poly345", DesignRequest.of(minimise=VIBRATION, limits=LIMITS, law_class=FINE_SPLINE)),
    ("poly345", DesignRequest.of(minimise=SOUND, limits=LIMITS, law_class=FINE_SPLINE)),
)


def paper_designs(cam_set: CamSet) -> list[LawDesign]:
    """Return the best laws for the cams of the set.

    The result is empty if the libraries of the extra `design` are not installed.
    """
    if find_spec("clarabel") is None:
        return []
    cams, rig = cam_set.cams, cam_set.rig
    return [search_design(cams[cam], rig, request) for cam, request in REQUESTS if cam in cams]


def table(designs: Sequence[LawDesign]) -> Table:
    """Return a table with a row per design: start, result, and bound of the class."""
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
