"""The smallest base radius that avoids undercut (eq. 2.42, and its counterpart for rollers)."""

from __future__ import annotations

from scipy.optimize import brentq

from cam_rig.errors import ProfileError
from cam_rig.laws import Law
from cam_rig.laws.peaks import extremes
from cam_rig.profile.centre import GuidedCentre
from cam_rig.profile.curvature import sharpest_convex
from cam_rig.profile.disc import Disc, discs
from cam_rig.profile.extremes import Scan
from cam_rig.profile.face import GuidedFace
from cam_rig.schema.follower import Follower

#: The search goes from the cam's own base radius by these factors, to these ends of it.
SMALLER, LARGER = 0.5, 2.0
LEAST, MOST = 1e-2, 1e3
#: The base radius is found to this fraction of the cam's own.
PRECISION = 1e-12


def least_base_radius(follower: Follower, law: Law) -> float | None:
    """The base radius (m) above which no convex part is sharper than the least radius asked for.

    A face in a guide has it in closed form, min over θ of r_c being R_b + min (s + s'') cos β. For
    the others it is the root, next to the cam's own base radius, of that minimum as a function of
    R_b; the least one that the follower reaches counts as such. 0 where every base radius
    down to a hundredth of the own does, None where none does.
    """
    asked, own = follower.least_curvature_radius, follower.base_radius.si
    least = 0.0 if asked is None else asked.si
    plates = _plates(follower, law, own)
    if plates and isinstance(plates[0].element, GuidedFace):
        return max(0.0, least - _sharpest(plates, law) + own)

    def margin(base: float) -> float:
        found = _plates(follower, law, base)
        value = _sharpest(found, law) - least if found else -own
        return min(max(value, -own), own)  # finite, for the root finder

    good = margin(own) > 0.0
    here, factor = own, SMALLER if good else LARGER
    while LEAST * own < here < MOST * own:
        there = here * factor
        if (margin(there) > 0.0) != good:
            low, high = sorted((here, there))
            return float(brentq(margin, low, high, xtol=PRECISION * own))
        here = there
    return 0.0 if good else None


def _sharpest(plates: tuple[Disc, ...], law: Law) -> float:
    return min(sharpest_convex(Scan(law, disc.element)).value for disc in plates)


def _plates(follower: Follower, law: Law, base: float) -> tuple[Disc, ...]:
    """The discs on another base radius; none where the follower does not reach."""
    try:
        plates = discs(follower, law, base)
    except ProfileError:
        return ()
    low, high = (extreme.value for extreme in extremes(law, 0))
    guided = (disc.element for disc in plates if isinstance(disc.element, GuidedCentre))
    lowest = (one.start + min(one.side * low, one.side * high) for one in guided)
    return plates if all(height > 0.0 for height in lowest) else ()
