"""Least-squares identification of the encoder's zero and the sensors' clock from the lift."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cam_rig.simulation.instruments import Signal
from cam_rig.studies.compare.model_run import ModelRun, SteadyStretch
from cam_rig.units import TURN, FloatArray, correlation_length, rms

#: Number of harmonics of the cam rotation by which the lift readings of a turn are compared with
#: the model.
ORDERS = 24
#: Smallest number of lift readings in a turn that is compared with the model.
MIN_READINGS = 12
#: Number of equally spaced cam angles that are tried as the offset of a turn (cam angle minus
#: encoder angle) in the first estimate.
SEARCH_ANGLES = 2048
#: Smallest ratio of an alignment parameter (offset, gauge zero, lag, clock delay or drift) to its
#: standard error at which it is significant.
MIN_SIGNIFICANCE = 5.0
#: Smallest shift of the cam angle (rad) by a clock error at which the error is corrected.
MIN_CLOCK_SHIFT = 1e-3
#: Smallest shift of the cam angle by a clock error at which the error is corrected, in counts of
#: the encoder. The fitted cam motion at a varying speed is accurate to this fraction of a count.
MIN_CLOCK_COUNTS = 0.5
#: Distance from the mean within which 90 % of normally distributed values are, in standard
#: deviations.
SIGMAS_OF_90_PERCENT = 1.645
#: Lower limit of the standard deviation of the lift residuals, as a fraction of the lift range.
MIN_SPREAD = 1e-6
#: Largest residual of a lift reading that is used in the fit, in standard deviations. The residuals
#: at landings are larger.
CLIP_SIGMAS = 4.0
#: Smallest velocity of the follower, relative to the largest, at which the direction of its motion
#: is taken as rising or falling. Below it the lag has no effect.
MIN_VELOCITY_RATIO = 0.05
#: Largest ratio of the lift residual over all speeds to that over the speeds without flights at
#: which all speeds are used for the alignment.
MAX_SCATTER_RATIO = 1.2
#: Largest number of Gauss-Newton steps in the identification of the encoder's zero, the gauge's
#: zero and clock errors.
MAX_STEPS = 4
#: Change of the cam angle (rad) by a Gauss-Newton step below which the alignment has converged.
STEP_ATOL = 1e-6
#: Names of the alignment parameters, in the order in which their errors are stored.
NAMES = ("offset", "zero", "lag", "delay", "drift")


@dataclass(frozen=True)
class Alignment:
    """Parameters that relate the sensors' readings to the cam angle.

    Attributes
    ----------
    offset
        Cam angle minus encoder angle, rad.
    delay
        Time of the cam angle minus the sensors' stamp, s. It is negative if the stamps are late.
    drift
        Rate of the cam angle's clock minus that of the sensors' clock, s/s. It is positive if the
        sensors' clock is slow.
    zero
        Reading of the gauge at zero lift, m.
    lag
        Half of the width of the lift's hysteresis, m. It is negative if the gauge lags, as with
        backlash.
    scatter
        R.m.s. residual of the lift, m.
    errors
        Standard errors of the parameters in the order of `NAMES`. They are 0 for parameters that
        were not fitted.
    """

    offset: float = 0.0
    delay: float = 0.0
    drift: float = 0.0
    zero: float = 0.0
    lag: float = 0.0
    scatter: float = 0.0
    errors: tuple[float, ...] = (0.0,) * len(NAMES)

    def on_cam_clock(self, time: FloatArray) -> FloatArray:
        """Convert times (s) of the sensors' clock to times of the cam angle's clock."""
        return time + self.delay + self.drift * time

    def is_significant(self, name: str) -> bool:
        """Return True if an alignment parameter clearly exceeds its standard error.

        ``name`` is an element of `NAMES`. The limit is `MIN_SIGNIFICANCE` standard errors.
        """
        error = self.errors[NAMES.index(name)]
        return error > 0.0 and abs(float(getattr(self, name))) > MIN_SIGNIFICANCE * error


#: Function that computes the model's motion with the cam motion of a time of steady speed. Its
#: second argument is the offset (rad): cam angle minus encoder angle.
Drive = Callable[[SteadyStretch, float], ModelRun]


def find_alignment(
    stretches: Sequence[SteadyStretch],
    lift: Signal,
    drive: Drive,
    offset: float | None,
    count: float,
) -> Alignment:
    """Identify the offset of the cam angle, the gauge's zero, and clock errors.

    Delay and drift of the clock are identified only if they are significant. If there are speeds at
    which the model keeps contact, these are used, because a flight contains the errors of the
    model's follower. All speeds are used if they fit nearly as well. A lag between rise and return
    is estimated too, because it would otherwise change the offset. The lag is not subtracted from
    the readings.

    Parameters
    ----------
    stretches : sequence of SteadyStretch
        The measured cam motions at steady speeds.
    lift : Signal
        The measured lift.
    drive : Drive
        The function that drives the model.
    offset : float or None
        Cam angle minus encoder angle in rad, or None if it is unknown.
    count : float
        Resolution of the encoder in rad, 0 without steps.
    """
    runs = [drive(stretch, offset or 0.0) for stretch in stretches]
    contact_runs = [run for run in runs if not run.loses_contact] or runs
    alignment = _estimate(contact_runs, offset or 0.0, lift)
    if alignment is None:
        return Alignment(offset or 0.0)
    is_fixed = offset is not None
    alignment = alignment if offset is None else replace(alignment, offset=offset)
    min_shift = max(MIN_CLOCK_SHIFT, MIN_CLOCK_COUNTS * count)
    alignment = _fit(
        alignment, [run.stretch for run in contact_runs], lift, drive, is_fixed, min_shift
    )
    if len(contact_runs) == len(runs):
        return alignment
    all_speeds = _fit(alignment, stretches, lift, drive, is_fixed, min_shift)
    return all_speeds if all_speeds.scatter <= MAX_SCATTER_RATIO * alignment.scatter else alignment


def _max_speed(stretches: Sequence[SteadyStretch]) -> tuple[float, bool]:
    """Return the highest speed of the stretches (rad/s), and True if speeds differ.

    A stretch is a time of steady cam speed. The speeds differ if the highest is more than 5 % above
    the lowest.
    """
    speeds = [stretch.mean_speed for stretch in stretches]
    return max(speeds), max(speeds) > 1.05 * min(speeds)


def _fit(
    alignment: Alignment,
    stretches: Sequence[SteadyStretch],
    lift: Signal,
    drive: Drive,
    is_fixed: bool,
    min_shift: float,
) -> Alignment:
    """Fit the alignment parameters, and again without insignificant clock errors.

    The clock errors are delay and drift. Each is kept if it is significant and shifts the cam angle
    by more than `min_shift` (rad). `is_fixed` is True if the offset is given.
    """
    fastest, several = _max_speed(stretches)
    names = {"zero", "lag", "drift"} | (set() if is_fixed else {"offset"})
    names |= {"delay"} if several or is_fixed else set()
    alignment = _iterate(alignment, stretches, lift, drive, names)
    span = max(stretch.knots[-1] for stretch in stretches)
    time_errors = {"delay": abs(alignment.delay), "drift": abs(alignment.drift) * span}
    hidden = {
        name
        for name, seconds in time_errors.items()
        if not (alignment.is_significant(name) and seconds * fastest > min_shift)
    }
    if not hidden & names:
        return alignment
    zeros: dict[str, Any] = dict.fromkeys(hidden, 0.0)
    return _iterate(replace(alignment, **zeros), stretches, lift, drive, names - hidden)


def _estimate(runs: Sequence[ModelRun], offset_guess: float, lift: Signal) -> Alignment | None:
    """Estimate offset, delay and drift of the alignment from the shift of each turn.

    The shift is the offset at which the harmonics of the measured lift match those of the model
    best. Returns None if there are too few readings.
    """
    orders = np.arange(1.0, ORDERS + 1.0)
    _, several = _max_speed([run.stretch for run in runs])
    rows = []
    for run in runs:
        stretch = run.stretch
        modelled = stretch.angle_at(run.rows[0])
        last = modelled > modelled[-1] - TURN  # samples of the last whole turn
        wave = np.exp(1j * orders[:, None] * (modelled[last] + offset_guess))
        expected = wave @ run.rows[1, last] / np.count_nonzero(last)
        inside = (lift.time >= run.start) & (lift.time <= stretch.knots[-1])
        time, value = lift.time[inside], lift.value[inside]
        angle = stretch.angle_at(time)
        if time.size < MIN_READINGS:
            continue
        turns_per_group = max(1, math.ceil(2 * MIN_READINGS * (np.ptp(angle) / TURN) / time.size))
        groups = np.floor((angle - angle[0]) / (turns_per_group * TURN))
        for number in np.unique(groups):
            in_group = groups == number
            count = int(np.count_nonzero(in_group))
            if count < MIN_READINGS or np.ptp(angle[in_group]) < 0.8 * TURN:
                continue
            centred = value[in_group] - value[in_group].mean()
            measured = np.exp(-1j * orders[:, None] * angle[in_group]) @ centred / count
            products = np.zeros(SEARCH_ANGLES, dtype=np.complex128)
            products[1 : ORDERS + 1] = np.where(orders <= count / 3, measured * expected, 0.0)
            best = float(np.argmax(np.fft.fft(products).real)) * (TURN / SEARCH_ANGLES)
            rows.append((best, stretch.mean_speed, float(time[in_group].mean())))
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


def _iterate(
    alignment: Alignment,
    stretches: Sequence[SteadyStretch],
    lift: Signal,
    drive: Drive,
    names: set[str],
) -> Alignment:
    """Repeat Gauss-Newton steps on the alignment until the cam angle is constant.

    `names` are the parameters that are fitted. There are at most `MAX_STEPS` steps.
    """
    for _ in range(MAX_STEPS):
        before = alignment
        runs = [drive(stretch, alignment.offset) for stretch in stretches]
        alignment = _gauss_newton_step(alignment, runs, lift, names)
        time = max(stretch.knots[-1] for stretch in stretches)
        shift = abs(alignment.delay - before.delay) + time * abs(alignment.drift - before.drift)
        speed, _ = _max_speed(stretches)
        if abs(alignment.offset - before.offset) + speed * shift < STEP_ATOL:
            break
    return alignment


def _sample_model(
    time: FloatArray, runs: Sequence[ModelRun]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return lift (m), its velocity (m/s) and the cam speed (rad/s) of the model.

    `time` is in s, ``(n,)``, as is each result. Values at times outside the settled turns of all
    runs are NaN.
    """
    modelled, velocity, speed = (np.full_like(time, np.nan) for _ in range(3))
    for run in runs:
        inside = (time >= run.start) & (time <= run.rows[0, -1])
        modelled[inside] = np.interp(time[inside], run.rows[0], run.rows[1])
        velocity[inside] = np.interp(time[inside], run.rows[0], run.rows[2])
        speed[inside] = run.stretch.mean_speed
    return modelled, velocity, speed


def _gauss_newton_step(
    alignment: Alignment, runs: Sequence[ModelRun], lift: Signal, names: set[str]
) -> Alignment:
    """Improve an alignment by one Gauss-Newton step on the residuals of the lift.

    `names` are the parameters that are fitted. Readings whose residual exceeds `CLIP_SIGMAS`
    standard deviations, such as those at landings, are left out.
    """
    modelled, velocity, speed = _sample_model(alignment.on_cam_clock(lift.time), runs)
    has_model = np.isfinite(modelled)
    if np.count_nonzero(has_model) < MIN_READINGS:
        return alignment
    difference, velocity = (lift.value - modelled)[has_model], velocity[has_model]
    sign = np.sign(velocity) * (np.abs(velocity) > MIN_VELOCITY_RATIO * np.abs(velocity).max())
    by_name = {
        "offset": velocity / speed[has_model],
        "zero": np.ones_like(velocity),
        "lag": sign,
        "delay": velocity,
        "drift": velocity * lift.time[has_model],
    }
    chosen = [name for name in NAMES if name in names]
    matrix = np.column_stack([by_name[name] for name in chosen])
    residual = difference - alignment.zero - alignment.lag * sign
    # The 90 % quantile is used instead of the median: with a long dwell, most readings do not
    # depend on the angle, and their small residuals would determine the median.
    deviation = np.abs(residual - np.median(residual))
    spread = float(np.percentile(deviation, 90.0)) / SIGMAS_OF_90_PERCENT
    spread = max(spread, MIN_SPREAD * float(np.ptp(modelled[has_model])))
    is_used = deviation <= CLIP_SIGMAS * spread
    scale = np.abs(matrix).max(axis=0)
    scaled = matrix[is_used] / scale
    step, _, rank, _ = np.linalg.lstsq(scaled, difference[is_used], rcond=None)
    if rank < len(chosen):
        return alignment
    error = difference[is_used] - scaled @ step
    # Correlated residuals count as fewer independent readings. Otherwise any clock error would be
    # significant.
    variance = correlation_length(error) * float(error @ error) / max(error.size - len(chosen), 1)
    inverse = np.linalg.inv(scaled.T @ scaled)
    errors = dict(zip(chosen, np.sqrt(variance * np.diag(inverse)) / scale, strict=True))
    change = dict(zip(chosen, (step / scale).tolist(), strict=True))
    values = {
        name: change[name] + (0.0 if name in ("zero", "lag") else getattr(alignment, name))
        for name in chosen
    }
    all_residuals = difference - matrix / scale @ step
    all_errors = tuple(float(errors.get(name, 0.0)) for name in NAMES)
    return replace(alignment, **values, scatter=rms(all_residuals), errors=all_errors)
