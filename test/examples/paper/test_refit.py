"""Tests of the refit of the four numbers of the rig that the paper does not print."""

from dataclasses import replace

import numpy as np
import pytest

from cam_rig.dynamics.jump.any_follower import find_jump
from cam_rig.dynamics.jump.two_masses import find_jump_speed
from cam_rig.laws import build_law
from cam_rig.units import RPM
from examples.paper import refit as jump_refit
from examples.paper.refit import jumps, main, refit, refitted, study, tables, with_event

FOUR = ("bezier15", "poly345", "poly4567", "cycloidal")


def test_every_start_of_a_refit_is_reported(cams, laws, two_mass, monkeypatch):
    """A refit reports the result from every start value, the best first.

    Four parameters fitted to four jump speeds may have several solutions.
    """
    monkeypatch.setattr(jump_refit, "STARTS", 2)
    monkeypatch.setattr(jump_refit, "MAX_STEPS", 2)
    speeds = {
        cam: 1.01 * find_jump(laws[cam], two_mass, 0.4).rpm for cam in ("poly345", "poly4567")
    }
    found = refit(cams, speeds, two_mass, 0.4)
    ends = [one.rms for one in found.solutions]
    assert ends == sorted(ends) and len(ends) == 2
    assert ends[0] == pytest.approx(found.rms[1])
    again, follower = refitted({"poly345": cams["poly345"]}, two_mass, found.numbers)
    rpm = find_jump_speed(again["poly345"], follower, 0.4) / RPM
    assert rpm / speeds["poly345"] - 1.0 == pytest.approx(found.after["poly345"], abs=1e-6)


def test_with_event(cams):
    """`with_event` changes the angle of rise and fall of a cam, and keeps its lift.

    Both halves of a divided rise get equal angles. A cam that moves over a whole turn is unchanged.
    """
    for name, halves in (("poly345", 1), ("bezier_segments", 2)):
        changed = with_event(cams[name], np.radians(100.0))
        moving = [np.degrees(s.span.si) for s in changed.segments if s.law != "dwell"]
        assert moving == pytest.approx([100.0 / halves] * len(moving))
        assert build_law(changed).lift == pytest.approx(0.05)
    assert with_event(cams["bezier15"], 1.0) is cams["bezier15"]


def test_refit_finds_the_numbers_again(cams, laws, two_mass, monkeypatch):
    """A refit to jump speeds of known parameters finds them from another start value."""
    monkeypatch.setattr(jump_refit, "STARTS", 1)
    monkeypatch.setattr(jump_refit, "MAX_STEPS", 6)
    speeds = {cam: find_jump(laws[cam], two_mass, 0.4).rpm for cam in FOUR}
    off = replace(two_mass, preload=0.97 * two_mass.preload)
    found = refit(cams, speeds, off, 0.4)
    assert found.rms[1] < 0.1 * found.rms[0]
    assert found.numbers.preload == pytest.approx(two_mass.preload, rel=0.01)
    assert found.numbers.event == pytest.approx(np.radians(117.5), rel=0.005)


def test_the_script_prints_its_tables(tmp_path, monkeypatch, capsys):
    """A short refit prints the original rig first, and the jump speeds of five cams."""
    monkeypatch.setattr(jump_refit, "STARTS", 1)
    monkeypatch.setattr(jump_refit, "MAX_STEPS", 1)
    found = study(0.2, lambda _text: None)
    solutions, errors = tables(found)
    assert solutions.frame.iloc[0]["event angle [°]"] == pytest.approx(117.5)
    assert found.rms[1] <= found.rms[0] * (1.0 + 1e-12)
    assert errors.frame["rounding of a speed [%]"].item() == pytest.approx(0.33, abs=5e-3)
    assert list(jumps(found, 0.2).frame["role"]) == ["fitted"] * 4 + ["test"]
    main(["--from-rest", "0.2", "--out", str(tmp_path)])
    assert "rounding of Table 2 alone: 0.33 %" in capsys.readouterr().out
