"""Best law of a class with a bound, by convex programs with cutting planes.

A program with all inequalities (rows) of a design would be too large. It is solved with few of
them, and the rows that its solution violates are added until there are none (the method of cutting
planes). The level t of a program is the variable that it maximises.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from cam_rig.dynamics.jump.any_follower import find_jump
from cam_rig.dynamics.jump.rigid_mass import rigid_jump_speed
from cam_rig.dynamics.jump.two_masses import MAX_RPM
from cam_rig.errors import DesignError, DynamicsError
from cam_rig.quantities.terms import sign_of
from cam_rig.studies.design.convex_program import (
    Affine,
    ConvexProgram,
    GrowingProgram,
    ProgramSolution,
    RowBlock,
)
from cam_rig.studies.design.request import Multistart
from cam_rig.studies.design.rows import add, force_parts, keep_lift, rows_of
from cam_rig.studies.design.space import DesignProblem, ScaledLimit
from cam_rig.studies.design.two_mass_contact import MARGIN, ContactRows, ResidualRows
from cam_rig.units import RPM, FloatArray, to_rpm

#: Only every n-th of a program's thousands of inequalities is used for the first solution.
ROW_STRIDE = 24
#: Smallest violation at which an inequality is added to the program, relative to
#: `ScaledLimit.scale`.
VIOLATION = 1e-9
#: Slack below which a satisfied inequality is added together with the violated inequalities,
#: relative to `ScaledLimit.scale`.
NEARLY_VIOLATED = 1e-3
#: Largest number of times that a program is solved. After each solution violated inequalities are
#: added.
MAX_ROUNDS = 80
#: Relative tolerance of the computed jump speed of a law, and of its bound.
SPEED_RTOL = 2e-5


@dataclass(eq=False)
class WorkingRows:
    """Inequalities of a convex program, of which only the relevant ones are used.

    At first, every ``stride``-th inequality and all equations and cones are used. After each
    solution, the inequalities that it violates or nearly violates are added. ``all_rows`` are the
    complete blocks of the program. ``in_use`` contains one mask per block, True for the
    inequalities in use.
    """

    all_rows: list[RowBlock]
    stride: int = ROW_STRIDE
    in_use: list[NDArray[np.bool_]] = field(default_factory=list)

    def __post_init__(self) -> None:
        for block in self.all_rows:
            in_use = np.zeros(block.weight.size, dtype=bool)
            in_use[:: 1 if block.kind != "nonneg" else self.stride] = True
            self.in_use.append(in_use)

    @property
    def blocks(self) -> list[RowBlock]:
        """Blocks of a convex program, reduced to the inequalities in use.

        A block contains the inequalities or equations of one limit.
        """
        return [
            replace(block, rows=block.rows.rows(in_use), weight=block.weight[in_use])
            for block, in_use in zip(self.all_rows, self.in_use, strict=True)
        ]

    def add_violated(self, solution: ProgramSolution) -> bool:
        """Add the rows to the program that a solution violates or nearly violates.

        Returns True if the solution violates any row that was not in use.
        """
        violated = False
        for block, in_use in zip(self.all_rows, self.in_use, strict=True):
            values = block.rows(solution.unknowns) + block.weight * solution.level
            violated |= bool((~in_use & (values < -VIOLATION)).any())
            np.logical_or(in_use, values < NEARLY_VIOLATED, out=in_use)
        return violated


#: Function that is called for each better law that a search finds, with the unknowns of the law and
#: the value of its goal (SI).
OnBetterLaw = Callable[[FloatArray, float], None]
#: Objects that provide inequalities for a program, and add those that a solution violates.
RowSource = WorkingRows | ContactRows | ResidualRows


@dataclass(frozen=True)
class BestLaw:
    """Best law of a class for a goal: its unknowns, value and bound (SI).

    ``active`` names the limits that the law reaches. ``rounds`` is the number of solved programs, 0
    for an intermediate law of an interrupted search. The best of several local searches has
    ``multistart``, and its bound is None.
    """

    unknowns: FloatArray
    value: float = math.nan
    bound: float | None = None
    active: tuple[str, ...] = ()
    rounds: int = 0
    multistart: Multistart | None = None


@dataclass(eq=False)
class Solver:
    """Solver for the best value of one goal over a class of laws, under convex limits.

    ``on_best`` is called for each better law, with its unknowns and the value of its goal (SI).
    ``rounds`` counts the convex programs that were solved.
    """

    problem: DesignProblem
    goal: ScaledLimit
    limits: list[ScaledLimit]
    on_best: OnBetterLaw = lambda _x, _v: None
    rounds: int = 0
    _static: dict[bool, ConvexProgram] = field(default_factory=dict)

    def static_program(self, sufficient: bool) -> ConvexProgram:
        """Return the convex program of the lift limits and of all fixed inequalities.

        Limits whose inequalities depend on the solution are not included (see `row_sources`). If
        ``sufficient``, a law that satisfies the inequalities satisfies the limits at every angle.
        Otherwise every law that satisfies the limits satisfies the inequalities.
        """
        if sufficient not in self._static:
            program = ConvexProgram(self.problem.space.unknowns, self.problem.space.link)
            keep_lift(program, self.problem, sufficient)
            for limit in self.limits:
                rows = rows_of(limit.term)
                if rows.run is not None and rows.run.rigid:
                    assert limit.value is not None
                    force = force_parts(self.problem, limit.value, sufficient)
                    program.at_least(limit.name, force, necessary=not sufficient)
                elif rows.run is None and not rows.in_rounds:
                    add(program, self.problem, limit, sufficient)
            self._static[sufficient] = program
        return replace(self._static[sufficient], blocks=list(self._static[sufficient].blocks))

    def row_sources(self, sufficient: bool) -> list[RowSource]:
        """Return objects that add inequalities to a program when a solution violates them.

        The inequalities belong to limits of the residual vibration and of jump speeds. If
        ``sufficient``, they keep a margin from the limits, so that a law that satisfies them
        satisfies the limits.
        """
        sources: list[RowSource] = []
        for limit in self.limits:
            rows = rows_of(limit.term)
            if rows.in_rounds:
                sources.append(ResidualRows(self.problem, limit, sufficient))
            elif rows.run is not None and not rows.run.rigid:
                assert limit.value is not None
                duration, margin = rows.run.duration, MARGIN if sufficient else 0.0
                contact = ContactRows(
                    self.problem, duration, limit.value, limit.name, limit=True, margin=margin
                )
                # Initial rows: at the minima of the contact force of the law that is best for a
                # rigid stem.
                program = self.static_program(True)
                program.at_least("rigid", force_parts(self.problem, contact.fastest, True), -1.0)
                contact.add_rows_below(self.solve_in_rounds(program, []).unknowns, 0.5)
                sources.append(contact)
        return sources

    def solve_rows(
        self, sources: list[RowSource], growing: GrowingProgram | None = None
    ) -> ProgramSolution:
        """Solve the convex program of all inequalities that the sources contain so far.

        ``sources`` are objects that collect the inequalities. ``growing`` is a solver that
        continues from its previous solution, or None to solve the program from scratch.
        """
        self.rounds += 1
        blocks = [block for source in sources for block in source.blocks]
        space = self.problem.space
        program = ConvexProgram(space.unknowns, space.link, blocks)
        return program.solve() if growing is None else growing.solve(program)

    def solve_in_rounds(self, program: ConvexProgram, sources: list[RowSource]) -> ProgramSolution:
        """Solve a program repeatedly, adding inequalities until none is violated.

        Of the inequalities of ``program`` and ``sources``, only those are used that a solution has
        violated. Returns the last solution.
        """
        rounds = [WorkingRows(program.blocks), *sources]
        for _ in range(MAX_ROUNDS):
            solution = self.solve_rows(rounds)
            added = [source.add_violated(solution) for source in rounds]
            if not any(added) and self._confirm(sources, solution):
                return solution
        raise DesignError(
            f"the design did not converge in {MAX_ROUNDS} rounds; use fewer pieces, or a narrower "
            "range of speeds"
        )

    def _confirm(self, sources: list[RowSource], solution: ProgramSolution) -> bool:
        """Return True if a solution's law satisfies its limits on jump speeds exactly.

        The programs evaluate contact forces on a grid of angles and speeds only. If the exact
        search finds a loss of contact between them, the grid of that source is refined, and the
        result is False.
        """
        law = self.problem.space.law(solution.unknowns, "design")
        for source in sources:
            if isinstance(source, ContactRows) and source.margin > 0.0:
                jump = find_jump(law, self.problem.follower, source.duration)
                if jump.speed < source.fastest:
                    source.refine(jump, solution)
                    return False
        return True

    def level(self) -> BestLaw:
        """Return the best law for a goal that is the level of a single convex program.

        The level is the variable that a program maximises. The program is solved twice: with
        inequalities that are sufficient for the limits, which gives the law, and with necessary
        inequalities, which gives the bound of the goal.
        """
        scale = -sign_of(self.goal.sense) * self.goal.scale
        solutions = {}
        # False first: the necessary rows show whether a law exists
        for sufficient in (False, True):
            program, sources = self.static_program(sufficient), self.row_sources(sufficient)
            if rows_of(self.goal.term).in_rounds:
                sources.append(ResidualRows(self.problem, self.goal, sufficient))
            else:
                add(program, self.problem, self.goal, sufficient)
            solutions[sufficient] = self.solve_in_rounds(program, sources)
        solution, bound = solutions[True], solutions[False].bound * scale
        self.on_best(solution.unknowns, solution.level * scale)
        active = self.other_than_goal(solution.active)
        return BestLaw(solution.unknowns, solution.level * scale, bound, active, self.rounds)

    def other_than_goal(self, active: tuple[str, ...], *more: str) -> tuple[str, ...]:
        """Return the names of the limits among ``active``.

        The name of the goal and the names ``more`` are removed.
        """
        return tuple(name for name in active if name not in (self.goal.name, *more))

    def rigid(self) -> BestLaw:
        """Return the law with which one rigid mass keeps contact up to the highest speed.

        The value and the bound of the result are jump speeds (rad/s). At each speed a program
        maximises the least contact force. The jump speed of the class is the speed at which this
        maximum is zero.
        """
        solutions: dict[float, ProgramSolution] = {}
        # If these necessary rows contradict each other, no law of the class is possible.
        possible = self.static_program(False)
        level_one = Affine.number(1.0, possible.unknowns)
        # the program has no goal, so its level needs a limit
        possible.at_least("level", level_one, -1.0)
        self.solve_in_rounds(possible, [])

        def level(speed: float, sufficient: bool) -> float:
            program = self.static_program(sufficient)
            rows = force_parts(self.problem, speed, sufficient)
            program.at_least(self.goal.name, rows, -1.0, not sufficient)
            solutions[speed] = self.solve_in_rounds(program, self.row_sources(sufficient))
            if sufficient and solutions[speed].level > 0.0:
                self.on_best(solutions[speed].unknowns, speed)
            return solutions[speed].level if sufficient else solutions[speed].bound

        start_speed = rigid_jump_speed(self.problem.start, self.problem.rigid)
        highest = self._root(lambda speed: level(speed, True), min(start_speed, MAX_RPM * RPM))
        highest_speed = max(speed for speed, best in solutions.items() if best.level >= 0.0)
        best = solutions[highest_speed]
        bound = self._root(lambda speed: level(speed, False), highest)
        # By (41) of docs/proofs.md a speed is a bound if its level is not positive.
        for _ in range(MAX_ROUNDS):
            if level(bound, False) <= 0.0:
                break
            bound *= 1.0 + SPEED_RTOL
        else:
            raise DesignError(f"no bound was proved up to {to_rpm(bound):.6g} rpm")
        law = self.problem.space.law(best.unknowns, "design")
        value = rigid_jump_speed(law, self.problem.rigid)
        return BestLaw(best.unknowns, value, bound, self.other_than_goal(best.active), self.rounds)

    def _root(self, level: Callable[[float], float], start: float) -> float:
        """Return the speed (rad/s) at which a function of the speed is zero.

        ``level`` is the least contact force that a program reaches at a speed. It decreases with
        the speed. The search starts at ``start`` (rad/s).
        """
        low = high = start
        ratio = 1.02
        if level(start) > 0.0:
            while level(high := high * ratio) > 0.0:
                low, ratio = high, ratio**1.7
                if high > MAX_RPM * RPM:
                    raise DynamicsError(
                        f"the class has laws that keep contact beyond {MAX_RPM:g} rpm; add a limit "
                        "such as peak_acceleration<=start"
                    )
        else:
            while level(low := low / ratio) <= 0.0:
                high, ratio = low, ratio**1.7
                if low < RPM:
                    raise DesignError(
                        "no law of the class keeps contact at 1 rpm; in a dwell the force is the "
                        "preload, so use a rig with a preload"
                    )
        return float(brentq(level, low, high, xtol=1e-12, rtol=SPEED_RTOL))
