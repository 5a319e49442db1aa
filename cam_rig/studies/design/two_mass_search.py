"""Search for the law with the highest jump speed of two masses, by cutting planes.

At a fixed speed a convex program maximises the level: the least contact force, relative to the
force scale of the problem. The level decreases as the speed rises and as inequalities (rows) are
added. The jump speed of the class is the speed at which the level with all inequalities is zero. A
program contains only a few of them. After each program, either violated inequalities are added or
the speed is changed: see `SearchPhase`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import Enum, auto

import numpy as np

from cam_rig.dynamics.jump.any_follower import find_jump
from cam_rig.dynamics.jump.two_masses import Jump
from cam_rig.errors import DesignError
from cam_rig.studies.design.convex_program import GrowingProgram, InfeasibleError, ProgramSolution
from cam_rig.studies.design.cutting_planes import (
    BestLaw,
    RowSource,
    Solver,
    WorkingRows,
)
from cam_rig.studies.design.two_mass_contact import MARGIN, ContactRows
from cam_rig.units import FloatArray, to_rpm

#: Cam speed at which the search starts, as a fraction of the bound for one rigid mass.
FIRST_SPEED_FRACTION = 0.95
#: Minima of the contact force below this value give the first inequalities of the program. They are
#: those of the best law of one rigid mass. Relative to `DesignProblem.force_scale`.
FIRST_LEVEL = 0.5
#: Largest number of programs that one search for a law, or for a bound at one speed, solves.
MAX_SPEED_ROUNDS = 120
#: Largest number of laws that may fail the exact check of their jump speed before the search over
#: the speed ends.
MAX_REJECTED = 24
#: Largest difference between the least contact force and the required force at which the search
#: over the speed has converged, relative to `DesignProblem.force_scale`.
LEVEL_ATOL = 4e-3
#: Largest relative amount by which the exact jump speed of a law may be below the speed at which
#: its program keeps contact.
JUMP_RTOL = 5e-4
#: Largest number of times that the search for a law and the search for a bound of the jump speed
#: are repeated in turn.
MAX_SEARCHES = 6
#: Relative gap between the jump speed of the best law and its bound at which the search ends.
GAP_RTOL = 2e-3
#: Largest distance of the least contact force above the required force at which the jump speed of a
#: law is checked exactly, relative to `DesignProblem.force_scale`. At a larger distance the speed
#: is raised without this costly check.
EXACT_DISTANCE = 0.1
#: First estimate of the change of the least contact force per relative change of the speed,
#: relative to `DesignProblem.force_scale`.
FIRST_SLOPE = -11.0
#: Largest relative change of the cam speed after one convex program in the search for the highest
#: jump speed.
MAX_STEP = 0.06
#: Ratio of the best law's jump speed to the highest speed of the search above which a bound is
#: searched for just above that jump speed. Below this ratio the law is far from optimal, and the
#: bound is searched for just above the highest speed.
MIN_SPEED_FRACTION = 0.95
#: Multiples of a speed that are tried in rising order as an upper bound of the jump speeds of all
#: laws.
BOUND_FACTORS = (1.0008, 1.0016, 1.0025, 1.004, 1.007, 1.012, 1.02, 1.04, 1.08, 1.15, 1.3)


class SearchPhase(Enum):
    """Next action of the search for the highest jump speed, after solving a program."""

    #: The law of the program violates inequalities that were not in use. They are in use now, and a
    #: new program is solved.
    CUT = auto()
    #: The law keeps contact at the evaluated speeds, but its exact jump speed is lower. This speed
    #: was added, and a new program is solved.
    REFINE = auto()
    #: The least contact force differs from the required force. The speed is changed, and a new
    #: program is solved.
    MOVE = auto()
    #: The least contact force equals the required force, or the highest allowed speed is reached.
    #: The search ends.
    CONVERGED = auto()


@dataclass(eq=False)
class TwoMassSearch:
    """Search for the law of two masses with the highest jump speed.

    ``duration`` (s) is that of a run from rest, None for the steady state. ``best_law`` is the best
    law so far. ``rejected`` is the number of laws that the exact check of the jump speed has
    rejected.

    Invariants: ``best_law.value`` is the exact jump speed of ``best_law.unknowns`` and never
    decreases. At one speed and margin the level (the maximised least contact force) never rises.
    Inequalities are added until it converges, and removed only after it has fallen by
    `MIN_LEVEL_FALL`, so inequalities are not added and removed endlessly.
    """

    solver: Solver
    duration: float | None
    best_law: BestLaw = field(default_factory=lambda: BestLaw(np.zeros(0), 0.0))
    rejected: int = 0
    _slope: float = FIRST_SLOPE
    _converged: tuple[float, float] | None = None

    def best(self) -> BestLaw:
        """Return the best law found, with a speed that no law of the class reaches.

        Searches for a law and for this bound alternate until both speeds agree within `GAP_RTOL`.
        """
        solver = self.solver
        rigid = Solver(solver.problem, solver.goal, solver.limits).rigid()
        assert rigid.bound is not None
        solver.rounds += rigid.rounds
        contact = ContactRows(solver.problem, self.duration, FIRST_SPEED_FRACTION * rigid.bound)
        sources = [WorkingRows(solver.static_program(True).blocks), *solver.row_sources(True)]
        contact.add_rows_below(rigid.unknowns, FIRST_LEVEL)
        self._evaluate(rigid.unknowns, rigid.active)
        bound = np.inf
        for _ in range(MAX_SEARCHES):
            speed = self.best_law.value
            far_bound = bound < np.inf and bound > speed / MIN_SPEED_FRACTION
            limit = contact.fastest if far_bound else np.inf
            self._raise_speed(contact, sources, limit)
            speed = self.best_law.value
            if speed < limit * (1.0 - JUMP_RTOL):  # otherwise higher speeds remain possible
                near = speed > MIN_SPEED_FRACTION * contact.fastest
                bound = min(bound, self._bound(contact, speed if near else contact.fastest))
            if bound <= speed * (1.0 + GAP_RTOL):
                break
            # The rejected laws have refined the grid of speeds, so the margin can be small again.
            contact.margin, self.rejected, contact.fastest = MARGIN, 0, 0.5 * (bound + speed)
        return replace(self.best_law, bound=bound, rounds=solver.rounds)

    def _raise_speed(self, contact: ContactRows, sources: list[RowSource], limit: float) -> None:
        """Raise the speed to the highest speed at which a law keeps contact.

        The search ends at the latest at the speed ``limit`` (rad/s). ``contact`` and ``sources``
        provide the inequalities of the programs. The best law is stored in ``best_law``.
        """
        self._slope, self._converged, solution = FIRST_SLOPE, None, None
        program = GrowingProgram()
        for _ in range(MAX_SPEED_ROUNDS):
            try:
                solution = self.solver.solve_rows([*sources, contact], program)
            except InfeasibleError:  # at this speed every law loses contact in the dwells
                contact.move(1.0 - MAX_STEP)
                continue
            phase = self._next_phase(contact, sources, solution, limit)
            if phase is SearchPhase.CONVERGED:
                return
            if phase is SearchPhase.MOVE:
                excess = solution.level - contact.margin
                step = float(np.clip(-excess / self._slope, -MAX_STEP, MAX_STEP))
                contact.move(min(1.0 + step, limit / contact.fastest))
        if solution is not None:  # the search over the speed did not converge
            self._reaches(contact, solution)

    def _next_phase(
        self,
        contact: ContactRows,
        sources: list[RowSource],
        solution: ProgramSolution,
        limit: float,
    ) -> SearchPhase:
        """Decide how the search continues after a program was solved.

        Inequalities that the solution violates are added. If there are none, the estimated slope of
        the least contact force over the speed is updated. ``limit`` (rad/s) is the highest allowed
        speed.
        """
        excess = solution.level - contact.margin
        if excess <= -LEVEL_ATOL:  # more rows would only lower the level
            return SearchPhase.MOVE
        if any([source.add_violated(solution) for source in [*sources, contact]]):
            return SearchPhase.CUT
        at_limit = contact.fastest >= limit
        is_exact = excess < EXACT_DISTANCE or at_limit
        if is_exact and not self._reaches(contact, solution) and self.rejected <= MAX_REJECTED:
            return SearchPhase.REFINE
        if self._converged is not None and self._converged[0] != contact.fastest:
            speed, last_excess = self._converged
            measured = (excess - last_excess) / (contact.fastest / speed - 1.0)
            self._slope = float(np.clip(measured, 4.0 * FIRST_SLOPE, 0.4 * FIRST_SLOPE))
        self._converged = (contact.fastest, excess)
        if excess <= LEVEL_ATOL or at_limit or self.rejected > MAX_REJECTED:
            return SearchPhase.CONVERGED
        return SearchPhase.MOVE

    def _reaches(self, contact: ContactRows, solution: ProgramSolution) -> bool:
        """Return True if the exact jump speed of a law confirms the result of its program.

        ``solution`` is the solution of the program, which evaluates the contact force at a grid of
        speeds only. If the exact jump speed is lower, the grid ``contact`` is refined, and the law
        counts as rejected.
        """
        active = self.solver.other_than_goal(solution.active, contact.name)
        jump = self._evaluate(solution.unknowns, active)
        if jump.speed >= contact.fastest * (1.0 - JUMP_RTOL):
            return True
        self.rejected += 1
        contact.refine(jump, solution)
        return False

    def _evaluate(self, unknowns: FloatArray, active: tuple[str, ...]) -> Jump:
        """Return the exact jump speed of a law, and store the law if it is the best.

        ``active`` names the limits that the law reaches.
        """
        problem = self.solver.problem
        jump = find_jump(problem.space.law(unknowns, "design"), problem.follower, self.duration)
        if jump.speed > self.best_law.value:
            self.best_law = BestLaw(unknowns, jump.speed, active=active)
            self.solver.on_best(unknowns, jump.speed)
        return jump

    def _bound(self, contact: ContactRows, speed: float) -> float:
        """Return a speed above all jump speeds of the class, by (41) of docs/proofs.md.

        The search tries multiples of ``speed`` (rad/s). Its inequalities are necessary: every law
        with a higher jump speed satisfies them.
        """
        solver = self.solver
        sources = [WorkingRows(solver.static_program(False).blocks), *solver.row_sources(False)]
        contact.margin = 0.0  # necessary inequalities must not have a margin
        program = GrowingProgram()
        for factor in BOUND_FACTORS:
            contact.fastest = speed * factor
            for _ in range(MAX_SPEED_ROUNDS):
                try:
                    solution = solver.solve_rows([*sources, contact], program)
                except InfeasibleError as error:
                    if error.proved:
                        return contact.fastest
                    break
                if solution.bound <= 0.0:
                    return contact.fastest
                if not any([source.add_violated(solution) for source in [*sources, contact]]):
                    break
        raise DesignError(f"no bound was found up to {to_rpm(contact.fastest):.4g} rpm")
