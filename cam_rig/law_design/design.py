"""A design: the best law of a class by a goal, beside its start and the bound that proves it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

from cam_rig.arguments import checked
from cam_rig.errors import ConfigError, DesignError
from cam_rig.extras import libraries_named
from cam_rig.law_design.cam_file import designed_cam
from cam_rig.law_design.constraints import Asked, DesignProblem
from cam_rig.law_design.cutting_planes import Best, Solver
from cam_rig.law_design.local_search import EventSpans, LocalBest, LocalSearch, is_local
from cam_rig.law_design.measure import level_of, measured, rate_of
from cam_rig.law_design.request import KEEP, STARTS, DesignRequest, LawClass, Multistart
from cam_rig.law_design.space import Space
from cam_rig.law_design.tables import LawDesign, Measure
from cam_rig.law_design.terms import ORDERS, PEAKS, Limit, Sense, Term
from cam_rig.laws import Law, build_law
from cam_rig.laws.law import peak
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.show.result import notebook
from cam_rig.units import FloatArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

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


@dataclass(frozen=True)
class SoFar:
    """A law that a search has found on its way."""

    unknowns: FloatArray
    active: tuple[str, ...] = ()
    rounds: int = 0


def search_design(
    cam: CamConfig,
    rig: RigConfig,
    request: DesignRequest,
    name: str | None = None,
    on_best: OnBest = lambda _design, _value: None,
) -> LawDesign:
    """The best law of a class between the dwells of a cam.

    Parameters
    ----------
    name : of the new cam, by default the start's with ``_designed``
    on_best : told each better law, as what makes a design of it, and what the goal comes to (SI)
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
    problem: DesignProblem,
    request: DesignRequest,
    name: str,
    on_best: OnBest,
) -> LawDesign:
    """The best law whose events have the best spans, by a search of these."""
    asked = own_limits(problem, request)
    spans = [limit for limit in asked if limit.term.name == "event_angle"]
    others = replace(request, limits=tuple(limit for limit in asked if limit not in spans))
    quick = replace(others, multistart=replace(request.multistart, starts=1))
    sign, best = 1.0 if request.sense == "<=" else -1.0, math.inf

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
    measures += [_span(moved, x) if x.term.name == "event_angle" else next(limited) for x in asked]
    measures = [
        replace(x, start=measured(problem, problem.start, x.term, x.sense)) for x in measures
    ]
    return replace(
        found,
        request=request,
        start=problem.start,
        measures=tuple(measures),
        spans_bound=goal.bound,
    )


def own_limits(problem: DesignProblem, request: DesignRequest) -> list[Limit]:
    """The limits with the start's values, which stay where its events move."""
    return [replace(limit, value=_value(problem, limit)) for limit in request.limits]


def _span(moved: DesignProblem, limit: Limit) -> Measure:
    """A limit on an event's span; ``start`` is not yet the start's."""
    assert limit.value is not None
    span = measured(moved, moved.start, limit.term, limit.sense)
    met = math.isclose(span, limit.value, rel_tol=SPAN_MET)
    return Measure(limit.term, limit.sense, span, span, None, limit.value, met)


def design_problem(
    problem: DesignProblem,
    request: DesignRequest,
    name: str,
    on_best: OnBest,
    search: Multistart | None = None,
) -> LawDesign:
    """The best law with the events that a problem has; ``search`` is what they were found by."""
    limits = [_asked(problem, x.term, x.sense, _value(problem, x)) for x in request.limits]
    goal = _asked(problem, request.goal, request.sense, None)

    def told(unknowns: FloatArray, value: float) -> None:
        on_best(lambda: made(SoFar(unknowns)), value)

    def made(best: Best | LocalBest | SoFar) -> LawDesign:
        return _law_design(problem, request, name, limits, best, search)

    best: Best | LocalBest
    if is_local(problem, goal.term, True) or any(is_local(problem, x.term) for x in limits):
        best = LocalSearch(problem, goal, limits, request.multistart, told).best()
    else:
        best = _solve(problem, goal, limits, told)
    return made(best)


def _law_design(
    problem: DesignProblem,
    request: DesignRequest,
    name: str,
    limits: list[Asked],
    best: Best | LocalBest | SoFar,
    search: Multistart | None,
) -> LawDesign:
    """A law with all that was asked of it."""
    start, space, rig = problem.start, problem.space, problem.rig
    if search is None and isinstance(best, LocalBest):
        search = best.multistart
    file = designed_cam(problem, best.unknowns, name, request.verb, request.goal, limits, search)
    law = build_law(file.cam)
    measures = [_goal(problem, request, law, best)]
    measures += [
        _limit(problem, law, asked, limit, best)
        for asked, limit in zip(limits, request.limits, strict=True)
    ]
    events, tops = tuple(space.events), tuple(angle for _, angle in space.turning_points)
    texts = file.cam, file.text, rig
    rounds, ended = best.rounds, not isinstance(best, SoFar)
    return LawDesign(
        request, start, law, *texts, events, tops, tuple(measures), rounds, search, ended=ended
    )


def _solve(
    problem: DesignProblem,
    goal: Asked,
    limits: list[Asked],
    told: Callable[[FloatArray, float], None],
) -> Best:
    def shown(unknowns: FloatArray, value: float) -> None:
        told(unknowns, _shown(problem, goal.term, value))

    best = Solver(problem, goal, limits, shown).best()
    if goal.sense == "<=" and 0.0 < best.value < SMALL * goal.scale:
        goal = Asked(goal.term, goal.sense, None, best.value / SMALL)  # for more digits
        with suppress(DesignError):  # then the first stands alone
            again = Solver(problem, goal, limits, shown).best()
            law = min(best, again, key=lambda found: found.value)
            best = replace(
                law, bound=max(best.bound, again.bound), rounds=best.rounds + again.rounds
            )
    return best


def _value(problem: DesignProblem, limit: Limit) -> float:
    """What a limit allows, SI; the level in dB."""
    if limit.value is not None:
        return limit.value
    return measured(problem, problem.start, limit.term, limit.sense)


def _asked(problem: DesignProblem, term: Term, sense: Sense, value: float | None) -> Asked:
    """A goal or a limit in the units of its rows, and what they are measured by."""
    if value is not None and term.name == "sound_level_rigid":
        value = rate_of(problem, term, value)
        if value <= 0.0:
            raise ConfigError(f"limit {term.key}: the background alone is as loud")
    if value is not None and not math.isfinite(value):
        raise ConfigError(f"limit {term.key}: the start has none; allowed: a number")
    scale = _scale(problem, term, sense)
    if not (math.isfinite(scale) and scale > 0.0):  # a start without that quantity
        scale = 1.0 if value is None else abs(value) or 1.0
    return Asked(term, sense, value, scale)


def _scale(problem: DesignProblem, term: Term, sense: Sense) -> float:
    start = problem.start
    if term.name in PEAKS or term.name in ORDERS:
        order = PEAKS[term.name] if term.name in PEAKS else ORDERS[term.name]
        return start.lift if order == 0 else abs(peak(start, order).value)
    if term.name in ("pressure_angle", "radius_of_curvature"):
        return start.lift
    if term.name.endswith("contact_force_rigid"):
        return problem.force_scale
    if term.name.startswith("jump_speed"):
        return 1.0
    found = measured(problem, start, term, sense)
    return rate_of(problem, term, found) if term.name == "sound_level_rigid" else found


def _shown(problem: DesignProblem, term: Term, value: float) -> float:
    """A goal's value as it is shown: rows have the root of a mean square for a level."""
    return level_of(problem, term, value) if term.name == "sound_level_rigid" else value


def _goal(
    problem: DesignProblem, request: DesignRequest, law: Law, best: Best | LocalBest | SoFar
) -> Measure:
    term, sense = request.goal, request.sense
    start, result = (measured(problem, x, term, sense) for x in (problem.start, law))
    bound = _shown(problem, term, best.bound) if isinstance(best, Best) else None
    return Measure(term, sense, start, result, bound)


def _limit(
    problem: DesignProblem,
    law: Law,
    asked: Asked,
    limit: Limit,
    best: Best | LocalBest | SoFar,
) -> Measure:
    start = measured(problem, problem.start, limit.term, limit.sense)
    result, allowed = measured(problem, law, limit.term, limit.sense), _value(problem, limit)
    over = (result - allowed) * (1.0 if limit.sense == "<=" else -1.0)
    if over > BROKEN * max(abs(allowed), abs(start)) and not isinstance(best, SoFar):
        raise DesignError(
            f"the law found breaks {limit.words}: it has "
            f"{result / limit.term.quantity.shown:.6g} {limit.term.quantity.unit}; allowed: a "
            "narrower range, or more pieces"
        )
    active = asked.name in best.active
    return Measure(limit.term, limit.sense, start, result, limit=allowed, active=active)


# The best law of a class between a cam's dwells, and the bound that proves it.


@dataclass(frozen=True, eq=False, repr=False)
class DesignedLaw(LawDesign):
    """A designed law: ``law``, ``cam``, the ``text`` of its file, and ``measures``, goal first."""

    def __repr__(self) -> str:
        """The goal, from start to result, and its bound."""
        goal = self.goal
        factor, unit = goal.term.quantity.shown, goal.term.quantity.unit
        bound = "local" if goal.bound is None else f"bound {goal.bound / factor:.4g}"
        start, result = goal.start / factor, goal.result / factor
        return f"DesignedLaw({self.request.words}: {start:.4g} → {result:.4g} {unit}, {bound})"

    def to_pandas(self) -> DataFrame:
        """A row for the goal and for each limit, SI (levels in dB)."""
        with libraries_named():
            from pandas import DataFrame
        keys = ("start", "result", "bound", "limit", "active")
        rows = [
            {"quantity": measure.term.key} | {key: getattr(measure, key) for key in keys}
            for measure in self.measures
        ]
        return DataFrame(rows)

    def plot(self) -> Figure:
        """Start and result: derivatives, contact force, contour."""
        with libraries_named():
            from cam_rig.law_design.figures import figure
        return notebook(figure(self))


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
) -> DesignedLaw:
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
    return DesignedLaw(**vars(search_design(cam, rig, request)))
