"""From a bag to a Rerun recording."""

from __future__ import annotations

import math
import time
import warnings
from collections import deque
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import rerun as rr

from cam_rig.bag.measured_run import read_states
from cam_rig.bag.reader import messages, pressure_of, read_counts, read_scene
from cam_rig.errors import BagError, CamRigError
from cam_rig.live.playback import MARGIN_S, Playback, Tick
from cam_rig.live.queues import TickMatcher
from cam_rig.messages import topics
from cam_rig.messages.codec import block_of, cam_state_of
from cam_rig.messages.topics import Topic
from cam_rig.show.chart import APPLICATION, name_recording, require_free, rrd_stream
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.schedule import CamState, run_length
from cam_rig.units import NS, FloatArray
from cam_rig.viewer import Layout, ViewOptions
from cam_rig.viewer.blueprint import blueprint, compared_rpm, playback_begin
from cam_rig.viewer.page import new_recording, next_part, page_delay
from cam_rig.viewer.quantities import scene_ranges
from cam_rig.viewer.run_recorder import RunRecorder
from cam_rig.viewer.timeline import FramePace

# The messages of a run, in any order of topics, put together into ticks and passed on.


class RunReceiver(Protocol):
    """What takes a run tick by tick, in order: a recording for Rerun, or an archive of turns."""

    profiles: dict[str, FloatArray]

    def tick(self, start: CamState, end: CamState, rows: FloatArray) -> None:
        """Take one tick; ``rows`` are the ``(6, n)`` samples of its block."""

    def sound(self, end_ns: int, level: float, pressure: float) -> None:
        """Take level (dB) and pressure (Pa) of the tick that ended at a rig time."""

    def close(self) -> None:
        """Nothing more comes."""


class RunFeed:
    """Takes messages as they come, from a bag or from a live run; passes on what is complete.

    A tick is passed on when both its states, its block and its cam's profile are there. Levels
    carry no stamp: each is published with a pressure, which does.
    """

    def __init__(self, receiver: RunReceiver) -> None:
        self._receiver, self._pairing = receiver, TickMatcher()
        self._ticks: deque[Tick] = deque()
        self._levels: deque[float] = deque()
        self._pressures: deque[tuple[int, float]] = deque()
        self._sounds: deque[tuple[int, float, float]] = deque()
        self._drawn = self._sound_until = -1

    @property
    def handlers(self) -> dict[Topic, Callable[[Any], None]]:
        """What takes a message, by its topic."""
        return {
            topics.CAM_STATE: lambda m: self.state(cam_state_of(m)),
            topics.PROFILE: lambda m: self.profile(str(m.header.frame_id), polygon(m)),
            topics.FOLLOWER_SAMPLES: lambda m: self.block(block_of(m)),
            topics.LEVEL: lambda m: self.level(float(m.data)),
            topics.PRESSURE: lambda m: self.pressure(*pressure_of(m)),
        }

    @property
    def is_behind(self) -> bool:
        """Whether a tick is drawn whose level has not come yet."""
        return self._sound_until < self._drawn

    def profile(self, cam: str, points: FloatArray) -> None:
        """Take the contour of a cam, ``(n, 2)`` in its own frame, m."""
        self._receiver.profiles[cam] = points

    def state(self, state: CamState) -> None:
        """Take the next state of the cam."""
        self._pairing.add_state(state)

    def block(self, rows: FloatArray) -> None:
        """Take the next block of samples, ``(6, n)``."""
        self._pairing.add_block(rows)

    def level(self, level: float) -> None:
        """Take the next level, dB."""
        self._levels.append(level)

    def pressure(self, end_ns: int, pressure: float) -> None:
        """Take the r.m.s. pressure (Pa) of the tick that ended at a rig time."""
        self._pressures.append((end_ns, pressure))

    def draw(self) -> Iterator[Tick]:
        """Draw all that is complete; gives each tick that was."""
        self._ticks.extend(map(Tick._make, self._pairing.complete()))
        while self._levels and self._pressures:
            reading, level = self._pressures.popleft(), self._levels.popleft()
            self._sounds.append((reading[0], level, reading[1]))
        while self._ticks and self._ticks[0].start.cam in self._receiver.profiles:
            tick = self._ticks.popleft()
            self._receiver.tick(*tick)
            self._drawn = tick[1].time_ns
            self._pass_sound()
            yield tick
        self._pass_sound()

    def close(self) -> None:
        """Draw what is left."""
        for _ in self.draw():
            pass
        self._receiver.close()
        if self._ticks:
            cam = self._ticks[0].start.cam
            raise BagError(f"cam {cam!r} turns, but its /cam/profile is not in the bag")

    def _pass_sound(self) -> None:
        while self._sounds and self._sounds[0][0] <= self._drawn:
            sound = self._sounds.popleft()
            self._receiver.sound(*sound)
            self._sound_until = sound[0]


#: A run of fewer samples is shown whole.
WHOLE_BELOW = 1_000_000
#: Buckets per curve of a longer run; each gives its minimum and its maximum.
BUCKETS = 250_000


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

    Gives the rig time (s) from which it is played. ``loaded`` is the scene that was run, for a bag
    without one attached; ``on_tick`` is called after each tick.
    """
    require_free(path, overwrite)
    loaded, view_options = loaded or read_scene(bag), view_options or ViewOptions()
    if read_counts(bag).get(topics.FOLLOWER_SAMPLES.name, 0) == 0:
        raise BagError(f"{bag}: has no {topics.FOLLOWER_SAMPLES.name}, so nothing to show")
    duration, speeds = _course(bag)
    rpm = compared_rpm(speeds or loaded.scene.program.speeds.si_list, view_options.rpm)
    samples = round(duration * loaded.scene.sample_rate.si)
    bucket = 1 if view_options.all_samples else bucket_for(samples)
    whole, ranges = view_options.layout is Layout.RUN, scene_ranges(loaded)
    plan = blueprint(view_options.layout, loaded, duration, bucket, rpm, ranges.whole)
    with rrd_stream(path, f"{loaded.scene.title} ({bag.name})", plan) as stream:
        recorder = RunRecorder(stream, loaded, bucket, rpm, ranges, whole)
        feed_bag(bag, loaded, RunFeed(recorder), on_tick)
    return playback_begin(loaded, duration) if whole else 0.0


def _course(bag: Path) -> tuple[float, set[float]]:
    """Rig time (s) at the end of a run, and the speeds (rad/s) that were held.

    They are the bag's, as an operator may have set others than the scene's, or ended it.
    """
    held, before, end = set[float](), None, 0.0
    for state in read_states(bag):
        if before and before.turns_until(state) and before.holds_until(state):
            held.add(before.speed)
        before, end = state, state.time_ns / NS
    return end, held


def feed_bag(bag: Path, loaded: LoadedScene, feed: RunFeed, on_tick: Callable[[], None]) -> None:
    """Pass every message of a bag on; ``on_tick`` is called after each tick."""
    take = feed.handlers
    for topic, _, message in messages(bag, tuple(take)):
        take[topic](message)
        if topic is topics.CAM_STATE:
            loaded.law_of(message.header.frame_id)  # refuses a cam that the scene has not
        for _ in feed.draw():
            on_tick()
    feed.close()


def bucket_for(samples: int) -> int:
    """Samples per bucket, so that a long run stays small enough for a viewer."""
    return 1 if samples < WHOLE_BELOW else math.ceil(samples / BUCKETS)


def polygon(message: Any) -> FloatArray:
    """``(n, 2)`` points of a PolygonStamped, m."""
    return np.array([[point.x, point.y] for point in message.polygon.points], dtype=np.float64)


# A run in the viewer while it runs: drawn as from a bag.

#: Two points of a curve are all that a screen shows at one place along it: so many places.
ACROSS_SCREEN = 1000
#: Rig time (s) before the newest sample that the curves show at least: some turns, and what is
#: sent at once to the slowest page.
MIN_WINDOW_S = 2.0
#: Wall time (s) between blocks of columns, at least.
SEND_EVERY_S = 0.25
#: Wall time (s) to send the rest at the end.
TIMEOUT_S = 8.0


class LiveView:
    """A feed that is shown at once: by a viewer at an address, or in a folder that a page reads."""

    def __init__(self, loaded: LoadedScene, address: str) -> None:
        duration, tick = (length / NS for length in run_length(loaded.scene))
        window = live_window(tick)
        bucket = screen_bucket(window, loaded.scene.sample_rate.si)
        rpm = compared_rpm(loaded.scene.program.speeds.si_list, None)
        ranges = scene_ranges(loaded)
        plan = blueprint(Layout.RUN, loaded, duration, bucket, rpm, ranges.whole, window)
        self._address, self._stream = address, rr.RecordingStream(APPLICATION)
        #: What a page reads; None for a viewer.
        self._part = new_recording(Path(address)) if "://" not in address else None
        try:
            if self._part is not None:
                self._stream.save(self._part, default_blueprint=plan)
            else:
                self._stream.connect_grpc(address, default_blueprint=plan)
        except (RuntimeError, ValueError, OSError) as error:
            raise CamRigError(f"{address}: no viewer can be reached there ({error})") from None
        name_recording(self._stream, loaded.scene.title)
        self._pace = FramePace(None if self._part is None else partial(page_delay, Path(address)))
        self._sent, self._factor = time.monotonic(), 0.0
        # a picture waits for its tick's curves
        rate = int(loaded.scene.sample_rate.si)
        self._playback = Playback(rate, MARGIN_S + SEND_EVERY_S)
        # a block and the tick that makes it whole fit into the window: no curve is ever out of it
        block = window - tick
        self._drawing = RunRecorder(
            self._stream, loaded, bucket, rpm, ranges, pace=self._pace, send_every=block
        )
        self.feed = RunFeed(self._drawing)

    def set_pace(self, factor: float) -> None:
        """Show each tick while the next one turns, at rig seconds a wall second; 0: at once."""
        self._factor = factor
        self._playback.clear()

    def draw(self) -> Iterator[Tick]:
        """Draw all ticks that are complete; gives each."""
        for tick in self.feed.draw():
            if self._factor:
                now = time.monotonic()
                self._playback.add(tick, self._factor, now, now)
            yield tick

    def flush(self) -> None:
        """Send what was drawn, as often as who looks at it can show it.

        Of a paced run cam and follower are shown when their time has come, and go out alone where
        a block of curves has just gone.
        """
        if self._pace.is_due():
            now = time.monotonic()
            until = self._playback.position(now) / NS if self._factor else math.inf
            if now - self._sent >= SEND_EVERY_S:
                self._sent = now
                self._drawing.flush(until)
            else:
                self._drawing.show(until)
        part = None if self._part is None else next_part(self._part)
        if part is not None:
            self._stream.save(part)  # the same recording goes on
            self._part = part

    def close(self) -> None:
        """Send the rest."""
        self.feed.close()
        try:
            self._stream.flush(timeout_sec=TIMEOUT_S)
        except (RuntimeError, ValueError) as error:
            raise CamRigError(f"{self._address}: the viewer has gone ({error})") from None
        finally:
            with warnings.catch_warnings(action="ignore"):
                self._stream.disconnect()


def screen_bucket(window: float, rate: float) -> int:
    """Samples of which a curve shows the least and the greatest, where it shows some time (s)."""
    return max(1, round(window * rate / ACROSS_SCREEN))


def live_window(longest_tick: float) -> float:
    """Rig time (s) that the curves of a live run show: two ticks at least, the longest (s)."""
    return max(MIN_WINDOW_S, 2.0 * longest_tick)
