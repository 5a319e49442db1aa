"""Tests of steady segments of encoder readings, and of computed periodic turns.

A steady segment is a time with constant speed. A periodic turn is a motion that repeats each turn.
"""

from dataclasses import replace

import numpy as np
import pytest

from benchmark.simulated_instruments import InstrumentErrors, measured_run
from cam_rig.dynamics import MODELS, Interval, TwoMassParameters
from cam_rig.dynamics.events.trajectory import EndlessEventsError
from cam_rig.dynamics.one_mass import OneMassTrajectory
from cam_rig.errors import ConfigError
from cam_rig.simulation.instruments import MeasuredRun, Signal
from cam_rig.studies.fit_rig.parameters import build_follower
from cam_rig.studies.fit_rig.run.likelihood import NO_TURN_RESIDUAL, Likelihood
from cam_rig.studies.fit_rig.run.search import Candidate, search
from cam_rig.studies.fit_rig.run.steady_turn import one_mass_turn, sensor_response, two_mass_turn
from cam_rig.studies.fit_rig.run.stem_start import MAX_POINTS, POINTS_PER_PERIOD, PressingSamples
from cam_rig.studies.fit_rig.run.turns import find_steady_segments, measured_segments
from cam_rig.units import NS, RPM, TURN

from .machines import numbers_of


def speed_profile_run(random, rate, counts, ramp):
    """Return encoder readings of a cam at four random speeds, 3 to 12 turns each.

    A ramp of `ramp` s joins them. `rate` is the readings per second, and `counts` those per turn (0
    for an ideal encoder). The other results are the speeds (rad/s) and the times (s) at which a
    speed starts or stops.
    """
    speeds = np.repeat(random.uniform(100.0, 600.0, 4) * RPM, 2)
    lengths = random.uniform(3.0, 12.0, 4) * TURN / speeds[::2]
    steps = np.append(np.stack([lengths, np.full(4, ramp)], axis=1).ravel()[:-1], 0.0)
    corners = np.append(0.0, np.cumsum(steps[:-1]))
    at = np.cumsum(steps[:-1] * (speeds[:-1] + speeds[1:]) / 2.0)
    time = np.arange(0.0, corners[-1], 1.0 / rate)
    part = np.searchsorted(corners, time, side="right") - 1
    since, bend = time - corners[part], np.diff(speeds) / np.maximum(steps[:-1], 1e-9)
    angle = np.append(random.uniform(0.0, TURN) + np.append(0.0, at[:-1]), 0.0)[part]
    angle = angle + speeds[part] * since + 0.5 * np.append(bend, 0.0)[part] * since**2
    if counts:
        angle = np.floor(angle * counts / TURN) * TURN / counts
    return MeasuredRun("own", "cam", Signal(time, angle, "encoder")), speeds[::2], corners


@pytest.mark.parametrize("rate", [1000, 2000, 4000])
@pytest.mark.parametrize("counts", [1024, 2048, 4096, 0])
@pytest.mark.parametrize("ramp", [0.0, 0.05, 0.3])
@pytest.mark.variants(3)
def test_no_speed_is_lost_at_a_corner(ramp, counts, rate):
    """Two constant speeds that follow each other with a short ramp are both found.

    They agree within 0.3 % and 4 standard errors. The segments of constant speed end within a tenth
    of the shortest one from the true times.
    """
    random = np.random.default_rng(7)
    for _ in range(3):
        run, speeds, corners = speed_profile_run(random, rate, counts, ramp)
        segments = find_steady_segments(run)
        assert [segment.rpm for segment in segments] == pytest.approx(speeds / RPM, rel=3e-3)
        ends = [segment.end for segment in segments]
        assert all(segment.begin >= end for segment, end in zip(segments[1:], ends, strict=False))
        length = corners[1::2] - corners[::2]
        assert np.array(ends) == pytest.approx(corners[1::2], abs=0.1 * length.min())
        if counts:
            off = [(h.speed - w) / h.speed_error for h, w in zip(segments, speeds, strict=True)]
            assert np.abs(off).max() < 4.0


def test_a_speed_that_is_left_out_is_reported(law, rig):
    """A note reports each speed of a measured run that is excluded, with the reason.

    The reasons are too few samples, and a lift that differs from turn to turn.
    """
    run = measured_run(law, rig, "kinetostatic", (200.0, 250.0, 300.0), InstrumentErrors(rate=400))
    first, second, _ = (segment for segment in find_steady_segments(run))
    time, lift = run.lift.time, run.lift.value.copy()
    inside = (time > second.begin) & (time < second.end)
    lift[inside] += 0.1 * law.lift * np.random.default_rng(0).standard_normal(inside.sum())
    kept = time > first.end - 0.02
    run = replace(run, lift=Signal(time[kept], lift[kept], "lift"), force=None)
    read, segments = measured_segments(run)
    assert [round(segment.line.rpm) for segment in segments] == [300]
    assert read.notes == (
        "left out: 200 rpm (fewer than 20 samples)",
        "left out: 250 rpm (the lift differs from turn to turn)",
    )


def test_a_cam_that_nowhere_turns_steadily_is_refused():
    """A measured run that is a single speed ramp is refused.

    No speed of it is steady.
    """
    time = np.linspace(0.0, 3.0, 3000)
    run = MeasuredRun("ramp", "cam", Signal(time, 40.0 * time**2, "encoder"))
    with pytest.raises(ConfigError, match=r"must turn at a steady speed.*record"):
        find_steady_segments(run)


def test_the_errors_of_a_line_are_those_of_an_encoder_s_steps():
    """Fitted speed and angle of a steady segment are within 4 standard errors.

    A steady segment is a time with constant speed. If a reading interval is nearly a fraction k/n
    of an encoder count, the rounding errors are not independent. With the scatter of independent
    readings, one speed in twenty was more than 4 standard errors off. Half a count is the mean lag
    of the angle, not an error.
    """
    random, count = np.random.default_rng(1), 2.0 * np.pi / 1024
    off = []
    for strands in [2, 3] * 30:
        part = random.integers(5, 16) + random.integers(1, strands) / strands
        speed = 500.0 * count * (part + random.uniform(-0.02, 0.02))
        time = np.arange(0.0, 4.0 * 2.0 * np.pi / speed, 1.0 / 500.0)
        start = random.uniform(0.0, 2.0 * np.pi)
        angle = np.floor((start + speed * time) / count) * count
        (segment,) = find_steady_segments(
            MeasuredRun("steps", "cam", Signal(time, angle, "encoder"))
        )
        middle = segment.angle + segment.speed * (segment.middle - segment.begin) + 0.5 * count
        missed = middle - start - speed * segment.middle
        off.append(((segment.speed - speed) / segment.speed_error, missed / segment.angle_error))
    assert np.abs(off).max() < 4.0
    assert np.std(off, axis=0).min() > 0.3


SETTLE = 80


def force_off(law, model, parameters, speed, turn, rate=5000):
    """Return the force errors of a computed periodic turn, relative to the peak force.

    The reference is the last of many simulated turns from rest. The lifts must agree within 1e-9 m.
    `rate` is the sample rate in Hz.
    """
    begin = round(SETTLE * TURN / speed * NS)
    first = Interval(0, begin, 0.0, speed)
    state, _ = MODELS[model].advance(law, parameters, None, first, rate)
    at = first.angle_at(first.duration)
    last = Interval(begin, begin + round(TURN / speed * NS), at, speed)
    _, block = MODELS[model].advance(law, parameters, state, last, rate)
    lift, force = turn.evaluate(at + speed * (block.time - begin / NS))
    assert np.abs(lift - block.lift).max() < 1e-9
    return np.abs(force - block.force) / block.force.max()


@pytest.mark.parametrize("rpm", [200.0, 430.0, 470.0])
@pytest.mark.parametrize("restitution", [0.0, 0.3])
def test_one_mass(law, rig, rpm, restitution):
    """The computed periodic turn of one mass equals a simulation, with bounces too."""
    parameters = MODELS["one_mass"].parameters(rig.with_follower(restitution=restitution))
    turn = one_mass_turn(law, parameters, rpm * RPM)
    away = force_off(law, "one_mass", parameters, rpm * RPM, turn)
    assert (away > 1e-4).sum() <= 2  # samples next to a landing


@pytest.mark.parametrize("rpm", [250.0, 420.0])
def test_two_masses(law, two_mass, rpm):
    """The computed periodic turn of two masses equals the last of many turns.

    The simulation starts from rest.
    """
    turn = two_mass_turn(law, two_mass, rpm * RPM)
    assert bool(turn.events) == (rpm > 400.0)
    assert np.median(force_off(law, "two_mass", two_mass, rpm * RPM, turn)) < 1e-6


def test_a_stem_with_excessive_damping_has_no_turn(laws):
    """A stem with excessive damping has no computed periodic turn: None is returned.

    Its flight starts so slowly that steps of 1e-12 s once took an hour.
    """
    parameters = TwoMassParameters(0.0156, 0.839, 1.06, 4511.0, 9.69e8, 7.1, 30.0, 0.0)
    assert two_mass_turn(laws["bezier15"], parameters, 18.2) is None


def test_a_turn_is_found_from_its_neighbour(law, two_mass):
    """A search for a periodic turn that starts from a similar turn finds the same.

    The start is the turn of a follower with a slightly different preload.
    """
    near, other = two_mass_turn(law, two_mass, 420.0 * RPM), replace(two_mass, preload=30.7)
    angle = np.linspace(0.0, TURN, 500)
    one = two_mass_turn(law, other, 420.0 * RPM, near).evaluate(angle)[1]
    two = two_mass_turn(law, other, 420.0 * RPM).evaluate(angle)[1]
    assert np.median(np.abs(one - two)) < 1e-6


def test_a_sensor_s_resonance_is_its_transfer_function(law, rig):
    """The modelled force sensor responds to each order by 1/(1 + 2iζr − r²).

    An order is a multiple of the cam's frequency. r is its frequency divided by the sensor's, ζ the
    damping ratio. A sensor far above all orders shows the force.
    """
    parameters = MODELS["one_mass"].parameters(rig)
    turn, speed = one_mass_turn(law, parameters, 300.0 * RPM), 300.0 * RPM
    angle = np.linspace(0.0, TURN, 4096, endpoint=False)
    force = turn.evaluate(angle)[1]
    stiff = sensor_response(turn, speed, 1e5, 0.5)(angle)
    assert np.abs(stiff - force).max() < 2e-3 * force.max()
    shown = np.fft.rfft(sensor_response(turn, speed, 40.0, 0.1)(angle))[:60]
    r = np.arange(60) * 5.0 / 40.0
    wanted = np.fft.rfft(force)[:60] / (1.0 - r**2 + 0.2j * r)
    assert np.abs(shown - wanted).max() < 1e-4 * np.abs(wanted).max()


@pytest.mark.parametrize("cam", ["poly345", "arcs_straight", "tm21"])
def test_a_stem_is_in_series_with_the_end_mass(laws, two_mass, cam):
    """The force of two masses by harmonics is exact within 1 % of the vibration.

    If the stem has more periods per turn than the points resolve, the error grows with the square.
    """
    random, law = np.random.default_rng(len(cam)), laws[cam]
    for frequency in (9.0, *np.exp(random.uniform(np.log(20.0), np.log(2900.0), 20))):
        speed = np.exp(random.uniform(np.log(20.0), np.log(6000.0))) * RPM
        p = replace(
            two_mass,
            preload=1e6,  # keeps contact
            stem_stiffness=two_mass.end_mass * (TURN * frequency) ** 2,
            stem_damping=0.02 * two_mass.end_mass * TURN * frequency,
        )
        angle = random.uniform(-TURN, 3.0 * TURN, 400)
        pressing = PressingSamples.of(law, [(speed, angle)], np.zeros(400))
        exact, shown = two_mass_turn(law, p, speed).evaluate(angle)[1], pressing.on_a_stem(p)
        mass = p.end_mass + p.roller_mass
        rigid = pressing.parts @ [mass, p.damping, p.spring_stiffness, p.share * p.preload]
        off = np.abs(shown - exact).max() / np.abs(exact - rigid).max()
        periods, most = TURN * frequency / speed, MAX_POINTS / POINTS_PER_PERIOD
        assert off < 0.01 * max(1.0, periods / most) ** 2


def test_a_follower_that_chatters_without_end_has_no_steady_turn(law, rig, monkeypatch):
    """A rig fit continues if a trial has no periodic motion at one of the speeds.

    Here its bounces exceed the limit of events. The fitted spring is then correct within 1 %.
    """
    monkeypatch.setattr(OneMassTrajectory, "max_events", 0)  # any lift-off counts as endless
    run = measured_run(law, rig, "kinetostatic", (200.0, 300.0), InstrumentErrors(rate=200), 1)
    values = numbers_of(rig) | {"restitution": 0.0}
    loose = values | {"spring_stiffness": 1000.0}  # lifts off above 236 rpm
    like = Likelihood(law, measured_segments(run)[1], ("spring_stiffness",), values, None)
    start = Candidate(like, like.start(loose, 0.0, 0.0))
    with pytest.raises(EndlessEventsError, match="allowed: 0 per turn"):
        one_mass_turn(law, build_follower(start.values, None), 300.0 * RPM)
    assert start.steady == [0]
    assert (like.residuals(start.x) == NO_TURN_RESIDUAL).any()
    found = search(start)
    assert found.steady == [0, 1]
    spring = found.likelihood.values(found.x)["spring_stiffness"]
    assert spring == pytest.approx(values["spring_stiffness"], rel=0.01)
