"""Fitting the acoustic constants to one published curve of one cam."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from cam_rig.acoustics.radiation import REFERENCE_PRESSURE, RadiationParameters
from cam_rig.acoustics.steady import mean_square_rate
from cam_rig.arrays import FloatArray
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.contact import loss_intervals
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.units import RPM_PER_RAD_S

#: Corner frequencies searched, Hz.
CORNERS = (1.0, 1000.0)


@dataclass(frozen=True)
class Calibration:
    """The fitted constants and what they leave: ``rmse_db`` over ``points`` speeds."""

    radiation: RadiationParameters
    rmse_db: float
    points: int


def calibrate(
    law: Law,
    follower: FollowerParameters,
    start: RadiationParameters,
    speeds: FloatArray,
    levels: FloatArray,
) -> Calibration:
    """Fit gain and corner to the levels (dB) of one cam at ``speeds`` (rad/s).

    Two numbers, least squares in dB; the background stays as it is. The cam must keep contact
    at all speeds, since the fit uses the exact steady response.

    Raises
    ------
    DynamicsError : the follower leaves the cam within the speeds
    """
    for speed in speeds:
        if loss_intervals(law, follower, float(speed)):
            raise DynamicsError(
                f"cam {law.name!r} loses contact at {speed * RPM_PER_RAD_S:.0f} rpm; allowed for a "
                "calibration: a cam that keeps contact at every published speed"
            )
    background = np.array([start.background_power(float(s)) for s in speeds])

    def fitted(log_corner: float) -> tuple[float, float]:
        rate = 2.0 * math.pi * math.exp(log_corner)
        power = np.array([mean_square_rate(law, follower, rate, float(s)) for s in speeds])
        return _best_gain(power, background, levels)

    low, high = (math.log(c) for c in CORNERS)
    log_corner = _least(lambda x: fitted(x)[1], (low, high), 1e-6)[0]
    gain, rmse = fitted(log_corner)
    radiation = replace(start, gain=gain, corner=math.exp(log_corner))
    return Calibration(radiation, rmse, speeds.size)


def _best_gain(
    power: FloatArray, background: FloatArray, levels: FloatArray
) -> tuple[float, float]:
    """Gain (Pa·s/N) of least r.m.s. difference, and that difference in dB."""

    def rmse(log_gain: float) -> float:
        total = background + math.exp(2.0 * log_gain) * power
        difference = 10.0 * np.log10(total / REFERENCE_PRESSURE**2) - levels
        return float(np.sqrt(np.mean(difference**2)))

    log_gain, least = _least(rmse, (-20.0, 0.0), 1e-9)
    return math.exp(log_gain), least


def _least(
    function: Callable[[float], float], bounds: tuple[float, float], tolerance: float
) -> tuple[float, float]:
    """Where a function is least between bounds, and how little it is there."""
    from scipy.optimize import minimize_scalar  # only who calibrates should pay its import

    best = minimize_scalar(function, bounds=bounds, method="bounded", options={"xatol": tolerance})
    return float(best.x), float(best.fun)
