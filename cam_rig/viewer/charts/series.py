"""Time series: which curves there are, and sending samples as columns without hiding a peak."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from rerun.components import AggregationPolicy, InterpolationMode

from cam_rig.arrays import FloatArray
from cam_rig.drawing import colours
from cam_rig.units import RPM_PER_RAD_S, TURN
from cam_rig.viewer.timeline import Times, time_columns

#: Rows sent at once: big enough to be fast, small enough to stay out of the way in memory.
ROWS_AT_ONCE = 100_000


@dataclass(frozen=True)
class SeriesLine:
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


@dataclass(frozen=True)
class Mark:
    """Single points on the lift."""

    entity: str
    name: str
    colour: int
    factor: float = 1e3

    def style(self) -> rr.SeriesPoints:
        """How a point looks."""
        return rr.SeriesPoints(colors=self.colour, names=self.name, marker_sizes=4.0)


LIFT = SeriesLine("plots/lift/follower", "follower", colours.LIFT, factor=1e3, width=4.5)
LAW = SeriesLine("plots/lift/law", "law", colours.LAW, factor=1e3, width=1.2)
VELOCITY = SeriesLine("plots/velocity/follower", "velocity", colours.VELOCITY)
ACCELERATION = SeriesLine("plots/acceleration/follower", "acceleration", colours.ACCELERATION)
FORCE = SeriesLine("plots/force/contact", "contact force", colours.FORCE)
ZERO = SeriesLine("plots/force/zero", "0 N", colours.ZERO, width=1.6)
GAP = SeriesLine("plots/gap", "gap", colours.GAP, factor=1e6)
TWIST = SeriesLine("plots/twist", "twist", colours.TWIST, factor=360.0 / TURN)
LEVEL = SeriesLine(
    "plots/level",
    "sound pressure level [dB]",
    colours.LEVEL,
    width=2.0,
    interpolation=InterpolationMode.StepBefore,
    aggregation=AggregationPolicy.Off,
)
SPEED = SeriesLine(
    "plots/speed",
    "cam speed [rpm]",
    colours.SPEED,
    factor=RPM_PER_RAD_S,
    width=2.0,
    interpolation=InterpolationMode.StepAfter,
    aggregation=AggregationPolicy.Off,
)
#: Lift-off and landing.
LIFT_OFF = Mark("plots/lift/lift_off", "lift-off", colours.LIFT_OFF)
LANDING = Mark("plots/lift/landing", "landing", colours.LANDING)


def extremes(values: FloatArray, bucket: int) -> NDArray[np.intp]:
    """Indices, in order, of the minimum and the maximum of every ``bucket`` values."""
    if bucket <= 1:
        return np.arange(values.size)
    # A first occurrence is found, so the padding never stands for itself.
    rows = np.pad(values, (0, -values.size % bucket), mode="edge").reshape(-1, bucket)
    begin = np.arange(rows.shape[0]) * bucket
    pairs = np.stack([begin + rows.argmin(axis=1), begin + rows.argmax(axis=1)], axis=1)
    pairs.sort(axis=1)
    kept = pairs.ravel()
    return kept[np.append(True, kept[1:] != kept[:-1])]


@dataclass
class SeriesWriter:
    """Collects the samples of a curve, or single points, and sends them in big columns.

    ``bucket`` 1 keeps every sample; else the minimum and the maximum of every ``bucket`` are kept.
    """

    stream: rr.RecordingStream
    series: SeriesLine | Mark
    bucket: int = 1
    times: Times = time_columns
    _parts: list[FloatArray] = field(default_factory=list)
    _rows: int = 0

    def __post_init__(self) -> None:
        self.stream.log(self.series.entity, self.series.style(), static=True)

    def add(self, time: FloatArray, angle: FloatArray, values: FloatArray) -> None:
        """Take ``values`` (SI) at ``time`` (s) and unwrapped cam ``angle`` (rad)."""
        if values.size == 0:
            return
        kept = extremes(values, self.bucket)
        self._parts.append(np.stack([time[kept], angle[kept], values[kept] * self.series.factor]))
        self._rows += kept.size
        if self._rows >= ROWS_AT_ONCE:
            self.flush()

    def flush(self) -> None:
        """Send what was collected."""
        if self._parts:
            time, angle, values = np.concatenate(self._parts, axis=1)
            columns = rr.Scalars.columns(scalars=values)
            self.stream.send_columns(self.series.entity, self.times(time, angle), columns)
        self._parts, self._rows = [], 0
