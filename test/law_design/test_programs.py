"""Programs that go on from each other give what each gives alone."""

import numpy as np
import pytest
from scipy import sparse

from cam_rig.law_design.convex_program import Affine, ConvexProgram, InfeasibleError
from cam_rig.law_design.cutting_planes import GrowingProgram

FREE, LINKED, POOL = 8, 5, 60


def rows(rng, count):
    """Random rows that zero keeps."""
    matrix = rng.normal(size=(count, FREE + LINKED)) * rng.integers(0, 2, (count, FREE + LINKED))
    return Affine(rng.uniform(0.1, 1.0, count), sparse.csr_array(matrix))


def linked(rng):
    """Unknowns that follow from the others."""
    own = np.hstack([rng.normal(size=(LINKED, FREE)), -np.eye(LINKED)])
    return Affine(rng.normal(size=LINKED), sparse.csr_array(own))


@pytest.mark.parametrize("seed", range(8))
def test_rounds_are_programs_alone(seed):
    """Rows come, go, come back, and are moved, twice in one program: level and bound are the same
    as of each program from nothing, and the bound is met."""
    rng = np.random.default_rng(seed)
    link, pool, growing = linked(rng), rows(rng, POOL), GrowingProgram()
    for _ in range(12):
        program = ConvexProgram(FREE + LINKED, link)
        chosen = rng.permutation(POOL)[: rng.integers(5, POOL)]
        moved = pool.rows(chosen).plus(rng.uniform(0.0, 2.0))
        program.at_least("goal", moved, -1.0)
        program.at_least("limits", pool.rows(chosen[:4]).plus(3.0))
        program.at_least("the same", pool.rows(chosen[:2]).plus(2.5))
        alone, found = program.solve(), growing.solve(program)
        assert found.level == pytest.approx(alone.level, abs=1e-7)
        assert found.level - 1e-8 <= found.bound == pytest.approx(alone.bound, abs=1e-6)
        assert np.abs(link(found.unknowns)).max() < 1e-7
        for block in program.blocks:
            assert (block.rows(found.unknowns) + block.weight * found.level).min() > -1e-7


def test_no_unknowns_keep_the_rows():
    """It is refused, and proved, as by a program alone; the next one is solved again."""
    rng = np.random.default_rng(3)
    link, pool, growing = linked(rng), rows(rng, 6), GrowingProgram()
    program = ConvexProgram(FREE + LINKED, link)
    program.at_least("goal", pool, -1.0)
    first = growing.solve(program)
    fighting = program.copy()
    one = Affine(np.zeros(1), sparse.csr_array(np.eye(1, FREE + LINKED)))
    fighting.at_least("above one", one.plus(-1.0))
    fighting.at_least("below zero", one * -1.0)
    with pytest.raises(InfeasibleError, match=r"above one and below zero|below zero and above one"):
        growing.solve(fighting)
    assert growing.solve(program).level == pytest.approx(first.level, abs=1e-9)
