"""The quantities of a run that are drawn over the turn, and how far each goes in a scene."""

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
from cam_rig.dynamics.torsional.model import begin, inner_of
from cam_rig.dynamics.torsional.motion import solve
from cam_rig.laws import Law
from cam_rig.schema import SceneConfig
from cam_rig.schema.quantity import Quantity
from cam_rig.show import looks as colours
from cam_rig.show.chart import round_range
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.simulate import turned_ticks
from cam_rig.units import NS, RPM_PER_RAD_S, TURN, FloatArray
from cam_rig.viewer.timeline import Canvas

# Time series: which curves there are, and sending samples as columns without hiding a peak.

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
#: Lift-off and landing.
LIFT_OFF = Mark("plots/lift/lift_off", "lift-off", colours.LIFT_OFF)
LANDING = Mark("plots/lift/landing", "landing", colours.LANDING)
MARKS = LIFT_OFF, LANDING
#: Few enough to be sent as they are.
UNTHINNED = (ZERO, SPEED, LEVEL, *MARKS)


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
    """Collects a curve's samples, of each ``bucket`` least and greatest, and sends them."""

    canvas: Canvas
    series: SeriesLine | Mark
    bucket: int = 1
    _parts: list[FloatArray] = field(default_factory=list)
    _rows: int = 0

    def __post_init__(self) -> None:
        self.canvas.always(self.series.entity, self.series.style())

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
            self.canvas.rows(self.series.entity, self.canvas.times(time, angle), columns)
        self._parts, self._rows = [], 0


# The twist of the shaft behind the cam, which no message carries.

#: The model whose shaft's twist is shown.
TORSIONAL = "torsional"


class ShaftTwist:
    """The twist of the shaft, solved again as it was: each tick from where the one before ended."""

    def __init__(self, loaded: LoadedScene) -> None:
        self._loaded = loaded
        self._parameters = MODELS[TORSIONAL].parameters(loaded.rig)
        self._end: tuple[str, tuple[float, ...], float] | None = None

    def tick(self, cam: str, interval: Interval, time: FloatArray) -> FloatArray:
        """``(n,)`` twist in rad at ``time`` (s of rig time) within the tick of a cam."""
        known = self._end is not None and self._end[0] == cam
        inner, speed = self._end[1:] if self._end is not None and known else ((), None)
        law, at = self._loaded.laws[cam], interval.start_ns / NS
        driven, state = begin(law, self._parameters, inner, speed, interval)
        motion = solve(law, driven, state, at, interval.duration, interval.acceleration)
        self._end = cam, inner_of(motion), interval.speed_at(interval.duration)
        return motion.at(time.clip(at, motion.stop_time))[0]


#: From and to, and step, of an axis, in the unit shown.
Range = tuple[float, float, float]
Ranges = Mapping[str, Range]


@dataclass(frozen=True)
class Drawn:
    """A quantity with its title and its curve, whose ``factor`` takes SI to the unit shown."""

    key: str
    title: str
    line: SeriesLine


LIFT = Drawn("lift", "Lift [mm]", LIFT_LINE)
VELOCITY = Drawn("velocity", "Velocity [m/s]", VELOCITY_LINE)
ACCELERATION = Drawn("acceleration", "Acceleration [m/s²]", ACCELERATION_LINE)
FORCE = Drawn("force", "Contact force [N]", FORCE_LINE)
GAP = Drawn("gap", "Gap [µm]", GAP_LINE)
TWIST = Drawn("twist", "Twist of the shaft [°]", TWIST_LINE)
#: Turns at each speed, at most, that the axes of a scene are found from.
MAX_TURNS = 50
#: Key of the axis on which the smallest of a scene's gaps can be seen beside its greatest.
CLOSE_GAP = "close_gap"
#: Key of the axis (mm) of the gap where the cam passes angle 0.
ZERO_GAP = "zero_gap"
#: A gap (µm) that is worth an axis of its own, that axis over it, and over the axis of all gaps.
MIN_GAP, CLOSE, MAX_SHARE = 1.0, 4.0, 0.2


def drawn_of(model: str) -> tuple[Drawn, ...]:
    """What is drawn of a model: the gap where it can leave the cam, the twist of a shaft."""
    more = [GAP] if MODELS[model].lifts_off else [TWIST] if model == TORSIONAL else []
    return LIFT, VELOCITY, ACCELERATION, FORCE, *more


def gap_of(law: Law, angle: FloatArray, rows: NamedRows) -> FloatArray:
    """``(n,)`` how far (m) a follower is off its cam at cam ``angle`` (rad); 0 in contact."""
    return np.where(rows.force == 0.0, rows.lift - law(angle), 0.0)


@dataclass(frozen=True)
class SceneRanges:
    """The axis of each quantity by its key: over all cams, and of each cam by its name."""

    whole: Ranges
    by_cam: Mapping[str, Ranges]

    def of(self, cam: str) -> Ranges:
        """A cam's own; of one that the scene does not name, those over all."""
        return self.by_cam.get(cam, self.whole)


def scene_ranges(loaded: LoadedScene) -> SceneRanges:
    """Axes from the least and the greatest of each quantity, at all speeds of the scene.

    The scene is solved for it, as it runs: it takes a few tenths of a second. Of a long scene, the
    first turns at each speed, in which what the step of speed set off dies away.
    """
    loaded = replace(loaded, scene=_shortened(loaded.scene))
    rows = drawn_of(loaded.scene.model)
    shaft = ShaftTwist(loaded) if TWIST in rows else None
    ends: dict[str, FloatArray] = {}
    gaps: dict[tuple[str, float], float] = {}
    at_zero = 0.0
    for tick in turned_ticks(loaded):
        values = [*tick.motion, tick.force]
        if GAP in rows:
            values.append(gap := gap_of(loaded.laws[tick.cam], tick.angle, tick))
            step = tick.cam, tick.interval.speed
            gaps[step] = max(gaps.get(step, 0.0), float(gap.max()))
            passed = tick.angle % TURN < tick.interval.speed / loaded.scene.sample_rate.si
            at_zero = max(at_zero, float(gap[passed].max(initial=0.0)))
        if shaft is not None:
            values.append(shaft.tick(tick.cam, tick.interval, tick.time))
        now = np.array([[row.min(), row.max()] for row in values])
        ends[tick.cam] = _wider(ends.get(tick.cam, now), now)
    whole = reduce(_wider, ends.values())
    by_cam = {cam: _ranges(rows, values) for cam, values in ends.items()}
    more = {**close_gap([*gaps.values()]), ZERO_GAP: round_range(0.0, at_zero * 1e3)}
    return SceneRanges({**_ranges(rows, whole), **more}, by_cam)


def _shortened(scene: SceneConfig) -> SceneConfig:
    """A scene with no more turns than are looked at."""
    program = scene.program
    if program.turns.si <= MAX_TURNS:
        return scene
    turns = Quantity(assumed=float(MAX_TURNS), unit="turns", source="what the axes are drawn for")
    settle = Quantity(assumed=0.0, unit="turns", source="as turns")
    short = program.model_copy(update={"turns": turns, "settle_turns": settle})
    return scene.model_copy(update={"program": short})


def close_gap(gaps: Sequence[float]) -> Ranges:
    """The axis of the smallest gap (m) of any speed, where it is lost on that of all; else none."""
    seen = [gap * GAP.line.factor for gap in gaps if gap * GAP.line.factor >= MIN_GAP]
    if not seen or CLOSE * min(seen) > MAX_SHARE * max(seen):
        return {}
    return {CLOSE_GAP: round_range(0.0, CLOSE * min(seen))}


def _wider(one: FloatArray, other: FloatArray) -> FloatArray:
    """``(k, 2)`` ends of both."""
    low, high = np.minimum(one, other), np.maximum(one, other)
    return np.column_stack([low[:, 0], high[:, 1]])


def _ranges(rows: Sequence[Drawn], ends: FloatArray) -> dict[str, Range]:
    """Round axes that show 0 too, of ``(k, 2)`` ends, SI."""
    shown = {}
    for row, (low, high) in zip(rows, ends.tolist(), strict=True):
        factor = row.line.factor
        shown[row.key] = round_range(min(low, 0.0) * factor, max(high, 0.0) * factor)
    return shown
