"""The picture of a bag shows the bag's own numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from cam_rig.errors import BagError, CamRigError
from cam_rig.messages import topics
from cam_rig.units import NS
from cam_rig.viewer import recording
from cam_rig.viewer.blueprint import ViewOptions
from cam_rig.viewer.quantities import FORCE_LINE as FORCE
from cam_rig.viewer.quantities import LANDING, LEVEL, SPEED, ZERO
from cam_rig.viewer.quantities import LIFT_LINE as LIFT
from cam_rig.viewer.recording import WHOLE_BELOW, bucket_for, save_recording

from .conftest import Picture, SmallBag, make_bag

SCALARS = "Scalars:scalars"


def test_lift_and_force_are_every_sample_of_the_bag(bag: SmallBag, picture: Picture) -> None:
    """A small bag is shown whole: lift in mm, force in N, at the samples' own rig time."""
    time, lift, _, _, force, _ = bag.samples
    np.testing.assert_allclose(picture.numbers(LIFT.entity, SCALARS), lift * 1e3, rtol=1e-12)
    np.testing.assert_allclose(picture.numbers(FORCE.entity, SCALARS), force, rtol=1e-12)
    np.testing.assert_allclose(picture.time(FORCE.entity), time, atol=1e-9)
    np.testing.assert_allclose(picture.numbers(ZERO.entity, SCALARS), 0.0)


def test_cam_degrees_go_on_from_turn_to_turn(bag: SmallBag, picture: Picture) -> None:
    """The second timeline is the unwrapped cam angle in whole degrees."""
    degrees = picture.numbers(LIFT.entity, "cam_degrees")
    assert np.all(np.diff(degrees) >= 0.0)
    assert np.all(np.abs(degrees + 0.5 - np.degrees(bag.angle)) < 0.5 + 1e-5)
    assert degrees[-1] > 7 * 360


def test_level_is_shown_where_its_tick_ends(bag: SmallBag, picture: Picture) -> None:
    """Each tick's level is that of /microphone/level, at the state that closes the tick."""
    times, levels = np.array(bag.levels).T
    np.testing.assert_allclose(picture.time(LEVEL.entity), times / NS, atol=1e-9)
    np.testing.assert_allclose(picture.numbers(LEVEL.entity, SCALARS), levels)


def test_speed_is_in_rpm(picture: Picture) -> None:
    """Two cams at 300 and at 700 rpm, four ticks each, the last until the end."""
    expected = np.repeat([300.0, 700.0, 300.0, 700.0], [4, 4, 4, 5])
    np.testing.assert_allclose(picture.numbers(SPEED.entity, SCALARS), expected)


def test_landings_are_marked(bag: SmallBag, picture: Picture) -> None:
    """Every sample with an impulse is a marker on the lift and a line of text."""
    time, lift, _, _, _, impulse = bag.samples
    landed = impulse > 0.0
    assert landed.any()
    np.testing.assert_allclose(picture.time(LANDING.entity), time[landed], atol=1e-9)
    np.testing.assert_allclose(picture.column(LANDING.entity, SCALARS), lift[landed, None] * 1e3)
    words = [row[0] for row in picture.column("events", "TextLog:text")]
    assert sum("landing" in line for line in words) == landed.sum()
    assert "Polynomial 3-4-5, 700 rpm" in words


def test_a_long_run_keeps_its_peaks(
    bag: SmallBag, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fewer samples, but each tick's greatest and least force and lift are there."""
    monkeypatch.setattr(recording, "WHOLE_BELOW", 100)
    monkeypatch.setattr(recording, "BUCKETS", 40)
    save_recording(bag.path, tmp_path / "few.rrd")
    few = Picture(tmp_path / "few.rrd")
    for line, row in ((LIFT, 1), (FORCE, 4)):
        values = few.numbers(line.entity, SCALARS)
        assert values.size < bag.samples.shape[1] / 10
        for rows in bag.rows:
            for peak in (rows[row].max(), rows[row].min()):
                assert np.isclose(values, peak * line.factor, rtol=1e-12).any()
    save_recording(bag.path, tmp_path / "all.rrd", ViewOptions(all_samples=True))
    assert Picture(tmp_path / "all.rrd").time(LIFT.entity).size == bag.samples.shape[1]


def test_only_a_long_run_is_thinned() -> None:
    """Below a million samples all are shown; above, some half a million a line."""
    assert bucket_for(WHOLE_BELOW - 1, WHOLE_BELOW) == 1
    assert bucket_for(6_314_142, WHOLE_BELOW) == 26


def test_what_holds_at_every_time_is_read_first(picture: Picture) -> None:
    """A viewer shows a file while it loads: colours, axes and results precede the first curve."""
    static = [chunk.is_static for chunk in RrdReader(picture.path).stream().to_chunks()]
    assert any(static)
    assert static == sorted(static, reverse=True)


def test_every_tick_is_reported(bag: SmallBag, tmp_path: Path) -> None:
    """A progress bar can count on one call a tick."""
    ticks: list[None] = []
    save_recording(bag.path, tmp_path / "a.rrd", on_tick=lambda: ticks.append(None))
    assert len(ticks) == len(bag.rows) == 16


def test_an_existing_file_is_not_overwritten(bag: SmallBag, tmp_path: Path) -> None:
    """Only with ``overwrite``, and nothing is left beside it."""
    path = tmp_path / "taken.rrd"
    path.write_text("mine")
    with pytest.raises(CamRigError, match=r"taken\.rrd: exists already.*--force"):
        save_recording(bag.path, path)
    assert path.read_text() == "mine"
    save_recording(bag.path, path, overwrite=True)
    assert Picture(path).time(LIFT.entity).size == bag.samples.shape[1]
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("name", "words"), [("a.mcap", r"allowed: \.rrd"), ("file/a.rrd", "cannot be written")]
)
def test_a_path_that_cannot_be_is_refused(
    bag: SmallBag, tmp_path: Path, name: str, words: str
) -> None:
    """Another suffix; a folder that is a file."""
    (tmp_path / "file").touch()
    with pytest.raises(CamRigError, match=words):
        save_recording(bag.path, tmp_path / name)


@pytest.mark.parametrize(
    ("topic", "words"),
    [
        (topics.PROFILE, "'poly345' turns, but its /cam/profile is not in the bag"),
        (topics.FOLLOWER_SAMPLES, "has no /follower/samples, so nothing to show"),
    ],
)
def test_a_bag_without_what_is_shown_is_refused(
    tmp_path: Path, config_dir: Path, topic: topics.Topic, words: str
) -> None:
    """The message names the topic, and no half file stays behind."""
    poor = make_bag(tmp_path, config_dir, leave_out=(topic,))
    with pytest.raises(BagError, match=words):
        save_recording(poor.path, tmp_path / "out" / "a.rrd")
    assert not list(tmp_path.glob("out/*"))
