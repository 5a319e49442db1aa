"""Checks of a table with half a lobe, from its nose to its base circle."""

from __future__ import annotations

import math

import numpy as np

from cam_rig.errors import ConfigError
from cam_rig.laws.spline import scatter
from cam_rig.schema.segment_base import MIN_POINTS
from cam_rig.units import FloatArray

#: Fraction of the angle range, at the end of the table opposite the nose, over which the slope of
#: the lift is fitted. At least 2 readings are used.
END_FRACTION = 0.03
#: Fraction of the lift below the nose over which polynomials are fitted to the readings. At least 4
#: readings are used.
NOSE_FRACTION = 0.02
#: Largest difference between the largest lift and the lift at the nose's end of the table, in
#: scatters (standard deviations of a reading). One step of the gauge is added to this limit.
TIE_SCATTERS = 3.0
#: Relative tolerance for the rounding of a difference of one step of the gauge.
STEP_RTOL = 1e-6
#: Largest relative change of the curvature of the lift from the reading at the nose to the vertex
#: of the fitted nose. It is that of a nose whose lift changes with the fourth power of the angle.
MAX_CURVATURE_CHANGE = 2.0 / 3.0
#: Largest slope of the lift, at the end of the table opposite the nose, that counts as rest. It is
#: a fraction of the steepest slope. A half lobe that is cut off at 80 % of its angle has a slope
#: several times as large.
MAX_END_SLOPE = 0.05
#: Largest distance of the nose's vertex from the reading with the largest lift, in steps of the
#: angle. Half a step is possible if the nose is between two readings. A quarter is added for noise.
MAX_STEPS_TO_NOSE = 0.75
#: Number of standard errors of the slope that are added to the slope limits of half a lobe, to
#: allow for noise.
SLOPE_ERRORS = 3.0
#: Number of standard errors that are added to the slope limit of a cubic polynomial, to allow for
#: noise. It is larger than `SLOPE_ERRORS` because this slope depends mainly on the first reading,
#: which was selected as the largest and may be so because of its error.
CUBIC_SLOPE_ERRORS = 6.0


def nose_of_half_lobe(file: str, resolution: float, angles: FloatArray, lifts: FloatArray) -> float:
    """Return the angle (rad) of the nose of half a lobe.

    The nose must be at the smallest or largest angle of the table. The lift there must be the
    largest, within the scatter and one step of the gauge. ``file`` is the name of the table,
    `resolution` the step of the lifts in m. Raises ConfigError if the nose is inside the table or
    not reached, or if the lift is not at rest at the other end.
    """
    ends = [int(np.argmin(angles)), int(np.argmax(angles))]
    end = max(ends, key=lambda i: float(lifts[i]))
    nose = float(angles[end])
    x, first = np.unique(np.abs(angles - nose), return_index=True)
    y, noise = lifts[first], 0.0
    # Shorter tables are rejected later, because they have too few readings.
    is_long = x.size >= MIN_POINTS // 2
    if is_long:
        noise = max(scatter(x, y), resolution / math.sqrt(12.0))
    if lifts.max() - lifts[end] > resolution * (1.0 + STEP_RTOL) + TIE_SCATTERS * noise:
        nose = float(angles[int(np.argmax(lifts))])
        raise ConfigError(
            f"{file}: the largest lift is at {math.degrees(nose):.6g} deg, inside the table; "
            "allowed with --mirror: half a lobe, which starts or ends at its nose"
        )
    if is_long:
        _require_rest_at_end(file, x, y, noise)
        _require_nose(file, x, y, noise)
    return nose


def _require_rest_at_end(file: str, x: FloatArray, y: FloatArray, noise: float) -> None:
    """Raise ConfigError if the lift still changes at the far end of half a lobe.

    `x` is the angle (rad) from the nose, `y` the lift (m), `noise` the standard deviation of a lift
    (m).
    """
    count = max(2, int(np.sum(x >= x[-1] - END_FRACTION * x[-1])))
    slope, error = _slope_at_zero(x[-count:] - x[-1], y[-count:], 1, noise)
    steepest = float(np.max(np.abs((y[count:] - y[:-count]) / (x[count:] - x[:-count]))))
    if abs(slope) > MAX_END_SLOPE * steepest + SLOPE_ERRORS * error:
        raise ConfigError(
            f"{file}: the lift still changes by {abs(slope) * 1e3 * math.radians(1.0):.3g} "
            f"mm/deg at the end of the half lobe, {abs(slope) / steepest:.2g} of its steepest "
            "slope; allowed with --mirror: half a lobe from its nose to its base circle"
        )


def _require_nose(file: str, x: FloatArray, y: FloatArray, noise: float) -> None:
    """Raise ConfigError if half a lobe does not reach the vertex of its nose.

    `x` is the angle (rad) from the reading with the largest lift, `y` the lift (m), `noise` its
    standard deviation (m). The vertex must be within `MAX_STEPS_TO_NOSE` steps of that reading. It
    is computed from a fitted parabola, and from a cubic polynomial for a nose whose lift changes
    with a higher power of the angle. The slope of the cubic has a larger error, but does not
    underestimate the distance.
    """
    count = max(4, int(np.sum(y >= y[0] - NOSE_FRACTION * float(np.ptp(y)))))
    nose_x, nose_y = x[:count], y[:count]
    distance = MAX_STEPS_TO_NOSE * float(x[1] - x[0])
    slope, error = _slope_at_zero(nose_x, nose_y, 2, noise)
    curvature = 2.0 * abs(float(np.polyfit(nose_x, nose_y, 2)[0]))
    is_missing = slope < -curvature * distance - SLOPE_ERRORS * error
    cubic_slope, cubic_error = _slope_at_zero(nose_x, nose_y, 3, noise)
    third, second = (float(c) for c in np.polyfit(nose_x, nose_y, 3)[:2])
    curvature = 2.0 * abs(second)
    change = 6.0 * cubic_slope * third / curvature**2 if curvature else 0.0
    curvature *= 1.0 - min(max(change, 0.0), MAX_CURVATURE_CHANGE)
    is_missing |= cubic_slope < -curvature * distance - CUBIC_SLOPE_ERRORS * cubic_error
    if is_missing:
        raise ConfigError(
            f"{file}: the lift still rises by {-slope * 1e3 * math.radians(1.0):.3g} mm/deg "
            "at the largest lift, so the nose is not reached; allowed with --mirror: half a lobe "
            "that contains its nose"
        )


def _slope_at_zero(x: FloatArray, y: FloatArray, degree: int, noise: float) -> tuple[float, float]:
    """Return the slope (m/rad) at x = 0 of a polynomial fit, and its standard error.

    ``x`` is in rad, ``y`` in m, and ``noise`` is the standard deviation of y in m.
    """
    inverse = np.linalg.pinv(np.vander(x, degree + 1, increasing=True))
    return float(inverse[1] @ y), noise * float(np.linalg.norm(inverse[1]))
