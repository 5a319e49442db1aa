"""The model of a scene, driven along a steady stretch of a real cam's motion."""

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

# The cam's motion through the counts of an encoder: steady stretches, and states along them.

#: Turns whose mean speeds differ by less than this part are of one speed; or by this many counts.
SAME_SPEED, SAME_COUNTS = 0.02, 4.0
#: A gap in which the cam turned by less (rad) does not end a stretch.
SMALL_GAP = TURN / 8.0
#: Knots a turn of a motion that is not steady, and readings between two, at least.
KNOTS, READINGS = 8, 6
#: Readings that are of one angle while the cam stands still, and the range of these angles, rad.
STILL_READINGS = 16
STILL = 1e-3
#: A line is kept unless a curve leaves less than this part of its scatter.
BETTER = 0.9


@dataclass(frozen=True, eq=False)
class SteadyStretch:
    """Turns at one speed: θ at ``knots`` (s), with quadratic pieces between them.

    ``angle``, ``speed``: ``(k,)`` rad with all turns, and rad/s, at the knots; ``scatter``,
    ``largest``: r.m.s. and largest distance of the readings from the motion, rad; ``line``: whether
    one speed is held throughout.
    """

    knots: FloatArray
    angle: FloatArray
    speed: FloatArray
    scatter: float
    largest: float
    line: bool

    @property
    def mean_speed(self) -> float:
        """rad/s."""
        return float((self.angle[-1] - self.angle[0]) / (self.knots[-1] - self.knots[0]))

    @property
    def rpm(self) -> float:
        """Mean speed in rpm."""
        return to_rpm(self.mean_speed)

    @property
    def turns(self) -> float:
        """How many."""
        return float((self.angle[-1] - self.angle[0]) / TURN)

    def at(self, time: FloatArray) -> FloatArray:
        """θ (rad, with all turns) at times ``(n,)``."""
        i = np.clip(np.searchsorted(self.knots, time, side="right") - 1, 0, self.knots.size - 2)
        since, length = time - self.knots[i], self.knots[i + 1] - self.knots[i]
        acceleration = (self.speed[i + 1] - self.speed[i]) / length
        return np.asarray(self.angle[i] + since * (self.speed[i] + 0.5 * acceleration * since))

    def states(self, cam: str, offset: float) -> Iterator[CamState]:
        """The states of a cam that is ``offset`` (rad) ahead of the angle."""
        for time, angle, speed in zip(self.knots, self.angle, self.speed, strict=True):
            ns = round(float(time) * NS)
            there = float(angle + offset + speed * (ns / NS - time))
            yield CamState(ns, there, float(speed), cam)


def steady_stretches(angle: Signal, least_turns: float) -> list[SteadyStretch]:
    """The parts of a run in which the cam turns steadily for ``least_turns`` turns or more.

    A gap in the readings ends a stretch, as what the cam did there is not known; not one in which
    it turned by a small part of a turn.
    """
    count = encoder_count(angle.value)
    gaps = angle.gaps()
    turned = np.diff(angle.value[np.searchsorted(angle.time, gaps)], axis=1).ravel()
    edges = [angle.time[0], *gaps[turned > SMALL_GAP].ravel(), angle.time[-1]]
    found = []
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        inside = (angle.time >= begin) & (angle.time <= end)
        time, value = angle.time[inside], angle.value[inside]
        for first, last in _alike(time, value, count):
            part = (time >= first) & (time <= last)
            stretch = _smoothed(time[part], value[part], count)
            if stretch is not None and stretch.turns >= least_turns:
                found.append(stretch)
    return found


def standstills(angle: Signal) -> FloatArray:
    """Return the times (s) between which the cam stands still, ``(k, 2)``, without short ones."""
    near = max(STILL, 1.5 * encoder_count(angle.value))
    first = np.arange(0, angle.time.size, STILL_READINGS)
    last = np.minimum(first + STILL_READINGS, angle.time.size - 1)
    low, high = (part.reduceat(angle.value, first) for part in (np.minimum, np.maximum))
    still = (high - low <= near) & (np.abs(angle.value[last] - angle.value[first]) <= near)
    # Between two readings of one angle, as in a gap, nothing is known of the cam.
    gaps = angle.gaps()[:, 0]
    bounded = np.searchsorted(gaps, angle.time[first]) == np.searchsorted(gaps, angle.time[last])
    found = still & bounded & (last - first == STILL_READINGS)
    return np.column_stack([angle.time[first[found]], angle.time[last[found]]])


def _alike(time: FloatArray, angle: FloatArray, count: float) -> Iterator[tuple[float, float]]:
    """Times between which neighbouring turns are of one speed."""
    rising = np.maximum.accumulate(angle)
    marks = np.arange(rising[0] + 0.5 * count, rising[-1], TURN)
    if marks.size < 2:
        return
    # The last reading of a plateau is where the count changes.
    crossings = np.interp(marks, rising, time)
    speeds = TURN / np.diff(crossings)
    same = max(SAME_SPEED, SAME_COUNTS * count / TURN)
    first, mean = 0, float(speeds[0])
    for i in range(1, speeds.size + 1):
        if i < speeds.size and abs(speeds[i] - mean) <= same * mean:
            mean += (float(speeds[i]) - mean) / (i - first + 1)
            continue
        yield float(crossings[first]), float(crossings[i])
        if i < speeds.size:
            first, mean = i, float(speeds[i])


def _smoothed(time: FloatArray, angle: FloatArray, count: float) -> SteadyStretch | None:
    """A line through the readings; where it leaves more than a count and a curve less, the curve.

    A difference of counts would be a speed that jumps by whole counts a reading.
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
    off = angle - (start + speed * (time - middle))
    off_line = float(np.sqrt(np.sum(off**2) / (time.size - 2)))
    values = start + speed * (knots - middle), np.full_like(knots, speed)
    steady = SteadyStretch(knots, *values, off_line, float(np.abs(off).max()), True)
    if count and steady.largest <= count:
        return steady
    curve = _curve(time, angle, turns)
    return steady if curve is None or curve.scatter > BETTER * off_line else curve


def _curve(time: FloatArray, angle: FloatArray, turns: int) -> SteadyStretch | None:
    """A quadratic spline by least squares: the acceleration is constant from knot to knot."""
    from scipy.interpolate import make_lsq_spline

    pieces = min(KNOTS * turns, time.size // READINGS)
    if pieces < 2:
        return None
    knots = np.linspace(time[0], time[-1], pieces + 1)
    if np.histogram(time, knots)[0].min() < 3:
        return None
    spline = make_lsq_spline(time, angle, np.r_[[knots[0]] * 2, knots, [knots[-1]] * 2], k=2)
    off = angle - spline(time)
    scatter = float(np.sqrt(np.sum(off**2) / (time.size - pieces - 2)))
    speed = np.asarray(spline(knots, 1))
    if speed.min() <= 0.0:
        return None
    return SteadyStretch(
        knots, np.asarray(spline(knots)), speed, scatter, float(np.abs(off).max()), False
    )


@dataclass(frozen=True, eq=False)
class ModelRun:
    """The follower's samples, rows as in `COLUMNS`, from where it is put down on its cam.

    ``begin``: s, from here on it is settled; ``sound``: ``(3, n)``, for each tick its end (s), mean
    square pressure (Pa²), samples; empty if the rig has no numbers of its sound.
    """

    stretch: SteadyStretch
    begin: float
    rows: FloatArray
    sound: FloatArray

    @property
    def settled(self) -> FloatArray:
        """The settled samples."""
        return self.rows[:, self.rows[0] >= self.begin]

    @property
    def flies(self) -> bool:
        """Whether contact is lost in its settled turns."""
        return bool((self.settled[4] <= 0.0).any())

    def level(self) -> float | None:
        """Return the level of the settled turns in dB re 20 µPa, None without sound."""
        if not self.sound.size:
            return None
        settled = self.sound[:, self.sound[0] > self.begin + 1.0 / NS]
        mean = float(np.sum(settled[1] * settled[2]) / np.sum(settled[2]))
        return float(level_db(np.sqrt(mean)))


def drive(loaded: LoadedScene, cam: str, stretch: SteadyStretch, offset: float) -> ModelRun:
    """Turn a cam of a scene as the stretch says, its angle ahead of it by ``offset`` (rad)."""
    follower, blocks, sound = FollowerSimulator.of(loaded), [], []
    microphone = None if loaded.missing_for_sound else MicrophoneSimulator.of(loaded)
    for state in stretch.states(cam, offset):
        turned = follower.turn_to(state)
        if turned is None:
            continue
        block = turned[1]
        blocks.append(block.rows)
        if microphone is not None:
            pressure = microphone.listen(block.rows, block.interval.mean_speed)
            sound.append((block.interval.stop_ns / NS, pressure**2, float(block.rows.shape[1])))
    settle = loaded.scene.program.settle_turns.si * TURN / stretch.mean_speed
    begin = float(stretch.knots[0]) + settle
    return ModelRun(stretch, begin, np.hstack(blocks), np.array(sound).T)
