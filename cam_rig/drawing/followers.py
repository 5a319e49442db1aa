"""Which shape a cam file's follower has: the one place where a further kind is added."""

from __future__ import annotations

from cam_rig.drawing.follower import FollowerShape
from cam_rig.drawing.swinging import Swinging
from cam_rig.drawing.translating import Translating
from cam_rig.laws import Law
from cam_rig.profile import turn_angles
from cam_rig.schema.cam import CamConfig


def follower_shape(cam: CamConfig, law: Law) -> FollowerShape:
    """The shape of a cam's follower."""
    kind = Swinging if str(cam.follower.type).startswith("oscillating") else Translating
    return kind(cam.follower, float(law(turn_angles(360)).max()))
