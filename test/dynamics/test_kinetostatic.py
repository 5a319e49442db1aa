"""The follower that never leaves the cam: force balance, derivatives, power."""

import numpy as np
import pytest

from cam_rig.dynamics import Interval, kinetostatic
from cam_rig.dynamics.kinetostatic import force_ordinates, loss_intervals
from cam_rig.laws import bernstein
from cam_rig.units import NS, TURN

RPM = 400.0
SPEED = RPM * np.pi / 30.0
TURN_NS = round(60 / RPM * NS)
RATE = 48_000


@pytest.fixture
def turn(law, follower, run):
    """Samples of one turn."""
    return run(law, follower, RPM, [0, TURN_NS], model="kinetostatic", sample_rate=RATE).rows


@pytest.mark.variants(3)
def test_force_balance(turn, follower):
    """F = m a + c v + k s + preload at each sample, to rounding of the largest force."""
    _, lift, velocity, acceleration, force, impulse = turn
    p = follower
    expected = p.mass * acceleration + p.damping * velocity + p.spring_stiffness * lift + p.preload
    np.testing.assert_allclose(force, expected, rtol=0, atol=1e-12 * np.abs(force).max())
    assert not impulse.any()


@pytest.mark.variants(3)
@pytest.mark.parametrize("row", [1, 2])
def test_each_row_is_the_rate_of_the_one_before(turn, law, row):
    """Velocity and acceleration are central differences of lift and velocity, off the joints."""
    t, h = turn[0], 1.0 / RATE
    difference = (turn[row, 2:] - turn[row, :-2]) / (2 * h)
    angle = SPEED * t[1:-1]
    inside = np.abs(angle[:, None] - law.breaks).min(axis=1) > 2 * SPEED * h
    third = np.abs(law.derivative_ordinates(row + 2)).max() * SPEED ** (row + 2)
    tolerance = h**2 / 6 * third + 1e-13 / h * np.abs(turn[row]).max()  # truncation + rounding
    np.testing.assert_allclose(
        turn[row + 1, 1:-1][inside], difference[inside], rtol=0, atol=tolerance
    )


@pytest.mark.variants(3)
def test_time_is_the_grid(turn):
    """Sample k stands at k / rate."""
    np.testing.assert_array_equal(turn[0], np.arange(turn.shape[1]) / RATE)


@pytest.mark.variants(3)
def test_power_balance(law, follower):
    """Over a turn the cam's work ∮F ds is what the damper burns: spring and mass give all back."""
    nodes, weights = np.polynomial.legendre.leggauss(24)  # exact to degree 47; F·s' has 29
    u = 0.5 * (nodes + 1.0)
    forces = force_ordinates(law, follower, SPEED)
    work = burnt = moved = 0.0
    for i, span in enumerate(law.spans):
        force = bernstein.evaluate(forces[:, i], u)
        velocity = SPEED * bernstein.evaluate(law.motion[1][:, i], u)
        time = 0.5 * weights * span / SPEED
        work += time @ (force * velocity)
        burnt += time @ (follower.damping * velocity**2)
        moved += time @ np.abs(force * velocity)
    assert burnt > 0.0
    assert work == pytest.approx(burnt, abs=1e-13 * moved)


@pytest.mark.variants(3)
def test_state_is_the_next_sample(law, follower):
    """The state at the end is what the next interval's first sample shows."""
    stop = 37 * NS // 1000
    first, second = (
        Interval(a, b, SPEED * a / NS, SPEED) for a, b in ((0, stop), (stop, 2 * stop))
    )
    state, _ = kinetostatic.advance(law, follower, None, first, 1000)
    _, block = kinetostatic.advance(law, follower, state, second, 1000)
    shown = (state.displacement, state.velocity, state.contact_force)
    sizes = np.abs(block.rows[[1, 2, 4]]).max(axis=1)
    assert np.all(np.abs(block.rows[[1, 2, 4], 0] - shown) <= 1e-12 * sizes)
    assert state.in_contact


@pytest.mark.variants(3)
def test_loss_intervals_are_where_the_force_pulls(law, follower):
    """Inside a loss interval F < 0, outside F ≥ 0, at every sampled angle clear of its ends."""
    angle = np.linspace(0.0, TURN, 5001)[1:-1]
    for rpm in (100.0, 400.0, 700.0):
        speed = rpm * np.pi / 30.0
        s, ds, dds = (law(angle, k) for k in range(3))
        p = follower
        force = p.mass * speed**2 * dds + p.damping * speed * ds + p.spring_stiffness * s
        force += p.preload
        lost = np.zeros(angle.size, dtype=bool)
        near = np.zeros(angle.size, dtype=bool)
        for start, stop in loss_intervals(law, p, speed):
            lost |= (angle > start) & (angle < stop)
            near |= np.minimum(np.abs(angle - start), np.abs(angle - stop)) < 1e-9
        np.testing.assert_array_equal(lost[~near], force[~near] < 0.0)
