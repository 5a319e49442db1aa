"""Tests of sound levels, their regressions over speed, and crossings.

The levels are those of simulated ticks, the intervals between two cam states.
"""

import numpy as np
import pytest

from cam_rig.acoustics import level_db
from cam_rig.errors import CamRigError
from cam_rig.schema import PublishedNoise
from cam_rig.simulation import regression
from cam_rig.simulation.regression import compare, crossings, nearest_crossing, real_roots
from cam_rig.simulation.schedule import CamState
from cam_rig.simulation.simulate import MeasuredTick, require_ticks, step_levels
from cam_rig.units import NS

RPM = np.arange(200.0, 401.0, 10.0)
ONE = np.array([25.93808, 0.57355, -0.002045, 2.483e-6])
TWO = np.array([0.41488, 0.84929, -0.0033286, 4.537e-6])


def ticks(pressures, speed=10.0, cam="a", angle=1.0, time_ns=0):
    """Yield one tick per turn, with the given sound pressures (Pa).

    A tick is the interval between two cam states. `speed` is in rad/s, `angle` and `time_ns` are
    those of the first state.
    """
    turn_ns = round(2.0 * np.pi / speed * NS)
    for i, pressure in enumerate(pressures):
        start = CamState(time_ns + i * turn_ns, angle + 2.0 * np.pi * i, speed, cam)
        yield MeasuredTick(start, start.time_ns + turn_ns, pressure, samples=100)


def steps_of(coefficients):
    return {
        float(rpm * np.pi / 30.0): float(np.polynomial.polynomial.polyval(rpm, coefficients))
        for rpm in RPM
    }


@pytest.fixture
def published():
    """Published levels of two cams, "one" and "two", as cubics of the speed.

    The curves cross at 335 rpm.
    """
    return PublishedNoise(
        name="p",
        source="made",
        range_rpm=(200.0, 400.0),
        regression_db={"one": list(ONE), "two": list(TWO)},
        crossover={"between": ("one", "two"), "rpm": 335.0},
    )


def test_the_first_turns_of_each_step_are_left_out():
    """The first turns after each change of cam or speed are excluded from the level."""
    run = [
        *ticks([9.0, 1.0]),
        *ticks([9.0, 2.0], speed=20.0, angle=99.0, time_ns=10 * NS),
        *ticks([9.0, 3.0], speed=20.0, cam="b", angle=200.0, time_ns=20 * NS),
    ]
    levels = step_levels(run, transient_turns=1)
    assert levels["a"][10.0] == pytest.approx(float(level_db(1.0)))
    assert levels["a"][20.0] == pytest.approx(float(level_db(2.0)))
    assert levels["b"][20.0] == pytest.approx(float(level_db(3.0)))


def test_the_level_is_the_energy_mean_over_all_samples():
    """The level of a speed is the energy mean of its ticks, weighted by their samples.

    A tick is the interval between two cam states.
    """
    state = CamState(0, 0.0, 10.0, "a")
    run = [
        MeasuredTick(state, 2 * NS, 3.0, samples=1),
        MeasuredTick(CamState(2 * NS, 20.0, 10.0, "a"), 4 * NS, 1.0, samples=3),
    ]
    level = step_levels(run, transient_turns=0)["a"][10.0]
    assert level == pytest.approx(float(level_db(np.sqrt((9.0 + 3.0) / 4.0))), abs=1e-12)


@pytest.mark.parametrize("left_out", range(1, 8))
def test_an_incomplete_turn_does_not_count(left_out):
    """If the run at a speed ends within a turn, the level is that of its whole turns.

    After a lost tick (interval between two cam states) a new turn starts.
    """
    eighth = round(0.25 * np.pi / 10.0 * NS)
    run = [
        MeasuredTick(
            CamState(k * eighth, 0.25 * np.pi * k, 10.0, "a"), (k + 1) * eighth, 1.0 + k % 8, 10
        )
        for k in range(32 - left_out)
    ]
    levels = step_levels(run, transient_turns=1)
    assert levels == step_levels(run[:24], transient_turns=1)
    assert levels["a"][10.0] == pytest.approx(float(level_db(np.sqrt(25.5))))
    assert not step_levels(run[:15], transient_turns=1)
    gap = step_levels(run[:12] + run[13:], transient_turns=1)  # a turn starts after the loss
    assert gap["a"][10.0] == pytest.approx(levels["a"][10.0])


@pytest.mark.parametrize("stop_ns", [0, NS])
@pytest.mark.parametrize("speed", [1.05e-3, 10.0, 209.0])
def test_a_stop_of_the_cam_starts_a_new_step(speed, stop_ns):
    """After a stop of the cam the first turns are excluded from the level again.

    Follower and structure start from rest then. Without a stop they are included.
    """
    run = list(ticks([9.0, 1.0, 1.0], speed))
    end = run[-1]
    angle = end.start.unwrapped + 2.0 * np.pi
    again = ticks([9.0, 1.0], speed, angle=angle, time_ns=end.stop_ns + stop_ns)
    level = step_levels([*run, *again], transient_turns=1)["a"][speed]
    quiet = float(level_db(1.0))
    assert (level == pytest.approx(quiet)) == bool(stop_ns)


def test_crossover_of_two_cubics(published):
    """The crossing of two cams is the speed at which their level cubics are equal.

    It is the root nearest to the published crossing at 335 rpm.
    """
    result = compare(
        {"one": steps_of(ONE), "two": steps_of(TWO)}, {"one": "x", "two": "y"}, published
    )
    roots = np.polynomial.polynomial.polyroots(ONE - TWO)
    expected = min(roots.real, key=lambda rpm: abs(rpm - 335.0))
    assert result.crossover_rpm == pytest.approx(expected, abs=1e-6)
    assert result.crossover_rpm == pytest.approx(335.0, abs=1.0)
    assert [result.curves[cam].role for cam in ("one", "two")] == ["x", "y"]


def test_the_crossover_is_none_without_both_cams(published):
    """The crossing is None without both cams or published curves.

    It is also None without a root in the speed range.
    """
    apart = {"one": steps_of(ONE), "two": steps_of(ONE + np.array([10.0, 0.0, 0.0, 0.0]))}
    assert compare(apart, {"one": "", "two": ""}, published).crossover_rpm is None
    assert compare({"one": steps_of(ONE)}, {"one": ""}, published).crossover_rpm is None
    both = {"one": steps_of(ONE), "two": steps_of(TWO)}
    assert compare(both, {"one": "", "two": ""}, None).crossover_rpm is None


def test_rms_difference_to_the_published_curve(published):
    """A curve 1.5 dB above the published curve has an r.m.s. difference of 1.5 dB.

    Speeds outside of the published range do not count. The difference of a cam without a published
    curve is None.
    """
    steps = {speed: level + 1.5 for speed, level in steps_of(ONE).items()}
    steps[500.0 * np.pi / 30.0] = 0.0
    levels = {"one": steps, "other": steps_of(ONE)}
    result = compare(levels, {"one": "", "other": ""}, published)
    assert result.curves["one"].rmse_db == pytest.approx(1.5, abs=1e-9)
    assert result.curves["other"].rmse_db is None


def test_a_run_without_settled_turns_is_an_error():
    """A run without a turn after the excluded first turns raises CamRigError.

    It has no sound level.
    """
    with pytest.raises(CamRigError, match="here: no whole settled turn"):
        require_ticks(step_levels(ticks([1.0, 1.0]), transient_turns=5), "here")


def test_regression_recovers_a_cubic():
    """The regression of levels over speed returns the coefficients of a known cubic.

    They agree to 1e-9 of each term at 400 rpm.
    """
    # The higher coefficients of a constant are zero, not missing. Three points give NaN.
    level = np.polynomial.polynomial.polyval(RPM, ONE)
    scale = 400.0 ** np.arange(4)
    np.testing.assert_allclose(regression.regression(RPM, level) * scale, ONE * scale, rtol=1e-9)
    flat = regression.regression(RPM, np.full(RPM.size, 80.0))
    np.testing.assert_allclose(flat, [80.0, 0.0, 0.0, 0.0], rtol=0, atol=1e-10)
    few = regression.regression(RPM[:3], np.array([70.0, 71.0, 72.0]))
    assert few.shape == (4,) and np.isnan(few).all()


def test_leading_coefficients_of_rounding_add_no_root():
    """A cubic that was fitted to a straight line has only the root of the line.

    Its leading coefficients are rounding errors.
    """
    assert real_roots(np.array([-1.0, 1.25, 3e-17, -2e-17])) == pytest.approx([0.8], abs=1e-12)
    assert real_roots(np.array([2.0, 0.0, 1.0, 1e-16])).size == 0


def test_crossings_are_sorted_roots_within_the_speeds():
    """`crossings` returns the speeds at which two regressions are equal, sorted.

    Only speeds within the range are returned. `nearest_crossing` returns the one nearest to a
    speed.
    """
    difference = np.polynomial.Polynomial.fromroots([0.7, 1.1, 1.9]).coef
    speeds = crossings(difference, (200.0, 400.0), scale=300.0)
    assert speeds == pytest.approx([210.0, 330.0])
    assert nearest_crossing(difference, (200.0, 400.0), 250.0, scale=300.0) == pytest.approx(210.0)
    assert crossings(difference, (340.0, 400.0), scale=300.0).size == 0
