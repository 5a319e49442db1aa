"""Rerun recordings of bags and of live runs."""

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
from cam_rig.viewer.blueprint import blueprint, compared_rpm, playback_start
from cam_rig.viewer.page import new_recording, next_part, page_delay
from cam_rig.viewer.quantities import scene_ranges
from cam_rig.viewer.run_recorder import RunRecorder
from cam_rig.viewer.timeline import FramePace

# Assembly of the messages of a run, which arrive in any order of topics, into ticks.


class RunReceiver(Protocol):
    """Receiver of a run, tick by tick, such as a writer of a Rerun recording.

    A tick is the time between two successive cam states. `profiles` contains the contour of each
    cam in m, shape (n, 2).
    """

    profiles: dict[str, FloatArray]

    def tick(self, start: CamState, end: CamState, rows: FloatArray) -> None:
        """Process one tick, the time between two successive cam states.

        `rows` contains its samples, shape (6, n): time (s), lift (m), velocity (m/s), acceleration
        (m/s²), contact force (N) and landing impulse (N·s).
        """

    def sound(self, end_ns: int, level: float, pressure: float) -> None:
        """Process sound level (dB) and pressure (Pa) of the tick that ended at a time.

        ``end_ns`` is its rig time in ns. A tick is the time between two cam states.
        """

    def close(self) -> None:
        """Finish the processing after the last tick of the run.

        A tick is the time between two cam states.
        """


class RunFeed:
    """Assembler of the messages of a bag or a live run into ticks for a receiver.

    A tick is the time between two cam states. It is passed on when the cam states at its start and
    its end, its samples and the contour of its cam have arrived. Messages of the sound level have
    no time stamp: the n-th of them belongs to the n-th message of the sound pressure, which has
    one.
    """

    def __init__(self, receiver: RunReceiver) -> None:
        self._receiver = receiver
        #: Cam states and blocks of samples that are not yet combined into ticks (times between two
        #: cam states).
        self.pairing = TickMatcher()
        #: Contour of each cam by name, m, shape (n, 2). The receiver uses the same dict.
        self.profiles = receiver.profiles
        #: Sound levels (dB) whose message of the pressure has not arrived, in their order.
        self.levels: deque[float] = deque()
        #: Ends of ticks (times between two cam states) in ns and r.m.s. pressures (Pa) whose level
        #: has not arrived, in their order.
        self.pressures: deque[tuple[int, float]] = deque()
        self._ticks: deque[Tick] = deque()
        self._sounds: deque[tuple[int, float, float]] = deque()
        self._drawn = self._sound_until = -1

    @property
    def handlers(self) -> dict[Topic, Callable[[Any], None]]:
        """Functions that store a received message, by topic."""
        return {
            topics.CAM_STATE: lambda m: self.pairing.add_state(cam_state_of(m)),
            topics.PROFILE: lambda m: self.profiles.update({m.header.frame_id: polygon(m)}),
            topics.FOLLOWER_SAMPLES: lambda m: self.pairing.add_block(block_of(m)),
            topics.LEVEL: lambda m: self.levels.append(float(m.data)),
            topics.PRESSURE: lambda m: self.pressures.append(pressure_of(m)),
        }

    @property
    def is_behind(self) -> bool:
        """True if the sound level of a drawn tick has not arrived yet.

        A tick is the time between two cam states.
        """
        return self._sound_until < self._drawn

    def draw(self) -> Iterator[Tick]:
        """Pass all complete ticks to the receiver, and yield each tick.

        A tick is the time between two cam states.
        """
        self._ticks.extend(map(Tick._make, self.pairing.complete()))
        while self.levels and self.pressures:
            end_ns, pressure = self.pressures.popleft()
            self._sounds.append((end_ns, self.levels.popleft(), pressure))
        while self._ticks and self._ticks[0].start.cam in self.profiles:
            tick = self._ticks.popleft()
            self._receiver.tick(*tick)
            self._drawn = tick[1].time_ns
            self._pass_sound()
            yield tick
        self._pass_sound()

    def close(self) -> None:
        """Pass on the remaining ticks and close the receiver.

        A tick is the time between two cam states.

        Raises
        ------
        BagError
            If the profile of a cam is missing.
        """
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


#: Number of samples of a run below which the curves keep every sample.
WHOLE_BELOW = 1_000_000
#: Number of groups (buckets) into which the samples of a long run are divided. For each group a
#: curve keeps its minimum and its maximum.
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
    """Write a bag as a Rerun recording.

    The ``.rrd`` file appears when it is complete.

    Parameters
    ----------
    bag : Path
        Bag of the run.
    path : Path
        File to write.
    view_options : ViewOptions, optional
        Layout and reduction of the samples.
    loaded : LoadedScene, optional
        Scene of the run (default: the scene attached to the bag).
    overwrite : bool
        True to replace an existing file.
    on_tick : callable
        Function called after each tick.

    Returns
    -------
    float
        Rig time in s at which playback starts.

    Raises
    ------
    BagError
        If the bag has no samples of the follower or no profile of a cam.
    ConfigError
        If the run has no speed as requested in `view_options`.
    """
    require_free(path, overwrite)
    loaded, view_options = loaded or read_scene(bag), view_options or ViewOptions()
    if read_counts(bag).get(topics.FOLLOWER_SAMPLES.name, 0) == 0:
        raise BagError(f"{bag}: has no messages on {topics.FOLLOWER_SAMPLES.name} to show")
    duration, speeds = _duration_and_speeds(bag)
    rpm = compared_rpm(speeds or loaded.scene.schedule.speeds.si_list, view_options.rpm)
    samples = round(duration * loaded.scene.sample_rate.si)
    bucket = bucket_for(samples) if view_options.decimate else 1
    draws_run, ranges = view_options.layout is Layout.RUN, scene_ranges(loaded)
    plan = blueprint(
        view_options.layout,
        loaded,
        duration,
        bucket,
        rpm,
        ranges.all_cams,
        tab=view_options.tab,
    )
    with rrd_stream(path, f"{loaded.scene.title} ({bag.name})", plan) as stream:
        recorder = RunRecorder(stream, loaded, bucket, rpm, ranges, draws_run)
        feed_bag(bag, loaded, RunFeed(recorder), on_tick)
    return playback_start(loaded, duration) if draws_run else 0.0


def _duration_and_speeds(bag: Path) -> tuple[float, set[float]]:
    """Return the rig time (s) at the end of a run, and its constant speeds (rad/s).

    They are read from the bag, because an operator may have changed the speeds of the scene or
    stopped the run.
    """
    speeds, previous, end = set[float](), None, 0.0
    for state in read_states(bag):
        if previous and previous.turns_until(state) and previous.is_steady_until(state):
            speeds.add(previous.speed)
        previous, end = state, state.time_ns / NS
    return end, speeds


def feed_bag(bag: Path, loaded: LoadedScene, feed: RunFeed, on_tick: Callable[[], None]) -> None:
    """Pass every message of a bag to `feed`, and call ``on_tick`` after each tick.

    A tick is the time between two cam states.
    """
    take = feed.handlers
    for topic, _, message in messages(bag, tuple(take)):
        take[topic](message)
        if topic is topics.CAM_STATE:
            loaded.law_of(message.header.frame_id)  # raises if the scene does not contain the cam
        for _ in feed.draw():
            on_tick()
    feed.close()


def bucket_for(samples: int) -> int:
    """Return the number of samples per bucket that keeps a long run displayable.

    A curve shows the minimum and the maximum of each bucket, a group of successive samples.
    `samples` is the number of samples of the run.
    """
    return 1 if samples < WHOLE_BELOW else math.ceil(samples / BUCKETS)


def polygon(message: Any) -> FloatArray:
    """Return the points of a PolygonStamped message, m, shape (n, 2)."""
    return np.array([[point.x, point.y] for point in message.polygon.points], dtype=np.float64)


# Live view of a run, drawn like a bag.

#: Number of horizontal positions of a curve on a screen. At each of them a curve shows two points.
ACROSS_SCREEN = 1000
#: Shortest rig time (s) before the newest sample that the curves of a live run show. It covers
#: several turns, and all data that a slow page receives at once.
MIN_WINDOW_S = 2.0
#: Shortest wall-clock time (s) between two transmissions of the curves of a live run.
SEND_EVERY_S = 0.25
#: Longest wall-clock time (s) for sending the remaining data at the end of a run.
TIMEOUT_S = 8.0


class LiveView:
    """View of a live run, in a viewer at an address or in a folder that a page reads.

    Parameters
    ----------
    loaded : LoadedScene
        Scene of the run.
    address : str
        Address of a viewer (contains "://"), or folder of the recording.

    Raises
    ------
    CamRigError
        If the viewer cannot be reached, or the folder does not exist.
    """

    def __init__(self, loaded: LoadedScene, address: str) -> None:
        duration, tick = (nanoseconds / NS for nanoseconds in run_length(loaded.scene))
        window = live_window(tick)
        bucket = screen_bucket(window, loaded.scene.sample_rate.si)
        rpm = compared_rpm(loaded.scene.schedule.speeds.si_list, None)
        ranges = scene_ranges(loaded)
        plan = blueprint(Layout.RUN, loaded, duration, bucket, rpm, ranges.all_cams, window)
        self._address, self._stream = address, rr.RecordingStream(APPLICATION)
        #: File of the recording that is being written, None if the run is sent to a viewer.
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
        # The playback is delayed, so that the curves of a tick are sent before its pictures.
        rate = int(loaded.scene.sample_rate.si)
        self._playback = Playback(rate, MARGIN_S + SEND_EVERY_S)
        # The curves are sent at the end of the tick in which this rig time (s) has passed. They
        # then cover no more than the displayed time, so that the display never becomes empty.
        block = window - tick
        self._drawing = RunRecorder(
            self._stream, loaded, bucket, rpm, ranges, pace=self._pace, send_every=block
        )
        self.feed = RunFeed(self._drawing)

    def set_pace(self, factor: float) -> None:
        """Set the real-time factor, in rig seconds per wall-clock second.

        In a paced run each tick is displayed while the drive computes the next one. With a factor
        of 0 (free run) ticks are displayed immediately. A tick is the time between two cam states.
        """
        self._factor = factor
        self._playback.clear()

    def draw(self) -> Iterator[Tick]:
        """Draw all complete ticks, and yield each tick.

        A tick is the time between two cam states.
        """
        for tick in self.feed.draw():
            if self._factor:
                now = time.monotonic()
                self._playback.add(tick, self._factor, now, now)
            yield tick

    def flush(self) -> None:
        """Send the drawn data at the rate that the viewer or page can display.

        In a paced run (with a real-time factor) the pictures of cam and follower are sent at their
        playback time. Curves are sent with them only if `SEND_EVERY_S` has passed since the last
        curves.
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
            self._stream.save(part)  # continues the same recording
            self._part = part

    def close(self) -> None:
        """Send the remaining data to the viewer, and disconnect.

        Raises
        ------
        CamRigError
            If the viewer has been closed.
        """
        self.feed.close()
        try:
            self._stream.flush(timeout_sec=TIMEOUT_S)
        except (RuntimeError, ValueError) as error:
            raise CamRigError(f"{self._address}: the viewer has gone ({error})") from None
        finally:
            with warnings.catch_warnings(action="ignore"):
                self._stream.disconnect()


def screen_bucket(window: float, rate: float) -> int:
    """Return the number of samples per bucket of a curve that fills the screen.

    A bucket is a group of successive samples, of which the curve shows the minimum and the maximum.
    The curve shows `window` s, and `rate` is the sample rate in Hz.
    """
    return max(1, round(window * rate / ACROSS_SCREEN))


def live_window(longest_tick: float) -> float:
    """Return the length (s of rig time) of the curves that a live run shows.

    It covers at least two ticks (times between two cam states). `longest_tick` is the longest tick
    of the run in s.
    """
    return max(MIN_WINDOW_S, 2.0 * longest_tick)
