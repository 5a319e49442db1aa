"""Tests of the smallest contact force by modes, against the exact response."""

from dataclasses import asdict, replace

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from scipy.optimize import minimize_scalar

from cam_rig.dynamics.free_masses import TwoMassParameters, contact_response, force_output
from cam_rig.dynamics.jump.any_follower import find_jump
from cam_rig.dynamics.jump.two_masses import force_run
from cam_rig.dynamics.linear.propagator import piece, pieces
from cam_rig.dynamics.linear.response import sample
from cam_rig.dynamics.modal.law_series import law_series
from cam_rig.dynamics.modal.min_output import SearchRange, find_min_output
from cam_rig.dynamics.modal.motion import mode_on_law, motion_at
from cam_rig.dynamics.two_mass import first_lift_off
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.laws.spline import bezier_pieces
from cam_rig.units import RPM, TURN

from ..helpers import TWO, lift_off
from .test_first_zero import forces


def test_exactly_critical_damping(laws, two_mass):
    """At critical damping, where two modes coincide, the smallest force is correct.

    It agrees with 200 000 samples of the exact response within 0.1 %.
    """
    critical = 2.0 * np.sqrt(two_mass.stiffness * two_mass.end_mass)
    parameters = replace(two_mass, stem_damping=0.5 * critical, damping=0.5 * critical)
    law, speed, count = laws["poly345"], 300.0 * RPM, 200_000
    response = contact_response(law, parameters, speed)
    force = sample(response, np.zeros(2), 0.0, 0.0, 0.4 / count, count, force_output(parameters))
    assert force_run(law, parameters, 0.4).min_output(speed) == pytest.approx(force.min(), rel=1e-3)


def test_no_steady_state_at_undamped_resonance(laws, two_mass):
    """Without damping, a speed with a harmonic at the natural frequency is refused.

    There is no steady state.
    """
    parameters = replace(two_mass, stem_damping=0.0, damping=0.0)
    run = force_run(laws["poly345"], parameters, None)
    speed = np.sqrt(parameters.stiffness / parameters.end_mass) / 30.0
    assert np.isfinite(run.steady(0.9 * speed, 0.0)).all()
    with pytest.raises(DynamicsError, match=r"no steady state at .* rpm.*allowed: damping, or"):
        run.steady(speed, 0.0)


# -- smallest force on laws of many pieces, against an exhaustive search

#: Cases: number of polynomial pieces of a law, and factor of the paper's damping.
CASES = [(1, 1.0), (2, 0.3), (7, 0.0), (7, 400.0), (30, 1.0), (90, 228.8), (360, 1.0), (1440, 3.0)]


def random_law(rng, count):
    """Return a random spline of degree 3, 5 or 7 with uneven knots as a motion law.

    `count` is the number of its polynomial pieces. With `count` 1 it is a single Bézier curve.
    """
    if count == 1:
        ordinates = 0.02 * rng.random(10)
        ordinates[-3:] = ordinates[2::-1] = ordinates[0]
        return Law("random", [0.0, TURN], ordinates[:, None])
    degree = int(rng.choice([3, 5, 7]))
    knots = np.cumsum(rng.uniform(0.3, 1.0, max(count, degree + 1)))
    knots = np.append(0.0, knots) * (TURN / knots[-1])
    knots[-1] = TURN
    lifts = 0.02 * (1.0 - np.cos(knots + 0.3 * np.sin(knots))) + 1e-4 * np.sin(3.0 * knots)
    lifts[-1] = lifts[0]
    spline = make_interp_spline(knots, lifts, k=degree, bc_type="periodic")
    breaks, columns = bezier_pieces(spline)
    return Law("random", [0.0, *breaks[1:-1], TURN], np.stack(columns, axis=1))


def random_rig(rng, damping):
    """Return two masses with 1 to 1.5 times the parameters of the identified rig.

    The factors are random. `damping` is a further factor of both dampers.
    """
    numbers = {name: x * rng.uniform(1.0, 1.5) for name, x in asdict(TWO).items()}
    rig = TwoMassParameters(**numbers)
    return replace(rig, stem_damping=damping * rig.stem_damping, damping=damping * rig.damping)


@pytest.mark.variants(6)
@pytest.mark.parametrize("from_rest", [True, False])
@pytest.mark.parametrize(("count", "damping"), CASES)
def test_least_force_is_the_exhaustive_minimum(count, damping, from_rest):
    """The smallest contact force of a run is that of the exact model.

    The tolerance is 1e-11 of the largest force. The reference is the lowest of 40 000 samples and a
    minimisation next to it. The lower bounds per group of pieces are not above the samples either.
    """
    if not from_rest and damping == 0.0:
        return  # no steady state
    rng = np.random.default_rng(count)
    law, rig = random_law(rng, count), random_rig(rng, damping)
    speed = rng.uniform(150.0, 450.0) * RPM
    duration = rng.uniform(0.2, 0.5) if from_rest else None
    length = duration or TURN / speed
    times = np.linspace(0.0, length, 40_001)[:-1]
    force = forces(law, rig, speed, duration, speed * times)
    run = force_run(law, rig, duration)
    table = law_series(law)
    floors = np.full(table.first_pieces.size - 1, np.inf)
    search = SearchRange(0.0, speed * length, 0.25)
    motion = motion_at(mode_on_law(table, run.mode), speed)
    coarse = find_min_output(table, run.mode, motion, search, floors)
    size = np.abs(force).max()
    starts = table.breaks[table.first_pieces]
    group = np.searchsorted(starts, (speed * times) % TURN + 1e-12, side="right") - 1
    assert (force >= np.array(floors)[group] - 1e-11 * size).all()
    assert coarse.value - 0.25 * abs(coarse.value) <= force.min() + 1e-11 * size
    lowest_time, step = times[int(np.argmin(force))], times[1]
    low, high = max(0.0, lowest_time - step), min(length, lowest_time + step)
    refined = minimize_scalar(
        lambda t: forces(law, rig, speed, duration, speed * np.array([t]))[0],
        bounds=(low, high),
        method="bounded",
        options={"xatol": 1e-12},
    )
    exact = min(force.min(), refined.fun)
    assert run.min_output(speed) == pytest.approx(exact, abs=1e-11 * size)


@pytest.mark.parametrize("count", [1, 8, 60, 360])
def test_first_lift_off_is_that_of_a_simulation(count):
    """`first_lift_off` returns the time of a simulation's first event, or None."""
    rng = np.random.default_rng(count)
    law, rig = random_law(rng, count), random_rig(rng, 1.0)
    lift_offs = 0
    for rpm in rng.uniform(300.0, 1500.0, 8):
        speed = rpm * RPM
        simulated = lift_off(law, rig, speed, np.zeros(2), 0.5)
        time = first_lift_off(law, rig, speed, np.zeros(2), 0.5)
        assert (simulated is None) == (time is None)
        if simulated is not None:
            lift_offs += 1
            assert time == pytest.approx(simulated, rel=1e-9)
    assert lift_offs


@pytest.mark.variants(1)
@pytest.mark.parametrize("seed", [133, 232, 257])
def test_no_lift_off_at_the_end_of_a_part(seed):
    """Below the jump speed no lift-off is reported within a run of 0.5 s.

    The random cases are those in which a former search restarted at the end of a part of the run.
    """
    # A former search restarted after the end of a part, because this end was one float before the
    # requested time.
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 40))
    law, rig = random_law(rng, count), random_rig(rng, 1.0)
    jump = find_jump(law, rig, 0.5).speed
    for speed in jump * np.append(rng.uniform(0.8, 1.0, 10), np.linspace(0.985, 1.0, 20)[:-1]):
        assert lift_off(law, rig, speed, np.zeros(2), 0.5) is None
        assert first_lift_off(law, rig, speed, np.zeros(2), 0.5) is None


def test_pieces_together_are_pieces_alone():
    """`pieces` solves many linear systems in one call, with the results of `piece`.

    Both return the exact solution over one polynomial of the drive. The tolerance is 1e-13. The
    durations are mixed, with slow and fast modes.
    """
    rng = np.random.default_rng(5)
    for matrix in (
        np.array([[0.0, 1.0], [-1.4e6, -20.0]]),
        np.array([[0.0, 1.0], [-90.0, -40.0]]),
        rng.normal(size=(4, 4)) - 3.0 * np.eye(4),
    ):
        durations = 10.0 ** rng.uniform(-5.0, -1.0, 40)
        forcing = rng.normal(size=(matrix.shape[0], 6, 40))
        for i, joint in enumerate(pieces(matrix, forcing, durations)):
            alone = piece(matrix, forcing[:, :, i], float(durations[i]))
            size = np.abs(alone.particular).max()
            atol = 1e-13 * size
            np.testing.assert_allclose(joint.particular, alone.particular, rtol=0, atol=atol)
            np.testing.assert_allclose(joint.part_flow, alone.part_flow, rtol=1e-13, atol=1e-13)
