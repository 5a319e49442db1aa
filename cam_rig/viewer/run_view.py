"""The run itself: cam and follower, time series, bands and events, on every timeline.

A viewer that follows a run puts its cursor at the newest time it knows of anything. So whatever
is of a tick waits for the tick's curves, and goes after them.
"""

from __future__ import annotations

import math

import numpy as np
import rerun as rr

from cam_rig.laws.sampling import sample
from cam_rig.schema.quantity import ORIGINS, Quantity
from cam_rig.show import looks as colours
from cam_rig.show.looks import four_digits, shortened
from cam_rig.simulation.scene import RELATIVE_NOTE, LoadedScene
from cam_rig.simulation.schedule import CamState
from cam_rig.units import NS, TURN, FloatArray, to_rpm
from cam_rig.viewer import quantities
from cam_rig.viewer.bounce_chart import BounceChart, rebounds
from cam_rig.viewer.level_chart import BandChart, third_octaves
from cam_rig.viewer.quantities import Mark, SceneRanges, SeriesLine, SeriesWriter, drawn_of, gap_of
from cam_rig.viewer.scene2d import Scene2D, frame_mask
from cam_rig.viewer.timeline import Canvas, FramePace, Turn, lift_offs
from cam_rig.viewer.turn_chart import MAX_TITLE, TurnChart

# The time series of a run, tick by tick.

#: s alone, of s, s', s''.
LIFT_OF_LAW = np.array([[1.0, 0.0, 0.0]])


class TimeSeries:
    """Writes the curves and the marks on them, of every ``bucket`` samples least and greatest."""

    def __init__(self, canvas: Canvas, loaded: LoadedScene, bucket: int) -> None:
        self._loaded, self._flew = loaded, False
        self._lines = [quantities.LAW, *(row.line for row in drawn_of(loaded.scene.model))]
        self._writers: dict[SeriesLine | Mark, SeriesWriter] = {
            **{line: SeriesWriter(canvas, line, bucket) for line in self._lines},
            **{one: SeriesWriter(canvas, one) for one in quantities.UNTHINNED},
        }

    def tick(self, start: CamState, end: CamState, angle: FloatArray, rows: FloatArray) -> None:
        """Take one tick: cam ``angle`` (rad) and the block's rows, with a shaft's twist below."""
        time, lift, _, _, force, impulse = rows[:6]
        law = self._law(start, end, angle)
        values = [law, *rows[1:5], *rows[6:]]
        if quantities.GAP_LINE in self._writers:
            values.append(np.where(force == 0.0, lift - law, 0.0))
        for line, drawn in zip(self._lines, values, strict=True):
            self._writers[line].add(time, angle, drawn)
        self.add(quantities.ZERO, start, 0.0)
        self.add(quantities.ZERO, end, 0.0)
        self.add(quantities.SPEED, start, start.speed)
        left, landed = lift_offs(force, self._flew), impulse > 0.0
        self._flew = bool(force[-1] == 0.0)
        for mark, there in zip(quantities.MARKS, (left, landed), strict=True):
            self._writers[mark].add(time[there], angle[there], lift[there])

    def add(self, line: SeriesLine, at: CamState, value: float) -> None:
        """Take a curve's value (SI) at a state."""
        at_end = np.array([at.time_ns / NS]), np.array([at.unwrapped])
        self._writers[line].add(*at_end, np.array([value]))

    def flush(self) -> None:
        """Send what was collected."""
        for writer in self._writers.values():
            writer.flush()

    def _law(self, start: CamState, end: CamState, angle: FloatArray) -> FloatArray:
        law, step = self._loaded.laws[start.cam], start.speed / self._loaded.scene.sample_rate.si
        if not start.holds_until(end):
            return law(angle)
        return sample(law, float(angle[0]), step, angle.size, LIFT_OF_LAW, np.zeros(1))[0]


EVENTS, BANDS = "events", "bands"


class RunView:
    """Draws a run tick by tick; ``pace`` as in `RunRecorder`."""

    def __init__(
        self,
        canvas: Canvas,
        loaded: LoadedScene,
        bucket: int,
        ranges: SceneRanges,
        pace: FramePace | None,
    ) -> None:
        self._canvas, self._loaded, self._rate = canvas, loaded, loaded.scene.sample_rate.si
        self._time_series = TimeSeries(canvas, loaded, bucket)
        self._last: CamState | None = None
        self._bands = BandChart(canvas, BANDS, self._rate, colours.BANDS)
        self._turn_chart = TurnChart(canvas, loaded, ranges, every=pace is None)
        self._scene = Scene2D(canvas, loaded, pace=pace, cursor=self._turn_chart.move_cursor)
        bounces = rebounds(loaded)
        self._bounces = BounceChart(canvas, loaded, ranges.whole) if bounces else None
        self._heard, self._whole = list[tuple[CamState, Turn]](), pace is None
        self._events: list[tuple[float, float, str, str]] = []

    def tick(
        self,
        start: CamState,
        end: CamState,
        angle: FloatArray,
        rows: FloatArray,
        turn: Turn | None,
        profile: FloatArray,
    ) -> None:
        """Draw one tick as `TimeSeries.tick`, the newest whole turn, the cam's contour (m)."""
        self._change(start, profile)
        time, lift, _, _, force, impulse = rows[:6]
        self._time_series.tick(start, end, angle, rows)
        if self._bounces is not None:
            self._bounces.tick(start, end, angle, rows)
        frame = frame_mask(angle, start.until(end).mean_speed / self._rate)
        if frame.any():
            self._scene.frames(time[frame], angle[frame], lift[frame], force[frame])
        landed = impulse > 0.0
        for row in zip(time[landed], angle[landed], impulse[landed], strict=True):
            turns, within = divmod(row[1], TURN)
            words = f"landing at {math.degrees(within):.1f}° of turn {int(turns) + 1}"
            self._events.append((*row[:2], f"{words}, {row[2]:.3g} N·s", "INFO"))
        if turn is not None:
            self._heard.append((end, turn))
            self._turn_chart.add(end, turn)

    def level(self, end: CamState, level: float) -> None:
        """Draw the level (dB) of the tick that ended with a state."""
        self._time_series.add(quantities.LEVEL, end, level)

    def close(self, end: CamState) -> None:
        """Draw the last speed up to the end of the run."""
        if self._last is not None:
            self._time_series.add(quantities.SPEED, end, self._last.speed)

    def show(self, until: float) -> None:
        """Send pictures of cam and follower up to a rig time (s), of which the curves are sent."""
        self._scene.flush(until)

    def flush(self, until: float = math.inf) -> None:
        """Send what was collected so far, the curves first; pictures up to a rig time (s)."""
        self._time_series.flush()
        self._scene.flush(until)
        # of a live run only the newest bars are seen
        for end, turn in self._heard if self._whole else self._heard[-1:]:
            bands = third_octaves(self._loaded.radiation, turn.force, turn.impulse, self._rate)
            self._bands.add(end.time_ns / NS, end.unwrapped, bands)
        self._heard = []
        self._bands.flush()
        self._turn_chart.flush()
        if self._bounces is not None:
            self._bounces.flush()
        if self._events:
            time, angle, words, levels = zip(*self._events, strict=True)
            columns = rr.TextLog.columns(text=words, level=levels)
            times = self._canvas.times(np.array(time), np.array(angle))
            self._canvas.rows(EVENTS, times, columns)
        self._events = []

    def _change(self, state: CamState, profile: FloatArray) -> None:
        last, self._last = self._last, state
        if last is not None and (state.cam, state.speed) == (last.cam, last.speed):
            return
        self.flush()
        if last is None or state.cam != last.cam:
            self._scene.mount(state, profile)
        title = f"{shortened(self._loaded.cams[state.cam].title, MAX_TITLE)}, "
        self._scene.speed(state, title)
        if not self._whole:  # of a bag, a turn is there from its beginning
            self._turn_chart.begin(state)
        words = f"{title}{to_rpm(state.speed):.0f} rpm"
        self._events.append((state.time_ns / NS, state.unwrapped, words, "INFO"))


# What the viewer shows as text: the scene with every number, and a table of results.

HEAD = """| cam | rpm | level [dB] | max force [N] | min force [N] | lift-offs | gap [µm] |
|---|---:|---:|---:|---:|---:|---:|"""


class ResultTable:
    """A table that grows: cams in the scene's order, each with its speeds in theirs."""

    def __init__(self, loaded: LoadedScene) -> None:
        self._loaded = loaded
        self._motion: dict[tuple[str, float], str] = {}
        self._levels: dict[tuple[str, float], float] = {}

    def motion(self, turn: Turn) -> None:
        """Take the newest turn of a cam at a speed."""
        force, law = turn.force, self._loaded.laws[turn.cam]
        count = int(lift_offs(force, bool(force[-1] == 0.0)).sum())
        gap = 1e6 * float(gap_of(law, turn.angle, turn).max()) if count else 0.0
        most, least = four_digits(float(force.max())), four_digits(float(force.min()))
        words = f"| {most} | {least} | {count} | {four_digits(gap)} |"
        self._motion[turn.cam, turn.speed] = words

    def level(self, cam: str, speed: float, level: float) -> None:
        """Take the level (dB) of a cam at a speed (rad/s), measured so far."""
        self._levels[cam, speed] = level

    def words(self, state: str = "") -> str:
        """Markdown; ``state`` of a live run stands in the heading: running, finished."""
        lines = []
        for cam in self._loaded.cams:
            steps = [step for step in self._motion if step[0] == cam]
            lines += [self._line(*step, first=step is steps[0]) for step in steps]
        head = HEAD if self._loaded.calibrated else HEAD.replace("level", "relative level")
        return "\n".join([f"# Results{f', {state}' if state else ''}", "", head, *lines]) + "\n"

    def _line(self, cam: str, speed: float, first: bool) -> str:
        level, rpm = self._levels.get((cam, speed)), to_rpm(speed)
        shown = "settling" if level is None else f"{level:.4g}"
        title = shortened(self._loaded.cams[cam].title, MAX_TITLE) if first else ""
        return f"| {title} | {rpm:.4g} | {shown} {self._motion[cam, speed]}"


def about(loaded: LoadedScene, bucket: int) -> str:
    """Markdown on the scene, its cams and its rig; of ``bucket`` samples two are shown."""
    scene, rig = loaded.scene, loaded.rig
    lines = [
        f"# {scene.title}",
        f"Model `{scene.model}`, {scene.sample_rate.si:g} samples per second, "
        f"{scene.program.turns.si:g} turns at each speed.",
        "The follower is drawn at its simulated lift; contact is lost where the force is zero.",
    ]
    if not loaded.calibrated:
        lines.append(RELATIVE_NOTE)
    if bucket > 1:
        lines.append(f"Of every {bucket} samples the curves show the minimum and the maximum.")
    for name, cam in loaded.cams.items():
        lines += [f"## {cam.title}", f"`{name}`, {cam.follower.type} follower"]
        lines += by_origin(cam.numbers())
    lines += [f"## {rig.title}", f"`{rig.name}`"]
    parts = [*rig.follower, *(rig.radiation or ())]
    lines += by_origin({key: value for key, value in parts if isinstance(value, Quantity)})
    return "\n\n".join(lines) + "\n"


def by_origin(numbers: dict[str, Quantity]) -> list[str]:
    """A paragraph for the given, the assumed and the identified ones of the numbers."""
    lines = []
    for origin in ORIGINS:
        named = [f"{key} {_value(q)}" for key, q in numbers.items() if q.origin == origin]
        if named:
            lines.append(f"**{origin}:** " + "; ".join(named))
    return lines


def _value(quantity: Quantity) -> str:
    values = ", ".join(f"{value:g}" for value in quantity.numbers)
    return values if quantity.unit == "1" else f"{values} {quantity.unit}"
