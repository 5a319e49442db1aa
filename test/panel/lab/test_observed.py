"""What is seen of the rig is what is marked: the follower leaves the cam at its jump speed."""

from __future__ import annotations

import numpy as np
import pytest

from cam_rig.dynamics.jump.any_follower import follower_of
from cam_rig.dynamics.jump.jump_speed import rigid_least
from cam_rig.panel.lab.marking import POINTS, observe
from cam_rig.units import RPM

from .conftest import sheet_of

#: How far above and below the marked speed the model is asked, relative: 0.008 rpm at 400 rpm.
NEAR = 2e-5


@pytest.mark.variants(3)
@pytest.mark.parametrize("rig", ["paper_table2", "tm21"])
@pytest.mark.parametrize("seed", [None, "alpha", "group-3", "Z9"])
def test_the_model_leaves_the_cam_exactly_above_the_marked_speed(rig: str, seed: str) -> None:
    """In steady state, two masses and one, with every set-up of the sheet."""
    sheet = sheet_of(rig, seed)
    for setup in sheet.setups:
        jump, true = sheet.jump_rpm(setup), sheet.true_rig(setup)
        assert not observe(sheet.law, true, jump * (1.0 - NEAR)).contact_lost, setup
        assert observe(sheet.law, true, jump * (1.0 + NEAR)).contact_lost, setup


def test_a_kept_turn_is_the_kinetostatic_force_of_one_mass() -> None:
    """m s'' Ω² + c s' Ω + k s + preload, to what the sensor resolves."""
    sheet = sheet_of("tm21")
    rig, rpm = sheet.true_rig(sheet.setups[0]), 300.0
    follower, speed = follower_of(rig), rpm * RPM
    motion = np.array([sheet.law.at(a) for a in np.arange(POINTS) * (2.0 * np.pi / POINTS)]).T
    force = (
        follower.spring_stiffness * motion[0]
        + follower.damping * motion[1] * speed
        + follower.mass * motion[2] * speed**2
        + follower.preload
    )
    turn = observe(sheet.law, rig, rpm)
    # 0.05 N of rounding, and a straight line between two samples of 16 kHz
    assert np.abs(turn.force - force).max() < 0.1
    least = rigid_least(sheet.law, follower, np.array([speed]))[0]
    assert turn.force.min() == pytest.approx(least, abs=0.15)


def test_above_the_jump_the_force_is_zero_in_flight_and_never_pulls() -> None:
    """A cam cannot pull: where the follower is off, a sensor reads nothing."""
    for rig in ("paper_table2", "tm21"):
        sheet = sheet_of(rig)
        turn = observe(sheet.law, sheet.rig, 1.15 * sheet.jump_rpm(sheet.setups[-1]) + 150.0)
        assert turn.contact_lost
        assert turn.force.min() == 0.0
        assert (turn.force == 0.0).sum() > POINTS // 50
        assert np.isfinite(turn.sound).all()
        assert np.abs(turn.sound).max() > 0.0
