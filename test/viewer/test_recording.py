"""The picture of a bag shows the bag's own numbers."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from cam_rig.errors import BagError, CamRigError
from cam_rig.messages import topics
from cam_rig.simulation.schedule import CamState, cam_states
from cam_rig.units import NS, FloatArray
from cam_rig.viewer import ViewOptions, recording
from cam_rig.viewer.quantities import FORCE_LINE as FORCE
from cam_rig.viewer.quantities import LANDING, LEVEL, SPEED, ZERO
from cam_rig.viewer.quantities import LIFT_LINE as LIFT
from cam_rig.viewer.recording import WHOLE_BELOW, RunFeed, bucket_for, save_recording

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
    """Fewer samples, but each tick's greatest and least force and lift are there. Below a million
    samples all are shown; above, some half a million a line."""
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
    monkeypatch.undo()
    assert bucket_for(WHOLE_BELOW - 1, WHOLE_BELOW) == 1
    assert bucket_for(6_314_142, WHOLE_BELOW) == 26


def test_what_holds_at_every_time_is_read_first(picture: Picture) -> None:
    """A viewer shows a file while it loads: colours, axes and results precede the first curve."""
    static = [chunk.is_static for chunk in RrdReader(picture.path).stream().to_chunks()]
    assert any(static)
    assert static == sorted(static, reverse=True)


def test_an_existing_file_is_not_overwritten(bag: SmallBag, tmp_path: Path) -> None:
    """Only with ``overwrite``, and nothing is left beside it. Another suffix, and a folder
    that is a file, are refused. A progress bar can count on one call a tick."""
    path = tmp_path / "taken.rrd"
    path.write_text("mine")
    with pytest.raises(CamRigError, match=r"taken\.rrd: exists already.*--force"):
        save_recording(bag.path, path)
    assert path.read_text() == "mine"
    ticks: list[None] = []
    save_recording(bag.path, path, overwrite=True, on_tick=lambda: ticks.append(None))
    assert len(ticks) == len(bag.rows) == 16
    assert Picture(path).time(LIFT.entity).size == bag.samples.shape[1]
    assert list(tmp_path.iterdir()) == [path]
    for other, words in (("a.mcap", r"allowed: \.rrd"), ("taken.rrd/a.rrd", "cannot be written")):
        with pytest.raises(CamRigError, match=words):
            save_recording(bag.path, tmp_path / other)


def test_a_bag_without_what_is_shown_is_refused(tmp_path: Path, config_dir: Path) -> None:
    """The message names the topic, and no half file stays behind."""
    for topic, words in (
        (topics.PROFILE, "'poly345' turns, but its /cam/profile is not in the bag"),
        (topics.FOLLOWER_SAMPLES, "has no /follower/samples, so nothing to show"),
    ):
        folder = tmp_path / topic.name[1:].replace("/", "_")
        folder.mkdir()
        poor = make_bag(folder, config_dir, leave_out=(topic,))
        with pytest.raises(BagError, match=words):
            save_recording(poor.path, tmp_path / "out" / "a.rrd")
    assert not list(tmp_path.glob("out/*"))


# -- messages come on many topics in any order; the picture is the same -----------------------


class Notes:
    """Stands for a recording: writes down what it receives."""

    def __init__(self) -> None:
        self.profiles: dict[str, FloatArray] = {}
        self.received: list[tuple[str, int]] = []
        self.levels: list[float] = []

    def tick(self, start: CamState, end: CamState, rows: FloatArray) -> None:
        assert start.cam in self.profiles
        assert start.time_ns <= round(rows[0, 0] * 1e9) <= end.time_ns
        self.received.append(("tick", end.time_ns))

    def sound(self, end_ns: int, level: float, pressure: float) -> None:
        np.testing.assert_allclose(level, 20.0 * np.log10(pressure / 20e-6))
        self.received.append(("sound", end_ns))
        self.levels.append(level)

    def close(self) -> None:
        self.received.append(("close", 0))


def echoed(calls: list[Callable[[], None]]) -> list[Callable[[], None]]:
    """After every third call, the last three once more."""
    return [call for i in range(0, len(calls), 3) for call in 2 * calls[i : i + 3]]


@pytest.mark.parametrize("republished", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_any_order_of_topics_gives_the_ticks_in_order(
    bag: SmallBag, seed: int, republished: bool
) -> None:
    """Each topic keeps its own order; every tick is passed on once, and its sound after it. Also
    when nodes republish what a subscriber may have missed."""
    notes = Notes()
    feed = RunFeed(notes)
    queues = [
        [lambda c=c, p=p: feed.profile(c, p) for c, p in bag.profiles.items()],
        [lambda s=s: feed.state(s) for s in cam_states(bag.loaded.scene)],
        [lambda r=r: feed.block(r) for r in bag.rows],
        [lambda v=v: feed.level(v) for _, v in bag.levels],
        [
            lambda t=t, p=p: feed.pressure(t, p)
            for (t, _), p in zip(bag.levels, bag.pressures, strict=True)
        ],
    ]
    queues = [echoed(queue) if republished else queue for queue in queues]
    chance = random.Random(seed)
    while any(queues):
        chance.choice([queue for queue in queues if queue]).pop(0)()
        for _ in feed.draw():
            pass
    feed.close()
    ends = [t for t, _ in bag.levels]
    assert [t for what, t in notes.received if what == "tick"] == ends
    assert [t for what, t in notes.received if what == "sound"] == ends
    assert notes.levels == [v for _, v in bag.levels]
    assert all(notes.received.index(("tick", t)) < notes.received.index(("sound", t)) for t in ends)
    assert notes.received[-1] == ("close", 0)


def test_a_cam_without_a_profile_waits_and_is_named_at_the_end(bag: SmallBag) -> None:
    """Nothing is drawn of it; the end says which cam it was."""
    notes = Notes()
    feed = RunFeed(notes)
    for state in cam_states(bag.loaded.scene):
        feed.state(state)
    for rows in bag.rows:
        feed.block(rows)
    assert list(feed.draw()) == []
    with pytest.raises(BagError, match="cam 'poly345' turns, but its /cam/profile is not"):
        feed.close()
