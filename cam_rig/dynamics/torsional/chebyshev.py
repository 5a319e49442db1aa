"""Chebyshev collocation in integral form: tables by degree, and a path of many windows.

The unknown of a window is the second derivative at its nodes; rate and value follow from it by
integration matrices, which are well conditioned at every degree where those of
differentiation are not (Greengard, SIAM J. Numer. Anal. 28 (1991) 1071).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from cam_rig.arrays import FloatArray

#: Samples evaluated together: their basis values stay in the processor's cache.
BATCH = 2048


@dataclass(frozen=True, eq=False)
class CollocationTable:
    """Chebyshev-Lobatto nodes on [0, 1] and what is linear in the values there.

    Parameters
    ----------
    nodes : ``(N + 1,)`` from 0 to 1
    series : ``(3, N + 3, N + 1)``; [r] takes values at the nodes to the Chebyshev coefficients
        of the r-fold integral from 0
    first, second : ``(N + 1, N + 1)``; take values to those of the one- and two-fold integral
    """

    nodes: FloatArray
    series: FloatArray
    first: FloatArray
    second: FloatArray


@lru_cache(maxsize=32)
def table(degree: int) -> CollocationTable:
    """Nodes and matrices of one degree N."""
    k = np.arange(degree + 1)
    angles = np.pi * (degree - k) / degree
    weights = np.ones(degree + 1)
    weights[[0, -1]] = 0.5
    interpolation = 2.0 / degree * np.cos(np.outer(k, angles)) * weights
    interpolation[[0, -1]] *= 0.5
    series = np.zeros((3, degree + 3, degree + 1))
    series[0, : degree + 1] = interpolation
    integral = _integral(degree + 3)
    series[1] = integral @ series[0]
    series[2] = integral @ series[1]
    at_nodes = np.cos(np.outer(angles, np.arange(degree + 3)))
    first, second = at_nodes @ series[1], at_nodes @ series[2]
    first[0] = second[0] = 0.0
    nodes = np.sin(0.5 * np.pi * k / degree) ** 2
    for array in (nodes, series, first, second):
        array.setflags(write=False)
    return CollocationTable(nodes, series, first, second)


def _integral(size: int) -> FloatArray:
    """``(size, size)``: coefficients to those of the integral over u = (1 + x)/2 from u = 0.

    ∫T_k dx = T_{k+1}/(2(k+1)) − T_{k−1}/(2(k−1)); what would pass the last row is cut off.
    """
    matrix = np.zeros((size, size))
    for k in range(size):
        if k + 1 < size:
            matrix[k + 1, k] += 1.0 if k == 0 else 0.5 / (k + 1)
        if k > 1:
            matrix[k - 1, k] -= 0.5 / (k - 1)
    matrix[0] = -((-1.0) ** np.arange(1, size)) @ matrix[1:]
    return 0.5 * matrix


def basis_at(size: int, u: float) -> FloatArray:
    """``(size,)`` values T_k(2u − 1) at one u in [0, 1]."""
    return np.asarray(np.cos(np.arange(size) * np.arccos(min(1.0, max(-1.0, 2.0 * u - 1.0)))))


def basis(size: int, u: FloatArray) -> FloatArray:
    """``(size, len(u))`` values T_k(2u − 1), by the three-term recurrence."""
    values = np.empty((size, u.size))
    values[0] = 1.0
    np.subtract(2.0 * u, 1.0, out=values[1])
    double = 2.0 * values[1]
    for k in range(2, size):
        np.multiply(double, values[k - 1], out=values[k])
        values[k] -= values[k - 2]
    return values


@dataclass(frozen=True, eq=False)
class ChebyshevPath:
    """Rows of functions of time, window after window, each a Chebyshev series.

    Parameters
    ----------
    edges : ``(W + 1,)`` times between the windows, s
    spans : ``(W,)`` length of the interval each series is written on; it begins with its
        window and may end later
    series : W arrays ``(rows, size)``
    """

    edges: FloatArray
    spans: FloatArray
    series: list[FloatArray]

    def window(self, times: FloatArray) -> FloatArray:
        """Index of the window of each time; at an edge the one that begins there."""
        inner = np.searchsorted(self.edges[1:-1], times, side="right")
        return np.asarray(inner, dtype=np.intp)

    def at(self, times: FloatArray) -> FloatArray:
        """``(rows, len(times))`` values at times in any order, inside the edges."""
        out = np.empty((self.series[0].shape[0], times.size))
        if np.any(times[1:] < times[:-1]):
            order = np.argsort(times, kind="stable")
            out[:, order] = self.at(times[order])
            return out
        for begin in range(0, times.size, BATCH):
            self._fill(times[begin : begin + BATCH], out[:, begin : begin + BATCH])
        return out

    def _fill(self, times: FloatArray, out: FloatArray) -> None:
        """Fill ``out`` at times that rise."""
        window = self.window(times)
        u = (times - self.edges[window]) / self.spans[window]
        low, high = int(window[0]), int(window[-1])
        values = basis(max(s.shape[1] for s in self.series[low : high + 1]), u)
        cuts = np.searchsorted(window, np.arange(low, high + 2))
        for i in range(low, high + 1):
            a, b = cuts[i - low], cuts[i - low + 1]
            if b > a:
                series = self.series[i]
                np.matmul(series, values[: series.shape[1], a:b], out=out[:, a:b])
