"""The best law of a class: programs solved in rounds, and speeds by the roots of their levels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from scipy import sparse
from scipy.optimize import brentq

from cam_rig.arrays import FloatArray
from cam_rig.errors import ConfigError, DesignError, DynamicsError
from cam_rig.studies.design.constraints import Asked, add, force, keep_lift
from cam_rig.studies.design.elastic.contact_kept import MARGIN, ContactKept
from cam_rig.studies.design.elastic.residual import Residual
from cam_rig.studies.design.problem import DesignProblem
from cam_rig.studies.design.programs.affine import Affine
from cam_rig.studies.design.programs.few_rows import FewRows
from cam_rig.studies.design.programs.growing import GrowingProgram
from cam_rig.studies.design.programs.program import (
    ConvexProgram,
    InfeasibleError,
    ProgramSolution,
    RowBlock,
)
from cam_rig.studies.jump.any_rig import find_jump
from cam_rig.studies.jump.contact_lost_speed import FROM_REST
from cam_rig.studies.jump.rigid import rigid_jump_speed
from cam_rig.studies.jump.search import FASTEST
from cam_rig.units import RPM, to_rpm

#: Rounds of cuts, at most.
MAX_ROUNDS = 80
#: A jump speed is found to this part.
SPEED = 2e-5


class Cuts(Protocol):
    """Rows that are added where a law is seen to need them."""

    @property
    def blocks(self) -> list[RowBlock]:
        """Those so far."""

    def cut(self, solution: ProgramSolution) -> bool:
        """Add what a solution breaks; whether that is anything."""


@dataclass(frozen=True)
class Best:
    """The best law of a class by a goal: unknowns, its value and the bound on it (SI).

    ``active`` names the limits that hold it; ``rounds`` is how many programs were solved.
    """

    unknowns: FloatArray
    value: float
    bound: float
    active: tuple[str, ...]
    rounds: int


@dataclass(eq=False)
class Solver:
    """One goal over one class, under limits.

    ``on_best`` is told each law that is better than the ones before: unknowns and value (SI).
    """

    problem: DesignProblem
    goal: Asked
    limits: list[Asked]
    on_best: Callable[[FloatArray, float], None] = lambda _x, _v: None
    rounds: int = 0
    _static: dict[bool, ConvexProgram] = field(default_factory=dict)

    def best(self) -> Best:
        """Solve it.

        Where the sufficient program has no law, one may still be: the message says so.

        Raises
        ------
        InfeasibleError : no law of the class keeps the limits
        ConfigError, DesignError, DynamicsError : a limit that the cam or the rig has not; the
            solver did not end; contact lost at no speed
        """
        try:
            return self._best()
        except InfeasibleError as error:
            if error.proved:
                raise
            raise DesignError(
                f"a law of the class may keep {error.together}, but none was found whose "
                "ordinates prove it; allowed: limits looser by 0.1 %, or more pieces"
            ) from None

    def _best(self) -> Best:
        name = self.goal.term.name
        if name == "jump_speed_rigid" or (name == "jump_speed" and not self.problem.two_masses):
            return self.rigid()
        if name.startswith("jump_speed"):
            return self._two_masses()
        return self._level()

    def static(self, hull: bool) -> ConvexProgram:
        """The rows of lift and limits that need no rounds."""
        if hull not in self._static:
            program = ConvexProgram(self.problem.space.unknowns, self.problem.space.link)
            keep_lift(program, self.problem, hull)
            for limit in self.limits:
                if not is_cut(limit):
                    self._add(program, limit, hull)
            self._static[hull] = program
        return self._static[hull].copy()

    def _add(self, program: ConvexProgram, limit: Asked, hull: bool) -> None:
        name = limit.term.name
        if name.startswith("jump_speed"):  # of one rigid mass
            assert limit.value is not None
            rows = force(self.problem, limit.value, hull) * (1.0 / self.problem.force_scale)
            program.at_least(limit.name, rows, necessary=not hull)
        else:
            add(program, self.problem, limit, hull)

    def cuts(self, hull: bool) -> list[Cuts]:
        """The limits that need rounds; with something to spare where they are to be kept."""
        found: list[Cuts] = []
        for limit in self.limits:
            if limit.term.name == "residual_vibration":
                found.append(Residual(self.problem, limit, hull))
            elif is_cut(limit):
                assert limit.value is not None
                duration = FROM_REST if limit.term.name == "jump_speed" else None
                margin = MARGIN if hull else 0.0
                kept = ContactKept(self.problem, duration, limit.value, limit.name, True, margin)
                self._begin(kept)
                found.append(kept)
        return found

    def solved(self, cuts: list[Cuts], growing: GrowingProgram | None = None) -> ProgramSolution:
        """One program of what was cut."""
        self.rounds += 1
        blocks = [block for cut in cuts for block in cut.blocks]
        space = self.problem.space
        program = ConvexProgram(space.unknowns, space.link, blocks)
        return program.solve() if growing is None else growing.solve(program)

    def settled(self, program: ConvexProgram, cuts: list[Cuts]) -> ProgramSolution:
        """Solve, cut and solve again until nothing is cut; the program's rows are cuts too."""
        rounds = [FewRows(program), *cuts]
        for _ in range(MAX_ROUNDS):
            found = self.solved(rounds)
            if not any([cut.cut(found) for cut in rounds]) and self._confirmed(cuts, found):
                return found
        raise DesignError(
            f"design: {MAX_ROUNDS} rounds of cuts did not settle; allowed: fewer pieces, or a "
            "narrower range of speeds"
        )

    def _confirmed(self, cuts: list[Cuts], found: ProgramSolution) -> bool:
        """Whether the exact search finds that limits on a jump speed are kept; else look closer."""
        kept = [cut for cut in cuts if isinstance(cut, ContactKept) and cut.margin > 0.0]
        law = self.problem.space.law(found.unknowns, "design")
        for cut in kept:
            jump = find_jump(law, self.problem.follower, cut.duration)
            if jump.speed < cut.fastest:
                cut.refine(jump, found)
                return False
        return True

    def _level(self) -> Best:
        """A goal that is the program's own level."""
        sign = -1.0 if self.goal.sense == "<=" else 1.0
        found = {}
        for hull in (False, True):  # points first: where they have no law there is none
            program, cuts = self.static(hull), self.cuts(hull)
            if self.goal.term.name == "residual_vibration":
                cuts.append(Residual(self.problem, self.goal, hull))
            else:
                add(program, self.problem, self.goal, hull)
            found[hull] = self.settled(program, cuts)
            if hull:
                level = sign * found[hull].level * self.goal.scale
                self.on_best(found[hull].unknowns, level)
        value, bound = found[True].level, found[False].bound
        scale = sign * self.goal.scale
        active = tuple(n for n in found[True].active if n != self.goal.name)
        return Best(found[True].unknowns, value * scale, bound * scale, active, self.rounds)

    def rigid(self) -> Best:
        """The highest speed at which the least force of one rigid mass can be above zero."""
        found: dict[float, ProgramSolution] = {}

        self._require_a_law()

        def level(speed: float, hull: bool) -> float:
            program = self.static(hull)
            rows = force(self.problem, speed, hull) * (1.0 / self.problem.force_scale)
            program.at_least(self.goal.name, rows, -1.0, not hull)
            found[speed] = self.settled(program, self.cuts(hull))
            if hull and found[speed].level > 0.0:
                self.on_best(found[speed].unknowns, speed)
            return found[speed].level if hull else found[speed].bound

        first = rigid_jump_speed(self.problem.start, self.problem.rigid)
        top = self._root(lambda speed: level(speed, True), min(first, FASTEST * RPM))
        held = max(speed for speed, solution in found.items() if solution.level >= 0.0)
        law = found[held]
        bound = self._root(lambda speed: level(speed, False), top)
        for _ in range(MAX_ROUNDS):  # it is proved where it is said
            if level(bound, False) <= 0.0:
                break
            bound *= 1.0 + SPEED
        else:
            raise DesignError(f"no bound was proved up to {to_rpm(bound):.6g} rpm")
        value = rigid_jump_speed(self.problem.space.law(law.unknowns, "design"), self.problem.rigid)
        active = tuple(name for name in law.active if name != self.goal.name)
        return Best(law.unknowns, value, bound, active, self.rounds)

    def _require_a_law(self) -> None:
        """Refuse limits that no law keeps at points of the turn: it is a proof for the class."""
        program, size = self.static(False), self.problem.space.unknowns
        none = Affine(np.ones(1), sparse.csr_array((1, size)))
        program.at_least("level", none, -1.0)  # no goal: t is at most 1
        self.settled(program, [])

    def _root(self, level: Callable[[float], float], first: float) -> float:
        """Where a level that falls with speed is zero."""
        low = high = first
        ratio = 1.02
        if level(first) > 0.0:
            while level(high := high * ratio) > 0.0:
                low, ratio = high, ratio**1.7
                if high > FASTEST * RPM:
                    raise DynamicsError(
                        f"the class has laws that keep contact beyond {FASTEST:g} rpm; allowed: "
                        "a limit on what lets it, such as peak_acceleration<=start"
                    )
        else:
            while level(low := low / ratio) <= 0.0:
                high, ratio = low, ratio**1.7
                if low < RPM:
                    raise DesignError("no law of the class keeps contact at 1 rpm")
        return float(brentq(level, low, high, xtol=1e-12, rtol=SPEED))

    def _begin(self, kept: ContactKept) -> None:
        """First rows of a force: where the best law without vibration would be lowest."""
        program = self.static(True)
        rows = force(self.problem, kept.fastest, True) * (1.0 / self.problem.force_scale)
        program.at_least("rigid", rows, -1.0)
        kept.look(self.settled(program, []).unknowns, 0.5)

    def _two_masses(self) -> Best:
        """The highest speed up to which the least force of two masses can be above zero."""
        if not self.problem.two_masses:
            raise ConfigError(
                f"goal {self.goal.term.name}: rig {self.problem.rig.name!r} does not say how its "
                "mass is split; allowed: jump_speed_rigid, or follower.roller_share and "
                "follower.stem_damping in the rig file"
            )
        # it asks this module back
        from cam_rig.studies.design.elastic.two_mass_search import TwoMassSearch

        return TwoMassSearch(self).best()


def is_cut(limit: Asked) -> bool:
    """Whether a limit's rows are found in rounds."""
    name = limit.term.name
    return name == "residual_vibration" or name in ("jump_speed", "jump_speed_steady")
