"""Sound level against cam speed: the published curves, and each speed as it is simulated.

A finished run has its points from the start, small, and the larger ones grow over them.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import rerun as rr

from cam_rig.acoustics import RadiationParameters, level_db
from cam_rig.show.chart import UNSEEN, Axes, round_marks
from cam_rig.show.looks import in_words, of_cam, shortened
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.schedule import CamState
from cam_rig.simulation.simulate import MeasuredTick, StepLevels
from cam_rig.units import NS, RPM_PER_RAD_S, FloatArray
from cam_rig.viewer.quantities import GAP, LIFT, TWIST, VELOCITY, Drawn, Ranges, drawn_of
from cam_rig.viewer.scene2d import Scene2D, force_scale, frame_mask
from cam_rig.viewer.timeline import Canvas, Turn, within_turn
from cam_rig.viewer.turn_chart import MAX_TITLE, TurnAxes, curve, label
from cam_rig.viewer.turn_chart import WIDTH as TURN_WIDTH

VIEW = "noise"
#: dB shown where nothing is published.
LEVELS = (50.0, 110.0)
#: Radii on the screen: of dashes, of points as they come, of those of a finished run.
LINE, POINT, FINAL = -1.2, -4.0, -2.5
DASHES = 40
#: Of the plane, whose height is 100; of a letter and around a word in it, and from name to name.
WIDTH = 200.0
LETTER, AROUND, STEP = 4.4, 12.0, 10.0


def speed_ends(loaded: LoadedScene) -> tuple[float, float]:
    """From and to (rpm) of an axis of all speeds of the scene."""
    speeds = np.array(loaded.scene.program.speeds.si_list) * RPM_PER_RAD_S
    low, high = float(speeds.min()), float(speeds.max())
    return (low, high) if high > low else (low - 50.0, high + 50.0)


def level_axes(loaded: LoadedScene) -> Axes:
    """All speeds of the scene, and the published levels with room around them."""
    low, high = speed_ends(loaded)
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
    """``(n,)`` places moved up so that each is a step from the next, in their order."""
    moved, order = places.copy(), np.argsort(places, kind="stable")
    for before, at in pairwise(order):
        moved[at] = max(moved[at], moved[before] + step)
    return moved


class LevelChart:
    """Draws the axes and what is published, then every step as far as it is measured."""

    def __init__(self, canvas: Canvas, loaded: LoadedScene) -> None:
        self._canvas, self._loaded, self._axes = canvas, loaded, level_axes(loaded)
        self._measured = StepLevels(loaded.scene.program.settle_turns.si)
        self._new: dict[str, tuple[int, float]] = {}
        self._drawn: set[str] = set()
        self._named: dict[str, float] = {}
        marks = round_marks(*self._axes.x, "rpm"), round_marks(*self._axes.y, "dB")
        self._axes.draw(canvas.stream, f"{VIEW}/axes", *marks)
        canvas.look(f"{VIEW}/names", rr.Points2D, radii=UNSEEN, show_labels=True)
        if loaded.published is not None:
            rpm = np.linspace(*self._axes.x, 2 * DASHES)
            for cam in loaded.published.regression_db:
                points = self._axes.place(rpm, loaded.published.level(cam, rpm))
                strips = list(points.reshape(DASHES, 2, 2))
                dashes = rr.LineStrips2D(strips, colors=of_cam(cam), radii=LINE)
                canvas.always(f"{VIEW}/published/{cam}", dashes)
            self._draw_names(None)

    def add(self, tick: MeasuredTick, end_angle: float) -> float | None:
        """The level (dB) with the next tick, which ends at an angle (rad); None until settled."""
        level = self._measured.add(tick)
        if level is not None:
            self._new[tick.start.cam] = tick.stop_ns, end_angle
        return level

    def flush(self) -> None:
        """Draw what was measured since."""
        for cam, (time_ns, angle) in self._new.items():
            entity = f"{VIEW}/measured/{cam}"
            if cam not in self._drawn:
                self._drawn.add(cam)
                self._canvas.look(entity, rr.Points2D, colors=of_cam(cam), radii=POINT)
            self._canvas.points(entity, self._canvas.at(time_ns / NS, angle), self._points(cam))
        if self._new and len(self._ends()) > len(self._named):
            self._draw_names(max(self._new.values()))
        self._new = {}

    def finish(self) -> None:
        """Draw all points so that they are there at every time, and on every timeline."""
        for cam in self._measured.levels:
            points = rr.Points2D(self._points(cam), colors=of_cam(cam), radii=FINAL)
            self._canvas.always(f"{VIEW}/final/{cam}", points)
        self._draw_names(None)

    def _ends(self) -> dict[str, float]:
        """The level (dB) at the last point of each cam: published, or measured so far."""
        published, ends = self._loaded.published, {}
        for cam in shown_cams(self._loaded):
            if published is not None and cam in published.regression_db:
                ends[cam] = float(published.level(cam, np.array([self._axes.x[1]]))[0])
            elif cam in self._measured.levels:
                ends[cam] = self._measured.levels[cam][max(self._measured.levels[cam])]
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
        shades = np.array([*map(of_cam, ends)], np.uint32)
        words: dict[str, Any] = {"labels": [titles[cam] for cam in ends], "colors": shades}
        if at is None:
            self._canvas.look(f"{VIEW}/names", rr.Points2D, positions=places, **words)
        else:
            self._canvas.points(
                f"{VIEW}/names", self._canvas.at(at[0] / NS, at[1]), places, **words
            )

    def _points(self, cam: str) -> FloatArray:
        """``(n, 2)`` places of a cam's points so far."""
        steps = self._measured.levels[cam]
        return self._axes.place(np.array(list(steps)) * RPM_PER_RAD_S, np.array([*steps.values()]))


# The sound of the last turn in third-octave bands.

#: Band numbers 10 lg(f/Hz): 5 is 3.15 Hz, slower than any turn's own frequency.
LOWEST_BAND = 5
#: Below this no bar is drawn, Pa²: 0 dB.
SILENCE = 4e-10


def band_numbers(sample_rate: float) -> FloatArray:
    """10 lg(f/Hz) of all bands up to half the sample rate (Hz)."""
    highest = int(np.floor(10.0 * np.log10(sample_rate / 2.0)))
    return np.arange(LOWEST_BAND, highest + 1, dtype=np.float64)


def third_octaves(
    parameters: RadiationParameters, force: FloatArray, impulse: FloatArray, sample_rate: float
) -> FloatArray:
    """Level (dB re 20 µPa, 0 at least) in each band, of a turn's force (N) and impulses (N·s)."""
    power = band_power(parameters, force, impulse, sample_rate)
    return level_db(np.sqrt(np.maximum(power, SILENCE)))


def band_power(
    parameters: RadiationParameters, force: FloatArray, impulse: FloatArray, sample_rate: float
) -> FloatArray:
    """Mean square sound pressure (Pa²) in each band; their sum is that of the turn."""
    frequency = np.asarray(np.fft.rfftfreq(force.size, 1.0 / sample_rate), dtype=np.float64)
    with np.errstate(divide="ignore"):  # the constant does not sound
        ratio = np.minimum(parameters.corner / frequency, 1e150)
    transfer = parameters.gain * parameters.corner_rate / (1.0 - 1j * ratio)
    # a half sine of unit area, cos(πx)/(1 − 4x²) as two sinc's, which has no 0/0 at x = 1/2
    x = parameters.contact_time * frequency
    pulse = 0.25 * np.pi * (np.sinc(x - 0.5) + np.sinc(x + 0.5))
    lines = np.fft.rfft(force) + np.fft.rfft(impulse) * sample_rate * pulse
    power = 2.0 * np.abs(transfer * lines / force.size) ** 2
    if force.size % 2 == 0:  # the line at half the sample rate is its own mirror
        power[-1] *= 0.5
    numbers = band_numbers(sample_rate)
    band = np.rint(10.0 * np.log10(frequency[1:])).clip(numbers[0], numbers[-1]) - numbers[0]
    return np.bincount(band.astype(np.int64), power[1:], numbers.size).astype(np.float64)


# Third-octave bars in the plane: one scale for all cams and speeds, so that they compare.

#: dB shown, the same wherever bars are drawn; what is louder ends at the upper edge.
BAND_LEVELS = (0.0, 110.0)
#: Height of the plane over its width, and width of a bar over that of its band.
SHAPE, BAR = 0.42, 0.8
#: Radius of a bar's outline on the screen.
BAND_LINE = -1.0
#: Bands that are named, by number.
NAMED = {10.0: "10 Hz", 20.0: "100 Hz", 30.0: "1 kHz", 40.0: "10 kHz"}


def band_axes(sample_rate: float) -> Axes:
    """Bands up to half the sample rate (Hz) along x, each as wide as the next; dB along y."""
    numbers = band_numbers(sample_rate)
    ends = float(numbers[0]) - 0.5, float(numbers[-1]) + 0.5
    return Axes(ends, BAND_LEVELS, height=SHAPE * 160.0)


class BandChart:
    """Draws the axes into a view, then bars as they come; `flush` sends them."""

    def __init__(self, canvas: Canvas, view: str, rate: float, colour: int) -> None:
        self._canvas, self._entity, self._rate = canvas, f"{view}/bars", rate
        self._axes, self._waiting = band_axes(rate), list[tuple[float, float, FloatArray]]()
        named = {number: words for number, words in NAMED.items() if number <= self._axes.x[1]}
        self._axes.draw(canvas.stream, f"{view}/axes", named, round_marks(*BAND_LEVELS, "dB"))
        canvas.look(self._entity, rr.LineStrips2D, colors=colour, radii=BAND_LINE)

    def add(self, time: float, angle: float, levels: FloatArray) -> None:
        """Take the bands' levels (dB) from rig time (s) and unwrapped cam angle (rad) on."""
        self._waiting.append((time, angle, levels))

    def flush(self) -> None:
        """Send what was taken."""
        if not self._waiting:
            return
        time, angle, levels = zip(*self._waiting, strict=True)
        self._waiting = []
        columns = rr.LineStrips2D.columns(strips=[self._skyline(some) for some in levels])
        times = self._canvas.times(np.array(time), np.array(angle))
        self._canvas.rows(self._entity, times, columns)

    def draw_once(self, levels: FloatArray) -> None:
        """Draw bars that stay."""
        self._canvas.look(self._entity, rr.LineStrips2D, strips=[self._skyline(levels)])

    def _skyline(self, levels: FloatArray) -> FloatArray:
        """``(4n, 2)`` of n bands as one strip: Rerun takes a strip a bar thirty times as slowly."""
        numbers, low = band_numbers(self._rate), np.full(levels.size, BAND_LEVELS[0])
        left, right, top = numbers - 0.5 * BAR, numbers + 0.5 * BAR, levels.clip(*BAND_LEVELS)
        corners = [(left, low), (left, top), (right, top), (right, low)]
        return np.stack([self._axes.place(*corner) for corner in corners], axis=1).reshape(-1, 2)


# Turns laid over each other, and cams side by side at one speed.

TURNS, COMPARE = "turns", "compare"
#: Height of the axes, of their width 160.
ROW = 80.0
#: Cams whose names stand in a line over the axes, and from line to line.
NAMES_IN_LINE, NAME_STEP = 2, 11.0
#: Radius of a curve on the screen.
STROKE = -0.9


def compared_of(loaded: LoadedScene) -> tuple[Drawn, ...]:
    """The quantities that are laid over each other."""
    return tuple(row for row in drawn_of(loaded.scene.model) if row not in (VELOCITY, GAP, TWIST))


def at_speed(rpm: float, quantity: str) -> str:
    """The view in which every cam has its curve of a quantity at a speed."""
    return f"{TURNS}/{rpm:.6g}_rpm/{quantity}"


def turn_axes(row: Drawn, ranges: Ranges) -> TurnAxes:
    """The axes in which all cams have their curve of one quantity."""
    return TurnAxes([row], ranges, ROW)


def names_height(loaded: LoadedScene) -> float:
    """Room for the cams' names over the axes, which no curve reaches."""
    return -(-len(loaded.cams) // NAMES_IN_LINE) * NAME_STEP


def draw_turn_axes(canvas: Canvas, loaded: LoadedScene, rpm: float, ranges: Ranges) -> None:
    """Draw the axes, their cursor on the timeline of degrees, and each cam's name in its colour."""
    degrees = np.arange(360.0)
    for row in compared_of(loaded):
        view = at_speed(rpm, row.key)
        axes = turn_axes(row, ranges)
        axes.draw(canvas, view, titled=False)
        axes.draw_marks(canvas, view)
        turned = np.radians(degrees)
        axes.move_cursor(canvas, view, within_turn(degrees, turned), turned)
    lines = names_height(loaded) / NAME_STEP
    for i, (name, cam) in enumerate(loaded.cams.items()):
        line, column = divmod(i, NAMES_IN_LINE)
        at = (column + 0.5) * TURN_WIDTH / NAMES_IN_LINE, (line - lines) * NAME_STEP
        where = f"{at_speed(rpm, LIFT.key)}/lift/names/{name}"
        label(canvas, where, at, shortened(cam.title, MAX_TITLE), of_cam(name))


def draw_turn(canvas: Canvas, loaded: LoadedScene, turn: Turn, ranges: Ranges) -> None:
    """Curves of one turn over the angle within it."""
    for row in compared_of(loaded):
        values = getattr(turn, row.key) * row.line.factor
        points = curve(turn_axes(row, ranges), row.key, turn.angle, values)
        line = rr.LineStrips2D([points], colors=of_cam(turn.cam), radii=STROKE)
        canvas.always(f"{at_speed(turn.rpm, row.key)}/{row.key}/{turn.cam}", line)


def draw_side_by_side(canvas: Canvas, loaded: LoadedScene, turn: Turn, profile: FloatArray) -> None:
    """A cam under its follower, and third-octave bands, of one turn, in a view of its own."""
    view, rate = f"{COMPARE}/{turn.cam}", loaded.scene.sample_rate.si
    scale = force_scale(loaded, turn.speed)
    within = Canvas(canvas.stream, within_turn)
    scene = Scene2D(within, loaded, f"{view}/scene", scale=scale)
    begin = CamState(0, 0.0, turn.speed, turn.cam)
    scene.mount(begin, profile)
    scene.speed(begin)
    frame = frame_mask(turn.angle, turn.speed / rate)
    scene.frames(turn.time[frame], turn.angle[frame], turn.lift[frame], turn.force[frame])
    scene.flush()
    bands = third_octaves(loaded.radiation, turn.force, turn.impulse, rate)
    BandChart(canvas, f"{view}/bands", rate, of_cam(turn.cam)).draw_once(bands)
