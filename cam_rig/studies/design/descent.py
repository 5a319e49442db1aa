"""Local search for a better law, by a sequence of linearised convex programs.

Each step solves a program within a trust region around the present law. Convex limits are kept
exactly, so every law of the descent satisfies them. Other goals and limits are linearised at the
present law. A step is accepted only if the exact values of the new law satisfy these limits and its
goal is better.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from scipy import sparse

from cam_rig.errors import DesignError, DynamicsError
from cam_rig.laws import Law
from cam_rig.profile.contact import Motion
from cam_rig.quantities.terms import sign_of
from cam_rig.quantities.values import SAMPLES, Branches, maxima
from cam_rig.studies.design.convex_program import Affine, ProgramSolution, RowBlock
from cam_rig.studies.design.cutting_planes import RowSource, Solver, WorkingRows
from cam_rig.studies.design.rows import add, force_parts, rows_of
from cam_rig.studies.design.space import DesignProblem, ScaledLimit, dwells, measured
from cam_rig.studies.design.two_mass_contact import ResidualRows
from cam_rig.units import FloatArray

#: Largest number of steps of one local search. A step solves a linearised program.
MAX_STEPS = 60
#: Largest number of times that a rejected step is repeated with a corrected linearisation of the
#: goal and the limits.
MAX_CORRECTIONS = 2
#: Initial trust region: largest change of a B-spline ordinate in one step, relative to the lift.
FIRST_REACH = 0.1
#: Upper limit of the trust region (largest change of a B-spline ordinate in one step), relative to
#: the lift.
MAX_REACH = 2.0
#: Trust region below which a local search ends: largest change of a B-spline ordinate in one step,
#: relative to the lift.
MIN_REACH = 1e-5
#: Relative improvement of the goal below which a step of a local search counts as idle. Two
#: successive idle steps end the search.
GAIN_RTOL = 2e-5
#: Predicted improvement of the goal below which a local search ends, relative to the goal. It is
#: the prediction of a linearised program within a trust region of `FIRST_REACH`.
PROMISE_RTOL = 1e-5
#: Ratio of the actual to the predicted improvement of a step below which the trust region is
#: halved.
POOR_GAIN = 0.25
#: Ratio of the actual to the predicted improvement of a step above which the trust region may be
#: doubled.
GOOD_GAIN = 0.7
#: Initial amount by which a program tightens the linearised limits, relative to their scales.
MARGIN = 1e-7
#: Largest increase of the margin of the linearised limits after a rejected step, relative to the
#: scales of the limits.
MAX_MARGIN_STEP = 1e-3
#: Largest violation of a limit at which a law counts as feasible, relative to the scale of the
#: limit.
FEASIBLE_RTOL = 1e-9
#: Largest amount by which a linearised limit is tightened, as a fraction of the distance of the
#: present law from the limit.
MARGIN_FRACTION = 0.5
#: Step of the central differences of a function of s, s' and s'', as a fraction of the largest
#: value of the argument. See `PointwiseTerm`.
BRANCH_STEP = 1e-5
#: Step of a B-spline ordinate in the central differences of a goal or limit, relative to the lift.
#: It is large enough for the differences to include flights of the follower that appear or vanish.
VALUE_STEP = 1e-3
#: Distance from a joint between two polynomial pieces of the law at which a quantity is evaluated
#: on both sides, as a fraction of the length of a piece.
JOINT_OFFSET = 1e-6
#: Scale by which inequalities for a sound level are divided, in dB.
LEVEL_SCALE = 10.0
#: Distance from all limits at which the search for a first law that satisfies them aims, relative
#: to the scales of the limits.
FEASIBILITY_MARGIN = 0.02


@dataclass(frozen=True, eq=False)
class PointwiseTerm:
    """Goal or limit on the maximum, over the turn, of functions of s, s' and s''.

    Such a quantity is, for example, the pressure angle. The functions of one cam angle are called
    branches, and the quantity is the maximum of all branches over the turn. ``allowed`` is the
    limit, NaN for a goal.
    """

    problem: DesignProblem
    name: str
    branches: Branches
    allowed: float

    @cached_property
    def scale(self) -> float:
        """Scale by which values are divided: the largest |branch| on the start law.

        A branch is one of the functions of s, s' and s'' whose maximum is limited.
        """
        u = np.linspace(0.0, 1.0, SAMPLES)
        values = np.abs(self.branches(Motion.on_pieces(self.problem.start, u)))
        return float(values[np.isfinite(values)].max(initial=0.0)) or 1.0

    def max_value(self, law: Law) -> float:
        """Return the quantity of a law: the maximum of its branches over the turn.

        A branch is one of the functions of s, s' and s'' whose maximum is limited.
        """
        return max(value for value, _ in maxima(law, self.branches))

    @property
    def dwell_value(self) -> float:
        """Maximum of the limited functions of s, s' and s'' in the dwells.

        It is the same for all laws of the class, because they share the dwells. It is −∞ if the law
        has no dwell.
        """
        levels = [self.problem.start.at(start)[0] for start, _ in dwells(self.problem.start)]
        if not levels:
            return -np.inf
        motion = Motion(np.zeros(len(levels)), np.array(levels), *np.zeros((2, len(levels))))
        return float(self.branches(motion).max())

    @cached_property
    def _grid(self) -> FloatArray:
        """Cam angles (rad) at which the limited functions are linearised.

        They lie in all polynomial pieces of the events (motions between two dwells), and on both
        sides of the joints between the pieces.
        """
        space = self.problem.space
        pieces = space.law_class.pieces
        inner = (np.arange(pieces)[:, None] + (np.arange(space.parts) + 0.5) / space.parts).ravel()
        joints = (np.arange(1, pieces)[:, None] + np.array([-JOINT_OFFSET, JOINT_OFFSET])).ravel()
        positions = np.concatenate([inner, joints])
        return np.concatenate([e.start + e.span / pieces * positions for e in space.events])

    def _inside(self, angles: FloatArray) -> FloatArray:
        """Return the cam angles (rad) that are inside events, away from their ends.

        An event is the motion between two dwells. Near its ends the law is fixed by the dwells, so
        a linearisation there has no effect.
        """
        space = self.problem.space
        edge = 0.25 / (space.law_class.pieces * space.parts)
        position = np.array([(angles - event.start) / event.span for event in space.events])
        return np.asarray(angles[((edge < position) & (position < 1.0 - edge)).any(axis=0)])

    def rows(self, unknowns: FloatArray, tried: list[FloatArray]) -> Affine:
        """Return the limited functions of the motion, linearised at a law.

        A limit such as the pressure angle is the largest value of several functions of s, s' and
        s'', its branches. The result has one value per branch and cam angle. ``unknowns`` are the
        free coefficients of the law. The angles are a grid, and those of the law's maxima.
        ``tried`` are the coefficients of laws that this step has rejected. Their maxima are added
        to the angles, and the values are shifted to be exact for the last rejected law.
        """
        space = self.problem.space
        laws = [space.law(x, "design") for x in (unknowns, *tried)]
        maxima_angles = np.array([angle for law in laws for _, angle in maxima(law, self.branches)])
        angles = np.concatenate([self._grid, self._inside(maxima_angles)])
        parts = [space.at(order, angles) for order in range(3)]
        motion = Motion(angles, *(part(unknowns) for part in parts))
        slopes = [self._slope(motion, order) for order in range(3)]
        branch_rows = []
        for branch, value in enumerate(self.branches(motion)):
            total = Affine(value, sparse.csr_array(parts[0].matrix.shape))
            for part, slope in zip(parts, slopes, strict=True):
                total += part.plus(-part(unknowns)).mapped(sparse.diags_array(slope[branch]))
            branch_rows.append(total)
        rows = Affine.stacked(branch_rows)
        if tried:
            exact = self.branches(Motion(angles, *(part(tried[-1]) for part in parts)))
            rows = rows.plus(exact.ravel() - rows(tried[-1]))
        return rows

    def _slope(self, motion: Motion, order: int) -> FloatArray:
        """Return the derivatives of the branches by s, s' or s'', by central differences.

        The branches are the functions of s, s' and s'' whose maximum is limited. ``order`` 0, 1 or
        2 selects s, s' or s''.
        """
        name = ("s", "slope", "curvature")[order]
        values = getattr(motion, name)
        step = BRANCH_STEP * float(np.abs(values).max())
        high, low = (self.branches(replace(motion, **{name: values + x})) for x in (step, -step))
        return np.asarray((high - low) / (2.0 * step))


@dataclass(eq=False)
class ValueTerm:
    """Goal or limit with one value per law, linearised by finite differences.

    Such a quantity is, for example, the peak contact force with flights. ``allowed`` is the limit,
    NaN for a goal. A quantity to be maximised is negated, so that every value is minimised.
    """

    problem: DesignProblem
    target: ScaledLimit

    def __post_init__(self) -> None:
        target = self.target
        self.name, self._sign = target.name, sign_of(target.sense)
        self.allowed = math.nan if target.value is None else self._sign * target.value
        # The changes of a level in dB are not proportional to the level.
        self.scale = LEVEL_SCALE if target.term.quantity.unit == "dB" else target.scale

    def max_value(self, law: Law) -> float:
        """Return the exact value of a goal or limit for a law.

        It is negated if the quantity is to be maximised.
        """
        return self._sign * measured(self.problem, law, self.target.term, self.target.sense)

    def rows(self, unknowns: FloatArray, tried: list[FloatArray]) -> Affine:
        """Return the value of the goal or limit, linearised at a law.

        ``unknowns`` are those of the law. ``tried`` are the unknowns of laws that this step of the
        search has rejected. The result is shifted to be exact at the last of them.
        """
        point, slope = tried[-1] if tried else unknowns, self._slope(unknowns.tobytes())
        constant = self._value(point) - slope @ point
        return Affine(constant, sparse.csr_array(slope))

    @lru_cache(maxsize=1)  # noqa: B019 - a term lives as long as its search
    def _slope(self, unknowns: bytes) -> FloatArray:
        """Return the derivatives of the value by the unknowns, ``(1, m)``.

        ``unknowns`` are the bytes of the array, which can be a key of the cache. The result is
        cached, because a rejected step is repeated from the same law.
        """
        space = self.problem.space
        steps = VALUE_STEP * np.eye(space.free)
        free, slope = np.frombuffer(unknowns)[: space.free], np.zeros((1, space.unknowns))
        for index, step in enumerate(steps):
            high, low = (self._value(space.joined(free + sign * step)) for sign in (1.0, -1.0))
            slope[0, index] = (high - low) / (2.0 * VALUE_STEP)
        return slope

    def _value(self, unknowns: FloatArray) -> float:
        return self.max_value(self.problem.space.law(unknowns, "design"))


class Iterate(NamedTuple):
    """Law of a local search with its exact values.

    ``violation`` is the largest violation of a limit, relative to the scale of the limit, and
    negative if all are satisfied. ``goal`` is relative to its scale, with the sign with which it is
    minimised. ``active`` names the limits that the law reaches in its program.
    """

    unknowns: FloatArray
    violation: float
    goal: float
    active: tuple[str, ...] = ()


LocalTerm = PointwiseTerm | ValueTerm


@dataclass(eq=False)
class Descent:
    """Local search for one goal under limits, from one law to better laws.

    The goal is convex (`ScaledLimit`) or not convex, and ``limits`` are the limits that are not
    convex. ``solver`` has the convex limits. ``row_sources`` provide inequalities of convex limits
    that are added when a solution violates them. ``on_feasible`` is called with each law that
    satisfies all limits. ``reach`` is the trust region: the largest change of a B-spline ordinate
    in a step, relative to the lift.
    """

    solver: Solver
    goal: LocalTerm | ScaledLimit
    limits: list[LocalTerm]
    row_sources: list[RowSource]
    on_feasible: Callable[[Iterate], None] = lambda _: None
    reach: float = field(default=FIRST_REACH, init=False)
    _residual: list[RowSource] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.problem, self._free = self.solver.problem, self.solver.problem.space.free
        assert not any(math.isnan(limit.allowed) for limit in self.limits)
        goal = self.goal
        #: True if the goal is the jump speed (lowest speed with loss of contact) of one rigid mass.
        self._speed = isinstance(goal, ScaledLimit) and rows_of(goal.term).run is not None

    def evaluate(self, unknowns: FloatArray) -> Iterate:
        """Return the exact goal of a law, and its largest violation of a limit.

        ``unknowns`` describe the law.
        """
        law = self.problem.space.law(unknowns, "design")
        violations = ((limit.max_value(law) - limit.allowed) / limit.scale for limit in self.limits)
        violation = max(violations, default=-np.inf)
        if isinstance(self.goal, ScaledLimit):
            sign = sign_of(self.goal.sense)
            value = sign * measured(self.problem, law, self.goal.term, self.goal.sense)
        else:
            value = self.goal.max_value(law)
        return Iterate(unknowns, violation, value / self.goal.scale)

    def run(self, unknowns: FloatArray) -> Iterate:
        """Improve a law step by step, and return the last law.

        ``unknowns`` describe the first law, which must satisfy the convex limits.
        """
        current, self.reach, idle = self.evaluate(unknowns), FIRST_REACH, 0
        for _ in range(MAX_STEPS):
            if current.violation <= FEASIBLE_RTOL:
                self.on_feasible(current)
            better = self._step(current)
            if better is None:
                self.reach *= 0.25
                if self.reach < MIN_REACH:
                    break
                continue
            gain = current.goal - better.goal
            if current.violation > FEASIBLE_RTOL:
                gain = max(gain, current.violation - better.violation)
            idle = idle + 1 if gain < GAIN_RTOL * max(abs(better.goal), GAIN_RTOL) else 0
            current = better
            if idle == 2:
                break
        if current.violation <= FEASIBLE_RTOL:
            self.on_feasible(current)
        return current

    def _step(self, current: Iterate) -> Iterate | None:
        """Return a better law in the trust region, or None if no better law was found.

        ``current`` is the present law. A program that is linearised at this law gives a candidate.
        If the candidate is not better or violates a limit, the program is repeated, corrected by
        the exact values of the rejected candidate and with limits tightened by its violation.
        """
        tried: list[FloatArray] = []
        margin = MARGIN
        for _ in range(1 + MAX_CORRECTIONS):
            try:
                solution = self._solve_linearised(current, tried, margin)
            except DesignError:  # the trust region has no law, or the solver fails
                return None
            if not tried and self._has_converged(current, solution):
                self.reach = 0.0
                return None
            candidate = self.evaluate(solution.unknowns)._replace(active=solution.active)
            if current.violation > FEASIBLE_RTOL:
                if candidate.violation < max(0.9 * current.violation, FEASIBLE_RTOL):
                    return candidate
            elif candidate.violation <= FEASIBLE_RTOL and candidate.goal < current.goal:
                self._adapt(current, candidate, solution.level)
                return candidate
            tried.append(solution.unknowns)
            margin += max(0.0, min(candidate.violation, MAX_MARGIN_STEP))
        return None

    def _has_converged(self, current: Iterate, solution: ProgramSolution) -> bool:
        """Return True if the local search cannot improve the present law any more.

        The law is then feasible, and its linearised program predicts almost no improvement.
        ``current`` is the present law, and ``solution`` that of the linearised program.
        """
        promised, tolerance = (
            current.goal + solution.level,
            PROMISE_RTOL * min(1.0, self.reach / FIRST_REACH),
        )
        return (
            current.violation <= FEASIBLE_RTOL
            and not self._speed
            and promised < tolerance * abs(current.goal)
        )

    def _adapt(self, current: Iterate, candidate: Iterate, level: float) -> None:
        """Adapt the trust region to the ratio of the actual to the predicted improvement.

        ``current`` is the law before the step, ``candidate`` the law after it. ``level`` is the
        maximised variable of the program that gave the candidate, from which the prediction
        follows.
        """
        gain, promised = current.goal - candidate.goal, current.goal + level
        # for a jump speed the level of the program is a force and predicts no speed
        if self._speed:
            promised = gain
        change = np.abs(candidate.unknowns - current.unknowns)[: self._free].max()
        if gain < POOR_GAIN * promised:
            self.reach *= 0.5
        elif gain > GOOD_GAIN * promised and change > 0.9 * self.reach:
            self.reach = min(2.0 * self.reach, MAX_REACH)

    def _solve_linearised(
        self, current: Iterate, tried: list[FloatArray], margin: float
    ) -> ProgramSolution:
        """Return the solution of the program that is linearised at the present law.

        ``tried`` are the unknowns of laws that this step has rejected, and ``margin`` tightens the
        limits. If the present law violates a limit, the program reduces the violation instead of
        the goal.
        """
        program = self.solver.static_program(True)
        sources: list[RowSource] = [
            WorkingRows([self._trust_region(current)], stride=1),
            *self.row_sources,
        ]
        for limit in self.limits:
            slack = limit.rows(current.unknowns, tried) * (-1.0 / limit.scale)
            slack = slack.plus(limit.allowed / limit.scale)
            # The margin is limited, because next to a dwell that reaches the limit the slack is
            # always nearly zero.
            slack = slack.plus(-np.clip(MARGIN_FRACTION * slack(current.unknowns), 0.0, margin))
            program.at_least(limit.name, slack, -1.0 if current.violation > FEASIBLE_RTOL else 0.0)
        if current.violation > FEASIBLE_RTOL:
            program.at_least("inside", Affine.number(FEASIBILITY_MARGIN, program.unknowns), -1.0)
        elif not isinstance(self.goal, ScaledLimit):
            rows = self.goal.rows(current.unknowns, tried) * (-1.0 / self.goal.scale)
            program.at_least(self.goal.name, rows, -1.0)
        elif self._speed:
            if not np.isfinite(current.goal):
                raise DynamicsError(
                    "the class has laws that keep contact at every speed; add a limit such as "
                    "peak_acceleration<=start"
                )
            # If the least force at the present jump speed becomes positive, the jump speed rises.
            rows = force_parts(self.problem, -current.goal * self.goal.scale, True)
            program.at_least(self.goal.name, rows, -1.0)
        elif rows_of(self.goal.term).in_rounds:
            self._residual = self._residual or [ResidualRows(self.problem, self.goal, True)]
            sources += self._residual
        else:
            add(program, self.problem, self.goal, True)
        return self.solver.solve_in_rounds(program, sources)

    def _trust_region(self, current: Iterate) -> RowBlock:
        """Return inequalities that keep a law close to the present law.

        Each free B-spline ordinate may change by at most ``reach`` lifts.
        """
        free = self._free
        eye = sparse.eye_array(free, self.problem.space.unknowns)
        point = current.unknowns[:free]
        constant = np.concatenate([self.reach - point, self.reach + point])
        rows = Affine(constant, sparse.vstack([eye, -eye], "csr"))
        return RowBlock("reach", rows, np.zeros(2 * free), "nonneg")
