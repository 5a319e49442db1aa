"""A run into a Rerun recording: the run itself, and the results of its turns and speeds."""

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

ABOUT, RESULTS = "about", "results"
#: Rig time (s) into a file at once: long enough to be fast, short enough to stay small in memory.
SEND_EVERY_S = 5.0


class RunRecorder:
    """Draws a run tick by tick; `close` sends what is left.

    Of every ``bucket`` samples the minimum and the maximum are kept; at ``compared`` rpm the cams
    are laid over each other and put side by side; ``whole`` draws the run itself too. ``pace`` is
    of a live run; a finished one (None) has its results at every time. ``send_every`` is the rig
    time (s) that is sent at once at the most, and a tick.
    """

    def __init__(
        self,
        stream: rr.RecordingStream,
        loaded: LoadedScene,
        bucket: int,
        compared: float,
        ranges: SceneRanges,
        whole: bool = True,
        pace: FramePace | None = None,
        send_every: float = SEND_EVERY_S,
    ) -> None:
        self._canvas = Canvas(stream, time_columns if pace is None else rig_time_alone)
        self._loaded, self._compared, self._ranges = loaded, compared, ranges
        self._finished, self._send_every = pace is None, send_every
        self._run_view = RunView(self._canvas, loaded, bucket, ranges, pace) if whole else None
        self._levels = LevelChart(self._canvas, loaded)
        self._results = ResultTable(loaded)
        self._turns = TurnCollector(loaded.scene.program.ticks_per_turn)
        shaft = whole and loaded.scene.model == TORSIONAL
        self._twist = ShaftTwist(loaded) if shaft else None
        self._without_sound: dict[int, tuple[CamState, CamState]] = {}
        self._last: tuple[CamState, CamState] | None = None
        self._newest_sound: CamState | None = None
        self._sent = 0
        #: The contour of each cam received so far, ``(n, 2)`` in its own frame, m.
        self.profiles: dict[str, FloatArray] = {}
        level_chart.draw_turn_axes(self._canvas, loaded, compared, ranges.whole)
        words = rr.TextDocument(about(loaded, bucket), media_type="text/markdown")
        self._canvas.always(ABOUT, words)
        if not self._finished:
            self._canvas.look(RESULTS, rr.TextDocument, media_type="text/markdown")

    def tick(self, start: CamState, end: CamState, rows: FloatArray) -> None:
        """Draw one tick; ``rows`` are the ``(6, n)`` samples of its block."""
        last = self._last[0] if self._last is not None else start
        if (start.cam, start.speed) != (last.cam, last.speed):
            self._finish_step()
        self._last = self._without_sound[end.time_ns] = (start, end)
        angle, turn = sample_angles(start, end, rows[0]), None
        if self._twist is not None:
            rows = np.vstack([rows, self._twist.tick(start.cam, start.until(end), rows[0])])
        if start.holds_until(end):
            self._turns.add(start, angle, rows)
            turn = self._turns.turn()
        if self._run_view is not None:
            self._run_view.tick(start, end, angle, rows, turn, self.profiles[start.cam])
        if turn is not None:
            self._results.motion(turn)
        if (end.time_ns - self._sent) / NS >= self._send_every:
            self.flush()

    def sound(self, end_ns: int, level: float, pressure: float) -> None:
        """Take level (dB) and r.m.s. pressure (Pa) of the tick that ended at a rig time."""
        if end_ns not in self._without_sound:
            return  # of a tick from before we subscribed
        start, end = self._without_sound.pop(end_ns)
        if self._run_view is not None:
            self._run_view.level(end, level)
        tick = MeasuredTick.between(start, end, pressure, int(self._loaded.scene.sample_rate.si))
        measured = self._levels.add(tick, end.unwrapped)
        if measured is not None:
            self._results.level(start.cam, start.speed, measured)
        self._newest_sound = end

    def show(self, until: float) -> None:
        """Send pictures up to a rig time (s), as far as the curves are sent; nothing else."""
        if self._run_view is not None:
            self._run_view.show(min(until, self._sent / NS))

    def flush(self, until: float = math.inf) -> None:
        """Send all, the run first, for nothing may lead it; pictures up to a rig time (s)."""
        if self._run_view is not None:
            self._run_view.flush(until)
            self._levels.flush()
        if self._last is not None:
            self._sent = self._last[1].time_ns
        if self._newest_sound is not None and not self._finished:
            self._say("running", self._newest_sound)
            self._newest_sound = None

    def _say(self, state: str, at: CamState) -> None:
        columns = rr.TextDocument.columns(text=[self._results.words(state)])
        self._canvas.rows(RESULTS, self._canvas.state(at), columns)

    def close(self) -> None:
        """Send what is left, and finish the last step."""
        if self._last is not None:
            self._finish_step()
            if self._run_view is not None:
                self._run_view.close(self._last[1])
        self.flush()
        if self._finished:
            self._levels.finish()
            words = rr.TextDocument(self._results.words(), media_type="text/markdown")
            self._canvas.always(RESULTS, words)
        elif self._last is not None:
            self._say("finished", self._last[1])

    def _finish_step(self) -> None:
        turn = self._turns.turn()
        if turn is not None and math.isclose(turn.rpm, self._compared, rel_tol=1e-9):
            level_chart.draw_turn(self._canvas, self._loaded, turn, self._ranges.whole)
            profile = self.profiles[turn.cam]
            level_chart.draw_side_by_side(self._canvas, self._loaded, turn, profile)
