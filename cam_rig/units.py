"""Factors of units to SI, formatting of times and numbers, and array statistics."""

from __future__ import annotations

import math
from datetime import UTC, datetime
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: Angle of one turn of the cam, rad.
TURN = 2.0 * math.pi
#: Angular speed of one revolution per minute, rad/s.
RPM = math.pi / 30.0
#: Revolutions per minute that are equal to 1 rad/s.
RPM_PER_RAD_S = 30.0 / math.pi
#: Number of nanoseconds in one second. Times of messages are whole nanoseconds.
NS = 1_000_000_000
Speed = TypeVar("Speed", float, NDArray[np.float64])


def to_rpm(speed: Speed) -> Speed:
    """Convert a speed in rad/s, a number or an array, to revolutions per minute."""
    return speed * 30.0 / math.pi


def round_to_error(value: float, error: float) -> str:
    """Return a value as text, rounded to two digits of its standard error.

    If the error is not positive and finite, the value is rounded to six significant digits.
    """
    if not 0.0 < error < math.inf:
        return f"{value:.6g}"
    exponent = int(f"{error:.1e}".partition("e")[2]) - 1  # of the last digit
    if exponent > -8 and abs(value) < 1e7:
        return f"{round(value, -exponent) + 0.0:.{max(0, -exponent)}f}"
    leading = int(f"{value:e}".partition("e")[2])
    return f"{value:.{max(0, leading - exponent)}e}"


#: Seconds from which on a time is printed as a date: 115 days, longer than any recording.
DATE_FROM_S = 1e7


def format_time(seconds: float, begin_ns: int = 0) -> str:
    """Return a time within a bag as text: seconds since its start, or a date.

    `begin_ns` is the start of the bag in ns. Times from `DATE_FROM_S` on are printed as a date.
    """
    if abs(seconds) < DATE_FROM_S:
        return f"{seconds:.6g} s"
    date = datetime.fromtimestamp(begin_ns // NS + int(seconds), UTC)
    return f"{date:%Y-%m-%d %H:%M:%S} UTC"


def format_duration(seconds: float) -> str:
    """Return a duration (s) as text with its unit: s, min or h."""
    if seconds < 120.0:
        return f"{seconds:.3g} s"
    return f"{seconds / 60.0:.3g} min" if seconds < 7200.0 else f"{seconds / 3600.0:.3g} h"


#: Type of an array of real numbers in double precision.
FloatArray = NDArray[np.float64]
#: Type of an array of complex numbers.
ComplexArray = NDArray[np.complexfloating[Any, Any]]


def rms(values: ArrayLike) -> float:
    """Return the root of the mean square, in the unit of the values."""
    return float(np.sqrt(np.mean(np.square(values))))


def autocorrelation(residual: FloatArray) -> FloatArray:
    """Return the autocorrelation of a residual, shape (m,), from lag 0, where it is 1.

    The residual has the shape (n,), m ≤ n. The array ends before the first lag at which the
    autocorrelation is below 2/√n, the level of white noise.
    """
    size = residual.size
    spectrum = np.fft.rfft(residual - residual.mean(), 2 * size)
    product = np.fft.irfft(np.abs(spectrum) ** 2)[:size]
    if product[0] <= 0.0:
        return np.ones(1)
    rho = np.asarray(product / product[0])
    uncorrelated = np.flatnonzero(rho < 2.0 / math.sqrt(size))
    return rho[: max(1, uncorrelated[0]) if uncorrelated.size else size]


def correlation_length(residual: FloatArray) -> float:
    """Return the correlation length 1 + 2 Σ ρₖ of a residual, shape (n,), in samples.

    It is the number of samples that count as one independent sample: 1 for white noise.
    """
    return 1.0 + 2.0 * float(autocorrelation(residual)[1:].sum())
