"""The last turns of a run over 0 to 360° of the cam, laid over each other.

Where they differ, the follower has not settled, or bounces without end.
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
from cam_rig.viewer.quantities import LAW, LIFT, MARKS, Drawn, Ranges, SceneRanges, SeriesLine
from cam_rig.viewer.timeline import Canvas, Turn, lift_offs

# Axes over one turn of the cam, 0 to 360°, one under the other, as books on cams have them.

#: Of the plane: width, height of a row's axes, and of the words above them.
WIDTH, ROW, HEAD = 160.0, 27.0, 9.0
#: Room left, right, above and below all rows.
LEFT, RIGHT, ABOVE, BELOW = 16.0, 6.0, 8.0, 7.0
#: Letters of a cam's title that tables and charts have room for where a page is 1000 pixels wide.
MAX_TITLE = 24
#: Marks of the cam angle, °.
DEGREES = {0.0: "0°", 90.0: "90°", 180.0: "180°", 270.0: "270°", 360.0: "360°"}
#: Of a curve two points are sent at each of so many places along the turn.
PLACES = 360
#: Colour of the line where the cam is.
CURSOR = 0x555555FF
#: Middle of a row's title, from the corner of its axes.
TITLE_AT = (22.0, -HEAD + 1.0)
#: Of the axes' height: words beside y hang by this much.
RAISED = 0.1


class TurnAxes:
    """Where rows of axes, each ``row`` high, are in their plane; its y is down, as in Rerun."""

    def __init__(self, rows: Sequence[Drawn], ranges: Ranges, row: float = ROW) -> None:
        self.rows, self._ranges = tuple(rows), ranges
        raised = RAISED * ROW / row
        self.tops = {it.key: HEAD + i * (HEAD + row) for i, it in enumerate(rows)}
        self.axes = {
            key: Axes((0.0, 360.0), ranges[key][:2], WIDTH, row, raised, top)
            for key, top in self.tops.items()
        }
        #: Of all rows.
        self.height = len(rows) * (HEAD + row)

    def bounds(
        self, below: float = BELOW, above: float = ABOVE
    ) -> tuple[tuple[float, float], tuple[float, float]]:
        """Range of x and y of a view of it all, with room below for the degrees."""
        return (-LEFT, WIDTH + RIGHT), (-above, self.height + below)

    def place(self, key: str, degrees: FloatArray, values: FloatArray) -> FloatArray:
        """``(n, 2)`` points in a row; beyond its axis they end at its edge."""
        axes = self.axes[key]
        return axes.place(degrees, values.clip(*axes.y))

    def draw(self, canvas: Canvas, view: str, titled: bool = True) -> None:
        """Draw titles, degrees, a line at each quarter of the turn, the style of the cursor."""
        for row in self.rows:
            if titled:
                at = TITLE_AT[0], self.tops[row.key] + TITLE_AT[1]
                label(canvas, f"{view}/{row.key}/title", at, row.title)
        axes, last = self.axes[self.rows[-1].key], f"{view}/{self.rows[-1].key}"
        axes.draw_words(canvas.stream, f"{last}/degrees", axes.under(DEGREES), DEGREES)
        across = np.array([*DEGREES]) / 360.0 * WIDTH
        lines = [np.array([[x, HEAD], [x, self.height]]) for x in across]
        grid = rr.LineStrips2D(lines, colors=colours.LIGHT_GREY, radii=THIN)
        canvas.always(f"{view}/quarters", grid)
        canvas.look(f"{view}/cursor", rr.LineStrips2D, colors=CURSOR, radii=-0.75)

    def move_cursor(
        self, canvas: Canvas, view: str, at: list[rr.TimeColumn], angle: FloatArray
    ) -> None:
        """Where the cam is, at each of many times: a line at its unwrapped angle ``(n,)``, rad."""
        # Drawn anew each time: a transform that moves costs a page a third of its speed.
        x = np.mod(angle, TURN) / TURN * WIDTH
        strips = np.empty((x.size, 2, 2))
        strips[:, :, 0], strips[:, :, 1] = x[:, None], (HEAD, self.height)
        canvas.rows(f"{view}/cursor", at, rr.LineStrips2D.columns(strips=list(strips)))

    def draw_marks(self, canvas: Canvas, view: str) -> None:
        """Draw the frames of all rows and the numbers beside them, once for all."""
        for key, axes in self.axes.items():
            axes.draw(canvas.stream, f"{view}/{key}/axes", {}, self.marks(key))

    def marks(self, key: str) -> dict[float, str]:
        """The numbers beside a row."""
        return step_marks(*self._ranges[key])


def label(
    canvas: Canvas, entity: str, at: tuple[float, float], words: str, colour: int = colours.BLACK
) -> None:
    """Words whose middle hangs from a place, once for all."""
    shown = rr.Points2D([at], labels=[words], colors=colour, radii=UNSEEN, show_labels=True)
    canvas.always(entity, shown)


def in_turn(angle: FloatArray) -> tuple[FloatArray, int]:
    """Degrees within the turn of unwrapped angles (rad) of a turn, and where 0° is passed."""
    degrees = np.degrees(angle - TURN * np.floor(angle / TURN + 1e-9))
    return degrees, int(degrees.argmin())


def curve(axes: TurnAxes, key: str, angle: FloatArray, values: FloatArray) -> FloatArray:
    """``(n, 2)`` points of a turn's curve in the unit shown, from 0 to 360°, its peaks too."""
    degrees, first = in_turn(angle)
    degrees, values = np.roll(degrees, -first), np.roll(values, -first)
    kept = quantities.extremes(values, -(-values.size // PLACES))
    return axes.place(key, degrees[kept], values[kept])


VIEW = "turn"
#: So many turns of a speed lie over each other.
LAID = 4
#: Turns that differ nowhere by more than this share of a row's height look like one.
ALIKE = 0.004
#: Where turns are compared, and the law is drawn.
ALONG, DEGREES_OF_LAW = np.linspace(0.0, WIDTH, 361), np.linspace(0.0, 360.0, 361)
#: Along the lift's head: a short stroke, and the middle of the name after it.
LEGEND = ((52.0, 70.0), (84.0, 97.0), (106.0, 122.0), (134.0, 151.0))
STROKE, MARK = 6.0, -4.0
#: Height of the line that says which cam turned how fast.
CAPTION = -7.0


class TurnChart:
    """Draws axes, then turns from their end on, ``every`` one or the newest; `flush` sends."""

    def __init__(
        self, canvas: Canvas, loaded: LoadedScene, ranges: SceneRanges, every: bool
    ) -> None:
        self._canvas, self._loaded, self._every = canvas, loaded, every
        self._rows = quantities.drawn_of(loaded.scene.model)
        self._ranges, self._axes = ranges, TurnAxes(self._rows, ranges.whole)
        self._flies = MODELS[loaded.scene.model].lifts_off
        self._edges = np.array([HEAD, self._axes.height])
        self._waiting, self._reached = list[tuple[CamState, Turn]](), -np.inf
        self._taken = self._shown = ("", 0.0)
        self._laid, self._count = dict[int, FloatArray](), 0
        self._axes.draw(canvas, VIEW)
        self._draw_styles()
        self._draw_legend()

    def add(self, end: CamState, turn: Turn) -> None:
        """Take the turn that ended with a state; one that overlaps the turn before is left out."""
        hold = turn.cam, turn.speed
        if hold == self._taken and turn.angle[0] <= self._reached:
            return
        self._taken, self._reached = hold, float(turn.angle[-1])
        self._waiting.append((end, turn))

    def flush(self) -> None:
        """Send what was taken."""
        for end, turn in self._waiting if self._every else self._waiting[-1:]:
            first = float(turn.time[0]), float(turn.angle[0])
            self._send(self._canvas.at(*first) if self._every else self._canvas.state(end), turn)
        self._waiting = []

    def move_cursor(self, at: list[rr.TimeColumn], angle: FloatArray) -> None:
        """Where the cam is at each of many times, by its unwrapped angle ``(n,)``, rad."""
        self._axes.move_cursor(self._canvas, VIEW, at, angle)

    def _send(self, at: list[rr.TimeColumn], turn: Turn) -> None:
        """Lay a turn over those of its speed, where it can be told from them."""
        if self._shown != (turn.cam, turn.speed):
            self._begin(at, turn.cam, turn.speed)
        curves = {row.key: self._curve(row.key, row.line.factor, turn) for row in self._rows}
        now = np.stack([np.interp(ALONG, *points.T) for points in curves.values()])
        if any(np.abs(now - before).max() < ALIKE * ROW for before in self._laid.values()):
            return
        slot = self._count % LAID
        self._laid[slot], self._count = now, self._count + 1
        for key, points in curves.items():
            # of one entity the last strip lies over the others
            strips = [points, self._law] if key == LIFT.key else [points]
            self._strips(at, f"{key}/follower/{slot}", strips)
        self._draw_events(at, turn)

    def begin(self, state: CamState) -> None:
        """Another cam or speed turns from a state on; its first whole turn comes later."""
        at = self._canvas.state(state)
        self._begin(at, state.cam, state.speed)
        for mark in MARKS:
            self._canvas.points(f"{VIEW}/lift/{mark.name}", at, [])
        self._strips(at, "flights", [])

    def _begin(self, at: list[rr.TimeColumn], cam: str, speed: float) -> None:
        """Another cam or speed: its axes, law and name, and away with what was laid."""
        for slot in self._laid:
            for row in self._rows:
                self._strips(at, f"{row.key}/follower/{slot}", [])
        if cam != self._shown[0]:
            self._mount(at, cam)
        self._shown, self._laid, self._count = (cam, speed), {}, 0
        words = f"{self._loaded.cams[cam].title}, {to_rpm(speed):.4g} rpm"
        self._canvas.rows(f"{VIEW}/caption", at, rr.Points2D.columns(labels=[words]))

    def _mount(self, at: list[rr.TimeColumn], cam: str) -> None:
        self._axes = TurnAxes(self._rows, self._ranges.of(cam))
        for key, axes in self._axes.axes.items():
            marks = self._axes.marks(key)
            self._strips(at, f"{key}/axes", axes.grid(marks))
            words = [*marks.values()]
            self._canvas.points(f"{VIEW}/{key}/axes/y", at, axes.beside(marks), labels=words)
        law = self._loaded.laws[cam](np.radians(DEGREES_OF_LAW)) * LAW.factor
        self._law = self._axes.place("lift", DEGREES_OF_LAW, law)

    def _curve(self, key: str, factor: float, turn: Turn) -> FloatArray:
        law = self._loaded.laws[turn.cam]
        if key == quantities.GAP.key:
            values = quantities.gap_of(law, turn.angle, turn)
        else:
            values = turn.rows[6] if key == quantities.TWIST.key else getattr(turn, key)
        return curve(self._axes, key, turn.angle, values * factor)

    def _draw_events(self, at: list[rr.TimeColumn], turn: Turn) -> None:
        """Mark where the follower left the cam and landed, and shade between."""
        degrees, _ = in_turn(turn.angle)
        off = turn.force == 0.0
        lift = turn.lift * LIFT.line.factor
        left, landed = lift_offs(turn.force, bool(off[-1])), turn.impulse > 0.0
        for mark, there in zip(MARKS, (left, landed), strict=True):
            points = self._axes.place("lift", degrees[there], lift[there])
            self._canvas.points(f"{VIEW}/lift/{mark.name}", at, points)
        if self._flies:
            flown = np.unique(np.floor(degrees[off]))
            x = (flown[:, None] + 0.5) / 360.0 * WIDTH
            strokes = np.stack([x * [1.0, 1.0], np.full((x.size, 2), self._edges)], axis=2)
            self._strips(at, "flights", list(strokes))

    def _strips(self, at: list[rr.TimeColumn], entity: str, strips: list[FloatArray]) -> None:
        self._canvas.strips(f"{VIEW}/{entity}", at, strips)

    def _draw_styles(self) -> None:
        """What each curve and mark looks like, once for all: the law lies over the follower."""
        look = self._canvas.look
        words: dict[str, Any] = {"radii": UNSEEN, "show_labels": True}
        for row in self._rows:
            view, lines = f"{VIEW}/{row.key}", [row.line, LAW] if row is LIFT else [row.line]
            shades, radii = [it.colour for it in lines], [-0.5 * it.width for it in lines]
            for slot in range(LAID):
                look(f"{view}/follower/{slot}", rr.LineStrips2D, colors=shades, radii=radii)
            look(f"{view}/axes", rr.LineStrips2D, colors=colours.GREY, radii=THIN)
            look(f"{view}/axes/y", rr.Points2D, colors=colours.GREY, **words)
        for mark in MARKS:
            look(f"{VIEW}/lift/{mark.name}", rr.Points2D, colors=mark.colour, radii=MARK)
        width = 0.56 * WIDTH / 360.0
        flights: dict[str, Any] = {"colors": colours.FLIGHT, "radii": width, "draw_order": 19.0}
        look(f"{VIEW}/flights", rr.LineStrips2D, **flights)
        middle = [[0.5 * WIDTH, CAPTION]]
        look(f"{VIEW}/caption", rr.Points2D, positions=middle, colors=colours.BLACK, **words)

    def _draw_legend(self) -> None:
        """Strokes and points of the lift with their names beside them, over its axes."""
        named = (LIFT.line, LAW, *(MARKS if self._flies else ()))
        for (x, middle), it in zip(LEGEND, named, strict=False):
            where = f"{VIEW}/lift/legend/{it.name}"
            top = HEAD + TITLE_AT[1]
            label(self._canvas, f"{where}/name", (middle, top), it.name, it.colour)
            y = top + 3.0
            if isinstance(it, SeriesLine):
                ends = [[[x, y], [x + STROKE, y]]]
                key = rr.LineStrips2D(ends, colors=it.colour, radii=-0.5 * it.width)
                self._canvas.always(where, key)
            else:
                point = rr.Points2D([[x + 0.5 * STROKE, y]], colors=it.colour, radii=MARK)
                self._canvas.always(where, point)
