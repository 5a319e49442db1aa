"""The model of a scene along a real cam's motion, and how the sensors' readings lie on that.

The encoder's zero and an error of the sensors' clock are found from the measured lift by least
squares.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cam_rig.acoustics import level_db
from cam_rig.simulation.instruments import Signal, encoder_count
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.schedule import CamState
from cam_rig.simulation.simulate import FollowerSimulator, MicrophoneSimulator
from cam_rig.units import NS, TURN, FloatArray, correlation_length, rms, to_rpm

# The cam's motion through the counts of an encoder: steady stretches, and states along them.

#: Turns whose mean speeds differ by less than this part are of one speed; or by this many counts.
SAME_SPEED, SAME_COUNTS = 0.02, 4.0
#: A gap in which the cam turned by less (rad) does not end a stretch.
SMALL_GAP = TURN / 8.0
#: Knots a turn of a motion that is not steady, and readings between two, at least.
KNOTS, READINGS = 8, 6
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
    square pressure (Pa²), samples.
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

    def level(self) -> float:
        """DB re 20 µPa, of the settled turns."""
        settled = self.sound[:, self.sound[0] > self.begin + 1.0 / NS]
        mean = float(np.sum(settled[1] * settled[2]) / np.sum(settled[2]))
        return float(level_db(np.sqrt(mean)))


def model_run(loaded: LoadedScene, cam: str, stretch: SteadyStretch, offset: float) -> ModelRun:
    """Turn a cam of a scene as the stretch says, its angle ahead of it by ``offset`` (rad)."""
    follower, microphone = FollowerSimulator.of(loaded), MicrophoneSimulator.of(loaded)
    blocks, sound = [], []
    for state in stretch.states(cam, offset):
        turned = follower.turn_to(state)
        if turned is None:
            continue
        block = turned[1]
        pressure = microphone.listen(block.rows, block.interval.mean_speed)
        blocks.append(block.rows)
        sound.append((block.interval.stop_ns / NS, pressure**2, float(block.rows.shape[1])))
    settle = loaded.scene.program.settle_turns.si * TURN / stretch.mean_speed
    begin = float(stretch.knots[0]) + settle
    return ModelRun(stretch, begin, np.hstack(blocks), np.array(sound).T)


# The encoder's zero and the sensors' clock.

#: Orders of the cam that a turn's readings are compared by, and readings it needs for that.
ORDERS, LEAST_READINGS = 24, 12
#: Angles a turn at which the first offset is looked for.
ANGLES = 2048
#: A clock's error shows where it is so many standard errors, and moves the lift by so much (rad).
SHOWS, LEAST_SHIFT = 5.0, 1e-3
#: Standard deviations within which nine of ten readings are; a spread that is none, of the lift.
NINETY, FINEST = 1.645, 1e-6
#: Readings farther off than so many standard deviations (landings) do not count.
CLIP = 4.0
#: Slower than this part of the fastest, the follower does not say which way it goes.
MOVES = 0.05
#: All speeds are taken where they leave no more than this times what the others do.
AS_GOOD = 1.2
#: Steps at most, and a step (rad) that is none.
MAX_STEPS, SETTLED = 4, 1e-6
NAMES = ("offset", "zero", "lag", "delay", "drift")


@dataclass(frozen=True)
class Alignment:
    """How the sensors' readings lie on the cam's angle.

    ``offset``: rad, the cam's angle less the encoder's; ``delay``: s, what the sensors' stamps are
    late by is below 0; ``drift``: s a second, by how much the sensors' clock is slow; ``zero``: m,
    what the gauge shows at no lift; ``lag``: m, half the width of the lift's hysteresis; below 0
    the gauge lags, as with backlash; ``scatter``: m, r.m.s. of what is left of the lift;
    ``errors``: standard errors of these five, in the same order as `NAMES`; 0 of what was not
    fitted.
    """

    offset: float = 0.0
    delay: float = 0.0
    drift: float = 0.0
    zero: float = 0.0
    lag: float = 0.0
    scatter: float = 0.0
    errors: tuple[float, ...] = (0.0,) * len(NAMES)

    def on_cam_clock(self, time: FloatArray) -> FloatArray:
        """Times of the cam angle's clock at a sensor's times (s)."""
        return time + self.delay + self.drift * time

    def shows(self, name: str) -> bool:
        """Whether a number is more than its error would make it."""
        error = self.errors[NAMES.index(name)]
        return error > 0.0 and abs(float(getattr(self, name))) > SHOWS * error


#: The model over a stretch, at an offset (rad) of the cam's angle.
Drive = Callable[[SteadyStretch, float], ModelRun]


def find_alignment(
    stretches: Sequence[SteadyStretch], lift: Signal, drive: Drive, offset: float | None
) -> Alignment:
    """The offset of the angle, the zero of the gauge, and the error of the clock where it shows.

    Speeds at which the model never leaves the cam are taken, if there are any: a flight has the
    follower's errors in it. A lag between rise and return is estimated too, since it would pass
    for an offset; it is not taken off. ``offset``: rad, where it is known.
    """
    runs = [drive(stretch, offset or 0.0) for stretch in stretches]
    calm = [run for run in runs if not run.flies] or runs
    found = _first(calm, offset or 0.0, lift)
    if found is None:
        return Alignment(offset or 0.0)
    fixed = offset is not None
    found = found if offset is None else replace(found, offset=offset)
    found = _fitted(found, [run.stretch for run in calm], lift, drive, fixed)
    if len(calm) == len(runs):
        return found
    every = _fitted(found, stretches, lift, drive, fixed)
    return every if every.scatter <= AS_GOOD * found.scatter else found


def _speeds(stretches: Sequence[SteadyStretch]) -> tuple[float, bool]:
    """The highest speed (rad/s), and whether there are several."""
    speeds = [stretch.mean_speed for stretch in stretches]
    return max(speeds), max(speeds) > 1.05 * min(speeds)


def _fitted(
    found: Alignment, stretches: Sequence[SteadyStretch], lift: Signal, drive: Drive, fixed: bool
) -> Alignment:
    """All numbers; then again without a delay or drift that does not show."""
    fastest, several = _speeds(stretches)
    names = {"zero", "lag", "drift"} | (set() if fixed else {"offset"})
    names |= {"delay"} if several or fixed else set()
    found = _iterated(found, stretches, lift, drive, names)
    span = max(stretch.knots[-1] for stretch in stretches)
    moved = {"delay": abs(found.delay), "drift": abs(found.drift) * span}
    hidden = {
        name
        for name, seconds in moved.items()
        if not (found.shows(name) and seconds * fastest > LEAST_SHIFT)
    }
    if not hidden & names:
        return found
    none: dict[str, Any] = dict.fromkeys(hidden, 0.0)
    return _iterated(replace(found, **none), stretches, lift, drive, names - hidden)


def _first(runs: Sequence[ModelRun], given: float, lift: Signal) -> Alignment | None:
    """Offset, delay and drift from the shift of each turn; None where the readings are too few."""
    orders = np.arange(1.0, ORDERS + 1.0)
    _, several = _speeds([run.stretch for run in runs])
    rows = []
    for run in runs:
        stretch = run.stretch
        modelled = stretch.at(run.rows[0])
        last = modelled > modelled[-1] - TURN  # Fourier coefficients of the last whole turn
        wave = np.exp(1j * orders[:, None] * (modelled[last] + given))
        wanted = wave @ run.rows[1, last] / np.count_nonzero(last)
        near = (lift.time >= run.begin) & (lift.time <= stretch.knots[-1])
        time, value = lift.time[near], lift.value[near]
        angle = stretch.at(time)
        if time.size < LEAST_READINGS:
            continue
        together = max(1, math.ceil(2 * LEAST_READINGS * (np.ptp(angle) / TURN) / time.size))
        turns = np.floor((angle - angle[0]) / (together * TURN))
        for number in np.unique(turns):
            here = turns == number
            count = int(np.count_nonzero(here))
            if count < LEAST_READINGS or np.ptp(angle[here]) < 0.8 * TURN:
                continue
            centred = value[here] - value[here].mean()
            seen = np.exp(-1j * orders[:, None] * angle[here]) @ centred / count
            products = np.zeros(ANGLES, dtype=np.complex128)
            products[1 : ORDERS + 1] = np.where(orders <= count / 3, seen * wanted, 0.0)
            best = float(np.argmax(np.fft.fft(products).real)) * (TURN / ANGLES)
            rows.append((best, stretch.mean_speed, float(time[here].mean())))
    if not rows:
        return None
    shifts, speeds, times = np.array(rows).T
    columns = [np.ones_like(speeds), speeds * times, *([speeds] if several else [])]
    matrix = np.column_stack(columns)
    if len(rows) <= 2 * matrix.shape[1]:
        matrix = matrix[:, :1]
    solved = np.linalg.lstsq(matrix, np.unwrap(shifts), rcond=None)[0]
    offset, drift, delay = np.pad(solved, (0, 3 - solved.size))
    offset = float(np.remainder(offset + 0.5 * TURN, TURN) - 0.5 * TURN)
    return Alignment(offset, float(delay), float(drift))


def _iterated(
    found: Alignment,
    stretches: Sequence[SteadyStretch],
    lift: Signal,
    drive: Drive,
    names: set[str],
) -> Alignment:
    """Steps of Gauss and Newton until none moves the cam's angle."""
    for _ in range(MAX_STEPS):
        before = found
        runs = [drive(stretch, found.offset) for stretch in stretches]
        found = _improved(found, runs, lift, names)
        time = max(stretch.knots[-1] for stretch in stretches)
        late = abs(found.delay - before.delay) + time * abs(found.drift - before.drift)
        speed, _ = _speeds(stretches)
        if abs(found.offset - before.offset) + speed * late < SETTLED:
            break
    return found


def _improved(
    found: Alignment, runs: Sequence[ModelRun], lift: Signal, names: set[str]
) -> Alignment:
    """One step of Gauss and Newton on the lift less the model's, landings left out."""
    time = found.on_cam_clock(lift.time)
    modelled, velocity, speed = (np.full_like(time, np.nan) for _ in range(3))
    for run in runs:
        inside = (time >= run.begin) & (time <= run.rows[0, -1])
        modelled[inside] = np.interp(time[inside], run.rows[0], run.rows[1])
        velocity[inside] = np.interp(time[inside], run.rows[0], run.rows[2])
        speed[inside] = run.stretch.mean_speed
    there = np.isfinite(modelled)
    if np.count_nonzero(there) < LEAST_READINGS:
        return found
    rest, velocity = (lift.value - modelled)[there], velocity[there]
    sign = np.sign(velocity) * (np.abs(velocity) > MOVES * np.abs(velocity).max())
    by_name = {
        "offset": velocity / speed[there],
        "zero": np.ones_like(velocity),
        "lag": sign,
        "delay": velocity,
        "drift": velocity * lift.time[there],
    }
    chosen = [name for name in NAMES if name in names]
    matrix = np.column_stack([by_name[name] for name in chosen])
    off = rest - found.zero - found.lag * sign
    apart = np.abs(off - np.median(off))  # on a long dwell most readings say nothing of the angle
    least = FINEST * float(np.ptp(modelled[there]))
    near = apart <= CLIP * max(float(np.percentile(apart, 90.0)) / NINETY, least)
    scale = np.abs(matrix).max(axis=0)
    scaled = matrix[near] / scale
    step, _, rank, _ = np.linalg.lstsq(scaled, rest[near], rcond=None)
    if rank < len(chosen):
        return found
    left = rest[near] - scaled @ step
    # correlated residuals count as fewer, else a clock's error would show in any of them
    variance = correlation_length(left) * float(left @ left) / max(left.size - len(chosen), 1)
    inverse = np.linalg.inv(scaled.T @ scaled)
    errors = dict(zip(chosen, np.sqrt(variance * np.diag(inverse)) / scale, strict=True))
    change = dict(zip(chosen, (step / scale).tolist(), strict=True))
    values = {
        name: change[name] + (0.0 if name in ("zero", "lag") else getattr(found, name))
        for name in chosen
    }
    every = rest - matrix / scale @ step
    all_errors = tuple(float(errors.get(name, 0.0)) for name in NAMES)
    return replace(found, **values, scatter=rms(every), errors=all_errors)
