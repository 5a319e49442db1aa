"""Torsional vibration: energy, momentum, and shafts that vibrate freely in a dwell."""

import dataclasses

import numpy as np
import pytest

from cam_rig.dynamics.torsional.solution import TorsionalParameters, TorsionalState, solve
from cam_rig.laws import Law
from cam_rig.units import TURN

NODES, WEIGHTS = np.polynomial.legendre.leggauss(48)
SPEED = 350.0 * np.pi / 30.0


@pytest.fixture(scope="module")
def shaft(follower):
    """A soft shaft, damped."""
    return TorsionalParameters(follower, 0.02, 8e3, 0.4)


@pytest.fixture(scope="module")
def round_cam():
    """A cam without lift."""
    return Law("round", np.array([0.0, TURN]), np.zeros((1, 1)))


def stored(motion, times):
    """Energy (J) of cam, follower, its spring, and the shaft's twist."""
    p, f = motion.parameters, motion.parameters.follower
    twist, _, angle, speed = motion.at(times)[:4]
    s, s1 = motion.law(angle), motion.law(angle, 1)
    energy = 0.5 * (p.cam_inertia + f.mass * s1**2) * speed**2
    return (
        energy + (0.5 * f.spring_stiffness * s + f.preload) * s + 0.5 * p.shaft_stiffness * twist**2
    )


def integral(motion, value):
    """∫ value dt over all windows of a motion, by Gauss-Legendre in each."""
    edges = motion.path.edges + motion.start_time
    half = 0.5 * np.diff(edges)
    times = (edges[:-1] + half)[:, None] + half[:, None] * NODES
    return float(np.sum(half[:, None] * WEIGHTS * value(times.ravel()).reshape(times.shape)))


def burnt(motion, times):
    """Power (W) lost in both dampers."""
    p = motion.parameters
    _, twist_rate, angle, speed = motion.at(times)[:4]
    velocity = motion.law(angle, 1) * speed
    return p.shaft_damping * twist_rate**2 + p.follower.damping * velocity**2


def test_energy_balance(law, shaft):
    """What the flywheel of fixed speed gives is stored or burnt, to 1e-11 of what flows."""
    duration = 2.3 * TURN / SPEED
    motion = solve(law, shaft, TorsionalState(2e-4, -0.1, 0.7, SPEED), 0.0, duration)
    given = -integral(motion, motion.shaft_torque) * SPEED
    flows = integral(motion, lambda t: np.abs(motion.shaft_torque(t))) * SPEED
    change = float(np.diff(stored(motion, np.array([0.0, duration])))[0])
    lost = integral(motion, lambda t: burnt(motion, t))
    assert lost > 0.0
    assert given == pytest.approx(change + lost, abs=1e-11 * flows)


@pytest.mark.parametrize("speed", [SPEED, 3.0, 0.0, -SPEED])
def test_energy_is_kept_without_damping(law, follower, speed):
    """Free flywheel, no damper: one number never changes, also where the cam turns back."""
    p = TorsionalParameters(dataclasses.replace(follower, damping=0.0), 0.02, 5e3, 0.0, 0.3)
    motion = solve(law, p, TorsionalState(0.05, 5.0, 2.6, speed), 0.0, 0.3)
    times = np.linspace(0.0, 0.3, 2000)
    rows = motion.at(times)
    total = stored(motion, times) + 0.5 * p.flywheel_inertia * (rows[3] - rows[1]) ** 2
    np.testing.assert_allclose(total, total[0], rtol=1e-11)
    if speed in (0.0, 3.0):
        assert rows[3].min() < 0.0 < rows[3].max()


@pytest.mark.parametrize("damping", [0.0, 0.4, 19.9, 20.0, 300.0])
def test_free_vibration_is_exact(round_cam, follower, damping):
    """I ψ̈ + c ψ̇ + k ψ = 0 from weakly damped through critical (c = 20) to creeping."""
    p = TorsionalParameters(follower, 0.02, 5e3, damping)
    times = np.linspace(0.0, 0.2, 501)
    got = solve(round_cam, p, TorsionalState(1e-3, 0.4, 0.0, SPEED), 0.0, 0.2).at(times)
    roots = np.roots([p.cam_inertia, damping, p.shaft_stiffness]).astype(complex)
    if damping == 20.0:
        roots = np.array([-500.0, -500.0])
        twist = (1e-3 + (0.4 + 0.5) * times) * np.exp(-500.0 * times)
    else:
        a = np.linalg.solve(np.stack([np.ones(2), roots]), np.array([1e-3, 0.4]))
        twist = (np.exp(np.outer(times, roots)) @ a).real
    np.testing.assert_allclose(got[0], twist, rtol=0, atol=2e-13 * np.abs(twist).max())
    np.testing.assert_allclose(got[2] - got[0], SPEED * times, rtol=0, atol=1e-14)


def test_two_inertias_and_a_motor(round_cam, follower):
    """Without lift the momentum grows by the motor's torque, and ψ swings about −T/(k I_v μ)."""
    p = TorsionalParameters(follower, 0.02, 5e3, 0.0, 0.05, 7.0)
    times = np.linspace(0.0, 0.2, 300)
    got = solve(round_cam, p, TorsionalState(0.0, 0.0, 0.0, SPEED), 0.0, 0.2).at(times)
    momentum = 0.02 * got[3] + 0.05 * (got[3] - got[1])
    np.testing.assert_allclose(momentum, 0.07 * SPEED + 7.0 * times, rtol=1e-13)
    mobility = 1.0 / 0.02 + 1.0 / 0.05
    middle, rate = -7.0 / 0.05 / (mobility * 5e3), np.sqrt(mobility * 5e3)
    swing = middle * (1.0 - np.cos(rate * times))
    np.testing.assert_allclose(got[0], swing, rtol=0, atol=1e-13 * abs(middle))


def test_flywheel_feels_the_cam(laws, shaft):
    """Momentum of both inertias changes by the follower's torque F s' alone."""
    p = dataclasses.replace(shaft, flywheel_inertia=0.1)
    duration = TURN / SPEED
    motion = solve(laws["tm21"], p, TorsionalState(0.0, 0.0, 1.0, SPEED), 0.0, duration)
    rows = motion.at(np.array([0.0, duration]))
    momentum = p.cam_inertia * rows[3] + p.flywheel_inertia * (rows[3] - rows[1])

    def torque(times):
        return motion.contact_force(times) * motion.law(motion.at(times)[2], 1)

    flows = integral(motion, lambda t: np.abs(torque(t)))
    assert momentum[1] - momentum[0] == pytest.approx(-integral(motion, torque), abs=1e-12 * flows)
    assert flows > 0.005
