"""A convex program in a design's unknowns and one level t, solved, and bounded by its multipliers.

The bound does not rest on the solver: any multipliers of the right signs give one (weak duality),
and these are put right and the bound computed here, in a few sums. Numbers in brackets are the
inequalities of docs/proofs.md, part 2.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from cam_rig.errors import DesignError
from cam_rig.extras import libraries_named
from cam_rig.units import FloatArray

#: An ordinate of a law is at most so many lifts.
BOX, LARGEST = 10.0, "ordinates"
#: How the solver is set, one after the other until it ends well. Left to itself it takes another
#: factorisation for larger programs, three times as slow on these.
ALWAYS = {"verbose": False, "max_iter": 400, "direct_solve_method": "qdldl"}
TUNINGS = (
    {"tol_feas": 1e-10, "tol_gap_abs": 1e-10, "tol_gap_rel": 1e-10},
    {"static_regularization_constant": 1e-7, "iterative_refinement_max_iter": 50},
    {"equilibrate_max_iter": 50, "reduced_tol_gap_rel": 1e-4, "reduced_tol_feas": 1e-4},
)

#: Where it does not, a solution is used that breaks no row, and is as near to its bound.
USABLE = 1e-5
#: Limits are proved to contradict each other for levels of no more than this size.
LEVELS = 1e4
#: A limit counts as active where it is met to this part of its scale.
ACTIVE = 1e-5


@dataclass(frozen=True, eq=False)
class Affine:
    """Values c + A x, ``(n,)``, of unknowns x ``(m,)``; A is sparse or dense, any of it complex."""

    constant: NDArray[Any]
    matrix: Any

    def __call__(self, unknowns: FloatArray) -> NDArray[Any]:
        """The values at unknowns ``(m,)``."""
        return np.asarray(self.constant + self.matrix @ unknowns)

    def __add__(self, other: Affine) -> Affine:
        return Affine(self.constant + other.constant, self.matrix + other.matrix)

    def __mul__(self, factor: float) -> Affine:
        return Affine(self.constant * factor, self.matrix * factor)

    def plus(self, number: float | FloatArray) -> Affine:
        """The values and a number more."""
        return Affine(self.constant + number, self.matrix)

    def mapped(self, matrix: Any) -> Affine:
        """``matrix`` times the values."""
        return Affine(np.asarray(matrix @ self.constant), matrix @ self.matrix)

    def rows(self, chosen: Any) -> Affine:
        """Some of the values, by indices, a mask or a slice."""
        return Affine(self.constant[chosen], self.matrix[chosen])

    def dense(self) -> Affine:
        """The same of a sparse matrix."""
        return Affine(self.constant, self.matrix.toarray())

    @staticmethod
    def number(value: float, unknowns: int) -> Affine:
        """One value, whatever the unknowns."""
        return Affine(np.full(1, value), sparse.csr_array((1, unknowns)))

    @staticmethod
    def stacked(parts: list[Affine]) -> Affine:
        """The values of all, one after the other."""
        matrices = [part.matrix for part in parts]
        is_sparse = sparse.issparse(matrices[0])
        matrix = sparse.vstack(matrices, "csr") if is_sparse else np.vstack(matrices)
        return Affine(np.concatenate([part.constant for part in parts]), matrix)


@dataclass(frozen=True)
class RowBlock:
    """Rows c + A x + w t: ≥ 0, = 0, or in cones of ``cone`` rows, the first one the radius.

    ``necessary`` rows are broken by no law that keeps its limits; others only prove that it does.
    """

    name: str
    rows: Affine
    weight: FloatArray
    kind: str
    cone: int = 1
    necessary: bool = True


@dataclass(frozen=True)
class ProgramSolution:
    """Unknowns ``(m,)``, the level t, what no law of the class exceeds, and the active limits.

    ``blocks`` and ``multipliers`` (one a row, the weights' sum −1) are what proves the bound.
    """

    unknowns: FloatArray
    level: float
    bound: float
    active: tuple[str, ...]
    blocks: list[RowBlock]
    multipliers: FloatArray


class InfeasibleError(DesignError):
    """No law of the class keeps the limits; ``fighting`` are those that contradict each other."""

    def __init__(self, fighting: tuple[str, ...], proved: bool = True) -> None:
        self.together = " and ".join(fighting[:2]) + (" at once" if len(fighting) > 1 else "")
        self.fighting, self.proved = fighting, proved
        super().__init__(
            f"no law of the class keeps {self.together}; allowed: looser limits, or more pieces"
        )


@dataclass
class ConvexProgram:
    """Limits on unknowns ``(unknowns,)``, and t, which is made as large as they allow."""

    unknowns: int
    link: Affine
    blocks: list[RowBlock] = field(default_factory=list)

    def at_least(
        self, name: str, rows: Affine, weight: float = 0.0, necessary: bool = True
    ) -> None:
        """Rows + weight · t ≥ 0."""
        weights = np.full(rows.constant.size, weight)
        self.blocks.append(RowBlock(name, rows, weights, "nonneg", necessary=necessary))

    def equal(self, name: str, rows: Affine) -> None:
        """Rows = 0."""
        self.blocks.append(RowBlock(name, rows, np.zeros(rows.constant.size), "zero"))

    def within(self, name: str, parts: Affine, radius: float = 0.0, weight: float = 0.0) -> None:
        """Root of the parts' squares ≤ radius + weight · t."""
        cone = Affine.stacked([Affine.number(radius, self.unknowns), parts])
        weights = np.zeros(cone.constant.size)
        weights[0] = weight
        self.blocks.append(RowBlock(name, cone, weights, "cone", weights.size))

    def solve(self) -> ProgramSolution:
        """The largest t."""
        with libraries_named():
            import clarabel
        blocks = self.all_blocks()
        rows, weights = _joined(blocks)
        matrix = sparse.csc_matrix(-_beside(rows.matrix, weights))
        halves = {"zero": clarabel.ZeroConeT, "nonneg": clarabel.NonnegativeConeT}
        cones: list[object] = []
        for block in blocks:
            size = block.weight.size
            if block.kind == "cone":
                cones += [clarabel.SecondOrderConeT(block.cone)] * (size // block.cone)
            else:
                cones.append(halves[block.kind](size))
        cost = np.zeros(self.unknowns + 1)
        cost[-1] = -1.0
        none = sparse.csc_matrix((cost.size, cost.size))
        best, fault = None, np.inf
        for tuning in TUNINGS:
            settings = clarabel.DefaultSettings()
            for key, value in {**ALWAYS, **tuning}.items():
                setattr(settings, key, value)
            solver = clarabel.DefaultSolver(none, cost, matrix, rows.constant, cones, settings)
            found = solver.solve()
            status, x, dual = str(found.status), np.array(found.x), np.array(found.z)
            if status in ("PrimalInfeasible", "AlmostPrimalInfeasible"):
                raise _infeasible(blocks, dual)
            if status in ("Solved", "AlmostSolved"):
                return solution_of(blocks, x, dual)
            broken = max(0.0, *(-float(_slack(block, x).min()) for block in blocks))
            if broken < min(fault, USABLE):
                best, fault = solution_of(blocks, x, dual), broken
        if best is None or not best.bound - best.level <= USABLE * max(1.0, abs(best.level)):
            raise DesignError(f"design: the solver ended with {status}; allowed: fewer pieces")
        return best

    def all_blocks(self) -> list[RowBlock]:
        """The link first, then equations, limits and (last) the largest ordinates."""
        linked = self.link.constant.size
        link = RowBlock("", self.link, np.zeros(linked), "zero")
        ranked = sorted(self.blocks, key=lambda block: block.kind != "zero")
        eye = sparse.eye_array(self.unknowns - linked, self.unknowns)
        matrix = sparse.vstack([eye, -eye], "csr")
        most = Affine(np.full(matrix.shape[0], BOX), matrix)
        return [link, *ranked, RowBlock(LARGEST, most, np.zeros(most.constant.size), "nonneg")]


def _infeasible(blocks: list[RowBlock], dual: FloatArray) -> InfeasibleError:
    share: dict[str, float] = {}
    for block, part in zip(blocks, _parts(blocks, dual), strict=True):
        if block.name:
            terms = abs(block.rows.matrix).sum(axis=1) + np.abs(block.rows.constant)
            share[block.name] = share.get(block.name, 0.0) + float(np.abs(part * terms).sum())
    most = max(share.values(), default=0.0)
    ranked = sorted(share.items(), key=lambda item: (item[0] == LARGEST, -item[1]))
    names = tuple(name for name, part in ranked if part > 1e-6 * most)
    # (40): no unknowns keep the rows for any |t| up to `LEVELS`
    y, weight = _in_cones(blocks, dual)
    refuted = bound_of(blocks, y) + abs(weight) * LEVELS < 0.0
    proved = all(block.necessary for block in blocks) and refuted
    return InfeasibleError(names or ("its limits",), proved)


def _joined(blocks: list[RowBlock]) -> tuple[Affine, FloatArray]:
    """All rows, one after the other, and their weights of t."""
    rows = Affine.stacked([block.rows for block in blocks])
    return rows, np.concatenate([block.weight for block in blocks])


def _beside(matrix: Any, weights: FloatArray) -> Any:
    return sparse.hstack([matrix, sparse.csr_array(weights[:, None])], "csr")


def _parts(blocks: list[RowBlock], of_rows: FloatArray) -> list[FloatArray]:
    """What stands for all rows, block by block: views."""
    return np.split(of_rows, np.cumsum([block.weight.size for block in blocks])[:-1])


def solution_of(blocks: list[RowBlock], x: FloatArray, dual: FloatArray) -> ProgramSolution:
    """Of unknowns with t as the last, and multipliers of all rows, as yet not scaled to t."""
    y, weight = _in_cones(blocks, dual)
    multipliers = y / -weight if weight < 0.0 else np.full(y.size, np.nan)
    met = (b.name for b in blocks if b.kind != "zero" and _slack(b, x).min() < ACTIVE)
    active, bound = tuple(dict.fromkeys(met)), bound_of(blocks, multipliers)
    return ProgramSolution(x[:-1], float(x[-1]), bound, active, blocks, multipliers)


def _slack(block: RowBlock, x: FloatArray) -> FloatArray:
    """How far each row, or each cone, is from being broken; of an equation how far it is off."""
    values = np.asarray(block.rows(x[:-1]) + block.weight * x[-1])
    if block.kind == "cone":
        cones = values.reshape(-1, block.cone)
        return np.asarray(cones[:, 0] - np.linalg.norm(cones[:, 1:], axis=1))
    return -np.abs(values) if block.kind == "zero" else values


def _in_cones(blocks: list[RowBlock], dual: FloatArray) -> tuple[FloatArray, float]:
    """The solver's multipliers, put into the cones, and what they weigh t with.

    The first block links the last unknowns to the others, with −1 each: its multipliers are made
    such that those unknowns drop out (39).
    """
    y = dual.copy()
    rows, weights = _joined(blocks)
    for block, part in zip(blocks, _parts(blocks, y), strict=True):
        if block.kind == "nonneg":
            np.maximum(part, 0.0, out=part)
        elif block.kind == "cone":
            cones = part.reshape(-1, block.cone)
            cones[:, 0] = np.maximum(cones[:, 0], np.linalg.norm(cones[:, 1:], axis=1))
    linked = blocks[0].weight.size
    y[:linked] += (rows.matrix.T @ y)[-linked:]
    return y, float(weights @ y)


def bound_of(blocks: list[RowBlock], multipliers: FloatArray) -> float:
    """Return yᵀc + β Σ|(Aᵀy)ⱼ|, which t cannot exceed if yᵀw = −1 (39); β is `BOX`."""
    if np.isnan(multipliers).any():
        return np.inf
    rows, _ = _joined(blocks)
    rest = (rows.matrix.T @ multipliers)[: -blocks[0].weight.size]
    return float(rows.constant @ multipliers) + float(np.abs(rest).sum()) * BOX


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
            if new:
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
        matrix = _beside(block.rows.matrix[new], block.weight[new])
        free = np.full(len(new), np.inf)
        starts, columns = (part.astype(np.int32) for part in (matrix.indptr[:-1], matrix.indices))
        self._solver.addRows(len(new), -free, free, matrix.nnz, starts, columns, matrix.data)


def _keys(block: RowBlock) -> Iterator[tuple[bytes, Bounds]]:
    """What tells each row from others, constants apart, and its bounds."""
    matrix, kind = block.rows.matrix, block.kind.encode()
    columns, values, wide = matrix.indices.tobytes(), matrix.data.tobytes(), matrix.indices.itemsize
    ends = pairwise(matrix.indptr.tolist())
    numbers = zip(block.weight.tolist(), (-block.rows.constant).tolist(), strict=True)
    for (begin, end), (weight, least) in zip(ends, numbers, strict=True):
        own = columns[wide * begin : wide * end], values[8 * begin : 8 * end]
        key = b"".join((kind, struct.pack("d", weight), *own))
        yield key, (least, least if block.kind == "zero" else np.inf)
