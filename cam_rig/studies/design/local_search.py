"""Event angles as unknowns: the best law for some spans is a design of its own, and spans are few.

For given spans the design is the one of `design`, convex where it is; the spans are searched by
simplexes from several places. Dwells keep their lengths and the events share what is left, or
events keep their middles (one at the turn's start or end keeps that) and the dwells have what
they leave.
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
from cam_rig.quantities.catalogue import DESIGNED
from cam_rig.quantities.terms import Limit, Term
from cam_rig.studies.design.convex_program import Affine, ConvexProgram
from cam_rig.studies.design.cutting_planes import Best, Cuts, Solver, Told
from cam_rig.studies.design.descent import KEPT, Descent, LocalTerm, Place, PointwiseTerm, ValueTerm
from cam_rig.studies.design.request import SAME, Multistart
from cam_rig.studies.design.rows import add, rows_of
from cam_rig.studies.design.space import Asked, DesignProblem, Space, measured
from cam_rig.units import TURN, FloatArray

#: A span is at least and at most so many times the start's, where no limit says otherwise.
SHORTEST, LONGEST = 0.5, 2.0
#: A dwell that gives way keeps so much (rad); a search ends where spans (rad) and goal (in parts
#: of it) are within so much; spans are whole multiples of the last (degrees).
LEAST_DWELL, NEAR, LEVEL, STEP_DEG = 1e-3, 5e-4, 1e-5, 1e-4
#: Designs of one descent, at most, for each span that is free.
DESIGNS = 30
#: Spans without a law are halved so often towards those nearest to the start's.
NEARER = 4


@dataclass(eq=False)
class EventSpans:
    """The spans (rad) that the events of a problem may have, and their search."""

    problem: DesignProblem
    keep_dwells: bool
    limits: list[Limit]
    value: Callable[[DesignProblem], float]
    _known: dict[tuple[float, ...], float] = field(default_factory=dict)
    _why: str = "no room for them"

    def __post_init__(self) -> None:
        events = self.problem.space.events
        self.start = np.array([event.span for event in events])
        if self.keep_dwells and len(events) == 1:
            raise ConfigError(
                f"keep: {self.problem.cam.name!r} has one event, whose span is what the dwells "
                "leave; allowed: lift alone, or events,dwells,lift"
            )
        for number, event in enumerate(events, 1):
            if any((*event.first[1:], *event.last[1:])):
                raise ConfigError(
                    f"keep: event {number} of {self.problem.cam.name!r} does not begin and end at "
                    "rest; allowed: events,dwells,lift"
                )
        self.low, self.high = SHORTEST * self.start, LONGEST * self.start
        for limit in self.limits:
            assert limit.value is not None
            measured(self.problem, self.problem.start, limit.term, limit.sense)  # there is one
            own = self.low if limit.sense == ">=" else self.high
            own[limit.term.event - 1] = limit.value
        self.base = self._base()
        #: Spans that are unknown: where dwells stay the last is what the others leave.
        self.size = self.start.size - self.keep_dwells

    def _base(self) -> FloatArray:
        """The spans that limits allow, nearest to the start's."""

        def total(more: float) -> float:
            return float(np.clip(self.start + more, self.low, self.high).sum() - self.start.sum())

        more, most = 0.0, float(np.abs(self.high - self.low).max() + self.start.max())
        if self.keep_dwells and total(-most) <= 0.0 <= total(most):
            more = float(brentq(total, -most, most, xtol=1e-14))
        found = self._rounded(np.clip(self.start + more, self.low, self.high))
        if not self.possible(found):
            raise ConfigError(
                "limits on event_angle: no spans of events keep them and the dwells; allowed: "
                "looser limits"
            )
        return found

    def _rounded(self, spans: FloatArray) -> FloatArray:
        """As a file has them; the last one is what the others leave where dwells stay."""
        step = np.radians(STEP_DEG)
        found = step * np.rint(spans / step)
        if self.keep_dwells:
            found[-1] = self.start.sum() - found[:-1].sum()
        return np.asarray(found)

    def possible(self, spans: FloatArray) -> bool:
        """Whether limits and dwells leave these spans (rad)."""
        slack = np.radians(STEP_DEG)
        if (spans < self.low - slack).any() or (spans > self.high + slack).any():
            return False
        rests = np.diff(self._edges(spans))[::2]
        own = np.diff(self._edges(self.start))[::2]  # dwells before, between and behind the events
        return self.keep_dwells or bool((rests >= np.where(own, LEAST_DWELL, 0.0)).all())

    def _edges(self, spans: FloatArray) -> FloatArray:
        """The turn's start, both ends of each event in turn, and the turn's end (rad)."""
        events = self.problem.space.events
        begin = np.array([event.start for event in events])
        if self.keep_dwells:
            begin = begin + np.concatenate([[0.0], np.cumsum(spans - self.start)[:-1]])
        else:  # half of an event's growth is before it, and none at the turn's ends
            before = np.full(len(events), 0.5)
            before[0] *= begin[0] != 0.0
            if begin[-1] + self.start[-1] == TURN:
                before[-1] = 1.0
            begin = begin + before * (self.start - spans)
        ends = np.stack([begin, begin + spans], axis=1).ravel()
        return np.concatenate([[0.0], ends, [TURN]])

    def moved(self, spans: FloatArray) -> DesignProblem:
        """The problem with these spans."""
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
        """What is to be small; infinite where no law was found."""
        spans = self._spans(unknowns)
        key = tuple(spans.tolist())
        if key not in self._known:
            self._known[key] = np.inf
            if self.possible(spans):
                try:
                    self._known[key] = self.value(self.moved(spans))
                except DesignError as error:  # no law at these spans; at others there may be
                    self._why = str(error)
                    return np.inf
        return self._known[key]

    def best(self, asked: Multistart) -> tuple[DesignProblem, Multistart]:
        """The problem with the best spans, and how many of the searches came to the same."""
        size = self.size
        bounds = list(zip(self.low[:size], self.high[:size], strict=True))
        found = []
        for place in self._places(asked):
            first = self._value(place)
            if np.isfinite(first):
                end = minimize(
                    self._value,
                    place,
                    method="Nelder-Mead",
                    bounds=bounds,
                    options={"xatol": NEAR, "fatol": LEVEL * abs(first), "maxfev": DESIGNS * size},
                )
                found.append((float(end.fun), end.x))
        if not found:
            raise DesignError(
                f"no spans of events that were tried have a law; of the last: {self._why}"
            )
        value, unknowns = min(found, key=lambda pair: pair[0])
        same = sum(other <= value + SAME * abs(value) for other, _ in found)
        return self.moved(self._spans(unknowns)), replace(asked, near=same)

    def _places(self, asked: Multistart) -> Iterator[FloatArray]:
        """Unknowns to begin from: spans nearest to the start's, and random ones that have a law."""
        random, size = np.random.default_rng(asked.seed), self.size
        yield self.base[:size]
        for _ in range(asked.starts - 1):
            way = random.uniform(self.low, self.high) - self.base
            if self.keep_dwells:
                way -= way.mean()
            while not self.possible(place := self._rounded(self.base + way)):
                way *= 0.7
            for _ in range(NEARER):
                if np.isfinite(self._value(place[:size])):
                    break
                way *= 0.5
                place = self._rounded(self.base + way)
            yield place[:size]


# The best of several descents: a seeded multistart, the same for the same seed.

#: Convex goals whose best laws are started from.
GOALS = ("rms_acceleration", "peak_velocity")
#: A random law is on the way from the first of these to a random corner of the class: at least so
#: far, at most so far as s'' grows by so many times its largest.
LEAST_WAY, CURVED = 0.2, 3.0


def _starts(solver: Solver, cuts: list[Cuts], asked: Multistart) -> Iterator[FloatArray]:
    """Unknowns of laws that keep the solver's limits and what is cut, as many as are asked for."""
    problem, space = solver.problem, solver.problem.space
    lift = problem.start.lift

    def best(add_goal: Callable[[ConvexProgram], None]) -> FloatArray:
        program = solver.static(True)
        add_goal(program)
        return solver.settled(program, cuts).unknowns

    def nearest(program: ConvexProgram) -> None:
        """To the start's lift, in mean square."""
        u = np.linspace(0.0, 1.0, space.parts + 1)
        angles = (space.breaks[:-1, None] + u * space.spans[:, None]).ravel()
        own = problem.start(np.minimum(angles, space.breaks[-1]))
        apart = space.points(space.derivative(0)).plus(-own)
        program.within("start", apart * (1.0 / lift), weight=-1.0)

    def farthest(program: ConvexProgram) -> None:
        """In a random direction of the ordinates."""
        direction = np.zeros((1, space.unknowns))
        direction[0, : space.free] = random.normal(size=space.free) / np.sqrt(space.free)
        rows = Affine(np.zeros(1), sparse.csr_array(direction))
        program.at_least("direction", rows, -1.0)

    yield best(nearest)
    random = np.random.default_rng(asked.seed)
    goals = [Asked(Term(DESIGNED[goal]), "<=", None, lift) for goal in GOALS[: asked.starts - 1]]
    convex = [best(partial(add, problem=problem, asked=goal, hull=True)) for goal in goals]
    yield from convex
    second = space.derivative(2)
    for _ in range(asked.starts - 1 - len(convex)):
        way = best(farthest) - convex[0]
        most = np.abs(second(convex[0])).max() / np.abs(second.matrix @ way).max()
        yield convex[0] + random.uniform(LEAST_WAY, 1.0) * min(1.0, CURVED * most) * way


def _local_term(problem: DesignProblem, asked: Asked) -> LocalTerm:
    rows = rows_of(asked.term)
    if rows.branches is None:
        return ValueTerm(problem, asked)
    branches, allowed = rows.branches(problem, asked.term), math.nan
    if asked.value is not None:
        allowed = rows.on_branches(problem, asked.term, asked.value)
    found = PointwiseTerm(problem, asked.name, branches, allowed)
    if found.at_rest > allowed + KEPT * found.scale:
        raise DesignError(
            f"limit {asked.name}: a dwell of {problem.start.name!r} breaks it, whatever "
            "the law; allowed: a looser limit"
        )
    return found


def local_best(
    problem: DesignProblem, goal: Asked, limits: list[Asked], asked: Multistart, on_best: Told
) -> Best:
    """The best law of all descents; ``on_best`` is told better ones, with the goal's value (SI)."""
    convex = [limit for limit in limits if not rows_of(limit.term).is_local(problem)]
    solver, rows = Solver(problem, goal, convex), rows_of(goal.term)
    own = _local_term(problem, goal) if rows.is_local(problem, True) else goal
    if rows.run is not None and not rows.run.rigid and problem.two_masses:
        raise ConfigError(
            f"goal {goal.term.key}: stands beside a limit that is not convex; allowed: it "
            "as a limit, such as jump_speed>=450rpm, or the goal jump_speed_rigid"
        )
    local = [_local_term(problem, limit) for limit in limits if limit not in convex]
    least = np.inf

    def told(place: Place) -> None:
        nonlocal least
        if place.goal < least:
            least = place.goal
            law = problem.space.law(place.unknowns, "design")
            on_best(place.unknowns, measured(problem, law, goal.term, goal.sense))

    cuts = solver.cuts(True)
    descent = Descent(solver, own, local, cuts, told)
    ends = [descent.run(x) for x in _starts(solver, cuts, asked)]
    kept = [end for end in ends if end.over <= KEPT]
    if not kept:
        nearest = min(ends, key=lambda end: end.over)
        raise DesignError(
            f"no law was found that keeps {' and '.join(limit.name for limit in local)}, from "
            f"{asked.starts} starts: the nearest is over by {100.0 * nearest.over:.2g} %; allowed: "
            "looser limits, more starts or more pieces"
        )
    best = min(kept, key=lambda end: end.goal)
    near = sum(end.goal <= best.goal + SAME * abs(best.goal) for end in kept)
    found = Best(best.unknowns, active=best.active, rounds=solver.rounds)
    return replace(found, multistart=replace(asked, near=near))
