"""Design study: the law of a class that is best for a goal, and Pareto fronts."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import TypedDict, Unpack, overload

import numpy as np

from cam_rig.arguments import check_arguments
from cam_rig.errors import ConfigError, DesignError
from cam_rig.laws import Law, build_law
from cam_rig.quantities.terms import Limit, Term, sign_of
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.show.result import NULL_PROGRESS, Progress
from cam_rig.simulation.inputs import Cam, RequiredRig, resolve_cam, resolve_rig
from cam_rig.studies.design.convex_search import best_convex
from cam_rig.studies.design.cutting_planes import BestLaw
from cam_rig.studies.design.local_search import LONGEST, SHORTEST, EventSpans, local_best
from cam_rig.studies.design.request import (
    DEFAULT_STARTS,
    KEEP,
    DesignRequest,
    LawClass,
    Multistart,
    parse_second,
)
from cam_rig.studies.design.result import Front, LawDesign, Measure, designed_cam
from cam_rig.studies.design.rows import rows_of, scale_limit
from cam_rig.studies.design.space import DesignProblem, ScaledLimit, Space, measured
from cam_rig.units import FloatArray

#: Largest difference between a law's goal and its bound that counts as rounding, as a fraction of
#: the start law's goal. It is due to cancellation in the integrals of a goal far below that of the
#: start law. If the law exceeds its bound by less than this, the bound is set to the law's value.
ROUNDING_RTOL = 1e-6
#: Excess of the designed law over a limit above which the limit counts as violated, relative to the
#: larger of the limit and the start law's value.
BROKEN_RTOL = 1e-6
#: Follower types between two faces or rollers of a single disc. With them the fall of the cam
#: depends on its rise, so such cams cannot be designed.
CLOSED_TYPES = ("constant_breadth", "constant_diameter")
#: Largest relative distance between the span of an event (motion between two dwells) and its limit
#: at which the limit counts as active.
SPAN_RTOL = 1e-3
#: Callback for each better law that a design search finds. Its arguments are a function that
#: creates the `LawDesign` of the law, and the value of the goal (SI).
OnBest = Callable[[Callable[[], LawDesign], float], None]


def search_design(
    cam: CamConfig,
    rig: RigConfig,
    request: DesignRequest,
    name: str | None = None,
    on_best: OnBest = lambda _design, _value: None,
) -> LawDesign:
    """Search for the best law of a class between the dwells of a cam.

    ``request`` contains the goal, the limits and the class of laws. ``name`` is that of the
    designed cam (default: the name of the cam with ``_designed``). ``on_best`` is called for each
    better law, with a function that creates its `LawDesign` and with the value of the goal (SI).

    Raises
    ------
    ConfigError
        If the request does not apply to the cam or the rig.
    DesignError
        If the class has no law that satisfies the limits, or the search finds no law.
    """
    if cam.follower.type in CLOSED_TYPES:
        raise ConfigError(
            f"cam {cam.name!r}: a design requires a follower whose rise and fall are independent, "
            f"got {cam.follower.type}; use another follower"
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
    """Search for the best law of a design problem.

    ``name`` is that of the designed cam. ``on_best`` is called for each better law. ``spans`` is
    the completed search for the spans of the events, or None if the spans are those of the cam. An
    event is the motion between two dwells.
    """

    problem: DesignProblem
    request: DesignRequest
    name: str
    on_best: OnBest = lambda _design, _value: None
    spans: Multistart | None = None

    def best_of_spans(self) -> LawDesign:
        """Return the best law over all allowed spans of the events.

        An event is the motion between two dwells. During the search for the spans, each local
        search for a law has a single start law. The design at the best spans then uses all start
        laws.
        """
        limits = self.with_values().limits
        spans = [limit for limit in limits if limit.term.quantity.where == "event"]
        others = replace(self.request, limits=tuple(x for x in limits if x not in spans))
        quick = replace(others, multistart=replace(others.multistart, starts=1))
        sign, best_value = sign_of(self.request.sense), math.inf

        def report(moved: DesignProblem, create: Callable[[], LawDesign], value: float) -> None:
            nonlocal best_value
            if sign * value < best_value:
                best_value = sign * value
                self.on_best(lambda: self._compare_with_start(limits, moved, create()), value)

        def search_at(moved: DesignProblem, request: DesignRequest) -> DesignSearch:
            return replace(self, problem=moved, request=request, on_best=partial(report, moved))

        def value(moved: DesignProblem) -> float:
            return sign * search_at(moved, quick).best().goal.result

        search = EventSpans(self.problem, "dwells" in self.request.keep, spans, value)
        moved, multistart = search.best(self.request.multistart)
        best = replace(search_at(moved, others), spans=multistart).best()
        return self._compare_with_start(limits, moved, best)

    def _compare_with_start(
        self, limits: Sequence[Limit], moved: DesignProblem, design: LawDesign
    ) -> LawDesign:
        """Return a design with the values of the original start law for comparison.

        ``moved`` is the design problem with the event spans of ``design``. Values for the
        ``limits`` on spans are added. An event is the motion between two dwells.
        """
        goal, *others = design.measures
        other_limits, measures = iter(others), [replace(goal, bound=None)]
        for limit in limits:
            if limit.term.quantity.where != "event":
                measures.append(next(other_limits))
                continue
            assert limit.value is not None
            span = measured(moved, moved.start, limit.term, limit.sense)
            active = math.isclose(span, limit.value, rel_tol=SPAN_RTOL)
            measures.append(Measure(limit.term, limit.sense, span, span, None, limit.value, active))
        start = self.problem.start
        compared = tuple(
            replace(x, start=measured(self.problem, start, x.term, x.sense)) for x in measures
        )
        return replace(
            design, request=self.request, start=start, measures=compared, spans_bound=goal.bound
        )

    def with_values(self) -> DesignRequest:
        """Return the request of a design with numbers in place of ``start`` in its limits.

        An example is a limit such as ``peak_acceleration<=start``.
        """
        limits = (replace(limit, value=self._limit_value(limit)) for limit in self.request.limits)
        return replace(self.request, limits=tuple(limits))

    def _limit_value(self, limit: Limit) -> float:
        """Return the value of a limit, SI (levels in dB).

        A limit that refers to ``start`` has the value of the start law.
        """
        if limit.value is not None:
            return limit.value
        return measured(self.problem, self.problem.start, limit.term, limit.sense)

    def best(self) -> LawDesign:
        """Return the best law for the spans of the events that the problem has.

        An event is the motion between two dwells.
        """
        problem, request = self.problem, self.request
        limits = [
            scale_limit(problem, x.term, x.sense, self._limit_value(x)) for x in request.limits
        ]
        goal = scale_limit(problem, request.goal, request.sense, None)

        def report(unknowns: FloatArray, value: float) -> None:
            self.on_best(lambda: self._law_design(limits, BestLaw(unknowns)), value)

        local = any(rows_of(x.term).is_local(problem) for x in limits)
        if local or rows_of(goal.term).is_local(problem, True):
            best = local_best(problem, goal, limits, request.multistart, report)
        else:
            best = best_convex(problem, goal, limits, report)
        return self._law_design(limits, best)

    def _law_design(self, limits: list[ScaledLimit], best: BestLaw) -> LawDesign:
        problem, request = self.problem, self.request
        start, space, term, sense = problem.start, problem.space, request.goal, request.sense
        search = self.spans or best.multistart
        cam, text = designed_cam(problem, best.unknowns, self.name, request, limits, search)
        law = build_law(cam)
        start_value, result = (measured(problem, x, term, sense) for x in (start, law))
        bound = None if best.bound is None else rows_of(term).from_rows(problem, term, best.bound)
        if bound is not None and abs(bound - result) <= ROUNDING_RTOL * abs(start_value) < math.inf:
            sign = sign_of(sense)
            bound = sign * min(sign * bound, sign * result)
        pairs = zip(limits, request.limits, strict=True)
        others = (self._limit(law, target, limit, best) for target, limit in pairs)
        return LawDesign(
            request=request,
            start=start,
            law=law,
            cam=cam,
            text=text,
            rig=problem.rig,
            events=tuple(space.events),
            tops=tuple(angle for _, angle in space.turning_points),
            measures=(Measure(term, sense, start_value, result, bound), *others),
            rounds=best.rounds,
            multistart=search,
            interrupted=not best.rounds,
        )

    def _limit(self, law: Law, target: ScaledLimit, limit: Limit, best: BestLaw) -> Measure:
        quantity, allowed = limit.term.quantity, self._limit_value(limit)
        laws = self.problem.start, law
        start, result = (measured(self.problem, x, limit.term, limit.sense) for x in laws)
        excess = (result - allowed) * sign_of(limit.sense)
        if excess > BROKEN_RTOL * max(abs(allowed), abs(start)) and best.rounds:
            raise DesignError(
                f"the designed law does not satisfy {limit.words}: it has "
                f"{result / quantity.factor:.6g} {quantity.unit}; use a narrower range, or more "
                "pieces"
            )
        active = target.name in best.active
        return Measure(limit.term, limit.sense, start, result, limit=allowed, active=active)


class DesignOptions(TypedDict, total=False):
    """Keyword options of `design`, except ``pareto``.

    ``pareto`` is separate, because it selects the type of the result.
    """

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
    cam: Cam, rig: RequiredRig, *, pareto: None = ..., **options: Unpack[DesignOptions]
) -> LawDesign: ...
@overload
def design(
    cam: Cam, rig: RequiredRig, *, pareto: str, **options: Unpack[DesignOptions]
) -> Front: ...
@check_arguments
def design(
    cam: Cam,
    rig: RequiredRig,
    *,
    minimise: str | None = None,
    maximise: str | None = None,
    limits: Sequence[str] = (),
    pieces: int = 16,
    joints: int = 3,
    degree: int | None = None,
    starts: int = DEFAULT_STARTS,
    seed: int = 1,
    keep: Sequence[str] = KEEP[0],
    pareto: str | None = None,
    points: int = 25,
) -> LawDesign | Front:
    """Design the law that is best for a goal, with a B-spline in each event of a cam.

    The command is ``cam-rig design``. An event is the stretch of the turn between two dwells.
    Dwells, events and lift are kept. The bound is valid for the whole class of laws and comes from
    the multipliers of a convex program. A goal or limit that is not convex is searched for from
    several start laws, without a bound.

    Parameters
    ----------
    cam : Cam, str or Path
        Cam with the start law: its name in ``config/cams``, its path, or the object.
    rig : Rig, str or Path
        Rig: its name in ``config/rigs``, its path, or the object.
    minimise, maximise : str, optional
        Quantity to minimise or to maximise, as in `cam-rig design`. Exactly one of them is needed.
    limits : sequence of str, optional
        Limits such as ``"peak_acceleration<=start"`` or ``"lift@90deg>=30mm"``. The value ``start``
        is that of the start law.
    pieces : int, optional
        Number of polynomial pieces per event, 1 to 200 (default: 16).
    joints : int, optional
        Order k of continuity Cᵏ at the joints between pieces, 1 to 6 (default: 3).
    degree : int, optional
        Degree of the splines, up to 15 (default: ``joints`` + 2).
    starts : int, optional
        Number of start laws of a local search (default: 8).
    seed : int, optional
        Seed of its random start laws (default: 1). The same seed gives the same law.
    keep : sequence of str, optional
        Properties of the start law to keep: ``("events", "dwells", "lift")`` (default),
        ``("dwells", "lift")`` or ``("lift",)``. Without ``events`` the spans of the events are
        searched for.
    pareto : str, optional
        Other quantity of a Pareto front. The result is then a `Front`.
    points : int, optional
        Number of points of the front, 3 to 200 (default: 25).

    Returns
    -------
    LawDesign or Front
        Designed law with its bound, or the front if ``pareto`` is given.

    Raises
    ------
    ConfigError
        If a quantity or unit is unknown, or a goal or limit is not convex in this sense.
    DesignError
        If the class has no law that satisfies the limits, or the search found no law.
    MissingLibraryError
        If clarabel or highspy is not installed.

    Examples
    --------
    >>> import cam_rig
    >>> goal = {"minimise": "peak_acceleration", "joints": 1}
    >>> result = cam_rig.design("poly345", "paper_table2", **goal)
    >>> print(f"{result.goal.start:.4f} {result.goal.result:.4f} m/rad^2")
    0.0686 0.0476 m/rad^2
    """
    cam, rig = resolve_cam(cam), resolve_rig(rig, cam)
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


#: Smallest number of points (designs) of a Pareto front.
MIN_POINTS = 3
#: Largest number of points (designs) of a Pareto front.
MAX_POINTS = 200
#: Tolerance of the shortest and the longest span of a front over the span of an event (motion
#: between two dwells), as a fraction of the start law's span.
EDGE_TOLERANCE = 2e-3


def front(
    cam: CamConfig,
    rig: RigConfig,
    request: DesignRequest,
    other: Term,
    points: int,
    progress: Progress = NULL_PROGRESS,
) -> Front:
    """Compute a Pareto front: the best goal for each of several values of ``other``.

    The values range from the best value of the other quantity to the value at which it no longer
    limits the goal. If ``other`` is the span of an event, they cover all possible spans. ``points``
    is the number of values, 3 to 200. An event is the motion between two dwells.

    Raises
    ------
    ConfigError
        If the number of points is out of range, or both quantities have the same best law.
    DesignError
        If the class has no law that satisfies the limits, or the search found no law.
    """
    if not MIN_POINTS <= points <= MAX_POINTS:
        raise ConfigError(f"--points must be between {MIN_POINTS} and {MAX_POINTS}, got {points}")
    progress.start(points + 2, request.words)
    problem = _problem(cam, rig, request)
    if other.quantity.where == "event":
        return _over_spans(problem, request, other, points, progress)
    if other == request.goal:
        raise ConfigError(f"--pareto must be another quantity than the goal, got {other.key}")
    sense = other.quantity.senses[0]
    best_other = search_design(cam, rig, replace(request, goal=other, sense=sense))
    progress.advance()
    unlimited = search_design(cam, rig, request)
    progress.advance()
    best, last = best_other.goal.result, measured(problem, unlimited.law, other, sense)
    if (last - best) * sign_of(sense) <= 1e-9 * abs(best):
        raise ConfigError(
            f"--pareto: {other.key} and {request.goal.key} have the same best law, so there is no "
            "front; use two quantities that conflict"
        )

    def design_at(value: float) -> LawDesign:
        limits = (*request.limits, Limit(other, sense, value))
        return search_design(cam, rig, replace(request, limits=limits))

    # The first value is left out, because only the best law of the other quantity reaches it.
    return _compute_front(other, np.linspace(best, last, points + 1)[1:], design_at, progress)


def _compute_front(
    other: Term, allowed: FloatArray, design_at: Callable[[float], LawDesign], progress: Progress
) -> Front:
    """Return a front with one design per allowed value of the other quantity.

    Ctrl-C ends the computation, and the result then contains the designs so far.
    """
    designs: list[LawDesign] = []
    try:
        for value in allowed.tolist():
            designs.append(design_at(value))
            progress.advance()
    except KeyboardInterrupt:
        if not designs:
            raise
    values = tuple(allowed[: len(designs)].tolist())
    return Front(other, values, tuple(designs), allowed.size, len(designs) < allowed.size)


def _over_spans(
    problem: DesignProblem, request: DesignRequest, other: Term, points: int, progress: Progress
) -> Front:
    """Return a Pareto front over the span of one event (motion between two dwells).

    ``other`` is this span, and ``points`` the number of designs. For each design the spans of all
    events are scaled by the same factor, and each event keeps its middle.
    """
    if "events" not in request.keep:
        raise ConfigError(
            f"--pareto {other.key} cannot be combined with --keep, because the front sets the "
            "spans of the events"
        )
    search = DesignSearch(problem, request, f"{problem.cam.name}_designed")
    fixed, spans = search.with_values(), EventSpans(problem, False, [], lambda _: 0.0)
    span = measured(problem, problem.start, other, "<=")

    def design_at(factor: float) -> LawDesign:
        return replace(
            search, problem=spans.shift_events(factor * spans.start), request=fixed
        ).best()

    def has_law(factor: float) -> bool:
        with suppress(DesignError):
            design_at(factor)
            return True
        return False

    longest = _last_factor(lambda factor: spans.possible(factor * spans.start), 1.0, LONGEST)
    if not has_law(longest):
        design_at(longest)  # raises the error that states why there is no law
    progress.advance()
    shortest = _last_factor(has_law, longest, SHORTEST)
    progress.advance()
    allowed = np.linspace(shortest, longest, points) * span
    return _compute_front(other, allowed, lambda value: design_at(value / span), progress)


def _last_factor(condition: Callable[[float], bool], inside: float, outside: float) -> float:
    """Return the factor nearest to ``outside`` at which a condition is satisfied.

    The factor scales the spans of the events. ``condition`` must be True at the factor ``inside``.
    The tolerance is `EDGE_TOLERANCE`. An event is the motion between two dwells.
    """
    if condition(outside):
        return outside
    while abs(outside - inside) > EDGE_TOLERANCE:
        middle = 0.5 * (inside + outside)
        inside, outside = (middle, outside) if condition(middle) else (inside, middle)
    return inside
