"""Lift, high dwell and joints: the cams are what they are said to be."""

import dataclasses
import math

import numpy as np
import pytest

from cam_rig.paper.noise.high_dwell import WITH_JUMPS, study_high_dwell, timing_of
from cam_rig.paper.noise.roles import NoiseSetup
from cam_rig.schema.load import config_root
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.simulate import Acoustics

LIFT = 0.005


@pytest.fixture(scope="module")
def setup():
    return NoiseSetup.of(open_scene(config_root() / "scenes" / "tm21_sweep.yaml"))


@pytest.fixture(scope="module")
def found(setup):
    return study_high_dwell(setup, setup.start, LIFT)


def test_the_first_cam_is_the_reference(setup, found):
    """Made from its lift, its dwell and its rise, it sounds as the cam of the file does."""
    own = setup.start.levels(setup.cams[setup.roles.reference].turns)
    np.testing.assert_allclose(found.reference, own, atol=1e-6)
    assert len(found.levels_db) == 8


def test_a_change_is_one_of_the_motion(setup, found):
    """In contact what changes of the force is proportional to the lift, the preload is constant:
    without background a tenth of the lift is 20 dB the quieter at every speed."""
    quiet = dataclasses.replace(setup.start.radiation, background=-200.0)
    alone = study_high_dwell(setup, Acoustics(quiet), LIFT)
    (lift, dwell, rise), *_ = alone.levels_db
    change = alone.levels_db[LIFT, dwell, rise] - alone.reference
    np.testing.assert_allclose(change, 20.0 * math.log10(LIFT / lift), atol=1e-6)
    assert found.shares[(0,)] > 0.9


def test_shares_are_of_all(found):
    """Three factors, three pairs and all of them together."""
    assert len(found.shares) == 7
    assert sum(found.shares.values()) == pytest.approx(1.0)
    assert min(found.shares.values()) >= 0.0


def test_a_cam_without_a_high_dwell_or_rises_is_left_out(setup):
    """A single Bézier curve and arcs have no rise of a name; the study says nothing of them."""
    cams = setup.loaded.cams
    assert timing_of(cams["poly345"]).high_dwell == pytest.approx(math.radians(62.5))
    assert timing_of(cams["bezier15"]) is None
    assert timing_of(cams["tm21"]) is None
    assert timing_of(cams["poly345"]).rise != WITH_JUMPS
    same = timing_of(cams["poly345"]).lift
    assert study_high_dwell(setup, setup.start, same) is None
