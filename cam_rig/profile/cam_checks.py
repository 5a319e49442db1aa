"""All checks of a cam (profile thesis §2.3), and the refusal of one that cannot exist."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from cam_rig.errors import ProfileError, ReachError
from cam_rig.laws import Law
from cam_rig.laws.law import VELOCITY_JUMP, Extreme
from cam_rig.profile.checks import (
    Check,
    corner_check,
    crossing_check,
    curvature_checks,
    least_base_radius,
    reach_checks,
)
from cam_rig.profile.contact import Element, Scan, greatest_between, stroke
from cam_rig.profile.disc import Disc, discs
from cam_rig.profile.faces import Swung
from cam_rig.schema import CamConfig
from cam_rig.schema.cam import Follower
from cam_rig.units import TURN, FloatArray

# The condition of constant breadth and constant diameter: s(θ) + s(θ + π) = s_max.

#: The sum may differ from s_max by this fraction of the lift.
TOLERANCE = 1e-9


def breadth_check(law: Law) -> Check:
    """How far the sum of opposite displacements is from what the two elements are apart for."""
    apart = stroke(law)

    def difference(angle: FloatArray) -> FloatArray:
        return np.abs(law(angle) + law(angle + 0.5 * TURN) - apart)

    edges = np.concatenate([law.breaks, (law.breaks + 0.5 * TURN) % TURN])
    worst, limit = greatest_between(difference, np.unique(edges)), TOLERANCE * law.lift
    remedy = "let the fall be the rise turned by 180°, or take conjugate cams"
    return Check.at("s(θ) + s(θ + 180°) − s_max", worst, "at most", limit, "mm", remedy)


# Pressure angle: from the follower's direction of motion to the common normal.

#: The most when the cam file names none, rad: what handbooks advise for a guide and for a pivot.
GUIDED, SWUNG = float(np.radians(30.0)), float(np.radians(45.0))


def greatest_allowed(follower: Follower, element: Element) -> float:
    """The most pressure angle, rad: what the cam file asks for, else what handbooks advise."""
    if (asked := follower.most_pressure_angle) is not None:
        return asked.si
    return SWUNG if isinstance(element, Swung) else GUIDED


def pressure_check(scan: Scan, follower: Follower) -> Check:
    """The greatest pressure angle of either sign against what guide or pivot bear."""
    steepest = scan.greatest(lambda touch: np.abs(touch.pressure))
    limit = greatest_allowed(follower, scan.element)
    remedy = "let base_radius be larger, the spans longer, or set most_pressure_angle"
    return replace(Check.at("pressure angle", steepest, "at most", limit, "°", remedy), vital=False)


def check_cam(cam: CamConfig, law: Law) -> list[Check]:
    """Every check that the kind of follower asks for, those first that explain the later ones."""
    follower, smaller = cam.follower, "a smaller one is undercut or out of reach"
    found = [corner_check(law, VELOCITY_JUMP)]
    least_base = least_base_radius(follower, law)
    try:
        plates = discs(follower, law)
    except ReachError as error:
        raise ReachError(f"cam {cam.name!r}: {error}") from None
    if any(disc.opposite is not None for disc in plates):
        found.append(breadth_check(law))
    for disc in plates:
        checks = list(_disc_checks(disc, follower, law, least_base))
        found += [replace(check, disc=disc.name) for check in checks]
    if least_base is not None and least_base > 0.0:
        base = Extreme(follower.base_radius.si, 0.0)
        check = Check.at("base radius", base, "more than", least_base, "mm", smaller)
        found.append(replace(check, angle=None, vital=False))
    return found


def _disc_checks(
    disc: Disc, follower: Follower, law: Law, least_base: float | None
) -> Iterator[Check]:
    scan = Scan(law, disc.element)
    yield from reach_checks(scan)
    curvature = list(curvature_checks(scan, follower, least_base))
    yield from curvature
    if all(check.passed or not check.vital for check in curvature):
        yield crossing_check(disc, law)
    yield pressure_check(scan, follower)


def require_profile(cam: CamConfig, law: Law) -> None:
    """Refuse a cam that cannot exist."""
    for check in check_cam(cam, law):
        if check.vital and not check.passed:
            raise ProfileError(f"cam {cam.name!r}: {check}")


# Cams with their checks, as `cam-rig profile` gives them.

#: Lifts (m) of the cams that fit on a bench. Others may be right, but are reported.
USUAL_LIFTS = 1e-4, 0.1


def unusual_lift(lift: float) -> list[str]:
    """Return a sentence on a lift (m) outside of `USUAL_LIFTS`, none for a usual one."""
    low, high = USUAL_LIFTS
    if low <= lift <= high:
        return []
    return [
        f"The lift of {lift * 1e3:.4g} mm is outside the usual size of a bench, {low * 1e3:g} to "
        f"{high * 1e3:g} mm: check its unit."
    ]


@dataclass(frozen=True)
class CheckedCam:
    """A cam, its law, and every check of its contour."""

    cam: CamConfig
    law: Law
    checks: list[Check]

    @classmethod
    def of(cls, cam: CamConfig, law: Law) -> CheckedCam:
        """Check it."""
        return cls(cam, law, check_cam(cam, law))

    @property
    def failed(self) -> list[Check]:
        """The checks that it does not pass."""
        return [check for check in self.checks if not check.passed]

    def worst(self, name: str) -> float | None:
        """Value of the check of that name that is nearest to its limit, of two discs."""
        named = [check for check in self.checks if check.name == name]
        nearest = min if named and named[0].relation == "more than" else max
        worst = nearest((check.value for check in named), default=math.inf)
        return worst if math.isfinite(worst) else None

    @property
    def least_base_radius(self) -> float | None:
        """Limit of the base radius, m; None where none was found."""
        return next((check.limit for check in self.checks if check.name == "base radius"), None)


# Cams that are asked for by name, file or scene, each with its checks.
