"""Pressure angle: from the follower's direction of motion to the common normal."""

from __future__ import annotations

import numpy as np

from cam_rig.profile.checks.check import Check
from cam_rig.profile.contact import Element
from cam_rig.profile.extremes import Scan
from cam_rig.profile.flat_face import SwungFace
from cam_rig.profile.roller import SwungCentre
from cam_rig.schema.follower import Follower

#: The most when the cam file names none, rad: what handbooks advise for a guide and for a pivot.
GUIDED, SWUNG = float(np.radians(30.0)), float(np.radians(45.0))


def greatest_allowed(follower: Follower, element: Element) -> float:
    """The most pressure angle, rad: what the cam file asks for, else what handbooks advise."""
    usual = SWUNG if isinstance(element, SwungCentre | SwungFace) else GUIDED
    asked = follower.most_pressure_angle
    return usual if asked is None else asked.si


def pressure_check(scan: Scan, follower: Follower) -> Check:
    """The greatest pressure angle of either sign against what guide or pivot bear."""
    steepest = scan.greatest(lambda touch: np.abs(touch.pressure))
    return Check(
        "pressure angle",
        steepest.value,
        "at most",
        greatest_allowed(follower, scan.element),
        "°",
        steepest.angle,
        "let base_radius be larger, the spans longer, or set most_pressure_angle",
        vital=False,
    )
