"""The best law of a class: programs solved in rounds, and speeds by the roots of their levels."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.optimize import brentq

from cam_rig.dynamics.jump.any_follower import find_jump
from cam_rig.dynamics.jump.jump_speed import FROM_REST, rigid_jump_speed
from cam_rig.dynamics.jump.search import FASTEST
from cam_rig.errors import ConfigError, DesignError, DynamicsError
from cam_rig.extras import libraries_named
from cam_rig.law_design.constraints import Asked, DesignProblem, add, force, keep_lift
from cam_rig.law_design.convex_program import (
    BOX,
    Affine,
    ConvexProgram,
    InfeasibleError,
    ProgramSolution,
    RowBlock,
    solution_of,
)
from cam_rig.law_design.two_mass_contact import MARGIN, ContactKept, Residual
from cam_rig.units import RPM, FloatArray, to_rpm

# Of a program's thousands of rows the few that a solution breaks or nearly meets.

#: Every so many-th row is taken at first; one is broken where it is below zero by so much.
FIRST_ROWS, BROKEN = 24, 1e-9

#: With them those are taken that are no farther above it than this.
NEARLY = 1e-3


@dataclass(eq=False)
class FewRows:
    """Rows of a program, of which those are taken that a solution breaks or nearly meets."""

    program: ConvexProgram
    taken: list[NDArray[np.bool_]] = field(default_factory=list)

    def __post_init__(self) -> None:
        for block in self.program.blocks:
            taken = np.zeros(block.weight.size, dtype=bool)
            taken[:: 1 if block.kind != "nonneg" else FIRST_ROWS] = True
            self.taken.append(taken)

    @property
    def blocks(self) -> list[RowBlock]:
        """Those taken so far."""
        return [
            replace(block, rows=block.rows.rows(taken), weight=block.weight[taken])
            for block, taken in zip(self.program.blocks, self.taken, strict=True)
        ]

    def cut(self, solution: ProgramSolution) -> bool:
        """Take what a solution breaks, and what is near it; whether it breaks anything."""
        broken = False
        for block, taken in zip(self.program.blocks, self.taken, strict=True):
            values = block.rows(solution.unknowns) + block.weight * solution.level
            broken |= bool((~taken & (values < -BROKEN)).any())
            np.logical_or(taken, values < NEARLY, out=taken)
        return broken


# Linear programs that differ by a few rows, each solved from where the last one ended.

#: What rows and multipliers may be broken by; of a limit's scale.
TOLERANCE = 1e-9

#: How the solver is set. Left to itself it simplifies each program anew, and looks for a method.
OPTIONS: dict[str, bool | int | str | float] = {
    "output_flag": False,
    "threads": 1,
    "presolve": "off",
    "solver": "simplex",
    "simplex_scale_strategy": 2,
    "primal_feasibility_tolerance": TOLERANCE,
    "dual_feasibility_tolerance": TOLERANCE,
}

#: Least and largest of a row.
Bounds = tuple[float, float]


class GrowingProgram:
    """Programs of the same unknowns, one after the other."""

    def __init__(self) -> None:
        self._solver: Any = None
        #: The solver's row of each that it has, and the bounds of those in use.
        self._index: dict[bytes, int] = {}
        self._bounds: dict[int, Bounds] = {}

    def solve(self, program: ConvexProgram) -> ProgramSolution:
        """The largest t, as `ConvexProgram.solve`, which takes one with cones or without law."""
        blocks = program.all_blocks()
        if any(block.kind == "cone" for block in blocks):
            return program.solve()
        with libraries_named():
            import highspy
        if self._solver is None:
            self._begin(program, highspy)
        self._drop(highspy.HighsBasisStatus.kBasic)
        rows = self._take(blocks[:-1])  # columns have the largest ordinates
        self._solver.run()
        if self._solver.getModelStatus() != highspy.HighsModelStatus.kOptimal:
            self._solver = None
            return program.solve()
        found = self._solver.getSolution()
        dual = np.zeros(sum(block.weight.size for block in blocks))
        dual[list(rows.values())] = np.array(found.row_dual)[list(rows)]
        return solution_of(blocks, np.array(found.col_value), dual)

    def _begin(self, program: ConvexProgram, highspy: Any) -> None:
        solver = self._solver = highspy.Highs()
        self._index, self._bounds = {}, {}
        for name, value in OPTIONS.items():
            solver.setOptionValue(name, value)
        size = program.unknowns + 1
        most = np.full(size, np.inf)
        most[: program.unknowns - program.link.constant.size] = BOX
        solver.addVars(size, -most, most)
        solver.changeColCost(size - 1, -1.0)

    def _drop(self, basic: Any) -> None:
        """Drop the rows that are free, but for those that the basis needs."""
        status = self._solver.getBasis().row_status
        dropped = {at for at, of in enumerate(status) if of == basic and at not in self._bounds}
        if dropped:
            self._solver.deleteRows(len(dropped), np.array(sorted(dropped), dtype=np.int32))
            kept = [(key, at) for key, at in self._index.items() if at not in dropped]
            self._index = {key: place for place, (key, _) in enumerate(kept)}
            place_of = {at: place for place, (_, at) in enumerate(kept)}
            self._bounds = {place_of[at]: bounds for at, bounds in self._bounds.items()}

    def _take(self, blocks: list[RowBlock]) -> dict[int, int]:
        """Make these the rows in use; where each of the solver's rows stands among them."""
        in_use: dict[int, Bounds] = {}
        places: dict[int, int] = {}
        first = 0
        for block in blocks:
            new = []
            for row, (key, bounds) in enumerate(_keys(block)):
                if key not in self._index:
                    self._index[key] = len(self._index)
                    new.append(row)
                at = self._index[key]
                if at not in in_use or bounds > in_use[at]:  # of equal rows the tightest
                    in_use[at], places[at] = bounds, first + row
            self._add(block, new)
            first += block.weight.size
        for at, bounds in in_use.items():
            if self._bounds.get(at) != bounds:
                self._solver.changeRowBounds(at, *bounds)
        for at in self._bounds.keys() - in_use.keys():
            self._solver.changeRowBounds(at, -np.inf, np.inf)
        self._bounds = in_use
        return places

    def _add(self, block: RowBlock, new: list[int]) -> None:
        """Give the solver some rows of a block, as yet free."""
        if not new:
            return
        weights = sparse.csr_array(block.weight[new][:, None])
        matrix = sparse.csr_array(sparse.hstack([block.rows.matrix[new], weights], format="csr"))
        free = np.full(len(new), np.inf)
        starts, columns = (part.astype(np.int32) for part in (matrix.indptr[:-1], matrix.indices))
        self._solver.addRows(len(new), -free, free, matrix.nnz, starts, columns, matrix.data)


def _keys(block: RowBlock) -> Iterator[tuple[bytes, Bounds]]:
    """What tells each row from others, constants apart, and its bounds."""
    matrix, equal = block.rows.matrix, block.kind == "zero"
    columns, values, weights = matrix.indices.tobytes(), matrix.data.tobytes(), block.weight
    wide = matrix.indices.itemsize
    starts = matrix.indptr.tolist()
    kind = block.kind.encode()
    for row, (weight, constant) in enumerate(
        zip(weights.tolist(), block.rows.constant.tolist(), strict=True)
    ):
        begin, end = starts[row], starts[row + 1]
        key = b"".join(
            (
                kind,
                struct.pack("d", weight),
                columns[wide * begin : wide * end],
                values[8 * begin : 8 * end],
            )
        )
        yield key, (-constant, -constant if equal else np.inf)


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
        from cam_rig.law_design.methods import TwoMassSearch

        return TwoMassSearch(self).best()


def is_cut(limit: Asked) -> bool:
    """Whether a limit's rows are found in rounds."""
    name = limit.term.name
    return name == "residual_vibration" or name in ("jump_speed", "jump_speed_steady")
