"""A run as a picture: takes cam states, profiles, blocks and levels, fills a Rerun stream."""

from __future__ import annotations

import math

import numpy as np
import rerun as rr

from cam_rig.dynamics import NS, FloatArray
from cam_rig.experiment.program import CamState
from cam_rig.experiment.stage import Stage
from cam_rig.view import series
from cam_rig.view.about import about
from cam_rig.view.blueprint import ABOUT, EVENTS
from cam_rig.view.scene2d import Scene2D, frame_mask
from cam_rig.view.series import LineWriter
from cam_rig.view.timeline import time_columns


class RunDrawing:
    """Draws a run tick by tick; `close` sends what is left.

    Parameters
    ----------
    stream : where to draw
    stage : the scene that was run
    bucket : samples of which the least and the greatest are kept, 1 for all
    """

    def __init__(self, stream: rr.RecordingStream, stage: Stage, bucket: int) -> None:
        self._stream, self._stage = stream, stage
        self._profiles: dict[str, FloatArray] = {}
        self._levels: list[tuple[int, float]] = []
        self._angles: dict[int, float] = {}
        self._last: CamState | None = None
        self._end: CamState | None = None
        words = rr.TextDocument(about(stage, bucket), media_type="text/markdown")
        stream.log(ABOUT, words, static=True)
        marks = rr.SeriesPoints(colors=series.LANDING.colour, names=series.LANDING.name)
        stream.log(series.LANDING.entity, marks, static=True)
        self._scene = Scene2D(stream, stage)
        self._lift = LineWriter(stream, series.LIFT, bucket)
        self._force = LineWriter(stream, series.FORCE, bucket)
        self._zero = LineWriter(stream, series.ZERO)
        self._speed = LineWriter(stream, series.SPEED)
        self._level = LineWriter(stream, series.LEVEL)

    def profile(self, cam: str, points: FloatArray) -> None:
        """Take the contour of a cam, ``(n, 2)`` in its own frame, m."""
        self._profiles[cam] = points

    def level(self, time_ns: int, level: float) -> None:
        """Take the level (dB) of the tick that ended at a rig time."""
        self._levels.append((time_ns, level))

    def tick(self, start: CamState, end: CamState, rows: FloatArray) -> None:
        """Draw one tick; ``rows`` are the ``(6, n)`` samples of its block."""
        self._step(start)
        time, lift, _, _, force, impulse = rows
        angle = start.angle + start.speed * (time - start.time_ns / NS)
        self._lift.add(time, angle, lift)
        self._force.add(time, angle, force)
        ends = np.array([start.time_ns, end.time_ns]) / NS, np.array([start.angle, end.angle])
        self._zero.add(*ends, np.zeros(2))
        self._speed.add(ends[0][:1], ends[1][:1], np.array([start.speed]))
        self._angles[end.time_ns], self._end = end.angle, end
        frame = frame_mask(angle, start.speed / self._stage.scene.sample_rate.si)
        if frame.any():
            self._scene.frames(time[frame], angle[frame], lift[frame])
        landed = impulse > 0.0
        if landed.any():
            self._landings(time[landed], angle[landed], lift[landed], impulse[landed])

    def close(self) -> None:
        """Send what was collected."""
        for time_ns, level in self._levels:
            if time_ns in self._angles:
                angle = np.array([self._angles[time_ns]])
                self._level.add(np.array([time_ns / NS]), angle, np.array([level]))
        if self._end is not None and self._last is not None:
            at = np.array([self._end.time_ns / NS]), np.array([self._end.angle])
            self._speed.add(*at, np.array([self._last.speed]))
        for writer in (self._lift, self._force, self._zero, self._speed, self._level):
            writer.flush()

    def _step(self, state: CamState) -> None:
        """What changes with the cam or the speed."""
        last, self._last = self._last, state
        if last is None or state.cam != last.cam:
            self._scene.mount(state, self._profiles.get(state.cam))
        if last is None or (state.cam, state.speed) != (last.cam, last.speed):
            title = self._stage.cams[state.cam].title
            words = f"{title}, {state.speed * 30.0 / math.pi:.0f} rpm"
            self._scene.label(state, words)
            at = np.array([state.time_ns / NS]), np.array([state.angle])
            self._events(*at, [words], "INFO")

    def _landings(
        self, time: FloatArray, angle: FloatArray, lift: FloatArray, impulse: FloatArray
    ) -> None:
        points = rr.Scalars.columns(scalars=lift * series.LANDING.factor)
        self._stream.send_columns(series.LANDING.entity, time_columns(time, angle), points)
        self._events(time, angle, [f"landing, {value:.3g} N·s" for value in impulse], "WARN")

    def _events(self, time: FloatArray, angle: FloatArray, words: list[str], level: str) -> None:
        columns = rr.TextLog.columns(text=words, level=[level] * len(words))
        self._stream.send_columns(EVENTS, time_columns(time, angle), columns)
