"""Closed polylines along a contour or a cutter path, with few points.

The largest distance of the path from the chords of the polyline (the chord error) is measured and
kept within a tolerance. A jump of s' or s'' of the law is a corner or a jump of curvature of the
path. The polyline has a vertex just before and just after it.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from cam_rig.errors import ConfigError, ProfileError
from cam_rig.laws import Law
from cam_rig.laws.law import joints
from cam_rig.profile.checks import sharpest_concave
from cam_rig.profile.contact import Motion, Scan
from cam_rig.profile.disc import Contour, Disc, discs
from cam_rig.profile.faces import GuidedFace, SwungFace
from cam_rig.schema.cam import Follower
from cam_rig.units import TURN, FloatArray


@dataclass(frozen=True, eq=False)
class ContourPath:
    """Closed curve at a distance `offset` (m) outside the contour of a disc.

    It is the contour, the pitch curve or the path of a cutter.
    """

    name: str  #: name of the path in a drawing, such as CAM or PITCH
    disc: Disc  #: disc of the cam
    law: Law  #: motion law of the cam
    offset: float = 0.0  #: distance from the contour, m

    def at(self, angle: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return points, radii of curvature and pressure angles of the path.

        `angle` are n cam angles (rad). The results are points ``(2, n)`` in m, radii of curvature
        of the path ``(n,)`` in m, and pressure angles ``(n,)`` in rad.
        """
        return self.of(Motion.at(self.law, angle))

    def of(self, motion: Motion) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return points, radii of curvature and pressure angles of the path.

        `motion` is that of the follower at n cam angles. The results are those of `at`.
        """
        contour = Contour.of(self.disc, motion)
        points = contour.points + self.offset * contour.normal
        return points, contour.radius + self.offset, contour.pressure

    def require_room(self) -> None:
        """Raise a `ProfileError` if a cutter is too large for a concave part of the contour.

        The radius of the cutter is `offset`.
        """
        concave = sharpest_concave(Scan(self.law, self.disc.element))
        if concave is not None and concave.value <= self.offset:
            raise ProfileError(
                f"cutter radius is {self.offset * 1e3:.6g} mm; allowed: less than the concave "
                f"radius of curvature {concave.value * 1e3:.6g} mm at "
                f"{np.degrees(concave.angle):.4g}°; let the cutter be smaller"
            )


def contour_paths(
    follower: Follower, law: Law, kind: str = "CAM", offset: float = 0.0
) -> list[ContourPath]:
    """Return closed paths at a distance `offset` (m) outside a cam's contours.

    The result has one path per disc. An offset of 0 gives the contours, an offset of the cutter's
    radius gives the path of a cutter. The name of a path starts with `kind`.
    """
    return [
        ContourPath(f"{kind}_{disc.name.upper()}" if disc.name else kind, disc, law, offset)
        for disc in discs(follower, law)
    ]


def pitch_paths(follower: Follower, law: Law) -> list[ContourPath]:
    """Return the pitch curves of a cam, one per disc.

    A pitch curve is the path of the roller's centre in the cam frame. For a point follower it is
    the contour.

    Raises
    ------
    ConfigError
        If the follower has a flat face.
    """
    paths = contour_paths(follower, law, "PITCH", follower.roller)
    if isinstance(paths[0].disc.element, GuidedFace | SwungFace):
        raise ConfigError(
            f"a {follower.type} follower has no pitch curve; allowed: a roller or a point, or the "
            "path of a cutter by its radius"
        )
    return paths


#: Number of samples of a path per turn. The number of chords is estimated from them.
PATH_SAMPLES = 8192
#: Number of samples of the path per chord, at which the chord error is measured.
CHORD_SAMPLES = 12
#: Longest chord as a fraction of the length of the path, so that straight parts have vertices too.
MAX_CHORD_RATIO = 1.0 / 90.0
#: Smallest factor by which the number of points is increased if the tolerance is not reached.
POINTS_FACTOR = 1.08
#: Largest number of polylines that are tried to reach the tolerance, each with more points.
MAX_TRIALS = 12
#: Smallest accepted tolerance of the chord error, m. Shorter distances are within the rounding of a
#: coordinate of 1 m.
MIN_TOLERANCE = 1e-11
#: Samples of a smooth part of a path: cam angles (rad), distances between neighbouring points (m),
#: and curvatures between them (1/m).
Samples = tuple[FloatArray, FloatArray, FloatArray]


def polyline(path: ContourPath, tolerance: float) -> FloatArray:
    """Return the vertices ``(2, n)`` (m) of a closed polyline along a path.

    Parameters
    ----------
    path : ContourPath
        Contour, pitch curve or path of a cutter.
    tolerance : float
        Greatest distance between the path and a chord in m, at least `MIN_TOLERANCE`.

    Raises
    ------
    ProfileError
        The tolerance is too small, or is not reached.
    """
    if not tolerance >= MIN_TOLERANCE:
        raise ProfileError(
            f"tolerance is {tolerance * 1e6:.3g} µm; allowed: at least {MIN_TOLERANCE * 1e6:g} µm"
        )
    rough = [joint.angle for joint in joints(path.law) if joint.continuity < 2]
    cuts = sorted({0.0, TURN, *rough})
    stretches = [_samples(path, low, high) for low, high in pairwise(cuts)]
    longest = MAX_CHORD_RATIO * sum(float(step.sum()) for _, step, _ in stretches)
    vertices = np.concatenate(
        [_line(path, stretch, longest, tolerance) for stretch in stretches], axis=1
    )
    step = np.hypot(*(vertices - np.roll(vertices, 1, axis=1)))
    return vertices[:, step > MIN_TOLERANCE]  # both sides of a joint can be the same point


def _samples(path: ContourPath, low: float, high: float) -> Samples:
    """Return samples of a smooth part of a path from cam angle `low` to `high` (rad).

    They are the cam angles (rad), the distances of neighbouring points (m) and the curvatures
    between them (1/m). The last angle is just below `high`, where the law may jump.
    """
    count = max(CHORD_SAMPLES, round(PATH_SAMPLES * (high - low) / TURN))
    angle = np.linspace(low, np.nextafter(high, low), count + 1)
    points, radius, _ = path.at(angle)
    step = np.hypot(*np.diff(points, axis=1))
    curvature = np.abs(1.0 / np.where(radius == 0.0, np.inf, radius))
    return angle, step, 0.5 * (curvature[1:] + curvature[:-1])


def _line(path: ContourPath, samples: Samples, longest: float, tolerance: float) -> FloatArray:
    """Return the vertices ``(2, n)`` (m) of a polyline along a smooth part of a path.

    Both ends of the part are included. `longest` is the greatest length of a chord, and `tolerance`
    is its greatest distance from the path, both in m.
    """
    angle, step, curvature = samples
    chords = step * np.maximum(np.sqrt(curvature / (8.0 * tolerance)), 1.0 / longest)
    cumulative = np.append(0.0, np.cumsum(chords))
    count = max(1, int(np.ceil(cumulative[-1])))
    for _ in range(MAX_TRIALS):
        nodes = np.interp(np.linspace(0.0, cumulative[-1], count + 1), cumulative, angle)
        nodes[[0, -1]] = angle[[0, -1]]
        vertices, error = _chord_error(path, nodes)
        if error <= tolerance:
            return vertices
        count = int(np.ceil(count * POINTS_FACTOR * max(1.0, min(4.0, np.sqrt(error / tolerance)))))
    raise ProfileError(
        f"a polyline of {count} points is {error * 1e6:.3g} µm off; allowed: {tolerance * 1e6:.3g} "
        "µm; let the tolerance be coarser"
    )


def _chord_error(path: ContourPath, nodes: FloatArray) -> tuple[FloatArray, float]:
    """Return the points of a path at cam angles, and the chord error between them (m).

    `nodes` are n cam angles, rad. The points are ``(2, n)`` in m. The chord error is the largest
    distance of the path from the chords between the points.
    """
    fraction = np.arange(CHORD_SAMPLES) / CHORD_SAMPLES
    angle = nodes[:-1, None] + fraction * np.diff(nodes)[:, None]
    all_points = path.at(np.append(angle.ravel(), nodes[-1]))[0]
    points = all_points[:, :-1].reshape(2, *angle.shape)
    ends = np.append(points[:, :, 0], all_points[:, -1:], axis=1)
    start = points[:, :, :1]
    chord = np.diff(ends, axis=1)[:, :, None]
    length = np.maximum(np.hypot(*chord), 1e-300)
    inside = points - start
    along = np.clip((inside * chord).sum(axis=0) / length**2, 0.0, 1.0)
    error = np.hypot(*(inside - along * chord)).max()
    return ends, float(error)
