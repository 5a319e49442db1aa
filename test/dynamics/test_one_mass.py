"""One mass on the cam: rides, leaves where it would have to be pulled, lands with a blow."""

from dataclasses import replace

import numpy as np
import pytest

from cam_rig.dynamics import MODELS, Interval, one_mass
from cam_rig.units import NS

from .helpers import run_in_ticks


def test_rides_at_200_rpm(laws, follower):
    """Below the jump speed nothing happens: the samples are those of the kinetostatic model."""
    cuts, whole = [0, NS // 5, NS], Interval(0, NS, 0.0, 200.0 * np.pi / 30.0)
    ridden, expected = (
        run_in_ticks(laws["poly345"], model, follower, whole, cuts)
        for model in ("one_mass", "kinetostatic")
    )
    assert ridden.events == []
    np.testing.assert_array_equal(ridden.rows, expected.rows)
    assert ridden.state == expected.state


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
