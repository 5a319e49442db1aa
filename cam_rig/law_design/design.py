"""A design: the best law of a class by a goal, beside its start and the bound that proves it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial

from cam_rig.arguments import checked
from cam_rig.errors import ConfigError, DesignError
from cam_rig.law_design.cam_file import designed_cam
from cam_rig.law_design.cutting_planes import Best, Solver
from cam_rig.law_design.local_search import EventSpans, LocalSearch
from cam_rig.law_design.problem import Asked, DesignProblem, measured
from cam_rig.law_design.request import KEEP, STARTS, DesignRequest, LawClass, Multistart
from cam_rig.law_design.result import LawDesign, Measure
from cam_rig.law_design.rows import asked_of, rows_of
from cam_rig.law_design.space import Space
from cam_rig.laws import Law, build_law
from cam_rig.quantities.terms import Limit, sign_of
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.units import FloatArray

#: A goal below this part of the start's is solved again, measured by itself.
SMALL = 0.05

#: Told what makes a design of a law that is better than those before, and its goal's value (SI).
OnBest = Callable[[Callable[[], LawDesign], float], None]

#: A limit is broken where the written law exceeds it by this part of its scale.
BROKEN = 1e-6

#: Followers between two faces or rollers of one disc, which bind the fall to the rise.
CLOSED = ("constant_breadth", "constant_diameter")

#: A limit on an event's span is met within this part of it.
SPAN_MET = 1e-3


def search_design(
    cam: CamConfig,
    rig: RigConfig,
    request: DesignRequest,
    name: str | None = None,
    on_best: OnBest = lambda _design, _value: None,
) -> LawDesign:
    """The best law of a class between the dwells of a cam.

    ``name`` is the new cam's, by default the start's with ``_designed``; ``on_best`` is told each
    better law.
    """
    if cam.follower.type in CLOSED:
        raise ConfigError(
            f"cam {cam.name!r}: its follower is {cam.follower.type}, whose fall must be its rise "
            "turned by 180°, which a design does not keep; allowed: other followers"
        )
    start = build_law(cam)
    problem = DesignProblem(cam, start, rig, Space(start, request.law_class))
    name = name or f"{cam.name}_designed"
    if "events" in request.keep:
        return design_problem(problem, request, name, on_best)
    return _with_other_spans(problem, request, name, on_best)


def _with_other_spans(
    problem: DesignProblem, request: DesignRequest, name: str, on_best: OnBest
) -> LawDesign:
    """The best law whose events have the best spans, by a search of these."""
    asked = own_limits(problem, request)
    spans = [limit for limit in asked if limit.term.quantity.where == "event"]
    others = replace(request, limits=tuple(limit for limit in asked if limit not in spans))
    quick = replace(others, multistart=replace(request.multistart, starts=1))
    sign, best = sign_of(request.sense), math.inf

    def told(moved: DesignProblem, made: Callable[[], LawDesign], value: float) -> None:
        nonlocal best
        if sign * value < best:
            best = sign * value
            on_best(lambda: _of_start(problem, request, asked, moved, made()), value)

    def value(moved: DesignProblem) -> float:
        return sign * design_problem(moved, quick, name, partial(told, moved)).goal.result

    search = EventSpans(problem, "dwells" in request.keep, spans, value)
    moved, multistart = search.best(request.multistart)
    found = design_problem(moved, others, name, partial(told, moved), multistart)
    return _of_start(problem, request, asked, moved, found)


def _of_start(
    problem: DesignProblem,
    request: DesignRequest,
    asked: list[Limit],
    moved: DesignProblem,
    found: LawDesign,
) -> LawDesign:
    """A design of moved events beside the start that was asked for."""
    goal, *rest = found.measures
    limited = iter(rest)
    measures = [replace(goal, bound=None)]
    for limit in asked:
        if limit.term.quantity.where != "event":
            measures.append(next(limited))
            continue
        assert limit.value is not None
        span = measured(moved, moved.start, limit.term, limit.sense)
        met = math.isclose(span, limit.value, rel_tol=SPAN_MET)
        measures.append(Measure(limit.term, limit.sense, span, span, None, limit.value, met))
    beside = tuple(
        replace(x, start=measured(problem, problem.start, x.term, x.sense)) for x in measures
    )
    return replace(
        found, request=request, start=problem.start, measures=beside, spans_bound=goal.bound
    )


def own_limits(problem: DesignProblem, request: DesignRequest) -> list[Limit]:
    """The limits with the start's values, which stay where its events move."""
    return [replace(limit, value=_allowed(problem, limit)) for limit in request.limits]


def _allowed(problem: DesignProblem, limit: Limit) -> float:
    """What a limit allows, SI; the level in dB."""
    if limit.value is not None:
        return limit.value
    return measured(problem, problem.start, limit.term, limit.sense)


def design_problem(
    problem: DesignProblem,
    request: DesignRequest,
    name: str,
    on_best: OnBest = lambda _design, _value: None,
    search: Multistart | None = None,
) -> LawDesign:
    """The best law with the events that a problem has; ``search`` is what they were found by."""
    limits = [asked_of(problem, x.term, x.sense, _allowed(problem, x)) for x in request.limits]
    goal = asked_of(problem, request.goal, request.sense, None)

    def told(unknowns: FloatArray, value: float) -> None:
        on_best(lambda: _law_design(problem, request, name, limits, Best(unknowns), search), value)

    if rows_of(goal.term).is_local(problem, True) or any(
        rows_of(x.term).is_local(problem) for x in limits
    ):
        best = LocalSearch(problem, goal, limits, request.multistart, told).best()
    else:
        best = _solve(problem, goal, limits, told)
    return _law_design(problem, request, name, limits, best, search)


def _law_design(
    problem: DesignProblem,
    request: DesignRequest,
    name: str,
    limits: list[Asked],
    best: Best,
    search: Multistart | None,
) -> LawDesign:
    """A law with all that was asked of it."""
    start, space, term, sense = problem.start, problem.space, request.goal, request.sense
    search = search or best.multistart
    cam, text = designed_cam(problem, best.unknowns, name, request, limits, search)
    law = build_law(cam)
    first, result = (measured(problem, x, term, sense) for x in (start, law))
    bound = None if best.bound is None else rows_of(term).from_rows(problem, term, best.bound)
    measures = [Measure(term, sense, first, result, bound)]
    measures += [
        _limit(problem, law, asked, limit, best)
        for asked, limit in zip(limits, request.limits, strict=True)
    ]
    return LawDesign(
        request,
        start,
        law,
        cam,
        text,
        problem.rig,
        tuple(space.events),
        tuple(angle for _, angle in space.turning_points),
        tuple(measures),
        best.rounds,
        search,
        interrupted=best.so_far,
    )


def _solve(
    problem: DesignProblem,
    goal: Asked,
    limits: list[Asked],
    told: Callable[[FloatArray, float], None],
) -> Best:
    def shown(unknowns: FloatArray, value: float) -> None:
        told(unknowns, rows_of(goal.term).from_rows(problem, goal.term, value))

    best = Solver(problem, goal, limits, shown).best()
    if goal.sense == "<=" and 0.0 < best.value < SMALL * goal.scale:
        fine = Asked(goal.term, goal.sense, None, best.value / SMALL)  # for more digits
        with suppress(DesignError):  # then the first stands alone
            again = Solver(problem, fine, limits, shown).best()
            law = min(best, again, key=lambda found: found.value)
            assert best.bound is not None and again.bound is not None  # of programs
            bound = max(best.bound, again.bound)
            best = replace(law, bound=bound, rounds=best.rounds + again.rounds)
    return best


def _limit(problem: DesignProblem, law: Law, asked: Asked, limit: Limit, best: Best) -> Measure:
    quantity, allowed = limit.term.quantity, _allowed(problem, limit)
    start, result = (measured(problem, x, limit.term, limit.sense) for x in (problem.start, law))
    over = (result - allowed) * sign_of(limit.sense)
    if over > BROKEN * max(abs(allowed), abs(start)) and not best.so_far:
        raise DesignError(
            f"the law found breaks {limit.words}: it has {result / quantity.factor:.6g} "
            f"{quantity.unit}; allowed: a narrower range, or more pieces"
        )
    active = asked.name in best.active
    return Measure(limit.term, limit.sense, start, result, limit=allowed, active=active)


@checked
def design(
    cam: CamConfig,
    rig: RigConfig,
    *,
    minimise: str | None = None,
    maximise: str | None = None,
    limits: Sequence[str] = (),
    pieces: int = 16,
    joints: int = 3,
    degree: int | None = None,
    starts: int = STARTS,
    seed: int = 1,
    keep: Sequence[str] = KEEP[0],
) -> LawDesign:
    """The law that is best by a goal, of B-splines in each event of a cam.

    Dwells, events and lift stay. The bound holds for the whole class: it comes from a convex
    program's multipliers. What is not convex is searched for from several starts, without a bound:
    ``multistart`` says how many of them came to the same.

    Parameters
    ----------
    minimise, maximise : one of them: a quantity as `cam-rig design` takes it
    limits : such as ``"peak_acceleration<=start"`` or ``"lift@90deg>=30mm"``
    pieces, joints, degree : of the splines; joints k means Cᵏ, a degree is by default k + 2
    keep : what stays: all of it, ``("dwells", "lift")`` or ``("lift",)``; then spans are searched
    starts, seed : of a local search; the same seed gives the same law

    Raises
    ------
    ConfigError : an unknown quantity or unit, a goal or limit that is not convex that way
    DesignError : no law of the class keeps the limits
    MissingLibraryError : clarabel or highspy is not installed

    Examples
    --------
    >>> import cam_rig
    >>> cam, rig = cam_rig.load_cam("poly345"), cam_rig.load_rig("paper_table2")
    >>> found = cam_rig.design(cam, rig, minimise="peak_acceleration", joints=1)
    >>> print(f"{found.goal.start:.4f} {found.goal.result:.4f} m/rad^2")
    0.0686 0.0476 m/rad^2
    """
    request = DesignRequest.of(
        minimise=minimise,
        maximise=maximise,
        limits=limits,
        law_class=LawClass(pieces, joints, degree),
        multistart=Multistart(starts, seed),
        keep=keep,
    )
    return search_design(cam, rig, request)
