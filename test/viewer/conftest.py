"""A small bag, simulated and written without ROS, and its picture read back."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr
from rosbags.typesys import Stores, get_typestore

from cam_rig.acoustics import level_db
from cam_rig.bag.writer import BagWriter
from cam_rig.messages import topics
from cam_rig.messages.codec import Dimensions, encode_block
from cam_rig.messages.topics import Topic
from cam_rig.profile import contours
from cam_rig.simulation.scene import LoadedScene, open_scene
from cam_rig.simulation.schedule import CamState, cam_states
from cam_rig.simulation.simulate import FollowerSimulator, MicrophoneSimulator
from cam_rig.units import NS, FloatArray
from cam_rig.viewer import ViewOptions
from cam_rig.viewer.recording import save_recording

SCENE = """
name: small
title: Two cams, two speeds
cams: [poly345, bezier15]
rig: tm21
model: one_mass
sample_rate: {assumed: 4, unit: kHz, source: "small"}
program:
  speeds: {assumed: [300, 700], unit: rpm, source: "slow, and so fast that the follower jumps"}
  turns: {assumed: 2, unit: turns, source: "small"}
  settle_turns: {assumed: 1, unit: turns, source: "small"}
  ticks_per_turn: 2
"""


@dataclass
class SmallBag:
    """A bag, and what was written into it."""

    path: Path
    loaded: LoadedScene
    rows: list[FloatArray] = field(default_factory=list)
    angles: list[FloatArray] = field(default_factory=list)
    levels: list[tuple[int, float]] = field(default_factory=list)
    pressures: list[float] = field(default_factory=list)
    profiles: dict[str, FloatArray] = field(default_factory=dict)

    @property
    def samples(self) -> FloatArray:
        """``(6, n)`` all samples."""
        return np.concatenate(self.rows, axis=1)

    @property
    def angle(self) -> FloatArray:
        """``(n,)`` cam angle at every sample, rad."""
        return np.concatenate(self.angles)


class Messages:
    """Serialized messages, made with rosbags alone."""

    def __init__(self) -> None:
        self._store = get_typestore(Stores.ROS2_KILTED)

    def cdr(self, topic: Topic, message: Any) -> bytes:
        return bytes(self._store.serialize_cdr(message, topic.type))

    def new(self, type_name: str, **fields: Any) -> Any:
        return self._store.types[type_name](**fields)

    def header(self, time_ns: int, frame: str) -> Any:
        stamp = self.new("builtin_interfaces/msg/Time", sec=time_ns // NS, nanosec=time_ns % NS)
        return self.new("std_msgs/msg/Header", stamp=stamp, frame_id=frame)

    def state(self, state: CamState) -> Any:
        return self.new(
            topics.CAM_STATE.type,
            header=self.header(state.time_ns, state.cam),
            name=["cam"],
            position=np.array([state.unwrapped]),
            velocity=np.array([state.speed]),
            effort=np.array([0.0]),
        )

    def array(self, dimensions: Dimensions, data: FloatArray) -> Any:
        dim = "std_msgs/msg/MultiArrayDimension"
        parts = [self.new(dim, label=label, size=size, stride=1) for label, size in dimensions]
        layout = self.new("std_msgs/msg/MultiArrayLayout", dim=parts, data_offset=0)
        return self.new(topics.FOLLOWER_SAMPLES.type, layout=layout, data=data.ravel())

    def profile(self, cam: str, points: FloatArray) -> Any:
        point = "geometry_msgs/msg/Point32"
        corners = [self.new(point, x=float(x), y=float(y), z=0.0) for x, y in points]
        polygon = self.new("geometry_msgs/msg/Polygon", points=corners)
        return self.new(topics.PROFILE.type, header=self.header(0, cam), polygon=polygon)

    def pressure(self, time_ns: int, value: float) -> Any:
        header = self.header(time_ns, "microphone")
        return self.new(topics.PRESSURE.type, header=header, fluid_pressure=value, variance=0.0)

    def number(self, value: float) -> Any:
        return self.new(topics.LEVEL.type, data=value)


def make_bag(folder: Path, config: Path, leave_out: tuple[Topic, ...] = ()) -> SmallBag:
    """Simulate the small scene and write what the picture needs, but for some topics."""
    for part in ("cams", "rigs"):
        shutil.copytree(config / part, folder / "config" / part)
    scene = folder / "config" / "scenes" / "small.yaml"
    scene.parent.mkdir()
    scene.write_text(SCENE, encoding="utf-8")
    loaded = open_scene(scene)
    made, messages = SmallBag(folder / "small", loaded), Messages()
    with BagWriter(made.path) as writer:

        def write(topic: Topic, time_ns: int, message: Any) -> None:
            if topic not in leave_out:
                writer.write(topic, time_ns, messages.cdr(topic, message))

        for path in loaded.files:
            writer.attach(f"{path.parent.name}/{path.name}", path.read_bytes())
        for name, cam in loaded.cams.items():
            made.profiles[name] = contours(cam.follower, loaded.laws[name], 360)[0].points.T
            write(topics.PROFILE, 0, messages.profile(name, made.profiles[name]))
        follower, microphone = FollowerSimulator.of(loaded), MicrophoneSimulator.of(loaded)
        last: CamState | None = None
        for state in cam_states(loaded.scene):
            write(topics.CAM_STATE, state.time_ns, messages.state(state))
            turned = follower.turn_to(state)
            if turned is not None and last is not None:
                rows = turned[1].rows
                pressure = microphone.listen(rows, last.speed)
                level = float(level_db(pressure))
                made.rows.append(rows)
                made.angles.append(last.unwrapped + last.speed * (rows[0] - last.time_ns / NS))
                made.levels.append((state.time_ns, level))
                made.pressures.append(pressure)
                block = messages.array(*encode_block(rows))
                write(topics.FOLLOWER_SAMPLES, state.time_ns, block)
                write(topics.LEVEL, state.time_ns, messages.number(level))
                heard = messages.pressure(state.time_ns, pressure)
                write(topics.PRESSURE, state.time_ns, heard)
            last = state
    return made


@pytest.fixture(scope="session")
def bag(tmp_path_factory: pytest.TempPathFactory, config_dir: Path) -> SmallBag:
    """A whole small bag."""
    return make_bag(tmp_path_factory.mktemp("whole"), config_dir)


@pytest.fixture(scope="session")
def picture(bag: SmallBag, tmp_path_factory: pytest.TempPathFactory) -> Picture:
    """The small bag's picture, read back."""
    path = tmp_path_factory.mktemp("picture") / "small.rrd"
    save_recording(bag.path, path)
    return Picture(path)


#: Gives the small bag's picture with some options, drawn once.
Drawings = Callable[[ViewOptions], "Picture"]


@pytest.fixture(scope="session")
def drawings(bag: SmallBag, tmp_path_factory: pytest.TempPathFactory) -> Drawings:
    @cache
    def drawn(options: ViewOptions) -> Picture:
        path = tmp_path_factory.mktemp("drawing") / "small.rrd"
        save_recording(bag.path, path, options)
        return Picture(path)

    return drawn


@pytest.fixture(scope="session", autouse=True)
def strict() -> Iterator[None]:
    """Rerun raises what it would only warn of."""
    before = rr.strict_mode()
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(before)


class Picture:
    """A recording by entity and column."""

    def __init__(self, path: Path) -> None:
        from rerun.chunk import RrdReader

        self.path = path
        self._batches: dict[str, list[Any]] = {}
        for chunk in RrdReader(path).stream().to_chunks():
            self._batches.setdefault(chunk.entity_path, []).append(chunk.to_record_batch())

    @property
    def entities(self) -> set[str]:
        """All entities, each with a slash before it."""
        return set(self._batches)

    def column(self, entity: str, name: str) -> list[Any]:
        """Every value of a column, as plain data, in the order sent."""
        values: list[Any] = []
        for batch in self._batches[f"/{entity}"]:
            if name in batch.schema.names:
                values += batch.column(name).to_pylist()
        return values

    def numbers(self, entity: str, name: str) -> FloatArray:
        """``(n, …)`` numbers of a column."""
        return np.array(self.column(entity, name), dtype=np.float64).squeeze()

    def time(self, entity: str) -> FloatArray:
        """``(n,)`` rig time of an entity's rows, s."""
        times = [
            batch.column("rig_time").cast("int64").to_numpy()
            for batch in self._batches[f"/{entity}"]
            if "rig_time" in batch.schema.names
        ]
        return np.concatenate(times) * 1e-9
