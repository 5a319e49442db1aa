"""A design: the best law of a class by a goal, beside its start and the bound that proves it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field

from cam_rig.arrays import FloatArray
from cam_rig.errors import ConfigError, DesignError
from cam_rig.laws import Law, build_law
from cam_rig.laws.peaks import peak
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.schema.studies.design import DesignConfig
from cam_rig.studies.design.cam_file import DesignedCam, designed_cam
from cam_rig.studies.design.constraints import PEAKS, Asked
from cam_rig.studies.design.events import LawEvent
from cam_rig.studies.design.law_class import LawClass
from cam_rig.studies.design.measure import level_of, measured, rate_of
from cam_rig.studies.design.problem import DesignProblem
from cam_rig.studies.design.solve import Best, Solver
from cam_rig.studies.design.space import Space
from cam_rig.studies.design.terms import ORDERS, Limit, Sense, Term, parse_goal, parse_limit

#: A result within this part of its bound is called certified.
CERTIFIED = 2e-3
#: A goal below this part of the start's is solved again, measured by itself.
SMALL = 0.05
#: A limit is broken where the written law exceeds it by this part of its scale.
BROKEN = 1e-6


@dataclass(frozen=True)
class DesignRequest:
    """What is asked: a goal with its sense, limits, and the class of laws.

    Examples
    --------
    >>> request = DesignRequest.of(maximise="jump_speed", limits=["peak_acceleration<=start"])
    >>> request.words
    'maximise jump speed from rest'
    """

    goal: Term
    sense: Sense
    limits: tuple[Limit, ...] = ()
    law_class: LawClass = field(default_factory=LawClass)

    @classmethod
    def of(
        cls,
        *,
        minimise: str | None = None,
        maximise: str | None = None,
        limits: Sequence[str] = (),
        law_class: LawClass | None = None,
    ) -> DesignRequest:
        """From words.

        Raises
        ------
        ConfigError : not one goal, one that is not convex that way, or a limit that is none
        """
        if (minimise is None) == (maximise is None):
            raise ConfigError("goal: needed: one, to minimise or to maximise")
        goal = parse_goal(minimise or maximise or "")
        sense: Sense = "<=" if minimise is not None else ">="
        if sense not in goal.quantity.senses:
            other = "maximise" if sense == "<=" else "minimise"
            raise ConfigError(f"goal {goal.key}: allowed: {other}; the other way is not convex")
        found = cls(goal, sense, tuple(map(parse_limit, limits)), law_class or LawClass())
        for term in (goal, *(limit.term for limit in found.limits)):
            order = PEAKS.get(term.name, 0)
            if found.law_class.joints < order - 1:
                raise ConfigError(
                    f"{term.key}: has no bound with joints C{found.law_class.joints}, where a "
                    f"lower derivative may step; allowed: C{order - 1} and above"
                )
        return found

    @classmethod
    def of_config(cls, config: DesignConfig) -> DesignRequest:
        """From a design file.

        Raises
        ------
        ConfigError : as `of`, or a class that is none
        """
        own = config.class_
        return cls.of(
            minimise=config.minimise,
            maximise=config.maximise,
            limits=config.limits,
            law_class=LawClass.of(own.pieces, own.joints, own.degree),
        )

    @property
    def verb(self) -> str:
        """Minimise or maximise."""
        return "minimise" if self.sense == "<=" else "maximise"

    @property
    def words(self) -> str:
        """As a title says it."""
        return f"{self.verb} {self.goal.words}"


@dataclass(frozen=True)
class Measure:
    """A goal or a limit of a design, SI (dB for levels).

    ``bound`` is what no law of the class passes, for the goal alone; ``limit`` for limits alone.
    """

    term: Term
    sense: Sense
    start: float
    result: float
    bound: float | None = None
    limit: float | None = None
    active: bool = False


@dataclass(frozen=True, eq=False)
class LawDesign:
    """The best law found, its cam and file; ``measures`` has the goal first.

    ``tops`` are the cam angles (rad) within events where start and law reach their lift;
    ``rounds`` is how many programs were solved.
    """

    request: DesignRequest
    start: Law
    law: Law
    cam: CamConfig
    text: str
    rig: RigConfig
    events: tuple[LawEvent, ...]
    tops: tuple[float, ...]
    measures: tuple[Measure, ...]
    rounds: int

    @property
    def goal(self) -> Measure:
        """The goal's."""
        return self.measures[0]

    @property
    def gap(self) -> float:
        """How far the result is from its bound, in parts of it; of a level, of its pressure."""
        assert self.goal.bound is not None
        if self.goal.term.name == "sound_level":
            return float(10.0 ** (abs(self.goal.result - self.goal.bound) / 20.0) - 1.0)
        size = max(abs(self.goal.bound), 1e-300)
        return abs(self.goal.result - self.goal.bound) / size

    @property
    def certified(self) -> bool:
        """Whether the bound proves that little could be better."""
        return self.gap <= CERTIFIED


def design(
    cam: CamConfig,
    rig: RigConfig,
    request: DesignRequest,
    name: str | None = None,
    on_best: Callable[[DesignedCam, float], None] = lambda _c, _v: None,
) -> LawDesign:
    """The best law of a class between the dwells of a cam.

    Parameters
    ----------
    name : of the new cam, by default the start's with ``_designed``
    on_best : told each better law as a cam, and what the goal comes to (SI)

    Raises
    ------
    DesignError : no law of the class keeps the limits; the solver did not end
    ConfigError : what the cam or the rig does not have
    DynamicsError : contact lost at every speed or at none
    """
    start = build_law(cam)
    space = Space(start, request.law_class)
    problem = DesignProblem(cam, start, rig, space)
    name = name or f"{cam.name}_designed"
    limits = [_asked(problem, x.term, x.sense, _value(problem, x)) for x in request.limits]

    def told(unknowns: FloatArray, value: float) -> None:
        file = designed_cam(problem, unknowns, name, request.verb, request.goal, limits)
        on_best(file, _shown(problem, request.goal, value))

    best = _solve(problem, request, limits, told)
    file = designed_cam(problem, best.unknowns, name, request.verb, request.goal, limits)
    law = build_law(file.cam)
    measures = [_goal(problem, request, law, best)]
    measures += [
        _limit(problem, law, asked, limit, best)
        for asked, limit in zip(limits, request.limits, strict=True)
    ]
    events = tuple(space.events)
    tops = tuple(angle for _, angle in space.turning_points)
    return LawDesign(
        request, start, law, file.cam, file.text, rig, events, tops, tuple(measures), best.rounds
    )


def _solve(
    problem: DesignProblem,
    request: DesignRequest,
    limits: list[Asked],
    told: Callable[[FloatArray, float], None],
) -> Best:
    goal = _asked(problem, request.goal, request.sense, None)
    best = Solver(problem, goal, limits, told).best()
    if request.sense == "<=" and 0.0 < best.value < SMALL * goal.scale:
        goal = Asked(goal.term, goal.sense, None, best.value / SMALL)  # for its bound's digits
        with suppress(DesignError):  # then the first stands, with its bound
            best = Solver(problem, goal, limits, told).best()
    return best


def _value(problem: DesignProblem, limit: Limit) -> float:
    """What a limit allows, SI; the level in dB."""
    if limit.value is not None:
        return limit.value
    return measured(problem, problem.start, limit.term, limit.sense)


def _asked(problem: DesignProblem, term: Term, sense: Sense, value: float | None) -> Asked:
    """A goal or a limit in the units of its rows, and what they are measured by."""
    if value is not None and term.name == "sound_level":
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
    if term.name.endswith("contact_force"):
        return problem.force_scale
    if term.name.startswith("jump_speed"):
        return 1.0
    found = measured(problem, start, term, sense)
    return rate_of(problem, term, found) if term.name == "sound_level" else found


def _shown(problem: DesignProblem, term: Term, value: float) -> float:
    """A goal's value as it is shown: rows have the root of a mean square for a level."""
    return level_of(problem, term, value) if term.name == "sound_level" else value


def _goal(problem: DesignProblem, request: DesignRequest, law: Law, best: Best) -> Measure:
    term, sense = request.goal, request.sense
    start = measured(problem, problem.start, term, sense)
    return Measure(
        term,
        sense,
        start,
        measured(problem, law, term, sense),
        bound=_shown(problem, term, best.bound),
    )


def _limit(problem: DesignProblem, law: Law, asked: Asked, limit: Limit, best: Best) -> Measure:
    start = measured(problem, problem.start, limit.term, limit.sense)
    result, allowed = measured(problem, law, limit.term, limit.sense), _value(problem, limit)
    over = (result - allowed) * (1.0 if limit.sense == "<=" else -1.0)
    if over > BROKEN * max(abs(allowed), abs(start)):
        raise DesignError(
            f"the law found breaks {limit.words}: it has "
            f"{result / limit.term.quantity.shown:.6g} {limit.term.quantity.unit}; allowed: a "
            "narrower range, or more pieces"
        )
    active = asked.name in best.active
    return Measure(limit.term, limit.sense, start, result, limit=allowed, active=active)
