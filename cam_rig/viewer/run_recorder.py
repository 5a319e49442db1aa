"""Recorder of a run for the Rerun viewer, with results by turn and speed."""

from __future__ import annotations

import math

import numpy as np
import rerun as rr

from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.schedule import CamState
from cam_rig.simulation.simulate import MeasuredTick
from cam_rig.units import NS, FloatArray
from cam_rig.viewer import level_chart
from cam_rig.viewer.level_chart import LevelChart
from cam_rig.viewer.quantities import TORSIONAL, SceneRanges, ShaftTwist
from cam_rig.viewer.run_view import ResultTable, RunView, about
from cam_rig.viewer.timeline import (
    Canvas,
    FramePace,
    TurnCollector,
    rig_time_alone,
    sample_angles,
    time_columns,
)

ABOUT = "about"
RESULTS = "results"
#: Rig time (s) whose samples are written to a file together: long enough to be fast, short enough
#: for the memory.
SEND_EVERY_S = 5.0


class RunRecorder:
    """Recorder that draws a run into a Rerun recording, tick by tick.

    `close` sends the remaining data. A tick is the time between two cam states.

    Parameters
    ----------
    stream : RecordingStream
        Recording to write.
    loaded : LoadedScene
        Scene of the run.
    bucket : int
        Number of samples of which the minimum and the maximum are kept.
    compared : float
        Speed in rpm at which the turns of the cams are overlaid and drawn side by side.
    ranges : SceneRanges
        Axis ranges of the quantities.
    draws_run : bool
        True if the run itself is drawn, too.
    pace : FramePace, optional
        Rate of the pictures of a live run. None for a finished run, whose results are drawn for
        every time.
    send_every : float
        Rig time in s after which data are sent at the end of the current tick.
    """

    def __init__(
        self,
        stream: rr.RecordingStream,
        loaded: LoadedScene,
        bucket: int,
        compared: float,
        ranges: SceneRanges,
        draws_run: bool = True,
        pace: FramePace | None = None,
        send_every: float = SEND_EVERY_S,
    ) -> None:
        self._canvas = Canvas(stream, time_columns if pace is None else rig_time_alone)
        self._loaded, self._compared, self._ranges = loaded, compared, ranges
        self._finished, self._send_every = pace is None, send_every
        self._run_view = RunView(self._canvas, loaded, bucket, ranges, pace) if draws_run else None
        self._levels = LevelChart(self._canvas, loaded)
        self._results = ResultTable(loaded)
        self._turns = TurnCollector(loaded.scene.schedule.ticks_per_turn)
        shaft = draws_run and loaded.scene.model == TORSIONAL
        self._twist = ShaftTwist(loaded) if shaft else None
        self._without_sound: dict[int, tuple[CamState, CamState]] = {}
        self._last: tuple[CamState, CamState] | None = None
        self._newest_sound: CamState | None = None
        self._sent = 0
        #: Contour of each cam received so far, in the cam's frame, m, shape (n, 2).
        self.profiles: dict[str, FloatArray] = {}
        level_chart.draw_turn_axes(self._canvas, loaded, compared, ranges.all_cams)
        document = rr.TextDocument(about(loaded, bucket), media_type="text/markdown")
        self._canvas.log_static(ABOUT, document)
        if not self._finished:
            self._canvas.set_style(RESULTS, rr.TextDocument, media_type="text/markdown")

    def tick(self, start: CamState, end: CamState, rows: FloatArray) -> None:
        """Draw one tick, the time between two successive cam states.

        `rows` contains its samples, shape (6, n): time (s), lift (m), velocity (m/s), acceleration
        (m/s²), contact force (N) and landing impulse (N·s).
        """
        last = self._last[0] if self._last is not None else start
        if (start.cam, start.speed) != (last.cam, last.speed):
            self._finish_step()
        self._last = self._without_sound[end.time_ns] = (start, end)
        angle, turn = sample_angles(start, end, rows[0]), None
        if self._twist is not None:
            rows = np.vstack([rows, self._twist.tick(start.cam, start.until(end), rows[0])])
        if start.is_steady_until(end):
            self._turns.add(start, angle, rows)
            turn = self._turns.turn()
        if self._run_view is not None:
            self._run_view.tick(start, end, angle, rows, turn, self.profiles[start.cam])
        if turn is not None:
            self._results.motion(turn)
        if (end.time_ns - self._sent) / NS >= self._send_every:
            self.flush()

    def sound(self, end_ns: int, level: float, pressure: float) -> None:
        """Draw sound level (dB) and r.m.s. pressure (Pa) of the tick that ended at a time.

        ``end_ns`` is its rig time in ns. A tick is the time between two cam states.
        """
        if end_ns not in self._without_sound:
            return  # the tick ended before this node subscribed
        start, end = self._without_sound.pop(end_ns)
        if self._run_view is not None:
            self._run_view.level(end, level)
        tick = MeasuredTick.between(start, end, pressure, int(self._loaded.scene.sample_rate.si))
        measured = self._levels.add(tick, end.unwrapped)
        if measured is not None:
            self._results.level(start.cam, start.speed, measured)
        self._newest_sound = end

    def show(self, until: float) -> None:
        """Send the pictures of cam and follower up to a rig time (s).

        Pictures that are later than the curves sent so far are kept for a later call.
        """
        if self._run_view is not None:
            self._run_view.show(min(until, self._sent / NS))

    def flush(self, until: float = math.inf) -> None:
        """Send all data to the recording, and the pictures up to a rig time (s).

        The curves of the run are sent first. A viewer that follows the run jumps to the newest time
        of any data, so no other data may be newer than the curves.
        """
        if self._run_view is not None:
            self._run_view.flush(until)
            self._levels.flush()
        if self._last is not None:
            self._sent = self._last[1].time_ns
        if self._newest_sound is not None and not self._finished:
            self._send_results("running", self._newest_sound)
            self._newest_sound = None

    def _send_results(self, state: str, cam_state: CamState) -> None:
        columns = rr.TextDocument.columns(text=[self._results.text(state)])
        self._canvas.rows(RESULTS, self._canvas.times_of(cam_state), columns)

    def close(self) -> None:
        """Draw the results of the last cam speed, and send the remaining data."""
        if self._last is not None:
            self._finish_step()
            if self._run_view is not None:
                self._run_view.close(self._last[1])
        self.flush()
        if self._finished:
            self._levels.finish()
            document = rr.TextDocument(self._results.text(), media_type="text/markdown")
            self._canvas.log_static(RESULTS, document)
        elif self._last is not None:
            self._send_results("finished", self._last[1])

    def _finish_step(self) -> None:
        turn = self._turns.turn()
        if turn is not None and math.isclose(turn.rpm, self._compared, rel_tol=1e-9):
            level_chart.draw_turn(self._canvas, self._loaded, turn, self._ranges.all_cams)
            profile = self.profiles[turn.cam]
            level_chart.draw_side_by_side(self._canvas, self._loaded, turn, profile)
