"""Detection of gauge readings with a common shift, and of slips of the gauge.

A speck of dirt on the cam shifts several adjacent readings by the same amount. The shift is fitted
together with a polynomial through these readings and their neighbours. It is accepted if the
residuals are as small as the scatter, which is not the case at a kink of the law. A slip is a
sudden shift of all later readings.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.polynomial.chebyshev import chebvander
from numpy.typing import NDArray

from cam_rig.errors import ConfigError
from cam_rig.laws.spline import WINDOW, differences
from cam_rig.studies.fit_cam.gauge import Readings
from cam_rig.units import TURN

#: Largest number of adjacent readings with a common shift. Inside a longer sequence, the law cannot
#: be interpolated from the readings next to it.
MAX_RUN = 32
#: Longest angle (rad) of adjacent readings with a common shift. Inside a longer sequence, the law
#: cannot be interpolated from the readings next to it.
MAX_RUN_SPAN = math.radians(15.0)
#: Number of readings before and after a shifted sequence that are fitted together with it. With
#: fewer readings, the polynomial is nearly undetermined.
RUN_FLANK = 5
#: Number of readings before and after a slip (a sudden shift of the gauge) that are fitted together
#: with the slip.
SLIP_FLANK = 8
#: Degree of the polynomial through a shifted sequence and its neighbours. It is high enough for the
#: law over them, and together with the shift it has fewer coefficients than there are neighbours.
RUN_DEGREE = 5
#: Degree of the polynomial through the readings next to a slip. They span a smaller angle than
#: those of a shifted sequence.
SLIP_DEGREE = 4
#: Smallest deviation of a reading from its neighbours, in scatters (standard deviations of a
#: reading), at which a shifted sequence may start or stop. The limit only selects the places to
#: examine, so it is lower than the limit of an outlier.
MIN_EDGE_SCATTERS = 4.0
#: Smallest significant shift of a sequence of readings, in standard errors of the shift. Up to 14
#: 000 sequences are tried, so this limit is above that of a single reading.
MIN_SHIFT_ERRORS = 8.0
#: Smallest significance (shift in standard errors) of a shifted sequence that is considered, as a
#: fraction of the largest significance. The shortest of these sequences is used, because good
#: readings between two specks of dirt look like one longer sequence.
MIN_SIGNIFICANCE_RATIO = 0.7
#: A slip of the gauge causes a step of the readings, and the opposite step at the end of the turn.
#: This is the largest sum of both steps, in standard errors, at which they belong to one slip.
MAX_RETURN_ERRORS = 4.0
#: Largest step of the angle from the last to the first reading, in median steps, at which a jump of
#: the lift between them is taken as a drift of the gauge.
MAX_CLOSING_STEPS = 2.0
#: Largest r.m.s. residual of the polynomial with the shift, in scatters (standard deviations of a
#: reading). The residual is larger at a kink of the law.
MAX_RESIDUAL_SCATTERS = 2.0
#: Largest number of sequences of readings that are marked as shifted. More are a property of the
#: law, and then no reading is marked.
MAX_RUNS = 10
#: Largest number of possible ends of shifted sequences of readings that are examined. More are a
#: property of the law, and the time increases with the square of their number.
MAX_EDGES = 120


@dataclass(frozen=True, eq=False)
class Shift:
    """Common shift of the readings with the indices `indices`.

    The shift, its standard error and the residual are in m. The residual is the r.m.s. residual of
    a polynomial through these readings and their neighbours.
    """

    indices: NDArray[np.int64]
    shift: float
    error: float
    residual: float

    @property
    def significance(self) -> float:
        """Magnitude of a common shift of readings, in its standard errors."""
        return abs(self.shift) / self.error

    def is_clear(self, scatter: float) -> bool:
        """Return True if a common shift is significant and explains the readings.

        ``scatter`` is the standard deviation of a reading, m.
        """
        is_complete = self.residual <= MAX_RESIDUAL_SCATTERS * scatter
        return is_complete and self.significance > MIN_SHIFT_ERRORS


def find_shifted_runs(readings: Readings) -> NDArray[np.bool_]:
    """Return a mask of the readings in sequences of two or more with a common shift.

    No reading is marked if there are more than `MAX_RUNS` sequences.
    """
    mask = np.zeros(readings.angles.size, dtype=np.bool_)
    for _ in range(MAX_RUNS + 1):
        good = np.flatnonzero(~mask)
        remaining = readings.select(good)
        scatter = remaining.scatter
        runs = [run for run in _runs(remaining, scatter) if run.is_clear(scatter)]
        if not runs:
            return mask
        clearest = max(run.significance for run in runs)
        likely = [run for run in runs if run.significance > MIN_SIGNIFICANCE_RATIO * clearest]
        best = min(likely, key=lambda run: (run.indices.size, -run.significance))
        mask[good[best.indices]] = True
    return np.zeros_like(mask)


def require_no_slip(readings: Readings) -> None:
    """Raise ConfigError if the gauge, or its support, has moved during the turn.

    The lift then has a step between two readings, and the opposite step between the last and the
    first line of the table. A law is smooth there.
    """
    count, lines = readings.angles.size, readings.lines
    ends = {int(lines.min()), int(lines.max())}
    if count < 2 * SLIP_FLANK + WINDOW:
        return
    closing = next((i for i in range(count) if {lines[i], lines[(i + 1) % count]} == ends), None)
    scatter = readings.scatter
    if closing is None or not (back := _fit_slip(readings, closing, scatter)).is_clear(scatter):
        return
    others = range(closing + SLIP_FLANK, closing + count - SLIP_FLANK)
    slips = [_fit_slip(readings, edge % count, scatter) for edge in others]
    clear = [slip for slip in slips if slip.is_clear(scatter)]
    slip = max(clear, key=lambda slip: slip.significance, default=None)
    if slip is None:
        _require_small_drift(readings, closing, back)
        return
    if abs(slip.shift + back.shift) > MAX_RETURN_ERRORS * math.hypot(slip.error, back.error):
        return
    first = int(slip.indices[0])
    before, after = sorted((int(lines[first - 1]), int(lines[first])))
    raise ConfigError(
        f"{readings.name}: the lift jumps by {abs(slip.shift) * 1e3:.3g} mm between lines {before} "
        f"and {after}, and back between the last line and the first, so the gauge has slipped; "
        "allowed: readings with the same zero, so read again, or correct the lines from "
        f"{after} on"
    )


def _require_small_drift(readings: Readings, closing: int, back: Shift) -> None:
    """Raise ConfigError if the lift jumps from the last to the first reading.

    ``closing`` is the index of the reading before this jump, ``back`` the jump. No error is raised
    if the angle between the two readings is large.
    """
    steps = np.diff(readings.angles, append=readings.angles[0] + TURN)
    if steps[closing] <= MAX_CLOSING_STEPS * float(np.median(steps)):
        raise ConfigError(
            f"{readings.name}: the lift does not return after one turn, by "
            f"{abs(back.shift) * 1e3:.3g} mm between lines {readings.lines[closing]} and "
            f"{readings.lines[(closing + 1) % steps.size]}: the gauge has drifted, or a part of "
            "the table is missing; allowed: the same lift after one turn, so read again"
        )


def _runs(readings: Readings, scatter: float) -> Iterator[Shift]:
    """Yield the fitted common shift of each sequence of readings that may be shifted.

    Such a sequence starts and stops where readings deviate from their neighbours by more than
    `MIN_EDGE_SCATTERS`. ``scatter`` is the standard deviation of a reading, m.
    """
    count, half = readings.angles.size, WINDOW // 2
    values, is_valid = differences(readings.angles, readings.lifts)
    is_large = is_valid & (np.abs(values) > MIN_EDGE_SCATTERS * scatter)
    is_edge = np.any([np.roll(is_large, shift) for shift in range(-half, half)], axis=0)
    edges = np.flatnonzero(is_edge).tolist()
    if len(edges) > MAX_EDGES:
        return
    for start, stop in product(edges, edges):
        width = (stop - start) % count
        span = (readings.angles[stop] - readings.angles[(start + 1) % count]) % TURN
        if 2 <= width <= min(MAX_RUN, count // 4) and span <= MAX_RUN_SPAN:
            window = np.arange(start + 1 - RUN_FLANK, start + 1 + width + RUN_FLANK)
            is_shifted = (window > start) & (window <= start + width)
            yield _fit(readings, window, is_shifted, RUN_DEGREE, scatter)


def _fit_slip(readings: Readings, edge: int, scatter: float) -> Shift:
    """Return the step of the readings at a possible slip of the gauge.

    ``edge`` is the index of the last reading before it. The step is fitted together with a
    polynomial through `SLIP_FLANK` readings on both sides. ``scatter`` is the standard deviation of
    a reading, m.
    """
    window = np.arange(edge + 1 - SLIP_FLANK, edge + 1 + SLIP_FLANK)
    return _fit(readings, window, window > edge, SLIP_DEGREE, scatter)


def _fit(
    readings: Readings,
    window: NDArray[np.int64],
    is_shifted: NDArray[np.bool_],
    degree: int,
    scatter: float,
) -> Shift:
    """Fit a common shift of some readings together with a polynomial.

    ``window`` are the indices of all fitted readings, modulo their number. ``is_shifted`` marks the
    shifted readings, and ``degree`` is that of the polynomial. ``scatter`` is the standard
    deviation of a reading, m.
    """
    count = readings.angles.size
    indices = window % count
    x = readings.angles[indices] + TURN * (window // count)
    x = 2.0 * (x - x[0]) / (x[-1] - x[0]) - 1.0
    matrix = np.column_stack([chebvander(x, degree), is_shifted])
    inverse = np.linalg.pinv(matrix)
    coefficients = inverse @ readings.lifts[indices]
    residuals = readings.lifts[indices] - matrix @ coefficients
    return Shift(
        indices=indices[is_shifted],
        shift=float(coefficients[-1]),
        error=scatter * float(np.linalg.norm(inverse[-1])),
        residual=math.sqrt(float(np.sum(residuals**2)) / (window.size - degree - 2)),
    )
