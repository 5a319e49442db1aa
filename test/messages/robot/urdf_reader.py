"""Where a URDF puts its links: read and composed without the rig's own code."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from cam_rig.units import FloatArray


def homogeneous(rotation: Rotation, place: FloatArray) -> FloatArray:
    """``(4, 4)`` of a rotation and a translation (m)."""
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = rotation.as_matrix(), place
    return found


def numbers(text: str) -> FloatArray:
    return np.array([float(word) for word in text.split()])


def poses(urdf: str, positions: dict[str, float]) -> dict[tuple[str, str], FloatArray]:
    """``(4, 4)`` of each joint's child in its parent, by (parent, child), at joint positions."""
    found = {}
    for joint in ElementTree.fromstring(urdf).iter("joint"):
        position, mimic = positions.get(joint.get("name")), joint.find("mimic")
        if mimic is not None:
            of = positions[mimic.get("joint")]
            position = float(mimic.get("multiplier")) * of + float(mimic.get("offset"))
        origin = joint.find("origin")
        # xyz in lower case are rotations about the parent's axes.
        turn = Rotation.from_euler("xyz", numbers(origin.get("rpy")))
        pose = homogeneous(turn, numbers(origin.get("xyz")))
        if joint.get("type") != "fixed":
            axis = numbers(joint.find("axis").get("xyz"))
            slides = joint.get("type") == "prismatic"
            moved = (
                homogeneous(Rotation.identity(), axis * position)
                if slides
                else homogeneous(Rotation.from_rotvec(axis * position), np.zeros(3))
            )
            pose = pose @ moved
        found[joint.find("parent").get("link"), joint.find("child").get("link")] = pose
    return found
