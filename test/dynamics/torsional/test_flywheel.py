"""Elastic shaft with a flywheel of finite inertia: momentum, energy, limits."""

import dataclasses
import math

import numpy as np
import pytest

from cam_rig.dynamics import MODELS, FollowerParameters, Interval
from cam_rig.dynamics.torsional.model import TorsionalParameters, TorsionalState
from cam_rig.dynamics.torsional.motion import solve, steady_motion
from cam_rig.laws import Law
from cam_rig.schema import load_rig
from cam_rig.units import TURN

from ..helpers import MS, gauss, run_in_ticks

SPEED = 300.0 * np.pi / 30.0


@pytest.fixture(scope="module")
def shaft(config_dir):
    """Shaft parameters of the shipped rig with a flywheel."""
    return MODELS["torsional"].parameters(load_rig(config_dir / "rigs" / "paper_flywheel.yaml"))


def integral(motion, value):
    """Return the integral of the function `value` of time (s) over a torsional motion.

    It uses the Gauss-Legendre rule.
    """
    times, weights = gauss(motion.path.edges, 48)
    return float(weights @ value(times))


def momentum(motion, time):
    """Return the sum of the angular momenta (N·m·s) of flywheel and cam at a time (s)."""
    p, times = motion.parameters, np.array([time])
    cam = p.cam_inertia * motion.at(times)[3, 0]
    return cam + p.flywheel_inertia * (SPEED + motion.lead(times)[1, 0])


@pytest.mark.variants(3)
def test_balance_of_angular_momentum(law, shaft):
    """The angular momentum of shaft and cam changes by the integral of the torques.

    The torque is motor torque minus follower torque F s', with the contact force F. The tolerance
    is 1e-12 of the integral of |F s'|.
    """
    p = dataclasses.replace(shaft, motor_torque=2.0)
    start = TorsionalState(2e-4, -0.1, 0.7, SPEED, 0.01, -0.3)
    motion = solve(law, p, start, 0.0, 1.7 * TURN / SPEED)

    def load(times):
        return motion.contact_force(times) * law(motion.at(times)[2], 1)

    change = momentum(motion, motion.stop_time) - momentum(motion, 0.0)
    expected = 2.0 * motion.stop_time - integral(motion, load)
    size = integral(motion, lambda times: np.abs(load(times)))
    assert change == pytest.approx(expected, abs=1e-12 * size)


def test_two_inertias_and_a_motor(shaft):
    """Without lift, flywheel and cam are two inertias that the motor accelerates.

    The twist ψ oscillates about −T/(k I_v μ), with the motor torque T and the mobility μ.
    """
    disc = Law("round", np.array([0.0, TURN]), np.zeros((1, 1)))
    p = dataclasses.replace(shaft, shaft_damping=0.0, flywheel_inertia=0.05, motor_torque=7.0)
    times = np.linspace(0.0, 0.2, 300)
    motion = solve(disc, p, TorsionalState(0.0, 0.0, 0.0, SPEED), 0.0, 0.2)
    got, lead = motion.at(times), motion.lead(times)
    total = p.cam_inertia * got[3] + 0.05 * (SPEED + lead[1])
    np.testing.assert_allclose(total, (p.cam_inertia + 0.05) * SPEED + 7.0 * times, rtol=1e-13)
    middle = -7.0 / 0.05 / (p.mobility * p.shaft_stiffness)
    rate = math.sqrt(p.mobility * p.shaft_stiffness)
    swing = middle * (1.0 - np.cos(rate * times))
    np.testing.assert_allclose(got[0], swing, rtol=0, atol=1e-13 * abs(middle))
    np.testing.assert_allclose(got[2], SPEED * times + lead[0] + got[0], rtol=0, atol=1e-13)


@pytest.mark.variants(4)
@pytest.mark.parametrize("seed", range(6))
def test_the_steady_state_returns_after_a_turn(laws, seed):
    """The steady state returns after a turn, to 1e-9.

    In a turn the work of the motor equals that of the dampers.
    """
    rng = np.random.default_rng(seed)
    law = laws[["poly345", "tm21", "bezier15", "cycloidal", "poly4567", "modified_sine"][seed]]
    inertia, flywheel = 10.0 ** rng.uniform(-2.5, -1.0), 10.0 ** rng.uniform(-2.0, 4.0)
    numbers = rng.uniform([0.3, 1e3, 1.0], [2.0, 8e3, 20.0])
    follower = FollowerParameters(*numbers, 40.0, 1e6)
    stiffness, damping = 10.0 ** rng.uniform(3.5, 5.0), rng.uniform(0.02, 1.0)
    speed = rng.uniform(15.0, 60.0)
    p = TorsionalParameters(follower, inertia, stiffness, damping, flywheel)
    motion = steady_motion(law, p, speed)
    ends = np.array([0.0, motion.stop_time])
    (first, last), peak = motion.lead(ends).T, np.abs(motion.lead(motion.path.edges)).max(axis=1)
    assert (np.abs(last - first) <= 1e-9 * peak).all()
    twist = motion.at(ends)[:2]
    assert np.abs(np.diff(twist[0])) <= 1e-9 * np.abs(motion.at(motion.path.edges)[0]).max()

    def dissipation(times):
        _, rate, angle, cam_speed = motion.at(times)[:4]
        return damping * rate**2 + follower.damping * (law(angle, 1) * cam_speed) ** 2

    work = motion.parameters.motor_torque * TURN
    assert work == pytest.approx(integral(motion, dissipation), rel=1e-8)


@pytest.mark.parametrize("cam", ["poly345", "tm21"])
def test_a_heavy_flywheel_has_constant_speed(laws, shaft, cam):
    """With an infinite flywheel the twist of the shaft is that at constant speed.

    The difference decreases as 1/I_v with the flywheel inertia I_v, down to rounding. Constant
    speed is the assumption of eq. 10 of the paper.
    """
    law, times = laws[cam], np.linspace(0.0, TURN / SPEED, 400)
    limit = steady_motion(law, dataclasses.replace(shaft, flywheel_inertia=None), SPEED).at(times)
    errors = []
    for inertia in (1e3, 1e5, 1e13):
        p = dataclasses.replace(shaft, flywheel_inertia=inertia)
        rows = steady_motion(law, p, SPEED).at(times)
        errors.append(np.abs(rows[0] - limit[0]).max() / np.abs(limit[0]).max())
    assert errors[0] / errors[1] == pytest.approx(100.0, rel=0.02)
    assert errors[2] < 1e-10


def by_energy(law, p, motion, times):
    """Return the cam speed (rad/s) at some times (s) from the conservation of energy.

    The shaft is rigid and undamped: ½(I + I_v + m s'²) θ̇² + ½ k s² + F₀ s = E, with E at the first
    time.
    """
    angle, speed = motion.at(times)[2:4]
    f, s, s1 = p.follower, law(angle), law(angle, 1)
    inertia = p.cam_inertia + p.flywheel_inertia + f.mass * s1**2
    stored = 0.5 * f.spring_stiffness * s**2 + f.preload * s
    energy = 0.5 * inertia[0] * speed[0] ** 2 + stored[0]
    return np.sqrt(2.0 * (energy - stored) / inertia)


@pytest.mark.variants(1)
@pytest.mark.parametrize(
    ("inertia", "stiffness", "error"), [(0.2, 1e7, 2e-5), (0.02, 1e7, 2e-5), (1e-5, 5e3, 1e-3)]
)
def test_the_speed_of_one_body_follows_from_energy(laws, shaft, inertia, stiffness, error):
    """Without elasticity the cam speed follows from the conservation of energy.

    The shaft is nearly rigid, or has almost no flywheel. Cam and flywheel are then one body whose
    energy is constant. The relative tolerance is 2e-5 or 1e-3.
    """
    follower = dataclasses.replace(shaft.follower, damping=0.0)
    p = TorsionalParameters(follower, 0.02, stiffness, 1e-9, inertia)
    law, times = laws["poly4567"], np.linspace(0.0, TURN / SPEED, 300)
    motion = steady_motion(law, p, SPEED)
    expected = by_energy(law, p, motion, times)
    np.testing.assert_allclose(motion.at(times)[3], expected, rtol=error)
    assert np.ptp(expected) > 0.02 * SPEED


def test_a_run_may_start_at_any_angle(laws, shaft):
    """A torsional run that starts within a turn starts in the steady state.

    This is the steady state at its cam angle. The lift agrees with that of a run from angle 0 to
    1e-12 m.
    """
    whole = Interval(0, 200 * MS, 0.0, SPEED)
    rows = run_in_ticks(laws["poly345"], "torsional", shaft, whole, [0, 200 * MS], 24_000)[0]
    part = Interval(90 * MS, 200 * MS, SPEED * 0.09, SPEED)
    late = MODELS["torsional"].advance(laws["poly345"], shaft, None, part, 24_000)[1].rows
    np.testing.assert_allclose(late[1], rows[1, -late.shape[1] :], rtol=0, atol=1e-12)


def test_a_ramp_follows_the_drive_and_a_new_speed_is_steady(laws, shaft):
    """On a speed ramp the drive prescribes the motion of the flywheel.

    After the ramp, and after a change of speed, the motion of the shaft is steady again.
    """
    law, advance = laws["poly345"], MODELS["torsional"].advance
    ramp = Interval(0, 100 * MS, 0.0, 0.0, 10.0 * SPEED)
    driven = dataclasses.replace(shaft, flywheel_inertia=None)
    state, block = advance(law, shaft, None, ramp, 24_000)
    np.testing.assert_array_equal(block.rows, advance(law, driven, None, ramp, 24_000)[1].rows)
    after = Interval(100 * MS, 300 * MS, ramp.angle_at(0.1), SPEED)
    rows = advance(law, shaft, state, after, 24_000)[1].rows
    np.testing.assert_array_equal(rows, advance(law, shaft, None, after, 24_000)[1].rows)
    faster = dataclasses.replace(after, speed=1.1 * SPEED)
    state = advance(law, shaft, None, after, 24_000)[0]
    other = dataclasses.replace(state, cam_angle=None)
    rows = advance(law, shaft, other, faster, 24_000)[1].rows
    np.testing.assert_array_equal(rows, advance(law, shaft, None, faster, 24_000)[1].rows)
