"""The rig's arrays: double precision throughout, and what is taken of one everywhere."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complexfloating[Any, Any]]


def rms(values: ArrayLike) -> float:
    """Root of the mean square, in the unit of the values."""
    return float(np.sqrt(np.mean(np.square(values))))


def autocorrelation(residual: FloatArray) -> FloatArray:
    """Of a residual ``(n,)``, from lag 0 (1) to before the first lag at which there is none."""
    size = residual.size
    spectrum = np.fft.rfft(residual - residual.mean(), 2 * size)
    product = np.fft.irfft(np.abs(spectrum) ** 2)[:size]
    if product[0] <= 0.0:
        return np.ones(1)
    rho = np.asarray(product / product[0])
    none = np.flatnonzero(rho < 2.0 / math.sqrt(size))
    return rho[: max(1, none[0]) if none.size else size]


def correlation_length(residual: FloatArray) -> float:
    """How many neighbours of a residual ``(n,)`` are as one: 1 + 2 Σ ρₖ, 1 where each is free."""
    return 1.0 + 2.0 * float(autocorrelation(residual)[1:].sum())
