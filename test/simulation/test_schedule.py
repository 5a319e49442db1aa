"""The drive's program: whole turns, ticks that meet, an angle that never jumps."""

from fractions import Fraction
from itertools import groupby, islice, pairwise

import numpy as np
import pytest

from cam_rig.simulation.schedule import CamState, cam_states, run_length, tick_count
from cam_rig.units import NS, TURN


@pytest.fixture(params=[1, 7, 64])
def scene(request, make_scene):
    return make_scene(ticks_per_turn=request.param, speeds=[200, 333, 400, 210])


def test_length_and_longest_tick_are_those_of_the_states(scene, ramped):
    """The last stamp, and to a nanosecond the longest of the gaps; along ramps as well."""
    for program in (scene, ramped):
        times = [state.time_ns for state in cam_states(program)]
        length, longest = run_length(program)
        assert length == times[-1]
        assert 0 <= longest - max(np.diff(times)) <= 1


def test_a_scene_of_any_length_begins_at_once(make_scene):
    """Its first states are those of a short one; a list of all of them would hold 1e7."""
    short = make_scene(ticks_per_turn=64, speeds=[333], turns=5)
    long = make_scene(ticks_per_turn=64, speeds=[333], turns=100_000)
    assert list(islice(cam_states(long), 320)) == list(islice(cam_states(short), 320))
    assert run_length(long)[0] == pytest.approx(2 * 100_000 * 60 / 333 * NS, rel=1e-12)


def test_each_step_is_whole_turns(scene):
    """Every cam turns three times at every speed; half a nanosecond of turning is 3e-8 rad."""
    states = list(cam_states(scene))
    steps = [states[0]]
    for before, after in pairwise(states):
        if (after.cam, after.speed) != (before.cam, before.speed):
            steps.append(after)
    assert len(steps) == 2 * 4 + 1
    turned = np.diff([state.unwrapped for state in steps]) / TURN
    np.testing.assert_allclose(turned, 3.0, rtol=0, atol=1e-8)


def test_the_angle_keeps_its_digits(make_scene):
    """θ of each state of a speed held for a thousand turns is ω t to the last digit, turns and all.

    One number for both would have lost three digits of it.
    """
    scene = make_scene(speeds=[300, 400], turns=1000)
    last = None
    for state in cam_states(scene):
        if last is None or state.speed != last.speed:
            last = state
        ahead = Fraction(last.speed) * (state.time_ns - last.time_ns) / NS
        turned = ahead + Fraction(last.angle) + last.turns * Fraction(TURN)
        away = Fraction(state.angle) + state.turns * Fraction(TURN) - turned
        assert 0.0 <= state.angle < TURN
        assert abs(float(away)) < 2e-15
        if state.speed == 0.0:
            break


def test_angle_is_continuous(scene):
    """θ at a state is where the state before it has turned to, over speeds and cams, unramped."""
    for before, after in pairwise(cam_states(scene)):
        interval = before.until(after)
        assert (interval.start_ns, interval.stop_ns) == (before.time_ns, after.time_ns)
        told = interval.angle, interval.speed, interval.acceleration
        assert told == (before.angle, before.speed, 0.0)
        reached = before.speed * (after.time_ns - before.time_ns) / NS
        assert after.since(before) == pytest.approx(reached, abs=1e-12)


def test_order_of_cams_and_speeds(scene):
    """Cam after cam, and for each the speeds in the order given; as many ticks as said."""
    states = list(cam_states(scene))
    assert len(states) == tick_count(scene) + 1 == 2 * 4 * 3 * scene.program.ticks_per_turn + 1
    assert states[0].time_ns == 0
    assert all(a.time_ns < b.time_ns for a, b in pairwise(states))
    assert (states[-1].speed, states[-1].cam) == (0.0, "bezier15")
    played = dict.fromkeys((state.cam, state.speed) for state in states if state.speed)
    rates = [float(speed) for speed in scene.program.speeds.si_list]
    assert list(played) == [(cam, speed) for cam in ("poly345", "bezier15") for speed in rates]


# Ramps


@pytest.fixture(params=[1, 5])
def ramped(request, make_scene):
    """Up, on, down and no change: from rest for each of two cams."""
    program = {
        "speeds": {"assumed": [200, 333, 100, 100], "unit": "rpm"},
        "turns": {"assumed": 2, "unit": "turns"},
        "settle_turns": {"assumed": 1, "unit": "turns"},
        "ticks_per_turn": request.param,
        "ramp": {"assumed": 0.7, "unit": "s"},
    }
    return make_scene(program=program)


def intervals(scene):
    return [before.until(after) for before, after in pairwise(cam_states(scene))]


def test_states_tell_ramps_from_held_speeds(ramped):
    """From angle and speed at both ends alone; a ramp takes its time, each cam starts at rest."""
    parts = intervals(ramped)
    assert len(parts) == tick_count(ramped)
    rates = [0.0, *(float(speed) for speed in ramped.program.speeds.si_list)]
    runs = [
        (rate, list(group)) for rate, group in groupby(parts, key=lambda part: part.acceleration)
    ]
    slopes = [(b - a) / 0.7 for a, b in pairwise(rates) if a != b]
    expected = [round(slope, 6) for up in slopes for slope in (up, 0.0)] * 2
    # a ramp's slope is found from each of its ticks, so they are put together by their rounding
    found = [round(rate, 6) for rate, _ in runs]
    assert [rate for rate, _ in groupby(found)] == expected
    ramps = sum(part.duration for part in parts if part.acceleration != 0.0)
    assert ramps == pytest.approx(2 * 3 * 0.7, rel=1e-12)


def test_angle_and_speed_go_on_over_ramps(ramped):
    """No jump of the angle anywhere, and none of the speed but where a cam is put on."""
    states = list(cam_states(ramped))
    assert states[0].speed == 0.0
    for part, (before, after) in zip(intervals(ramped), pairwise(states), strict=True):
        assert part.unwrapped_at(part.duration) == pytest.approx(after.unwrapped, abs=1e-11)
        if after.cam == before.cam and after is not states[-1]:
            assert part.speed_at(part.duration) == pytest.approx(after.speed, rel=1e-9)


def test_ticks_of_a_ramp_are_no_longer_than_of_its_faster_end(ramped):
    """So a bag's blocks are not larger along a ramp."""
    turn = TURN / ramped.program.ticks_per_turn
    for part in intervals(ramped):
        if part.acceleration != 0.0:
            fastest = max(part.speed, part.speed_at(part.duration))
            assert part.duration * fastest <= turn * (1.0 + 1e-6) or part.mean_speed < 1.0
    assert max(part.mean_speed * part.duration for part in intervals(ramped)) <= turn * 1.000001


@pytest.mark.parametrize(
    ("first", "second", "turned", "acceleration"),
    [
        (10.0, 20.0, 15.0, 10.0),  # turned at the mean: a ramp
        (10.0, 20.0, 10.0, 0.0),  # turned at the first speed: a step at the end
        (0.0, 20.0, 10.0, 20.0),  # from rest
        (20.0, 0.0, 10.0, -20.0),  # down to rest
        (20.0, 0.0, 20.0, 0.0),  # held, and stands from there on
        (20.0, 20.0, 20.0, 0.0),
    ],
)
def test_what_two_states_tell(first, second, turned, acceleration):
    """A ramp is inferred from the angle turned, nothing else is sent."""
    one = CamState(0, 3.0, first, "poly345")
    part = one.until(CamState(NS, 3.0 + turned, second, "poly345"))
    assert part.acceleration == acceleration
