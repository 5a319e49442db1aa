"""The best of several descents: a seeded multistart, the same for the same seed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.errors import ConfigError, DesignError
from cam_rig.profile.flat_face import GuidedFace
from cam_rig.profile.roller import GuidedCentre
from cam_rig.studies.design.constraints import Asked, one_element
from cam_rig.studies.design.local.descent import KEPT, Descent, LocalTerm, Place
from cam_rig.studies.design.local.multistart import SAME, Multistart
from cam_rig.studies.design.local.pointwise import PointwiseTerm, as_branch, pointwise
from cam_rig.studies.design.local.sound import FlightLevel
from cam_rig.studies.design.local.starts import starts
from cam_rig.studies.design.measure import measured
from cam_rig.studies.design.problem import DesignProblem
from cam_rig.studies.design.solve import Solver
from cam_rig.studies.design.terms import Term


@dataclass(frozen=True)
class LocalBest:
    """The best law of several descents: no bound says how much better another may be.

    ``active`` names the limits that hold it, ``rounds`` is how many programs were solved.
    """

    unknowns: FloatArray
    active: tuple[str, ...]
    rounds: int
    multistart: Multistart


def is_local(problem: DesignProblem, term: Term, goal: bool = False) -> bool:
    """Whether a goal or a limit is not convex, for the cam's follower."""
    if term.name == "pressure_angle":
        return goal or not isinstance(one_element(problem), GuidedCentre)
    if term.name == "radius_of_curvature":
        return not isinstance(one_element(problem), GuidedFace)
    return term.name in ("shaft_torque", "sound_level_with_jumps")


@dataclass(eq=False)
class LocalSearch:
    """The search of one goal from several laws.

    ``on_best`` is told each law that is better than the ones before: unknowns and value (SI).
    """

    problem: DesignProblem
    goal: Asked
    limits: list[Asked]
    multistart: Multistart
    on_best: Callable[[FloatArray, float], None] = lambda _x, _v: None

    def __post_init__(self) -> None:
        convex = [x for x in self.limits if not is_local(self.problem, x.term)]
        self.solver = Solver(self.problem, self.goal, convex)
        own = self._term(self.goal) if is_local(self.problem, self.goal.term, True) else self.goal
        two_masses = ("jump_speed", "jump_speed_steady") if self.problem.two_masses else ()
        if isinstance(own, Asked) and own.term.name in two_masses:
            raise ConfigError(
                f"goal {own.term.key}: stands beside a limit that is not convex; allowed: it as a "
                "limit, such as jump_speed>=450rpm, or the goal jump_speed_rigid"
            )
        limits = [self._term(x) for x in self.limits if x not in convex]
        self.cuts = self.solver.cuts(True)
        self.descent = Descent(self.problem, self.solver, own, limits, self.cuts, self._told)
        self.best_goal = np.inf

    def _term(self, asked: Asked) -> LocalTerm:
        if asked.term.name == "sound_level_with_jumps":
            return FlightLevel(self.problem, asked.name, asked.term, asked.value)
        if asked.term.name == "pressure_angle" and isinstance(
            one_element(self.problem), GuidedFace
        ):
            raise ConfigError(
                f"{asked.term.key}: the follower is {self.problem.cam.follower.type}, whose "
                "pressure angle no law changes; allowed: a roller, a point, or an arm"
            )
        allowed = None
        if asked.value is not None:
            allowed = as_branch(self.problem, asked.term, asked.value)
        branches = pointwise(self.problem, asked.term)
        found = PointwiseTerm(self.problem, asked.name, branches, allowed)
        if allowed is not None and found.at_rest > allowed + KEPT * found.scale:
            raise DesignError(
                f"limit {asked.name}: a dwell of {self.problem.start.name!r} breaks it, whatever "
                "the law; allowed: a looser limit"
            )
        return found

    def _value(self, place: Place) -> float:
        law = self.problem.space.law(place.unknowns, "design")
        return measured(self.problem, law, self.goal.term, self.goal.sense)

    def _told(self, place: Place) -> None:
        if place.goal < self.best_goal:
            self.best_goal = place.goal
            self.on_best(place.unknowns, self._value(place))

    def best(self) -> LocalBest:
        """The best law of all descents.

        Raises
        ------
        InfeasibleError : no law of the class keeps the convex limits
        DesignError : no law was found that keeps all limits; the solver did not end
        DynamicsError : contact lost at no speed
        """
        asked = self.multistart
        ends = [self.descent.run(x) for x in starts(self.solver, self.cuts, asked)]
        kept = [end for end in ends if end.over <= KEPT]
        if not kept:
            nearest = min(ends, key=lambda end: end.over)
            names = " and ".join(limit.name for limit in self.descent.limits)
            raise DesignError(
                f"no law was found that keeps {names}, from {asked.starts} starts: the nearest is "
                f"over by {100.0 * nearest.over:.2g} %; allowed: looser limits, more starts or "
                "more pieces"
            )
        best = min(kept, key=lambda end: end.goal)
        room = SAME * abs(best.goal)
        near = sum(end.goal <= best.goal + room for end in kept)
        return LocalBest(best.unknowns, best.active, self.solver.rounds, replace(asked, near=near))
