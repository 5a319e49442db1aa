"""Fixtures: a cam for each kind of follower, whose rise and fall differ."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from cam_rig.laws import Law, build_law
from cam_rig.profile import Contour, Disc, contours_at, discs
from cam_rig.schema import CamConfig
from cam_rig.units import FloatArray

from ..conftest import assumed

#: Dimensions of a follower on an arm, in mm.
ARM = {"base_radius": 40, "pivot_distance": 90, "arm": 75}
#: Numbers of each kind of follower, by kind: lengths in mm, angles in degrees.
FOLLOWERS: dict[str, dict[str, float]] = {
    "point": {"base_radius": 40, "eccentricity": 5},
    "roller": {"base_radius": 40, "roller_radius": 8, "eccentricity": -6},
    "flat": {"base_radius": 40, "eccentricity": 3},
    "inclined_flat": {"base_radius": 45, "eccentricity": 3, "inclination": 12},
    "oscillating_point": ARM,
    "oscillating_roller": ARM | {"roller_radius": 8},
    "oscillating_flat": {"base_radius": 50, "pivot_distance": 110, "arm": 90, "face_offset": 6},
    "constant_breadth": {"base_radius": 50},
    "constant_diameter": {"base_radius": 50, "roller_radius": 8},
    "conjugate": {"base_radius": 50, "roller_radius": 8, "eccentricity": 4},
    "oscillating_conjugate": ARM | {"roller_radius": 8},
}
#: Keys of a follower whose numbers are angles, not lengths.
ANGLES = {"arms_angle", "inclination", "most_pressure_angle"}
#: Segments of a motion law: name of the law, span (degrees), and lift at the end as a fraction
#: (None for a dwell).
Segments = list[tuple[str, float, float | None]]
#: Segments of a cam whose rise and fall differ, as for `make`.
UNEVEN: Segments = [("dwell", 60, None), ("cycloidal", 110, 1), ("dwell", 40, None)]
UNEVEN += [("poly345", 120, 0), ("dwell", 30, None)]
#: Segments of a cam with s(θ) + s(θ + π) = s_max and dwells of different length.
OPPOSITE: Segments = [("dwell", 10, None), ("poly345", 150, 1), ("dwell", 30, None)]
OPPOSITE += [("poly345", 150, 0), ("dwell", 20, None)]
#: Kinds of followers that need segments with s(θ) + s(θ + π) = s_max.
BREADTH = ("constant_breadth", "constant_diameter")


@dataclass(frozen=True, eq=False)
class SampleCam:
    """Cam configuration and its motion law."""

    cam: CamConfig
    law: Law

    def contours(self, angle: FloatArray) -> tuple[Contour, ...]:
        """Return the contours at cam angles (rad), one for each disc of the cam."""
        return contours_at(self.cam.follower, self.law, angle)

    @property
    def discs(self) -> tuple[Disc, ...]:
        """Discs of the cam. Each has the part of the follower that touches it."""
        return discs(self.cam.follower, self.law)


def make(kind: str, segments: Segments = UNEVEN, lift: float = 10.0, **numbers: float) -> SampleCam:
    """Return a cam with a kind of follower.

    Each of `segments` is a law, its span in degrees, and the lift at its end as a fraction of
    `lift` (mm), or None for a dwell. `numbers` in mm and degrees replace those of `FOLLOWERS`.
    """
    sizes = (FOLLOWERS[kind] | numbers).items()
    sized = {key: assumed(value, "deg" if key in ANGLES else "mm") for key, value in sizes}
    rows = [
        {"law": law, "span": assumed(span, "deg")} | ({} if to is None else {"to": to})
        for law, span, to in segments
    ]
    data = {"name": kind, "title": "made for a test", "lift": assumed(lift, "mm")}
    cam = CamConfig.model_validate(data | {"follower": {"type": kind} | sized, "segments": rows})
    return SampleCam(cam, build_law(cam))


@pytest.fixture(scope="session")
def every_kind() -> list[SampleCam]:
    """A cam of each kind of follower."""
    return [make(kind, OPPOSITE if kind in BREADTH else UNEVEN) for kind in FOLLOWERS]


@pytest.fixture(params=list(FOLLOWERS))
def sample(request: pytest.FixtureRequest, every_kind: list[SampleCam]) -> SampleCam:
    """Each of the cams of `every_kind`; the test runs once per kind."""
    return every_kind[list(FOLLOWERS).index(request.param)]


@pytest.fixture
def angles() -> FloatArray:
    """360 cam angles in rad that are not at a joint of a law.

    At a joint two pieces of the law meet, and derivatives may jump.
    """
    return np.radians(np.arange(360.0) + 0.137)
