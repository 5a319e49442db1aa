"""Convex programs of a design, and upper bounds that their multipliers prove.

A program maximises a level t over the unknowns x of a law, under linear and conic limits. Each
inequality or equation c + A x + w t is a row, and w is its weight. The bound does not rely on the
solver, because any multipliers of the right signs give a bound (weak duality). The solver's
multipliers are corrected, and the bound is computed from them in a few sums. Numbers in brackets
are the inequalities of docs/proofs.md, part 2.
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
from cam_rig.extras import friendly_import_errors
from cam_rig.units import FloatArray

#: Largest absolute value of the B-spline ordinates (control values) of a law, in units of its lift.
#: Every program has this limit, so that a bound can be proved for its unknowns.
MAX_ORDINATE = 10.0
#: Name by which messages refer to the limit `MAX_ORDINATE` of the B-spline ordinates.
ORDINATE_LIMIT = "ordinates"
#: Options of every run of the solver clarabel. Its default factorisation is three times slower on
#: these programs.
SOLVER_OPTIONS = {"verbose": False, "max_iter": 400, "direct_solve_method": "qdldl"}
#: Sets of further options of clarabel. They are tried in turn until the solver converges.
SOLVER_TUNINGS = (
    {"tol_feas": 1e-10, "tol_gap_abs": 1e-10, "tol_gap_rel": 1e-10},
    {"static_regularization_constant": 1e-7, "iterative_refinement_max_iter": 50},
    {"equilibrate_max_iter": 50, "reduced_tol_gap_rel": 1e-4, "reduced_tol_feas": 1e-4},
)

#: Tolerances at which a solution is used although the solver did not converge: the largest
#: violation of an inequality, relative to `ScaledLimit.scale`, and the largest relative gap between
#: the level (the maximised variable) and its bound.
USABLE_ATOL = 1e-5
#: Largest absolute value of the level (the maximised variable) up to which a contradiction between
#: limits is proved. It is relative to the scale of the goal.
MAX_LEVEL = 1e4
#: Distance of an inequality from equality up to which its limit counts as active, relative to
#: `ScaledLimit.scale`. An active limit restricts the best law.
ACTIVE_TOLERANCE = 1e-5


@dataclass(frozen=True, eq=False)
class Affine:
    """Affine function c + A x with n values, of the unknowns x ``(m,)`` of a program.

    The unknowns describe a motion law. ``constant`` is c ``(n,)``, and ``matrix`` is A ``(n, m)``,
    sparse or dense. Both may be complex.
    """

    constant: NDArray[Any]
    matrix: Any

    def __call__(self, unknowns: FloatArray) -> NDArray[Any]:
        """Return the values ``(n,)`` of the function at unknowns ``(m,)``."""
        return np.asarray(self.constant + self.matrix @ unknowns)

    def __add__(self, other: Affine) -> Affine:
        return Affine(self.constant + other.constant, self.matrix + other.matrix)

    def __mul__(self, factor: float) -> Affine:
        return Affine(self.constant * factor, self.matrix * factor)

    def plus(self, number: float | FloatArray) -> Affine:
        """Return this function plus a constant.

        ``number`` is one number, or an array ``(n,)`` with one number for each of the n values.
        """
        return Affine(self.constant + number, self.matrix)

    def mapped(self, matrix: Any) -> Affine:
        """Return the function ``matrix`` @ f, where f are the n values of this function."""
        return Affine(np.asarray(matrix @ self.constant), matrix @ self.matrix)

    def rows(self, chosen: Any) -> Affine:
        """Return the function with only some of its n values.

        ``chosen`` selects the values: indices, a mask or a slice.
        """
        return Affine(self.constant[chosen], self.matrix[chosen])

    def dense(self) -> Affine:
        """Return this function with a dense matrix."""
        return Affine(self.constant, self.matrix.toarray())

    @staticmethod
    def number(value: float, unknowns: int) -> Affine:
        """Return a function whose only value is the constant ``value``.

        ``unknowns`` is the number of unknowns of the program. The value does not depend on them.
        """
        return Affine(np.full(1, value), sparse.csr_array((1, unknowns)))

    @staticmethod
    def stacked(parts: list[Affine]) -> Affine:
        """Return one function whose values are those of all ``parts``, in order."""
        matrices = [part.matrix for part in parts]
        is_sparse = sparse.issparse(matrices[0])
        matrix = sparse.vstack(matrices, "csr") if is_sparse else np.vstack(matrices)
        return Affine(np.concatenate([part.constant for part in parts]), matrix)


@dataclass(frozen=True)
class RowBlock:
    """Inequalities or equations c + A x + w t of one limit of a convex program.

    Each of them is called a row, x are the unknowns of the program, and t is its level, the
    variable that it maximises. ``rows`` is c + A x, and ``weight`` is w. The ``kind`` of the rows
    is ``nonneg`` (each row is ≥ 0), ``zero`` (each row is 0) or ``cone``. A cone consists of
    ``cone`` rows in sequence, of which the first is at least the Euclidean norm of the others.
    ``necessary`` is True if every law that satisfies the limit satisfies the rows, and False if
    they are only sufficient for the limit.
    """

    name: str
    rows: Affine
    weight: FloatArray
    kind: str
    cone: int = 1
    necessary: bool = True


@dataclass(frozen=True)
class ProgramSolution:
    """Solution of a convex program, with a bound on its level.

    ``unknowns`` ``(m,)`` describe the law, and ``level`` is the value t that it reaches. No law of
    the class exceeds ``bound``. The bound is proved by ``blocks`` and ``multipliers``, one
    multiplier y per row, scaled to Σ w y = −1. ``active`` names the limits that the law reaches.
    """

    unknowns: FloatArray
    level: float
    bound: float
    active: tuple[str, ...]
    blocks: list[RowBlock]
    multipliers: FloatArray


class InfeasibleError(DesignError):
    """Error of a design in which no law of the class satisfies the limits.

    ``conflicting`` names the limits that contradict each other. ``proved`` is True if the
    contradiction is proved for the whole class.
    """

    def __init__(self, conflicting: tuple[str, ...], proved: bool = True) -> None:
        self.conflict = " and ".join(conflicting[:2]) + (" at once" if len(conflicting) > 1 else "")
        self.conflicting, self.proved = conflicting, proved
        super().__init__(
            f"no law of the class satisfies {self.conflict}; use looser limits, or more pieces"
        )


@dataclass
class ConvexProgram:
    """Convex program: the largest level t under limits on ``unknowns`` unknowns.

    The unknowns describe a motion law. ``link`` is a function of them that must be zero. It relates
    the last unknowns (ordinates of s'') to the others (ordinates of s). ``blocks`` contains the
    rows of the limits.
    """

    unknowns: int
    link: Affine
    blocks: list[RowBlock] = field(default_factory=list)

    def at_least(
        self, name: str, rows: Affine, weight: float = 0.0, necessary: bool = True
    ) -> None:
        """Add inequalities to the program, each of the form rows + weight · t ≥ 0.

        The level t is the variable that the program maximises. ``rows`` is a function of the
        unknowns. ``name`` is the name of the limit in messages. ``necessary`` is True if every law
        that satisfies the limit satisfies the inequalities.
        """
        weights = np.full(rows.constant.size, weight)
        self.blocks.append(RowBlock(name, rows, weights, "nonneg", necessary=necessary))

    def equal(self, name: str, rows: Affine) -> None:
        """Add the equations rows = 0 to the program.

        ``rows`` is a function of the unknowns, with one value per equation. ``name`` is the name of
        the limit in messages.
        """
        self.blocks.append(RowBlock(name, rows, np.zeros(rows.constant.size), "zero"))

    def within(self, name: str, parts: Affine, radius: float = 0.0, weight: float = 0.0) -> None:
        """Add a limit on the root of a sum of squares to the program.

        The limit is √(sum of the squared ``parts``) ≤ radius + weight · t, with the level t that
        the program maximises. ``name`` is that of the limit in messages.
        """
        cone = Affine.stacked([Affine.number(radius, self.unknowns), parts])
        weights = np.zeros(cone.constant.size)
        weights[0] = weight
        self.blocks.append(RowBlock(name, cone, weights, "cone", weights.size))

    def solve(self) -> ProgramSolution:
        """Solve the program for the largest level t, the variable that it maximises.

        Sets of solver options are tried in turn until the solver converges.

        Raises
        ------
        InfeasibleError
            If the limits contradict each other.
        DesignError
            If the solver does not converge.
        """
        with friendly_import_errors():
            import clarabel
        blocks = self.all_blocks()
        rows, weights = _join_rows(blocks)
        matrix = sparse.csc_matrix(-_append_column(rows.matrix, weights))
        cone_types = {"zero": clarabel.ZeroConeT, "nonneg": clarabel.NonnegativeConeT}
        cones: list[object] = []
        for block in blocks:
            size = block.weight.size
            if block.kind == "cone":
                cones += [clarabel.SecondOrderConeT(block.cone)] * (size // block.cone)
            else:
                cones.append(cone_types[block.kind](size))
        cost = np.zeros(self.unknowns + 1)
        cost[-1] = -1.0
        no_cost = sparse.csc_matrix((cost.size, cost.size))
        best, violation = None, np.inf
        for tuning in SOLVER_TUNINGS:
            settings = clarabel.DefaultSettings()
            for key, value in {**SOLVER_OPTIONS, **tuning}.items():
                setattr(settings, key, value)
            solver = clarabel.DefaultSolver(no_cost, cost, matrix, rows.constant, cones, settings)
            result = solver.solve()
            status, x, dual = str(result.status), np.array(result.x), np.array(result.z)
            if status in ("PrimalInfeasible", "AlmostPrimalInfeasible"):
                raise _infeasible(blocks, dual)
            if status in ("Solved", "AlmostSolved"):
                return solution_of(blocks, x, dual)
            row_violation = max(0.0, *(-float(_slack(block, x).min()) for block in blocks))
            if row_violation < min(violation, USABLE_ATOL):
                best, violation = solution_of(blocks, x, dual), row_violation
        if best is None or not best.bound - best.level <= USABLE_ATOL * max(1.0, abs(best.level)):
            raise DesignError(f"the solver of the design ended with {status}; use fewer pieces")
        return best

    def all_blocks(self) -> list[RowBlock]:
        """Return all inequalities and equations of the program in a fixed order.

        The link between the unknowns of s and s'' comes first, then equations, other limits, and
        the limit `MAX_ORDINATE` of the ordinates.
        """
        linked = self.link.constant.size
        link = RowBlock("", self.link, np.zeros(linked), "zero")
        ranked = sorted(self.blocks, key=lambda block: block.kind != "zero")
        eye = sparse.eye_array(self.unknowns - linked, self.unknowns)
        matrix = sparse.vstack([eye, -eye], "csr")
        box = Affine(np.full(matrix.shape[0], MAX_ORDINATE), matrix)
        return [link, *ranked, RowBlock(ORDINATE_LIMIT, box, np.zeros(box.constant.size), "nonneg")]


def _infeasible(blocks: list[RowBlock], dual: FloatArray) -> InfeasibleError:
    shares: dict[str, float] = {}
    for block, row_part in zip(blocks, _split_by_block(blocks, dual), strict=True):
        if block.name:
            terms = abs(block.rows.matrix).sum(axis=1) + np.abs(block.rows.constant)
            shares[block.name] = shares.get(block.name, 0.0) + float(np.abs(row_part * terms).sum())
    max_share = max(shares.values(), default=0.0)
    ranked = sorted(shares.items(), key=lambda item: (item[0] == ORDINATE_LIMIT, -item[1]))
    names = tuple(name for name, row_part in ranked if row_part > 1e-6 * max_share)
    # By inequality (40) of docs/proofs.md, no unknowns satisfy the rows at any level up to
    # `MAX_LEVEL`.
    y, weight = _in_cones(blocks, dual)
    refuted = upper_bound(blocks, y) + abs(weight) * MAX_LEVEL < 0.0
    proved = all(block.necessary for block in blocks) and refuted
    return InfeasibleError(names or ("its limits",), proved)


def _join_rows(blocks: list[RowBlock]) -> tuple[Affine, FloatArray]:
    """Return the rows of all blocks as one function, and their weights of the level t.

    A row is an inequality or equation c + A x + w t of a program, with the weight w.
    """
    rows = Affine.stacked([block.rows for block in blocks])
    return rows, np.concatenate([block.weight for block in blocks])


def _append_column(matrix: Any, weights: FloatArray) -> Any:
    """Return a matrix with ``weights`` as an additional last column.

    The columns belong to the unknowns of a program, the last to its level t, the maximised
    variable.
    """
    return sparse.hstack([matrix, sparse.csr_array(weights[:, None])], "csr")


def _split_by_block(blocks: list[RowBlock], of_rows: FloatArray) -> list[FloatArray]:
    """Split an array of one value per row into one array per block.

    The results are views of ``of_rows``.
    """
    return np.split(of_rows, np.cumsum([block.weight.size for block in blocks])[:-1])


def solution_of(blocks: list[RowBlock], x: FloatArray, dual: FloatArray) -> ProgramSolution:
    """Return the solution of a program from the arrays that a solver returns.

    ``x`` are the unknowns, with the level t (the maximised variable) last. ``dual`` are the
    multipliers of the inequalities and equations, which are corrected and scaled here.
    """
    y, weight = _in_cones(blocks, dual)
    multipliers = y / -weight if weight < 0.0 else np.full(y.size, np.nan)
    met = (b.name for b in blocks if b.kind != "zero" and _slack(b, x).min() < ACTIVE_TOLERANCE)
    active, bound = tuple(dict.fromkeys(met)), upper_bound(blocks, multipliers)
    return ProgramSolution(x[:-1], float(x[-1]), bound, active, blocks, multipliers)


def _slack(block: RowBlock, x: FloatArray) -> FloatArray:
    """Return the distance of each row or cone from its limit, negative if violated.

    A row is an inequality or equation of a program. For an equation the result is minus the
    absolute residual. ``x`` are the unknowns of the program, with its level t (the maximised
    variable) last.
    """
    values = np.asarray(block.rows(x[:-1]) + block.weight * x[-1])
    if block.kind == "cone":
        cones = values.reshape(-1, block.cone)
        return np.asarray(cones[:, 0] - np.linalg.norm(cones[:, 1:], axis=1))
    return -np.abs(values) if block.kind == "zero" else values


def _in_cones(blocks: list[RowBlock], dual: FloatArray) -> tuple[FloatArray, float]:
    """Return multipliers with corrected signs, and their weight of the level t.

    The multipliers belong to the inequalities and equations (rows) of a convex program. Weak
    duality requires them to be ≥ 0, or inside the cone of their rows, so ``dual`` is projected into
    these cones. The first block links the last unknowns to the others, with coefficients −1. Its
    multipliers are set to eliminate these unknowns, by (39) of docs/proofs.md.
    """
    y = dual.copy()
    rows, weights = _join_rows(blocks)
    for block, part in zip(blocks, _split_by_block(blocks, y), strict=True):
        if block.kind == "nonneg":
            np.maximum(part, 0.0, out=part)
        elif block.kind == "cone":
            cones = part.reshape(-1, block.cone)
            cones[:, 0] = np.maximum(cones[:, 0], np.linalg.norm(cones[:, 1:], axis=1))
    linked = blocks[0].weight.size
    y[:linked] += (rows.matrix.T @ y)[-linked:]
    return y, float(weights @ y)


def upper_bound(blocks: list[RowBlock], multipliers: FloatArray) -> float:
    """Return the upper bound of a program's level t that multipliers prove.

    By (39) of docs/proofs.md, the bound is yᵀc + β Σ|(Aᵀy)ⱼ| for multipliers y with yᵀw = −1, where
    β is `MAX_ORDINATE` and the rows of the program are c + A x + w t. It is infinite if a
    multiplier is NaN.
    """
    if np.isnan(multipliers).any():
        return np.inf
    rows, _ = _join_rows(blocks)
    remainder = (rows.matrix.T @ multipliers)[: -blocks[0].weight.size]
    return float(rows.constant @ multipliers) + float(np.abs(remainder).sum()) * MAX_ORDINATE


# Fast solution of successive linear programs that differ by a few rows: each is solved from the
# solution of the previous program.

#: Feasibility tolerance of inequalities and multipliers in the simplex solver HiGHS, relative to
#: `ScaledLimit.scale`.
SIMPLEX_TOLERANCE = 1e-9
#: Options of the simplex solver HiGHS. Presolve is off, because with it the solver could not start
#: from the previous solution.
SIMPLEX_OPTIONS: dict[str, bool | int | str | float] = {
    "output_flag": False,
    "threads": 1,
    "presolve": "off",
    "solver": "simplex",
    "simplex_scale_strategy": 2,
    "primal_feasibility_tolerance": SIMPLEX_TOLERANCE,
    "dual_feasibility_tolerance": SIMPLEX_TOLERANCE,
}

#: Lower and upper bound of an inequality or equation in the simplex solver.
Bounds = tuple[float, float]


class GrowingProgram:
    """Solver of successive linear programs with the same unknowns.

    The inequalities differ little between the programs. Each program is therefore solved by the
    simplex method from the solution of the previous program.
    """

    def __init__(self) -> None:
        self._solver: Any = None
        #: Number of each row (inequality or equation) in the solver, by the key of the row (see
        #: `_keys`), and the bounds of the rows in use by their number.
        self._index: dict[bytes, int] = {}
        self._bounds: dict[int, Bounds] = {}

    def solve(self, program: ConvexProgram) -> ProgramSolution:
        """Solve a program for the largest level t, as `ConvexProgram.solve` does.

        Programs with cones, and programs that the simplex solver does not solve, are passed to
        `ConvexProgram.solve`.
        """
        blocks = program.all_blocks()
        if any(block.kind == "cone" for block in blocks):
            return program.solve()
        with friendly_import_errors():
            import highspy
        if self._solver is None:
            self._start(program, highspy)
        self._drop(highspy.HighsBasisStatus.kBasic)
        # the last block, the limits of ordinates, is given as column bounds
        rows = self._use_rows(blocks[:-1])
        self._solver.run()
        if self._solver.getModelStatus() != highspy.HighsModelStatus.kOptimal:
            self._solver = None
            return program.solve()
        result = self._solver.getSolution()
        dual = np.zeros(sum(block.weight.size for block in blocks))
        dual[list(rows.values())] = np.array(result.row_dual)[list(rows)]
        return solution_of(blocks, np.array(result.col_value), dual)

    def _start(self, program: ConvexProgram, highspy: Any) -> None:
        """Create the solver with one variable per unknown of a program, and its level.

        The level is the variable that the program maximises. Inequalities and equations are added
        later.
        """
        solver = self._solver = highspy.Highs()
        self._index, self._bounds = {}, {}
        for name, value in SIMPLEX_OPTIONS.items():
            solver.setOptionValue(name, value)
        size = program.unknowns + 1
        limits = np.full(size, np.inf)
        limits[: program.unknowns - program.link.constant.size] = MAX_ORDINATE
        solver.addVars(size, -limits, limits)
        solver.changeColCost(size - 1, -1.0)

    def _drop(self, basic: Any) -> None:
        """Delete unused inequalities and equations from the solver.

        They are deleted only if the simplex basis stays valid without them: their status in the
        basis must be ``basic``, the constant of HiGHS for a row that does not restrict the
        solution.
        """
        status = self._solver.getBasis().row_status
        dropped = {row for row, s in enumerate(status) if s == basic and row not in self._bounds}
        if dropped:
            self._solver.deleteRows(len(dropped), np.array(sorted(dropped), dtype=np.int32))
            remaining = [(key, row) for key, row in self._index.items() if row not in dropped]
            self._index = {key: index for index, (key, _) in enumerate(remaining)}
            new_row = {row: index for index, (_, row) in enumerate(remaining)}
            self._bounds = {new_row[row]: bounds for row, bounds in self._bounds.items()}

    def _use_rows(self, blocks: list[RowBlock]) -> dict[int, int]:
        """Give the solver the rows and bounds of the given blocks.

        New rows are added, and all other rows become free. The result maps the number of a row in
        the solver to its number among the rows of the blocks.
        """
        in_use: dict[int, Bounds] = {}
        indices: dict[int, int] = {}
        first = 0
        for block in blocks:
            new_rows = []
            for row, (key, bounds) in enumerate(_keys(block)):
                if key not in self._index:
                    self._index[key] = len(self._index)
                    new_rows.append(row)
                solver_row = self._index[key]
                # If a row occurs twice, the tighter bounds apply.
                if solver_row not in in_use or bounds > in_use[solver_row]:
                    in_use[solver_row], indices[solver_row] = bounds, first + row
            if new_rows:
                self._add(block, new_rows)
            first += block.weight.size
        for solver_row, bounds in in_use.items():
            if self._bounds.get(solver_row) != bounds:
                self._solver.changeRowBounds(solver_row, *bounds)
        for solver_row in self._bounds.keys() - in_use.keys():
            self._solver.changeRowBounds(solver_row, -np.inf, np.inf)
        self._bounds = in_use
        return indices

    def _add(self, block: RowBlock, new_rows: list[int]) -> None:
        """Add new rows (inequalities or equations) of a block to the solver.

        They have no bounds yet. ``new_rows`` are their indices in the block.
        """
        matrix = _append_column(block.rows.matrix[new_rows], block.weight[new_rows])
        free = np.full(len(new_rows), np.inf)
        row_starts, columns = (
            part.astype(np.int32) for part in (matrix.indptr[:-1], matrix.indices)
        )
        self._solver.addRows(
            len(new_rows), -free, free, matrix.nnz, row_starts, columns, matrix.data
        )


def _keys(block: RowBlock) -> Iterator[tuple[bytes, Bounds]]:
    """Yield a key and the bounds of each row of a block.

    The key consists of the kind and the coefficients of the row. Rows that differ only in their
    constant have the same key, so that the solver can reuse a row with other bounds.
    """
    matrix, kind = block.rows.matrix, block.kind.encode()
    columns, values, size = matrix.indices.tobytes(), matrix.data.tobytes(), matrix.indices.itemsize
    ends = pairwise(matrix.indptr.tolist())
    numbers = zip(block.weight.tolist(), (-block.rows.constant).tolist(), strict=True)
    for (start, end), (weight, lower) in zip(ends, numbers, strict=True):
        entries = columns[size * start : size * end], values[8 * start : 8 * end]
        key = b"".join((kind, struct.pack("d", weight), *entries))
        yield key, (lower, lower if block.kind == "zero" else np.inf)
