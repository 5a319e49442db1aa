"""Links and joints of the rig, from which the URDF and /tf are made.

Lengths are in m and angles in rad. The axes of ``base_link`` follow REP 103: x points forward, y
left, z up. An observer in front of the rig looks along -x. For this observer the shaft points
forward, the cam turns counterclockwise, and a translating follower moves up along z. The origin is
on the shaft, in the middle of the cam.

The ``guide`` is the frame of `cam_rig.profile.contact`: x to the right, y up, z out of the plane
of the cam. The cam turns in this frame, and the follower moves in it.
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

#: Names of the links. In addition each cam has a link with the name of the cam, which turns with
#: the link ``cam``. An oscillating follower has the additional link ``follower_arc`` without a
#: body. Its prismatic joint gives the travel along the arc.
BASE, GUIDE, MOTOR, MICROPHONE, CAM, FOLLOWER, ARC = FRAMES
#: Name of the joint that turns an oscillating follower. Its position follows that of the joint
#: ``follower``.
ARM = "follower_arm"
#: Roll, pitch and yaw (rad) of the frame ``guide`` in base_link. The axis x of the guide is y of
#: base_link, and its y is z of base_link.
GUIDE_RPY = (0.5 * math.pi, 0.0, 0.5 * math.pi)
#: Travel of the follower's joint that is added for lift-off above the largest lift of the scene, as
#: a multiple of this lift.
LIFT_OFF_TRAVEL = 1.0
Vector = tuple[float, float, float]


@dataclass(frozen=True)
class RobotJoint:
    """Joint between a link and its parent.

    A moving child turns about z by the position of the joint (rad), or slides along its y axis by
    this position (m).

    Parameters
    ----------
    name, kind, parent, child
        Name and type of the joint, and names of its links.
    xyz
        Origin of the child in the parent at position 0, in m.
    rpy
        Roll, pitch and yaw of the child in the parent at position 0, in rad.
    limits
        Lowest and highest position, None for an endless rotation.
    follows
        Ratio of the position to that of the joint ``follower``, None for an independent joint.
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
        """Return x, y (m) and yaw (rad) of the joint's child at positions, (n,) each.

        A position is in rad or m, depending on the kind of the joint.
        """
        (x, y, _), yaw = self.xyz, self.rpy[2]
        if self.kind != "prismatic":
            zero = np.zeros_like(position)
            return x + zero, y + zero, yaw + position
        slide_x, slide_y = -math.sin(yaw) * position, math.cos(yaw) * position
        return x + slide_x, y + slide_y, np.full_like(position, yaw)


def _mount(parent: str, child: str, xyz: Vector = (0, 0, 0), rpy: Vector = (0, 0, 0)) -> RobotJoint:
    return RobotJoint(f"{child}_mount", "fixed", parent, child, xyz, rpy)


@dataclass(frozen=True, eq=False)
class Robot:
    """Rig of a scene as a robot: a link per cam, the mounted cam, and the follower.

    `frame_prefix`, such as "rig1/", is put before the frames of messages. The links of the URDF
    have no prefix, as robot_state_publisher expects.
    """

    loaded: LoadedScene
    mounted: CamConfig
    shape: FollowerShape
    frame_prefix: str = ""

    @classmethod
    def of(cls, loaded: LoadedScene, cam: str | None = None, frame_prefix: str = "") -> Robot:
        """Return the rig of a scene as a robot, with a mounted cam (default: the first)."""
        name = loaded.scene.cams[0] if cam is None else cam
        law = loaded.law_of(name)
        shape = follower_shape(loaded.cams[name], law)
        return cls(loaded, loaded.cams[name], shape, frame_prefix)

    @property
    def size(self) -> float:
        """Largest distance of the follower from the shaft (m).

        Display sizes are in proportion to it.
        """
        return self.shape.reach

    @property
    def cams(self) -> list[str]:
        """Names of the cams that have a link: those of the scene, and the mounted cam."""
        return list(dict.fromkeys([*self.loaded.scene.cams, self.mounted.name]))

    @property
    def top_speed(self) -> float:
        """Highest cam speed of the scene in rad/s."""
        return max(self.loaded.scene.schedule.speeds.si_list)

    @property
    def max_force_and_velocity(self) -> tuple[float, float]:
        """Largest contact force (N) and velocity (m/s) of all cams at the highest speed."""
        forces = [max_contact_force(self.loaded, cam, self.top_speed) for cam in self.cams]
        slopes = [abs(peak(self.loaded.laws[cam], 1).value) for cam in self.cams]
        return max(forces), max(slopes) * self.top_speed

    @property
    def max_torque(self) -> float:
        """Upper bound of the shaft torque (N m) of all cams at `top_speed`.

        It is the product of the largest contact force and the largest ds/dθ.
        """
        force, velocity = self.max_force_and_velocity
        return force * velocity / self.top_speed

    @property
    def law(self) -> Law:
        """Law of the mounted cam."""
        return self.loaded.laws[self.mounted.name]

    @property
    def fixed(self) -> list[RobotJoint]:
        """Joints of the rig that do not move, published on /tf_static."""
        return [
            _mount(BASE, GUIDE, rpy=GUIDE_RPY),
            _mount(BASE, MOTOR, (-0.75 * self.size, 0.0, 0.0)),
            _mount(BASE, MICROPHONE, (2.0 * self.size, 0.0, 2.0 * self.size)),
            *(_mount(CAM, name) for name in self.cams),
        ]

    @property
    def moving(self) -> list[RobotJoint]:
        """Joints of the rig that move, published on /tf, in the order of their names."""
        # the largest lift of all cams, because they share the follower's joint
        lift = max(extremes(self.loaded.laws[cam], 0)[1].value for cam in self.cams)
        limits = 0.0, (1.0 + LIFT_OFF_TRAVEL) * lift
        cam = RobotJoint(CAM, "continuous", GUIDE, CAM)
        slide = RobotJoint(FOLLOWER, "prismatic", GUIDE, FOLLOWER, limits=limits)
        if not isinstance(self.shape.element, Swung):
            return [cam, slide]
        lift_0, ratio = np.zeros(1), -1.0 / self.shape.element.arm
        x, y = self.shape.origin(lift_0)[0].tolist()
        rpy, arm_limits = (0.0, 0.0, float(self.shape.turn(lift_0)[0])), (ratio * limits[1], 0.0)
        arm = RobotJoint(ARM, "revolute", GUIDE, FOLLOWER, (x, y, 0.0), rpy, arm_limits, ratio)
        return [cam, replace(slide, child=ARC), arm]

    def body(self, points: FloatArray) -> FloatArray:
        """Convert points of the follower's outline to the frame of the link ``follower``.

        `points` have the origin of the outline as their origin (see `FollowerShape.origin`). This
        is also the origin of the link for an oscillating follower. Otherwise the two differ by the
        position of the outline at zero lift. `points` and the result have the shape (n, 2), in m.
        """
        if isinstance(self.shape.element, Swung):
            return points
        return points + self.shape.origin(np.zeros(1))
