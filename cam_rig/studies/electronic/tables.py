"""Tables of points for a controller: sampling, rounding, and the law by each interpolation."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from cam_rig.errors import ConfigError
from cam_rig.laws.bernstein import hermite, rotate_to_zero
from cam_rig.laws.law import Law
from cam_rig.studies.electronic.controller import MM, TURN_DEG
from cam_rig.units import TURN, FloatArray

#: Smallest number of intervals of a table. A sliding spline needs as many points around each.
MIN_INTERVALS = 8
#: Largest number of intervals of a table.
MAX_INTERVALS = 16384
#: Number of points of the sliding spline, from which the slope at its middle point is taken.
SLIDING_POINTS = 7
#: Largest relative difference of two intervals of master positions that count as equal. It is
#: above the rounding of REAL over 360 000 increments.
EQUAL_RTOL = 0.05
#: Largest integer of a DINT.
MAX_DINT = 2**31 - 1


class Interpolation(Enum):
    """Interpolation of a table of points by a controller."""

    LINEAR = "linear"  #: straight lines
    CUBIC = "cubic"  #: cubics with slopes estimated from the two neighbours of each point
    SPLINE = "spline"  #: cubic spline with continuous s''
    SLIDING = "sliding"  #: cubics with the slopes of a spline through the nearest points


class Rounding(Enum):
    """Type of the numbers in the memory of a controller."""

    LREAL = "lreal"  #: 64-bit float
    REAL = "real"  #: 32-bit float
    DINT = "dint"  #: whole increments


@dataclass(frozen=True, eq=False)
class PointTable:
    """Table of points of one turn, the first and the last one turn apart.

    Parameters
    ----------
    name : str
        Name of the cam.
    x : ndarray, shape (n + 1,)
        Master positions, deg.
    y : ndarray, shape (n + 1,)
        Slave positions, mm.
    notes : tuple of str
        Comment lines.
    increments : float or None
        Increments per mm in which the slave positions are written (default: mm).
    """

    name: str
    x: FloatArray
    y: FloatArray
    notes: tuple[str, ...] = ()
    increments: float | None = None


def sample_table(
    law: Law, count: int, rounding: Rounding = Rounding.LREAL, increments: float = 1000.0
) -> PointTable:
    """Return a table of equally spaced points of a law, with the closing point in addition.

    Parameters
    ----------
    law : Law
        Law of the cam.
    count : int
        Number of points without the closing point.
    rounding : Rounding
        Type of the slave positions.
    increments : float
        Increments per mm for `Rounding.DINT`.

    Raises
    ------
    ConfigError
        If the number of points is out of range, or the increments do not fit in a DINT.
    """
    if not MIN_INTERVALS <= count <= MAX_INTERVALS:
        raise ConfigError(
            f"--points must be between {MIN_INTERVALS} and {MAX_INTERVALS}, got {count}"
        )
    angles = TURN * np.arange(count) / count
    y = np.round(law(angles) / MM, 12) + 0.0
    if rounding is Rounding.REAL:
        y = y.astype(np.float32).astype(np.float64)
    elif rounding is Rounding.DINT:
        if not 0.0 < increments * np.abs(y).max() <= MAX_DINT:
            raise ConfigError(
                f"--increments must be above 0 and fit in a DINT, got {increments:g} per mm"
            )
        y = np.round(y * increments) / increments
    x = np.append(np.round(np.arange(count) * (TURN_DEG / count), 12), TURN_DEG)
    steps = increments if rounding is Rounding.DINT else None
    return PointTable(law.name, x, np.append(y, y[0]), increments=steps)


def table_law(table: PointTable, interpolation: Interpolation) -> Law:
    """Return the law that a controller executes from a table of points.

    The table repeats each turn, also for the slopes at its ends.

    Raises
    ------
    ConfigError
        If a sliding spline is requested for points that are not equally spaced.

    References
    ----------
    Types of interpolation: pages of Beckhoff and ISG in docs/electronic.md.
    """
    x, y = table.x * (TURN / TURN_DEG), table.y * MM
    values = [y]
    if interpolation is not Interpolation.LINEAR:
        values.append(_slopes(table.name, x, y, interpolation))
    rows = np.stack(values)
    spans = np.diff(x)
    ordinates = hermite(rows[:, :-1], rows[:, 1:], spans)
    if x[0] != 0.0:
        columns = list(ordinates.T)
        breaks, columns = rotate_to_zero((x.tolist(), columns), TURN)
        x, ordinates = np.array(breaks), np.stack(columns, axis=1)
    x[-1] = TURN
    return Law(table.name, x, ordinates)


def _slopes(name: str, x: FloatArray, y: FloatArray, interpolation: Interpolation) -> FloatArray:
    """Return the slope (m/rad) of an interpolation at each point, ``(n + 1,)``."""
    from scipy.interpolate import CubicSpline

    if interpolation is Interpolation.SPLINE:
        return np.asarray(CubicSpline(x, y, bc_type="periodic")(x, 1))
    reach = SLIDING_POINTS // 2
    wide_x = np.concatenate([x[-1 - reach : -1] - TURN, x, x[1 : 1 + reach] + TURN])
    wide_y = np.concatenate([y[-1 - reach : -1], y, y[1 : 1 + reach]])
    if interpolation is Interpolation.CUBIC:
        middle = slice(reach, reach + x.size)
        before, after = (slice(middle.start + shift, middle.stop + shift) for shift in (-1, 1))
        return np.asarray((wide_y[after] - wide_y[before]) / (wide_x[after] - wide_x[before]))
    spans = np.diff(x)
    if np.ptp(spans) > EQUAL_RTOL * spans.max():
        raise ConfigError(
            f"table {name!r}: a sliding spline needs equally spaced points, got intervals of "
            f"{np.degrees(spans.min()):g}° to {np.degrees(spans.max()):g}°; use spline"
        )
    windows = np.lib.stride_tricks.sliding_window_view(wide_y, SLIDING_POINTS).T
    grid = float(spans.mean()) * np.arange(SLIDING_POINTS)
    return np.asarray(CubicSpline(grid, windows, bc_type="natural")(grid[reach], 1))
