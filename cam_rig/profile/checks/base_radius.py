"""The smallest base radius that avoids undercut (eq. 2.42, and its counterpart for rollers)."""

from __future__ import annotations

from collections.abc import Callable

from scipy.optimize import brentq

from cam_rig.errors import ReachError
from cam_rig.laws import Law
from cam_rig.profile.checks.curvature import sharpest_convex
from cam_rig.profile.checks.reach import least_clearance, pivot_checks
from cam_rig.profile.disc import Disc, discs
from cam_rig.profile.extremes import Scan
from cam_rig.schema.follower import ConstantBreadth, Flat, Follower, InclinedFlat

#: The search goes from the cam's own base radius by these factors, to these ends of it.
SMALLER, LARGER = 0.5, 2.0
LEAST, MOST = 1e-2, 1e3
#: The base radius is found to this fraction of the cam's own.
PRECISION = 1e-12


def least_base_radius(follower: Follower, law: Law) -> float | None:
    """The base radius (m) above which no convex part is sharper than the least radius asked for.

    Nor does the follower cross the cam's axis. A face in a guide has both in closed form: radius
    R_b + (s + s'') cos β, distance from the axis R_b + s cos β. For the others it is the root, next
    to the cam's own base radius, of the least radius as a function of R_b; the least one that the
    follower reaches counts as such. 0 where every base radius down to a hundredth of the own does,
    None where none does, or the cam cuts the pivot of an arm there.
    """
    asked, own = follower.least_curvature_radius, follower.base_radius.si
    sharpest = 0.0 if asked is None else asked.si
    if isinstance(follower, Flat | InclinedFlat | ConstantBreadth):
        plates = discs(follower, law)
        nearest = least_clearance(plates[0].element, law).value
        return max(0.0, own + sharpest - _sharpest(plates, law), own - nearest)

    def margin(base: float) -> float:
        found = plates_on(follower, law, base)
        value = _sharpest(found, law) - sharpest if found else -own
        return min(max(value, -own), own)  # finite, for the root finder

    least = least_base(margin, own)
    if least and not _clear_of_the_pivot(follower, law, least * (1.0 + PRECISION)):
        return None
    return least


def least_base(margin: Callable[[float], float], own: float) -> float | None:
    """The root next to ``own`` of a finite margin that grows with the base radius (m).

    0 where the margin is positive down to a hundredth of ``own``, None where it nowhere is.
    """
    good = margin(own) > 0.0
    here, factor = own, SMALLER if good else LARGER
    while LEAST * own < here < MOST * own:
        there = here * factor
        if (margin(there) > 0.0) != good:
            low, high = sorted((here, there))
            return float(brentq(margin, low, high, xtol=PRECISION * own))
        here = there
    return 0.0 if good else None


def _clear_of_the_pivot(follower: Follower, law: Law, base: float) -> bool:
    """Whether the cam on a base radius does not cut the pivot; on larger ones it sooner does."""
    found = (Scan(law, disc.element) for disc in plates_on(follower, law, base))
    return all(check.passed for scan in found for check in pivot_checks(scan))


def _sharpest(plates: tuple[Disc, ...], law: Law) -> float:
    return min(sharpest_convex(Scan(law, disc.element)).value for disc in plates)


def plates_on(follower: Follower, law: Law, base: float) -> tuple[Disc, ...]:
    """The discs on another base radius; none where the follower does not reach."""
    try:
        plates = discs(follower, law, base)
    except ReachError:
        return ()
    clear = all(least_clearance(disc.element, law).value > 0.0 for disc in plates)
    return plates if clear else ()
