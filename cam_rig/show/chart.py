"""Charts for the Rerun viewer, drawn in a plane, and recording files.

The charts consist of lines and points, because Rerun plots quantities over time only, and its bar
charts do not have a common scale.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from cam_rig.errors import CamRigError, ConfigError
from cam_rig.show import looks as colours
from cam_rig.show.tables import typeset_number
from cam_rig.units import FloatArray

#: Radius of a thin line. Rerun takes a negative radius in points of the screen, not in the plane.
THIN = -0.5
#: Radius of a point that only carries a label, so small that it is not visible. As in `THIN`, a
#: negative number is in points of the screen.
UNSEEN = -0.1
#: Margin for labels on the left of the axes, as a fraction of their width.
LEFT_MARGIN = 0.17
#: Free space on the right of the axes of a chart, as a fraction of their width.
RIGHT_MARGIN = 0.05
#: Free space above the axes of a chart, as a fraction of their height.
TOP_MARGIN = 0.1
#: Free space for labels below the axes of a chart, as a fraction of their height.
BOTTOM_MARGIN = 0.12
#: Margin above the highest number of an axis over time, as a fraction of the range below it.
TENS_MARGIN = 0.05


@dataclass(frozen=True)
class Axes:
    """Axes that map two quantities to the plane, in which y points down as in Rerun.

    Parameters
    ----------
    x, y : tuple of float
        Lowest and highest value on the axis.
    width, height : float
        Size of the axes in the plane, any unit.
    raised : float
        Distance of a y label above its mark, as a fraction of the height. Rerun draws a label below
        its position.
    top : float
        Position of the upper edge in the plane.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    width: float = 160.0
    height: float = 100.0
    raised: float = 0.04
    top: float = 0.0

    def place(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the points `(n, 2)` in the drawing plane of values on both axes.

        `x` and `y` are the values, each `(n,)`.
        """
        across = (x - self.x[0]) / (self.x[1] - self.x[0])
        up = (y - self.y[0]) / (self.y[1] - self.y[0])
        return np.column_stack([across * self.width, self.top + (1.0 - up) * self.height])

    def bounds(
        self, right: float = RIGHT_MARGIN, below: float = BOTTOM_MARGIN
    ) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return the ranges of x and y of a view that contains the axes with margins.

        The ranges are in the units of the plane. `right` and `below` are margins as fractions of
        the width and the height of the axes.
        """
        x = -LEFT_MARGIN * self.width, (1.0 + right) * self.width
        return x, (-TOP_MARGIN * self.height, (1.0 + below) * self.height)

    def view(self, origin: str, name: str, right: float, below: float) -> rrb.Spatial2DView:
        """Return a view of the entities below `origin` that shows these axes.

        `right` and `below` are margins as in `bounds`.
        """
        return plane_view(origin, name, *self.bounds(right, below))

    def draw(
        self,
        stream: rr.RecordingStream,
        entity: str,
        x: Mapping[float, str],
        y: Mapping[float, str],
    ) -> None:
        """Draw the frame, horizontal grid lines and all labels, as static data.

        `x` and `y` contain the labels of the axes by their values. There is a grid line at each
        label of y.
        """
        lines = rr.LineStrips2D(self.grid(y), colors=colours.GREY, radii=THIN)
        stream.log(entity, lines, static=True)
        self.draw_labels(stream, f"{entity}/x", self.x_label_positions(x), x)
        self.draw_labels(stream, f"{entity}/y", self.y_label_positions(y), y)

    def grid(self, y: Mapping[float, str]) -> list[FloatArray]:
        """Return the polylines `(n, 2)` of the frame and of the grid lines.

        There is a horizontal line at each key of `y`, the labels of the y axis by value.
        """
        (left, right), (low, high) = self.x, self.y
        frame = self.place(np.array([left, left, right]), np.array([high, low, low]))
        return [frame, *(self.place(np.array([left, right]), np.array([v, v])) for v in y)]

    def x_label_positions(self, x: Mapping[float, str]) -> FloatArray:
        """Return the positions `(n, 2)` in the plane of the labels of the x axis.

        `x` contains the labels by their values.
        """
        values = np.array([*x])
        marks = self.place(values, np.full_like(values, self.y[0]))
        return marks + np.array([0.0, 0.01 * self.height])

    def y_label_positions(self, y: Mapping[float, str]) -> FloatArray:
        """Return the positions `(n, 2)` in the plane of the labels of the y axis.

        `y` contains the labels by their values.
        """
        values = np.array([*y])
        shift = np.array([-0.05 * self.width, -self.raised * self.height])
        return self.place(np.full_like(values, self.x[0]), values) + shift

    @staticmethod
    def draw_labels(
        stream: rr.RecordingStream, entity: str, positions: FloatArray, marks: Mapping[float, str]
    ) -> None:
        """Draw the labels of axis marks at positions `(n, 2)`, as static data."""
        labels = [*marks.values()]
        points = rr.Points2D(
            positions, labels=labels, show_labels=True, colors=colours.GREY, radii=UNSEEN
        )
        stream.log(entity, points, static=True)


def plane_view(
    origin: str, name: str, x: Sequence[float], y: Sequence[float], **more: Any
) -> rrb.Spatial2DView:
    """Return a view of the entities below `origin` in the plane.

    `x` and `y` are the ranges of the plane that the view shows. `name` is its title.
    """
    bounds = rrb.VisualBounds2D(x_range=x, y_range=y)
    return rrb.Spatial2DView(origin=origin, name=name, visual_bounds=bounds, **more)


def round_marks(low: float, high: float, unit: str) -> dict[float, str]:
    """Return the labels of four to eight round values from `low` to `high`.

    The label of the last value contains the unit, if it is not empty. The key of a label is its
    value.
    """
    raw = (high - low) / 4.0
    power = 10.0 ** np.floor(np.log10(raw))
    step = float(max(f * power for f in (1.0, 2.0, 2.5, 5.0) if f * power <= raw))
    values = np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1.0) * step
    values += 0.0  # no -0
    labels = [typeset_number(value) for value in values]
    labels[-1] += f" {unit}" if unit else ""
    return dict(zip(values.tolist(), labels, strict=True))


def round_range(low: float, high: float) -> tuple[float, float, float]:
    """Return the ends and the step of an axis that contains two values.

    `low` and `high` are the values. The results are lower end, upper end and step. The step is 1, 2
    or 5 times a power of ten, and at most five steps lie between the values.
    """
    if not high > low:
        high = low + 1.0
    raw = (high - low) / 5
    power = 10.0 ** np.floor(np.log10(raw))
    step = float(min(f * power for f in (1.0, 2.0, 5.0, 10.0) if f * power >= raw * (1 - 1e-9)))
    ends = np.floor(low / step + 1e-9), np.ceil(high / step - 1e-9)
    return round(float(ends[0]) * step, 12), round(float(ends[1]) * step, 12), step


def tens_range(low: float, high: float) -> tuple[float, float]:
    """Return the ends of an axis on which Rerun places its labels.

    Rerun labels the multiples of a power of ten. The axis contains at least three of them, so that
    labels are displayed, and a margin of `TENS_MARGIN` above the highest.
    """
    step = 10.0 ** np.floor(np.log10(high - low) + 1e-9)
    first, last = np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9)
    while last - first < 2.0:
        if (last + 1.0) * step - high <= low - (first - 1.0) * step + 1e-9 * step:
            last += 1.0
        else:
            first -= 1.0
    low, last = min(low, float(first * step)), float(last * step)
    return low, max(high, last + TENS_MARGIN * (last - low))


def step_marks(low: float, high: float, step: float, max_count: int = 4) -> dict[float, str]:
    """Return the labels of two to `max_count` round values on an axis, with zero.

    `low`, `high` and `step` are the ends and the step of the axis from `round_range`. The key of a
    label is its value.
    """
    for stride in (1, 2, 3, 4):
        first, last = np.ceil(low / step / stride - 1e-9), np.floor(high / step / stride + 1e-9)
        if last - first < max_count:
            break
    values = (np.arange(first, last + 1.0) * stride * step).round(12) + 0.0  # no -0
    return {float(v): f"{v:.6g}".replace("-", "−") for v in values}


#: Name of the Rerun timeline of cam speeds, in whole rpm.
SPEED = "cam_rpm"
#: Name of the application in recordings.
APPLICATION = "cam_rig"


def name_recording(stream: rr.RecordingStream, name: str) -> None:
    """Name a recording, and disable wall-clock time in it.

    The recording of a run then does not depend on when it is made.
    """
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    stream.send_recording_name(name)


# Rerun recordings are written to a temporary file, which is renamed when it is complete.


def require_free(path: Path, overwrite: bool) -> None:
    """Raise `CamRigError` if `path` is not a suitable name for a new recording.

    An existing file is accepted if `overwrite` is True.
    """
    if path.is_dir():
        raise CamRigError(f"{path}: is a folder; name a file in it, such as {path / 'run.rrd'}")
    if path.suffix != ".rrd":
        raise ConfigError(f"{path}: must end in .rrd, got {path.suffix!r}")
    if path.exists() and not overwrite:
        raise CamRigError(f"{path}: exists already, not overwriting; name another, or use --force")


@contextmanager
def chart_stream(
    path: Path, name: str, views: Sequence[rrb.Vertical | rrb.Grid], timeline: str = ""
) -> Iterator[rr.RecordingStream]:
    """Open a recording file with one tab per view, replacing an existing file.

    The time panel shows `timeline`, or is hidden if it is empty.
    """
    require_free(path, overwrite=True)
    time_options: dict[str, Any] = {"state": "hidden"}
    if timeline:
        time_options = {"state": "collapsed", "timeline": timeline}
    panels = rrb.BlueprintPanel(state="collapsed"), rrb.SelectionPanel(state="collapsed")
    tabs = rrb.Tabs(*views) if len(views) > 1 else views[0]
    parts = tabs, *panels, rrb.TimePanel(**time_options)
    blueprint = rrb.Blueprint(*parts, auto_views=False, auto_layout=False)
    with rrd_stream(path, name, blueprint) as stream:
        yield stream


@contextmanager
def rrd_stream(path: Path, name: str, blueprint: rrb.Blueprint) -> Iterator[rr.RecordingStream]:
    """Open a recording stream into a temporary file that replaces `path` at the end.

    The file is sorted before, with static data first: a viewer shows a file while it loads.
    """
    unsorted, part = (path.with_name(f"{path.name}{end}") for end in (".drawn.part", ".part"))
    stream, ordered = (rr.RecordingStream(APPLICATION) for _ in range(2))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _save(stream, unsorted, blueprint)
        name_recording(stream, name)
        yield stream
        stream.disconnect()
        _require_complete(unsorted)
        _save(ordered, part, blueprint)
        for static in (True, False):
            ordered.send_chunks(RrdReader(unsorted).stream().filter(is_static=static))
        ordered.disconnect()
        _require_complete(part)
        os.replace(part, path)
    except OSError as error:
        raise CamRigError(f"{path}: cannot be written ({error})") from None
    finally:
        for open_stream, file in ((stream, unsorted), (ordered, part)):
            open_stream.disconnect()
            with suppress(OSError):
                file.unlink()


def _save(stream: rr.RecordingStream, part: Path, blueprint: rrb.Blueprint) -> None:
    """Direct a stream to a file. Raise `OSError` if it cannot be opened."""
    try:
        stream.save(part, default_blueprint=blueprint)
    except RuntimeError as error:
        raise OSError(error) from None


def _require_complete(part: Path) -> None:
    """Raise `OSError` if the footer of a file cannot be read.

    Rerun only logs errors that occur while it writes.
    """
    try:
        with warnings.catch_warnings(action="ignore"):
            RrdReader(part).recordings()
    except RuntimeError as error:
        raise OSError(f"it is incomplete; is the disk full? {error}") from None
