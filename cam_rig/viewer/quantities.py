"""Plotted quantities of a run, their time series and their axis ranges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from rerun.components import AggregationPolicy, InterpolationMode

from cam_rig.dynamics import MODELS, Interval
from cam_rig.dynamics.interval import NamedRows
from cam_rig.dynamics.torsional.model import inner_state, start_state
from cam_rig.dynamics.torsional.motion import solve
from cam_rig.laws import Law
from cam_rig.schema import SceneConfig
from cam_rig.schema.quantity import Quantity
from cam_rig.show import looks as colours
from cam_rig.show.chart import round_range
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.simulate import simulate_ticks
from cam_rig.units import NS, RPM_PER_RAD_S, TURN, FloatArray
from cam_rig.viewer.timeline import Canvas

# Curves over time, and the writer of their samples, which keeps every peak.

#: Number of samples of a curve that are sent to Rerun at once: large enough to be fast, small
#: enough for the memory.
ROWS_AT_ONCE = 100_000


@dataclass(frozen=True)
class SeriesLine:
    """Style of the curve of a quantity.

    `entity` is the path of the curve in the recording, and `name` its label. `factor` converts SI
    to the displayed unit. `colour` is 0xRRGGBBAA, and `width` is in points of the screen.
    """

    entity: str
    name: str
    colour: int
    factor: float = 1.0
    width: float = 1.2
    interpolation: InterpolationMode = InterpolationMode.Linear
    #: Method by which Rerun reduces samples to the pixels of the screen. It keeps the peaks at any
    #: zoom.
    aggregation: AggregationPolicy = AggregationPolicy.MinMax

    def style(self) -> rr.SeriesLines:
        """Return the style of a quantity's curve as a Rerun archetype."""
        return rr.SeriesLines(
            colors=self.colour,
            names=self.name,
            widths=self.width,
            aggregation_policy=self.aggregation,
            interpolation_mode=self.interpolation,
        )


@dataclass(frozen=True)
class Mark:
    """Style of single points on the curve of the lift.

    `entity` is the path of the points in the recording, and `name` their label. `colour` is
    0xRRGGBBAA. `factor` converts m to mm.
    """

    entity: str
    name: str
    colour: int
    factor: float = 1e3

    def style(self) -> rr.SeriesPoints:
        """Return the style of marks on the curve of the lift as a Rerun archetype."""
        return rr.SeriesPoints(colors=self.colour, names=self.name, marker_sizes=4.0)


LIFT_LINE = SeriesLine("plots/lift/follower", "follower", colours.LIFT, factor=1e3, width=4.5)
LAW = SeriesLine("plots/lift/law", "law", colours.LAW, factor=1e3, width=1.2)
VELOCITY_LINE = SeriesLine("plots/velocity/follower", "velocity", colours.VELOCITY)
ACCELERATION_LINE = SeriesLine("plots/acceleration/follower", "acceleration", colours.ACCELERATION)
FORCE_LINE = SeriesLine("plots/force/contact", "contact force", colours.FORCE)
ZERO = SeriesLine("plots/force/zero", "0 N", colours.ZERO, width=1.6)
GAP_LINE = SeriesLine("plots/gap", "gap", colours.GAP, factor=1e6)
TWIST_LINE = SeriesLine("plots/twist", "twist", colours.TWIST, factor=360.0 / TURN)
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
#: Marks of lift-offs and landings on the curve of the lift.
LIFT_OFF = Mark("plots/lift/lift_off", "lift-off", colours.LIFT_OFF)
LANDING = Mark("plots/lift/landing", "landing", colours.LANDING)
MARKS = LIFT_OFF, LANDING
#: Curves and marks that are sent with all points, without reduction, because they have few points.
UNTHINNED = (ZERO, SPEED, LEVEL, *MARKS)


def extremes(values: FloatArray, bucket: int) -> NDArray[np.intp]:
    """Return the indices of the minimum and the maximum of every bucket of values.

    A bucket is a group of `bucket` successive values. The indices are in order, each once. With a
    bucket of 1 all indices are returned.
    """
    if bucket <= 1:
        return np.arange(values.size)
    # argmin and argmax return the first occurrence, so no index points into the padding.
    rows = np.pad(values, (0, -values.size % bucket), mode="edge").reshape(-1, bucket)
    starts = np.arange(rows.shape[0]) * bucket
    pairs = np.stack([starts + rows.argmin(axis=1), starts + rows.argmax(axis=1)], axis=1)
    pairs.sort(axis=1)
    indices = pairs.ravel()
    return indices[np.append(True, indices[1:] != indices[:-1])]


@dataclass
class SeriesWriter:
    """Writer of the samples of one curve to a recording.

    It keeps the minimum and the maximum of every ``bucket`` samples.
    """

    canvas: Canvas
    series: SeriesLine | Mark
    bucket: int = 1
    _parts: list[FloatArray] = field(default_factory=list)
    _rows: int = 0

    def __post_init__(self) -> None:
        self.canvas.log_static(self.series.entity, self.series.style())

    def add(self, time: FloatArray, angle: FloatArray, values: FloatArray) -> None:
        """Add samples of one curve at rig times (s) and unwrapped cam angles (rad).

        The values are in SI. All arrays have the shape ``(n,)``.
        """
        if values.size == 0:
            return
        indices = extremes(values, self.bucket)
        self._parts.append(
            np.stack([time[indices], angle[indices], values[indices] * self.series.factor])
        )
        self._rows += indices.size
        if self._rows >= ROWS_AT_ONCE:
            self.flush()

    def flush(self) -> None:
        """Send the samples that were added to the curve since the last call."""
        if self._parts:
            time, angle, values = np.concatenate(self._parts, axis=1)
            columns = rr.Scalars.columns(scalars=values)
            self.canvas.rows(self.series.entity, self.canvas.times(time, angle), columns)
        self._parts, self._rows = [], 0


# Twist of the shaft behind the cam, which no message contains.

#: Name of the model with an elastic shaft. The twist of the shaft is plotted for this model only.
TORSIONAL = "torsional"


class ShaftTwist:
    """Twist of the elastic shaft in a run, recomputed from the recorded cam states.

    No message contains the twist. For each tick (the time between two cam states), the motion is
    solved from the state at the end of the previous tick.
    """

    def __init__(self, loaded: LoadedScene) -> None:
        self._loaded = loaded
        self._parameters = MODELS[TORSIONAL].parameters(loaded.rig)
        self._end: tuple[str, tuple[float, ...], float] | None = None

    def tick(self, cam: str, interval: Interval, time: FloatArray) -> FloatArray:
        """Return the twist (rad) at rig times ``time`` (s) of a tick, shape (n,).

        A tick is the time between two cam states.
        """
        is_same_cam = self._end is not None and self._end[0] == cam
        inner, speed = self._end[1:] if self._end is not None and is_same_cam else ((), None)
        law, start_time = self._loaded.laws[cam], interval.start_ns / NS
        driven, state = start_state(law, self._parameters, inner, speed, interval)
        motion = solve(law, driven, state, start_time, interval.duration, interval.acceleration)
        self._end = cam, inner_state(motion), interval.speed_at(interval.duration)
        return motion.at(time.clip(start_time, motion.stop_time))[0]


#: Lower limit, upper limit and step of the axis of a quantity, in its displayed unit.
Range = tuple[float, float, float]
Ranges = Mapping[str, Range]


@dataclass(frozen=True)
class PlotRow:
    """Plotted quantity of a run: its key, its title and its curve."""

    key: str
    title: str
    line: SeriesLine


LIFT = PlotRow("lift", "Lift [mm]", LIFT_LINE)
VELOCITY = PlotRow("velocity", "Velocity [m/s]", VELOCITY_LINE)
ACCELERATION = PlotRow("acceleration", "Acceleration [m/s²]", ACCELERATION_LINE)
FORCE = PlotRow("force", "Contact force [N]", FORCE_LINE)
GAP = PlotRow("gap", "Gap [µm]", GAP_LINE)
TWIST = PlotRow("twist", "Twist of the shaft [°]", TWIST_LINE)
#: Largest number of turns per speed that are simulated to determine the axes of a scene.
MAX_TURNS = 50
#: Key of an additional axis of the gap between follower and cam, which resolves the smallest gap of
#: a scene.
CLOSE_GAP = "close_gap"
#: Key of the axis (mm) of the gap at cam angle 0.
ZERO_GAP = "zero_gap"
#: Smallest gap between follower and cam (µm) for which an additional, enlarged axis is shown.
MIN_GAP = 1.0
#: Upper limit of the additional, enlarged axis of the gap, as a multiple of the smallest gap.
CLOSE_GAP_FACTOR = 4.0
#: Condition for the additional axis, which shows small gaps between follower and cam enlarged: its
#: upper limit is at most this fraction of the largest gap. Otherwise the common axis of all gaps
#: resolves the smallest gap too.
MAX_SHARE = 0.2


def plot_rows(model: str) -> tuple[PlotRow, ...]:
    """Return the plotted quantities of a model, in the order of their plots.

    The gap is included if the follower can lift off, and the twist if the model has an elastic
    shaft.
    """
    extra = [GAP] if MODELS[model].lifts_off else [TWIST] if model == TORSIONAL else []
    return LIFT, VELOCITY, ACCELERATION, FORCE, *extra


def gap_of(law: Law, angle: FloatArray, rows: NamedRows) -> FloatArray:
    """Return the gap (m) between follower and cam at cam ``angle`` (rad), shape (n,).

    It is 0 in contact.
    """
    return np.where(rows.force == 0.0, rows.lift - law(angle), 0.0)


@dataclass(frozen=True)
class SceneRanges:
    """Axis ranges of the quantities, by key.

    `all_cams` are those of all cams together, `by_cam` those of each cam by its name.
    """

    all_cams: Ranges
    by_cam: Mapping[str, Ranges]

    def of(self, cam: str) -> Ranges:
        """Return the axis ranges of a cam, or the common ranges if the cam is not known."""
        return self.by_cam.get(cam, self.all_cams)


def scene_ranges(loaded: LoadedScene) -> SceneRanges:
    """Return the axis ranges of all quantities, from a simulation of the scene.

    The axes contain the smallest and the largest value at all speeds. The simulation takes a few
    tenths of a second. Of a long scene only the first `MAX_TURNS` turns at each speed are
    simulated, in which the transient of the speed step decays.
    """
    loaded = replace(loaded, scene=_shortened(loaded.scene))
    rows = plot_rows(loaded.scene.model)
    shaft = ShaftTwist(loaded) if TWIST in rows else None
    limits: dict[str, FloatArray] = {}
    gaps: dict[tuple[str, float], float] = {}
    max_gap_at_zero = 0.0
    for tick in simulate_ticks(loaded):
        values = [*tick.motion, tick.force]
        if GAP in rows:
            values.append(gap := gap_of(loaded.laws[tick.cam], tick.angle, tick))
            step = tick.cam, tick.interval.speed
            gaps[step] = max(gaps.get(step, 0.0), float(gap.max()))
            at_angle_zero = tick.angle % TURN < tick.interval.speed / loaded.scene.sample_rate.si
            max_gap_at_zero = max(max_gap_at_zero, float(gap[at_angle_zero].max(initial=0.0)))
        if shaft is not None:
            values.append(shaft.tick(tick.cam, tick.interval, tick.time))
        new_limits = np.array([[row.min(), row.max()] for row in values])
        limits[tick.cam] = _wider(limits.get(tick.cam, new_limits), new_limits)
    overall = reduce(_wider, limits.values())
    by_cam = {cam: _ranges(rows, values) for cam, values in limits.items()}
    gap_axes = {**close_gap([*gaps.values()]), ZERO_GAP: round_range(0.0, max_gap_at_zero * 1e3)}
    return SceneRanges({**_ranges(rows, overall), **gap_axes}, by_cam)


def _shortened(scene: SceneConfig) -> SceneConfig:
    """Return the scene with at most `MAX_TURNS` turns at each speed, for the axes."""
    schedule = scene.schedule
    if schedule.turns.si <= MAX_TURNS:
        return scene
    turns = Quantity(assumed=float(MAX_TURNS), unit="turns", source="what the axes are drawn for")
    settle = Quantity(assumed=0.0, unit="turns", source="as turns")
    short = schedule.model_copy(update={"turns": turns, "transient_turns": settle})
    return scene.model_copy(update={"schedule": short})


def close_gap(gaps: Sequence[float]) -> Ranges:
    """Return the range of an additional axis that shows the smallest gap enlarged.

    `gaps` contains the largest gap (m) between follower and cam at each speed. Returns an empty
    dict if the common axis of all gaps resolves the smallest gap too.
    """
    visible = [gap * GAP.line.factor for gap in gaps if gap * GAP.line.factor >= MIN_GAP]
    if not visible or CLOSE_GAP_FACTOR * min(visible) > MAX_SHARE * max(visible):
        return {}
    return {CLOSE_GAP: round_range(0.0, CLOSE_GAP_FACTOR * min(visible))}


def _wider(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return limits that include both ``first`` and ``second``, shape (k, 2).

    The limits are the minimum and the maximum of k quantities.
    """
    low, high = np.minimum(first, second), np.maximum(first, second)
    return np.column_stack([low[:, 0], high[:, 1]])


def _ranges(rows: Sequence[PlotRow], ends: FloatArray) -> dict[str, Range]:
    """Return the axis ranges of quantities from their limits ``(k, 2)`` in SI units.

    The ranges are rounded, in displayed units, and contain 0. `rows` are the plotted quantities,
    and `ends` their limits.
    """
    axes = {}
    for row, (low, high) in zip(rows, ends.tolist(), strict=True):
        factor = row.line.factor
        axes[row.key] = round_range(min(low, 0.0) * factor, max(high, 0.0) * factor)
    return axes
