"""Function that computes a cam's contour with its curvature and pressure angle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from cam_rig.arguments import check_arguments
from cam_rig.errors import ConfigError
from cam_rig.laws import Law, build_law
from cam_rig.profile.cam_checks import CheckedCam, check_cam
from cam_rig.profile.checks import Check
from cam_rig.profile.disc import Contour, contours
from cam_rig.schema import CamConfig
from cam_rig.show.result import Column, Records, Result
from cam_rig.simulation.inputs import Cam, resolve_cam
from cam_rig.studies.profile.study import ProfileResult
from cam_rig.units import FloatArray

#: Smallest number of points of a contour that can be requested.
MIN_POINTS = 36
#: Largest number of points of a contour that can be requested.
MAX_POINTS = 1_000_000


def _of_discs(take: Callable[[Contour], Any]) -> Callable[[CamContour], Any]:
    """Return a function that maps a CamContour to one array over all its discs.

    `take` returns the array of one disc. The arrays are concatenated, because conjugate cams have
    two discs.
    """
    return lambda shape: np.concatenate([take(disc) for disc in shape.discs])


_radius = _of_discs(lambda disc: disc.radius)


@dataclass(frozen=True, eq=False, repr=False)
class CamContour(Result):
    """Contour of a cam in the cam's frame. Point i is touched at cam angle i.

    At cam angle 0 a translating follower is on +y. The cam turns counterclockwise. ``plot`` has the
    option ``positions``: the number of positions of the follower around the cam, 3 to 720 (default:
    24).

    Parameters
    ----------
    cam : CamConfig
        The cam.
    law : Law
        Its law.
    discs : tuple of Contour
        One contour, or two for conjugate cams. `x`, `y` and the other arrays are those of the
        first.

    Examples
    --------
    >>> import cam_rig
    >>> cam_rig.contour("poly345", points=360)
    CamContour(poly345: 360 points, 1 disc(s))
    """

    schema = "cam_rig.contour.1"
    plot_function = "cam_rig.studies.profile.figures:contour_figure"
    columns: ClassVar = {
        "points": (
            Column("disc", of=_of_discs(lambda disc: np.full(disc.angle.size, disc.disc.name))),
            Column("angle", "°", of=_of_discs(lambda disc: disc.angle), doc="cam angle"),
            Column("x", "mm", of=_of_discs(lambda disc: disc.points[0])),
            Column("y", "mm", of=_of_discs(lambda disc: disc.points[1])),
            Column("radius", "mm", of=_radius, doc="radius of curvature, negative where concave"),
            Column("pressure_angle", "°", of=_of_discs(lambda disc: disc.pressure)),
        ),
        "checks": ProfileResult.columns["checks"],
    }

    cam: CamConfig
    law: Law
    discs: tuple[Contour, ...]

    def __repr__(self) -> str:
        return f"CamContour({self.cam.name}: {self.angle.size} points, {len(self.discs)} disc(s))"

    @property
    def angle(self) -> FloatArray:
        """Cam angles (rad) at which the follower touches the points, shape ``(n,)``."""
        return self.discs[0].angle

    @property
    def x(self) -> FloatArray:
        """Coordinates x of the points of the first disc in m, shape ``(n,)``."""
        return np.asarray(self.discs[0].points[0])

    @property
    def y(self) -> FloatArray:
        """Coordinates y of the points of the first disc in m, shape ``(n,)``."""
        return np.asarray(self.discs[0].points[1])

    @property
    def radius(self) -> FloatArray:
        """Radius of curvature in m, shape ``(n,)``.

        It is positive where the contour is convex, and negative where it is concave.
        """
        return self.discs[0].radius

    @property
    def pressure_angle(self) -> FloatArray:
        """Pressure angles at the points of a contour, with sign, in rad, shape ``(n,)``."""
        return self.discs[0].pressure

    @cached_property
    def checks(self) -> list[Check]:
        """Checks of undercut, curvature, pressure angle and reach, with their limits."""
        return check_cam(self.cam, self.law)

    def tables(self) -> list[Records]:
        """Return the tables `points`, with the points of all discs, and `checks`."""
        checked = ProfileResult((CheckedCam(self.cam, self.law, self.checks),))
        return [self.array_table("points"), checked.tables()[0]]


@check_arguments
def contour(cam: Cam, points: int = 3600) -> CamContour:
    """Compute the contour of a cam at equal steps of the cam angle.

    The method is kinematic inversion.

    Parameters
    ----------
    cam : Cam, str or Path
        Cam: its name in ``config/cams``, its path, or the object.
    points : int
        Points of one turn, 36 to 1 000 000 (default: 3600).

    Returns
    -------
    CamContour
        The contour with curvature, pressure angle and checks.

    Raises
    ------
    ConfigError
        The number of points is out of range.
    LawError
        The segments of the law do not join.
    ReachError
        The follower does not reach the base circle.

    Examples
    --------
    >>> import cam_rig
    >>> shape = cam_rig.contour("poly345", points=360)
    >>> round(float(shape.radius.min()) * 1e3, 1)  # mm
    65.0
    >>> all(check.passed for check in shape.checks)
    True

    References
    ----------
    Profile thesis, §2.2.3.
    """
    if not MIN_POINTS <= points <= MAX_POINTS:
        raise ConfigError(f"points must be between {MIN_POINTS} and {MAX_POINTS}, got {points}")
    cam = resolve_cam(cam)
    law = build_law(cam)
    cam_contours = contours(cam.follower, law, points)
    for disc in cam_contours:
        for array in (getattr(disc, field.name) for field in fields(disc)):
            if isinstance(array, np.ndarray):
                array.setflags(write=False)
    return CamContour(cam, law, cam_contours)
