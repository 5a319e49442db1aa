"""Laws, forces and rows as functions of a design's unknowns; programs that grow."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from benchmark.speed.study import outputs_at
from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.dynamics.free_masses import contact_response, force_output
from cam_rig.errors import ConfigError
from cam_rig.laws import Law, build_law
from cam_rig.quantities.values import VibrationMode
from cam_rig.studies.design import convex_program
from cam_rig.studies.design.convex_program import (
    BOX,
    LEVELS,
    Affine,
    ConvexProgram,
    GrowingProgram,
    InfeasibleError,
    bound_of,
    solution_of,
)
from cam_rig.studies.design.descent import PointwiseTerm
from cam_rig.studies.design.modal_amplitude import Cells, ForceAtSpeed
from cam_rig.studies.design.request import LawClass
from cam_rig.studies.design.rows import rows_of
from cam_rig.studies.design.space import Space, dwells, measured
from cam_rig.units import TURN

from .shared import RIG, cam, problem, term

FREE, LINKED, POOL = 8, 5, 60


def rows(rng, count):
    """Random rows that zero keeps."""
    matrix = rng.normal(size=(count, FREE + LINKED)) * rng.integers(0, 2, (count, FREE + LINKED))
    return Affine(rng.uniform(0.1, 1.0, count), sparse.csr_array(matrix))


def linked(rng):
    """Unknowns that follow from the others."""
    own = np.hstack([rng.normal(size=(LINKED, FREE)), -np.eye(LINKED)])
    return Affine(rng.normal(size=LINKED), sparse.csr_array(own))


@pytest.mark.parametrize("seed", range(3))
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
    fighting = replace(program, blocks=list(program.blocks))
    one = Affine(np.zeros(1), sparse.csr_array(np.eye(1, FREE + LINKED)))
    fighting.at_least("above one", one.plus(-1.0))
    fighting.at_least("below zero", one * -1.0)
    with pytest.raises(InfeasibleError, match=r"above one and below zero|below zero and above one"):
        growing.solve(fighting)
    assert growing.solve(program).level == pytest.approx(first.level, abs=1e-9)


RNG = np.random.default_rng(11)


@pytest.mark.parametrize(
    ("name", "law_class"),
    [
        ("poly345", LawClass(16, 3)),
        ("poly345", LawClass(5, 1)),
        ("poly345", LawClass(3, 2, 9)),
        ("cycloidal", LawClass(7, 4)),
        ("bezier15", LawClass(1, 3, 15)),
        ("b_spline", LawClass(4, 2)),
    ],
)
def test_a_law_of_any_unknowns_is_smooth_and_has_the_starts_ends(name, law_class):
    """Derivatives up to C are continuous around the turn, so zero at the ends of dwells."""
    start = build_law(cam(name))
    space = Space(start, law_class)
    unknowns = space.joined(RNG.uniform(-0.5, 1.5, law_class.free * len(space.events)))
    law = space.law(unknowns, "any")
    for order in range(law_class.joints + 1):
        ordinates = law.derivative_ordinates(order)
        apart = np.abs(ordinates[0] - np.roll(ordinates[-1], 1)).max()
        assert apart <= 1e-8 * np.abs(ordinates).max()
    for begin, end in dwells(start):
        angle = np.linspace(begin, end, 7)[1:-1]
        np.testing.assert_allclose(law(angle), start(angle), atol=1e-15)


def test_the_derivatives_in_the_unknowns_are_the_laws():
    """Ordinates of s'' come from unknowns of their own, those of s from others: one law."""
    space = Space(build_law(cam()), LawClass(9, 3))
    unknowns = space.joined(RNG.uniform(0.0, 1.0, 2 * space.law_class.free))
    law, angle = space.law(unknowns, "any"), RNG.uniform(0.0, 2.0 * np.pi, 200)
    for order in range(5):
        expected = law(angle, order)
        found = space.at(order, angle)(unknowns)
        np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("order", range(5))
def test_the_ordinates_over_a_range_are_those_of_the_range(order):
    """They enclose the derivative in the range, and their ends are its values at the ends.

    Nothing outside of the range has an influence.
    """
    space = Space(build_law(cam()), LawClass(9, 3))
    unknowns = space.joined(RNG.uniform(0.0, 1.0, 2 * space.law_class.free))
    law = space.law(unknowns, "any")
    for _ in range(20):
        low, high = np.sort(RNG.uniform(0.0, 2.0 * np.pi, 2))
        ordinates = space.hull_over(order, low, high, 16)(unknowns)
        dense = law(np.linspace(low, high, 3001), order)
        size = np.abs(law.derivative_ordinates(order)).max()
        assert ordinates.min() <= dense.min() + 1e-9 * size
        assert ordinates.max() >= dense.max() - 1e-9 * size
        assert ordinates[0] == pytest.approx(dense[0], abs=1e-8 * size)
        assert ordinates[-1] == pytest.approx(dense[-1], abs=1e-8 * size)


REFUSED = (
    ({"pieces": 0}, "pieces is 0; allowed: 1 to 200"),
    ({"pieces": 201}, "pieces is 201"),
    ({"joints": 0}, "joints is 0; allowed: 1 to 6"),
    ({"joints": 3, "degree": 3}, "allowed: a degree above 3"),
    ({"degree": 16}, "degree is 16; allowed: 2 to 15"),
    ({"pieces": 1}, "so more pieces or a higher degree"),
    ({"pieces": 200, "degree": 9}, "so fewer pieces"),
)


def test_a_class_that_is_none_is_refused():
    """The message names the number, its limits and what to change."""
    for arguments, words in REFUSED:
        with pytest.raises(ConfigError, match=words):
            LawClass(**arguments)


def test_a_cam_that_rests_all_around_has_nothing_to_design():
    """A circle has no event."""
    circle = Law("circle", np.array([0.0, 2.0 * np.pi]), np.zeros((2, 1)))
    with pytest.raises(ConfigError, match="it rests all around"):
        Space(circle, LawClass()).events


@pytest.mark.parametrize("seed", range(3))
def test_the_force_is_that_of_the_exact_model(seed):
    """Any law, two masses, speed and turn: the first, a later one, and the steady state.

    The exact model propagates (η, η̇) by matrix exponentials; Gauss points in cells of 0.6 rad of
    phase give the same to 1e-9 of the force.
    """
    rng = np.random.default_rng(seed)
    start = build_law(cam())
    space = Space(start, LawClass(int(rng.integers(4, 12)), int(rng.integers(1, 5))))
    stock = TwoMassParameters.from_rig(RIG)
    follower = replace(
        stock,
        stem_stiffness=stock.stem_stiffness * rng.uniform(0.3, 3.0),
        stem_damping=stock.stem_damping * rng.uniform(0.0, 10.0),
        roller_mass=stock.roller_mass * rng.uniform(0.2, 2.0),
    )
    speed = rng.uniform(15.0, 60.0)
    ramps = np.linspace(0.0, 1.0, space.law_class.free)
    smooth = np.concatenate([ramps, ramps[::-1]]) + 0.05 * rng.normal(size=2 * ramps.size)
    unknowns = space.joined(smooth)
    law = space.law(unknowns, "any")
    found = ForceAtSpeed(Cells(space, VibrationMode.of(follower), speed), speed)
    response = contact_response(law, follower, speed)
    chosen = np.arange(0, found.first.angles.size, 29)
    for turn in (1.0, 4.0, np.inf):
        steady = np.isinf(turn)
        state = response.periodic() if steady else np.zeros(2)
        angles = found.first.angles[chosen] - 1e-13 + (0.0 if steady else TURN * (turn - 1.0))
        exact = outputs_at(response, state, 0.0, angles / speed, force_output(follower))[0]
        values = found.values(unknowns, np.array([turn]))[0][chosen]
        size = np.abs(exact).max()
        np.testing.assert_allclose(values, exact, atol=1e-8 * size)
        of_unknowns = found.rows(chosen, turn)(unknowns)
        np.testing.assert_allclose(of_unknowns, values, atol=1e-11 * size)


def test_an_overdamped_stem_has_no_residual_vibration():
    """Critical damping and more: one line, with the limit."""
    follower = FollowerParameters(1.3, 4030.0, 1e4, 30.0, 1.26e6)
    with pytest.raises(ConfigError, match=r"does not vibrate.*allowed.*below"):
        VibrationMode.of(follower)


QUANTITIES = ("shaft_torque@300rpm", "shaft_torque@50-600rpm", "pressure_angle")
CAMS = ("poly345", "oscillating_roller", "oscillating_flat", "conjugate", "eccentric_roller")


def term_of(cam_name, text):
    own, asked = problem(LawClass(5, 2), cam_name), term(text)
    branches = rows_of(asked).branches
    assert branches is not None
    return PointwiseTerm(own, text, branches(own, asked), math.nan)


def some_law(own, seed):
    """Unknowns of a law that rises where the start does, with ordinates a little off."""
    space, random = own.problem.space, np.random.default_rng(seed)
    found = []
    for event in space.events:
        ends = np.array([event.first[0], event.last[0]]) / space.start.lift
        way = np.linspace(0.0, 1.0, space.law_class.free)
        found.append(ends[0] + (ends[1] - ends[0]) * way + 0.01 * random.normal(size=way.size))
    return space.joined(np.concatenate(found))


@pytest.mark.variants(2)
@pytest.mark.parametrize("name", CAMS)
def test_rows_are_exact_at_a_law_and_have_its_slopes(name):
    """The greatest row is the greatest value, of a law that was tried too.

    What its correction changes at the first law goes with the square of the way between them.
    """
    for text in (*QUANTITIES, "radius_of_curvature"):
        own = term_of(name, text)
        space, here = own.problem.space, some_law(own, 1)
        worst = own.worst(space.law(here, "here"))
        assert own.rows(here, [])(here).max() == pytest.approx(worst, rel=1e-9)
        errors = []
        for size in (1e-3, 1e-4):
            there = here + size * (some_law(own, 2) - here)
            corrected = own.rows(here, [there])
            beside = own.worst(space.law(there, "there"))
            assert corrected(there).max() == pytest.approx(beside, rel=1e-7)
            errors.append(abs(corrected(here).max() - worst))  # what linear rows leave out
        assert errors[1] <= 0.02 * errors[0] + 1e-9 * own.scale


def test_the_greatest_branch_is_what_is_measured():
    """By the search over every piece of the branches, and by the profile's own."""
    for name in CAMS:
        for text in QUANTITIES:
            own = term_of(name, text)
            law = own.problem.space.law(some_law(own, 3), "some")
            expected = measured(own.problem, law, term(text), "<=")
            assert own.worst(law) == pytest.approx(expected, rel=1e-6)


# -- (38) to (40) of docs/proofs.md on random laws and programs -------------------------------


#: Free unknowns of a random program, and those that are linked to them.
UNKNOWNS, TIED = 4, 3
#: Relative rounding of sums of rows.
ROUNDING = 1e-12


def random_program(rng, slope=1.0, weight=1.0):
    """A link, an equation, inequalities and a cone in random unknowns, which zero satisfies.

    ``slope`` scales the rows' dependence on the unknowns, ``weight`` that on the level.
    """
    size, count = UNKNOWNS + TIED, 12
    own = np.hstack([rng.normal(size=(TIED, UNKNOWNS)), -np.eye(TIED)])
    program = ConvexProgram(size, Affine(np.zeros(TIED), sparse.csr_array(own)))
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
    free = np.zeros(UNKNOWNS + TIED)
    assert bound_of(blocks, np.zeros(best.multipliers.size)) == 0.0
    for _ in range(200):
        free[:UNKNOWNS] = rng.uniform(-1.0, 1.0, UNKNOWNS)
        free[UNKNOWNS:] = 0.0
        free[UNKNOWNS:] = program.link(free)
        y = np.abs(rng.normal(size=best.multipliers.size))
        in_cones, _ = convex_program._in_cones(blocks, y)
        values = np.concatenate([block.rows(free) for block in blocks])
        matrix = sparse.vstack([block.rows.matrix for block in blocks])
        assert np.abs((matrix.T @ in_cones)[-TIED:]).max() < ROUNDING * np.abs(in_cones).sum()
        # 0 ≤ yᵀ(c + Ax) wherever all rows hold; the sum alone never exceeds the bound.
        assert in_cones @ values <= bound_of(blocks, in_cones) + ROUNDING * np.abs(values).sum()


def test_contradictions_are_proved_for_levels_in_a_range():
    """(40): rows that contradict each other are refuted, rows that can be satisfied are not."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        program = random_program(rng)
        row = Affine(np.zeros(1), sparse.csr_array(rng.normal(size=(1, UNKNOWNS + TIED))))
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
