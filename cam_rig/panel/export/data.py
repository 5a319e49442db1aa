"""Data of cams and rigs for the static drawing board, which computes all results in the page."""

from __future__ import annotations

from typing import Any

from cam_rig.laws import Law
from cam_rig.profile.cam_checks import max_pressure_angle
from cam_rig.profile.disc import discs
from cam_rig.schema import CamConfig

#: Sizes of a follower that are 0 if its type or its file does not have them.
ZERO_SIZES = (
    "base_radius",
    "roller_radius",
    "eccentricity",
    "inclination",
    "arm",
    "pivot_distance",
    "face_offset",
)
#: Sizes of a follower that have a default other than 0, or None.
DEFAULT_SIZES = ("roller_distance", "arms_angle")


def follower_sizes(cam: CamConfig, law: Law) -> dict[str, Any]:
    """Return the type and the sizes (m, rad) of a cam's follower, and its limits.

    A size that the type of follower does not have is 0, or None if it has a default.
    ``allowed_pressure`` is the largest pressure angle.
    """
    follower = cam.follower
    sizes = {name: getattr(follower, name, None) for name in (*ZERO_SIZES, *DEFAULT_SIZES)}
    values = {name: None if size is None else size.si for name, size in sizes.items()}
    allowed = max_pressure_angle(follower, discs(follower, law)[0].element)
    zeros = {name: values[name] or 0.0 for name in ZERO_SIZES}
    return {"type": follower.type, "allowed_pressure": allowed} | values | zeros
