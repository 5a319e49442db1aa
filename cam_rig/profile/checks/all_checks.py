"""All checks of a cam (profile thesis §2.3), and the refusal of one that cannot exist."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from cam_rig.errors import ProfileError, ReachError
from cam_rig.laws import Law
from cam_rig.laws.law import VELOCITY_JUMP
from cam_rig.profile.checks.base_radius import least_base_radius
from cam_rig.profile.checks.check import Check
from cam_rig.profile.checks.constant_breadth import breadth_check
from cam_rig.profile.checks.curvature import corner_check, curvature_checks
from cam_rig.profile.checks.pressure_angle import pressure_check
from cam_rig.profile.checks.reach import crossing_check, reach_checks
from cam_rig.profile.disc import Disc, discs
from cam_rig.profile.extremes import Scan
from cam_rig.schema import CamConfig
from cam_rig.schema.follower import Follower


def check_cam(cam: CamConfig, law: Law) -> list[Check]:
    """Every check that the kind of follower asks for, those first that explain the later ones.

    Raises
    ------
    ReachError : the follower does not even reach the base circle
    """
    follower = cam.follower
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
        base = follower.base_radius.si
        remedy = "a smaller one is undercut or out of reach"
        found.append(
            Check("base radius", base, "more than", least_base, "mm", None, remedy, vital=False)
        )
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
    """Refuse a cam that cannot exist.

    Raises
    ------
    ProfileError : the first thing that cannot be, with the angle, the value and the limit
    """
    for check in check_cam(cam, law):
        if check.vital and not check.passed:
            raise ProfileError(f"cam {cam.name!r}: {check}")
