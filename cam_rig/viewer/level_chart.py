"""Chart of the published and the simulated sound level over the cam speed.

The recording of a finished run shows small points at every time. Larger points appear over them as
the time cursor advances.
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
from cam_rig.viewer.quantities import GAP, LIFT, TWIST, VELOCITY, PlotRow, Ranges, plot_rows
from cam_rig.viewer.scene2d import Scene2D, force_scale, frame_mask
from cam_rig.viewer.timeline import Canvas, Turn, within_turn
from cam_rig.viewer.turn_chart import MAX_TITLE, TurnAxes, curve, label
from cam_rig.viewer.turn_chart import WIDTH as TURN_WIDTH

VIEW = "noise"
#: Range of the axis of sound levels (dB) if the scene has no published curves.
LEVELS = (50.0, 110.0)
#: Radius of a dash of a published curve. Rerun interprets a negative radius in points of the
#: screen.
LINE = -1.2
#: Radius of a point of a run in progress, in points of the screen (negative for Rerun).
POINT = -4.0
#: Radius of a point of a finished run, in points of the screen (negative for Rerun).
FINAL = -2.5
#: Number of dashes with which a published curve is drawn.
DASHES = 40
#: Width of the drawing plane of the chart of sound levels, whose height is 100.
WIDTH = 200.0
#: Width of a letter of a cam's name, in the units of the plane of the chart.
LETTER = 4.4
#: Total free space left and right of a cam's name, in the units of the plane of the chart.
AROUND = 12.0
#: Smallest vertical distance between the names of two cams, in the units of the plane.
TITLE_DISTANCE = 10.0


def speed_ends(loaded: LoadedScene) -> tuple[float, float]:
    """Return the limits (rpm) of an axis that contains all speeds of the scene."""
    speeds = np.array(loaded.scene.schedule.speeds.si_list) * RPM_PER_RAD_S
    low, high = float(speeds.min()), float(speeds.max())
    return (low, high) if high > low else (low - 50.0, high + 50.0)


def level_axes(loaded: LoadedScene) -> Axes:
    """Return the axes of the level chart: cam speed (rpm) and sound level (dB).

    They contain the speeds of the scene, and the published levels with a margin of at least 5 dB.
    Without published curves the limits of the levels are `LEVELS`.
    """
    low, high = speed_ends(loaded)
    if loaded.published is None:
        return Axes((low, high), LEVELS, WIDTH)
    fine = np.linspace(low, high, 100)
    levels = np.array([loaded.published.level(c, fine) for c in loaded.published.regression_db])
    lowest, highest = 5.0 * np.floor(levels.min() / 5.0), 5.0 * np.ceil(levels.max() / 5.0)
    return Axes((low, high), (float(lowest) - 5.0, float(highest) + 5.0), WIDTH)


def displayed_titles(loaded: LoadedScene) -> dict[str, str]:
    """Return the shortened titles of the scene's cams, then of other published cams.

    The key is the name of the cam.
    """
    published_cams = () if loaded.published is None else loaded.published.regression_db
    published_titles = {cam: in_words(cam) for cam in published_cams if cam not in loaded.cams}
    titles = {name: cam.title for name, cam in loaded.cams.items()} | published_titles
    return {name: shortened(title, MAX_TITLE) for name, title in titles.items()}


def names_width(loaded: LoadedScene) -> float:
    """Return the width of the longest title of a cam, with the spaces around it.

    It is a fraction of the width of the axes.
    """
    return (LETTER * max(map(len, displayed_titles(loaded).values())) + AROUND) / WIDTH


def spread_apart(positions: FloatArray, step: float) -> FloatArray:
    """Return positions ``(n,)`` shifted up to be `step` or more apart.

    The order of the positions is unchanged.
    """
    shifted, order = positions.copy(), np.argsort(positions, kind="stable")
    for previous, current in pairwise(order):
        shifted[current] = max(shifted[current], shifted[previous] + step)
    return shifted


class LevelChart:
    """Chart of the published level curves and the levels measured so far."""

    def __init__(self, canvas: Canvas, loaded: LoadedScene) -> None:
        self._canvas, self._loaded, self._axes = canvas, loaded, level_axes(loaded)
        self._measured = StepLevels(loaded.scene.schedule.transient_turns.si)
        self._new: dict[str, tuple[int, float]] = {}
        self._drawn: set[str] = set()
        self._named: dict[str, float] = {}
        marks = round_marks(*self._axes.x, "rpm"), round_marks(*self._axes.y, "dB")
        self._axes.draw(canvas.stream, f"{VIEW}/axes", *marks)
        canvas.set_style(f"{VIEW}/names", rr.Points2D, radii=UNSEEN, show_labels=True)
        if loaded.published is not None:
            rpm = np.linspace(*self._axes.x, 2 * DASHES)
            for cam in loaded.published.regression_db:
                points = self._axes.place(rpm, loaded.published.level(cam, rpm))
                strips = list(points.reshape(DASHES, 2, 2))
                dashes = rr.LineStrips2D(strips, colors=of_cam(cam), radii=LINE)
                canvas.log_static(f"{VIEW}/published/{cam}", dashes)
            self._draw_names(None)

    def add(self, tick: MeasuredTick, end_angle: float) -> float | None:
        """Add a tick that ends at a cam angle (rad), and return the mean sound level (dB).

        A tick is the time between two cam states. The mean is that of the present cam and speed.
        Returns None unless the tick completes a turn after the transient turns of the scene.
        """
        level = self._measured.add(tick)
        if level is not None:
            self._new[tick.start.cam] = tick.stop_ns, end_angle
        return level

    def flush(self) -> None:
        """Draw the points of the sound levels that were measured since the last call."""
        for cam, (time_ns, angle) in self._new.items():
            entity = f"{VIEW}/measured/{cam}"
            if cam not in self._drawn:
                self._drawn.add(cam)
                self._canvas.set_style(entity, rr.Points2D, colors=of_cam(cam), radii=POINT)
            self._canvas.points(
                entity, self._canvas.times_at(time_ns / NS, angle), self._points(cam)
            )
        if self._new and len(self._ends()) > len(self._named):
            self._draw_names(max(self._new.values()))
        self._new = {}

    def finish(self) -> None:
        """Draw the points of all sound levels as static data, visible at every time."""
        for cam in self._measured.levels:
            points = rr.Points2D(self._points(cam), colors=of_cam(cam), radii=FINAL)
            self._canvas.log_static(f"{VIEW}/final/{cam}", points)
        self._draw_names(None)

    def _ends(self) -> dict[str, float]:
        """Return the level (dB) at the last published or measured point of each cam.

        The key is the name of the cam, which is drawn next to this point.
        """
        published, ends = self._loaded.published, {}
        for cam in displayed_titles(self._loaded):
            if published is not None and cam in published.regression_db:
                ends[cam] = float(published.level(cam, np.array([self._axes.x[1]]))[0])
            elif cam in self._measured.levels:
                ends[cam] = self._measured.levels[cam][max(self._measured.levels[cam])]
        return ends

    def _draw_names(self, start: tuple[int, float] | None) -> None:
        """Draw the name of each cam next to its last point.

        If `start` is a time (ns) and a cam angle (rad), the names appear from there on. If it is
        None, they are static data, visible at every time.
        """
        ends, titles = self._ends(), displayed_titles(self._loaded)
        if not ends:
            return
        self._named = ends
        right = np.full(len(ends), self._axes.x[1])
        positions = self._axes.place(right, np.array([*ends.values()]))
        positions[:, 0] += 0.5 * names_width(self._loaded) * self._axes.width
        positions[:, 1] = spread_apart(positions[:, 1] - 0.04 * self._axes.height, TITLE_DISTANCE)
        colours = np.array([*map(of_cam, ends)], np.uint32)
        style: dict[str, Any] = {"labels": [titles[cam] for cam in ends], "colors": colours}
        if start is None:
            self._canvas.set_style(f"{VIEW}/names", rr.Points2D, positions=positions, **style)
        else:
            self._canvas.points(
                f"{VIEW}/names", self._canvas.times_at(start[0] / NS, start[1]), positions, **style
            )

    def _points(self, cam: str) -> FloatArray:
        """Return the positions of a cam's measured sound levels in the chart, (n, 2)."""
        steps = self._measured.levels[cam]
        return self._axes.place(np.array(list(steps)) * RPM_PER_RAD_S, np.array([*steps.values()]))


# Sound of the last turn in third-octave bands.

#: Number 10 lg(f/Hz) of the lowest third-octave band: 5 is 3.15 Hz, below the rotation frequency of
#: every run.
LOWEST_BAND = 5
#: Mean square sound pressure (Pa²) of 0 dB, the lowest level that a bar shows.
SILENCE = 4e-10


def band_numbers(sample_rate: float) -> FloatArray:
    """Return the numbers of the third-octave bands up to half a sample rate.

    The number of a band is 10 lg(f/Hz), with its centre frequency f. `sample_rate` is in Hz.
    """
    highest = int(np.floor(10.0 * np.log10(sample_rate / 2.0)))
    return np.arange(LOWEST_BAND, highest + 1, dtype=np.float64)


def third_octaves(
    parameters: RadiationParameters, force: FloatArray, impulse: FloatArray, sample_rate: float
) -> FloatArray:
    """Return the level in each third-octave band (dB re 20 µPa, at least 0).

    The parameters are those of `band_power`.
    """
    power = band_power(parameters, force, impulse, sample_rate)
    return level_db(np.sqrt(np.maximum(power, SILENCE)))


def band_power(
    parameters: RadiationParameters, force: FloatArray, impulse: FloatArray, sample_rate: float
) -> FloatArray:
    """Return the mean square sound pressure (Pa²) of a turn in each third-octave band.

    The sum over the bands is the mean square sound pressure of the turn.

    Parameters
    ----------
    parameters : RadiationParameters
        Radiation of the rig.
    force, impulse : ndarray
        Contact force (N) and landing impulses (N·s) of the samples of one turn, shape (n,).
    sample_rate : float
        Sample rate in Hz.
    """
    frequency = np.asarray(np.fft.rfftfreq(force.size, 1.0 / sample_rate), dtype=np.float64)
    with np.errstate(divide="ignore"):  # the constant force radiates no sound
        ratio = np.minimum(parameters.corner_frequency / frequency, 1e150)
    transfer = parameters.gain * parameters.corner_rate / (1.0 - 1j * ratio)
    # Spectrum of a half sine of unit area: cos(πx)/(1 − 4x²) as a sum of two sinc functions, which
    # avoids 0/0 at x = 1/2.
    x = parameters.contact_time * frequency
    pulse = 0.25 * np.pi * (np.sinc(x - 0.5) + np.sinc(x + 0.5))
    lines = np.fft.rfft(force) + np.fft.rfft(impulse) * sample_rate * pulse
    power = 2.0 * np.abs(transfer * lines / force.size) ** 2
    if force.size % 2 == 0:  # no mirror image of the highest line
        power[-1] *= 0.5
    numbers = band_numbers(sample_rate)
    band = np.rint(10.0 * np.log10(frequency[1:])).clip(numbers[0], numbers[-1]) - numbers[0]
    return np.bincount(band.astype(np.int64), power[1:], numbers.size).astype(np.float64)


# Third-octave bars in the plane, with one scale for all cams and speeds.

#: Range of the level axis of every bar chart, dB. Louder bars are cut at the upper edge.
BAND_LEVELS = (0.0, 110.0)
#: Height of the drawing plane of the bar chart, relative to its width.
SHAPE = 0.42
#: Width of a bar, relative to the width of its band.
BAR = 0.8
#: Radius of the outline of a bar, in points of the screen (negative for Rerun).
BAND_LINE = -1.0
#: Labels of the frequency axis: number of the third-octave band, 10 lg(f/Hz) -> label.
BAND_LABELS = {10.0: "10 Hz", 20.0: "100 Hz", 30.0: "1 kHz", 40.0: "10 kHz"}


def band_axes(sample_rate: float) -> Axes:
    """Return the axes of a chart of third-octave bands: band number, and level in dB.

    The bands are those up to half of `sample_rate` (Hz). All bands have the same width.
    """
    numbers = band_numbers(sample_rate)
    ends = float(numbers[0]) - 0.5, float(numbers[-1]) + 0.5
    return Axes(ends, BAND_LEVELS, height=SHAPE * 160.0)


class BandChart:
    """Bar chart of the levels in third-octave bands in a view.

    Added bars are kept until `flush` sends them to the recording.
    """

    def __init__(self, canvas: Canvas, view: str, rate: float, colour: int) -> None:
        self._canvas, self._entity, self._rate = canvas, f"{view}/bars", rate
        self._axes, self._waiting = band_axes(rate), list[tuple[float, float, FloatArray]]()
        labels = {
            number: label for number, label in BAND_LABELS.items() if number <= self._axes.x[1]
        }
        self._axes.draw(canvas.stream, f"{view}/axes", labels, round_marks(*BAND_LEVELS, "dB"))
        canvas.set_style(self._entity, rr.LineStrips2D, colors=colour, radii=BAND_LINE)

    def add(self, time: float, angle: float, levels: FloatArray) -> None:
        """Add bars for the levels (dB) of all bands.

        They appear from a rig time (s) and an unwrapped cam angle (rad) on.
        """
        self._waiting.append((time, angle, levels))

    def flush(self) -> None:
        """Send the bars of levels that were added since the last call to the recording."""
        if not self._waiting:
            return
        time, angle, levels = zip(*self._waiting, strict=True)
        self._waiting = []
        columns = rr.LineStrips2D.columns(
            strips=[self._skyline(band_levels) for band_levels in levels]
        )
        times = self._canvas.times(np.array(time), np.array(angle))
        self._canvas.rows(self._entity, times, columns)

    def draw_once(self, levels: FloatArray) -> None:
        """Draw bars for the levels (dB) of all bands as static data.

        Static data are visible at every time.
        """
        self._canvas.set_style(self._entity, rr.LineStrips2D, strips=[self._skyline(levels)])

    def _skyline(self, levels: FloatArray) -> FloatArray:
        """Return the outline of n bars as one strip, shape (4n, 2).

        One strip per bar would be thirty times slower in Rerun.
        """
        numbers, low = band_numbers(self._rate), np.full(levels.size, BAND_LEVELS[0])
        left, right, top = numbers - 0.5 * BAR, numbers + 0.5 * BAR, levels.clip(*BAND_LEVELS)
        corners = [(left, low), (left, top), (right, top), (right, low)]
        return np.stack([self._axes.place(*corner) for corner in corners], axis=1).reshape(-1, 2)


# Overlaid turns, and cams side by side at one speed.

TURNS = "turns"
COMPARE = "compare"
#: Height of the axes of overlaid turns, in the units of the plane, whose width is 160.
ROW = 80.0
#: Number of cam names per line of the names above the axes of overlaid turns.
NAMES_IN_LINE = 2
#: Vertical distance between two lines of cam names, in the units of the plane.
NAME_STEP = 11.0
#: Radius of a curve of the overlaid turns, in points of the screen (negative for Rerun).
STROKE = -0.9


def compared_of(loaded: LoadedScene) -> tuple[PlotRow, ...]:
    """Return the quantities whose curves over a turn are overlaid for all cams."""
    return tuple(row for row in plot_rows(loaded.scene.model) if row not in (VELOCITY, GAP, TWIST))


def at_speed(rpm: float, quantity: str) -> str:
    """Return the entity path of the view of all cams' curves at a speed.

    `rpm` is the speed, and `quantity` the key of the drawn quantity.
    """
    return f"{TURNS}/{rpm:.6g}_rpm/{quantity}"


def turn_axes(row: PlotRow, ranges: Ranges) -> TurnAxes:
    """Return the axes on which the curves of one quantity are overlaid for all cams.

    `ranges` contains the limits of each quantity's axis.
    """
    return TurnAxes([row], ranges, ROW)


def names_height(loaded: LoadedScene) -> float:
    """Return the height of the space for the cams' names above the axes."""
    return -(-len(loaded.cams) // NAMES_IN_LINE) * NAME_STEP


def draw_turn_axes(canvas: Canvas, loaded: LoadedScene, rpm: float, ranges: Ranges) -> None:
    """Draw the axes of the overlaid turns, their cursor, and the cams' names.

    The cursor is a vertical line that moves over the cam angle as the recording is played. `rpm` is
    the speed at which the cams are compared.
    """
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
        position = (column + 0.5) * TURN_WIDTH / NAMES_IN_LINE, (line - lines) * NAME_STEP
        entity = f"{at_speed(rpm, LIFT.key)}/lift/names/{name}"
        label(canvas, entity, position, shortened(cam.title, MAX_TITLE), of_cam(name))


def draw_turn(canvas: Canvas, loaded: LoadedScene, turn: Turn, ranges: Ranges) -> None:
    """Draw the curves of one turn over the angle within the turn, one per quantity."""
    for row in compared_of(loaded):
        values = getattr(turn, row.key) * row.line.factor
        points = curve(turn_axes(row, ranges), row.key, turn.angle, values)
        line = rr.LineStrips2D([points], colors=of_cam(turn.cam), radii=STROKE)
        canvas.log_static(f"{at_speed(turn.rpm, row.key)}/{row.key}/{turn.cam}", line)


def draw_side_by_side(canvas: Canvas, loaded: LoadedScene, turn: Turn, profile: FloatArray) -> None:
    """Draw one turn of a cam in a separate view: moving picture and sound.

    The picture shows cam and follower. The sound is shown in third-octave bands. `profile` is the
    contour of the cam in m, shape (n, 2).
    """
    view, rate = f"{COMPARE}/{turn.cam}", loaded.scene.sample_rate.si
    scale = force_scale(loaded, turn.speed)
    turn_canvas = Canvas(canvas.stream, within_turn)
    scene = Scene2D(turn_canvas, loaded, f"{view}/scene", scale=scale)
    start = CamState(0, 0.0, turn.speed, turn.cam)
    scene.mount(start, profile)
    scene.speed(start)
    frame = frame_mask(turn.angle, turn.speed / rate)
    scene.frames(turn.time[frame], turn.angle[frame], turn.lift[frame], turn.force[frame])
    scene.flush()
    bands = third_octaves(loaded.radiation, turn.force, turn.impulse, rate)
    BandChart(canvas, f"{view}/bands", rate, of_cam(turn.cam)).draw_once(bands)
