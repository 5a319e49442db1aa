"""Tests of speed ramps: every model is exact, for every duration of the ticks.

A tick is one of the time intervals into which a run is divided.
"""

import math

import mpmath as mp
import numpy as np
import pytest

from cam_rig.dynamics import Interval
from cam_rig.dynamics.speed_ramp import substitute
from cam_rig.dynamics.torsional.model import TorsionalParameters
from cam_rig.laws.bernstein import evaluate
from cam_rig.units import TURN

from .helpers import CALM, MS, ONE, assert_same, exact_law, run_in_ticks

SHAFT = TorsionalParameters(ONE, 0.02, 5e3, 0.1)


def exact_motion(law, interval, time):
    """Return lift, velocity and acceleration at a time (s), in mpmath precision."""
    t, w, a = mp.mpf(time), mp.mpf(interval.speed), mp.mpf(interval.acceleration)
    speed = w + a * t
    s, slope, curvature = exact_law(law, mp.mpf(interval.angle) + w * t + a * t**2 / 2)
    return s, slope * speed, curvature * speed**2 + slope * a


RAMPS = {
    "from rest": Interval(0, 200 * MS, 0.0, 0.0, 200.0),
    "up": Interval(0, 200 * MS, 1.3, 10.0, 150.0),
    "down": Interval(0, 200 * MS, 100.0, 45.0, -100.0),
    "down to rest": Interval(0, 200 * MS, 2.0, 40.0, -200.0),
    "many turns": Interval(0, 200 * MS, 0.5, 55.0, 150.0),
}


@pytest.fixture(params=RAMPS, ids=list(RAMPS))
def ramp(request):
    """Speed ramp of each kind: from rest, up, down, to rest, and over many turns.

    The fixture runs each test with all of them.
    """
    return RAMPS[request.param]


@pytest.mark.variants(5)
@pytest.mark.parametrize("name", ["poly345", "bezier15", "tm21"])
def test_kinetostatic_rows_against_forty_digits(laws, ramp, name):
    """The kinetostatic samples on a ramp agree with 40-digit arithmetic.

    They are s(θ(t)), ṡ = s' ω, s̈ = s'' ω² + s' α and the contact force. The tolerance is 1e-12 of
    the largest value of each quantity.
    """
    law = laws[name]
    rows, _, state = run_in_ticks(law, "kinetostatic", ONE, ramp, [0, ramp.stop_ns], rate=97)
    with mp.workdps(40):
        times = [*rows[0].tolist(), ramp.duration]
        exact = np.array([[float(x) for x in exact_motion(law, ramp, t)] for t in times]).T
    exact, end = exact[:, :-1], exact[:, -1]
    for row, expected in zip(rows[1:4], exact, strict=True):
        np.testing.assert_allclose(row, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    force = np.array([4030.0, 8.642, 1.3]) @ exact + 12.753
    np.testing.assert_allclose(rows[4], force, rtol=0, atol=1e-12 * np.abs(force).max())
    size = np.abs(exact).max(axis=1)
    assert state.displacement == pytest.approx(end[0], abs=1e-13 * size[0])
    assert state.velocity == pytest.approx(end[1], abs=1e-12 * size[1])
    last = np.array([4030.0, 8.642, 1.3]) @ end + 12.753
    assert state.contact_force == pytest.approx(last, abs=1e-12 * np.abs(force).max())


def test_substitute_law_is_as_smooth_as_the_law(laws):
    """`substitute` returns the lift on a speed ramp as a law of time.

    It has the continuity of the original law, and the same lift to 1e-15 m.
    """
    interval = RAMPS["up"]
    law, steady = substitute(laws["poly4567"], interval)
    assert (steady.angle, steady.acceleration) == (0.0, 0.0)
    assert steady.speed * steady.duration == pytest.approx(law.breaks[-2], rel=1e-14)
    assert law.breaks[-2] == pytest.approx(interval.mean_speed * interval.duration, rel=1e-14)
    assert not law.repeats
    motion = law.motion
    for order, size in enumerate(np.abs(motion).max(axis=(1, 2))):
        ends, starts = motion[order, -1, :-2], motion[order, 0, 1:-1]
        np.testing.assert_allclose(ends, starts, rtol=0, atol=1e-12 * size)
    middle = float(evaluate(motion[0, :, 0], np.array([0.5]))[0])
    time = 0.5 * law.breaks[1] / steady.speed
    assert middle == pytest.approx(laws["poly4567"].at(interval.angle_at(time))[0], abs=1e-15)


@pytest.mark.variants(5)
@pytest.mark.parametrize(
    ("model", "p"),
    [
        *((model, ONE) for model in ("kinetostatic", "one_mass", "elastic_stem")),
        *(("two_mass", CALM), ("torsional", SHAFT)),
    ],
)
def test_the_duration_of_ticks_does_not_matter(laws, ramp, model, p):
    """Ticks of 1 ms and 200 ms give the same samples on a ramp, and the same events.

    The relative tolerance is 1e-10. A tick is a time interval that is simulated in one call.
    """
    law, stop = laws["poly345"], ramp.stop_ns
    fine = run_in_ticks(law, model, p, ramp, range(0, stop + 1, MS))
    coarse = run_in_ticks(law, model, p, ramp, [0, stop])
    assert_same(fine, coarse, 1e-10)
    for event in fine[1]:
        angle = ramp.angle_at(event.time)
        assert event.angle == pytest.approx(angle, abs=1e-12 * (1.0 + event.angle))
    if ramp is RAMPS["many turns"] and model in ("one_mass", "two_mass"):  # with flights
        assert sum(event.kind == "landing" for event in coarse[1]) >= 2
        assert coarse[1][-1].angle > TURN


@pytest.mark.parametrize("model", ["kinetostatic", "one_mass", "elastic_stem", "two_mass"])
def test_a_very_slow_ramp_equals_constant_speed(laws, model):
    """A speed ramp with an acceleration near zero gives the motion at constant speed."""
    p = CALM if model == "two_mass" else ONE
    law, speed = laws["poly345"], 30.0
    constant = run_in_ticks(law, model, p, Interval(0, 250 * MS, 0.4, speed), [0, 250 * MS])[0]
    slow = run_in_ticks(law, model, p, Interval(0, 250 * MS, 0.4, speed, 1e-10), [0, 250 * MS])[0]
    size = np.abs(constant[1:5]).max(axis=1, keepdims=True)
    assert (np.abs(slow - constant)[1:5] < 1e-10 * size).all()


# -- a law with velocity jumps on a ramp

#: Jump of the slope s' (m/rad) at the ends of rise and fall of the cam `edge`.
STEP = 0.05 / np.radians(90.0)
#: Ramp from rest that reaches 60° after 0.1 s.
START = Interval(0, 340 * MS, 0.0, 0.0, 2.0 * math.pi / 3.0 / 0.01)


@pytest.mark.variants(4)
@pytest.mark.parametrize(("model", "p", "mass"), [("one_mass", ONE, 1.3), ("two_mass", CALM, 0.4)])
@pytest.mark.parametrize("cuts", [[340], [99, 100, 101, 340], [100, 340], [50, 150, 340]])
def test_an_impact_on_a_ramp(edge, model, p, mass, cuts):
    """The impulse at a velocity jump of the cam on a ramp is m ω(t) Δs'.

    It occurs at the time at which the ramp reaches the joint (tolerance 1e-14 s), with the speed
    there.
    """
    events = run_in_ticks(edge, model, p, START, [0, *(cut * MS for cut in cuts)])[1]
    first = events[0]
    assert first.kind == "landing"
    assert first.time == pytest.approx(0.1, abs=1e-14)
    assert first.angle == pytest.approx(math.pi / 3.0, abs=1e-13)
    assert first.impulse == pytest.approx(mass * START.speed_at(0.1) * STEP, rel=1e-12)
    top = next(e for e in events if e.angle > math.radians(150.0) - 1e-9)
    assert top.kind == "lift-off"
    assert top.time == pytest.approx(0.1 * math.sqrt(2.5), abs=1e-13)
