"""The best law of a class: programs solved in rounds, and speeds by the roots of their levels."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from cam_rig.dynamics.jump.any_follower import find_jump
from cam_rig.dynamics.jump.rigid_mass import rigid_jump_speed
from cam_rig.dynamics.jump.two_masses import FASTEST, Jump
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
from cam_rig.studies.design.space import Asked, DesignProblem
from cam_rig.studies.design.two_mass_contact import MARGIN, ContactKept, Residual
from cam_rig.units import RPM, FloatArray, to_rpm

#: Of a program's thousands of rows every so many-th is taken at first; one is broken where it is
#: below zero by so much.
FIRST_ROWS, BROKEN = 24, 1e-9
#: With them those are taken that are no farther above it than this.
NEARLY = 1e-3
#: Rounds of cuts, at most; of a search of the jump speed of two masses.
MAX_ROUNDS, MAX_SEARCHED = 80, 120
#: A jump speed is found to this part.
SPEED = 2e-5


@dataclass(eq=False)
class FewRows:
    """Rows of a program, of which those are taken that a solution breaks or nearly meets.

    Every ``every``-th inequality is taken from the beginning, and all others.
    """

    all_rows: list[RowBlock]
    every: int = FIRST_ROWS
    taken: list[NDArray[np.bool_]] = field(default_factory=list)

    def __post_init__(self) -> None:
        for block in self.all_rows:
            taken = np.zeros(block.weight.size, dtype=bool)
            taken[:: 1 if block.kind != "nonneg" else self.every] = True
            self.taken.append(taken)

    @property
    def blocks(self) -> list[RowBlock]:
        """Those taken so far."""
        return [
            replace(block, rows=block.rows.rows(taken), weight=block.weight[taken])
            for block, taken in zip(self.all_rows, self.taken, strict=True)
        ]

    def cut(self, solution: ProgramSolution) -> bool:
        """Take what a solution breaks, and what is near it; whether it breaks anything."""
        broken = False
        for block, taken in zip(self.all_rows, self.taken, strict=True):
            values = block.rows(solution.unknowns) + block.weight * solution.level
            broken |= bool((~taken & (values < -BROKEN)).any())
            np.logical_or(taken, values < NEARLY, out=taken)
        return broken


#: Told a law's unknowns and its goal's value (SI).
Told = Callable[[FloatArray, float], None]
#: Rows that are added where a law is seen to need them.
Cuts = FewRows | ContactKept | Residual


@dataclass(frozen=True)
class Best:
    """The best law of a class by a goal: unknowns, its value and the bound on it (SI).

    ``active`` names the limits that hold it; ``rounds`` is how many programs were solved, none of
    a law that a search has found on its way. One of several descents has ``multistart`` and no
    bound: nothing says how much better another may be.
    """

    unknowns: FloatArray
    value: float = math.nan
    bound: float | None = None
    active: tuple[str, ...] = ()
    rounds: int = 0
    multistart: Multistart | None = None


@dataclass(eq=False)
class Solver:
    """One goal over one class, under limits; ``on_best`` is told better laws and values (SI)."""

    problem: DesignProblem
    goal: Asked
    limits: list[Asked]
    on_best: Told = lambda _x, _v: None
    rounds: int = 0
    _static: dict[bool, ConvexProgram] = field(default_factory=dict)

    def best(self) -> Best:
        """Solve it; where the sufficient program has no law, one may still be: it is said."""
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
                f"a law of the class may keep {error.together}, but none was found whose "
                "ordinates prove it; allowed: limits looser by 0.1 %, or more pieces"
            ) from None

    def static(self, hull: bool) -> ConvexProgram:
        """The rows of lift and limits that need no rounds."""
        if hull not in self._static:
            program = ConvexProgram(self.problem.space.unknowns, self.problem.space.link)
            keep_lift(program, self.problem, hull)
            for limit in self.limits:
                rows = rows_of(limit.term)
                if rows.run is not None and rows.run.rigid:
                    assert limit.value is not None
                    pressed = force_parts(self.problem, limit.value, hull)
                    program.at_least(limit.name, pressed, necessary=not hull)
                elif rows.run is None and not rows.in_rounds:
                    add(program, self.problem, limit, hull)
            self._static[hull] = program
        return replace(self._static[hull], blocks=list(self._static[hull].blocks))

    def cuts(self, hull: bool) -> list[Cuts]:
        """The limits that need rounds; with something to spare where they are to be kept."""
        found: list[Cuts] = []
        for limit in self.limits:
            rows = rows_of(limit.term)
            if rows.in_rounds:
                found.append(Residual(self.problem, limit, hull))
            elif rows.run is not None and not rows.run.rigid:
                assert limit.value is not None
                duration, margin = rows.run.duration, MARGIN if hull else 0.0
                kept = ContactKept(
                    self.problem, duration, limit.value, limit.name, limit=True, margin=margin
                )
                # first rows of a force: where the best law without vibration would be lowest
                program = self.static(True)
                program.at_least("rigid", force_parts(self.problem, kept.fastest, True), -1.0)
                kept.look(self.settled(program, []).unknowns, 0.5)
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
        rounds = [FewRows(program.blocks), *cuts]
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
        scale = -sign_of(self.goal.sense) * self.goal.scale
        found = {}
        for hull in (False, True):  # points first: where they have no law there is none
            program, cuts = self.static(hull), self.cuts(hull)
            if rows_of(self.goal.term).in_rounds:
                cuts.append(Residual(self.problem, self.goal, hull))
            else:
                add(program, self.problem, self.goal, hull)
            found[hull] = self.settled(program, cuts)
        best, bound = found[True], found[False].bound * scale
        self.on_best(best.unknowns, best.level * scale)
        active = self.other_than_goal(best.active)
        return Best(best.unknowns, best.level * scale, bound, active, self.rounds)

    def other_than_goal(self, active: tuple[str, ...], *more: str) -> tuple[str, ...]:
        """Names of active limits, without the goal's."""
        return tuple(name for name in active if name not in (self.goal.name, *more))

    def rigid(self) -> Best:
        """The highest speed at which the least force of one rigid mass can be above zero."""
        found: dict[float, ProgramSolution] = {}
        possible = self.static(False)  # limits that no law keeps at points: proved for the class
        one = Affine.number(1.0, possible.unknowns)
        possible.at_least("level", one, -1.0)  # no goal: t is at most 1
        self.settled(possible, [])

        def level(speed: float, hull: bool) -> float:
            program = self.static(hull)
            rows = force_parts(self.problem, speed, hull)
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
        for _ in range(MAX_ROUNDS):  # (41) of docs/proofs.md, at the speed that is returned
            if level(bound, False) <= 0.0:
                break
            bound *= 1.0 + SPEED
        else:
            raise DesignError(f"no bound was proved up to {to_rpm(bound):.6g} rpm")
        value = rigid_jump_speed(self.problem.space.law(law.unknowns, "design"), self.problem.rigid)
        return Best(law.unknowns, value, bound, self.other_than_goal(law.active), self.rounds)

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
                    raise DesignError(
                        "no law of the class keeps contact at 1 rpm; on a dwell the force is the "
                        "preload: a rig without one needs a small one here"
                    )
        return float(brentq(level, low, high, xtol=1e-12, rtol=SPEED))


# Two masses: cuts and the speed itself in one search.

#: Laws that the exact search may refuse.
MAX_REFUSED = 24
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
    """The highest jump speed of two masses: cuts and the speed itself are found in one search.

    The level of a program at a speed only falls as rows are added. Where it is below the margin
    the speed is too high, at once; where the law that it gives holds on the grid, the exact search
    looks at that law, and the speed goes up. Both move by the slope of the level, which is nearly
    straight. ``duration`` (s) is that of a run from rest; None is the steady state.
    """

    solver: Solver
    duration: float | None

    def __post_init__(self) -> None:
        self.problem = self.solver.problem
        self.law: tuple[float, FloatArray, tuple[str, ...]] = (0.0, np.zeros(0), ())
        self.refused = 0

    def best(self) -> Best:
        """The best law found, and a speed that no law of the class reaches."""
        rigid = Solver(self.problem, self.solver.goal, self.solver.limits).rigid()
        assert rigid.bound is not None
        self.solver.rounds += rigid.rounds
        kept = ContactKept(self.problem, self.duration, 0.95 * rigid.bound)
        cuts = [FewRows(self.solver.static(True).blocks), *self.solver.cuts(True)]
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
        for _ in range(MAX_SEARCHED):
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
        active = self.solver.other_than_goal(found.active, kept.name)
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
        """Return a speed above all jump speeds of the class, by (41) of docs/proofs.md.

        The rows are some of those that each law with a higher jump speed satisfies.
        """
        cuts = [FewRows(self.solver.static(False).blocks), *self.solver.cuts(False)]
        kept.margin = 0.0  # contact is kept above zero: more than that no law has to
        program = GrowingProgram()
        for above in ABOVE:
            kept.fastest = speed * above
            for _ in range(MAX_SEARCHED):
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
