"""The shape of a cam under its follower: contour, curvature, pressure angle, and its checks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from cam_rig.arguments import checked
from cam_rig.errors import ConfigError
from cam_rig.laws import Law, build_law
from cam_rig.profile.cam_checks import CheckedCam, check_cam
from cam_rig.profile.checks import Check
from cam_rig.profile.disc import Contour, contours
from cam_rig.schema import CamConfig
from cam_rig.show.result import Column, Records, Result
from cam_rig.studies.profile.study import ProfileResult
from cam_rig.units import FloatArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Points of a contour: at least, and at most.
FEWEST, MOST = 36, 1_000_000


def _of_discs(take: Callable[[Contour], Any]) -> Callable[[CamContour], Any]:
    return lambda shape: np.concatenate([take(disc) for disc in shape.discs])


_radius = _of_discs(lambda disc: disc.radius)


@dataclass(frozen=True, eq=False, repr=False)
class CamContour(Result):
    """The contour of a cam in its own frame; point i is touched at cam angle i.

    At cam angle 0 a translating follower is on +y; the cam turns counterclockwise.

    Parameters
    ----------
    cam, law : what the shape is of
    discs : one `Contour`, or two of conjugate cams; ``x`` and so on are those of the first
    """

    schema = "cam_rig.contour.1"
    plot_function = "cam_rig.studies.profile.figures:contour_figure"
    columns: ClassVar = {
        "points": (
            Column("disc", of=_of_discs(lambda disc: np.full(disc.angle.size, disc.disc.name))),
            Column("angle", "°", of=_of_discs(lambda disc: disc.angle), doc="cam angle"),
            Column("x", "mm", of=_of_discs(lambda disc: disc.points[0])),
            Column("y", "mm", of=_of_discs(lambda disc: disc.points[1])),
            Column("radius", "mm", of=_radius, doc="of curvature, below 0 where concave"),
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
        """``(n,)`` cam angles, rad."""
        return self.discs[0].angle

    @property
    def x(self) -> FloatArray:
        """``(n,)`` m."""
        return np.asarray(self.discs[0].points[0])

    @property
    def y(self) -> FloatArray:
        """``(n,)`` m."""
        return np.asarray(self.discs[0].points[1])

    @property
    def radius(self) -> FloatArray:
        """``(n,)`` radius of curvature, m: positive where convex, negative where concave."""
        return self.discs[0].radius

    @property
    def pressure_angle(self) -> FloatArray:
        """``(n,)`` rad, signed."""
        return self.discs[0].pressure

    @cached_property
    def checks(self) -> list[Check]:
        """Undercut, curvature, pressure angle, reach: each with value, limit and ``passed``."""
        return check_cam(self.cam, self.law)

    def tables(self) -> list[Records]:
        """``points`` of every disc, and its ``checks``."""
        checked = ProfileResult((CheckedCam(self.cam, self.law, self.checks),))
        return [self.array_table("points"), checked.tables()[0]]

    @checked
    def plot(self, positions: int = 24) -> Figure:  # type: ignore[override]
        """The cam with its follower around it, curvature and pressure angle.

        Parameters
        ----------
        positions : of the follower around the cam, 3 to 720
        """
        return super().plot(positions=positions)


@checked
def contour(cam: CamConfig, points: int = 3600) -> CamContour:
    """The contour of a cam at equal steps of the cam angle, by kinematic inversion.

    Parameters
    ----------
    cam : of `load_cam`
    points : of one turn, 36 to 1 000 000

    Raises
    ------
    ConfigError : another number of points
    LawError, ReachError : the law does not join, or the follower cannot reach the base circle

    Examples
    --------
    >>> import cam_rig
    >>> shape = cam_rig.contour(cam_rig.load_cam("poly345"), points=360)
    >>> round(float(shape.radius.min()) * 1e3, 1)  # mm
    65.0
    >>> all(check.passed for check in shape.checks)
    True
    """
    if not FEWEST <= points <= MOST:
        raise ConfigError(f"points: is {points}; allowed: {FEWEST} to {MOST}")
    law = build_law(cam)
    found = contours(cam.follower, law, points)
    for disc in found:
        for array in (getattr(disc, field.name) for field in fields(disc)):
            if isinstance(array, np.ndarray):
                array.setflags(write=False)
    return CamContour(cam, law, found)
