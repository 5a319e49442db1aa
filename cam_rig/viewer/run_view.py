"""View of a run: cam and follower, time series, bands and events.

A viewer that follows a run sets its cursor to the newest time of any data. All other data of a tick
are therefore sent after the curves of the tick.
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
from cam_rig.viewer.bounce_chart import BounceChart, can_rebound
from cam_rig.viewer.level_chart import BandChart, third_octaves
from cam_rig.viewer.quantities import Mark, SceneRanges, SeriesLine, SeriesWriter, gap_of, plot_rows
from cam_rig.viewer.robot_view import ContactLane, RobotView, RunSound
from cam_rig.viewer.scene2d import Scene2D, frame_mask
from cam_rig.viewer.timeline import Canvas, FramePace, Turn, lift_offs
from cam_rig.viewer.turn_chart import MAX_TITLE, TurnChart

# Time series of a run, tick by tick.

#: Weights of the lift s and its derivatives s' and s'' by the cam angle that select the lift.
LIFT_OF_LAW = np.array([[1.0, 0.0, 0.0]])


class TimeSeries:
    """Writer of the curves of a run and the marks on them.

    Each curve keeps the minimum and the maximum of every ``bucket`` samples.
    """

    def __init__(self, canvas: Canvas, loaded: LoadedScene, bucket: int) -> None:
        self._loaded, self._was_off = loaded, False
        self._lines = [quantities.LAW, *(row.line for row in plot_rows(loaded.scene.model))]
        self._writers: dict[SeriesLine | Mark, SeriesWriter] = {
            **{line: SeriesWriter(canvas, line, bucket) for line in self._lines},
            **{series: SeriesWriter(canvas, series) for series in quantities.UNTHINNED},
        }

    def tick(self, start: CamState, end: CamState, angle: FloatArray, rows: FloatArray) -> None:
        """Add the samples of one tick, the time between two cam states, to the curves.

        `angle` contains their unwrapped cam angles in rad, shape (n,). `rows` contains time (s),
        lift (m), velocity (m/s), acceleration (m/s²), contact force (N) and landing impulse (N·s),
        and the twist of the shaft (rad) if the model has an elastic shaft.
        """
        time, lift, _, _, force, impulse = rows[:6]
        law = self._loaded.laws[start.cam]
        if start.is_steady_until(end):
            step = start.speed / self._loaded.scene.sample_rate.si
            law_lift = sample(law, float(angle[0]), step, angle.size, LIFT_OF_LAW, np.zeros(1))[0]
        else:
            law_lift = law(angle)
        values = [law_lift, *rows[1:5], *rows[6:]]
        if quantities.GAP_LINE in self._writers:
            values.append(np.where(force == 0.0, lift - law_lift, 0.0))
        for line, samples in zip(self._lines, values, strict=True):
            self._writers[line].add(time, angle, samples)
        self.add(quantities.ZERO, start, 0.0)
        self.add(quantities.ZERO, end, 0.0)
        self.add(quantities.SPEED, start, start.speed)
        lifted_off, landed = lift_offs(force, self._was_off), impulse > 0.0
        self._was_off = bool(force[-1] == 0.0)
        for mark, mask in zip(quantities.MARKS, (lifted_off, landed), strict=True):
            self._writers[mark].add(time[mask], angle[mask], lift[mask])

    def add(self, line: SeriesLine, state: CamState, value: float) -> None:
        """Add a single value (SI) to a curve, at the time of a cam state."""
        times = np.array([state.time_ns / NS]), np.array([state.unwrapped])
        self._writers[line].add(*times, np.array([value]))

    def flush(self) -> None:
        """Send the samples that were added since the last call to the recording."""
        for writer in self._writers.values():
            writer.flush()


#: Entity path of the texts that report lift-offs, landings and changes in the run.
EVENTS = "events"
#: Entity path of the chart of third-octave bands.
BANDS = "bands"


class RunView:
    """View of a run in a recording, drawn tick by tick.

    The parameters have the same meaning as those of `RunRecorder`. A tick is the time between two
    cam states.
    """

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
        bounces = can_rebound(loaded)
        self._bounces = BounceChart(canvas, loaded, ranges.all_cams) if bounces else None
        self._new_turns, self._finished = list[tuple[CamState, Turn]](), pace is None
        has_sound = self._finished and not loaded.missing_for_sound
        self._robot = RobotView(canvas, loaded) if self._finished else None
        self._lane = ContactLane(canvas) if self._finished else None
        self._sound = RunSound(canvas, loaded) if has_sound else None
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
        """Draw one tick of the run.

        Parameters
        ----------
        start, end : CamState
            States at the ends of the tick.
        angle : ndarray
            Unwrapped cam angle of the samples in rad, shape (n,).
        rows : ndarray
            Samples: time (s), lift (m), velocity (m/s), acceleration (m/s²), contact force (N),
            landing impulse (N·s), and twist (rad) if the model has an elastic shaft.
        turn : Turn, optional
            Newest complete turn, if the tick completes one.
        profile : ndarray
            Contour of the cam in m, shape (m, 2).
        """
        self._change(start, profile)
        time, lift, _, _, force, impulse = rows[:6]
        self._time_series.tick(start, end, angle, rows)
        if self._bounces is not None:
            self._bounces.tick(start, end, angle, rows)
        frame = frame_mask(angle, start.until(end).mean_speed / self._rate)
        if frame.any():
            self._scene.frames(time[frame], angle[frame], lift[frame], force[frame])
            if self._robot is not None:
                self._robot.frames(time[frame], angle[frame], lift[frame])
        if self._lane is not None:
            self._lane.add(time, angle, force)
        if self._sound is not None:
            self._sound.add(start, end, force, impulse)
        landed = impulse > 0.0
        for row in zip(time[landed], angle[landed], impulse[landed], strict=True):
            turns, within = divmod(row[1], TURN)
            text = f"landing at {math.degrees(within):.1f}° of turn {int(turns) + 1}"
            self._events.append((*row[:2], f"{text}, {row[2]:.3g} N·s", "INFO"))
        if turn is not None:
            self._new_turns.append((end, turn))
            self._turn_chart.add(end, turn)

    def level(self, end: CamState, level: float) -> None:
        """Draw the sound level (dB) of the tick that ended with a cam state.

        A tick is the time between two cam states.
        """
        self._time_series.add(quantities.LEVEL, end, level)

    def close(self, end: CamState) -> None:
        """Draw the speed of the cam up to the end of the run, and write its sound."""
        if self._sound is not None:
            self._sound.close()
        if self._last is not None:
            self._time_series.add(quantities.SPEED, end, self._last.speed)

    def show(self, until: float) -> None:
        """Send the pictures of cam and follower up to a rig time (s).

        The curves up to this time must have been sent before.
        """
        self._scene.flush(until)

    def flush(self, until: float = math.inf) -> None:
        """Send the collected data to the recording, the curves first.

        Pictures are sent up to the rig time `until` (s).
        """
        self._time_series.flush()
        self._scene.flush(until)
        # A live run only displays the newest bars of the sound.
        for end, turn in self._new_turns if self._finished else self._new_turns[-1:]:
            bands = third_octaves(self._loaded.radiation, turn.force, turn.impulse, self._rate)
            self._bands.add(end.time_ns / NS, end.unwrapped, bands)
        self._new_turns = []
        self._bands.flush()
        self._turn_chart.flush()
        if self._bounces is not None:
            self._bounces.flush()
        if self._events:
            time, angle, texts, levels = zip(*self._events, strict=True)
            columns = rr.TextLog.columns(text=texts, level=levels)
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
            if self._robot is not None:
                self._robot.mount(state)
        title = f"{shortened(self._loaded.cams[state.cam].title, MAX_TITLE)}, "
        self._scene.speed(state, title)
        if not self._finished:  # live: no turn at this speed is complete yet
            self._turn_chart.begin(state)
        text = f"{title}{to_rpm(state.speed):.0f} rpm"
        self._events.append((state.time_ns / NS, state.unwrapped, text, "INFO"))


# Texts in the viewer: the scene with every number, and a table of results.

HEAD = """| cam | rpm | level [dB] | max force [N] | min force [N] | lift-offs | gap [µm] |
|---|---:|---:|---:|---:|---:|---:|"""


class ResultTable:
    """Table of results with one row per cam and speed, in the order of the scene."""

    def __init__(self, loaded: LoadedScene) -> None:
        self._loaded = loaded
        self._motion: dict[tuple[str, float], str] = {}
        self._levels: dict[tuple[str, float], float] = {}

    def motion(self, turn: Turn) -> None:
        """Set the row of a cam and speed in the table of results.

        `turn` is the newest turn of the cam, from which the results are computed.
        """
        force, law = turn.force, self._loaded.laws[turn.cam]
        count = int(lift_offs(force, bool(force[-1] == 0.0)).sum())
        gap = 1e6 * float(gap_of(law, turn.angle, turn).max()) if count else 0.0
        max_force, min_force = four_digits(float(force.max())), four_digits(float(force.min()))
        cells = f"| {max_force} | {min_force} | {count} | {four_digits(gap)} |"
        self._motion[turn.cam, turn.speed] = cells

    def level(self, cam: str, speed: float, level: float) -> None:
        """Set the sound level (dB) of a cam at a speed (rad/s) in the table of results."""
        self._levels[cam, speed] = level

    def text(self, state: str = "") -> str:
        """Return the table as Markdown.

        The heading contains the ``state`` of a live run, such as running or finished.
        """
        lines = []
        for cam in self._loaded.cams:
            steps = [step for step in self._motion if step[0] == cam]
            lines += [self._line(*step, first=step is steps[0]) for step in steps]
        head = HEAD if self._loaded.calibrated else HEAD.replace("level", "relative level")
        return "\n".join([f"# Results{f', {state}' if state else ''}", "", head, *lines]) + "\n"

    def _line(self, cam: str, speed: float, first: bool) -> str:
        level, rpm = self._levels.get((cam, speed)), to_rpm(speed)
        level_text = "settling" if level is None else f"{level:.4g}"
        title = shortened(self._loaded.cams[cam].title, MAX_TITLE) if first else ""
        return f"| {title} | {rpm:.4g} | {level_text} {self._motion[cam, speed]}"


def about(loaded: LoadedScene, bucket: int) -> str:
    """Return a description of the scene, its cams and its rig as Markdown.

    It also states that the curves show the minimum and the maximum of every ``bucket`` samples.
    """
    scene, rig = loaded.scene, loaded.rig
    lines = [
        f"# {scene.title}",
        f"Model `{scene.model}`, {scene.sample_rate.si:g} samples per second, "
        f"{scene.schedule.turns.si:g} turns at each speed.",
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
    """Return a Markdown paragraph each on the given, assumed and identified numbers.

    A number is given by a source, assumed, or identified from measurements. `numbers` contains the
    quantities by key. A paragraph without numbers is left out.
    """
    lines = []
    for origin in ORIGINS:
        texts = []
        for key, quantity in numbers.items():
            values = ", ".join(f"{value:g}" for value in quantity.numbers)
            unit = "" if quantity.unit == "1" else f" {quantity.unit}"
            texts += [f"{key} {values}{unit}"] if quantity.origin == origin else []
        if texts:
            lines.append(f"**{origin}:** " + "; ".join(texts))
    return lines
