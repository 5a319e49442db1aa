"""Fixtures: a small bag written without ROS, and its Rerun recording read back."""

from __future__ import annotations

import json
import shutil
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import rerun as rr

from cam_rig.acoustics import level_db
from cam_rig.bag.writer import BagWriter
from cam_rig.messages import topics
from cam_rig.messages.codec import encode_block
from cam_rig.messages.serialization import header, new, serialize
from cam_rig.profile import contours
from cam_rig.simulation.scene import LoadedScene, open_scene
from cam_rig.simulation.schedule import cam_states
from cam_rig.simulation.simulate import FollowerSimulator, MicrophoneSimulator
from cam_rig.units import NS, FloatArray
from cam_rig.viewer.recording import save_recording

from ..conftest import scene_data

#: Two cams at two speeds, two turns each. At the second speed the follower lifts off.
SCENE = scene_data(
    title="Two cams, two speeds", speeds=[300, 700], turns=2, ticks_per_turn=2, sample_rate=4000
)


@dataclass
class SmallBag:
    """Small bag of a simulated run, and the data that were written into it."""

    path: Path
    loaded: LoadedScene
    rows: list[FloatArray] = field(default_factory=list)
    angles: list[FloatArray] = field(default_factory=list)
    levels: list[tuple[int, float]] = field(default_factory=list)
    pressures: list[float] = field(default_factory=list)
    profiles: dict[str, FloatArray] = field(default_factory=dict)

    @property
    def samples(self):
        """All samples, shape (6, n)."""
        return np.concatenate(self.rows, axis=1)

    @property
    def angle(self):
        """Cam angle at every sample, rad, shape (n,)."""
        return np.concatenate(self.angles)

    @property
    def gap(self):
        """Lift minus the cam's law at every sample, m, shape (n,).

        It is the gap between cam and follower.
        """
        laws, angles = self.loaded.laws.values(), np.split(self.angle, len(self.loaded.laws))
        lifts = [law(angle) for law, angle in zip(laws, angles, strict=True)]
        return self.samples[1] - np.concatenate(lifts)

    def sample_of(self, picture, entity):
        """Return for each row of a displayed entity the index of the sample at its time."""
        return np.abs(self.samples[0][:, None] - picture.time(entity)).argmin(axis=0)


def of_state(state):
    numbers = (np.array([x]) for x in (state.unwrapped, state.speed, 0.0))
    return new("sensor_msgs/JointState", header(state.time_ns, state.cam), ["cam"], *numbers)


def of_rows(rows):
    dimensions, data = encode_block(rows)
    parts = [new("std_msgs/MultiArrayDimension", *sizes, 1) for sizes in dimensions]
    layout = new("std_msgs/MultiArrayLayout", parts, 0)
    return new("std_msgs/Float64MultiArray", layout, data.ravel())


def of_profile(cam, points):
    corners = [new("geometry_msgs/Point32", float(x), float(y), 0.0) for x, y in points]
    return new(
        "geometry_msgs/PolygonStamped", header(0, cam), new("geometry_msgs/Polygon", corners)
    )


def make_bag(folder, config, leave_out=(), scene=SCENE):
    """Simulate a scene and write its topics, except `leave_out`, to a bag.

    The `SmallBag` is returned.
    """
    for part in ("cams", "rigs"):
        shutil.copytree(config / part, folder / "config" / part)
    path = folder / "config" / "scenes" / "small.yaml"
    path.parent.mkdir()
    path.write_text(json.dumps(scene), encoding="utf-8")
    loaded = open_scene(path)
    bag = SmallBag(folder / "small", loaded)
    with BagWriter(bag.path) as writer:

        def write(topic, time_ns, message):
            if topic not in leave_out:
                writer.write(topic, time_ns, serialize(message))

        for path in loaded.files:
            writer.attach(f"{path.parent.name}/{path.name}", path.read_bytes())
        for name, cam in loaded.cams.items():
            bag.profiles[name] = contours(cam.follower, loaded.laws[name], 360)[0].points.T
            write(topics.PROFILE, 0, of_profile(name, bag.profiles[name]))
        follower, microphone = FollowerSimulator.of(loaded), MicrophoneSimulator.of(loaded)
        last = None
        for state in cam_states(loaded.scene):
            write(topics.CAM_STATE, state.time_ns, of_state(state))
            turned = follower.turn_to(state)
            if turned is not None and last is not None:
                rows = turned[1].rows
                pressure = microphone.listen(rows, last.speed)
                level = float(level_db(pressure))
                bag.rows.append(rows)
                bag.angles.append(last.unwrapped + last.speed * (rows[0] - last.time_ns / NS))
                bag.levels.append((state.time_ns, level))
                bag.pressures.append(pressure)
                write(topics.FOLLOWER_SAMPLES, state.time_ns, of_rows(rows))
                write(topics.LEVEL, state.time_ns, new("std_msgs/Float64", level))
                stamp = header(state.time_ns, "microphone")
                pressure_message = new("sensor_msgs/FluidPressure", stamp, pressure, 0.0)
                write(topics.PRESSURE, state.time_ns, pressure_message)
            last = state
    return bag


def play(view, bag):
    """Pass the run of a bag to a live view tick by tick.

    Each cam state is yielded before the samples that follow it.
    """
    feed, states = view.feed, cam_states(bag.loaded.scene)
    for cam, points in bag.profiles.items():
        feed.profiles[cam] = points
    feed.pairing.add_state(next(states))
    for state, rows, (end, level), pressure in zip(
        states, bag.rows, bag.levels, bag.pressures, strict=True
    ):
        yield state
        feed.pairing.add_state(state)
        feed.pairing.add_block(rows)
        feed.levels.append(level)
        feed.pressures.append((end, pressure))
        for _ in view.draw():
            pass


@pytest.fixture(scope="session")
def bag(tmp_path_factory, config_dir):
    """Small bag with all topics, created once for all tests."""
    return make_bag(tmp_path_factory.mktemp("whole"), config_dir)


@pytest.fixture(scope="session")
def drawings(bag, tmp_path_factory):
    """Function that records the small bag for the viewer with options.

    It returns the recording as a `Picture`.
    """

    @cache
    def drawn(*options):
        path = tmp_path_factory.mktemp("drawing") / "small.rrd"
        save_recording(bag.path, path, *options)
        return Picture(path)

    return drawn


@pytest.fixture(scope="session")
def picture(drawings):
    """Viewer recording of the small bag with the default options."""
    return drawings()


@pytest.fixture(scope="session", autouse=True)
def strict():
    """Make Rerun raise errors instead of warnings in every test."""
    before = rr.strict_mode()
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(before)


class Picture:
    """Rerun recording, whose data are read by entity and column.

    An entity is the path of a displayed object.
    """

    def __init__(self, path):
        from rerun.chunk import RrdReader

        self.path = path
        self._batches = {}
        for chunk in RrdReader(path).stream().to_chunks():
            self._batches.setdefault(chunk.entity_path, []).append(chunk.to_record_batch())

    @property
    def entities(self):
        """Set of entity paths in the recording, each with a leading slash."""
        return set(self._batches)

    def column(self, entity, name):
        """Return the values of a column of an entity as a list, in the order of sending."""
        values = []
        for batch in self._batches[f"/{entity}"]:
            if name in batch.schema.names:
                values += batch.column(name).to_pylist()
        return values

    def numbers(self, entity, name):
        """Return the numbers of a column of an entity, shape (n, …)."""
        return np.array(self.column(entity, name), dtype=np.float64).squeeze()

    def time(self, entity):
        """Return the rig time (s) of the rows of an entity, shape (n,)."""
        times = [
            batch.column("rig_time").cast("int64").to_numpy()
            for batch in self._batches[f"/{entity}"]
            if "rig_time" in batch.schema.names
        ]
        return np.concatenate(times) * 1e-9
