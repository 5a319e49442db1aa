"""/tf and /tf_static as robot_state_publisher makes them of /joint_states and the URDF."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cam_rig.arrays import FloatArray
from cam_rig.messages.cdr_template import CdrTemplate, example_header
from cam_rig.robot.frames import CAM, Robot, Vector
from cam_rig.robot.parts import header, new, serialize
from cam_rig.units import TURN

Quaternion = tuple[float, float, float, float]
#: Numbers of a joint that moves: x, y, and the quaternion's z and w.
_NUMBERS = 4


class Transforms:
    """The serialized transforms of a robot.

    Examples
    --------
    >>> from pathlib import Path
    >>> from cam_rig.simulation.loaded_scene import open_scene
    >>> robot = Robot.of(open_scene(Path("config/scenes/quick.yaml")))
    >>> stamps, angle, lift = np.array([0, 10]), np.array([1.0, 1.2]), np.array([0.002, 0.003])
    >>> len(Transforms(robot).moving(stamps, angle, lift))
    2
    """

    def __init__(self, robot: Robot) -> None:
        self._joints, self._fixed = robot.moving, robot.fixed
        count = _NUMBERS * len(self._joints)
        self._template = CdrTemplate("tf2_msgs/msg/TFMessage", self._example, count)

    def moving(self, stamps: NDArray[np.int64], angle: FloatArray, lift: FloatArray) -> list[bytes]:
        """A message of /tf at each of ``(n,)`` stamps (ns); cam angle in rad, lift in m."""
        columns = list[FloatArray]()
        for joint in self._joints:
            position = angle if joint.name == CAM else lift * (joint.follows or 1.0)
            x, y, yaw = joint.pose(position)
            half = 0.5 * (np.remainder(yaw + math.pi, TURN) - math.pi)
            columns += [x, y, np.sin(half), np.cos(half)]
        return self._template.fill(stamps, *columns)

    def fixed(self, stamp_ns: int) -> bytes:
        """The message of /tf_static, of rig time in ns."""
        transforms = [
            _transform(
                header(stamp_ns, joint.parent), joint.child, joint.xyz, quaternion(joint.rpy)
            )
            for joint in self._fixed
        ]
        return serialize(new("tf2_msgs/TFMessage", transforms))

    def _example(self, *numbers: float) -> Any:
        transforms = []
        for i, joint in enumerate(self._joints):
            x, y, z, w = numbers[_NUMBERS * i : _NUMBERS * (i + 1)]
            place, turn = (x, y, 0.0), (0.0, 0.0, z, w)
            transforms.append(_transform(example_header(joint.parent), joint.child, place, turn))
        return new("tf2_msgs/TFMessage", transforms)


def quaternion(rpy: Vector) -> Quaternion:
    """x, y, z, w of roll, pitch and yaw (rad) about the parent's axes, in this order.

    Examples
    --------
    >>> quaternion((0.0, 0.0, 0.0))
    (0.0, 0.0, 0.0, 1.0)
    """
    (sr, cr), (sp, cp), (sy, cy) = ((math.sin(0.5 * a), math.cos(0.5 * a)) for a in rpy)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def _transform(of_parent: Any, child: str, place: Vector, turn: Quaternion) -> Any:
    translation, rotation = (
        new("geometry_msgs/Vector3", *place),
        new("geometry_msgs/Quaternion", *turn),
    )
    transform = new("geometry_msgs/Transform", translation, rotation)
    return new("geometry_msgs/TransformStamped", of_parent, child, transform)
