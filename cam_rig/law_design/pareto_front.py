"""A front of two quantities: the best of one for every value of the other, each with its bound."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib.util import find_spec

import numpy as np

from cam_rig.errors import ConfigError, DesignError
from cam_rig.law_design.constraints import DesignProblem
from cam_rig.law_design.design import design_problem, own_limits
from cam_rig.law_design.design import search_design as design
from cam_rig.law_design.local_search import LONGEST, SHORTEST, EventSpans
from cam_rig.law_design.measure import measured
from cam_rig.law_design.request import DesignRequest, LawClass
from cam_rig.law_design.space import Space
from cam_rig.law_design.tables import LawDesign, in_words
from cam_rig.law_design.terms import Limit, Term
from cam_rig.laws import build_law
from cam_rig.laws.cam import CamSet
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.show.tables import DataTable, Head, tabulate

#: Points of a front, at least and at most.
FEWEST, MOST = 3, 200

#: The shortest and longest spans of a front are found to this part of the start's.
NEAR_EDGE = 2e-3


@dataclass(frozen=True)
class Front:
    """Designs by rising values of the other quantity: ``allowed`` ``(n,)``, SI (dB for levels)."""

    other: Term
    allowed: tuple[float, ...]
    designs: tuple[LawDesign, ...]
    ended: bool = True


def front(
    cam: CamConfig,
    rig: RigConfig,
    request: DesignRequest,
    other: Term,
    points: int,
    on_point: Callable[[], None] = lambda: None,
) -> Front:
    """The goal's best between the best that the other quantity can be and where it no longer binds.

    Where the other is an event's span, between the shortest and the longest that there can be.
    """
    if not FEWEST <= points <= MOST:
        raise ConfigError(f"--points: is {points}; allowed: {FEWEST} to {MOST}")
    if other.name == "event_angle":
        return _over_spans(cam, rig, request, other, points, on_point)
    if other == request.goal:
        raise ConfigError(f"--pareto: is the goal, {other.key}; allowed: another quantity")
    sense = other.quantity.senses[0]
    swapped = replace(request, goal=other, sense=sense)
    own = design(cam, rig, swapped)
    on_point()
    free = design(cam, rig, request)
    on_point()
    best, loosest = own.goal.result, _value(free, cam, rig, other)
    better = (loosest - best) * (1.0 if sense == "<=" else -1.0)
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

    return _along(other, allowed, found, on_point)


def _along(
    other: Term,
    allowed: list[float],
    found: Callable[[float], LawDesign],
    on_point: Callable[[], None],
) -> Front:
    """A design for each value; where it is interrupted those that there are."""
    designs: list[LawDesign] = []
    try:
        for value in allowed:
            designs.append(found(value))
            on_point()
    except KeyboardInterrupt:
        if not designs:
            raise
    count = len(designs)
    return Front(other, tuple(allowed[:count]), tuple(designs), count == len(allowed))


def _over_spans(
    cam: CamConfig,
    rig: RigConfig,
    request: DesignRequest,
    other: Term,
    points: int,
    on_point: Callable[[], None],
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

    def possible(factor: float) -> bool:
        return spans.possible(factor * spans.start)

    def found(factor: float) -> LawDesign:
        moved = spans.moved(factor * spans.start)
        return design_problem(moved, own, name, lambda _c, _v: None)

    def has_law(factor: float) -> bool:
        try:
            found(factor)
        except DesignError:
            return False
        return True

    longest = _edge(possible, 1.0, LONGEST)
    if not has_law(longest):
        found(longest)  # it says why
    on_point()
    shortest = _edge(has_law, longest, SHORTEST)
    on_point()
    allowed = np.linspace(shortest, longest, points) * span
    return _along(other, allowed.tolist(), lambda value: found(value / span), on_point)


def _edge(holds: Callable[[float], bool], inside: float, outside: float) -> float:
    """The factor nearest to the outer one at which something still holds."""
    if holds(outside):
        return outside
    while abs(outside - inside) > NEAR_EDGE:
        middle = 0.5 * (inside + outside)
        inside, outside = (middle, outside) if holds(middle) else (inside, middle)
    return inside


def _value(found: LawDesign, cam: CamConfig, rig: RigConfig, other: Term) -> float:
    """The other quantity of a design."""
    problem = DesignProblem(cam, found.start, rig, Space(found.start, found.request.law_class))
    return measured(problem, found.law, other, other.quantity.senses[0])


def front_table(front: Front) -> DataTable:
    """One row a point."""
    goal, own = front.designs[0].goal.term, front.other.quantity
    unit, shown = in_words(goal), goal.quantity.shown

    def bound(found: LawDesign) -> float | None:
        return None if found.goal.bound is None else found.goal.bound / shown

    rows = list(zip(front.allowed, front.designs, strict=True))
    return tabulate(
        f"{goal.words} against {front.other.words}",
        rows,
        (
            (
                Head(front.other.words, in_words(front.other), ".5g"),
                lambda r: r[0] / own.shown,
            ),
            (Head("result", unit, ".5g"), lambda r: r[1].goal.result / shown),
            (Head("bound", unit, ".5g", missing="–"), lambda r: bound(r[1])),
            (Head("certified"), lambda r: _proof(r[1])),
        ),
    )


def _proof(found: LawDesign) -> str:
    return "local" if found.goal.bound is None else "yes" if found.certified else "no"


# How far the paper's laws are from the best of their class: its ordinates, its events.

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
            (Head("start"), lambda row: titles[row.start.name]),
            (Head("class"), lambda row: row.request.law_class.words),
            (Head("quantity"), lambda row: row.goal.term.words),
            (Head("unit"), lambda row: in_words(row.goal.term)),
            (Head("start", "", ".5g"), lambda row: row.goal.start / _shown(row)),
            (Head("best law", "", ".5g"), lambda row: row.goal.result / _shown(row)),
            (Head("bound", "", ".5g"), bound),
        ),
        "Events, dwells and lift are the start's. Bound: no law of the class is better.",
    )


def _shown(row: LawDesign) -> float:
    return row.goal.term.quantity.shown
