"""Radius of curvature: undercut, cusp, and a roller that does not fit (§2.3.1-2.3.2).

A radius is positive where the contour is convex, negative where it is concave. Under a roller the
curvature of the pitch curve is compared, for that is finite wherever the law is smooth:
r_c = r_cp − R_r with the same signs (eq. 2.43).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.laws import Law
from cam_rig.laws.peaks import Extreme
from cam_rig.profile.checks.check import Check
from cam_rig.profile.contact import Touch
from cam_rig.profile.extremes import Scan
from cam_rig.schema.follower import Follower

#: Radii of curvature below this fraction of the base radius are none: a cusp.
CUSP = 1e-9


def _radius(touch: Touch) -> FloatArray:
    return touch.radius


def _bend(touch: Touch) -> FloatArray:
    assert touch.pitch_curvature is not None
    return touch.pitch_curvature


def sharpest_convex(scan: Scan) -> Extreme:
    """Least convex radius of the contour, m; not positive where it is undercut.

    Infinite for a contour without a convex part.
    """
    if scan.touch.pitch_curvature is None:
        return scan.least(_radius)
    bend = scan.greatest(_bend)
    radius = 1.0 / bend.value - scan.element.roller if bend.value > 0.0 else np.inf
    return Extreme(radius, bend.angle)


def sharpest_concave(scan: Scan) -> Extreme | None:
    """Least concave radius of the contour, m, positive; None for a cam without a concave part.

    It is the pitch curve's and the roller's together, so a law without a corner passes.
    """
    if scan.touch.pitch_curvature is None:
        return None
    bend = scan.least(_bend)
    if not bend.value < 0.0:
        return None
    return Extreme(scan.element.roller - 1.0 / bend.value, bend.angle)


def curvature_checks(scan: Scan, follower: Follower, least_base: float | None) -> Iterator[Check]:
    """Convex parts against undercut and the radius asked for; concave parts against the roller."""
    base, asked = follower.base_radius.si, follower.least_curvature_radius
    convex = sharpest_convex(scan)
    radius = 0.0 if abs(convex.value) <= CUSP * base else convex.value
    remedy = "no base_radius would do: let the spans be longer, the lift less or the roller smaller"
    if least_base is not None:
        remedy = f"let base_radius be more than {least_base * 1e3:.5g} mm"
    yield Check(
        "convex radius of curvature",
        radius,
        "more than",
        0.0 if asked is None else asked.si,
        "mm",
        convex.angle,
        remedy,
        vital=radius <= 0.0,
    )
    concave = sharpest_concave(scan)
    if concave is not None and scan.element.roller > 0.0:
        yield Check(
            "concave radius of curvature",
            concave.value,
            "more than",
            scan.element.roller,
            "mm",
            concave.angle,
            "let the roller be smaller or the spans longer",
        )


def corner_check(law: Law, tolerance: float) -> Check:
    """The contour has a corner where the slope of the law jumps."""
    jumps = np.abs(law.jumps(1))
    worst = int(np.argmax(jumps))
    return Check(
        "step of the slope s'",
        float(jumps[worst]),
        "at most",
        tolerance * law.lift,
        "mm/rad",
        float(law.breaks[worst]),
        "let the segments join with one slope, for the contour has a corner there",
    )
