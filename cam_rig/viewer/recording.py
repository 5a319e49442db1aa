"""From a bag to a Rerun recording."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr

from cam_rig.arrays import FloatArray
from cam_rig.bag.reader import messages, read_counts, read_scene
from cam_rig.errors import BagError
from cam_rig.messages import topics
from cam_rig.messages.codec import array_of, cam_state_of, decode_block, stamp_ns
from cam_rig.simulation.loaded_scene import LoadedScene
from cam_rig.simulation.schedule import CamState, cam_states
from cam_rig.units import NS
from cam_rig.viewer.blueprint import blueprint, compared_rpm, playback_begin
from cam_rig.viewer.charts.quantities import scene_ranges
from cam_rig.viewer.feed import RunFeed
from cam_rig.viewer.options import Layout, ViewOptions
from cam_rig.viewer.rrd_file import require_free, rrd_stream
from cam_rig.viewer.run_recorder import RunRecorder

APPLICATION = "cam_rig"
#: A run of fewer samples is shown whole.
WHOLE_BELOW = 1_000_000
#: Buckets per curve of a longer run; each gives its minimum and its maximum.
BUCKETS = 250_000
TOPICS = (
    topics.CAM_STATE,
    topics.PROFILE,
    topics.FOLLOWER_SAMPLES,
    topics.LEVEL,
    topics.PRESSURE,
)


def save_recording(
    bag: Path,
    path: Path,
    view_options: ViewOptions | None = None,
    *,
    loaded: LoadedScene | None = None,
    overwrite: bool = False,
    on_tick: Callable[[], None] = lambda: None,
) -> float:
    """Write a bag as a Rerun recording, a ``.rrd`` file that appears when it is complete.

    Gives the rig time (s) from which it is played.

    Parameters
    ----------
    view_options : how it is wanted
    loaded : the scene that was run, for a bag without one attached
    overwrite : replace the file when it exists
    on_tick : called after each tick

    Raises
    ------
    BagError : the bag cannot be read, or lacks a cam's profile
    CamRigError : the file exists already, or cannot be written; or no such speed
    """
    require_free(path, overwrite)
    loaded, view_options = loaded or read_scene(bag), view_options or ViewOptions()
    duration, rpm = run_duration(bag, loaded), compared_rpm(loaded, view_options.rpm)
    samples = round(duration * loaded.scene.sample_rate.si)
    whole, bucket = (
        view_options.layout is Layout.RUN,
        1 if view_options.all_samples else bucket_for(samples, WHOLE_BELOW),
    )
    ranges = scene_ranges(loaded)
    plan = blueprint(view_options.layout, loaded, duration, bucket, rpm, ranges.whole)
    with rrd_stream(path, APPLICATION, plan) as stream:
        name_recording(stream, f"{loaded.scene.title} ({bag.name})")
        feed_bag(
            bag, loaded, RunFeed(RunRecorder(stream, loaded, bucket, rpm, ranges, whole)), on_tick
        )
    return playback_begin(loaded, duration) if whole else 0.0


def name_recording(stream: rr.RecordingStream, name: str) -> None:
    """Name it, and keep wall time out of it: a run gives the same recording at any time."""
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    stream.send_recording_name(name)


def feed_bag(bag: Path, loaded: LoadedScene, feed: RunFeed, on_tick: Callable[[], None]) -> None:
    """Pass every message of a bag on; ``on_tick`` is called after each tick."""
    for topic, _, message in messages(bag, TOPICS):
        if topic is topics.PROFILE:
            feed.profile(str(message.header.frame_id), polygon(message))
        elif topic is topics.LEVEL:
            feed.level(float(message.data))
        elif topic is topics.PRESSURE:
            feed.pressure(stamp_ns(message.header.stamp), float(message.fluid_pressure))
        elif topic is topics.CAM_STATE:
            feed.state(cam_state(message, loaded))
        else:
            feed.block(decode_block(*array_of(message)))
        for _ in feed.draw():
            on_tick()
    feed.close()


def run_duration(bag: Path, loaded: LoadedScene) -> float:
    """Rig time (s) of the ticks in a bag, all of its scene's or those before an interruption."""
    ticks = read_counts(bag).get(topics.FOLLOWER_SAMPLES.name, 0)
    if ticks == 0:
        raise BagError(f"{bag}: has no {topics.FOLLOWER_SAMPLES.name}, so nothing to show")
    *_, last = islice(cam_states(loaded.scene), ticks + 1)
    return last.time_ns / NS


def bucket_for(samples: int, whole_below: int) -> int:
    """Samples per bucket, so that a long run stays small enough for a viewer."""
    return 1 if samples < whole_below else math.ceil(samples / BUCKETS)


def cam_state(message: Any, loaded: LoadedScene) -> CamState:
    """The cam's state from its message, of a cam that the scene knows."""
    state = cam_state_of(message)
    loaded.law_of(state.cam)
    return state


def polygon(message: Any) -> FloatArray:
    """``(n, 2)`` points of a PolygonStamped, m."""
    return np.array([[point.x, point.y] for point in message.polygon.points], dtype=np.float64)
