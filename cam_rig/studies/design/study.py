"""A design: the best law of a class by a goal, beside its start and the bound that proves it.

A front of two quantities: the best of one for every value of the other, each with its bound.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import TypedDict, Unpack, overload

import numpy as np

from cam_rig.arguments import checked
from cam_rig.errors import ConfigError, DesignError
from cam_rig.laws import Law, build_law
from cam_rig.quantities.terms import Limit, Term, sign_of
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.show.result import NULL_PROGRESS, Progress
from cam_rig.studies.design.cutting_planes import Best, Solver, Told
from cam_rig.studies.design.local_search import LONGEST, SHORTEST, EventSpans, local_best
from cam_rig.studies.design.request import (
    KEEP,
    STARTS,
    DesignRequest,
    LawClass,
    Multistart,
    parse_second,
)
from cam_rig.studies.design.result import Front, LawDesign, Measure, designed_cam
from cam_rig.studies.design.rows import asked_of, rows_of
from cam_rig.studies.design.space import Asked, DesignProblem, Space, measured
from cam_rig.units import FloatArray

#: A goal below this part of the start's is solved again, measured by itself.
SMALL = 0.05
#: Of a goal far below the start's, whose integrals cancel, so much of the start's is rounding: a
#: bound is no better than the law that is found.
ROUNDING = 1e-6
#: A limit is broken where the written law exceeds it by this part of its scale.
BROKEN = 1e-6
#: Followers between two faces or rollers of one disc, which bind the fall to the rise.
CLOSED = ("constant_breadth", "constant_diameter")
#: A limit on an event's span is met within this part of it.
SPAN_MET = 1e-3
#: Told what makes a design of a law that is better than those before, and its goal's value (SI).
OnBest = Callable[[Callable[[], LawDesign], float], None]


def search_design(
    cam: CamConfig,
    rig: RigConfig,
    request: DesignRequest,
    name: str | None = None,
    on_best: OnBest = lambda _design, _value: None,
) -> LawDesign:
    """The best law of a class between the dwells of a cam; ``on_best`` is told each better one."""
    if cam.follower.type in CLOSED:
        raise ConfigError(
            f"cam {cam.name!r}: its follower is {cam.follower.type}, whose fall must be its rise "
            "turned by 180°, which a design does not keep; allowed: other followers"
        )
    search = DesignSearch(
        _problem(cam, rig, request), request, name or f"{cam.name}_designed", on_best
    )
    return search.best() if "events" in request.keep else search.best_of_spans()


def _problem(cam: CamConfig, rig: RigConfig, request: DesignRequest) -> DesignProblem:
    start = build_law(cam)
    return DesignProblem(cam, start, rig, Space(start, request.law_class))


@dataclass(frozen=True, eq=False)
class DesignSearch:
    """A search for the best law; ``on_best`` is told better ones, ``spans`` found the events."""

    problem: DesignProblem
    request: DesignRequest
    name: str
    on_best: OnBest = lambda _design, _value: None
    spans: Multistart | None = None

    def best_of_spans(self) -> LawDesign:
        """The best law whose events have the best spans, by a search of these."""
        asked = self.with_values().limits
        spans = [limit for limit in asked if limit.term.quantity.where == "event"]
        others = replace(self.request, limits=tuple(x for x in asked if x not in spans))
        quick = replace(others, multistart=replace(others.multistart, starts=1))
        sign, least = sign_of(self.request.sense), math.inf

        def told(moved: DesignProblem, made: Callable[[], LawDesign], value: float) -> None:
            nonlocal least
            if sign * value < least:
                least = sign * value
                self.on_best(lambda: self._beside_start(asked, moved, made()), value)

        def at(moved: DesignProblem, request: DesignRequest) -> DesignSearch:
            return replace(self, problem=moved, request=request, on_best=partial(told, moved))

        def value(moved: DesignProblem) -> float:
            return sign * at(moved, quick).best().goal.result

        search = EventSpans(self.problem, "dwells" in self.request.keep, spans, value)
        moved, multistart = search.best(self.request.multistart)
        return self._beside_start(asked, moved, replace(at(moved, others), spans=multistart).best())

    def _beside_start(
        self, asked: Sequence[Limit], moved: DesignProblem, found: LawDesign
    ) -> LawDesign:
        """A design of moved events beside the start that was asked for."""
        goal, *rest = found.measures
        limited, measures = iter(rest), [replace(goal, bound=None)]
        for limit in asked:
            if limit.term.quantity.where != "event":
                measures.append(next(limited))
                continue
            assert limit.value is not None
            span = measured(moved, moved.start, limit.term, limit.sense)
            met = math.isclose(span, limit.value, rel_tol=SPAN_MET)
            measures.append(Measure(limit.term, limit.sense, span, span, None, limit.value, met))
        start = self.problem.start
        beside = tuple(
            replace(x, start=measured(self.problem, start, x.term, x.sense)) for x in measures
        )
        return replace(
            found, request=self.request, start=start, measures=beside, spans_bound=goal.bound
        )

    def with_values(self) -> DesignRequest:
        """The request whose limits have the start's values, which stay where its events move."""
        limits = (replace(limit, value=self._allowed(limit)) for limit in self.request.limits)
        return replace(self.request, limits=tuple(limits))

    def _allowed(self, limit: Limit) -> float:
        """What a limit allows, SI; the level in dB."""
        if limit.value is not None:
            return limit.value
        return measured(self.problem, self.problem.start, limit.term, limit.sense)

    def best(self) -> LawDesign:
        """The best law with the events that the problem has."""
        problem, request = self.problem, self.request
        limits = [asked_of(problem, x.term, x.sense, self._allowed(x)) for x in request.limits]
        goal = asked_of(problem, request.goal, request.sense, None)

        def told(unknowns: FloatArray, value: float) -> None:
            self.on_best(lambda: self._law_design(limits, Best(unknowns)), value)

        local = any(rows_of(x.term).is_local(problem) for x in limits)
        if local or rows_of(goal.term).is_local(problem, True):
            best = local_best(problem, goal, limits, request.multistart, told)
        else:
            best = _solve(problem, goal, limits, told)
        return self._law_design(limits, best)

    def _law_design(self, limits: list[Asked], best: Best) -> LawDesign:
        problem, request = self.problem, self.request
        start, space, term, sense = problem.start, problem.space, request.goal, request.sense
        search = self.spans or best.multistart
        cam, text = designed_cam(problem, best.unknowns, self.name, request, limits, search)
        law = build_law(cam)
        first, result = (measured(problem, x, term, sense) for x in (start, law))
        bound = None if best.bound is None else rows_of(term).from_rows(problem, term, best.bound)
        if bound is not None and abs(bound - result) <= ROUNDING * abs(first) < math.inf:
            side = sign_of(sense)
            bound = side * min(side * bound, side * result)
        pairs = zip(limits, request.limits, strict=True)
        others = (self._limit(law, asked, limit, best) for asked, limit in pairs)
        return LawDesign(
            request=request,
            start=start,
            law=law,
            cam=cam,
            text=text,
            rig=problem.rig,
            events=tuple(space.events),
            tops=tuple(angle for _, angle in space.turning_points),
            measures=(Measure(term, sense, first, result, bound), *others),
            rounds=best.rounds,
            multistart=search,
            interrupted=not best.rounds,
        )

    def _limit(self, law: Law, asked: Asked, limit: Limit, best: Best) -> Measure:
        quantity, allowed = limit.term.quantity, self._allowed(limit)
        laws = self.problem.start, law
        start, result = (measured(self.problem, x, limit.term, limit.sense) for x in laws)
        over = (result - allowed) * sign_of(limit.sense)
        if over > BROKEN * max(abs(allowed), abs(start)) and best.rounds:
            raise DesignError(
                f"the law found breaks {limit.words}: it has {result / quantity.factor:.6g} "
                f"{quantity.unit}; allowed: a narrower range, or more pieces"
            )
        active = asked.name in best.active
        return Measure(limit.term, limit.sense, start, result, limit=allowed, active=active)


def _solve(problem: DesignProblem, goal: Asked, limits: list[Asked], told: Told) -> Best:
    def shown(unknowns: FloatArray, value: float) -> None:
        told(unknowns, rows_of(goal.term).from_rows(problem, goal.term, value))

    best = Solver(problem, goal, limits, shown).best()
    if goal.sense == "<=" and 0.0 < best.value < SMALL * goal.scale:
        fine = replace(goal, scale=best.value / SMALL)  # for more digits
        with suppress(DesignError):  # then the first stands alone
            again = Solver(problem, fine, limits, shown).best()
            law = min(best, again, key=lambda found: found.value)
            assert best.bound is not None and again.bound is not None  # of programs
            bound = max(best.bound, again.bound)
            best = replace(law, bound=bound, rounds=best.rounds + again.rounds)
    return best


class DesignOptions(TypedDict, total=False):
    """Options of `design` but the front's, which says what it gives."""

    minimise: str | None
    maximise: str | None
    limits: Sequence[str]
    pieces: int
    joints: int
    degree: int | None
    starts: int
    seed: int
    keep: Sequence[str]
    points: int


@overload
def design(
    cam: CamConfig, rig: RigConfig, *, pareto: None = ..., **asked: Unpack[DesignOptions]
) -> LawDesign: ...
@overload
def design(
    cam: CamConfig, rig: RigConfig, *, pareto: str, **asked: Unpack[DesignOptions]
) -> Front: ...
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
    pareto: str | None = None,
    points: int = 25,
) -> LawDesign | Front:
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
    pareto, points : another quantity: the goal's best for so many of its values, 3 to 200, a front

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
    if pareto is not None:
        return front(cam, rig, request, parse_second(pareto), points)
    return search_design(cam, rig, request)


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
    progress: Progress = NULL_PROGRESS,
) -> Front:
    """The goal's best between the other's best and where it no longer binds, or over all spans."""
    if not FEWEST <= points <= MOST:
        raise ConfigError(f"--points: is {points}; allowed: {FEWEST} to {MOST}")
    progress.start(points + 2, request.words)
    problem = _problem(cam, rig, request)
    if other.quantity.where == "event":
        return _over_spans(problem, request, other, points, progress)
    if other == request.goal:
        raise ConfigError(f"--pareto: is the goal, {other.key}; allowed: another quantity")
    sense = other.quantity.senses[0]
    own = search_design(cam, rig, replace(request, goal=other, sense=sense))
    progress.advance()
    free = search_design(cam, rig, request)
    progress.advance()
    best, loosest = own.goal.result, measured(problem, free.law, other, sense)
    if (loosest - best) * sign_of(sense) <= 1e-9 * abs(best):
        raise ConfigError(
            f"--pareto: {other.key} is best where {request.goal.key} is; allowed: two quantities "
            "of which one costs the other"
        )

    def found(value: float) -> LawDesign:
        limits = (*request.limits, Limit(other, sense, value))
        return search_design(cam, rig, replace(request, limits=limits))

    # the end itself has no room for any other law
    return _along(other, np.linspace(best, loosest, points + 1)[1:], found, progress)


def _along(
    other: Term, allowed: FloatArray, found: Callable[[float], LawDesign], progress: Progress
) -> Front:
    """A design for each value; where it is interrupted those that there are."""
    designs: list[LawDesign] = []
    try:
        for value in allowed.tolist():
            designs.append(found(value))
            progress.advance()
    except KeyboardInterrupt:
        if not designs:
            raise
    values = tuple(allowed[: len(designs)].tolist())
    return Front(other, values, tuple(designs), allowed.size, len(designs) < allowed.size)


def _over_spans(
    problem: DesignProblem, request: DesignRequest, other: Term, points: int, progress: Progress
) -> Front:
    """The best for each span of an event about its middle, from the shortest to the longest."""
    if "events" not in request.keep:
        raise ConfigError(
            f"--pareto: over {other.key} the events and the dwells have their spans from it; "
            "allowed: without --keep"
        )
    search = DesignSearch(problem, request, f"{problem.cam.name}_designed")
    own, spans = search.with_values(), EventSpans(problem, False, [], lambda _: 0.0)
    span = measured(problem, problem.start, other, "<=")

    def found(factor: float) -> LawDesign:
        return replace(search, problem=spans.moved(factor * spans.start), request=own).best()

    def has_law(factor: float) -> bool:
        with suppress(DesignError):
            found(factor)
            return True
        return False

    longest = _edge(lambda factor: spans.possible(factor * spans.start), 1.0, LONGEST)
    if not has_law(longest):
        found(longest)  # it says why
    progress.advance()
    shortest = _edge(has_law, longest, SHORTEST)
    progress.advance()
    allowed = np.linspace(shortest, longest, points) * span
    return _along(other, allowed, lambda value: found(value / span), progress)


def _edge(holds: Callable[[float], bool], inside: float, outside: float) -> float:
    """The factor nearest to the outer one at which something still holds."""
    if holds(outside):
        return outside
    while abs(outside - inside) > NEAR_EDGE:
        middle = 0.5 * (inside + outside)
        inside, outside = (middle, outside) if holds(middle) else (inside, middle)
    return inside
