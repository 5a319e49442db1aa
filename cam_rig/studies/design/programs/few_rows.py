"""Of a program's thousands of rows the few that a solution breaks or nearly meets."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from cam_rig.studies.design.programs.program import ConvexProgram, ProgramSolution, RowBlock

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
