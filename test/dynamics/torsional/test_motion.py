"""Torsional vibration against other integrators, 40-digit arithmetic and closed forms."""

import dataclasses
import itertools
import math

import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import BPoly

from benchmark.speed import exact as exact_twist
from benchmark.speed.models import Case, Twist
from cam_rig.dynamics import MODELS, FollowerParameters, Interval
from cam_rig.dynamics.linear.propagator import piece
from cam_rig.dynamics.torsional.motion import periodic_state, solve
from cam_rig.dynamics.torsional.parameters import TorsionalParameters, TorsionalState
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law, bernstein, build_law
from cam_rig.units import TURN

from ..helpers import MS, every, ticked

SPEED, SLOW = 400.0 * np.pi / 30.0, 350.0 * np.pi / 30.0


@pytest.fixture(scope="module")
def shaft(follower):
    """A soft shaft, lightly damped."""
    return TorsionalParameters(follower, 0.02, 5e3, 0.05)


def acceleration(p, s, twist, twist_rate, speed):
    """θ̈_c of eq. 10 from s, s', s''."""
    f = p.follower
    force = f.mass * s[2] * speed**2 + f.damping * s[1] * speed
    force += f.spring_stiffness * s[0] + f.preload
    torque = p.shaft_damping * twist_rate + p.shaft_stiffness * twist + force * s[1]
    return -torque / (p.cam_inertia + f.mass * s[1] ** 2)


def integrate(law, p, state, duration, times, method="DOP853", rtol=2.3e-14):
    """The same by scipy, joint by joint (cam turning forwards), with BPoly for the law."""
    lift = BPoly(law.ordinates, law.breaks)
    laws = [lift, lift.derivative(), lift.derivative(2)]
    k, c, steady = p.flywheel_acceleration
    y = np.array(dataclasses.astuple(state)[:4])
    out, time = np.empty((4, times.size)), 0.0
    while time < duration:
        angle = y[0] + y[2] + 1e-9
        turn = math.floor(angle / TURN) * TURN
        i = int(np.searchsorted(law.breaks, angle - turn, side="right")) - 1
        low, joint = law.breaks[i] + turn, law.breaks[i + 1] + turn

        series = [local(poly, law.breaks[i]) for poly in laws]

        def slopes(_, y, low=low, series=series):
            x = y[0] + y[2] - low
            s = [sum(a * x**j for j, a in enumerate(row)) for row in series]
            flywheel = k * y[0] + c * y[1] + steady
            return [y[1], acceleration(p, s, y[0], y[1], y[1] + y[3]) - flywheel, y[3], flywheel]

        def crossing(_, y, joint=joint):
            return y[0] + y[2] - joint

        crossing.terminal, crossing.direction = True, 1.0
        run = solve_ivp(
            slopes, (time, duration), y, method, rtol=rtol, atol=1e-17,
            events=crossing, dense_output=True,
        )  # fmt: skip
        here = (times >= time) & (times <= run.t[-1])
        if here.any():
            out[:, here] = run.sol(times[here])
        time, y = run.t[-1], run.y[:, -1]
    return out


def local(poly, at):
    """Power series of a piece about its beginning."""
    i = int(np.flatnonzero(poly.x == at)[0])
    ordinates, span = poly.c[:, i], poly.x[i + 1] - poly.x[i]
    series = []
    for j in range(ordinates.size):
        row = ordinates
        for _ in range(j):
            row = bernstein.derivative(row)
        series.append(row[0] / math.factorial(j) / span**j)
    return series


@pytest.mark.parametrize(("name", "inertia"), [("poly345", 0.05), ("tm21", None)])
def test_against_dop853(laws, shaft, name, inertia):
    """Over a turn, all joints crossed (tm21: with steps of s''): within the peer's own error."""
    duration = 1.5 * TURN / SPEED
    times = np.linspace(0.0, duration, 301)
    state = TorsionalState(1e-4, 0.02, 0.1, SPEED)
    shaft = dataclasses.replace(
        shaft, flywheel_inertia=inertia, motor_torque=0.3 if inertia else 0.0
    )
    motion = solve(laws[name], shaft, state, 0.0, duration)
    got = motion.at(times)
    twist, rate, angle, speed = integrate(laws[name], shaft, state, duration, times)
    lead = np.stack([angle - 0.1 - SPEED * times, speed - SPEED])
    np.testing.assert_allclose(motion.lead(times), lead, rtol=0, atol=2e-11)
    peak = np.abs(twist).max()
    np.testing.assert_allclose(got[0], twist, rtol=0, atol=1e-11 * peak)
    np.testing.assert_allclose(got[1], rate, rtol=0, atol=1e-11 * np.abs(rate).max())
    np.testing.assert_allclose(got[2], twist + angle, rtol=0, atol=1e-12)
    np.testing.assert_allclose(got[3], rate + speed, rtol=1e-11)


def test_against_radau(laws, shaft):
    """An implicit method of another family agrees as far as it goes."""
    state, duration = TorsionalState(0.0, 0.0, 0.5, SPEED), 0.008
    times = np.linspace(0.0, duration, 50)
    got = solve(laws["poly345"], shaft, state, 0.0, duration).at(times)
    peer = integrate(laws["poly345"], shaft, state, duration, times, "Radau", 1e-11)
    np.testing.assert_allclose(got[0], peer[0], rtol=0, atol=1e-8 * np.abs(peer[0]).max())


def test_against_forty_digits(laws, shaft, many_digits):
    """5 ms inside the rise, from a twist and a rate, against Taylor's series in 40 digits."""
    p = shaft
    law, state, duration = laws["poly345"], TorsionalState(1e-3, 0.3, 1.2, SPEED), 0.005
    got = solve(law, p, state, 0.0, duration).at([duration])[:, 0]
    f = p.follower
    numbers = (p.cam_inertia, p.shaft_stiffness, p.shaft_damping)
    inputs = (law.breaks, law.ordinates, dataclasses.astuple(state)[:4], duration, numbers)
    follower = (f.mass, f.spring_stiffness, f.damping, f.preload)
    twist, rate, angle, speed = many_digits(
        lambda: by_taylor(law, p, state, duration), (*inputs, follower)
    )
    assert got[0] == pytest.approx(twist, abs=1e-13 * 3e-3)
    assert got[1] == pytest.approx(rate, abs=1e-13 * 1.5)
    assert got[2] == pytest.approx(angle, abs=1e-15)
    assert got[3] == pytest.approx(speed, abs=1e-13 * SPEED)


def by_taylor(law, p, state, duration):
    """Twist, its rate, the cam's angle and its speed."""
    with mp.workdps(40):
        end = taylor(law, p, state, duration)
        return [float(x) for x in (end[0], end[1], end[0] + end[2], end[1] + end[3])]


def taylor(law, p, state, duration):
    """mpmath's integrator; the law by de Casteljau on exact ordinates."""
    i = int(np.searchsorted(law.breaks, state.flywheel_angle)) - 1
    rows, span = [[mp.mpf(b) for b in law.ordinates[:, i]]], mp.mpf(law.spans[i])
    for _ in range(2):
        last = rows[-1]
        rows.append([(len(last) - 1) * (b - a) / span for a, b in itertools.pairwise(last)])

    def casteljau(row, u):
        while len(row) > 1:
            row = [a + (b - a) * u for a, b in itertools.pairwise(row)]
        return row[0]

    def slopes(_, y):
        u = (y[0] + y[2] - mp.mpf(law.breaks[i])) / span
        s = [casteljau(row, u) for row in rows]
        return [y[1], acceleration(p, s, y[0], y[1], y[1] + y[3]), y[3], mp.mpf(0)]

    return mp.odefun(slopes, 0, [mp.mpf(x) for x in dataclasses.astuple(state)[:4]])(
        mp.mpf(duration)
    )


def test_linear_limit(laws, shaft):
    """A cam of a nanometre is a torque on a linear oscillator: the exact propagator's answer."""
    base = laws["poly4567"]
    law = Law("tiny", base.breaks, 1e-8 * base.ordinates)
    a = np.array([[0.0, 1.0], [-shaft.shaft_stiffness, -shaft.shaft_damping]])
    a[1] /= shaft.cam_inertia
    state, times, expected = np.array([1e-11, 1e-9]), [], []
    for i, span in enumerate(law.spans):
        torque = shaft.follower.preload * law.motion[1, :, i]
        forcing = np.stack([np.zeros_like(torque), -torque / shaft.cam_inertia])
        part = piece(a, forcing, span / SPEED)
        inside = np.linspace(0.0, 0.99, 20) * span / SPEED
        times.append(law.breaks[i] / SPEED + inside)
        expected.append(part.at(state, inside))
        state = part.end(state)
    times, expected = np.concatenate(times), np.concatenate(expected, axis=1)
    motion = solve(law, shaft, TorsionalState(1e-11, 1e-9, 0.0, SPEED), 0.0, TURN / SPEED)
    got = motion.at(times)[:2]
    for row, exact in zip(got, expected, strict=True):
        # the follower's spring and the twisted angle enter at 1e-9 of the torque
        np.testing.assert_allclose(row, exact, rtol=0, atol=3e-8 * np.abs(exact).max())


def test_heavy_cam_does_not_twist(laws, shaft):
    """I → ∞: the shaft keeps the rate it had."""
    p = dataclasses.replace(shaft, cam_inertia=1e12)
    motion = solve(laws["poly345"], p, TorsionalState(0.0, 0.0, 0.0, SPEED), 0.0, TURN / SPEED)
    assert np.abs(motion.sample(0.0, 1e-3, 150)[0]).max() < 1e-12


# Joints, restarts, samples, the periodic state.

REST = TorsionalState(0.0, 0.0, 0.0, SLOW)


@pytest.fixture(scope="module")
def damped(follower):
    """A soft damped, damped."""
    return TorsionalParameters(follower, 0.02, 8e3, 0.4)


def test_joints_are_met(laws, damped):
    """Windows end where the cam itself, not the flywheel, is at a joint; there s'' and θ̈_c step.

    (I + m s'²) Δθ̈_c = −m Δs'' θ̇_c² s': all else is continuous.
    """
    law, f = laws["tm21"], damped.follower
    motion = solve(law, damped, REST, 0.0, TURN / SLOW)
    inner = motion.path.edges[1:-1]
    at_joint = motion.at(inner)
    distance = np.abs(at_joint[2][:, None] - law.breaks).min(axis=1)
    met = distance < 1e-9
    assert distance[met].max() < 4e-15
    assert met.sum() >= law.spans.size - 1
    before, after = motion.at(inner - 1e-10), at_joint
    s1 = law(at_joint[2], 1)
    step = law(at_joint[2] + 1e-9, 2) - law(at_joint[2] - 1e-9, 2)
    expected = -f.mass * step * at_joint[3] ** 2 * s1 / (damped.cam_inertia + f.mass * s1**2)
    np.testing.assert_allclose(after[4] - before[4], expected, rtol=0, atol=1e-4)
    assert np.abs(expected).max() > 5.0


@pytest.mark.variants(3)
def test_rows_obey_the_equation(law, damped):
    """Rates are those of the values, and θ̈_c closes eq. 10 with the contact force."""
    motion = solve(law, damped, REST, 2.0, 0.2)
    times = np.linspace(2.001, 2.199, 333)
    twist, rate, angle, speed, acceleration = motion.at(times)
    h = 1e-6
    slope = (motion.at(times + h) - motion.at(times - h)) / (2.0 * h)
    np.testing.assert_allclose(slope[0], rate, rtol=0, atol=1e-7)
    np.testing.assert_allclose(slope[2], speed, rtol=0, atol=1e-7)
    torque = damped.shaft_stiffness * twist + damped.shaft_damping * rate
    torque += motion.contact_force(times) * law(angle, 1)
    np.testing.assert_allclose(damped.cam_inertia * acceleration, -torque, rtol=0, atol=1e-10)


def test_restart_leaves_no_trace(laws, damped):
    """Going on from the end of a motion is the same motion."""
    p = damped
    law, start = laws["poly345"], 1.25
    whole = solve(law, p, REST, start, 0.5)
    first = solve(law, p, REST, start, 0.2345)
    second = solve(law, p, first.end, first.stop_time, 0.5 - 0.2345)
    times = np.linspace(first.stop_time, start + 0.4999, 500)
    one, other = whole.at(times), second.at(times)
    for a, b in zip(one, other, strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=2e-12 * np.abs(a).max())


def test_times_in_any_order(laws, damped):
    """Shuffled times, single times and uniform samples give the same numbers."""
    motion = solve(laws["tm21"], damped, REST, 5.0, 0.3)
    rows = motion.sample(5.0, 1e-4, 3000)
    order = np.random.default_rng(1).permutation(3000)
    times = 5.0 + 1e-4 * np.arange(3000)
    np.testing.assert_array_equal(motion.at(times[order]), rows[:, order])
    np.testing.assert_allclose(motion.at(times[17])[:, 0], rows[:, 17], rtol=1e-13)
    assert motion.at(np.array([])).shape == (5, 0)
    assert motion.stop_time == pytest.approx(5.3)


@pytest.mark.variants(3)
@pytest.mark.parametrize("speed", [SLOW, -SLOW, 3.0])
def test_periodic_state_returns(law, damped, speed):
    """After one turn it is back, to 1e-11 of the peak twist, and where it is on the turn."""
    state = periodic_state(law, damped, speed, 0.4)
    motion = solve(law, damped, state, 0.0, TURN / abs(speed))
    peak = np.abs(motion.sample(0.0, 1e-3 * motion.stop_time, 1000)[0]).max()
    assert motion.end.twist == pytest.approx(state.twist, abs=1e-11 * peak)
    assert motion.end.twist_rate == pytest.approx(state.twist_rate, abs=1e-11 * peak * 632.0)
    assert motion.end.flywheel_angle == pytest.approx(0.4 + math.copysign(TURN, speed), abs=1e-13)


def test_periodic_state_is_what_remains(laws, damped):
    """From rest the damped damped comes to the periodic state."""
    motion = solve(laws["poly345"], damped, REST, 0.0, 20.0 * TURN / SLOW)
    state = periodic_state(laws["poly345"], damped, SLOW)
    assert motion.end.twist == pytest.approx(state.twist, abs=1e-13)
    assert motion.end.twist_rate == pytest.approx(state.twist_rate, abs=1e-10)


def test_resonance_has_no_periodic_state(laws, follower):
    """Undamped, with a whole number of periods in the turn, and a cam too flat to detune it."""
    base = laws["poly345"]
    p = TorsionalParameters(
        dataclasses.replace(follower, damping=0.0), 0.02, 0.02 * (5 * SLOW) ** 2
    )
    law = Law("flat", base.breaks, 1e-9 * base.ordinates)
    with pytest.raises(DynamicsError, match=r"no periodic state at .* Resonance needs damping"):
        periodic_state(law, p, SLOW)


def test_periodic_state_needs_a_fixed_speed(laws, damped):
    """A standing flywheel makes no turn."""
    with pytest.raises(DynamicsError, match=r"speed is 0.0; allowed"):
        periodic_state(laws["poly345"], damped, 0.0)


def test_a_stiff_shaft_turns_the_cam_like_the_drive(laws, paper_rig, follower):
    """With an almost rigid shaft the follower moves as in the kinetostatic model."""
    parameters = MODELS["torsional"].parameters(paper_rig)
    stiff = dataclasses.replace(
        parameters, follower=follower, shaft_stiffness=1e9, shaft_damping=1e3
    )
    interval = Interval(0, 200_000_000, 0.0, SLOW)
    law = laws["poly345"]
    one = MODELS["torsional"].advance(law, stiff, None, interval, 10_000)[1].rows
    other = MODELS["kinetostatic"].advance(law, follower, None, interval, 10_000)[1].rows
    np.testing.assert_allclose(one[1], other[1], atol=1e-8)
    np.testing.assert_allclose(one[4], other[4], atol=1e-2)


# Along ramps: θ_v = θ₀ + ω t + α t²/2, the law at the twisted angle.

FOLLOWER = FollowerParameters(1.3, 4030.0, 8.642, 12.753, 3.3e8)
#: Without a damper in the shaft, as the reference has it.
SHAFT = TorsionalParameters(FOLLOWER, 0.02, 5e3)
TWIST = Twist(0.02, 5e3, 1.3, 8.642, 4030.0, 12.753)


def reference(law, speed, ramp, times, turns):
    """Twist and rate from an untwisted shaft at angle 0, by Taylor's series of 45 digits."""
    case = Case("ramp", "", law, TWIST, speed, turns, turns, times)
    found = exact_twist.solve_twist(case, ramp)
    return found.displacement[0], found.velocity[0]


@pytest.mark.variants(3)
@pytest.mark.parametrize("name", ["poly345", "tm21"])
@pytest.mark.parametrize(
    ("speed", "ramp", "duration"), [(0.0, 60.0, 0.5), (20.0, 100.0, 0.3), (45.0, -120.0, 0.37)]
)
def test_a_ramp_against_forty_digits(laws, many_digits, name, speed, ramp, duration):
    """From rest, up and almost to rest, over a turn: to 1e-12 of the largest twist."""
    times = np.linspace(0.0, duration, 24)[1:]
    law = laws[name]
    inputs = (law.breaks, law.ordinates, speed, ramp, times, list(vars(TWIST).values()))
    twist, rate = many_digits(lambda: reference(law, speed, ramp, times, 2), inputs)
    start = TorsionalState(0.0, 0.0, 0.0, speed)
    got = solve(laws[name], SHAFT, start, 0.0, duration, ramp).at(times)
    assert np.abs(got[0] - twist).max() < 1e-12 * np.abs(twist).max()
    assert np.abs(got[1] - rate).max() < 1e-12 * np.abs(rate).max()
    flywheel = speed * times + 0.5 * ramp * times**2
    np.testing.assert_allclose(got[2], flywheel + twist, rtol=0, atol=1e-13)
    np.testing.assert_allclose(got[3], speed + ramp * times + rate, rtol=0, atol=1e-12)


def test_every_row_belongs_to_one_motion(laws):
    """Rate, speed and acceleration are the slopes of twist and angle, the ramp among them."""
    motion = solve(laws["poly345"], SHAFT, TorsionalState(1e-4, 0.0, 1.0, 5.0), 0.0, 0.2, 80.0)
    t, h = np.linspace(0.01, 0.19, 50), 1e-6
    before, here, after = (motion.at(t + k * h) for k in (-1, 0, 1))
    slope = (after - before) / (2.0 * h)
    for value, rate in ((0, 1), (2, 3), (3, 4)):
        size = np.abs(here[rate]).max()
        np.testing.assert_allclose(slope[value], here[rate], rtol=0, atol=1e-6 * size)
    np.testing.assert_allclose(here[3] - here[1], 5.0 + 80.0 * t, rtol=1e-13)
    end = motion.end
    assert end.flywheel_speed == pytest.approx(21.0, rel=1e-14)
    assert end.flywheel_angle == pytest.approx(1.0 + 1.0 + 1.6, rel=1e-14)


def test_a_disc_lags_by_the_torque_that_turns_it(make_cam):
    """On a dwell of a whole turn the cam hangs back by ψ = −I α/k_s and swings about that."""
    disc = build_law(make_cam({"law": "dwell", "span": 360}))
    p = SHAFT
    rest = -50.0 / (p.mobility * p.shaft_stiffness)
    times = np.linspace(0.0, 0.7, 60)
    got = solve(disc, p, TorsionalState(0.0, 0.0, 0.0, 0.0), 0.0, 0.7, 50.0).at(times)
    rate = math.sqrt(p.mobility * p.shaft_stiffness)
    exact = rest * (1.0 - np.cos(rate * times))
    np.testing.assert_allclose(got[0], exact, rtol=0, atol=1e-12 * abs(rest))
    held = solve(disc, p, TorsionalState(rest, 0.0, 0.0, 0.0), 0.0, 0.7, 50.0).at(times)
    np.testing.assert_allclose(held[0], rest, rtol=1e-12)


@pytest.mark.parametrize(("speed", "ramp"), [(0.0, 80.0), (32.0, -80.0)])
def test_the_length_of_a_tick_does_not_enter(laws, speed, ramp):
    """2 ms against 200 ms, from rest and down to rest: 1e-10 of the largest value of each row."""
    p = dataclasses.replace(SHAFT, shaft_damping=0.1)
    law, total = laws["poly345"], 400 * MS
    whole = Interval(0, total, 0.0, speed, ramp)
    rows, _, state = ticked(law, "torsional", p, whole, every(2 * MS, total), 24_000)
    coarse, _, end = ticked(law, "torsional", p, whole, every(200 * MS, total), 24_000)
    size = np.abs(coarse).max(axis=1)
    assert (np.abs(rows - coarse).max(axis=1)[:5] < 1e-10 * size[:5]).all()
    assert state.inner == pytest.approx(end.inner, rel=1e-10, abs=1e-14)


def test_a_ramp_is_not_run_at_its_first_speed(laws):
    """A block of an interval with an acceleration is that of the flywheel which has it."""
    interval = Interval(0, 300 * MS, 0.0, 10.0, 60.0)
    stiff = TorsionalParameters(FOLLOWER, 0.02, 1e9, 1e3)
    block = MODELS["torsional"].advance(laws["poly345"], stiff, None, interval, 10_000)[1]
    other = MODELS["kinetostatic"].advance(laws["poly345"], FOLLOWER, None, interval, 10_000)[1]
    np.testing.assert_allclose(block.rows[1], other.rows[1], rtol=0, atol=1e-8)
    np.testing.assert_allclose(block.rows[4], other.rows[4], rtol=0, atol=1e-2)
