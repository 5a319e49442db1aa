"""A front of two quantities: the best of one for every value of the other, each with its bound."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec

import numpy as np

from cam_rig.errors import ConfigError, DesignError
from cam_rig.law_design.design import design_problem, own_limits
from cam_rig.law_design.design import search_design as design
from cam_rig.law_design.local_search import LONGEST, SHORTEST, EventSpans
from cam_rig.law_design.problem import DesignProblem, measured
from cam_rig.law_design.request import DesignRequest, LawClass
from cam_rig.law_design.result import Front, LawDesign
from cam_rig.law_design.space import Space
from cam_rig.laws import build_law
from cam_rig.laws.cam import CamSet
from cam_rig.quantities.terms import Limit, Term, sign_of
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.show.result import SILENT, Progress

#: Points of a front, at least and at most.
FEWEST, MOST = 3, 200

#: The shortest and longest spans of a front are found to this part of the start's.
NEAR_EDGE = 2e-3


def front(
    cam: CamConfig,
    rig: RigConfig,
    request: DesignRequest,
    other: Term,
    points: int,
    progress: Progress = SILENT,
) -> Front:
    """The goal's best between the best that the other quantity can be and where it no longer binds.

    Where the other is an event's span, between the shortest and the longest that there can be.
    """
    if not FEWEST <= points <= MOST:
        raise ConfigError(f"--points: is {points}; allowed: {FEWEST} to {MOST}")
    progress.begin(points + 2, request.words)
    if other.quantity.where == "event":
        return _over_spans(cam, rig, request, other, points, progress)
    if other == request.goal:
        raise ConfigError(f"--pareto: is the goal, {other.key}; allowed: another quantity")
    sense = other.quantity.senses[0]
    swapped = replace(request, goal=other, sense=sense)
    own = design(cam, rig, swapped)
    progress.advance()
    free = design(cam, rig, request)
    progress.advance()
    problem = DesignProblem(cam, free.start, rig, Space(free.start, request.law_class))
    best, loosest = own.goal.result, measured(problem, free.law, other, sense)
    better = (loosest - best) * sign_of(sense)
    if better <= 1e-9 * abs(best):
        raise ConfigError(
            f"--pareto: {other.key} is best where {request.goal.key} is; allowed: two quantities "
            "of which one costs the other"
        )
    # the end itself has no room for any other law
    allowed = [float(x) for x in np.linspace(best, loosest, points + 1)[1:]]

    def found(value: float) -> LawDesign:
        limits = (*request.limits, Limit(other, sense, value))
        return design(cam, rig, replace(request, limits=limits))

    return _along(other, allowed, found, progress)


def _along(
    other: Term,
    allowed: list[float],
    found: Callable[[float], LawDesign],
    progress: Progress,
) -> Front:
    """A design for each value; where it is interrupted those that there are."""
    designs: list[LawDesign] = []
    try:
        for value in allowed:
            designs.append(found(value))
            progress.advance()
    except KeyboardInterrupt:
        if not designs:
            raise
    count = len(designs)
    return Front(other, tuple(allowed[:count]), tuple(designs), len(allowed), count < len(allowed))


def _over_spans(
    cam: CamConfig,
    rig: RigConfig,
    request: DesignRequest,
    other: Term,
    points: int,
    progress: Progress,
) -> Front:
    """The goal's best for each span of an event, the others in proportion, about their middles.

    From the shortest that has a law (or half of the start's) to the longest that the dwells leave
    (or twice the start's).
    """
    if "events" not in request.keep:
        raise ConfigError(
            f"--pareto: over {other.key} the events and the dwells have their spans from it; "
            "allowed: without --keep"
        )
    start = build_law(cam)
    problem = DesignProblem(cam, start, rig, Space(start, request.law_class))
    own = replace(request, limits=tuple(own_limits(problem, request)))
    spans = EventSpans(problem, False, [], lambda _: 0.0)
    name = f"{cam.name}_designed"
    span = measured(problem, start, other, "<=")

    def found(factor: float) -> LawDesign:
        moved = spans.moved(factor * spans.start)
        return design_problem(moved, own, name)

    def has_law(factor: float) -> bool:
        try:
            found(factor)
        except DesignError:
            return False
        return True

    longest = _edge(lambda factor: spans.possible(factor * spans.start), 1.0, LONGEST)
    if not has_law(longest):
        found(longest)  # it says why
    progress.advance()
    shortest = _edge(has_law, longest, SHORTEST)
    progress.advance()
    allowed = np.linspace(shortest, longest, points) * span
    return _along(other, allowed.tolist(), lambda value: found(value / span), progress)


def _edge(holds: Callable[[float], bool], inside: float, outside: float) -> float:
    """The factor nearest to the outer one at which something still holds."""
    if holds(outside):
        return outside
    while abs(outside - inside) > NEAR_EDGE:
        middle = 0.5 * (inside + outside)
        inside, outside = (middle, outside) if holds(middle) else (inside, middle)
    return inside


# How far the paper's laws are from the best of their class: its ordinates, its events.

#: One Bézier curve as the paper's, and B-splines between dwells, few pieces and more.
CURVE, SPLINE, FINE = LawClass(1, 3, 15), LawClass(8, 3), LawClass(16, 3)

#: Over all speeds of the paper's figures; no law has a higher peak acceleration than its start.
SOUND, VIBRATION = "sound_level_rigid@200-400rpm", "residual_vibration@200-400rpm"

LIMITS = ("peak_acceleration<=start",)

#: What is designed: the cam, and what is asked.
ASKED = (
    ("bezier15", DesignRequest.of(maximise="jump_speed", limits=LIMITS, law_class=CURVE)),
    ("bezier15", DesignRequest.of(minimise=SOUND, limits=LIMITS, law_class=CURVE)),
    ("poly345", DesignRequest.of(maximise="jump_speed", limits=LIMITS, law_class=SPLINE)),
    ("poly345", DesignRequest.of(minimise=VIBRATION, limits=LIMITS, law_class=FINE)),
    ("poly345", DesignRequest.of(minimise=SOUND, limits=LIMITS, law_class=FINE)),
)


def paper_designs(cam_set: CamSet) -> list[LawDesign]:
    """The best laws beside the paper's, of those that are in the set.

    Nothing where the solver of the extra ``design`` is not installed.
    """
    if find_spec("clarabel") is None:
        return []
    return [
        design(cam_set.cams[cam], cam_set.rig, asked) for cam, asked in ASKED if cam in cam_set.cams
    ]
