"""The encoder's zero and the sensors' clock, found from the measured lift by least squares."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cam_rig.simulation.instruments import Signal
from cam_rig.studies.compare.model_run import ModelRun, SteadyStretch
from cam_rig.units import TURN, FloatArray, correlation_length, rms

#: Orders of the cam that a turn's readings are compared by, and readings it needs for that.
ORDERS, LEAST_READINGS = 24, 12
#: Angles a turn at which the first offset is looked for.
ANGLES = 2048
#: A clock's error shows where it is so many standard errors, and moves the lift by so much (rad),
#: and by so many counts of the encoder: where the cam speeds up in a stretch, its motion is known
#: to no more.
SHOWS, LEAST_SHIFT, LEAST_COUNTS = 5.0, 1e-3, 0.5
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
    stretches: Sequence[SteadyStretch],
    lift: Signal,
    drive: Drive,
    offset: float | None,
    count: float,
) -> Alignment:
    """The offset of the angle, the zero of the gauge, and the error of the clock where it shows.

    Speeds at which the model never leaves the cam are taken, if there are any: a flight has the
    follower's errors in it. A lag between rise and return is estimated too, since it would pass
    for an offset; it is not taken off. ``offset``: rad, where it is known; ``count``: rad, of the
    encoder, 0 for one without steps.
    """
    runs = [drive(stretch, offset or 0.0) for stretch in stretches]
    calm = [run for run in runs if not run.flies] or runs
    found = _first(calm, offset or 0.0, lift)
    if found is None:
        return Alignment(offset or 0.0)
    fixed = offset is not None
    found = found if offset is None else replace(found, offset=offset)
    least = max(LEAST_SHIFT, LEAST_COUNTS * count)
    found = _fitted(found, [run.stretch for run in calm], lift, drive, fixed, least)
    if len(calm) == len(runs):
        return found
    every = _fitted(found, stretches, lift, drive, fixed, least)
    return every if every.scatter <= AS_GOOD * found.scatter else found


def _speeds(stretches: Sequence[SteadyStretch]) -> tuple[float, bool]:
    """The highest speed (rad/s), and whether there are several."""
    speeds = [stretch.mean_speed for stretch in stretches]
    return max(speeds), max(speeds) > 1.05 * min(speeds)


def _fitted(
    found: Alignment,
    stretches: Sequence[SteadyStretch],
    lift: Signal,
    drive: Drive,
    fixed: bool,
    least: float,
) -> Alignment:
    """All numbers; then again without a delay or drift that does not show, ``least`` (rad)."""
    fastest, several = _speeds(stretches)
    names = {"zero", "lag", "drift"} | (set() if fixed else {"offset"})
    names |= {"delay"} if several or fixed else set()
    found = _iterated(found, stretches, lift, drive, names)
    span = max(stretch.knots[-1] for stretch in stretches)
    moved = {"delay": abs(found.delay), "drift": abs(found.drift) * span}
    hidden = {
        name
        for name, seconds in moved.items()
        if not (found.shows(name) and seconds * fastest > least)
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
