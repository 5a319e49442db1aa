"""Links, joints and where they are: what the URDF says, and what /tf is made of.

By REP 103 lengths are in m, angles in rad, x of ``base_link`` points forward, y left, z up. One who
stands before the rig looks along -x: the shaft points at him, the cam turns counterclockwise, and a
translating follower moves up along z. The origin is on the shaft, in the middle of the cam.

The ``guide`` is the frame of `cam_rig.profile.contact`: x to the right, y up, z out of the plane
of the cam. The cam turns in it, and the follower moves in it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from cam_rig.laws import Law
from cam_rig.laws.law import extremes, peak
from cam_rig.profile.faces import Swung
from cam_rig.profile.outlines import FollowerShape, follower_shape
from cam_rig.schema import CamConfig
from cam_rig.schema.cam import FRAMES
from cam_rig.simulation.scene import LoadedScene, max_contact_force
from cam_rig.units import FloatArray

#: Links besides one for each cam, which has the cam's name and turns with the link ``cam``. An
#: oscillating follower's joint moves ``follower_arc``, the way along the arc, which has no body.
BASE, GUIDE, MOTOR, MICROPHONE, CAM, FOLLOWER, ARC = FRAMES
#: The joint by which an oscillating follower turns; it follows the joint ``follower``.
ARM = "follower_arm"
#: Roll, pitch and yaw of the guide in base_link, rad: its x is y there, its y is z.
UPRIGHT = (0.5 * math.pi, 0.0, 0.5 * math.pi)
#: Room for lift-off over the scene's greatest lift, as a share of it.
LIFT_OFF = 1.0
Vector = tuple[float, float, float]


@dataclass(frozen=True)
class RobotJoint:
    """A link on its parent: where it stays (m, and roll, pitch, yaw in rad), or moves in a plane.

    There it turns about z by the joint's position (rad), or slides along its own y by it (m), from
    where it is at position 0. ``limits`` are None where it turns for ever; ``follows`` is its
    position over that of the joint ``follower``, None for one of its own.
    """

    name: str
    kind: Literal["fixed", "continuous", "prismatic", "revolute"]
    parent: str
    child: str
    xyz: Vector = (0.0, 0.0, 0.0)
    rpy: Vector = (0.0, 0.0, 0.0)
    limits: tuple[float, float] | None = None
    follows: float | None = None

    def pose(self, position: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """x, y (m) and yaw (rad) of a moving child at positions, each ``(n,)``."""
        (x, y, _), yaw = self.xyz, self.rpy[2]
        if self.kind != "prismatic":
            still = np.zeros_like(position)
            return x + still, y + still, yaw + position
        slid_x, slid_y = -math.sin(yaw) * position, math.cos(yaw) * position
        return x + slid_x, y + slid_y, np.full_like(position, yaw)


def _mount(parent: str, child: str, xyz: Vector = (0, 0, 0), rpy: Vector = (0, 0, 0)) -> RobotJoint:
    return RobotJoint(f"{child}_mount", "fixed", parent, child, xyz, rpy)


@dataclass(frozen=True, eq=False)
class Robot:
    """The rig of a scene, each of whose cams has a link, with one mounted and its follower."""

    loaded: LoadedScene
    mounted: CamConfig
    shape: FollowerShape

    @classmethod
    def of(cls, loaded: LoadedScene, cam: str | None = None) -> Robot:
        """The rig of a scene with a cam mounted, by default the scene's first."""
        name = loaded.scene.cams[0] if cam is None else cam
        law = loaded.law_of(name)
        return cls(loaded, loaded.cams[name], follower_shape(loaded.cams[name], law))

    @property
    def size(self) -> float:
        """How far the follower is from the shaft at most, m; the measure of what is only looks."""
        return self.shape.reach

    @property
    def cams(self) -> list[str]:
        """The cams that have a link: the scene's, and one that an operator mounted."""
        return list(dict.fromkeys([*self.loaded.scene.cams, self.mounted.name]))

    @property
    def top_speed(self) -> float:
        """The scene's highest speed, rad/s."""
        return max(self.loaded.scene.program.speeds.si_list)

    @property
    def most(self) -> tuple[float, float]:
        """Greatest contact force (N) and lift's speed (m/s) of the scene's cams at that speed."""
        forces = [max_contact_force(self.loaded, cam, self.top_speed) for cam in self.cams]
        slopes = [abs(peak(self.loaded.laws[cam], 1).value) for cam in self.cams]
        return max(forces), max(slopes) * self.top_speed

    @property
    def law(self) -> Law:
        """The mounted cam's."""
        return self.loaded.laws[self.mounted.name]

    @property
    def fixed(self) -> list[RobotJoint]:
        """The joints of /tf_static."""
        return [
            _mount(BASE, GUIDE, rpy=UPRIGHT),
            _mount(BASE, MOTOR, (-0.75 * self.size, 0.0, 0.0)),
            _mount(BASE, MICROPHONE, (2.0 * self.size, 0.0, 2.0 * self.size)),
            *(_mount(CAM, name) for name in self.cams),
        ]

    @property
    def moving(self) -> list[RobotJoint]:
        """The joints of /tf, in the order of their names."""
        # of all the scene's cams, as its follower is one joint for them
        lift = max(extremes(self.loaded.laws[cam], 0)[1].value for cam in self.cams)
        limits = 0.0, (1.0 + LIFT_OFF) * lift
        cam = RobotJoint(CAM, "continuous", GUIDE, CAM)
        slide = RobotJoint(FOLLOWER, "prismatic", GUIDE, FOLLOWER, limits=limits)
        if not isinstance(self.shape.element, Swung):
            return [cam, slide]
        rest, rate = np.zeros(1), -1.0 / self.shape.element.arm
        x, y = self.shape.origin(rest)[0].tolist()
        turn, turned = (0.0, 0.0, float(self.shape.turn(rest)[0])), (rate * limits[1], 0.0)
        arm = RobotJoint(ARM, "revolute", GUIDE, FOLLOWER, (x, y, 0.0), turn, turned, rate)
        return [cam, replace(slide, child=ARC), arm]

    def body(self, points: FloatArray) -> FloatArray:
        """Points ``(n, 2)`` of the follower's outline, in the link ``follower``."""
        if isinstance(self.shape.element, Swung):
            return points
        return points + self.shape.origin(np.zeros(1))
