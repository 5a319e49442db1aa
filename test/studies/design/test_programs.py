"""Tests of the convex programs of a design: laws, forces, limits and bounds.

A program finds the unknowns, the ordinates (coefficients) of a law, with the best goal value, its
level. A row is one inequality or equation, linear in the unknowns.
"""

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
    MAX_LEVEL,
    MAX_ORDINATE,
    Affine,
    ConvexProgram,
    GrowingProgram,
    InfeasibleError,
    solution_of,
    upper_bound,
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
    """Return random linear inequalities that are satisfied if all unknowns are zero."""
    matrix = rng.normal(size=(count, FREE + LINKED)) * rng.integers(0, 2, (count, FREE + LINKED))
    return Affine(rng.uniform(0.1, 1.0, count), sparse.csr_array(matrix))


def linked(rng):
    """Return linear equations by which the last unknowns follow from the others."""
    matrix = np.hstack([rng.normal(size=(LINKED, FREE)), -np.eye(LINKED)])
    return Affine(rng.normal(size=LINKED), sparse.csr_array(matrix))


@pytest.mark.parametrize("seed", range(3))
def test_a_growing_program_equals_separate_programs(seed):
    """A program whose inequalities change gives the results of separate programs.

    There are twelve of them. Inequalities are added, removed, added again and changed. The goal
    value agrees within 1e-7, and its bound within 1e-6.
    """
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


def test_contradicting_rows_are_refused():
    """Contradicting inequalities are refused with a proof.

    The next program is solved again.
    """
    rng = np.random.default_rng(3)
    link, pool, growing = linked(rng), rows(rng, 6), GrowingProgram()
    program = ConvexProgram(FREE + LINKED, link)
    program.at_least("goal", pool, -1.0)
    first = growing.solve(program)
    conflicting = replace(program, blocks=list(program.blocks))
    first_unknown = Affine(np.zeros(1), sparse.csr_array(np.eye(1, FREE + LINKED)))
    conflicting.at_least("above one", first_unknown.plus(-1.0))
    conflicting.at_least("below zero", first_unknown * -1.0)
    with pytest.raises(InfeasibleError, match=r"above one and below zero|below zero and above one"):
        growing.solve(conflicting)
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
    """A law with random ordinates is smooth and has the start law's dwells.

    Ordinates are the coefficients of its pieces. The derivatives are continuous up to the order of
    the joints (where two pieces meet), also from the end of the turn to its start.
    """
    start = build_law(cam(name))
    space = Space(start, law_class)
    unknowns = space.joined(RNG.uniform(-0.5, 1.5, law_class.free * len(space.events)))
    law = space.law(unknowns, "any")
    for order in range(law_class.joints + 1):
        ordinates = law.derivative_ordinates(order)
        step = np.abs(ordinates[0] - np.roll(ordinates[-1], 1)).max()
        assert step <= 1e-8 * np.abs(ordinates).max()
    for start_angle, end in dwells(start):
        angle = np.linspace(start_angle, end, 7)[1:-1]
        np.testing.assert_allclose(law(angle), start(angle), atol=1e-15)


def test_the_derivatives_in_the_unknowns_are_the_laws():
    """The derivatives computed from the unknowns of a program are those of the law.

    The ordinates (coefficients) of s'' and of s are separate unknowns, connected by linear
    equations.
    """
    space = Space(build_law(cam()), LawClass(9, 3))
    unknowns = space.joined(RNG.uniform(0.0, 1.0, 2 * space.law_class.free))
    law, angle = space.law(unknowns, "any"), RNG.uniform(0.0, 2.0 * np.pi, 200)
    for order in range(5):
        expected = law(angle, order)
        found = space.at(order, angle)(unknowns)
        np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("order", range(5))
def test_the_hull_over_a_range_is_that_of_the_range(order):
    """The Bernstein ordinates over a range of angles enclose the derivative there.

    They are coefficients that bound a polynomial. They equal the derivative at the ends of the
    range, and the law outside of it has no effect.
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
    ({"pieces": 0}, "pieces must be between 1 and 200, got 0"),
    ({"pieces": 201}, "pieces must be .*got 201"),
    ({"joints": 0}, "joints must be between 1 and 6, got 0"),
    ({"joints": 3, "degree": 3}, "degree must be above 3"),
    ({"degree": 16}, "degree must be between 2 and 15, got 16"),
    ({"pieces": 1}, "use more pieces or a higher degree"),
    ({"pieces": 200, "degree": 9}, "use fewer pieces"),
)


def test_an_invalid_class_is_refused():
    """An invalid class of laws is refused with number, limits and a remedy.

    The class of a design states pieces, continuity and degree of the laws.
    """
    for arguments, words in REFUSED:
        with pytest.raises(ConfigError, match=words):
            LawClass(**arguments)


def test_a_cam_that_rests_all_around_has_nothing_to_design():
    """A circular cam, whose lift is constant, cannot be designed and is refused."""
    circle = Law("circle", np.array([0.0, 2.0 * np.pi]), np.zeros((2, 1)))
    with pytest.raises(ConfigError, match="must have a lift"):
        Space(circle, LawClass()).events


@pytest.mark.parametrize("seed", range(3))
def test_the_force_is_that_of_the_exact_model(seed):
    """The contact force in a design program equals that of the exact model.

    This applies to the first and to later turns, for random laws, masses and speeds. The exact
    model uses matrix exponentials, the program Gauss points in cells of 0.6 rad of vibration phase.
    They agree within 1e-8 of the largest force.
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
    """A stem with critical or higher damping is refused, because it does not vibrate."""
    follower = FollowerParameters(1.3, 4030.0, 1e4, 30.0, 1.26e6)
    with pytest.raises(ConfigError, match=r"does not vibrate.*allowed.*below"):
        VibrationMode.of(follower)


QUANTITIES = ("shaft_torque@300rpm", "shaft_torque@50-600rpm", "pressure_angle")
CAMS = ("poly345", "oscillating_roller", "oscillating_flat", "conjugate", "eccentric_roller")


def term_of(cam_name, text):
    case, target = problem(LawClass(5, 2), cam_name), term(text)
    branches = rows_of(target).branches
    assert branches is not None
    return PointwiseTerm(case, text, branches(case, target), math.nan)


def some_law(case, seed):
    """Return the unknowns of a random law near a straight line in each event.

    An event is the motion between two dwells.
    """
    space, random = case.problem.space, np.random.default_rng(seed)
    ordinates = []
    for event in space.events:
        end_lifts = np.array([event.first[0], event.last[0]]) / space.start.lift
        fraction = np.linspace(0.0, 1.0, space.law_class.free)
        ordinates.append(
            end_lifts[0]
            + (end_lifts[1] - end_lifts[0]) * fraction
            + 0.01 * random.normal(size=fraction.size)
        )
    return space.joined(np.concatenate(ordinates))


@pytest.mark.variants(2)
@pytest.mark.parametrize("name", CAMS)
def test_rows_are_exact_at_a_law_and_have_its_slopes(name):
    """The linearised rows of a nonlinear limit are exact at the law of linearisation.

    A row is a linear inequality in the law's coefficients. The rows are exact also at a law that
    was tried in addition. The correction for it changes the rows at the first law quadratically in
    the distance of both laws.
    """
    for text in (*QUANTITIES, "radius_of_curvature"):
        case = term_of(name, text)
        space, law_unknowns = case.problem.space, some_law(case, 1)
        worst = case.max_value(space.law(law_unknowns, "here"))
        assert case.rows(law_unknowns, [])(law_unknowns).max() == pytest.approx(worst, rel=1e-9)
        errors = []
        for size in (1e-3, 1e-4):
            other = law_unknowns + size * (some_law(case, 2) - law_unknowns)
            corrected = case.rows(law_unknowns, [other])
            other_value = case.max_value(space.law(other, "there"))
            assert corrected(other).max() == pytest.approx(other_value, rel=1e-7)
            errors.append(abs(corrected(law_unknowns).max() - worst))  # error of the linear rows
        assert errors[1] <= 0.02 * errors[0] + 1e-9 * case.scale


def test_the_maximum_of_the_branches_is_the_measured_value():
    """The largest branch of a nonlinear limit is the value of its quantity, to 1e-6.

    A branch is one of the smooth functions of which a maximum or an absolute value consists.
    """
    for name in CAMS:
        for text in QUANTITIES:
            case = term_of(name, text)
            law = case.problem.space.law(some_law(case, 3), "some")
            expected = measured(case.problem, law, term(text), "<=")
            assert case.max_value(law) == pytest.approx(expected, rel=1e-6)


# -- inequalities (38) to (40) of docs/proofs.md on random laws and programs


#: Number of free unknowns of a random program.
UNKNOWNS = 4
#: Number of unknowns that linear equations determine from the free unknowns.
TIED = 3
#: Relative excess over a bound that is allowed for the rounding of a sum.
ROUNDING = 1e-12


def random_program(rng, slope=1.0, weight=1.0):
    """Return a convex program that zero satisfies: equations, inequalities and a cone.

    `slope` scales the dependence of its rows on the unknowns, `weight` that on the goal value.
    """
    size, count = UNKNOWNS + TIED, 12
    matrix = np.hstack([rng.normal(size=(TIED, UNKNOWNS)), -np.eye(TIED)])
    program = ConvexProgram(size, Affine(np.zeros(TIED), sparse.csr_array(matrix)))
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
    """(38) of docs/proofs.md: Bernstein ordinates enclose the values of a derivative.

    Limits on the ordinates are therefore sufficient, and limits at single points necessary.
    """
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
    """(39) of docs/proofs.md: even wrong multipliers give a valid bound of the goal.

    No goal value that satisfies the program is better than the bound.
    """
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
    assert upper_bound(blocks, np.zeros(best.multipliers.size)) == 0.0
    for _ in range(200):
        free[:UNKNOWNS] = rng.uniform(-1.0, 1.0, UNKNOWNS)
        free[UNKNOWNS:] = 0.0
        free[UNKNOWNS:] = program.link(free)
        y = np.abs(rng.normal(size=best.multipliers.size))
        in_cones, _ = convex_program._in_cones(blocks, y)
        values = np.concatenate([block.rows(free) for block in blocks])
        matrix = sparse.vstack([block.rows.matrix for block in blocks])
        assert np.abs((matrix.T @ in_cones)[-TIED:]).max() < ROUNDING * np.abs(in_cones).sum()
        # 0 ≤ yᵀ(c + Ax) if all rows are satisfied. This sum alone never exceeds the bound.
        assert in_cones @ values <= upper_bound(blocks, in_cones) + ROUNDING * np.abs(values).sum()


def test_contradictions_are_proved_for_levels_in_a_range():
    """(40) of docs/proofs.md: contradicting inequalities are proved infeasible.

    Inequalities that can be satisfied are never reported so.
    """
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
            assert upper_bound(blocks, in_cones) + abs(weight) * MAX_LEVEL >= 0.0


def test_the_box_is_that_of_the_program():
    """The constant β of the bound is the program's limit on the unknowns.

    It is MAX_ORDINATE.
    """
    block = random_program(np.random.default_rng(0)).all_blocks()[-1]
    assert (block.rows.constant == MAX_ORDINATE).all()
