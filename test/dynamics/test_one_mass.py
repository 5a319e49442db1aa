"""Tests of one mass: contact without flights, and steps of the cam speed."""

from dataclasses import replace

import numpy as np
import pytest

from cam_rig.dynamics import MODELS, Interval, one_mass
from cam_rig.units import NS

from .helpers import run_in_ticks


def test_no_events_at_200_rpm(laws, follower):
    """At 200 rpm, below the jump speed, one mass equals the kinetostatic model.

    That model has no loss of contact. One mass has no lift-off or landing here.
    """
    cuts, whole = [0, NS // 5, NS], Interval(0, NS, 0.0, 200.0 * np.pi / 30.0)
    run, expected = (
        run_in_ticks(laws["poly345"], model, follower, whole, cuts)
        for model in ("one_mass", "kinetostatic")
    )
    assert run.events == []
    np.testing.assert_array_equal(run.rows, expected.rows)
    assert run.state == expected.state


# -- a change of speed between intervals changes the velocity of the cam, not of the follower

MS = NS // 1000


def test_a_flight_continues_over_a_change_of_speed(laws, follower):
    """A step of the cam speed does not affect a follower in flight.

    Displacement and velocity are continuous.
    """
    law, fast, faster = laws["poly345"], 20.0 * np.pi, 25.0 * np.pi
    stop = 40 * NS // 1000
    angle = fast * 0.04  # 144°, in flight since 101.5°
    state, _ = one_mass.advance(law, follower, None, Interval(0, stop, 0.0, fast), 8000)
    assert not state.in_contact
    following = Interval(stop, stop + NS // 1000, angle, faster)
    _, block = one_mass.advance(law, follower, state, following, 8000)
    assert block.events == ()
    assert block.rows[1, 0] == pytest.approx(state.displacement, rel=1e-14)
    assert block.rows[2, 0] == pytest.approx(state.velocity, rel=1e-14)


@pytest.mark.parametrize("faster", [0.8, 1.0, 1.25])
@pytest.mark.parametrize("model", ["elastic_stem", "one_mass", "two_mass"])
@pytest.mark.parametrize("degrees", [90.0, 180.0, 270.0])
def test_a_change_of_speed_changes_the_cam_velocity_only(laws, paper_rig, model, faster, degrees):
    """A step of the cam speed hits the follower if the cam surface gets faster.

    If the surface gets slower, the follower lifts off. There is no event in a dwell, without a
    speed step, or with the model elastic_stem, which has no loss of contact.
    """
    # If the cam surface gets faster, the impulse is J = m Δv with the mass on the cam. If it gets
    # slower, the follower keeps its velocity and lifts off. In a dwell the surface has no velocity.
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
        return  # the stem determines its acceleration
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
        initial = block.rows[2, 0] - block.rows[3, 0] * since
        assert initial == pytest.approx(state.velocity, abs=3e-3 * abs(change))
