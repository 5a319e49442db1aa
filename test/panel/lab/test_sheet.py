"""The hidden rig: the same on every machine, within its tolerances, and different set-ups apart."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import cam_rig
from cam_rig.errors import ConfigError, DynamicsError
from cam_rig.panel.lab.pages import LabPages
from cam_rig.panel.lab.sheet import TOLERANCES, LabSetup, LabSheet, drawn, true_rig

from .conftest import sheet_of

#: 1 + 0.04 (2 x/(2^64 - 1) - 1), x the first eight bytes of the SHA-256 of the four words, a line
#: each.
ALPHA_MASS = 1.0175396720583243


def test_a_seed_is_the_same_rig_everywhere() -> None:
    """Numbers that were computed once: another version or machine must give them again."""
    assert drawn("jump", "alpha", "mass 0", 0.04) == pytest.approx(ALPHA_MASS, rel=1e-15)
    sheet = sheet_of(seed="alpha")
    assert sheet.jump_rpm(LabSetup(4030.0, 0.0, 30.6)) == pytest.approx(408.900, abs=0.01)


def test_every_number_is_drawn_evenly_within_its_tolerance() -> None:
    """Over 2000 names: both ends are come near, the mean is the sheet's."""
    for kind, tolerance in TOLERANCES.items():
        found = np.array([drawn("jump", f"n{i}", kind, tolerance) for i in range(2000)])
        assert np.abs(found - 1.0).max() <= tolerance
        assert found.max() > 1.0 + 0.98 * tolerance
        assert found.min() < 1.0 - 0.98 * tolerance
        # standard error of the mean: tolerance / sqrt(3 n)
        assert abs(found.mean() - 1.0) < 5.0 * tolerance / np.sqrt(3.0 * found.size)


def test_a_spring_is_the_same_in_every_set_up_and_two_are_not_alike() -> None:
    """What is hidden is a rig, and not noise on a reading."""
    rig = cam_rig.load_rig("paper_table2")

    def factor(setup: LabSetup) -> float:
        found = true_rig(rig, setup, "jump", "alpha").follower.spring_stiffness.si
        return found / setup.spring_stiffness

    first = factor(LabSetup(4030.0, 0.0, 30.6))
    assert factor(LabSetup(4030.0, 1.0, 61.2)) == first
    assert factor(LabSetup(3020.0, 0.0, 30.6)) != first
    own = true_rig(rig, LabSetup(4030.0, 0.5, 30.6), "jump", None).follower
    assert (own.mass.si, own.preload.si) == (1.8, 30.6)


@pytest.mark.parametrize("seed", ["", "a b", "../x", "é", "x" * 41])
def test_a_seed_is_a_name(seed: str) -> None:
    """It becomes part of a file's."""
    with pytest.raises(ConfigError, match=r"--seed: is .*; allowed: a name"):
        sheet_of(seed=seed)


def test_an_unknown_lab_names_those_there_are() -> None:
    """And the likeliest."""
    with pytest.raises(ConfigError, match=r"is 'jmp'; allowed: jump \(did you mean 'jump'\?\)"):
        LabSheet("jmp", cam_rig.load_cam("poly345"), cam_rig.load_rig("tm21"))


def test_a_cam_without_a_jump_speed_has_no_sheet(tmp_path: Path) -> None:
    """A frame of two rollers cannot leave; without preload every speed is above the jump speed."""
    with pytest.raises(ConfigError, match="conjugate"):
        sheet_of(cam="conjugate")
    loose = cam_rig.load_rig("tm21").with_follower(preload=0.0)
    sheet = LabSheet("jump", cam_rig.load_cam("poly345"), loose)
    with pytest.raises((ConfigError, DynamicsError), match="preload"):
        LabPages(sheet, tmp_path)


def test_the_line_is_the_jump_speed_of_a_rigid_follower() -> None:
    """n² = (k s + preload) / (m |s''|): for the sheet's own set-up exactly, without damping."""
    rig = cam_rig.load_rig("tm21").with_follower(damping=0.0)
    sheet = LabSheet("jump", cam_rig.load_cam("poly345"), rig)
    own = LabSetup(rig.follower.spring_stiffness.si, 0.0, rig.follower.preload.si)
    speed = np.sqrt(sheet.load(own) / abs(sheet.critical[1]))
    assert speed * 30.0 / np.pi == pytest.approx(cam_rig.jump_speed(sheet.law, rig).rpm, rel=1e-4)
