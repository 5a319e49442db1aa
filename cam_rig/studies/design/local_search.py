"""Local searches of a design: for the spans of the events, and from several laws.

The best law for given spans of the events is a design by itself, convex if possible. The spans are
searched for with the simplex method of Nelder and Mead from several start points. If the dwells
keep their lengths, the events share the remaining angle. Otherwise each event keeps its middle, and
the dwells take the remaining angle. An event at 0 or at 2π keeps that end instead.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from scipy import sparse
from scipy.optimize import brentq, minimize

from cam_rig.errors import ConfigError, DesignError
from cam_rig.laws import Law
from cam_rig.quantities.catalogue import DESIGN_QUANTITIES
from cam_rig.quantities.terms import Limit, Term
from cam_rig.studies.design.convex_program import Affine, ConvexProgram
from cam_rig.studies.design.cutting_planes import BestLaw, OnBetterLaw, RowSource, Solver
from cam_rig.studies.design.descent import (
    FEASIBLE_RTOL,
    Descent,
    Iterate,
    LocalTerm,
    PointwiseTerm,
    ValueTerm,
)
from cam_rig.studies.design.request import MULTISTART_RTOL, Multistart
from cam_rig.studies.design.rows import add, rows_of
from cam_rig.studies.design.space import DesignProblem, ScaledLimit, Space, measured
from cam_rig.units import TURN, FloatArray

#: Default lower limit of the span of an event (motion between two dwells), if the design may change
#: spans. It is a multiple of the span in the start law.
SHORTEST = 0.5
#: Default upper limit of the span of an event (motion between two dwells), if the design may change
#: spans. It is a multiple of the span in the start law.
LONGEST = 2.0
#: Shortest length (rad of cam angle) of a dwell when the motions between the dwells become longer.
MIN_DWELL = 1e-3
#: Tolerance at which the Nelder-Mead search for the spans of the events (motions between two
#: dwells) ends, rad.
SPAN_ATOL = 5e-4
#: Tolerance of the goal at which the Nelder-Mead search for the spans of the events (motions
#: between two dwells) ends, relative to the first value of the goal.
GOAL_RTOL = 1e-5
#: Resolution of the span of an event (motion between two dwells) in degrees: every span in a cam
#: file is a whole multiple of it.
STEP_DEG = 1e-4
#: Largest number of designs that one Nelder-Mead search computes, per span that it varies.
MAX_DESIGNS = 30
#: If no law exists for randomly chosen spans of the events (motions between two dwells), the spans
#: are moved halfway to the allowed spans nearest to those of the start law. This is the largest
#: number of such moves.
MAX_HALVINGS = 4


@dataclass(eq=False)
class EventSpans:
    """Search for the spans of the events (rad) whose best law has the best goal.

    An event is the stretch of the turn between two dwells. ``limits`` are limits on the spans.
    ``value`` returns the goal of the best law of a problem, with the sign with which it is
    minimised. If ``keep_dwells``, the dwells keep their lengths.
    """

    problem: DesignProblem
    keep_dwells: bool
    limits: list[Limit]
    value: Callable[[DesignProblem], float]
    _values: dict[tuple[float, ...], float] = field(default_factory=dict)
    _last_error: str = "the dwells are too short"

    def __post_init__(self) -> None:
        events = self.problem.space.events
        self.start = np.array([event.span for event in events])
        if self.keep_dwells and len(events) == 1:
            raise ConfigError(
                "--keep dwells,lift requires a cam with two or more events, got "
                f"{self.problem.cam.name!r} with one; use --keep lift or events,dwells,lift"
            )
        for number, event in enumerate(events, 1):
            if any((*event.first[1:], *event.last[1:])):
                raise ConfigError(
                    f"--keep: event {number} of {self.problem.cam.name!r} must start and end at "
                    "rest; use --keep events,dwells,lift"
                )
        self.low, self.high = SHORTEST * self.start, LONGEST * self.start
        for limit in self.limits:
            assert limit.value is not None
            # raises a `ConfigError` if the event does not exist
            measured(self.problem, self.problem.start, limit.term, limit.sense)
            bounds = self.low if limit.sense == ">=" else self.high
            bounds[limit.term.event - 1] = limit.value
        self.base = self._base()
        #: Number of spans of events (motions between two dwells) that are searched for. If the
        #: dwells keep their lengths, the last span follows from the others.
        self.size = self.start.size - self.keep_dwells

    def _base(self) -> FloatArray:
        """Return the allowed event spans (rad) that are nearest to those of the start law.

        The random start points of the search are chosen around them. An event is the motion between
        two dwells.
        """

        def total(change: float) -> float:
            return float(np.clip(self.start + change, self.low, self.high).sum() - self.start.sum())

        change, largest = 0.0, float(np.abs(self.high - self.low).max() + self.start.max())
        if self.keep_dwells and total(-largest) <= 0.0 <= total(largest):
            change = float(brentq(total, -largest, largest, xtol=1e-14))
        spans = self._rounded(np.clip(self.start + change, self.low, self.high))
        if not self.possible(spans):
            raise ConfigError(
                "no spans of the events satisfy the limits on event_angle with these dwells; use "
                "looser limits"
            )
        return spans

    def _rounded(self, spans: FloatArray) -> FloatArray:
        """Return spans (rad) of events rounded to the resolution `STEP_DEG` of a cam file.

        If the dwells are kept, the sum of the spans must not change, so the last span follows from
        the others. An event is the motion between two dwells.
        """
        step = np.radians(STEP_DEG)
        rounded = step * np.rint(spans / step)
        if self.keep_dwells:
            rounded[-1] = self.start.sum() - rounded[:-1].sum()
        return np.asarray(rounded)

    def possible(self, spans: FloatArray) -> bool:
        """Return True if the limits and the dwells allow these spans (rad) of the events.

        A dwell of the start law must not become shorter than `MIN_DWELL`. An event is the motion
        between two dwells.
        """
        slack = np.radians(STEP_DEG)
        if (spans < self.low - slack).any() or (spans > self.high + slack).any():
            return False
        dwells = np.diff(self._edges(spans))[::2]
        # lengths of the dwells before, between and after the events
        start_dwells = np.diff(self._edges(self.start))[::2]
        return self.keep_dwells or bool((dwells >= np.where(start_dwells, MIN_DWELL, 0.0)).all())

    def _edges(self, spans: FloatArray) -> FloatArray:
        """Return the ends of all events and of the turn (rad) for given spans.

        They are 0, the start and end of each event in order, and 2π. An event is the motion between
        two dwells.
        """
        events = self.problem.space.events
        starts = np.array([event.start for event in events])
        if self.keep_dwells:
            starts = starts + np.concatenate([[0.0], np.cumsum(spans - self.start)[:-1]])
        else:  # An event grows equally on both sides, but at an end of the turn on one side only.
            before = np.full(len(events), 0.5)
            before[0] *= starts[0] != 0.0
            if starts[-1] + self.start[-1] == TURN:
                before[-1] = 1.0
            starts = starts + before * (self.start - spans)
        ends = np.stack([starts, starts + spans], axis=1).ravel()
        return np.concatenate([[0.0], ends, [TURN]])

    def shift_events(self, spans: FloatArray) -> DesignProblem:
        """Return the design problem with the given spans (rad) of the events.

        The start law is stretched to these spans. An event is the motion between two dwells.
        """
        start = self.problem.start
        breaks = np.interp(start.breaks, self._edges(self.start), self._edges(spans))
        breaks[-1] = TURN
        law = Law(start.name, breaks, start.ordinates)
        space = Space(law, self.problem.space.law_class)
        free = ("events",) if self.keep_dwells else ("events", "dwells")
        return replace(self.problem, start=law, space=space, free=free)

    def _spans(self, unknowns: FloatArray) -> FloatArray:
        return self._rounded(np.append(unknowns, 0.0) if self.keep_dwells else unknowns)

    def _value(self, unknowns: FloatArray) -> float:
        """Return the goal of the best law for given event spans, or ∞ if there is no law.

        The goal has the sign with which it is minimised. ``unknowns`` are the spans (rad) of the
        events, without the last if the dwells keep their lengths. An event is the motion between
        two dwells.
        """
        spans = self._spans(unknowns)
        key = tuple(spans.tolist())
        if key not in self._values:
            self._values[key] = np.inf
            if self.possible(spans):
                try:
                    self._values[key] = self.value(self.shift_events(spans))
                except DesignError as error:  # there may be a law at other spans
                    self._last_error = str(error)
                    return np.inf
        return self._values[key]

    def best(self, search: Multistart) -> tuple[DesignProblem, Multistart]:
        """Return the design problem with the best event spans, and the search options.

        The options are those of ``search``, completed with the number of start points from which
        the search reached the best goal within the relative tolerance `MULTISTART_RTOL`. An event
        is the motion between two dwells.
        """
        size = self.size
        bounds = list(zip(self.low[:size], self.high[:size], strict=True))
        ends = []
        for start in self._start_spans(search):
            first = self._value(start)
            if np.isfinite(first):
                result = minimize(
                    self._value,
                    start,
                    method="Nelder-Mead",
                    bounds=bounds,
                    options={
                        "xatol": SPAN_ATOL,
                        "fatol": GOAL_RTOL * abs(first),
                        "maxfev": MAX_DESIGNS * size,
                    },
                )
                ends.append((float(result.fun), result.x))
        if not ends:
            raise DesignError(
                "no law was found at any of the spans of the events; the last error was: "
                f"{self._last_error}"
            )
        value, unknowns = min(ends, key=lambda pair: pair[0])
        near = sum(goal <= value + MULTISTART_RTOL * abs(value) for goal, _ in ends)
        return self.shift_events(self._spans(unknowns)), replace(search, starts_agreeing=near)

    def _start_spans(self, search: Multistart) -> Iterator[FloatArray]:
        """Yield the spans of the events (rad) from which the searches start.

        The first are the allowed spans nearest to those of the start law. Random spans follow.
        Random spans at which no law was found are moved towards the first spans. An event is the
        motion between two dwells.
        """
        random, size = np.random.default_rng(search.seed), self.size
        yield self.base[:size]
        for _ in range(search.starts - 1):
            change = random.uniform(self.low, self.high) - self.base
            if self.keep_dwells:
                change -= change.mean()
            while not self.possible(spans := self._rounded(self.base + change)):
                change *= 0.7
            for _ in range(MAX_HALVINGS):
                if np.isfinite(self._value(spans[:size])):
                    break
                change *= 0.5
                spans = self._rounded(self.base + change)
            yield spans[:size]


# Local search from several start laws, which are reproducible by their seed.

#: Convex goals whose best laws are used as start laws of local searches.
GOALS = ("rms_acceleration", "peak_velocity")
#: Smallest distance of a random start law from the start law of least RMS acceleration, as a
#: fraction of the way to a random extreme law of the class.
MIN_FRACTION = 0.2
#: Largest distance of a random start law from the start law of least RMS acceleration: s'' may
#: change by at most this multiple of the largest |s''| of the latter.
MAX_GROWTH = 3.0


def _starts(solver: Solver, sources: list[RowSource], search: Multistart) -> Iterator[FloatArray]:
    """Yield the unknowns of the laws from which local searches start.

    They satisfy the convex limits of the solver and the inequalities of the sources. The first is
    the law nearest to the start law of the design. Then come the best laws for `GOALS`, and random
    laws.
    """
    problem, space = solver.problem, solver.problem.space
    lift = problem.start.lift

    def best(add_goal: Callable[[ConvexProgram], None]) -> FloatArray:
        program = solver.static_program(True)
        add_goal(program)
        return solver.solve_in_rounds(program, sources).unknowns

    def nearest(program: ConvexProgram) -> None:
        """Set the goal of a program: the law nearest to the start law of the design.

        The distance is the root of the summed squared differences of the lift.
        """
        u = np.linspace(0.0, 1.0, space.parts + 1)
        angles = (space.breaks[:-1, None] + u * space.spans[:, None]).ravel()
        lifts = problem.start(np.minimum(angles, space.breaks[-1]))
        distance = space.points(space.derivative(0)).plus(-lifts)
        program.within("start", distance * (1.0 / lift), weight=-1.0)

    def farthest(program: ConvexProgram) -> None:
        """Set the goal of a program: the law farthest in a random direction.

        The direction is a random vector in the space of the free B-spline ordinates.
        """
        direction = np.zeros((1, space.unknowns))
        direction[0, : space.free] = random.normal(size=space.free) / np.sqrt(space.free)
        rows = Affine(np.zeros(1), sparse.csr_array(direction))
        program.at_least("direction", rows, -1.0)

    yield best(nearest)
    random = np.random.default_rng(search.seed)
    goals = [
        ScaledLimit(Term(DESIGN_QUANTITIES[x]), "<=", None, lift)
        for x in GOALS[: search.starts - 1]
    ]
    convex = [best(partial(add, problem=problem, target=goal, sufficient=True)) for goal in goals]
    yield from convex
    second = space.derivative(2)
    for _ in range(search.starts - 1 - len(convex)):
        step = best(farthest) - convex[0]
        limit = np.abs(second(convex[0])).max() / np.abs(second.matrix @ step).max()
        yield (convex[0] + random.uniform(MIN_FRACTION, 1.0) * min(1.0, MAX_GROWTH * limit) * step)


def _local_term(problem: DesignProblem, target: ScaledLimit) -> LocalTerm:
    rows = rows_of(target.term)
    if rows.branches is None:
        return ValueTerm(problem, target)
    branches, allowed = rows.branches(problem, target.term), math.nan
    if target.value is not None:
        allowed = rows.on_branches(problem, target.term, target.value)
    term = PointwiseTerm(problem, target.name, branches, allowed)
    if term.dwell_value > allowed + FEASIBLE_RTOL * term.scale:
        raise DesignError(
            f"limit {target.name}: a dwell of {problem.start.name!r} exceeds it for every law; "
            "use a looser limit"
        )
    return term


def local_best(
    problem: DesignProblem,
    goal: ScaledLimit,
    limits: list[ScaledLimit],
    search: Multistart,
    on_best: OnBetterLaw,
) -> BestLaw:
    """Return the best law of local searches from several start laws.

    It has no bound. ``on_best`` is called with the unknowns and the goal's value (SI) of each
    better law.

    Raises
    ------
    ConfigError
        If the goal is a jump speed of two masses, which cannot be combined with local limits.
    DesignError
        If no law was found that satisfies the limits.
    """
    convex = [limit for limit in limits if not rows_of(limit.term).is_local(problem)]
    solver, rows = Solver(problem, goal, convex), rows_of(goal.term)
    local_goal = _local_term(problem, goal) if rows.is_local(problem, True) else goal
    if rows.run is not None and not rows.run.rigid and problem.two_masses:
        raise ConfigError(
            f"goal {goal.term.key}: cannot be combined with a limit that is not convex; use it "
            "as a limit, such as jump_speed>=450rpm, or the goal jump_speed_rigid"
        )
    local = [_local_term(problem, limit) for limit in limits if limit not in convex]
    best_goal = np.inf

    def report_if_better(iterate: Iterate) -> None:
        nonlocal best_goal
        if iterate.goal < best_goal:
            best_goal = iterate.goal
            law = problem.space.law(iterate.unknowns, "design")
            on_best(iterate.unknowns, measured(problem, law, goal.term, goal.sense))

    sources = solver.row_sources(True)
    descent = Descent(solver, local_goal, local, sources, report_if_better)
    ends = [descent.run(x) for x in _starts(solver, sources, search)]
    feasible = [end for end in ends if end.violation <= FEASIBLE_RTOL]
    if not feasible:
        nearest = min(ends, key=lambda end: end.violation)
        raise DesignError(
            f"no law was found that satisfies {' and '.join(limit.name for limit in local)}, from "
            f"{search.starts} starts: the nearest exceeds a limit by "
            f"{100.0 * nearest.violation:.2g} %; use looser limits, more starts or more pieces"
        )
    best = min(feasible, key=lambda end: end.goal)
    count = sum(end.goal <= best.goal + MULTISTART_RTOL * abs(best.goal) for end in feasible)
    result = BestLaw(best.unknowns, active=best.active, rounds=solver.rounds)
    return replace(result, multistart=replace(search, starts_agreeing=count))
