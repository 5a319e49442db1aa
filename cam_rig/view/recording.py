"""From a bag to a Rerun recording."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr

from cam_rig.bag import topics
from cam_rig.bag.codec import array_of, decode_block
from cam_rig.bag.reader import messages, read_counts, read_stage, stamp_ns
from cam_rig.dynamics import NS, FloatArray
from cam_rig.errors import BagError
from cam_rig.experiment.pairing import TickPairing
from cam_rig.experiment.program import CamState, cam_states
from cam_rig.experiment.stage import Stage
from cam_rig.view.blueprint import layout
from cam_rig.view.drawing import RunDrawing
from cam_rig.view.rrd_file import require_free, rrd_stream
from cam_rig.view.scene2d import reach

APPLICATION = "cam_rig"
#: A run of fewer samples is shown whole.
WHOLE_BELOW = 2_000_000
#: Buckets a line of a longer run; each gives its least and its greatest sample.
BUCKETS = 250_000
TOPICS = (topics.CAM_STATE, topics.PROFILE, topics.FOLLOWER_SAMPLES, topics.LEVEL)


def save_recording(
    bag: Path,
    path: Path,
    *,
    all_samples: bool = False,
    overwrite: bool = False,
    on_tick: Callable[[], None] = lambda: None,
) -> None:
    """Write the picture of a bag to ``path``, a ``.rrd`` file, which appears when it is whole.

    Parameters
    ----------
    all_samples : keep every sample, however many
    overwrite : replace the file when it exists
    on_tick : called after each tick

    Raises
    ------
    BagError : the bag cannot be read, or lacks a cam's profile
    CamRigError : the file exists already, or cannot be written
    """
    require_free(path, overwrite)
    stage = read_stage(bag)
    duration = run_duration(bag, stage)
    samples = round(duration * stage.scene.sample_rate.si)
    bucket = 1 if all_samples else bucket_for(samples)
    blueprint = layout(reach(stage), duration, bucket)
    with rrd_stream(path, APPLICATION, blueprint) as stream:
        draw(bag, stage, stream, bucket, on_tick)


def draw(
    bag: Path,
    stage: Stage,
    stream: rr.RecordingStream,
    bucket: int,
    on_tick: Callable[[], None],
) -> None:
    """Draw every tick of a bag into a stream."""
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    stream.send_recording_name(f"{stage.scene.title} ({bag.name})")
    drawing, pairing = RunDrawing(stream, stage, bucket), TickPairing()
    for topic, time_ns, message in messages(bag, TOPICS):
        if topic is topics.PROFILE:
            drawing.profile(str(message.header.frame_id), polygon(message))
        elif topic is topics.LEVEL:
            drawing.level(time_ns, float(message.data))
        elif topic is topics.CAM_STATE:
            pairing.add_state(cam_state(message, stage))
        else:
            pairing.add_block(decode_block(*array_of(message)))
        for start, end, rows in pairing.complete():
            drawing.tick(start, end, rows)
            on_tick()
    drawing.close()


def run_duration(bag: Path, stage: Stage) -> float:
    """Rig time (s) of the ticks in a bag, all of its scene's or those before an interruption."""
    ticks = read_counts(bag).get(topics.FOLLOWER_SAMPLES.name, 0)
    if ticks == 0:
        raise BagError(f"{bag}: has no {topics.FOLLOWER_SAMPLES.name}, so nothing to show")
    *_, last = islice(cam_states(stage.scene), ticks + 1)
    return last.time_ns / NS


def bucket_for(samples: int) -> int:
    """Samples a bucket, so that a long run stays small enough for a viewer."""
    return 1 if samples < WHOLE_BELOW else math.ceil(samples / BUCKETS)


def cam_state(message: Any, stage: Stage) -> CamState:
    """The cam's state from its message, of a cam that the scene knows."""
    cam = str(message.header.frame_id)
    stage.law_of(cam)
    angle, speed = float(message.position[0]), float(message.velocity[0])
    return CamState(stamp_ns(message.header.stamp), angle, speed, cam)


def polygon(message: Any) -> FloatArray:
    """``(n, 2)`` points of a PolygonStamped, m."""
    return np.array([[point.x, point.y] for point in message.polygon.points], dtype=np.float64)
