"""Rerun recording of a bag: it contains the numbers of the bag."""

import io
import random
import wave

import numpy as np
import pytest
from rerun.chunk import RrdReader

from cam_rig.acoustics import SoundSource
from cam_rig.errors import BagError, CamRigError
from cam_rig.messages import topics
from cam_rig.show.looks import of_cam
from cam_rig.simulation.schedule import cam_states
from cam_rig.units import NS
from cam_rig.viewer import Layout, Tab, ViewOptions, recording
from cam_rig.viewer.blueprint import blueprint
from cam_rig.viewer.quantities import FORCE_LINE as FORCE
from cam_rig.viewer.quantities import LANDING, LEVEL, SPEED, ZERO, scene_ranges
from cam_rig.viewer.quantities import LIFT_LINE as LIFT
from cam_rig.viewer.recording import WHOLE_BELOW, RunFeed, bucket_for, save_recording
from cam_rig.viewer.robot_view import CONTACT, SOUND, robot_root

from .conftest import Picture, make_bag

SCALARS = "Scalars:scalars"


def test_every_sample_level_and_speed_of_a_small_bag_is_shown(bag, picture):
    """The recording contains every sample, level and speed of the bag at its time.

    Lift is in mm, force in N and speed in rpm. A level is at the end of its tick, the interval
    between two cam states.
    """
    time, lift, _, _, force, _ = bag.samples
    np.testing.assert_allclose(picture.numbers(LIFT.entity, SCALARS), lift * 1e3, rtol=1e-12)
    np.testing.assert_allclose(picture.numbers(FORCE.entity, SCALARS), force, rtol=1e-12)
    np.testing.assert_allclose(picture.time(FORCE.entity), time, atol=1e-9)
    np.testing.assert_allclose(picture.numbers(ZERO.entity, SCALARS), 0.0)
    degrees = picture.numbers(LIFT.entity, "cam_degrees")
    assert np.all(np.diff(degrees) >= 0.0)
    assert np.all(np.abs(degrees + 0.5 - np.degrees(bag.angle)) < 0.5 + 1e-5)
    times, levels = np.array(bag.levels).T
    np.testing.assert_allclose(picture.time(LEVEL.entity), times / NS, atol=1e-9)
    np.testing.assert_allclose(picture.numbers(LEVEL.entity, SCALARS), levels)
    expected = np.repeat([300.0, 700.0, 300.0, 700.0], [4, 4, 4, 5])
    np.testing.assert_allclose(picture.numbers(SPEED.entity, SCALARS), expected)


def test_landings_are_marked(bag, picture):
    """Each sample with a landing impulse has a mark on the lift and a line in the log."""
    time, lift, _, _, _, impulse = bag.samples
    landed = impulse > 0.0
    assert landed.any()
    np.testing.assert_allclose(picture.time(LANDING.entity), time[landed], atol=1e-9)
    np.testing.assert_allclose(picture.column(LANDING.entity, SCALARS), lift[landed, None] * 1e3)
    words = [row[0] for row in picture.column("events", "TextLog:text")]
    assert sum("landing" in line for line in words) == landed.sum()
    assert "Polynomial 3-4-5, 700 rpm" in words


def test_a_long_run_keeps_its_peaks(bag, tmp_path, monkeypatch):
    """The reduced curves of a long run contain the extremes of each tick.

    A tick is the interval between two cam states. `decimate=False` keeps all samples.
    """
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
    save_recording(bag.path, tmp_path / "all.rrd", ViewOptions(decimate=False))
    assert Picture(tmp_path / "all.rrd").time(LIFT.entity).size == bag.samples.shape[1]
    monkeypatch.undo()
    assert bucket_for(WHOLE_BELOW - 1) == 1 and bucket_for(6_314_142) == 26


def test_static_data_are_read_first(picture):
    """Colours and axes precede the curves in a recording file.

    A viewer displays a file while it loads, and needs them first.
    """
    static = [chunk.is_static for chunk in RrdReader(picture.path).stream().to_chunks()]
    assert any(static) and static == sorted(static, reverse=True)


def test_an_existing_file_is_not_overwritten(bag, tmp_path):
    """An existing recording is replaced only with `overwrite`.

    Another suffix than .rrd, or a file in place of the folder, is an error.
    """
    path = tmp_path / "taken.rrd"
    path.write_text("mine")
    with pytest.raises(CamRigError, match=r"taken\.rrd: exists already.*--force"):
        save_recording(bag.path, path)
    assert path.read_text() == "mine"
    ticks = []
    save_recording(bag.path, path, overwrite=True, on_tick=lambda: ticks.append(None))
    assert len(ticks) == len(bag.rows) == 16
    assert Picture(path).time(LIFT.entity).size == bag.samples.shape[1]
    assert list(tmp_path.iterdir()) == [path]
    for other, words in (
        ("a.mcap", r"must end in \.rrd"),
        ("taken.rrd/a.rrd", "cannot be written"),
    ):
        with pytest.raises(CamRigError, match=words):
            save_recording(bag.path, tmp_path / other)


def test_a_bag_without_a_required_topic_is_refused(tmp_path, config_dir):
    """A bag without the profile of a cam, or without samples, is refused.

    The error contains the topic, and no incomplete file remains.
    """
    for topic, words in (
        (topics.PROFILE, "'poly345' turns, but its /cam/profile is not in the bag"),
        (topics.FOLLOWER_SAMPLES, "has no messages on /follower/samples to show"),
    ):
        folder = tmp_path / topic.name[1:].replace("/", "_")
        folder.mkdir()
        poor = make_bag(folder, config_dir, leave_out=(topic,))
        with pytest.raises(BagError, match=words):
            save_recording(poor.path, tmp_path / "out" / "a.rrd")
    assert not list(tmp_path.glob("out/*"))


# -- messages arrive in any order of topics, and the result is the same


class Notes:
    """Receiver of a run's ticks and sound levels that records them for a test."""

    def __init__(self):
        self.profiles = {}
        self.received = []
        self.levels = []

    def tick(self, start, end, rows):
        assert start.cam in self.profiles
        assert start.time_ns <= round(rows[0, 0] * 1e9) <= end.time_ns
        self.received.append(("tick", end.time_ns))

    def sound(self, end_ns, level, pressure):
        np.testing.assert_allclose(level, 20.0 * np.log10(pressure / 20e-6))
        self.received.append(("sound", end_ns))
        self.levels.append(level)

    def close(self):
        self.received.append(("close", 0))


@pytest.mark.parametrize("seed", range(4))
def test_any_order_of_topics_gives_the_ticks_in_order(bag, seed):
    """Each tick is passed to the viewer once and in order.

    The order of the topics has no effect. A tick is the interval between two cam states. The sound
    level of a tick follows it.
    """
    notes = Notes()
    feed, sounds = RunFeed(notes), zip(bag.levels, bag.pressures, strict=True)
    queues = [
        [lambda c=c, p=p: feed.profiles.update({c: p}) for c, p in bag.profiles.items()],
        [lambda s=s: feed.pairing.add_state(s) for s in cam_states(bag.loaded.scene)],
        [lambda r=r: feed.pairing.add_block(r) for r in bag.rows],
        [lambda v=v: feed.levels.append(v) for _, v in bag.levels],
        [lambda t=t, p=p: feed.pressures.append((t, p)) for (t, _), p in sounds],
    ]
    chance = random.Random(seed)
    while any(queues):
        chance.choice([queue for queue in queues if queue]).pop(0)()
        for _ in feed.draw():
            pass
    feed.close()
    ends = [t for t, _ in bag.levels]
    assert [t for kind, t in notes.received if kind == "tick"] == ends
    assert [t for kind, t in notes.received if kind == "sound"] == ends
    assert notes.levels == [v for _, v in bag.levels]
    assert all(notes.received.index(("tick", t)) < notes.received.index(("sound", t)) for t in ends)
    assert notes.received[-1] == ("close", 0)


# -- archetypes that Rerun calls unstable, and the rig in three dimensions


def test_the_sound_of_the_run_is_a_wav_file_at_its_start(bag, picture):
    """`AssetAudio` contains the sound of the whole run, proportional to the pressure."""
    rate, loaded = int(bag.loaded.scene.sample_rate.si), bag.loaded
    ((blob,),) = picture.column(SOUND, "AssetAudio:blob")
    assert picture.column(SOUND, "AssetAudio:media_type") == [["audio/wav"]]
    assert picture.time(SOUND) == pytest.approx([bag.samples[0, 0]], abs=1.0 / rate)
    with wave.open(io.BytesIO(bytes(blob))) as file:
        assert (file.getframerate(), file.getnframes()) == (rate, bag.samples.shape[1])
        numbers = np.frombuffer(file.readframes(file.getnframes()), "<i2").astype(float)
    source = SoundSource(loaded.radiation, rate, least_rate=rate)
    states = list(cam_states(loaded.scene))
    pressure = np.concatenate(
        [
            source.pressure(rows[4], rows[5], start.until(end).mean_speed)
            for rows, start, end in zip(bag.rows, states[:-1], states[1:], strict=True)
        ]
    )
    scale = np.abs(numbers).max() / np.abs(pressure).max()
    np.testing.assert_allclose(numbers, scale * pressure, atol=1.5)


def test_contact_and_flight_are_a_lane(bag, picture):
    """`StateChange` changes where the contact force becomes zero, and where it no longer is."""
    time, _, _, _, force, _ = bag.samples
    off = force == 0.0
    changes = np.flatnonzero(np.diff(off)) + 1
    assert changes.size > 4
    np.testing.assert_allclose(picture.time(CONTACT), time[[0, *changes]], atol=1e-9)
    states = [state for (state,) in picture.column(CONTACT, "StateChange:state")]
    assert states == ["flight" if is_off else "contact" for is_off in off[[0, *changes]]]
    assert picture.column(CONTACT, "StateConfiguration:values") == [["contact", "flight"]]


@pytest.mark.parametrize("tab", Tab)
def test_the_requested_tab_of_a_run_is_open(bag, tab):
    """Each tab of a recorded run can be open at first. By default it is that of one turn."""
    ranges = scene_ranges(bag.loaded).all_cams
    for options, expected in (({"tab": tab}, tab), ({}, Tab.TURN)):
        plan = blueprint(Layout.RUN, bag.loaded, 1.0, 1, 300.0, ranges, **options)
        _, tabs = plan.root_container.contents
        assert tabs.contents[tabs.active_tab].name == expected


def test_the_robot_of_the_mounted_cam_moves(bag, picture):
    """The robot of each cam has its bodies, its cam at θ, and its follower at its lift.

    The cam has the colour that it has in all views.

    The robot of a cam that is not mounted is scaled to nothing.
    """
    for cam in bag.loaded.cams:
        root = robot_root(cam)
        bodies = f"{root}/cam_rig/visual_geometries"
        assert f"/{bodies}/follower/visual_0" in picture.entities
        for body, kind in ((f"{cam}/visual_0", "Boxes3D"), ("cam/visual_0", "Cylinders3D")):
            assert picture.column(f"{bodies}/{body}", f"{kind}:colors")[-1] == [of_cam(cam)]
        scales = picture.numbers(f"{root}/mounted", "Transform3D:scale")[:, 0]
        assert sorted(set(np.round(scales, 3))) == [0.0, 1.0]
        time, lift = picture.time(f"{root}/follower"), bag.samples[1]
        drawn = picture.numbers(f"{root}/follower", "Transform3D:translation")
        at = np.searchsorted(bag.samples[0], time - 1e-9)
        raised = drawn - drawn[np.argmin(lift[at])]
        height = np.linalg.norm(raised, axis=1)
        np.testing.assert_allclose(height, lift[at] - lift[at].min(), atol=1e-6)
        turned = 2.0 * np.arctan2(
            *picture.numbers(f"{root}/cam", "Transform3D:quaternion").T[[2, 3]]
        )
        error = np.remainder(turned - bag.angle[at] + np.pi, 2.0 * np.pi) - np.pi
        assert np.abs(error).max() < 1e-5
