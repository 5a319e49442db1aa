"""The highest jump speed of two masses: cuts and the speed itself are found in one search.

The level of a program at a speed only falls as rows are added. Where it is below the margin the
speed is too high, at once; where the law that it gives holds on the grid, the exact search looks
at that law, and the speed goes up. Both move by the slope of the level, which is nearly straight.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cam_rig.dynamics.jump.any_follower import find_jump
from cam_rig.dynamics.jump.jump_speed import FROM_REST, Jump
from cam_rig.errors import DesignError
from cam_rig.law_design.convex_program import InfeasibleError, ProgramSolution
from cam_rig.law_design.cutting_planes import Best, Cuts, FewRows, GrowingProgram, Solver
from cam_rig.law_design.two_mass_contact import MARGIN, ContactKept
from cam_rig.units import FloatArray, to_rpm

#: Rounds of cuts, at most, and laws that the exact search may refuse.
MAX_ROUNDS, MAX_REFUSED = 120, 24

#: A speed is settled where the level is no farther from the margin; a law holds a speed where the
#: exact search finds its jump no lower by more than this part.
NEAR, HELD = 4e-3, 5e-4

#: Searches, until a law is no farther from its bound than this part.
SEARCHES, NEAR_BOUND = 6, 2e-3

#: A law is searched exactly where the level is no farther above the margin: else it goes faster.
FAR = 0.1

#: First guess of what the level falls by where the speed doubles, and the largest step of a speed.
SLOPE, MAX_STEP = -11.0, 0.06

#: A search that ends with a law that holds less than this part of its speed has found the bound's
#: place alone.
HALF_WAY = 0.95

#: Speeds over the best law's at which a bound is sought.
ABOVE = (1.0008, 1.0016, 1.0025, 1.004, 1.007, 1.012, 1.02, 1.04, 1.08, 1.15, 1.3)


@dataclass(eq=False)
class TwoMassSearch:
    """The search of one design."""

    solver: Solver

    def __post_init__(self) -> None:
        self.problem = self.solver.problem
        self.duration = FROM_REST if self.solver.goal.term.name == "jump_speed" else None
        self.law: tuple[float, FloatArray, tuple[str, ...]] = (0.0, np.zeros(0), ())
        self.refused = 0

    def best(self) -> Best:
        """The best law found, and a speed that no law of the class reaches."""
        rigid = Solver(self.problem, self.solver.goal, self.solver.limits).rigid()
        self.solver.rounds += rigid.rounds
        kept = ContactKept(self.problem, self.duration, 0.95 * rigid.bound)
        cuts = [FewRows(self.solver.static(True)), *self.solver.cuts(True)]
        kept.look(rigid.unknowns, 0.5)
        self._take(rigid.unknowns, rigid.active)
        bound = np.inf
        for _ in range(SEARCHES):
            far = bound < np.inf and bound > self.law[0] / HALF_WAY
            most = kept.fastest if far else np.inf
            self._search(kept, cuts, most)
            if self.law[0] < most * (1.0 - HELD):  # else it only says that more may be had
                held = self.law[0] > HALF_WAY * kept.fastest
                bound = min(bound, self._bound(kept, self.law[0] if held else kept.fastest))
            if bound <= self.law[0] * (1.0 + NEAR_BOUND):
                break
            # the grid has grown by what was refused: what lies between its speeds is less now
            kept.margin, self.refused, kept.fastest = MARGIN, 0, 0.5 * (bound + self.law[0])
        speed, unknowns, active = self.law
        return Best(unknowns, speed, bound, active, self.solver.rounds)

    def _search(self, kept: ContactKept, cuts: list[Cuts], most: float) -> None:
        """The highest speed that a law is found for, or one that keeps contact up to ``most``."""
        slope, settled, found = SLOPE, None, None
        program = GrowingProgram()
        for _ in range(MAX_ROUNDS):
            try:
                found = self.solver.solved([*cuts, kept], program)
            except InfeasibleError:  # at this speed the dwells alone leave no law
                kept.move(1.0 - MAX_STEP)
                continue
            room = found.level - kept.margin
            if room > -NEAR:
                if any([cut.cut(found) for cut in [*cuts, kept]]):
                    continue
                there = kept.fastest >= most
                exact = room < FAR or there
                if exact and not self._held(kept, found) and self.refused <= MAX_REFUSED:
                    continue
                if settled is not None and settled[0] != kept.fastest:
                    measured = (room - settled[1]) / (kept.fastest / settled[0] - 1.0)
                    slope = float(np.clip(measured, 4.0 * SLOPE, 0.4 * SLOPE))
                settled = (kept.fastest, room)
                if room <= NEAR or there or self.refused > MAX_REFUSED:
                    return
            step = float(np.clip(-room / slope, -MAX_STEP, MAX_STEP))
            kept.move(min(1.0 + step, most / kept.fastest))
        if found is not None:  # out of rounds, or resonances narrower than the grid
            self._held(kept, found)

    def _held(self, kept: ContactKept, found: ProgramSolution) -> bool:
        """Whether the exact search finds that a law holds the speed; else its own is looked at."""
        names = (self.solver.goal.name, kept.name)
        active = tuple(name for name in found.active if name not in names)
        jump = self._take(found.unknowns, active)
        if jump.speed >= kept.fastest * (1.0 - HELD):
            return True
        self.refused += 1
        kept.refine(jump, found)
        return False

    def _take(self, unknowns: FloatArray, active: tuple[str, ...]) -> Jump:
        """Where the exact search finds that a law loses contact; it is kept if it is the best."""
        law = self.problem.space.law(unknowns, "design")
        jump = find_jump(law, self.problem.follower, self.duration)
        if jump.speed > self.law[0]:
            self.law = (jump.speed, unknowns, active)
            self.solver.on_best(unknowns, jump.speed)
        return jump

    def _bound(self, kept: ContactKept, speed: float) -> float:
        """A speed at which the rows, some of those that a law must keep, leave no law."""
        cuts = [FewRows(self.solver.static(False)), *self.solver.cuts(False)]
        kept.margin = 0.0  # contact is kept above zero: more than that no law has to
        program = GrowingProgram()
        for above in ABOVE:
            kept.fastest = speed * above
            for _ in range(MAX_ROUNDS):
                try:
                    found = self.solver.solved([*cuts, kept], program)
                except InfeasibleError as error:
                    if error.proved:
                        return kept.fastest
                    break
                if found.bound <= 0.0:
                    return kept.fastest
                if not any([cut.cut(found) for cut in [*cuts, kept]]):
                    break
        raise DesignError(f"no bound was found up to {to_rpm(kept.fastest):.4g} rpm")
