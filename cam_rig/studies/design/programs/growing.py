"""Linear programs that differ by a few rows, each solved from where the last one ended.

Rounds of cuts take a few rows, leave a few, and ask again. The dual simplex method goes on from
the basis of the round before, in a fraction of what a program from nothing takes. Rows that are
left become free, so that the basis stays one.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy import sparse

from cam_rig.extras import libraries_named
from cam_rig.studies.design.programs.program import (
    BOX,
    ConvexProgram,
    ProgramSolution,
    RowBlock,
    solution_of,
)

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
        """The largest t, as `ConvexProgram.solve`, which a program with cones or without law takes.

        Raises
        ------
        InfeasibleError : no unknowns keep the limits
        DesignError : the solver did not end
        """
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
