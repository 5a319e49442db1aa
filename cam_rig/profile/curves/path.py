"""What a machine or a drawing follows: the contour, the pitch curve, the path of a cutter.

The centre of a cutter of radius R_c runs R_c outside the contour; with the roller's radius that
is the pitch curve (profile thesis §2.2.3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.errors import ConfigError, ProfileError
from cam_rig.laws import Law
from cam_rig.profile.checks.curvature import sharpest_concave
from cam_rig.profile.contour import Contour
from cam_rig.profile.disc import Disc, discs
from cam_rig.profile.extremes import Scan
from cam_rig.profile.motion import Motion
from cam_rig.schema.follower import Follower


@dataclass(frozen=True, eq=False)
class ContourPath:
    """A closed curve ``offset`` (m) outside a disc's contour."""

    name: str
    disc: Disc
    law: Law
    offset: float = 0.0

    def at(self, angle: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Points ``(2, n)`` m, radius of curvature m and pressure angle rad at cam angles, rad."""
        return self._of(Motion.at(self.law, angle))

    def uniform(self, count: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The same at equal steps over one turn."""
        return self._of(Motion.uniform(self.law, count))

    def _of(self, motion: Motion) -> tuple[FloatArray, FloatArray, FloatArray]:
        contour = Contour.of(self.disc, motion)
        points = contour.points + self.offset * contour.normal
        return points, contour.radius + self.offset, contour.pressure

    def require_room(self) -> None:
        """Refuse a cutter that is too large for a concave part of the contour.

        Raises
        ------
        ProfileError : with the angle, the radius of curvature there and the cutter's
        """
        found = sharpest_concave(Scan(self.law, self.disc.element))
        if found is not None and found.value <= self.offset:
            raise ProfileError(
                f"cutter radius is {self.offset * 1e3:.6g} mm; allowed: less than the concave "
                f"radius of curvature {found.value * 1e3:.6g} mm at "
                f"{np.degrees(found.angle):.4g}°; let the cutter be smaller"
            )


def contour_paths(follower: Follower, law: Law) -> list[ContourPath]:
    """The contours themselves, one a disc."""
    return [ContourPath(_layer("CAM", disc), disc, law) for disc in discs(follower, law)]


def pitch_paths(follower: Follower, law: Law) -> list[ContourPath]:
    """The pitch curves; of a point follower the contours.

    Raises
    ------
    ConfigError : a face has none
    """
    plates = discs(follower, law)
    if Contour.of(plates[0], Motion.uniform(law, 1)).pitch is None:
        raise ConfigError(
            f"a {follower.type} follower has no pitch curve; allowed: a roller or a point, or the "
            "path of a cutter by its radius"
        )
    return [ContourPath(_layer("PITCH", disc), disc, law, disc.element.roller) for disc in plates]


def cutter_paths(follower: Follower, law: Law, radius: float) -> list[ContourPath]:
    """Path of the centre of a cutter with this radius, m."""
    return [ContourPath(_layer("CUTTER", disc), disc, law, radius) for disc in discs(follower, law)]


def _layer(kind: str, disc: Disc) -> str:
    return f"{kind}_{disc.name.upper()}" if disc.name else kind
