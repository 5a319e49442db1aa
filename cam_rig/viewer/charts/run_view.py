"""The run itself: cam and follower, time series, bands and events, on every timeline.

A viewer that follows a run puts its cursor at the newest time it knows of anything. So whatever
is of a tick waits for the tick's curves, and goes after them.
"""

from __future__ import annotations

import math

import numpy as np
import rerun as rr

from cam_rig.arrays import FloatArray
from cam_rig.drawing import colours
from cam_rig.drawing.words import shortened
from cam_rig.dynamics import Samples
from cam_rig.simulation.loaded_scene import LoadedScene
from cam_rig.simulation.schedule import CamState
from cam_rig.units import NS, TURN, to_rpm
from cam_rig.viewer.charts.band_chart import BandChart
from cam_rig.viewer.charts.bands import third_octaves
from cam_rig.viewer.charts.quantities import SceneRanges
from cam_rig.viewer.charts.shaft_twist import TORSIONAL, ShaftTwist
from cam_rig.viewer.charts.text_panels import MAX_TITLE
from cam_rig.viewer.charts.time_series import TimeSeries
from cam_rig.viewer.charts.turn_chart import TurnChart
from cam_rig.viewer.pace import FramePace
from cam_rig.viewer.scene2d import Scene2D, frame_mask
from cam_rig.viewer.timeline import Times, time_columns
from cam_rig.viewer.turns import Turn, TurnCollector

EVENTS, BANDS = "events", "bands"


class RunView:
    """Draws a run tick by tick.

    Parameters
    ----------
    bucket : samples of which the minimum and the maximum are kept, 1 for all
    ranges : axis of each quantity that is drawn over the turn
    times : the timelines of all that is drawn
    pace : of a live run, how many pictures of cam and follower may be sent
    """

    def __init__(
        self,
        stream: rr.RecordingStream,
        loaded: LoadedScene,
        bucket: int,
        ranges: SceneRanges,
        times: Times = time_columns,
        pace: FramePace | None = None,
    ) -> None:
        self._stream, self._loaded, self._rate = stream, loaded, loaded.scene.sample_rate.si
        self._times = times
        self._time_series = TimeSeries(stream, loaded, bucket, times)
        self._turns = TurnCollector(loaded.scene.program.ticks_per_turn)
        self._last: CamState | None = None
        self._bands = BandChart(stream, BANDS, self._rate, colours.BANDS, times)
        self._turn_chart = TurnChart(stream, loaded, ranges, times, every=pace is None)
        self._scene = Scene2D(
            stream, loaded, times=times, pace=pace, cursor=self._turn_chart.move_cursor
        )
        self._twist = ShaftTwist(loaded) if loaded.scene.model == TORSIONAL else None
        self._heard, self._whole = list[tuple[CamState, Turn]](), pace is None
        self._events: list[tuple[float, float, str, str]] = []

    def tick(
        self,
        start: CamState,
        end: CamState,
        angle: FloatArray,
        rows: FloatArray,
        profile: FloatArray,
    ) -> None:
        """Draw one tick: unwrapped cam ``angle`` (rad), ``(6, n)`` rows, the cam's contour."""
        self._change(start, profile)
        block = Samples(rows)
        time, lift, force, impulse = block.time, block.lift, block.force, block.impulse
        if self._twist is not None:
            rows = np.vstack([rows, self._twist.tick(start.cam, start.until(end), time)])
        self._time_series.tick(start, end, angle, rows)
        frame = frame_mask(angle, start.until(end).mean_speed / self._rate)
        if frame.any():
            self._scene.frames(time[frame], angle[frame], lift[frame], force[frame])
        landed = impulse > 0.0
        for row in zip(time[landed], angle[landed], impulse[landed], strict=True):
            turn, within = divmod(row[1], TURN)
            words = f"landing at {math.degrees(within):.1f}° of turn {int(turn) + 1}"
            self._events.append((*row[:2], f"{words}, {row[2]:.3g} N·s", "INFO"))
        if not start.holds_until(end):
            return
        self._turns.add(start, angle, rows)
        turn = self._turns.turn()
        if turn is not None:
            self._heard.append((end, turn))
            self._turn_chart.add(end, turn)

    def level(self, end: CamState, level: float) -> None:
        """Draw the level (dB) of the tick that ended with a state."""
        self._time_series.level(end, level)

    def close(self, end: CamState) -> None:
        """Draw the last speed up to the end of the run."""
        if self._last is not None:
            self._time_series.stop(end, self._last.speed)

    def show(self, until: float) -> None:
        """Send pictures of cam and follower up to a rig time (s), of which the curves are sent."""
        self._scene.flush(until)

    def flush(self, until: float = math.inf) -> None:
        """Send what was collected so far, the curves first; pictures up to a rig time (s)."""
        self._time_series.flush()
        self._scene.flush(until)
        # of a live run only the newest bars are seen
        for end, turn in self._heard if self._whole else self._heard[-1:]:
            bands = third_octaves(self._loaded.radiation, turn.force, turn.impulse, self._rate)
            self._bands.add(end.time_ns / NS, end.unwrapped, bands)
        self._heard = []
        self._bands.flush()
        self._turn_chart.flush()
        if self._events:
            time, angle, words, levels = zip(*self._events, strict=True)
            columns = rr.TextLog.columns(text=words, level=levels)
            times = self._times(np.array(time), np.array(angle))
            self._stream.send_columns(EVENTS, times, columns)
        self._events = []

    def _change(self, state: CamState, profile: FloatArray) -> None:
        """What changes with the cam or the speed."""
        last, self._last = self._last, state
        if last is not None and (state.cam, state.speed) == (last.cam, last.speed):
            return
        self.flush()
        if last is None or state.cam != last.cam:
            self._scene.mount(state, profile)
        title = f"{shortened(self._loaded.cams[state.cam].title, MAX_TITLE)}, "
        self._scene.speed(state, title)
        if not self._whole:  # of a bag, a turn is there from its beginning
            self._turn_chart.begin(state)
        words = f"{title}{to_rpm(state.speed):.0f} rpm"
        self._events.append((state.time_ns / NS, state.unwrapped, words, "INFO"))
