"""Sums of fading terms over the joints of a turn, and the series of a transfer function."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cam_rig.arrays import FloatArray

#: Amplitudes are summed over so many joints that they fade by e to this, at most.
FADED = 20.0


def taylor_series(top: NDArray[Any], bottom: NDArray[Any], count: int) -> NDArray[Any]:
    """Taylor coefficients of top(D)/bottom(D), by long division; complex where these are."""
    kind = np.result_type(top, bottom)
    found = np.zeros(count, kind)
    rest = np.zeros(count + bottom.size, kind)
    rest[: top.size] = top
    for k in range(count):
        found[k] = rest[k] / bottom[0]
        rest[k : k + bottom.size] -= found[k] * bottom
    return found


def carried(gains: NDArray[Any], ends: FloatArray, rates: NDArray[Any]) -> NDArray[Any]:
    """What gains at angles, each fading from there on, come to at each of them, ``(m, n)``.

    Many are summed as they would be at the first one's angle, as long as none is thereby
    larger by more than e to `FADED`: rounding stays rounding.

    Parameters
    ----------
    gains : ``(m, n)``, added at the angles ``ends`` (rad, rising from above 0)
    rates : ``(m, 1)``, 1/rad; what is there fades by e^{rate · angle}
    """
    found = np.empty_like(gains)
    reach = FADED / max(float(np.abs(rates.real).max()), 1e-300)
    begin, before, angle = 0, np.zeros_like(gains[:, :1]), 0.0
    while begin < ends.size:
        end = max(begin + 1, int(np.searchsorted(ends, ends[begin] + reach)))
        fading = np.exp(rates * (ends[begin:end] - ends[begin]))
        before = before * np.exp(rates * (ends[begin] - angle))
        found[:, begin:end] = fading * (before + np.cumsum(gains[:, begin:end] / fading, axis=1))
        begin, before, angle = end, found[:, end - 1 : end], float(ends[end - 1])
    return found
