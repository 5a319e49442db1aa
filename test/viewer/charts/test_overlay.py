"""Turns laid over each other, cams side by side, noise against rpm, results in words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cam_rig.simulation.levels import MeasuredTick, step_levels
from cam_rig.simulation.schedule import cam_states
from cam_rig.viewer.charts.level_chart import level_axes
from cam_rig.viewer.charts.overlay import at_speed
from cam_rig.viewer.options import Layout, ViewOptions
from cam_rig.viewer.recording import save_recording
from cam_rig.viewer.scene2d import max_contact_force
from cam_rig.viewer.timeline import TURN, TURN_DEGREES

from ..conftest import Picture, SmallBag

SCALARS = "Scalars:scalars"


@pytest.mark.parametrize("rpm", [300.0, 700.0])
def test_the_last_turn_lies_over_those_of_the_others(
    bag: SmallBag, tmp_path: Path, rpm: float
) -> None:
    """Lift of the step's last turn, sample by sample, over 0 to 359 degrees."""
    save_recording(bag.path, tmp_path / "a.rrd", ViewOptions(rpm=rpm))
    shown = Picture(tmp_path / "a.rrd")
    for i, cam in enumerate(bag.loaded.cams):
        entity = f"{at_speed(rpm, 'lift')}/{cam}"
        degrees = shown.numbers(entity, TURN_DEGREES)
        step = 4 * (2 * i + int(rpm > 500.0))
        rows = np.concatenate(bag.rows[step + 2 : step + 4], axis=1)
        angle = np.concatenate(bag.angles[step + 2 : step + 4])
        np.testing.assert_allclose(shown.numbers(entity, SCALARS), rows[1] * 1e3)
        np.testing.assert_array_equal(degrees, np.floor(np.degrees(angle) + 1e-4) % 360)
        assert (degrees.min(), degrees.max()) == (0, 359)


def test_turns_are_counted(bag: SmallBag, picture: Picture) -> None:
    """The timeline of turns is the whole part of the unwrapped angle."""
    turns = picture.numbers("plots/lift/follower", TURN)
    np.testing.assert_array_equal(turns, np.floor((bag.angle + 2e-8) / (2.0 * np.pi)))


def test_measured_points_are_the_steps_levels(bag: SmallBag, picture: Picture) -> None:
    """The chart's last points are the energy mean over each step's settled ticks, in its axes."""
    states, rate = list(cam_states(bag.loaded.scene)), int(bag.loaded.scene.sample_rate.si)
    ticks = [
        MeasuredTick.between(start, end, pressure, rate)
        for start, end, pressure in zip(states[:-1], states[1:], bag.pressures, strict=True)
    ]
    axes = level_axes(bag.loaded)
    for cam, steps in step_levels(ticks, 1.0).items():
        shown = picture.column(f"noise/measured/{cam}", "Points2D:positions")
        rpm = np.array(list(steps)) * 30.0 / np.pi
        np.testing.assert_allclose(shown[-1], axes.place(rpm, np.array([*steps.values()])), 1e-5)
        assert len(shown[-1]) == 2
        (final,) = picture.column(f"noise/final/{cam}", "Points2D:positions")
        np.testing.assert_allclose(final, shown[-1])


def test_the_chart_has_speed_to_the_right_and_level_up(bag: SmallBag) -> None:
    """Corners of the axes are corners of the plane, whose y is down."""
    axes = level_axes(bag.loaded)
    corners = axes.place(np.array([300.0, 700.0]), np.array(axes.y))
    np.testing.assert_allclose(corners, [[0.0, axes.height], [axes.width, 0.0]])


def test_results_are_those_of_the_turns(bag: SmallBag, picture: Picture) -> None:
    """The last table has a line a step, the newest first, with that turn's greatest force."""
    words = picture.column("results", "TextDocument:text")[-1][0]
    lines = [line.split("|") for line in words.splitlines() if "Polynomial" in line]
    assert [line[2].strip() for line in lines] == ["700", "300"]
    last = np.concatenate(bag.rows[6:8], axis=1)
    assert float(lines[0][4]) == pytest.approx(last[4].max(), rel=1e-3)
    assert float(lines[0][5]) == 0.0
    assert int(lines[0][6]) == 1
    assert float(lines[0][7]) > 0.5
    assert int(lines[1][6]) == 0


@pytest.mark.parametrize("layout", [Layout.COMPARE, Layout.REPORT])
def test_cams_side_by_side_at_one_speed(bag: SmallBag, tmp_path: Path, layout: Layout) -> None:
    """A moving picture and bars a cam, at the speed asked for, and not the whole run."""
    path = tmp_path / "a.rrd"
    save_recording(bag.path, path, ViewOptions(layout, 300.0))
    shown = Picture(path)
    assert "/plots/lift/follower" not in shown.entities
    for cam in bag.loaded.cams:
        label = shown.column(f"compare/{cam}/scene/rig/label", "Points2D:labels")
        force = max_contact_force(bag.loaded, cam, 10.0 * np.pi)
        assert label == [[f"300 rpm, longest arrow {force:.0f} N"]]
        assert len(shown.column(f"compare/{cam}/scene/rig/cam", "Transform3D:quaternion")) == 72
        assert len(shown.column(f"compare/{cam}/bands/bars", "LineStrips2D:strips")) == 1


@pytest.mark.parametrize("layout", list(Layout))
def test_a_finished_run_has_its_results_at_every_time(
    bag: SmallBag, tmp_path: Path, layout: Layout
) -> None:
    """On every timeline, also on that of a turn's degrees, all steps are in words and points."""
    path = tmp_path / "a.rrd"
    save_recording(bag.path, path, ViewOptions(layout))
    shown = Picture(path)
    (words,) = shown.column("results", "TextDocument:text")
    assert len([line for line in words[0].splitlines() if line.startswith("| ")]) == 1 + 4
    for cam in bag.loaded.cams:
        assert len(shown.column(f"noise/final/{cam}", "Points2D:positions")[0]) == 2
        assert shown.column(f"noise/final/{cam}", TURN_DEGREES) == []
    assert shown.column("results", TURN_DEGREES) == []
