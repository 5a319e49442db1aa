"""Torsional vibration: energy, momentum, and shafts that vibrate freely in a dwell."""

import dataclasses

import numpy as np
import pytest

from cam_rig.dynamics.torsional.motion import solve
from cam_rig.dynamics.torsional.parameters import TorsionalParameters, TorsionalState
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


@pytest.mark.variants(8)
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


@pytest.mark.variants(8)
@pytest.mark.parametrize("speed", [0.0, 3.0])
def test_the_balance_holds_without_damping(law, follower, speed):
    """No damper: what is stored changes by the flywheel's work alone, turning back too."""
    p = TorsionalParameters(dataclasses.replace(follower, damping=0.0), 0.02, 5e3)
    motion = solve(law, p, TorsionalState(0.05, 5.0, 2.6, speed), 0.0, 0.3)
    times = np.linspace(0.0, 0.3, 2000)
    rows = motion.at(times)
    total = stored(motion, times)
    given = -integral(motion, motion.shaft_torque) * speed
    assert total[-1] - total[0] == pytest.approx(given, abs=1e-9 * total.max())
    assert rows[3].min() < 0.0 < rows[3].max()
    if speed == 0.0:  # a flywheel at rest does no work
        np.testing.assert_allclose(total, total[0], rtol=1e-11)


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
