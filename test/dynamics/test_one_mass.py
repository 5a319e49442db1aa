"""One mass on the cam: rides, leaves where it would have to be pulled, lands with a blow."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from cam_rig.dynamics import MODELS, Interval, TwoMassParameters, one_mass
from cam_rig.dynamics.one_mass import OneMassTrajectory
from cam_rig.units import NS

from .helpers import ticked

JUMPING = 600.0  # rpm, above the jump speed of every 50 mm cam


def speed_of(rpm):
    return rpm * np.pi / 30.0


def test_rides_at_200_rpm(laws, follower):
    """Below the jump speed nothing happens: the samples are those of the kinetostatic model."""
    cuts, whole = [0, NS // 5, NS], Interval(0, NS, 0.0, speed_of(200.0))
    ridden, expected = (
        ticked(laws["poly345"], model, follower, whole, cuts)
        for model in ("one_mass", "kinetostatic")
    )
    assert ridden.events == []
    np.testing.assert_array_equal(ridden.rows, expected.rows)
    assert ridden.state == expected.state


def test_leaves_where_the_force_is_zero(laws, follower):
    """The first lift-off is the first zero of m ω² s'' + c ω s' + k s + preload."""
    law, p, w = laws["poly345"], follower, speed_of(JUMPING)

    def force(angle):
        s, ds, dds = (float(law(angle, k)) for k in range(3))
        return p.mass * w**2 * dds + p.damping * w * ds + p.spring_stiffness * s + p.preload

    # on the rise's second half, between its middle and its end
    middle = np.radians(31.25 + 117.5 / 2)
    root = brentq(force, middle, np.radians(115.0), xtol=1e-15)
    whole = Interval(0, NS // 10, 0.0, w)
    first = one_mass.advance(law, p, None, whole, 8000)[1].events[0]
    assert first.kind == "lift-off"
    assert first.angle == pytest.approx(root, abs=1e-12)
    assert first.time == pytest.approx(root / w, rel=1e-12)
    assert first.impulse == first.energy_lost == 0.0


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_impulse_is_the_change_of_momentum(laws, follower, restitution):
    """J = m Δv over a landing, and the energy lost is that of the two masses in one."""
    law, p = laws["poly345"], replace(follower, restitution=restitution)
    course = OneMassTrajectory(law, p, Interval(0, NS // 5, 0.0, speed_of(JUMPING)))
    course.run(None)
    landings = [event for event in course.events if event.kind == "landing"]
    flights = {phase.end: phase for phase in course.phases if phase.flight is not None}
    after = {phase.begin: phase for phase in course.phases}
    assert landings
    for event in landings:
        phase = flights[event.time]
        before = float(phase.flight.motion(np.array([phase.end - phase.begin]))[1][0])
        cam = law.at(event.angle)[1] * course.speed
        following = after[event.time].flight
        later = cam if following is None else float(following.start[1])
        assert event.impulse == pytest.approx(p.mass * (later - before), rel=1e-9)
        lost = 0.5 * p.mass * ((before - cam) ** 2 - (later - cam) ** 2)
        assert event.energy_lost == pytest.approx(lost, rel=1e-9)


def test_a_stiff_stem_tends_to_one_mass(laws, follower):
    """With ever stiffer and lighter roller side the lift-off is that of the rigid follower."""
    stiff = TwoMassParameters(0.013, 1.287, 3.3e10, 4030.0, 50.0, 8.642, follower.preload)
    interval, times = Interval(0, 120 * NS // 1000, 0.0, speed_of(450.0)), []
    for model, p in (("one_mass", follower), ("two_mass", stiff)):
        events = MODELS[model].advance(laws["poly345"], p, None, interval, 1000)[1].events
        times.append(events[0].time)
    assert times[0] == pytest.approx(times[1], abs=2e-4)


# A change of speed between intervals: the cam's velocity jumps, the follower's not.

MS = NS // 1000


def test_flight_goes_on_over_a_step(laws, follower):
    """A change of speed does not touch a follower in the air."""
    law, fast, faster = laws["poly345"], 20.0 * np.pi, 25.0 * np.pi
    stop = 40 * NS // 1000
    angle = fast * 0.04  # 144°: high above the cam since the lift-off at 101.5°
    state, _ = one_mass.advance(law, follower, None, Interval(0, stop, 0.0, fast), 8000)
    assert not state.in_contact
    go_on = Interval(stop, stop + NS // 1000, angle, faster)
    _, block = one_mass.advance(law, follower, state, go_on, 8000)
    assert block.events == ()
    assert block.rows[1, 0] == pytest.approx(state.displacement, rel=1e-14)
    assert block.rows[2, 0] == pytest.approx(state.velocity, rel=1e-14)


@pytest.mark.parametrize("faster", [0.8, 1.0, 1.25])
@pytest.mark.parametrize("model", ["elastic_stem", "one_mass", "two_mass"])
@pytest.mark.parametrize("degrees", [90.0, 180.0, 270.0])
def test_a_step_of_the_speed_moves_the_cam_alone(laws, paper_rig, model, faster, degrees):
    """No mass changes its velocity by itself, whatever the cam does under it."""
    # Where the cam gets faster it strikes: J = m Δv for the mass that touches it; where it gets
    # slower the follower goes on with the velocity it had. In the dwell, and where the speed stays,
    # nothing happens.
    law, p = laws["poly345"], replace(MODELS[model].parameters(paper_rig), preload=200.0)
    angle, slow, advance = np.radians(degrees), 20.0, MODELS[model].advance
    state, block = advance(law, p, None, Interval(0, MS, angle - slow * 1e-3, slow), 12_007)
    assert block.events == ()
    change = float(law(angle, 1)) * slow * (faster - 1.0)
    _, block = advance(law, p, state, Interval(MS, 2 * MS, angle, slow * faster), 12_007)
    if abs(change) < 1e-12:
        assert block.events == ()
        return
    if model == "elastic_stem":
        assert block.rows[2, 0] == pytest.approx(state.velocity, abs=0.02 * abs(change))
        return  # its acceleration is the stem's
    first, mass = block.events[0], p.mass if model == "one_mass" else p.roller_mass
    assert first.kind == ("landing" if change > 0.0 else "lift-off")
    assert first.time == pytest.approx(1e-3, abs=1e-15)
    assert first.angle == pytest.approx(angle, abs=1e-15)
    if change > 0.0:
        assert first.impulse == pytest.approx(mass * change, rel=1e-9)
        assert first.energy_lost == pytest.approx(0.5 * mass * change**2, rel=1e-9)
        assert block.rows[5, 0] == first.impulse
    else:
        assert block.rows[4, 0] == 0.0
        since = block.rows[0, 0] - first.time
        begun = block.rows[2, 0] - block.rows[3, 0] * since
        assert begun == pytest.approx(state.velocity, abs=3e-3 * abs(change))
