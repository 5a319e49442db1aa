"""Third-octave bars in the plane: one scale for all cams and speeds, so that they compare."""

from __future__ import annotations

import numpy as np
import rerun as rr

from cam_rig.arrays import FloatArray
from cam_rig.viewer.charts.axes import Axes, round_marks
from cam_rig.viewer.charts.bands import band_numbers
from cam_rig.viewer.timeline import Times, time_columns

#: dB shown, the same wherever bars are drawn; what is louder ends at the upper edge.
LEVELS = (0.0, 110.0)
#: Height of the plane over its width, and width of a bar over that of its band.
SHAPE, BAR = 0.42, 0.8
#: Radius of a bar's outline on the screen.
LINE = -1.0
#: Bands that are named, by number.
NAMED = {10.0: "10 Hz", 20.0: "100 Hz", 30.0: "1 kHz", 40.0: "10 kHz"}


def band_axes(sample_rate: float) -> Axes:
    """Bands up to half the sample rate (Hz) along x, each as wide as the next; dB along y."""
    numbers = band_numbers(sample_rate)
    ends = float(numbers[0]) - 0.5, float(numbers[-1]) + 0.5
    return Axes(ends, LEVELS, height=SHAPE * 160.0)


class BandChart:
    """Draws the axes into a view, then bars as they come; `flush` sends them."""

    def __init__(
        self,
        stream: rr.RecordingStream,
        view: str,
        rate: float,
        colour: int,
        times: Times = time_columns,
    ) -> None:
        self._times = times
        self._stream, self._entity, self._rate = stream, f"{view}/bars", rate
        self._axes, self._waiting = band_axes(rate), list[tuple[float, float, FloatArray]]()
        named = {number: words for number, words in NAMED.items() if number <= self._axes.x[1]}
        self._axes.draw(stream, f"{view}/axes", named, round_marks(*LEVELS, "dB"))
        style = rr.LineStrips2D.from_fields(colors=colour, radii=LINE)
        stream.log(self._entity, style, static=True)

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
        times = self._times(np.array(time), np.array(angle))
        self._stream.send_columns(self._entity, times, columns)

    def draw_once(self, levels: FloatArray) -> None:
        """Draw bars that stay."""
        strips = rr.LineStrips2D.from_fields(strips=[self._skyline(levels)])
        self._stream.log(self._entity, strips, static=True)

    def _skyline(self, levels: FloatArray) -> FloatArray:
        """``(4n, 2)``: over each of n bands up from the foot of the axes to its level and down.

        One strip, for Rerun takes a strip for each bar thirty times as slowly.
        """
        numbers, low = band_numbers(self._rate), np.full(levels.size, LEVELS[0])
        left, right, top = numbers - 0.5 * BAR, numbers + 0.5 * BAR, levels.clip(*LEVELS)
        corners = [(left, low), (left, top), (right, top), (right, low)]
        return np.stack([self._axes.place(*corner) for corner in corners], axis=1).reshape(-1, 2)
