"""Turns laid over each other, cams side by side, noise against rpm, results in words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cam_rig.simulation.schedule import cam_states
from cam_rig.simulation.simulate import MeasuredTick, step_levels
from cam_rig.viewer.blueprint import Layout, ViewOptions
from cam_rig.viewer.level_chart import ROW, at_speed, level_axes
from cam_rig.viewer.quantities import scene_ranges
from cam_rig.viewer.recording import save_recording
from cam_rig.viewer.scene2d import force_scale
from cam_rig.viewer.timeline import TURN, TURN_DEGREES
from cam_rig.viewer.turn_chart import HEAD, WIDTH

from ..conftest import Picture, SmallBag

SCALARS = "Scalars:scalars"


@pytest.mark.parametrize("rpm", [300.0, 700.0])
def test_the_last_turn_lies_over_those_of_the_others(
    bag: SmallBag, tmp_path: Path, rpm: float
) -> None:
    """Samples of the step's last turn at their degrees, its greatest and its least among them."""
    save_recording(bag.path, tmp_path / "a.rrd", ViewOptions(rpm=rpm))
    shown, ranges = Picture(tmp_path / "a.rrd"), scene_ranges(bag.loaded).whole
    for i, cam in enumerate(bag.loaded.cams):
        (strips,) = shown.column(f"{at_speed(rpm, 'lift')}/lift/{cam}", "LineStrips2D:strips")
        low, high, _ = ranges["lift"]
        x, y = np.array(strips[0]).T
        degrees, lift = x / WIDTH * 360.0, high - (y - HEAD) / ROW * (high - low)
        step = 4 * (2 * i + int(rpm > 500.0))
        rows = np.concatenate(bag.rows[step + 2 : step + 4], axis=1)
        angle = np.degrees(np.concatenate(bag.angles[step + 2 : step + 4])) % 360.0
        assert np.all(np.diff(degrees) > 0.0)
        at = np.abs(angle[:, None] - degrees).argmin(axis=0)
        np.testing.assert_allclose(degrees, angle[at], atol=1e-3)
        np.testing.assert_allclose(lift, rows[1, at] * 1e3, atol=1e-3)
        assert lift.max() == pytest.approx(rows[1].max() * 1e3, abs=1e-3)


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
    """Cams in the scene's order, each named once, its speeds below it, with four digits."""
    words = picture.column("results", "TextDocument:text")[-1][0]
    lines = [[cell.strip() for cell in line.split("|")[1:]] for line in words.splitlines()[4:]]
    assert [line[0] for line in lines] == ["Polynomial 3-4-5", "", "Bézier degree 15", ""]
    assert [line[1] for line in lines] == ["300", "700"] * 2
    last = np.concatenate(bag.rows[6:8], axis=1)
    slow, fast = lines[:2]
    assert float(fast[3]) == pytest.approx(last[4].max(), rel=1e-3)
    assert float(fast[4]) == 0.0
    assert int(fast[5]) == 1
    law, angle = bag.loaded.laws["poly345"], np.concatenate(bag.angles[6:8])
    gap = (last[1] - law(angle))[last[4] == 0.0].max() * 1e6
    assert float(fast[6]) == pytest.approx(gap, rel=1e-3)
    assert (slow[5], slow[6]) == ("0", "0")


@pytest.mark.parametrize("layout", [Layout.COMPARE, Layout.REPORT])
def test_cams_side_by_side_at_one_speed(bag: SmallBag, tmp_path: Path, layout: Layout) -> None:
    """A moving picture and bars a cam, at the speed asked for, and not the whole run."""
    path = tmp_path / "a.rrd"
    save_recording(bag.path, path, ViewOptions(layout, 300.0))
    shown = Picture(path)
    assert "/plots/lift/follower" not in shown.entities
    for cam in bag.loaded.cams:
        label = shown.column(f"compare/{cam}/scene/rig/label", "Points2D:labels")
        assert label == [["300 rpm"]]
        assert shown.column(f"compare/{cam}/scene/rig/bar/words", "Points2D:labels") == [["100 N"]]
        assert len(shown.column(f"compare/{cam}/scene/rig/cam", "Transform3D:quaternion")) == 72
        assert len(shown.column(f"compare/{cam}/bands/bars", "LineStrips2D:strips")) == 1


def test_cams_side_by_side_have_one_force_scale(bag: SmallBag, tmp_path: Path) -> None:
    """On the screen, where every cam is as high as the next, the bar of 100 N is as long."""
    path = tmp_path / "a.rrd"
    save_recording(bag.path, path, ViewOptions(Layout.COMPARE, 300.0))
    shown, lengths = Picture(path), []
    assert 100.0 < force_scale(bag.loaded, 10.0 * np.pi) < 1000.0
    for cam in bag.loaded.cams:
        ((foot, top),) = shown.column(f"compare/{cam}/scene/rig/bar", "LineStrips2D:strips")[0]
        (zoom,) = shown.column(f"compare/{cam}/scene/rig", "Transform3D:mat3x3")[0]
        lengths.append((top[1] - foot[1]) * zoom[0])
    assert lengths[0] == pytest.approx(lengths[1], rel=1e-5)


@pytest.mark.parametrize("layout", list(Layout))
def test_a_finished_run_has_its_results_at_every_time(
    bag: SmallBag, tmp_path: Path, layout: Layout
) -> None:
    """On every timeline, also on that of a turn's degrees, all steps are in words and points."""
    path = tmp_path / "a.rrd"
    save_recording(bag.path, path, ViewOptions(layout))
    shown = Picture(path)
    (words,) = shown.column("results", "TextDocument:text")
    assert len([line for line in words[0].splitlines() if line.startswith("|")]) == 2 + 4
    for cam in bag.loaded.cams:
        assert len(shown.column(f"noise/final/{cam}", "Points2D:positions")[0]) == 2
        assert shown.column(f"noise/final/{cam}", TURN_DEGREES) == []
    assert shown.column("results", TURN_DEGREES) == []
