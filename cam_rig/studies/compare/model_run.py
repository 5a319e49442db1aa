"""Model of a scene, driven with the measured cam motion at a steady speed.

A stretch is a time in which the real cam turns at a steady speed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from cam_rig.acoustics import level_db
from cam_rig.simulation.instruments import Signal, encoder_count
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.schedule import CamState
from cam_rig.simulation.simulate import FollowerSimulator, MicrophoneSimulator
from cam_rig.units import NS, TURN, FloatArray, to_rpm

# Motion of the cam from the readings of an encoder: stretches of steady speed, and cam states.
#: Largest relative difference between the mean speeds of successive turns that count as one steady
#: speed.
SPEED_RTOL = 0.02
#: Largest difference between the mean speeds of successive turns that count as one steady speed, in
#: encoder counts per turn. It replaces `SPEED_RTOL` for coarse encoders, for which it is larger.
SPEED_COUNTS = 4.0
#: Largest cam angle (rad) by which the cam may turn during a gap in the readings. A larger angle
#: ends the stretch of steady speed.
MAX_GAP_ANGLE = TURN / 8.0
#: Number of knots per turn of the spline that is fitted to a cam motion with varying speed.
KNOTS_PER_TURN = 8
#: Smallest number of readings per polynomial piece of the spline that is fitted to a cam motion
#: with varying speed.
READINGS_PER_PIECE = 6
#: Number of successive readings whose angles must be equal for the cam to count as stopped.
STILL_READINGS = 16
#: Largest range (rad) of cam angles that count as equal when the cam is stopped.
STILL_ANGLE = 1e-3
#: The spline is used for a cam motion if the r.m.s. distance of the readings from it is at most
#: this multiple of that from a straight line.
MAX_CURVE_SCATTER = 0.9


@dataclass(frozen=True, eq=False)
class SteadyStretch:
    """Time of steady cam speed, with the cam angle θ as a quadratic spline.

    Attributes
    ----------
    knots
        Times of the knots in s, shape (k,).
    angle
        θ at the knots in rad, not reduced to one turn, shape (k,).
    speed
        Speed at the knots in rad/s, shape (k,).
    scatter
        R.m.s. distance of the readings from the spline, rad.
    largest
        Largest distance of the readings from the spline, rad.
    is_uniform
        True if the speed is constant.
    """

    knots: FloatArray
    angle: FloatArray
    speed: FloatArray
    scatter: float
    largest: float
    is_uniform: bool

    @property
    def mean_speed(self) -> float:
        """Mean cam speed (rad/s) of a time in which the cam turns steadily."""
        return float((self.angle[-1] - self.angle[0]) / (self.knots[-1] - self.knots[0]))

    @property
    def rpm(self) -> float:
        """Mean cam speed in rpm of a time in which the cam turns steadily."""
        return to_rpm(self.mean_speed)

    @property
    def turns(self) -> float:
        """Number of turns (also fractions) in a time in which the cam turns steadily."""
        return float((self.angle[-1] - self.angle[0]) / TURN)

    def angle_at(self, time: FloatArray) -> FloatArray:
        """Return the cam angle θ (rad) at times in s, shape (n,).

        It is not reduced to one turn.
        """
        i = np.clip(np.searchsorted(self.knots, time, side="right") - 1, 0, self.knots.size - 2)
        since, length = time - self.knots[i], self.knots[i + 1] - self.knots[i]
        acceleration = (self.speed[i + 1] - self.speed[i]) / length
        return np.asarray(self.angle[i] + since * (self.speed[i] + 0.5 * acceleration * since))

    def states(self, cam: str, offset: float) -> Iterator[CamState]:
        """Yield the cam states at the knots of the spline.

        ``cam`` is the name of the cam. The cam angle of a state is θ plus `offset` (rad).
        """
        for time, angle, speed in zip(self.knots, self.angle, self.speed, strict=True):
            ns = round(float(time) * NS)
            cam_angle = float(angle + offset + speed * (ns / NS - time))
            yield CamState(ns, cam_angle, float(speed), cam)


def steady_stretches(angle: Signal, min_turns: float) -> list[SteadyStretch]:
    """Return the times in which the cam turns steadily for `min_turns` or more.

    ``angle`` is the encoder's signal. A gap in the readings ends a stretch if the cam turns by more
    than `MAX_GAP_ANGLE` during the gap, because its motion there is unknown.
    """
    count = encoder_count(angle.value)
    gaps = angle.gaps()
    turned = np.diff(angle.value[np.searchsorted(angle.time, gaps)], axis=1).ravel()
    edges = [angle.time[0], *gaps[turned > MAX_GAP_ANGLE].ravel(), angle.time[-1]]
    stretches = []
    for start, end in zip(edges[::2], edges[1::2], strict=True):
        inside = (angle.time >= start) & (angle.time <= end)
        time, value = angle.time[inside], angle.value[inside]
        for first, last in _uniform_parts(time, value, count):
            is_inside = (time >= first) & (time <= last)
            stretch = _fit_motion(time[is_inside], value[is_inside], count)
            if stretch is not None and stretch.turns >= min_turns:
                stretches.append(stretch)
    return stretches


def standstills(angle: Signal) -> FloatArray:
    """Return start and end times (s) of the cam's stops, one row each, (k, 2).

    ``angle`` is the encoder's signal. Stops of fewer than `STILL_READINGS` readings are left out. A
    longer stop can be divided into several successive rows.
    """
    limit = max(STILL_ANGLE, 1.5 * encoder_count(angle.value))
    first = np.arange(0, angle.time.size, STILL_READINGS)
    last = np.minimum(first + STILL_READINGS, angle.time.size - 1)
    low, high = (extreme.reduceat(angle.value, first) for extreme in (np.minimum, np.maximum))
    is_still = (high - low <= limit) & (np.abs(angle.value[last] - angle.value[first]) <= limit)
    # Between two equal readings of the angle, as in a gap, the motion of the cam is unknown.
    gaps = angle.gaps()[:, 0]
    is_bounded = np.searchsorted(gaps, angle.time[first]) == np.searchsorted(gaps, angle.time[last])
    selected = is_still & is_bounded & (last - first == STILL_READINGS)
    return np.column_stack([angle.time[first[selected]], angle.time[last[selected]]])


def _uniform_parts(
    time: FloatArray, angle: FloatArray, count: float
) -> Iterator[tuple[float, float]]:
    """Yield start and end times (s) of times in which the cam turns at a steady speed.

    Each of them consists of whole successive turns with equal mean speeds. ``time`` (s) and
    ``angle`` (rad) are the readings of the encoder, and ``count`` is its resolution in rad.
    """
    rising = np.maximum.accumulate(angle)
    marks = np.arange(rising[0] + 0.5 * count, rising[-1], TURN)
    if marks.size < 2:
        return
    # Among equal readings of the angle, the encoder's count changes after the last.
    crossings = np.interp(marks, rising, time)
    speeds = TURN / np.diff(crossings)
    tolerance = max(SPEED_RTOL, SPEED_COUNTS * count / TURN)
    first, mean = 0, float(speeds[0])
    for i in range(1, speeds.size + 1):
        if i < speeds.size and abs(speeds[i] - mean) <= tolerance * mean:
            mean += (float(speeds[i]) - mean) / (i - first + 1)
            continue
        yield float(crossings[first]), float(crossings[i])
        if i < speeds.size:
            first, mean = i, float(speeds[i])


def _fit_motion(time: FloatArray, angle: FloatArray, count: float) -> SteadyStretch | None:
    """Fit the motion of the cam to angle readings by a line, or by a spline if needed.

    The spline is used if the line is off by more than a count of the encoder (``count``, rad), and
    the spline reduces the scatter to less than `MAX_CURVE_SCATTER` of that of the line. Differences
    of single readings are not used, because they would give a speed that jumps by whole counts per
    reading. Returns None if the cam does not turn forwards.
    """
    if time.size < 4:
        return None
    middle = 0.5 * (time[0] + time[-1])
    line = np.polynomial.Polynomial.fit(time - middle, angle, 1).convert()
    start, speed = float(line.coef[0]), float(line.coef[1])
    if speed <= 0.0:
        return None
    turns = max(1, round(speed * (time[-1] - time[0]) / TURN))
    knots = np.linspace(time[0], time[-1], turns + 1)
    residual = angle - (start + speed * (time - middle))
    line_scatter = float(np.sqrt(np.sum(residual**2) / (time.size - 2)))
    values = start + speed * (knots - middle), np.full_like(knots, speed)
    uniform = SteadyStretch(knots, *values, line_scatter, float(np.abs(residual).max()), True)
    if count and uniform.largest <= count:
        return uniform
    curve = _fit_curve(time, angle, turns)
    return uniform if curve is None or curve.scatter > MAX_CURVE_SCATTER * line_scatter else curve


def _fit_curve(time: FloatArray, angle: FloatArray, turns: int) -> SteadyStretch | None:
    """Fit a quadratic spline to angle readings by least squares.

    The acceleration is constant between knots. Returns None if there are too few readings, or if
    the speed is not positive everywhere.
    """
    from scipy.interpolate import make_lsq_spline

    pieces = min(KNOTS_PER_TURN * turns, time.size // READINGS_PER_PIECE)
    if pieces < 2:
        return None
    knots = np.linspace(time[0], time[-1], pieces + 1)
    if np.histogram(time, knots)[0].min() < 3:
        return None
    spline = make_lsq_spline(time, angle, np.r_[[knots[0]] * 2, knots, [knots[-1]] * 2], k=2)
    residual = angle - spline(time)
    scatter = float(np.sqrt(np.sum(residual**2) / (time.size - pieces - 2)))
    speed = np.asarray(spline(knots, 1))
    if speed.min() <= 0.0:
        return None
    return SteadyStretch(
        knots, np.asarray(spline(knots)), speed, scatter, float(np.abs(residual).max()), False
    )


@dataclass(frozen=True, eq=False)
class ModelRun:
    """Samples of the model's follower, driven with a measured cam motion.

    Attributes
    ----------
    stretch
        The motion of the cam at a steady speed.
    start
        Time in s from which the follower is settled.
    rows
        Samples of the follower, with rows as in `COLUMNS`.
    sound
        End (s), mean square pressure (Pa²) and number of samples of each tick (time between two cam
        states), shape (3, n). It is empty if the rig has no sound parameters.
    """

    stretch: SteadyStretch
    start: float
    rows: FloatArray
    sound: FloatArray

    @property
    def settled(self) -> FloatArray:
        """Samples of the turns after the initial transient, with rows as in `COLUMNS`."""
        return self.rows[:, self.rows[0] >= self.start]

    @property
    def loses_contact(self) -> bool:
        """True if the model's follower loses contact in the settled turns."""
        return bool((self.settled[4] <= 0.0).any())

    def level(self) -> float | None:
        """Return the sound level of the settled turns in dB re 20 µPa.

        It is None if the rig has no sound parameters.
        """
        if not self.sound.size:
            return None
        settled = self.sound[:, self.sound[0] > self.start + 1.0 / NS]
        mean_square = float(np.sum(settled[1] * settled[2]) / np.sum(settled[2]))
        return float(level_db(np.sqrt(mean_square)))


def drive(loaded: LoadedScene, cam: str, stretch: SteadyStretch, offset: float) -> ModelRun:
    """Compute the scene's model with the measured cam motion of a steady speed.

    ``stretch`` is the time of steady speed with the encoder's angle, and ``cam`` the name of the
    cam. The cam angle is the encoder's angle plus `offset` (rad).
    """
    follower, blocks, sound = FollowerSimulator.of(loaded), [], []
    microphone = None if loaded.missing_for_sound else MicrophoneSimulator.of(loaded)
    for state in stretch.states(cam, offset):
        motion = follower.turn_to(state)
        if motion is None:
            continue
        block = motion[1]
        blocks.append(block.rows)
        if microphone is not None:
            pressure = microphone.listen(block.rows, block.interval.mean_speed)
            sound.append((block.interval.stop_ns / NS, pressure**2, float(block.rows.shape[1])))
    settle = loaded.scene.schedule.transient_turns.si * TURN / stretch.mean_speed
    start = float(stretch.knots[0]) + settle
    return ModelRun(stretch, start, np.hstack(blocks), np.array(sound).T)
