"""The rig as a URDF: links and joints of `cam_rig.messages.frames`, with bodies.

Given by the files are the contour, roller, face and arm, the follower's mass, and all that the
joints say. Only looks are thicknesses, shaft, stem, bearing, motor, microphone and the wall behind
them; masses and inertias that follow from looks are assumed, and a comment says so.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from xml.etree import ElementTree
from xml.etree.ElementTree import Comment, Element, SubElement

import numpy as np

from cam_rig.live.law_server import contour_of
from cam_rig.messages.bodies import MATERIALS, Body, inertial, prism, text
from cam_rig.messages.frames import (
    ARC,
    BASE,
    CAM,
    FOLLOWER,
    GUIDE,
    MICROPHONE,
    MOTOR,
    FixedJoint,
    PlaneJoint,
    Robot,
)
from cam_rig.units import FloatArray

#: Thicknesses along the shaft as shares of the robot's size; only looks.
DISC, BODY, LINE = 0.24, 0.12, 0.04

#: What wall, motor and microphone are in proportion to, m: the bench is one for all cams.
BENCH = 0.125

#: Digits of joints, of which others compute where the links are; of all else there are six.
JOINT_DIGITS = 12


def urdf(robot: Robot) -> str:
    """The URDF of a rig, as /robot_description has it.

    Examples
    --------
    >>> from pathlib import Path
    >>> from cam_rig.simulation.scene import open_scene
    >>> text = urdf(Robot.of(open_scene(Path("config/scenes/quick.yaml"))))
    >>> text.splitlines()[1]
    '<robot name="cam_rig">'
    """
    root = Element("robot", name="cam_rig")
    for name, (rgba, _) in MATERIALS.items():
        channels = [(rgba >> shift & 0xFF) / 255.0 for shift in (24, 16, 8)]
        SubElement(SubElement(root, "material", name=name), "color", rgba=text([*channels, 1.0]))
    for link in (BASE, GUIDE, MOTOR, MICROPHONE, CAM, FOLLOWER, *robot.cams):
        _link(root, robot, link)
    if any(joint.child == ARC for joint in robot.moving):
        _link(root, robot, ARC)
    joints: list[FixedJoint | PlaneJoint] = [*robot.fixed, *robot.moving]
    for joint in joints:
        _joint(root, robot, joint)
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _link(root: Element, robot: Robot, name: str) -> None:
    """A link with its bodies, its mass and its inertia; a comment says what is assumed."""
    element = SubElement(root, "link", name=name)
    looks = _contour if name == robot.mounted.name else _LOOKS.get(name, lambda _: ())
    bodies, mass = list(looks(robot)), None
    words = "mass and inertia assumed: of solid bodies" if bodies else "1 g assumed: no body"
    if name == FOLLOWER:
        rig = robot.loaded.rig
        mass, origin = rig.follower.mass.si, rig.follower.mass.origin
        words = f"mass {origin} in rig {rig.name}; inertia assumed: spread as in solid bodies"
    element.append(Comment(f" {words} "))
    element.append(inertial(bodies, mass))
    for body in bodies:
        element.extend(body.elements())


def _joint(root: Element, robot: Robot, joint: FixedJoint | PlaneJoint) -> None:
    kind = "fixed" if isinstance(joint, FixedJoint) else joint.kind
    element = SubElement(root, "joint", name=joint.name, type=kind)
    if isinstance(joint, FixedJoint):
        xyz, rpy = joint.xyz, joint.rpy
    else:
        x, y, yaw = joint.origin
        xyz, rpy = (x, y, 0.0), (0.0, 0.0, yaw)
    SubElement(element, "origin", xyz=text(xyz, JOINT_DIGITS), rpy=text(rpy, JOINT_DIGITS))
    SubElement(element, "parent", link=joint.parent)
    SubElement(element, "child", link=joint.child)
    if isinstance(joint, FixedJoint):
        return
    SubElement(element, "axis", xyz="0 1 0" if joint.kind == "prismatic" else "0 0 1")
    if joint.limits is not None:
        # What the joint bears at the scene's highest speed; the follower's own unit, N or N m.
        rate = abs(joint.follows or 1.0)
        effort, speed = robot.most
        names = ("lower", "upper", "effort", "velocity")
        values = (*joint.limits, effort / rate, rate * speed)
        found = {name: text((value,)) for name, value in zip(names, values, strict=True)}
        SubElement(element, "limit", found)
    if joint.follows is not None:
        follows = text((joint.follows,), JOINT_DIGITS)
        SubElement(element, "mimic", joint=FOLLOWER, multiplier=follows, offset="0")


def _base(robot: Robot) -> Iterator[Body]:
    box = (LINE * BENCH, 2.4 * BENCH, 3.0 * BENCH)
    yield Body(box, "wall", (-0.5 * BENCH, 0.0, 0.4 * BENCH))


def _motor(robot: Robot) -> Iterator[Body]:
    behind = 0.75 * (robot.size - BENCH)  # its link is as far off as the cam is large
    along_shaft = (0.0, 0.5 * math.pi, 0.0)
    yield Body((0.35 * BENCH, 0.4 * BENCH), "black", (behind, 0.0, 0.0), along_shaft)


def _microphone(robot: Robot) -> Iterator[Body]:
    yield Body((0.05 * BENCH, 0.4 * BENCH), "black")


def _cam(robot: Robot) -> Iterator[Body]:
    size, base = robot.size, robot.mounted.follower.base_radius.si
    yield Body((base, 0.9 * DISC * size), "steel")
    front, back = 0.15 * size, -0.75 * BENCH  # of the shaft
    middle = (0.0, 0.0, 0.5 * (front + back))
    yield Body((0.25 * base, front - back), "steel", middle)


def _contour(robot: Robot) -> Iterator[Body]:
    cam = robot.mounted
    outline = contour_of(cam, robot.law).T
    yield from prism(outline, cam.follower.base_radius.si, 0.9 * DISC * robot.size, "steel")


def _guide(robot: Robot) -> Iterator[Body]:
    for strip in robot.shape.support():
        yield _strip(strip, DISC * robot.size, LINE * robot.size, "wall")


def _follower(robot: Robot) -> Iterator[Body]:
    for strip in robot.shape.outline():
        yield _strip(robot.body(strip), BODY * robot.size, LINE * robot.size, "brass")


_LOOKS = {
    BASE: _base,
    GUIDE: _guide,
    MOTOR: _motor,
    MICROPHONE: _microphone,
    CAM: _cam,
    FOLLOWER: _follower,
}


def _strip(strip: FloatArray, depth: float, line: float, material: str) -> Body:
    """A body of an outline: a line, a circle, or else a box as large as the outline."""
    low, high = strip.min(axis=0), strip.max(axis=0)
    (x, y), (wide, tall) = 0.5 * (low + high), high - low
    place = float(x), float(y), 0.0
    if len(strip) == 2:
        turn = float(np.arctan2(*(strip[1] - strip[0])[::-1]))
        return Body((float(np.hypot(wide, tall)), line, depth), material, place, (0.0, 0.0, turn))
    if len(strip) > 5:
        return Body((0.5 * float(wide), depth), material, place)
    return Body((float(wide), float(tall), depth), material, place)
