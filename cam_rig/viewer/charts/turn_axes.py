"""Axes over one turn of the cam, 0 to 360°, one under the other, as books on cams have them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr

from cam_rig.arrays import FloatArray
from cam_rig.drawing import colours
from cam_rig.units import TURN
from cam_rig.viewer.charts.axes import THIN, UNSEEN, Axes, step_marks
from cam_rig.viewer.charts.quantities import Drawn, Ranges
from cam_rig.viewer.charts.series import extremes

#: Of the plane: width, height of a row's axes, and of the words above them.
WIDTH, ROW, HEAD = 160.0, 27.0, 9.0
#: Room left, right, above and below all rows.
LEFT, RIGHT, ABOVE, BELOW = 16.0, 6.0, 8.0, 7.0
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
    """Where the rows are in their plane; its y is down, as in Rerun.

    Parameters
    ----------
    rows : from the top
    ranges : from, to and step of each row's axis, in the unit shown
    row : height of a row's axes
    """

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

    def draw(self, stream: rr.RecordingStream, view: str, titled: bool = True) -> None:
        """Draw titles, degrees, a line at each quarter of the turn, the style of the cursor."""
        for row in self.rows:
            if titled:
                at = TITLE_AT[0], self.tops[row.key] + TITLE_AT[1]
                label(stream, f"{view}/{row.key}/title", at, row.title)
        axes, last = self.axes[self.rows[-1].key], f"{view}/{self.rows[-1].key}"
        axes.draw_words(stream, f"{last}/degrees", axes.under(DEGREES), DEGREES)
        across = np.array([*DEGREES]) / 360.0 * WIDTH
        lines = [np.array([[x, HEAD], [x, self.height]]) for x in across]
        grid = rr.LineStrips2D(lines, colors=colours.LIGHT_GREY, radii=THIN)
        stream.log(f"{view}/quarters", grid, static=True)
        line = rr.LineStrips2D.from_fields(colors=CURSOR, radii=-0.75)
        stream.log(f"{view}/cursor", line, static=True)

    def move_cursor(
        self, stream: rr.RecordingStream, view: str, at: list[rr.TimeColumn], angle: FloatArray
    ) -> None:
        """Where the cam is, at each of many times: a line at its unwrapped angle ``(n,)``, rad.

        Drawn anew each time: a transform that moves costs a page a third of its speed.
        """
        x = np.mod(angle, TURN) / TURN * WIDTH
        strips = np.empty((x.size, 2, 2))
        strips[:, :, 0], strips[:, :, 1] = x[:, None], (HEAD, self.height)
        stream.send_columns(f"{view}/cursor", at, rr.LineStrips2D.columns(strips=list(strips)))

    def draw_marks(self, stream: rr.RecordingStream, view: str) -> None:
        """Draw the frames of all rows and the numbers beside them, once for all."""
        for key, axes in self.axes.items():
            axes.draw(stream, f"{view}/{key}/axes", {}, self.marks(key))

    def marks(self, key: str) -> dict[float, str]:
        """The numbers beside a row."""
        return step_marks(*self._ranges[key])


def label(
    stream: rr.RecordingStream,
    entity: str,
    at: tuple[float, float],
    words: str,
    colour: int = colours.BLACK,
) -> None:
    """Words whose middle hangs from a place, once for all."""
    shown = rr.Points2D([at], labels=[words], colors=colour, radii=UNSEEN, show_labels=True)
    stream.log(entity, shown, static=True)


def in_turn(angle: FloatArray) -> tuple[FloatArray, int]:
    """Degrees within the turn of a turn's unwrapped angles (rad), and where in them 0° is passed.

    Examples
    --------
    >>> degrees, first = in_turn(np.radians([270.0, 359.0, 360.0, 450.0]))
    >>> degrees.round(9).tolist(), first
    ([270.0, 359.0, 0.0, 90.0], 2)
    """
    degrees = np.degrees(angle - TURN * np.floor(angle / TURN + 1e-9))
    return degrees, int(degrees.argmin())


def curve(axes: TurnAxes, key: str, angle: FloatArray, values: FloatArray) -> FloatArray:
    """``(n, 2)`` points of a turn's curve, from 0 to 360°, its peaks among them.

    ``values`` are in the unit shown, at unwrapped cam ``angle`` (rad).
    """
    degrees, first = in_turn(angle)
    degrees, values = np.roll(degrees, -first), np.roll(values, -first)
    kept = extremes(values, -(-values.size // PLACES))
    return axes.place(key, degrees[kept], values[kept])
