"""Sound level against cam speed: the published curves, and each speed as it is simulated.

A finished run has its points from the start, small, and the larger ones grow over them.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import rerun as rr

from cam_rig.arrays import FloatArray
from cam_rig.drawing.cam_looks import of_cam
from cam_rig.drawing.words import in_words, shortened
from cam_rig.simulation.levels import MeasuredTick, step_levels
from cam_rig.simulation.loaded_scene import LoadedScene
from cam_rig.units import RPM_PER_RAD_S
from cam_rig.viewer.charts.axes import UNSEEN, Axes, round_marks
from cam_rig.viewer.charts.text_panels import MAX_TITLE
from cam_rig.viewer.timeline import Times, time_columns

VIEW = "noise"
#: dB shown where nothing is published.
LEVELS = (50.0, 110.0)
#: Radii on the screen: of dashes, of points as they come, of those of a finished run.
LINE, POINT, FINAL = -1.2, -4.0, -2.5
DASHES = 40
#: Of the plane, whose height is 100; of a letter and around a word in it, and from name to name.
WIDTH = 200.0
LETTER, AROUND, STEP = 4.4, 12.0, 10.0


def level_axes(loaded: LoadedScene) -> Axes:
    """All speeds of the scene, and the published levels with room around them."""
    speeds = np.array(loaded.scene.program.speeds.si_list) * RPM_PER_RAD_S
    low, high = float(speeds.min()), float(speeds.max())
    if high == low:
        low, high = low - 50.0, high + 50.0
    if loaded.published is None:
        return Axes((low, high), LEVELS, WIDTH)
    fine = np.linspace(low, high, 100)
    levels = np.array([loaded.published.level(c, fine) for c in loaded.published.regression_db])
    lowest, highest = 5.0 * np.floor(levels.min() / 5.0), 5.0 * np.ceil(levels.max() / 5.0)
    return Axes((low, high), (float(lowest) - 5.0, float(highest) + 5.0), WIDTH)


def shown_cams(loaded: LoadedScene) -> dict[str, str]:
    """Titles of the cams of the scene, then of those that are published only; long ones short."""
    others = () if loaded.published is None else loaded.published.regression_db
    words = {cam: in_words(cam) for cam in others if cam not in loaded.cams}
    titles = {name: cam.title for name, cam in loaded.cams.items()} | words
    return {name: shortened(title, MAX_TITLE) for name, title in titles.items()}


def beside(loaded: LoadedScene) -> float:
    """Room for the longest of these titles right of the axes, as a share of their width."""
    return (LETTER * max(map(len, shown_cams(loaded).values())) + AROUND) / WIDTH


def spread(places: FloatArray, step: float) -> FloatArray:
    """``(n,)`` places moved so that each is a step from the next, in their order.

    Examples
    --------
    >>> spread(np.array([5.0, 0.0, 4.0]), 2.0).tolist()
    [6.0, 0.0, 4.0]
    """
    moved, order = places.copy(), np.argsort(places, kind="stable")
    for before, at in pairwise(order):
        moved[at] = max(moved[at], moved[before] + step)
    return moved


class LevelChart:
    """Draws the axes and what is published, then every step as far as it is measured."""

    def __init__(
        self, stream: rr.RecordingStream, loaded: LoadedScene, times: Times = time_columns
    ) -> None:
        self._times = times
        self._stream, self._loaded, self._axes = stream, loaded, level_axes(loaded)
        self._settle = loaded.scene.program.settle_turns.si
        self._step: list[MeasuredTick] = []
        self._levels: dict[str, dict[float, float]] = {}
        self._new: dict[str, tuple[int, float]] = {}
        self._drawn: set[str] = set()
        self._named: dict[str, float] = {}
        rpm, level = round_marks(*self._axes.x, "rpm"), round_marks(*self._axes.y, "dB")
        self._axes.draw(stream, f"{VIEW}/axes", rpm, level)
        style = rr.Points2D.from_fields(radii=UNSEEN, show_labels=True)
        stream.log(f"{VIEW}/names", style, static=True)
        if loaded.published is not None:
            for cam in loaded.published.regression_db:
                self._draw_published(cam)
            self._draw_names(None)

    def add(self, tick: MeasuredTick, end_angle: float) -> float | None:
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
        if self._new and len(self._ends()) > len(self._named):
            self._draw_names(max(self._new.values()))
        self._new = {}

    def finish(self) -> None:
        """Draw all points so that they are there at every time, and on every timeline."""
        for cam in self._levels:
            colour = of_cam(cam)
            points = rr.Points2D(self._points(cam), colors=colour, radii=FINAL)
            self._stream.log(f"{VIEW}/final/{cam}", points, static=True)
        self._draw_names(None)

    def _ends(self) -> dict[str, float]:
        """The level (dB) at the last point of each cam: published, or measured so far."""
        published, ends = self._loaded.published, {}
        for cam in shown_cams(self._loaded):
            if published is not None and cam in published.regression_db:
                ends[cam] = float(published.level(cam, np.array([self._axes.x[1]]))[0])
            elif cam in self._levels:
                ends[cam] = self._levels[cam][max(self._levels[cam])]
        return ends

    def _draw_names(self, at: tuple[int, float] | None) -> None:
        """Each cam's name beside its last point; once for all, or from a time (ns) and angle on."""
        ends, titles = self._ends(), shown_cams(self._loaded)
        if not ends:
            return
        self._named = ends
        right = np.full(len(ends), self._axes.x[1])
        places = self._axes.place(right, np.array([*ends.values()]))
        places[:, 0] += 0.5 * beside(self._loaded) * self._axes.width
        places[:, 1] = spread(places[:, 1] - 0.04 * self._axes.height, STEP)
        names, shades = [titles[cam] for cam in ends], np.array([*map(of_cam, ends)], np.uint32)
        entity = f"{VIEW}/names"
        if at is None:
            words = rr.Points2D.from_fields(positions=places, labels=names, colors=shades)
            self._stream.log(entity, words, static=True)
            return
        columns = rr.Points2D.columns(positions=places, labels=names, colors=shades)
        times = self._times(np.array([at[0] * 1e-9]), np.array([at[1]]))
        self._stream.send_columns(entity, times, columns.partition([len(ends)]))

    def _draw_measured(self, cam: str, time_ns: int, angle: float) -> None:
        points = self._points(cam)
        columns = rr.Points2D.columns(positions=points).partition([len(points)])
        at = self._times(np.array([time_ns * 1e-9]), np.array([angle]))
        entity = f"{VIEW}/measured/{cam}"
        if cam not in self._drawn:
            self._drawn.add(cam)
            style = rr.Points2D.from_fields(colors=of_cam(cam), radii=POINT)
            self._stream.log(entity, style, static=True)
        self._stream.send_columns(entity, at, columns)

    def _points(self, cam: str) -> FloatArray:
        """``(n, 2)`` places of a cam's points so far."""
        steps = self._levels[cam]
        return self._axes.place(np.array(list(steps)) * RPM_PER_RAD_S, np.array([*steps.values()]))

    def _draw_published(self, cam: str) -> None:
        published = self._loaded.published
        if published is None:
            return
        colour = of_cam(cam)
        rpm = np.linspace(*self._axes.x, 2 * DASHES)
        points = self._axes.place(rpm, published.level(cam, rpm))
        dashes = rr.LineStrips2D(list(points.reshape(DASHES, 2, 2)), colors=colour, radii=LINE)
        self._stream.log(f"{VIEW}/published/{cam}", dashes, static=True)
