"""The root between two signs, by Brent's method, without the imports of `scipy.optimize`."""

from __future__ import annotations

import math
from collections.abc import Callable

#: Relative width at which two neighbouring floats are told apart no further.
RELATIVE = 4.0 * 2.0**-52
#: Least absolute width: any root but 0 is found to its own relative width.
ABSOLUTE = 1e-300
#: A root beside 0 may take as many halvings as a float has; an ordinary one takes some ten steps.
MAX_STEPS = 2000


def bracketed_root(function: Callable[[float], float], lo: float, hi: float) -> float:
    """The x between ``lo`` and ``hi`` where a function changes sign, to rounding.

    Brent's method (R. P. Brent, Algorithms for Minimization without Derivatives, 1973, ch. 4): the
    secant or inverse quadratic interpolation where it closes in quickly, a halving where it does
    not. It takes the steps of `scipy.optimize.brentq`, and gives the same bits.

    Raises
    ------
    ValueError : the function has the same sign at both ends
    RuntimeError : not found in `MAX_STEPS`; a function that is not a number has no sign

    Examples
    --------
    >>> bracketed_root(lambda x: x * x - 2.0, 0.0, 2.0)
    1.4142135623730951
    """
    before, now = lo, hi
    f_before, f_now = function(before), function(now)
    if f_before == 0.0:
        return before
    if f_now == 0.0:
        return now
    if (f_before < 0.0) == (f_now < 0.0):
        raise ValueError(f"no change of sign between {lo:g} ({f_before:g}) and {hi:g} ({f_now:g})")
    other, f_other, step, last_step = before, f_before, 0.0, 0.0
    for _ in range(MAX_STEPS):
        if f_before != 0.0 and f_now != 0.0 and (f_before < 0.0) != (f_now < 0.0):
            other, f_other = before, f_before
            last_step = step = now - before
        if abs(f_other) < abs(f_now):  # go on from the better end
            before, now, other = now, other, now
            f_before, f_now, f_other = f_now, f_other, f_now
        width, half = 0.5 * (ABSOLUTE + RELATIVE * abs(now)), 0.5 * (other - now)
        if f_now == 0.0 or abs(half) < width:
            return now
        tried = math.inf
        if abs(last_step) > width and abs(f_now) < abs(f_before):
            tried = _interpolated((before, now, other), (f_before, f_now, f_other))
        if 2.0 * abs(tried) < min(abs(last_step), 3.0 * abs(half) - width):
            last_step, step = step, tried
        else:
            last_step = step = half
        before, f_before = now, f_now
        now += step if abs(step) > width else (width if half > 0.0 else -width)
        f_now = function(now)
    raise RuntimeError(f"no root between {lo:g} and {hi:g} after {MAX_STEPS} steps")


def _interpolated(x: tuple[float, float, float], f: tuple[float, float, float]) -> float:
    """Step to the zero of what goes through the last points; infinite where nothing does."""
    (before, now, other), (f_before, f_now, f_other) = x, f
    try:
        if before == other:
            return -f_now * (now - before) / (f_now - f_before)
        slope = (f_before - f_now) / (before - now)
        far_slope = (f_other - f_now) / (other - now)
        rise = f_other * far_slope - f_before * slope
        return -f_now * rise / (far_slope * slope * (f_other - f_before))
    except ZeroDivisionError:
        return math.inf
