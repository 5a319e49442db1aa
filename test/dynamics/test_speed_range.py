"""From 0.01 rpm to 1e5 rpm: ten million to one in speed, every model against 50 digits."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from benchmark.speed import exact
from benchmark.speed import exact as exact_twist
from benchmark.speed import study as rig
from benchmark.speed.models import CONTACT, Case, OneMass, Oscillator, Twist, TwoMasses
from cam_rig.dynamics import MODELS, FollowerParameters, Interval
from cam_rig.dynamics.torsional.motion import solve
from cam_rig.dynamics.torsional.parameters import TorsionalParameters, TorsionalState
from cam_rig.laws import Law, bernstein
from cam_rig.units import TURN

SPEEDS = [0.01, 1.0, 400.0, 1e4, 1e5]
MASS, SPRING, DAMPING, PRELOAD = 1.3, 4030.0, 8.642, 30.6


@pytest.fixture(autouse=True)
def digits(monkeypatch):
    """The reference goes by powers of time; over a fast turn of degree 25 that costs 60 digits."""
    monkeypatch.setattr(exact, "DIGITS", 140)


@dataclass(frozen=True)
class Riding(TwoMasses):
    """Two masses that cannot leave the cam: at a crawl they do not, and nobody has to look."""

    def phases(self):
        return {CONTACT: replace(super().phases()[CONTACT], guard=None, on_cam=False)}


def turn(law, model, rpm, last=1.0, count=23):
    """Output times on ``last`` of a turn."""
    speed = rpm * np.pi / 30.0
    times = (np.arange(count) + 0.5) / count * last * TURN / speed
    return Case("range", "range", law, model, speed, 1, 1, times)


def largest_errors(case, wanted):
    """Errors of lift (in lifts) and of velocity (in ω lifts or its own peak, the larger)."""
    got, lift = rig.solve(case), case.law.lift
    x = np.abs(got.displacement - wanted.displacement).max() / lift
    v = np.abs(got.velocity - wanted.velocity).max()
    return float(x), float(v / max(case.speed * lift, np.abs(wanted.velocity).max()))


@pytest.mark.parametrize("rpm", SPEEDS)
@pytest.mark.parametrize("cam", ["poly345", "tm21"])
def test_residual(laws, cam, rpm):
    """Quasi-static at one end, a follower that hardly moves at the other: 1e-12 of the lift.

    The slowest turn holds 1e7 periods of the stem, the fastest a hundredth of one.
    """
    case = turn(laws[cam], Oscillator(MASS, DAMPING, SPRING, 1.26e6), rpm)
    x, v = largest_errors(case, exact.solve(case))
    assert x < 1e-12
    assert v < 1e-12


@pytest.mark.parametrize("rpm", SPEEDS)
@pytest.mark.parametrize("cam", ["poly345", "tm21"])
def test_kinetostatic_force(laws, follower, cam, rpm):
    """F = m ω² s'' + c ω s' + k s + P: between spring and inertia lie fourteen orders."""
    law, p, speed = laws[cam], follower, rpm * np.pi / 30.0
    stop = round(0.9 * TURN / speed * 1e9)
    rate = max(1, round(200 * speed / TURN))
    rows = MODELS["kinetostatic"].advance(law, p, None, Interval(0, stop, 0.0, speed), rate)[1].rows
    s, v, a = (law(speed * rows[0], order) * speed**order for order in range(3))
    force = p.mass * a + p.damping * v + p.spring_stiffness * s + p.preload
    for got, wanted in zip(rows[1:5], (s, v, a, force), strict=True):
        np.testing.assert_allclose(got, wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())
    assert rows.shape[1] > 5


@pytest.mark.parametrize("rpm", SPEEDS)
@pytest.mark.parametrize("cam", ["poly345", "tm21"])
def test_one_mass(laws, cam, rpm):
    """Rides below the jump speed, and far above is thrown off once and hardly comes back.

    Positions to 1e-12 of the largest, events to 1e-12 of a turn.
    """
    model = OneMass(MASS, DAMPING, SPRING, PRELOAD, 0.0, 1e-12 * laws[cam].lift)
    case = turn(laws[cam], model, rpm)
    got, wanted = rig.solve(case), exact.solve(case)
    assert got.error(wanted) < 1e-12
    assert [kind for kind, _ in got.events] == [kind for kind, _ in wanted.events]
    if rpm >= 1e4:
        assert got.events
        assert got.event_error(wanted) < 1e-12 * TURN / case.speed


@pytest.mark.variants(6)
@pytest.mark.parametrize("rpm", SPEEDS)
@pytest.mark.parametrize("cam", ["poly345", "tm21"])
def test_separation(laws, cam, rpm):
    """Two masses on a stem of 1e5 N/m: 1e-12 of the largest, events to 1e-11 of a turn."""
    kind = Riding if rpm <= 1.0 else TwoMasses
    numbers = 0.4 * MASS, 0.6 * MASS, 1e5, SPRING, DAMPING, DAMPING, PRELOAD
    wanted = exact.solve(turn(laws[cam], kind(*numbers), rpm))
    got = rig.solve(turn(laws[cam], TwoMasses(*numbers), rpm))
    assert got.error(wanted) < 1e-12
    assert [name for name, _ in got.events] == [name for name, _ in wanted.events]
    if rpm >= 1e4:
        assert got.events
        assert got.event_error(wanted) < 1e-11 * 60.0 / rpm


@pytest.mark.parametrize("rpm", SPEEDS)
def test_torsional(laws, many_digits, rpm, monkeypatch):
    """The cam is started in the middle of its rise, so that the shaft swings at any speed.

    At a crawl over a few periods of the shaft, else over a turn; 1e-11 of the peak twist. The
    lift shrinks with the speed: no shaft carries 50 mm at 1e5 rpm. The reference's steps are
    1/200 turn at most, or its series does not end.
    """
    period = TURN / np.sqrt(1e4 / 0.02)
    monkeypatch.setattr(exact_twist, "STEPS", max(5, int(200 * period * rpm / 60.0)))
    law = _turned(laws["poly345"], np.radians(90.0), min(1.0, 400.0 / rpm))
    case = turn(law, Twist(0.02, 1e4, MASS, DAMPING, SPRING, PRELOAD), rpm)
    last = min(float(case.times[-1]), 0.05)
    case = replace(case, times=case.times / case.times[-1] * last)
    follower = FollowerParameters(MASS, SPRING, DAMPING, PRELOAD, 3.3e8)
    start = TorsionalState(0.0, 0.0, 0.0, case.speed)
    motion = solve(law, TorsionalParameters(follower, 0.02, 1e4), start, 0.0, last)
    wanted = many_digits.solution(case, exact_twist.solve_twist)
    for row, exact_row in zip(
        motion.at(case.times)[:2], (wanted.displacement[0], wanted.velocity[0]), strict=True
    ):
        np.testing.assert_allclose(row, exact_row, rtol=0, atol=1e-11 * np.abs(exact_row).max())


def _turned(law, angle, factor):
    """The same cam with its zero moved on by ``angle`` (rad), its lift made smaller."""
    i = int(np.searchsorted(law.breaks, angle)) - 1
    u = (angle - law.breaks[i]) / law.spans[i]
    left, right = bernstein.split(law.ordinates[:, i], u)
    columns = [right, *law.ordinates.T[i + 1 :], *law.ordinates.T[:i], left]
    edges = [angle, *law.breaks[i + 1 :], *(law.breaks[1 : i + 1] + TURN), angle + TURN]
    breaks = np.array(edges) - angle
    breaks[-1] = TURN
    return Law("turned", breaks, factor * np.stack(columns, axis=1))
