"""A chart in the plane, with axes of its own: for what Rerun has no plot.

Its plots have time along x, and its bars have no common scale.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import rerun as rr

from cam_rig.arrays import FloatArray
from cam_rig.drawing import colours

#: Radii on the screen: Rerun takes a negative one as points, not as the plane's unit.
THIN, UNSEEN = -0.5, -0.1
#: Room for the words around the axes, as shares of width and height: left, right, above, below.
MARGINS = (0.12, 0.05, 0.1, 0.12)


@dataclass(frozen=True)
class Axes:
    """From two quantities to the plane; its y is down, as in Rerun.

    Parameters
    ----------
    x, y : what is shown, from and to
    width, height : the plane's size, any unit
    """

    x: tuple[float, float]
    y: tuple[float, float]
    width: float = 160.0
    height: float = 100.0

    def place(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """``(n, 2)`` points in the plane."""
        across = (x - self.x[0]) / (self.x[1] - self.x[0])
        up = (y - self.y[0]) / (self.y[1] - self.y[0])
        return np.column_stack([across * self.width, (1.0 - up) * self.height])

    def bounds(self, right: float = MARGINS[1]) -> tuple[tuple[float, float], tuple[float, float]]:
        """Range of x and y of a view of it all; ``right`` is the share of the width left free."""
        left, _, above, below = MARGINS
        x = -left * self.width, (1.0 + right) * self.width
        return x, (-above * self.height, (1.0 + below) * self.height)

    def draw(
        self,
        stream: rr.RecordingStream,
        entity: str,
        x: Mapping[float, str],
        y: Mapping[float, str],
    ) -> None:
        """Draw the frame, a line at each marked y, and the words of all marks, once for all."""
        (left, right), (low, high) = self.x, self.y
        frame = self.place(np.array([left, left, right]), np.array([high, low, low]))
        grid = [self.place(np.array([left, right]), np.array([at, at])) for at in y]
        lines = rr.LineStrips2D([frame, *grid], colors=colours.GREY, radii=THIN)
        stream.log(entity, lines, static=True)
        along, up = np.array([*x]), np.array([*y])
        under, beside = np.array([0.0, 0.01 * self.height]), np.array([-0.05, -0.04])
        beside *= self.width, self.height
        _words(stream, f"{entity}/x", under + self.place(along, np.full_like(along, low)), x)
        _words(stream, f"{entity}/y", beside + self.place(np.full_like(up, left), up), y)


def round_marks(low: float, high: float, unit: str) -> dict[float, str]:
    """Four to eight round values from ``low`` to ``high``, the last with its unit."""
    raw = (high - low) / 4.0
    power = 10.0 ** np.floor(np.log10(raw))
    step = float(max(f * power for f in (1.0, 2.0, 2.5, 5.0) if f * power <= raw))
    values = np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1.0) * step
    values += 0.0  # no -0
    words = [f"{value:g}" for value in values]
    words[-1] += f" {unit}"
    return dict(zip(values.tolist(), words, strict=True))


def _words(
    stream: rr.RecordingStream, entity: str, at: FloatArray, marks: Mapping[float, str]
) -> None:
    words = rr.Points2D(
        at, labels=[*marks.values()], show_labels=True, colors=colours.GREY, radii=UNSEEN
    )
    stream.log(entity, words, static=True)
