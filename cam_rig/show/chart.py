"""A chart in the plane, with axes of its own: for what Rerun has no plot.

Its plots have time along x, and its bars have no common scale.
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

#: Radii on the screen: Rerun takes a negative one as points, not as the plane's unit.
THIN, UNSEEN = -0.5, -0.1
#: Room for the words around the axes, as shares of width and height: left, right, above, below.
MARGINS = (0.17, 0.05, 0.1, 0.12)
#: Room above the highest number of an axis over time, as a share of what is below it.
ABOVE = 0.05


@dataclass(frozen=True)
class Axes:
    """From two quantities to the plane; its y is down, as in Rerun.

    ``x`` and ``y``: what is shown, from and to; ``width`` and ``height``: the plane's size, any
    unit; ``top``: where its upper edge is in the plane; ``raised``: share of the height by which
    words beside y stand above their mark, for they hang.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    width: float = 160.0
    height: float = 100.0
    raised: float = 0.04
    top: float = 0.0

    def place(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """``(n, 2)`` points in the plane."""
        across = (x - self.x[0]) / (self.x[1] - self.x[0])
        up = (y - self.y[0]) / (self.y[1] - self.y[0])
        return np.column_stack([across * self.width, self.top + (1.0 - up) * self.height])

    def bounds(
        self, right: float = MARGINS[1], below: float = MARGINS[3]
    ) -> tuple[tuple[float, float], tuple[float, float]]:
        """Range of x and y of a view of it all, with shares of width and height left free."""
        left, _, above, _ = MARGINS
        x = -left * self.width, (1.0 + right) * self.width
        return x, (-above * self.height, (1.0 + below) * self.height)

    def view(self, origin: str, name: str, right: float, below: float) -> rrb.Spatial2DView:
        """A view of what is drawn at ``origin``, with shares of width and height left free."""
        return plane_view(origin, name, *self.bounds(right, below))

    def draw(
        self,
        stream: rr.RecordingStream,
        entity: str,
        x: Mapping[float, str],
        y: Mapping[float, str],
    ) -> None:
        """Draw the frame, a line at each marked y, and the words of all marks, once for all."""
        lines = rr.LineStrips2D(self.grid(y), colors=colours.GREY, radii=THIN)
        stream.log(entity, lines, static=True)
        self.draw_words(stream, f"{entity}/x", self.under(x), x)
        self.draw_words(stream, f"{entity}/y", self.beside(y), y)

    def grid(self, y: Mapping[float, str]) -> list[FloatArray]:
        """Strips of the frame, and of a line at each marked y."""
        (left, right), (low, high) = self.x, self.y
        frame = self.place(np.array([left, left, right]), np.array([high, low, low]))
        return [frame, *(self.place(np.array([left, right]), np.array([at, at])) for at in y)]

    def under(self, x: Mapping[float, str]) -> FloatArray:
        """``(n, 2)`` where the words of marked x hang."""
        along = np.array([*x])
        places = self.place(along, np.full_like(along, self.y[0]))
        return places + np.array([0.0, 0.01 * self.height])

    def beside(self, y: Mapping[float, str]) -> FloatArray:
        """``(n, 2)`` where the words of marked y hang."""
        up = np.array([*y])
        shift = np.array([-0.05 * self.width, -self.raised * self.height])
        return self.place(np.full_like(up, self.x[0]), up) + shift

    @staticmethod
    def draw_words(
        stream: rr.RecordingStream, entity: str, at: FloatArray, marks: Mapping[float, str]
    ) -> None:
        """Draw the words of marks, once for all."""
        words = rr.Points2D(
            at, labels=[*marks.values()], show_labels=True, colors=colours.GREY, radii=UNSEEN
        )
        stream.log(entity, words, static=True)


def plane_view(
    origin: str, name: str, x: Sequence[float], y: Sequence[float], **more: Any
) -> rrb.Spatial2DView:
    """A view of what is drawn at ``origin`` in a range of x and of y, as the plane has them."""
    bounds = rrb.VisualBounds2D(x_range=x, y_range=y)
    return rrb.Spatial2DView(origin=origin, name=name, visual_bounds=bounds, **more)


def round_marks(low: float, high: float, unit: str) -> dict[float, str]:
    """Four to eight round values from ``low`` to ``high``, the last with its unit if any."""
    raw = (high - low) / 4.0
    power = 10.0 ** np.floor(np.log10(raw))
    step = float(max(f * power for f in (1.0, 2.0, 2.5, 5.0) if f * power <= raw))
    values = np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1.0) * step
    values += 0.0  # no -0
    words = [typeset_number(value) for value in values]
    words[-1] += f" {unit}" if unit else ""
    return dict(zip(values.tolist(), words, strict=True))


def round_range(low: float, high: float) -> tuple[float, float, float]:
    """Ends of an axis that shows two values, and its step: 1, 2 or 5 by ten to n, five at most."""
    if not high > low:
        high = low + 1.0
    raw = (high - low) / 5
    power = 10.0 ** np.floor(np.log10(raw))
    step = float(min(f * power for f in (1.0, 2.0, 5.0, 10.0) if f * power >= raw * (1 - 1e-9)))
    ends = np.floor(low / step + 1e-9), np.ceil(high / step - 1e-9)
    return round(float(ends[0]) * step, 12), round(float(ends[1]) * step, 12), step


def tens_range(low: float, high: float) -> tuple[float, float]:
    """From and to of an axis that Rerun numbers: at powers of ten, three or more, and some room."""
    step = 10.0 ** np.floor(np.log10(high - low) + 1e-9)
    first, last = np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9)
    while last - first < 2.0:
        if (last + 1.0) * step - high <= low - (first - 1.0) * step + 1e-9 * step:
            last += 1.0
        else:
            first -= 1.0
    low, last = min(low, float(first * step)), float(last * step)
    return low, max(high, last + ABOVE * (last - low))


def step_marks(low: float, high: float, step: float, most: int = 4) -> dict[float, str]:
    """Two to ``most`` values of an axis of `round_range`, 0 among them, and their names."""
    for stride in (1, 2, 3, 4):
        first, last = np.ceil(low / step / stride - 1e-9), np.floor(high / step / stride + 1e-9)
        if last - first < most:
            break
    values = (np.arange(first, last + 1.0) * stride * step).round(12) + 0.0  # no -0
    return {float(v): f"{v:.6g}".replace("-", "−") for v in values}


#: The timeline: cam speed in whole rpm.
SPEED = "cam_rpm"
APPLICATION = "cam_rig"


def name_recording(stream: rr.RecordingStream, name: str) -> None:
    """Name it, and keep wall time out of it: a run gives the same recording at any time."""
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    stream.send_recording_name(name)


# A Rerun stream into a file that appears only when it is whole.


def require_free(path: Path, overwrite: bool) -> None:
    """Raise when a recording cannot have this path."""
    if path.is_dir():
        raise CamRigError(f"{path}: is a folder; name a file in it, such as {path / 'run.rrd'}")
    if path.suffix != ".rrd":
        raise ConfigError(f"{path}: ends in {path.suffix!r}; allowed: .rrd, or no viewer opens it")
    if path.exists() and not overwrite:
        raise CamRigError(f"{path}: exists already, not overwriting; name another, or use --force")


@contextmanager
def chart_stream(
    path: Path, name: str, views: Sequence[rrb.Vertical | rrb.Grid], timeline: str = ""
) -> Iterator[rr.RecordingStream]:
    """A recording that has these tabs alone, over a timeline if any; an older one is replaced."""
    require_free(path, overwrite=True)
    over: dict[str, Any] = {"state": "hidden"}
    if timeline:
        over = {"state": "collapsed", "timeline": timeline}
    panels = rrb.BlueprintPanel(state="collapsed"), rrb.SelectionPanel(state="collapsed")
    shown = rrb.Tabs(*views) if len(views) > 1 else views[0]
    plan = rrb.Blueprint(shown, *panels, rrb.TimePanel(**over), auto_views=False, auto_layout=False)
    with rrd_stream(path, name, plan) as stream:
        yield stream


@contextmanager
def rrd_stream(path: Path, name: str, blueprint: rrb.Blueprint) -> Iterator[rr.RecordingStream]:
    """A stream into a file beside ``path``, which takes its place at the end, in reading order."""
    drawn, part = (path.with_name(f"{path.name}{end}") for end in (".drawn.part", ".part"))
    stream, ordered = (rr.RecordingStream(APPLICATION) for _ in range(2))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _save(stream, drawn, blueprint)
        name_recording(stream, name)
        yield stream
        stream.disconnect()
        _require_whole(drawn)
        _save(ordered, part, blueprint)
        for static in (True, False):  # a viewer shows a file while it loads, from its beginning
            ordered.send_chunks(RrdReader(drawn).stream().filter(is_static=static))
        ordered.disconnect()
        _require_whole(part)
        os.replace(part, path)
    except OSError as error:
        raise CamRigError(f"{path}: cannot be written ({error})") from None
    finally:
        for open_stream, file in ((stream, drawn), (ordered, part)):
            open_stream.disconnect()
            with suppress(OSError):
                file.unlink()


def _save(stream: rr.RecordingStream, part: Path, blueprint: rrb.Blueprint) -> None:
    try:
        stream.save(part, default_blueprint=blueprint)
    except RuntimeError as error:
        raise OSError(error) from None


def _require_whole(part: Path) -> None:
    """Read the file's footer: Rerun only logs what goes wrong while it writes."""
    try:
        with warnings.catch_warnings(action="ignore"):
            RrdReader(part).recordings()
    except RuntimeError as error:
        raise OSError(f"it is not whole; is the disk full? {error}") from None
