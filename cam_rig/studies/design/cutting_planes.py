"""Best law of a class with a bound, by convex programs with cutting planes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from cam_rig.dynamics.jump.any_follower import find_jump
from cam_rig.dynamics.jump.rigid_mass import rigid_jump_speed
from cam_rig.dynamics.jump.two_masses import MAX_RPM, Jump
from cam_rig.errors import ConfigError, DesignError, DynamicsError
from cam_rig.quantities.terms import sign_of
from cam_rig.studies.design.convex_program import (
    Affine,
    ConvexProgram,
    GrowingProgram,
    InfeasibleError,
    ProgramSolution,
    RowBlock,
)
from cam_rig.studies.design.request import Multistart
from cam_rig.studies.design.rows import add, force_parts, keep_lift, rows_of
from cam_rig.studies.design.space import DesignProblem, ScaledLimit
from cam_rig.studies.design.two_mass_contact import MARGIN, ContactKept, Residual
from cam_rig.units import RPM, FloatArray, to_rpm

#: Every n-th of a program's thousands of inequalities is in its first round.
ROW_STRIDE = 24
#: A row is violated if it is below minus this value.
VIOLATION = 1e-9
#: Rows within this distance above zero are added together with the violated rows.
NEARLY_VIOLATED = 1e-3
#: Largest number of rounds of cuts.
MAX_ROUNDS = 80
#: Largest number of programs in a search for the jump speed of two masses.
MAX_SPEED_ROUNDS = 120
#: Relative tolerance of a jump speed.
SPEED_RTOL = 2e-5


@dataclass(eq=False)
class FewRows:
    """Rows of a program, of which only the violated and nearly violated rows are used.

    At the start every ``stride``-th inequality and all other rows are used.
    """

    all_rows: list[RowBlock]
    stride: int = ROW_STRIDE
    taken: list[NDArray[np.bool_]] = field(default_factory=list)

    def __post_init__(self) -> None:
        for block in self.all_rows:
            taken = np.zeros(block.weight.size, dtype=bool)
            taken[:: 1 if block.kind != "nonneg" else self.stride] = True
            self.taken.append(taken)

    @property
    def blocks(self) -> list[RowBlock]:
        """Blocks with the rows in use."""
        return [
            replace(block, rows=block.rows.rows(taken), weight=block.weight[taken])
            for block, taken in zip(self.all_rows, self.taken, strict=True)
        ]

    def cut(self, solution: ProgramSolution) -> bool:
        """Use the rows that a solution violates or nearly violates.

        Returns True if it violates any row that was not in use.
        """
        violated = False
        for block, taken in zip(self.all_rows, self.taken, strict=True):
            values = block.rows(solution.unknowns) + block.weight * solution.level
            violated |= bool((~taken & (values < -VIOLATION)).any())
            np.logical_or(taken, values < NEARLY_VIOLATED, out=taken)
        return violated


#: Function that is called with the unknowns of a better law and its goal (SI).
OnBetterLaw = Callable[[FloatArray, float], None]
#: Sources of rows that are added if a law requires them.
Cuts = FewRows | ContactKept | Residual


@dataclass(frozen=True)
class Best:
    """Best law of a class by a goal: unknowns, value and bound (SI).

    ``active`` names the active limits. ``rounds`` is the number of solved programs, 0 for an
    intermediate law of an interrupted search. The best of several descents has ``multistart`` and
    no bound.
    """

    unknowns: FloatArray
    value: float = math.nan
    bound: float | None = None
    active: tuple[str, ...] = ()
    rounds: int = 0
    multistart: Multistart | None = None


@dataclass(eq=False)
class Solver:
    """Solver of one goal over one class, under limits.

    ``on_best`` is called with better laws and their values (SI).
    """

    problem: DesignProblem
    goal: ScaledLimit
    limits: list[ScaledLimit]
    on_best: OnBetterLaw = lambda _x, _v: None
    rounds: int = 0
    _static: dict[bool, ConvexProgram] = field(default_factory=dict)

    def best(self) -> Best:
        """Return the best law and its bound.

        Raises
        ------
        InfeasibleError
            If it is proved that no law of the class satisfies the limits.
        DesignError
            If the search found no law, without a proof that the class has no such law.
        """
        run = rows_of(self.goal.term).run
        try:
            if run is None:
                return self._level()
            if self.problem.two_masses and not run.rigid:
                return TwoMassSearch(self, run.duration).best()
            if not run.rigid and run.duration is None:
                raise ConfigError(
                    f"goal {self.goal.term.name}: rig {self.problem.rig.name!r} does not say how "
                    "its mass is split; allowed: jump_speed_rigid, or follower.roller_share and "
                    "follower.stem_damping in the rig file"
                )
            return self.rigid()
        except InfeasibleError as error:
            if error.proved:
                raise
            raise DesignError(
                f"a law of the class may keep {error.conflict}, but none was found whose "
                "ordinates prove it; allowed: limits looser by 0.1 %, or more pieces"
            ) from None

    def static_program(self, sufficient: bool) -> ConvexProgram:
        """Return the program of lift and limits that needs no rounds.

        Its rows are sufficient or necessary.
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

    def cuts(self, sufficient: bool) -> list[Cuts]:
        """Return the limits that need rounds, with a margin if they must be satisfied."""
        cuts: list[Cuts] = []
        for limit in self.limits:
            rows = rows_of(limit.term)
            if rows.in_rounds:
                cuts.append(Residual(self.problem, limit, sufficient))
            elif rows.run is not None and not rows.run.rigid:
                assert limit.value is not None
                duration, margin = rows.run.duration, MARGIN if sufficient else 0.0
                kept = ContactKept(
                    self.problem, duration, limit.value, limit.name, limit=True, margin=margin
                )
                # first rows of a force: at the minima of the best law without vibration
                program = self.static_program(True)
                program.at_least("rigid", force_parts(self.problem, kept.fastest, True), -1.0)
                kept.add_rows_below(self.solve_in_rounds(program, []).unknowns, 0.5)
                cuts.append(kept)
        return cuts

    def solve_cuts(
        self, cuts: list[Cuts], growing: GrowingProgram | None = None
    ) -> ProgramSolution:
        """Solve one program with the present cuts."""
        self.rounds += 1
        blocks = [block for cut in cuts for block in cut.blocks]
        space = self.problem.space
        program = ConvexProgram(space.unknowns, space.link, blocks)
        return program.solve() if growing is None else growing.solve(program)

    def solve_in_rounds(self, program: ConvexProgram, cuts: list[Cuts]) -> ProgramSolution:
        """Solve and add cuts until no cut is added, the program's own rows included."""
        rounds = [FewRows(program.blocks), *cuts]
        for _ in range(MAX_ROUNDS):
            solution = self.solve_cuts(rounds)
            if not any([cut.cut(solution) for cut in rounds]) and self._confirm(cuts, solution):
                return solution
        raise DesignError(
            f"design: {MAX_ROUNDS} rounds of cuts did not settle; allowed: fewer pieces, or a "
            "narrower range of speeds"
        )

    def _confirm(self, cuts: list[Cuts], solution: ProgramSolution) -> bool:
        """Return True if the exact search confirms the jump speeds, else refine a cut."""
        kept = [cut for cut in cuts if isinstance(cut, ContactKept) and cut.margin > 0.0]
        law = self.problem.space.law(solution.unknowns, "design")
        for cut in kept:
            jump = find_jump(law, self.problem.follower, cut.duration)
            if jump.speed < cut.fastest:
                cut.refine(jump, solution)
                return False
        return True

    def _level(self) -> Best:
        """Return the best law of a goal that is the level of the program."""
        scale = -sign_of(self.goal.sense) * self.goal.scale
        solutions = {}
        for sufficient in (False, True):  # the necessary rows prove that a class has no law
            program, cuts = self.static_program(sufficient), self.cuts(sufficient)
            if rows_of(self.goal.term).in_rounds:
                cuts.append(Residual(self.problem, self.goal, sufficient))
            else:
                add(program, self.problem, self.goal, sufficient)
            solutions[sufficient] = self.solve_in_rounds(program, cuts)
        solution, bound = solutions[True], solutions[False].bound * scale
        self.on_best(solution.unknowns, solution.level * scale)
        active = self.other_than_goal(solution.active)
        return Best(solution.unknowns, solution.level * scale, bound, active, self.rounds)

    def other_than_goal(self, active: tuple[str, ...], *more: str) -> tuple[str, ...]:
        """Return the names of active limits without the goal and ``more``."""
        return tuple(name for name in active if name not in (self.goal.name, *more))

    def rigid(self) -> Best:
        """Return the highest speed with a positive least force of one rigid mass."""
        solutions: dict[float, ProgramSolution] = {}
        # limits violated at points are violated by the whole class
        possible = self.static_program(False)
        level_one = Affine.number(1.0, possible.unknowns)
        possible.at_least("level", level_one, -1.0)  # without a goal: t ≤ 1
        self.solve_in_rounds(possible, [])

        def level(speed: float, sufficient: bool) -> float:
            program = self.static_program(sufficient)
            rows = force_parts(self.problem, speed, sufficient)
            program.at_least(self.goal.name, rows, -1.0, not sufficient)
            solutions[speed] = self.solve_in_rounds(program, self.cuts(sufficient))
            if sufficient and solutions[speed].level > 0.0:
                self.on_best(solutions[speed].unknowns, speed)
            return solutions[speed].level if sufficient else solutions[speed].bound

        start_speed = rigid_jump_speed(self.problem.start, self.problem.rigid)
        highest = self._root(lambda speed: level(speed, True), min(start_speed, MAX_RPM * RPM))
        kept_speed = max(speed for speed, best in solutions.items() if best.level >= 0.0)
        best = solutions[kept_speed]
        bound = self._root(lambda speed: level(speed, False), highest)
        for _ in range(MAX_ROUNDS):  # (41) of docs/proofs.md at the returned speed
            if level(bound, False) <= 0.0:
                break
            bound *= 1.0 + SPEED_RTOL
        else:
            raise DesignError(f"no bound was proved up to {to_rpm(bound):.6g} rpm")
        law = self.problem.space.law(best.unknowns, "design")
        value = rigid_jump_speed(law, self.problem.rigid)
        return Best(best.unknowns, value, bound, self.other_than_goal(best.active), self.rounds)

    def _root(self, level: Callable[[float], float], start: float) -> float:
        """Return the speed (rad/s) at which a level that falls with speed is zero."""
        low = high = start
        ratio = 1.02
        if level(start) > 0.0:
            while level(high := high * ratio) > 0.0:
                low, ratio = high, ratio**1.7
                if high > MAX_RPM * RPM:
                    raise DynamicsError(
                        f"the class has laws that keep contact beyond {MAX_RPM:g} rpm; allowed: "
                        "a limit such as peak_acceleration<=start"
                    )
        else:
            while level(low := low / ratio) <= 0.0:
                high, ratio = low, ratio**1.7
                if low < RPM:
                    raise DesignError(
                        "no law of the class keeps contact at 1 rpm; on a dwell the force is the "
                        "preload: a rig without one needs a small one here"
                    )
        return float(brentq(level, low, high, xtol=1e-12, rtol=SPEED_RTOL))


# Two masses: one search for cuts and for the speed.

#: Largest number of laws that the exact search may reject.
MAX_REJECTED = 24
#: A speed has converged if the level is within this distance of the margin.
LEVEL_ATOL = 4e-3
#: Relative tolerance within which the jump speed of a law reaches a speed.
JUMP_RTOL = 5e-4
#: Largest number of searches.
MAX_SEARCHES = 6
#: Relative gap between law and bound at which the search ends.
GAP_RTOL = 2e-3
#: Distance of the level above the margin up to which a law is searched exactly. Above it the speed
#: is raised without an exact search.
EXACT_DISTANCE = 0.1
#: First estimate of the change of the level per relative change of the speed.
FIRST_SLOPE = -11.0
#: Largest relative step of the speed.
MAX_STEP = 0.06
#: Fraction of its speed that a law must reach. A search below it has located only the bound.
MIN_SPEED_FRACTION = 0.95
#: Multiples of the best law's jump speed at which a bound is searched for.
BOUND_FACTORS = (1.0008, 1.0016, 1.0025, 1.004, 1.007, 1.012, 1.02, 1.04, 1.08, 1.15, 1.3)


@dataclass(eq=False)
class TwoMassSearch:
    """Search for the highest jump speed of two masses.

    Cuts and the speed are found together. The level of a program at a fixed speed decreases as rows
    are added. A level below the margin shows that the speed is too high. If the law of a program
    keeps contact on the grid, the exact search evaluates it, and the speed is raised. The slope of
    the level, which is nearly constant, gives the step of the speed. ``duration`` (s) is that of a
    run from rest, None for the steady state.
    """

    solver: Solver
    duration: float | None

    def __post_init__(self) -> None:
        self.problem = self.solver.problem
        self.law: tuple[float, FloatArray, tuple[str, ...]] = (0.0, np.zeros(0), ())
        self.rejected = 0

    def best(self) -> Best:
        """Return the best law found, and a speed that no law of the class reaches."""
        rigid = Solver(self.problem, self.solver.goal, self.solver.limits).rigid()
        assert rigid.bound is not None
        self.solver.rounds += rigid.rounds
        kept = ContactKept(self.problem, self.duration, 0.95 * rigid.bound)
        cuts = [FewRows(self.solver.static_program(True).blocks), *self.solver.cuts(True)]
        kept.add_rows_below(rigid.unknowns, 0.5)
        self._evaluate(rigid.unknowns, rigid.active)
        bound = np.inf
        for _ in range(MAX_SEARCHES):
            far_bound = bound < np.inf and bound > self.law[0] / MIN_SPEED_FRACTION
            limit = kept.fastest if far_bound else np.inf
            self._search(kept, cuts, limit)
            if self.law[0] < limit * (1.0 - JUMP_RTOL):  # else higher speeds remain possible
                near = self.law[0] > MIN_SPEED_FRACTION * kept.fastest
                bound = min(bound, self._bound(kept, self.law[0] if near else kept.fastest))
            if bound <= self.law[0] * (1.0 + GAP_RTOL):
                break
            # the rejected laws refined the grid, so a smaller margin between its speeds suffices
            kept.margin, self.rejected, kept.fastest = MARGIN, 0, 0.5 * (bound + self.law[0])
        speed, unknowns, active = self.law
        return Best(unknowns, speed, bound, active, self.solver.rounds)

    def _search(self, kept: ContactKept, cuts: list[Cuts], limit: float) -> None:
        """Search for the highest speed of a law, at most ``limit`` (rad/s)."""
        slope, converged, solution = FIRST_SLOPE, None, None
        program = GrowingProgram()
        for _ in range(MAX_SPEED_ROUNDS):
            try:
                solution = self.solver.solve_cuts([*cuts, kept], program)
            except InfeasibleError:  # the dwells alone admit no law at this speed
                kept.move(1.0 - MAX_STEP)
                continue
            excess = solution.level - kept.margin
            if excess > -LEVEL_ATOL:
                if any([cut.cut(solution) for cut in [*cuts, kept]]):
                    continue
                at_limit = kept.fastest >= limit
                exact = excess < EXACT_DISTANCE or at_limit
                if exact and not self._reaches(kept, solution) and self.rejected <= MAX_REJECTED:
                    continue
                if converged is not None and converged[0] != kept.fastest:
                    measured = (excess - converged[1]) / (kept.fastest / converged[0] - 1.0)
                    slope = float(np.clip(measured, 4.0 * FIRST_SLOPE, 0.4 * FIRST_SLOPE))
                converged = (kept.fastest, excess)
                if excess <= LEVEL_ATOL or at_limit or self.rejected > MAX_REJECTED:
                    return
            step = float(np.clip(-excess / slope, -MAX_STEP, MAX_STEP))
            kept.move(min(1.0 + step, limit / kept.fastest))
        if solution is not None:  # out of rounds, or resonances narrower than the grid
            self._reaches(kept, solution)

    def _reaches(self, kept: ContactKept, solution: ProgramSolution) -> bool:
        """Return True if the exact search confirms the speed, else refine the grid."""
        active = self.solver.other_than_goal(solution.active, kept.name)
        jump = self._evaluate(solution.unknowns, active)
        if jump.speed >= kept.fastest * (1.0 - JUMP_RTOL):
            return True
        self.rejected += 1
        kept.refine(jump, solution)
        return False

    def _evaluate(self, unknowns: FloatArray, active: tuple[str, ...]) -> Jump:
        """Return the exact jump of a law, and store the law if it is the best so far."""
        law = self.problem.space.law(unknowns, "design")
        jump = find_jump(law, self.problem.follower, self.duration)
        if jump.speed > self.law[0]:
            self.law = (jump.speed, unknowns, active)
            self.solver.on_best(unknowns, jump.speed)
        return jump

    def _bound(self, kept: ContactKept, speed: float) -> float:
        """Return a speed above all jump speeds of the class, by (41) of docs/proofs.md.

        The rows are some of those that every law with a higher jump speed satisfies.
        """
        cuts = [FewRows(self.solver.static_program(False).blocks), *self.solver.cuts(False)]
        kept.margin = 0.0  # necessary rows: contact is kept, without a margin
        program = GrowingProgram()
        for factor in BOUND_FACTORS:
            kept.fastest = speed * factor
            for _ in range(MAX_SPEED_ROUNDS):
                try:
                    solution = self.solver.solve_cuts([*cuts, kept], program)
                except InfeasibleError as error:
                    if error.proved:
                        return kept.fastest
                    break
                if solution.bound <= 0.0:
                    return kept.fastest
                if not any([cut.cut(solution) for cut in [*cuts, kept]]):
                    break
        raise DesignError(f"no bound was found up to {to_rpm(kept.fastest):.4g} rpm")
