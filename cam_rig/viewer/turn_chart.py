"""Chart of the last turns of a run, overlaid over 0 to 360° of the cam.

If the turns differ, the motion is not periodic yet, or the follower bounces irregularly.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import rerun as rr

from cam_rig.dynamics import MODELS
from cam_rig.show import looks as colours
from cam_rig.show.chart import THIN, UNSEEN, Axes, step_marks
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.schedule import CamState
from cam_rig.units import TURN, FloatArray, to_rpm
from cam_rig.viewer import quantities
from cam_rig.viewer.quantities import LAW, LIFT, MARKS, PlotRow, Ranges, SceneRanges, SeriesLine
from cam_rig.viewer.timeline import Canvas, Turn, lift_offs

# Axes over one turn of the cam, 0 to 360°, one below the other.

#: Width of the drawing plane of the chart. All lengths of the chart are in its units.
WIDTH = 160.0
#: Height of the axes of one quantity, in the units of the drawing plane.
ROW = 27.0
#: Height of the space for the title above the axes of a quantity, in the units of the drawing
#: plane.
HEAD = 9.0
#: Free space left of the axes of the chart of turns, in the units of the drawing plane.
LEFT = 16.0
#: Free space right of the axes of the chart of turns, in the units of the drawing plane.
RIGHT = 6.0
#: Free space above the upper axes, in the units of the drawing plane.
SPACE_ABOVE = 8.0
#: Free space below the lower axes, in the units of the drawing plane.
SPACE_BELOW = 7.0
#: Largest number of letters of a cam's title in tables and charts, which a page of 1000 pixels has
#: room for.
MAX_TITLE = 24
#: Labels of the axis of the cam angle, by angle in degrees.
DEGREES = {0.0: "0°", 90.0: "90°", 180.0: "180°", 270.0: "270°", 360.0: "360°"}
#: Number of horizontal positions along the turn. At each of them a curve has two points, the
#: minimum and the maximum.
POSITIONS = 360
#: Colour (0xRRGGBBAA) of the vertical line at the present cam angle.
CURSOR = 0x555555FF
#: Position (x, y) of the middle of a title, relative to the upper left corner of the axes, in the
#: units of the drawing plane.
TITLE_AT = (22.0, -HEAD + 1.0)
#: Height of the labels of the y axis above their positions, relative to the height of the axes.
RAISED = 0.1


class TurnAxes:
    """Axes over the cam angle, one per quantity, below each other.

    `row` is the height of each of them. The y axis of their drawing plane points down, as in Rerun.
    """

    def __init__(self, rows: Sequence[PlotRow], ranges: Ranges, row: float = ROW) -> None:
        self.rows, self._ranges = tuple(rows), ranges
        raised = RAISED * ROW / row
        self.tops = {x.key: HEAD + i * (HEAD + row) for i, x in enumerate(rows)}
        self.axes = {
            key: Axes((0.0, 360.0), ranges[key][:2], WIDTH, row, raised, top)
            for key, top in self.tops.items()
        }
        #: Height of all axes together, with their titles, in the units of the drawing plane.
        self.height = len(rows) * (HEAD + row)

    def bounds(
        self, below: float = SPACE_BELOW, above: float = SPACE_ABOVE
    ) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return the limits of x and y of a view that contains all axes.

        `below` and `above` are free spaces. The degrees below the axes are included.
        """
        return (-LEFT, WIDTH + RIGHT), (-above, self.height + below)

    def place(self, key: str, degrees: FloatArray, values: FloatArray) -> FloatArray:
        """Return the positions of points in the axes of a quantity, shape (n, 2).

        ``degrees`` are cam angles (°). Values beyond the axis are drawn at its edge.
        """
        axes = self.axes[key]
        return axes.place(degrees, values.clip(*axes.y))

    def draw(self, canvas: Canvas, view: str, titled: bool = True) -> None:
        """Draw the titles of the axes, the degrees, and a line at each quarter turn.

        The style of the cursor, which `move_cursor` draws, is set too. `view` is the entity path of
        the chart. The titles are drawn only if `titled` is True.
        """
        for row in self.rows:
            if titled:
                position = TITLE_AT[0], self.tops[row.key] + TITLE_AT[1]
                label(canvas, f"{view}/{row.key}/title", position, row.title)
        axes, last = self.axes[self.rows[-1].key], f"{view}/{self.rows[-1].key}"
        axes.draw_labels(canvas.stream, f"{last}/degrees", axes.x_label_positions(DEGREES), DEGREES)
        quarters = np.array([*DEGREES]) / 360.0 * WIDTH
        lines = [np.array([[x, HEAD], [x, self.height]]) for x in quarters]
        grid = rr.LineStrips2D(lines, colors=colours.LIGHT_GREY, radii=THIN)
        canvas.log_static(f"{view}/quarters", grid)
        canvas.set_style(f"{view}/cursor", rr.LineStrips2D, colors=CURSOR, radii=-0.75)

    def move_cursor(
        self, canvas: Canvas, view: str, times: list[rr.TimeColumn], angle: FloatArray
    ) -> None:
        """Draw the cursor, a vertical line at the cam angle, for each of several times.

        `angle` are the unwrapped cam angles (rad), ``(n,)``, and `times` the time columns.
        """
        # The line is sent for each time, because a moving transform slows a page by a third.
        x = np.mod(angle, TURN) / TURN * WIDTH
        strips = np.empty((x.size, 2, 2))
        strips[:, :, 0], strips[:, :, 1] = x[:, None], (HEAD, self.height)
        canvas.rows(f"{view}/cursor", times, rr.LineStrips2D.columns(strips=list(strips)))

    def draw_marks(self, canvas: Canvas, view: str) -> None:
        """Draw the frames of all axes and the values on their y axes, for every time."""
        for key, axes in self.axes.items():
            axes.draw(canvas.stream, f"{view}/{key}/axes", {}, self.marks(key))

    def marks(self, key: str) -> dict[float, str]:
        """Return the labels of the y axis of a quantity, by value."""
        return step_marks(*self._ranges[key])


def label(
    canvas: Canvas,
    entity: str,
    position: tuple[float, float],
    text: str,
    colour: int = colours.BLACK,
) -> None:
    """Draw a text as static data, visible at every time.

    `position` is its upper middle. `entity` is the path in the recording, and `colour` is
    0xRRGGBBAA.
    """
    point = rr.Points2D([position], labels=[text], colors=colour, radii=UNSEEN, show_labels=True)
    canvas.log_static(entity, point)


def in_turn(angle: FloatArray) -> tuple[FloatArray, int]:
    """Return cam angles within the turn (°), and the index of the smallest of them.

    ``angle`` are the unwrapped angles of the samples of one turn in rad.
    """
    degrees = np.degrees(angle - TURN * np.floor(angle / TURN + 1e-9))
    return degrees, int(degrees.argmin())


def curve(axes: TurnAxes, key: str, angle: FloatArray, values: FloatArray) -> FloatArray:
    """Return the points of a turn's curve from 0 to 360° in the drawing plane, (n, 2).

    The samples are reduced in such a way that every peak is kept. `key` is that of the quantity,
    `angle` is in rad, and `values` are in the displayed unit.
    """
    degrees, first = in_turn(angle)
    degrees, values = np.roll(degrees, -first), np.roll(values, -first)
    indices = quantities.extremes(values, -(-values.size // POSITIONS))
    return axes.place(key, degrees[indices], values[indices])


VIEW = "turn"
#: Largest number of turns of a cam at one speed that the chart overlays.
MAX_OVERLAID = 4
#: Two turns whose curves differ by at most this fraction of the height of the axes are drawn once.
SAME_TURN_TOLERANCE = 0.004
#: Horizontal positions in the drawing plane at which the curves of two turns are compared.
ALONG = np.linspace(0.0, WIDTH, 361)
#: Cam angles (degrees) at which the curve of the law is computed.
DEGREES_OF_LAW = np.linspace(0.0, 360.0, 361)
#: Positions of the entries in the legend of the lift, one pair per entry: x of a short line, and x
#: of the middle of the name after it.
LEGEND = ((52.0, 70.0), (84.0, 97.0), (106.0, 122.0), (134.0, 151.0))
#: Length of a short line in the legend, in the units of the drawing plane.
STROKE = 6.0
#: Radius of the mark of a lift-off or landing, in points of the screen (negative for Rerun).
MARK = -4.0
#: Vertical position of the caption with cam and speed, in the units of the plane.
CAPTION = -7.0


class TurnChart:
    """Chart in which the turns of one cam at one speed are overlaid.

    Added turns are kept until `flush` sends them to the recording. If `every` is True, each turn is
    sent and is visible from its start on. Otherwise only the newest turn is sent and is visible
    from its end on.
    """

    def __init__(
        self, canvas: Canvas, loaded: LoadedScene, ranges: SceneRanges, every: bool
    ) -> None:
        self._canvas, self._loaded, self._every = canvas, loaded, every
        self._rows = quantities.plot_rows(loaded.scene.model)
        self._ranges, self._axes = ranges, TurnAxes(self._rows, ranges.all_cams)
        self._lifts_off = MODELS[loaded.scene.model].lifts_off
        self._edges = np.array([HEAD, self._axes.height])
        self._waiting, self._last_angle = list[tuple[CamState, Turn]](), -np.inf
        self._last_step = self._shown = ("", 0.0)
        self._overlaid, self._count = dict[int, FloatArray](), 0
        self._axes.draw(canvas, VIEW)
        self._draw_styles()
        self._draw_legend()

    def add(self, end: CamState, turn: Turn) -> None:
        """Add a turn that ended with a cam state.

        A turn that has samples in common with the last added turn is ignored.
        """
        hold = turn.cam, turn.speed
        if hold == self._last_step and turn.angle[0] <= self._last_angle:
            return
        self._last_step, self._last_angle = hold, float(turn.angle[-1])
        self._waiting.append((end, turn))

    def flush(self) -> None:
        """Draw the turns that were added to the chart since the last call."""
        for end, turn in self._waiting if self._every else self._waiting[-1:]:
            first = float(turn.time[0]), float(turn.angle[0])
            self._send(
                self._canvas.times_at(*first) if self._every else self._canvas.times_of(end), turn
            )
        self._waiting = []

    def move_cursor(self, times: list[rr.TimeColumn], angle: FloatArray) -> None:
        """Draw the cursor, a vertical line at the cam angle, for each of several times.

        `angle` are the unwrapped cam angles (rad), ``(n,)``, and `times` the time columns.
        """
        self._axes.move_cursor(self._canvas, VIEW, times, angle)

    def _send(self, times: list[rr.TimeColumn], turn: Turn) -> None:
        """Draw a turn over the earlier turns of its speed, unless it equals one of them."""
        if self._shown != (turn.cam, turn.speed):
            self._start_step(times, turn.cam, turn.speed)
        curves = {row.key: self._curve(row.key, row.line.factor, turn) for row in self._rows}
        new_curves = np.stack([np.interp(ALONG, *points.T) for points in curves.values()])
        if any(
            np.abs(new_curves - drawn).max() < SAME_TURN_TOLERANCE * ROW
            for drawn in self._overlaid.values()
        ):
            return
        slot = self._count % MAX_OVERLAID
        self._overlaid[slot], self._count = new_curves, self._count + 1
        for key, points in curves.items():
            # the last strip of an entity is drawn over the others
            strips = [points, self._law] if key == LIFT.key else [points]
            self._strips(times, f"{key}/follower/{slot}", strips)
        self._draw_events(times, turn)

    def begin(self, state: CamState) -> None:
        """Start the chart of another cam or speed at a cam state of a live run.

        The curves and marks of the last speed are removed, because no turn at the new speed is
        complete yet.
        """
        times = self._canvas.times_of(state)
        self._start_step(times, state.cam, state.speed)
        for mark in MARKS:
            self._canvas.points(f"{VIEW}/lift/{mark.name}", times, [])
        self._strips(times, "flights", [])

    def _start_step(self, times: list[rr.TimeColumn], cam: str, speed: float) -> None:
        """Remove the overlaid turns, and draw the caption of another cam or speed.

        If the cam changes, its axes and its law are drawn too.
        """
        for slot in self._overlaid:
            for row in self._rows:
                self._strips(times, f"{row.key}/follower/{slot}", [])
        if cam != self._shown[0]:
            self._mount(times, cam)
        self._shown, self._overlaid, self._count = (cam, speed), {}, 0
        caption = f"{self._loaded.cams[cam].title}, {to_rpm(speed):.4g} rpm"
        self._canvas.rows(f"{VIEW}/caption", times, rr.Points2D.columns(labels=[caption]))

    def _mount(self, times: list[rr.TimeColumn], cam: str) -> None:
        self._axes = TurnAxes(self._rows, self._ranges.of(cam))
        for key, axes in self._axes.axes.items():
            marks = self._axes.marks(key)
            self._strips(times, f"{key}/axes", axes.grid(marks))
            labels = [*marks.values()]
            self._canvas.points(
                f"{VIEW}/{key}/axes/y", times, axes.y_label_positions(marks), labels=labels
            )
        law = self._loaded.laws[cam](np.radians(DEGREES_OF_LAW)) * LAW.factor
        self._law = self._axes.place("lift", DEGREES_OF_LAW, law)

    def _curve(self, key: str, factor: float, turn: Turn) -> FloatArray:
        law = self._loaded.laws[turn.cam]
        if key == quantities.GAP.key:
            values = quantities.gap_of(law, turn.angle, turn)
        else:
            values = turn.rows[6] if key == quantities.TWIST.key else getattr(turn, key)
        return curve(self._axes, key, turn.angle, values * factor)

    def _draw_events(self, times: list[rr.TimeColumn], turn: Turn) -> None:
        """Mark the lift-offs and landings of a turn, and shade the flights between them."""
        degrees, _ = in_turn(turn.angle)
        in_flight = turn.force == 0.0
        lift = turn.lift * LIFT.line.factor
        lifted_off, landed = lift_offs(turn.force, bool(in_flight[-1])), turn.impulse > 0.0
        for mark, mask in zip(MARKS, (lifted_off, landed), strict=True):
            points = self._axes.place("lift", degrees[mask], lift[mask])
            self._canvas.points(f"{VIEW}/lift/{mark.name}", times, points)
        if self._lifts_off:
            flight_degrees = np.unique(np.floor(degrees[in_flight]))
            x = (flight_degrees[:, None] + 0.5) / 360.0 * WIDTH
            strokes = np.stack([x * [1.0, 1.0], np.full((x.size, 2), self._edges)], axis=2)
            self._strips(times, "flights", list(strokes))

    def _strips(self, times: list[rr.TimeColumn], entity: str, strips: list[FloatArray]) -> None:
        self._canvas.strips(f"{VIEW}/{entity}", times, strips)

    def _draw_styles(self) -> None:
        """Set the styles of all curves and marks.

        The law is drawn over the follower.
        """
        set_style = self._canvas.set_style
        label_style: dict[str, Any] = {"radii": UNSEEN, "show_labels": True}
        for row in self._rows:
            view, lines = f"{VIEW}/{row.key}", [row.line, LAW] if row is LIFT else [row.line]
            line_colours, radii = [x.colour for x in lines], [-0.5 * x.width for x in lines]
            for slot in range(MAX_OVERLAID):
                set_style(
                    f"{view}/follower/{slot}", rr.LineStrips2D, colors=line_colours, radii=radii
                )
            set_style(f"{view}/axes", rr.LineStrips2D, colors=colours.GREY, radii=THIN)
            set_style(f"{view}/axes/y", rr.Points2D, colors=colours.GREY, **label_style)
        for mark in MARKS:
            set_style(f"{VIEW}/lift/{mark.name}", rr.Points2D, colors=mark.colour, radii=MARK)
        width = 0.56 * WIDTH / 360.0
        flights: dict[str, Any] = {"colors": colours.FLIGHT, "radii": width, "draw_order": 19.0}
        set_style(f"{VIEW}/flights", rr.LineStrips2D, **flights)
        middle = [[0.5 * WIDTH, CAPTION]]
        set_style(
            f"{VIEW}/caption", rr.Points2D, positions=middle, colors=colours.BLACK, **label_style
        )

    def _draw_legend(self) -> None:
        """Draw the legend of the lift above its axes."""
        entries = (LIFT.line, LAW, *(MARKS if self._lifts_off else ()))
        for (x, middle), entry in zip(LEGEND, entries, strict=False):
            entity = f"{VIEW}/lift/legend/{entry.name}"
            top = HEAD + TITLE_AT[1]
            label(self._canvas, f"{entity}/name", (middle, top), entry.name, entry.colour)
            y = top + 3.0
            if isinstance(entry, SeriesLine):
                ends = [[[x, y], [x + STROKE, y]]]
                key = rr.LineStrips2D(ends, colors=entry.colour, radii=-0.5 * entry.width)
                self._canvas.log_static(entity, key)
            else:
                point = rr.Points2D([[x + 0.5 * STROKE, y]], colors=entry.colour, radii=MARK)
                self._canvas.log_static(entity, point)
