"""Noise against rpm as a picture that grows: published curves, and each step as it is measured.

Rerun's plots have time along x, so this one is drawn in the plane, with axes of its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import rerun as rr

from cam_rig.dynamics import FloatArray
from cam_rig.experiment.noise import HeardTick, step_levels
from cam_rig.experiment.stage import Stage
from cam_rig.view import colours
from cam_rig.view.timeline import time_columns

VIEW = "noise"
#: The plane's size, any unit.
WIDTH, HEIGHT = 160.0, 100.0
#: dB shown where nothing is published.
LEVELS = (50.0, 110.0)
RAD_S_TO_RPM = 30.0 / np.pi
LINE, THIN, POINT, UNSEEN = -1.2, -0.5, -3.0, -0.1
DASHES = 40


@dataclass(frozen=True)
class Axes:
    """From rpm and dB to the plane; y is down, as in Rerun."""

    rpm: tuple[float, float]
    level: tuple[float, float]

    @classmethod
    def of(cls, stage: Stage) -> Axes:
        """All speeds of the scene, and the published levels with room around them."""
        speeds = np.array(stage.scene.program.speeds.si_list) * RAD_S_TO_RPM
        low, high = float(speeds.min()), float(speeds.max())
        if high == low:
            low, high = low - 50.0, high + 50.0
        if stage.published is None:
            return cls((low, high), LEVELS)
        fine = np.linspace(low, high, 100)
        levels = np.array([stage.published.level(c, fine) for c in stage.published.regression_db])
        ends = 5.0 * np.floor(levels.min() / 5.0) - 5.0, 5.0 * np.ceil(levels.max() / 5.0) + 5.0
        return cls((low, high), (float(ends[0]), float(ends[1])))

    def place(self, rpm: FloatArray, level: FloatArray) -> FloatArray:
        """``(n, 2)`` points in the plane."""
        x = (rpm - self.rpm[0]) / (self.rpm[1] - self.rpm[0])
        y = (level - self.level[0]) / (self.level[1] - self.level[0])
        return np.column_stack([x * WIDTH, (1.0 - y) * HEIGHT])


class NoiseChart:
    """Draws the axes and what is published, then every step as far as it is measured."""

    def __init__(self, stream: rr.RecordingStream, stage: Stage) -> None:
        self._stream, self._stage, self._axes = stream, stage, Axes.of(stage)
        self._settle = stage.scene.program.settle_turns.si
        self._step: list[HeardTick] = []
        self._levels: dict[str, dict[float, float]] = {}
        self._new: dict[str, tuple[int, float]] = {}
        self._drawn: set[str] = set()
        self._draw_axes()
        if stage.published is not None:
            for cam in stage.published.regression_db:
                self._draw_published(cam)

    def hear(self, tick: HeardTick, end_angle: float) -> float | None:
        """Take the next tick; ``end_angle`` (rad) is the cam's at its end.

        Returns
        -------
        the level (dB) measured at this speed so far, None until it has settled
        """
        if self._step and (tick.start.cam, tick.start.speed) != (
            self._step[0].start.cam,
            self._step[0].start.speed,
        ):
            self._step = []
        self._step.append(tick)
        cam, speed = tick.start.cam, tick.start.speed
        level = step_levels(self._step, self._settle).get(cam, {}).get(speed)
        if level is not None:
            self._levels.setdefault(cam, {})[speed] = level
            self._new[cam] = tick.stop_ns, end_angle
        return level

    def flush(self) -> None:
        """Draw what was measured since."""
        for cam, (time_ns, angle) in self._new.items():
            self._draw_measured(cam, time_ns, angle)
        self._new = {}

    def _draw_measured(self, cam: str, time_ns: int, angle: float) -> None:
        steps = self._levels[cam]
        points = self._axes.place(np.array(list(steps)) * RAD_S_TO_RPM, np.array([*steps.values()]))
        columns = rr.Points2D.columns(positions=points).partition([len(points)])
        at = time_columns(np.array([time_ns * 1e-9]), np.array([angle]))
        entity = f"{VIEW}/measured/{cam}"
        if cam not in self._drawn:
            self._drawn.add(cam)
            style = rr.Points2D.from_fields(colors=colours.of_cam(self._stage, cam), radii=POINT)
            self._stream.log(entity, style, static=True)
        self._stream.send_columns(entity, at, columns)

    def _draw_published(self, cam: str) -> None:
        published = self._stage.published
        if published is None:
            return
        known = cam in self._stage.cams
        colour = colours.of_cam(self._stage, cam) if known else colours.GREY
        title = self._stage.cams[cam].title if known else cam
        rpm = np.linspace(*self._axes.rpm, 2 * DASHES)
        points = self._axes.place(rpm, published.level(cam, rpm))
        dashes = rr.LineStrips2D(list(points.reshape(DASHES, 2, 2)), colors=colour, radii=LINE)
        self._stream.log(f"{VIEW}/published/{cam}", dashes, static=True)
        beside = points[-1:] + np.array([0.13 * WIDTH, -0.04 * HEIGHT])
        name = rr.Points2D(beside, labels=[title], colors=colour, radii=UNSEEN)
        self._stream.log(f"{VIEW}/published/{cam}/name", name, static=True)

    def _draw_axes(self) -> None:
        (low, high), (least, most) = self._axes.rpm, self._axes.level
        frame = np.array([[low, most], [low, least], [high, least]])
        rpm, level = _round_steps(low, high), _round_steps(least, most)
        grid = [self._axes.place(np.array([low, high]), np.array([y, y])) for y in level]
        strips = [self._axes.place(*frame.T), *grid]
        lines = rr.LineStrips2D(strips, colors=colours.GREY, radii=THIN)
        self._stream.log(f"{VIEW}/axes", lines, static=True)
        under, left = np.array([0.0, 0.01 * HEIGHT]), np.array([-0.05 * WIDTH, -0.04 * HEIGHT])
        self._label("rpm", under + self._axes.place(rpm, np.full_like(rpm, least)), rpm, "rpm")
        self._label("level", left + self._axes.place(np.full_like(level, low), level), level, "dB")

    def _label(self, axis: str, at: FloatArray, values: FloatArray, unit: str) -> None:
        words = [f"{value:g}" for value in values]
        words[-1] += f" {unit}"
        points = rr.Points2D(at, labels=words, show_labels=True, colors=colours.GREY, radii=UNSEEN)
        self._stream.log(f"{VIEW}/axes/{axis}", points, static=True)


def _round_steps(low: float, high: float) -> FloatArray:
    """Four to eight round values from ``low`` to ``high``."""
    raw = (high - low) / 4.0
    power = 10.0 ** np.floor(np.log10(raw))
    step = float(max(f * power for f in (1.0, 2.0, 2.5, 5.0) if f * power <= raw))
    return np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1.0) * step
