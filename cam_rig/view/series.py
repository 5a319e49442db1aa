"""Time series: which lines there are, and sending samples as columns without hiding a peak."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from rerun.components import AggregationPolicy, InterpolationMode

from cam_rig.dynamics import FloatArray
from cam_rig.view.timeline import time_columns

#: Rows sent at once: big enough to be fast, small enough to stay out of the way in memory.
ROWS_AT_ONCE = 100_000


@dataclass(frozen=True)
class Line:
    """One curve: ``factor`` takes SI to the unit shown, ``colour`` is 0xRRGGBBAA."""

    entity: str
    name: str
    colour: int
    factor: float = 1.0
    width: float = 1.2
    interpolation: InterpolationMode = InterpolationMode.Linear
    #: However far one zooms out, the peaks stay.
    aggregation: AggregationPolicy = AggregationPolicy.MinMax

    def style(self) -> rr.SeriesLines:
        """How the curve looks."""
        return rr.SeriesLines(
            colors=self.colour,
            names=self.name,
            widths=self.width,
            aggregation_policy=self.aggregation,
            interpolation_mode=self.interpolation,
        )


LIFT = Line("plots/lift/follower", "follower", 0x56B4E9FF, factor=1e3)
FORCE = Line("plots/force/contact", "contact", 0xE69F00FF)
ZERO = Line("plots/force/zero", "0 N", 0x999999FF, width=0.8)
LEVEL = Line(
    "plots/level",
    "sound level [dB]",
    0x009E73FF,
    interpolation=InterpolationMode.StepBefore,
    aggregation=AggregationPolicy.Off,
)
SPEED = Line(
    "plots/speed",
    "cam speed [rpm]",
    0xCC79A7FF,
    factor=30.0 / np.pi,
    interpolation=InterpolationMode.StepAfter,
    aggregation=AggregationPolicy.Off,
)
#: Where the follower meets the cam again: markers on the lift.
LANDING = Line("plots/lift/landing", "landing", 0xD55E00FF, factor=1e3)


def extremes(values: FloatArray, bucket: int) -> NDArray[np.intp]:
    """Indices, in order, of the least and the greatest of every ``bucket`` values."""
    if bucket <= 1:
        return np.arange(values.size)
    # A first occurrence is found, so the padding never stands for itself.
    rows = np.pad(values, (0, -values.size % bucket), mode="edge").reshape(-1, bucket)
    begin = np.arange(rows.shape[0]) * bucket
    return np.unique(np.concatenate([begin + rows.argmin(axis=1), begin + rows.argmax(axis=1)]))


@dataclass
class LineWriter:
    """Collects the samples of a line and sends them in big columns.

    ``bucket`` 1 keeps every sample; else the least and the greatest of every ``bucket`` are kept.
    """

    stream: rr.RecordingStream
    line: Line
    bucket: int = 1
    _parts: list[FloatArray] = field(default_factory=list)
    _rows: int = 0

    def __post_init__(self) -> None:
        self.stream.log(self.line.entity, self.line.style(), static=True)

    def add(self, time: FloatArray, angle: FloatArray, values: FloatArray) -> None:
        """Take ``values`` (SI) at ``time`` (s) and unwrapped cam ``angle`` (rad)."""
        kept = extremes(values, self.bucket)
        self._parts.append(np.stack([time[kept], angle[kept], values[kept] * self.line.factor]))
        self._rows += kept.size
        if self._rows >= ROWS_AT_ONCE:
            self.flush()

    def flush(self) -> None:
        """Send what was collected."""
        if self._parts:
            time, angle, values = np.concatenate(self._parts, axis=1)
            columns = rr.Scalars.columns(scalars=values)
            self.stream.send_columns(self.line.entity, time_columns(time, angle), columns)
        self._parts, self._rows = [], 0
