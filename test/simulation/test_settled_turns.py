"""Settled turns hold the same energy as the exact steady response and as a whole run."""

import numpy as np
import pytest

from cam_rig.acoustics import level_db, steady_power
from cam_rig.dynamics import MODELS, Interval, TwoMassParameters
from cam_rig.schema import load_rig
from cam_rig.schema.load import config_root
from cam_rig.simulation.simulate import (
    TURN_RATE_HZ,
    Acoustics,
    Turns,
    settled_turns,
    simulate,
    step_levels,
)
from cam_rig.units import NS

RPM = np.array([200.0, 300.0, 400.0])
SPEEDS = RPM * np.pi / 30.0


@pytest.mark.parametrize("cam", ["poly345", "bezier15"])
def test_steady_levels(make_loaded_scene, cam):
    """Of a cam that keeps contact: those of the exact steady response, to 2e-3 dB."""
    loaded = make_loaded_scene()
    turns = settled_turns(loaded.laws[cam], "one_mass", loaded.follower, SPEEDS)
    power = [
        steady_power(loaded.laws[cam], loaded.follower, loaded.radiation, float(s)) for s in SPEEDS
    ]
    exact = level_db(np.sqrt(np.array(power)))
    np.testing.assert_allclose(Acoustics(loaded.radiation).levels(turns), exact, atol=2e-3)
    np.testing.assert_allclose(turns.rpm, RPM, rtol=1e-14)


def test_levels_with_landings(make_loaded_scene):
    """Of a cam that jumps: those of the whole simulated run, to 0.02 dB."""
    loaded = make_loaded_scene(
        cams=["tm21"], speeds=[350, 400], turns=6, settle_turns=2, sample_rate=12000
    )
    run = step_levels(simulate(loaded), 2.0)["tm21"]
    turns = settled_turns(loaded.laws["tm21"], "one_mass", loaded.follower, sorted(run))
    assert all(impulse.sum() > 0.0 for impulse in turns.impulses)
    levels = Acoustics(loaded.radiation).levels(turns)
    np.testing.assert_allclose(levels, [run[s] for s in sorted(run)], atol=0.02)


def test_the_speed_response_acts_on_the_contact_alone(make_loaded_scene):
    """A response of +3 dB at 400 rpm raises the contact's share alone."""
    loaded = make_loaded_scene()
    plain = Acoustics(loaded.radiation)
    raised = Acoustics(loaded.radiation, (3.0, 0.0, 0.0))
    turns = settled_turns(loaded.laws["poly345"], "one_mass", loaded.follower, SPEEDS)
    background = np.array([loaded.radiation.background_power(float(s)) for s in SPEEDS])
    power = [4e-10 * 10.0 ** (a.levels(turns) / 10.0) - background for a in (plain, raised)]
    np.testing.assert_allclose(10.0 * np.log10(power[1] / power[0]), [-3.0, 0.0, 3.0], atol=1e-9)


def test_every(make_loaded_scene):
    """Thinned out, the turns left are the same."""
    loaded = make_loaded_scene()
    turns = settled_turns(loaded.laws["poly345"], "one_mass", loaded.follower, SPEEDS)
    acoustics = Acoustics(loaded.radiation)
    np.testing.assert_array_equal(acoustics.levels(turns.every(2)), acoustics.levels(turns)[::2])


def test_elastic_turns_settle(make_loaded_scene):
    """On the two-mass follower the second turn is like the fourth, to 0.05 dB."""
    follower = TwoMassParameters.from_rig(load_rig(config_root() / "rigs" / "paper_table2.yaml"))
    law, loaded, speed = make_loaded_scene().laws["poly345"], make_loaded_scene(), float(SPEEDS[0])
    turn, state = round(2.0 * np.pi / speed * NS), None
    for i in range(4):
        interval = Interval(i * turn, (i + 1) * turn, speed * i * turn / NS, speed)
        state, block = MODELS["two_mass"].advance(law, follower, state, interval, TURN_RATE_HZ)
    late = Turns(SPEEDS[:1], (block.rows[4],), (block.rows[5],))
    early = settled_turns(law, "two_mass", follower, SPEEDS[:1])
    levels = [Acoustics(loaded.radiation).levels(turns) for turns in (early, late)]
    np.testing.assert_allclose(levels[0], levels[1], atol=0.05)
