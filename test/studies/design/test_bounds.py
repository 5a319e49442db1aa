"""(38) to (40) of docs/proofs.md on random laws and programs."""

import math

import numpy as np
import pytest
from scipy import sparse

from cam_rig.laws import build_law
from cam_rig.studies.design import convex_program
from cam_rig.studies.design.convex_program import (
    BOX,
    LEVELS,
    Affine,
    ConvexProgram,
    InfeasibleError,
    bound_of,
    solution_of,
)
from cam_rig.studies.design.request import LawClass
from cam_rig.studies.design.space import Space

from .shared import cam

#: Unknowns of a random program: free ones, and those that are linked to them.
FREE, LINKED = 4, 3
#: Relative rounding of sums of rows.
ROUNDING = 1e-12


def random_program(rng, slope=1.0, weight=1.0):
    """A link, an equation, inequalities and a cone in random unknowns, which zero satisfies.

    ``slope`` scales the rows' dependence on the unknowns, ``weight`` that on the level.
    """
    size, count = FREE + LINKED, 12
    own = np.hstack([rng.normal(size=(LINKED, FREE)), -np.eye(LINKED)])
    program = ConvexProgram(size, Affine(np.zeros(LINKED), sparse.csr_array(own)))
    rows = Affine(
        rng.uniform(0.1, 1.0, count), sparse.csr_array(slope * rng.normal(size=(count, size)))
    )
    program.at_least("goal", rows, -weight)
    equation = sparse.csr_array(slope * rng.normal(size=(1, size)))
    program.equal("equation", Affine(np.zeros(1), equation))
    parts = sparse.csr_array(slope * rng.normal(size=(3, size)))
    program.within("cone", Affine(rng.uniform(-0.2, 0.2, 3), parts), 0.5, 0.3 * weight)
    return program


@pytest.mark.parametrize("name", ["poly345", "bezier15"])
def test_points_are_necessary_and_ordinates_sufficient(name):
    """(38): a derivative is between its ordinates, and points are among its values."""
    rng, start = np.random.default_rng(0), build_law(cam(name))
    space = Space(start, LawClass(pieces=6))
    u = np.linspace(0.0, 1.0, 400)
    for _ in range(20):
        unknowns = space.joined(rng.uniform(0.0, 1.0, space.free))
        law = space.law(unknowns, "random")
        angles = (law.breaks[:-1, None] + law.spans[:, None] * u).ravel()
        for order in range(3):
            ordinates = space.derivative(order)
            hull, points = (space.bounds(ordinates, way)(unknowns) for way in (True, False))
            values = law.motion_at(angles)[order]
            size = np.abs(values).max()
            assert hull.min() <= values.min() + 1e-9 * size
            assert hull.max() >= values.max() - 1e-9 * size
            assert points.min() >= values.min() - 1e-3 * size
            assert points.max() <= values.max() + 1e-3 * size
            assert hull.max() - values.max() < 0.2 * size


@pytest.mark.parametrize("seed", range(20))
def test_any_multipliers_bound_the_level(seed):
    """(39): no feasible unknowns have a higher level, however wrong the multipliers are."""
    rng = np.random.default_rng(seed)
    program = random_program(rng)
    best = program.solve()
    assert best.bound == pytest.approx(best.level, abs=1e-6)
    blocks = program.all_blocks()
    x = np.append(best.unknowns, best.level)
    for _ in range(20):
        wrong = rng.normal(size=best.multipliers.size) * 10.0 ** rng.uniform(-3.0, 0.0)
        found = solution_of(blocks, x, best.multipliers + wrong)
        if math.isfinite(found.bound):
            assert found.bound >= best.level - 1e-7
    free = np.zeros(FREE + LINKED)
    assert bound_of(blocks, np.zeros(best.multipliers.size)) == 0.0
    for _ in range(200):
        free[:FREE] = rng.uniform(-1.0, 1.0, FREE)
        free[FREE:] = 0.0
        free[FREE:] = program.link(free)
        y = np.abs(rng.normal(size=best.multipliers.size))
        in_cones, _ = convex_program._in_cones(blocks, y)
        values = np.concatenate([block.rows(free) for block in blocks])
        matrix = sparse.vstack([block.rows.matrix for block in blocks])
        assert np.abs((matrix.T @ in_cones)[-LINKED:]).max() < ROUNDING * np.abs(in_cones).sum()
        # 0 ≤ yᵀ(c + Ax) wherever all rows hold; the sum alone never exceeds the bound.
        assert in_cones @ values <= bound_of(blocks, in_cones) + ROUNDING * np.abs(values).sum()


def test_contradictions_are_proved_for_levels_in_a_range():
    """(40): rows that contradict each other are refuted, rows that can be satisfied are not."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        program = random_program(rng)
        row = Affine(np.zeros(1), sparse.csr_array(rng.normal(size=(1, FREE + LINKED))))
        program.at_least("above", row.plus(-1.0))
        program.at_least("below", row * -1.0)
        with pytest.raises(InfeasibleError) as refused:
            program.solve()
        assert refused.value.proved
        blocks = random_program(rng, slope=1e-3, weight=0.0).all_blocks()
        for _ in range(100):
            y = rng.normal(size=sum(block.weight.size for block in blocks))
            in_cones, weight = convex_program._in_cones(blocks, y)
            assert bound_of(blocks, in_cones) + abs(weight) * LEVELS >= 0.0


def test_the_box_is_that_of_the_program():
    """The bound's β is the limit of the ordinates that the program contains."""
    block = random_program(np.random.default_rng(0)).all_blocks()[-1]
    assert (block.rows.constant == BOX).all()
