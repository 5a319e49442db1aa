"""All checks of a cam (profile thesis §2.3), and the rejection of impossible cams."""

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
    find_min_base_radius,
    reach_checks,
)
from cam_rig.profile.contact import Element, Scan, greatest_between, stroke
from cam_rig.profile.disc import Disc, discs
from cam_rig.profile.faces import Swung
from cam_rig.schema import CamConfig
from cam_rig.schema.cam import Follower
from cam_rig.units import TURN, FloatArray

#: Largest deviation from s(θ) + s(θ + π) = s_max that counts as rounding, as a fraction of the
#: lift.
BREADTH_RTOL = 1e-9


def breadth_check(law: Law) -> Check:
    """Return the check that two opposite elements of a follower both touch the cam.

    The condition is s(θ) + s(θ + π) = s_max, the largest lift. The distance of the elements is then
    constant, for two flats the breadth 2 R_b + s_max of the cam, for two rollers its diameter.
    """
    max_lift = stroke(law)

    def difference(angle: FloatArray) -> FloatArray:
        return np.abs(law(angle) + law(angle + 0.5 * TURN) - max_lift)

    edges = np.concatenate([law.breaks, (law.breaks + 0.5 * TURN) % TURN])
    worst, limit = greatest_between(difference, np.unique(edges)), BREADTH_RTOL * law.lift
    remedy = "let the fall be the rise turned by 180°, or take conjugate cams"
    return Check.at("s(θ) + s(θ + 180°) − s_max", worst, "at most", limit, "mm", remedy)


# Pressure angle: the angle from the follower's direction of motion to the common normal.

#: Default limit of the pressure angle of a follower in a guide, rad, as handbooks recommend.
MAX_GUIDED_ANGLE = float(np.radians(30.0))
#: Default limit of the pressure angle of a follower on an arm, rad, as handbooks recommend.
MAX_SWUNG_ANGLE = float(np.radians(45.0))


def max_pressure_angle(follower: Follower, element: Element) -> float:
    """Return the greatest permitted pressure angle in rad.

    It is the value of the cam file, or the default of `MAX_GUIDED_ANGLE` or `MAX_SWUNG_ANGLE`.
    """
    if (limit := follower.most_pressure_angle) is not None:
        return limit.si
    return MAX_SWUNG_ANGLE if isinstance(element, Swung) else MAX_GUIDED_ANGLE


def pressure_check(scan: Scan, follower: Follower) -> Check:
    """Return the check of the largest magnitude of the pressure angle over the turn.

    A cam that fails it can be made (``is_fatal`` is False).
    """
    steepest = scan.greatest(lambda touch: np.abs(touch.pressure))
    limit = max_pressure_angle(follower, scan.element)
    remedy = "let base_radius be larger, the spans longer, or set most_pressure_angle"
    return replace(
        Check.at("pressure angle", steepest, "at most", limit, "°", remedy), is_fatal=False
    )


def check_cam(cam: CamConfig, law: Law) -> list[Check]:
    """Return all checks of a cam that apply to its type of follower.

    If a failed check is the cause of a failure in another check, it comes before it.

    Parameters
    ----------
    cam : CamConfig
        The cam, with its follower and base radius.
    law : Law
        The motion law of the cam.

    Returns
    -------
    list of Check
        The passed and the failed checks. Those of conjugate cams have the name of the disc.

    Raises
    ------
    ReachError
        The follower does not reach the base circle.

    Examples
    --------
    >>> import cam_rig
    >>> cam = cam_rig.load_cam("poly345")
    >>> [check.name for check in check_cam(cam, cam_rig.build_law(cam))][:2]
    ["step of the slope s'", 'distance from the axis']
    """
    follower, smaller = cam.follower, "a smaller one is undercut or out of reach"
    checks = [corner_check(law, VELOCITY_JUMP)]
    min_base = find_min_base_radius(follower, law)
    try:
        plates = discs(follower, law)
    except ReachError as error:
        raise ReachError(f"cam {cam.name!r}: {error}") from None
    if any(disc.opposite is not None for disc in plates):
        checks.append(breadth_check(law))
    for disc in plates:
        disc_checks = _disc_checks(disc, follower, law, min_base)
        checks += [replace(check, disc=disc.name) for check in disc_checks]
    if min_base is not None and min_base > 0.0:
        base = Extreme(follower.base_radius.si, 0.0)
        check = Check.at("base radius", base, "more than", min_base, "mm", smaller)
        checks.append(replace(check, angle=None, is_fatal=False))
    return checks


def _disc_checks(
    disc: Disc, follower: Follower, law: Law, min_base: float | None
) -> Iterator[Check]:
    """Yield the checks of one disc of a cam.

    ``min_base`` is the smallest base radius (m) that passes the checks, None if it is not known.
    """
    scan = Scan(law, disc.element)
    yield from reach_checks(scan)
    curvature = list(curvature_checks(scan, follower, min_base))
    yield from curvature
    if all(check.passed or not check.is_fatal for check in curvature):
        yield crossing_check(disc, law)
    yield pressure_check(scan, follower)


def require_profile(cam: CamConfig, law: Law) -> None:
    """Raise a `ProfileError` if a cam cannot exist.

    This is so if it fails a check with ``is_fatal`` True. The message is that of the first such
    check.
    """
    for check in check_cam(cam, law):
        if check.is_fatal and not check.passed:
            raise ProfileError(f"cam {cam.name!r}: {check}")


#: Smallest and largest usual lift of cams on a test bench, m. Other lifts are reported, not
#: rejected.
USUAL_LIFTS = 1e-4, 0.1


def warn_of_unusual_lift(lift: float) -> list[str]:
    """Return a warning if a lift (m) is outside of `USUAL_LIFTS`.

    The list is empty for a usual lift.
    """
    low, high = USUAL_LIFTS
    if low <= lift <= high:
        return []
    return [
        f"The lift of {lift * 1e3:.4g} mm is outside the usual size of a bench, {low * 1e3:g} to "
        f"{high * 1e3:g} mm: check its unit."
    ]


@dataclass(frozen=True)
class CheckedCam:
    """Cam with its law and all checks of its contour.

    Parameters
    ----------
    cam : CamConfig
        The cam, with its follower and base radius.
    law : Law
        The motion law of the cam.
    checks : list of Check
        Results of `check_cam`.
    """

    cam: CamConfig
    law: Law
    checks: list[Check]

    @classmethod
    def of(cls, cam: CamConfig, law: Law) -> CheckedCam:
        """Check a cam, and return the cam with its law and its checks."""
        return cls(cam, law, check_cam(cam, law))

    @property
    def failed(self) -> list[Check]:
        """Checks that the cam does not pass."""
        return [check for check in self.checks if not check.passed]

    def worst(self, name: str) -> float | None:
        """Return the worst value (SI) among the checks called `name`.

        It is the smallest value if the limit is a lower one, otherwise the largest. Conjugate cams
        have two checks of the same name, one per disc. Returns None if no check has this name, or
        if the worst value is not finite.
        """
        named = [check for check in self.checks if check.name == name]
        choose = min if named and named[0].relation == "more than" else max
        worst = choose((check.value for check in named), default=math.inf)
        return worst if math.isfinite(worst) else None

    @property
    def least_base_radius(self) -> float | None:
        """Smallest base radius (m) with which the cam passes its checks, None if unknown."""
        return next((check.limit for check in self.checks if check.name == "base radius"), None)
