"""The time series of a run, tick by tick."""

from __future__ import annotations

import numpy as np
import rerun as rr

from cam_rig.arrays import FloatArray
from cam_rig.dynamics import MODELS
from cam_rig.laws.sampling import sample
from cam_rig.simulation.loaded_scene import LoadedScene
from cam_rig.simulation.schedule import CamState
from cam_rig.units import NS
from cam_rig.viewer.charts import series
from cam_rig.viewer.charts.series import Mark, SeriesLine, SeriesWriter
from cam_rig.viewer.charts.shaft_twist import TORSIONAL
from cam_rig.viewer.timeline import Times, time_columns
from cam_rig.viewer.turns import lift_offs

#: s alone, of s, s', s''.
LIFT_OF_LAW = np.array([[1.0, 0.0, 0.0]])


class TimeSeries:
    """Writes the curves and the marks on them.

    Parameters
    ----------
    bucket : samples of which the minimum and the maximum are kept, 1 for all
    times : the timelines of the curves
    """

    def __init__(
        self,
        stream: rr.RecordingStream,
        loaded: LoadedScene,
        bucket: int,
        times: Times = time_columns,
    ) -> None:
        self._loaded, self._flew = loaded, False
        thinned = [series.LIFT, series.LAW, series.VELOCITY, series.ACCELERATION, series.FORCE]
        if MODELS[loaded.scene.model].lifts_off:
            thinned.append(series.GAP)
        if loaded.scene.model == TORSIONAL:
            thinned.append(series.TWIST)
        whole = (series.ZERO, series.SPEED, series.LEVEL, series.LIFT_OFF, series.LANDING)
        self._writers: dict[SeriesLine | Mark, SeriesWriter] = {}
        for line in thinned:
            self._writers[line] = SeriesWriter(stream, line, bucket, times)
        for curve in whole:
            self._writers[curve] = SeriesWriter(stream, curve, times=times)

    def tick(self, start: CamState, end: CamState, angle: FloatArray, rows: FloatArray) -> None:
        """Take one tick: unwrapped cam ``angle`` (rad) and rows at its samples.

        They are the ``(6, n)`` of its block, and the twist (rad) below them where a shaft has it.
        """
        time, lift, velocity, acceleration, force, impulse = rows[:6]
        law = self._law(start, end, angle)
        for line, values in (
            (series.LIFT, lift),
            (series.LAW, law),
            (series.VELOCITY, velocity),
            (series.ACCELERATION, acceleration),
            (series.FORCE, force),
        ):
            self._writers[line].add(time, angle, values)
        if series.GAP in self._writers:
            gap = np.where(force == 0.0, lift - law, 0.0)
            self._writers[series.GAP].add(time, angle, gap)
        if series.TWIST in self._writers:
            self._writers[series.TWIST].add(time, angle, rows[6])
        ends = (
            np.array([start.time_ns, end.time_ns]) / NS,
            np.array([start.unwrapped, end.unwrapped]),
        )
        self._writers[series.ZERO].add(*ends, np.zeros(2))
        self._writers[series.SPEED].add(ends[0][:1], ends[1][:1], np.array([start.speed]))
        left, met = lift_offs(force, self._flew), impulse > 0.0
        self._flew = bool(force[-1] == 0.0)
        self._writers[series.LIFT_OFF].add(time[left], angle[left], lift[left])
        self._writers[series.LANDING].add(time[met], angle[met], lift[met])

    def level(self, end: CamState, level: float) -> None:
        """Take the level (dB) of the tick that ended with a state."""
        self._add(series.LEVEL, end, level)

    def stop(self, end: CamState, speed: float) -> None:
        """Draw the speed (rad/s) up to the end of the run."""
        self._add(series.SPEED, end, speed)

    def flush(self) -> None:
        """Send what was collected."""
        for writer in self._writers.values():
            writer.flush()

    def _add(self, line: series.SeriesLine, at: CamState, value: float) -> None:
        place = np.array([at.time_ns / NS]), np.array([at.unwrapped])
        self._writers[line].add(*place, np.array([value]))

    def _law(self, start: CamState, end: CamState, angle: FloatArray) -> FloatArray:
        law, step = self._loaded.laws[start.cam], start.speed / self._loaded.scene.sample_rate.si
        if not start.holds_until(end):
            return law(angle)
        return sample(law, float(angle[0]), step, angle.size, LIFT_OF_LAW, np.zeros(1))[0]
