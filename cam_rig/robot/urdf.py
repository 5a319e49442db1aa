"""The rig as a URDF: links and joints of `cam_rig.robot.frames`, with bodies to look at.

Given by the files are the disc of the base circle, roller, face and arm, and all that the joints
say. Only looks are thicknesses, shaft, stem, bearing, motor, microphone and the wall behind them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.drawing import colours
from cam_rig.robot.frames import (
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
    Vector,
)

#: Thicknesses along the shaft as shares of the robot's size; only looks.
DISC, BODY, LINE = 0.24, 0.12, 0.04
COLOURS = {
    "steel": colours.GREY,
    "brass": colours.FOLLOWER,
    "wall": colours.LIGHT_GREY,
    "black": colours.BLACK,
}


def urdf(robot: Robot) -> str:
    """The URDF of a rig, as /robot_description has it.

    Examples
    --------
    >>> from pathlib import Path
    >>> from cam_rig.simulation.loaded_scene import open_scene
    >>> text = urdf(Robot.of(open_scene(Path("config/scenes/quick.yaml"))))
    >>> text.splitlines()[1]
    '<robot name="cam_rig">'
    """
    root = Element("robot", name="cam_rig")
    for name, rgba in COLOURS.items():
        channels = ((rgba >> shift & 0xFF) / 255.0 for shift in (24, 16, 8))
        _child(_child(root, "material", name=name), "color", rgba=_text((*channels, 1.0)))
    for link in (BASE, GUIDE, MOTOR, MICROPHONE, CAM, FOLLOWER, *robot.cams):
        _child(root, "link", name=link).extend(_LOOKS.get(link, lambda _: ())(robot))
    if any(joint.child == ARC for joint in robot.moving):
        _child(root, "link", name=ARC)
    joints: list[FixedJoint | PlaneJoint] = [*robot.fixed, *robot.moving]
    for joint in joints:
        _joint(root, robot, joint)
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _joint(root: Element, robot: Robot, joint: FixedJoint | PlaneJoint) -> None:
    kind = "fixed" if isinstance(joint, FixedJoint) else joint.kind
    element = _child(root, "joint", name=joint.name, type=kind)
    if isinstance(joint, FixedJoint):
        _child(element, "origin", xyz=_text(joint.xyz), rpy=_text(joint.rpy))
    else:
        x, y, yaw = joint.origin
        _child(element, "origin", xyz=_text((x, y, 0.0)), rpy=_text((0.0, 0.0, yaw)))
    _child(element, "parent", link=joint.parent)
    _child(element, "child", link=joint.child)
    if isinstance(joint, FixedJoint):
        return
    _child(element, "axis", xyz="0 1 0" if joint.kind == "prismatic" else "0 0 1")
    if joint.limits is not None:
        # What the joint bears at the scene's highest speed; the follower's own unit, N or N m.
        rate, arm = abs(joint.follows or 1.0), 1.0 / abs(joint.follows or 1.0)
        speed = rate * robot.law.bounds[1] * robot.top_speed
        names = ("lower", "upper", "effort", "velocity")
        values = (*joint.limits, robot.top_force * arm, speed)
        _child(element, "limit", **{n: repr(v) for n, v in zip(names, values, strict=True)})
    if joint.follows is not None:
        _child(element, "mimic", joint=FOLLOWER, multiplier=repr(joint.follows), offset="0")


def _base(robot: Robot) -> Iterator[Element]:
    size = robot.size
    box = (LINE * size, 2.4 * size, 3.0 * size)
    yield _body(_box(*box), "wall", (-0.5 * size, 0.0, 0.4 * size))


def _motor(robot: Robot) -> Iterator[Element]:
    size, along_shaft = robot.size, (0.0, 0.5 * math.pi, 0.0)
    yield _body(_cylinder(0.35 * size, 0.4 * size), "black", rpy=along_shaft)


def _microphone(robot: Robot) -> Iterator[Element]:
    yield _body(_cylinder(0.05 * robot.size, 0.4 * robot.size), "black")


def _cam(robot: Robot) -> Iterator[Element]:
    size, base = robot.size, robot.mounted.follower.base_radius.si
    yield _body(_cylinder(base, 0.9 * DISC * size), "steel")
    yield _body(_cylinder(0.25 * base, 0.9 * size), "steel", (0.0, 0.0, -0.3 * size))


def _guide(robot: Robot) -> Iterator[Element]:
    for strip in robot.shape.support():
        yield _strip(strip, DISC * robot.size, LINE * robot.size, "wall")


def _follower(robot: Robot) -> Iterator[Element]:
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


def _strip(strip: FloatArray, depth: float, line: float, material: str) -> Element:
    """A body of an outline: a line, a circle, or else a box as large as the outline."""
    low, high = strip.min(axis=0), strip.max(axis=0)
    (x, y), (wide, tall) = 0.5 * (low + high), high - low
    place = float(x), float(y), 0.0
    if len(strip) == 2:
        turn = float(np.arctan2(*(strip[1] - strip[0])[::-1]))
        return _body(_box(float(np.hypot(wide, tall)), line, depth), material, place, (0, 0, turn))
    if len(strip) > 5:
        return _body(_cylinder(0.5 * float(wide), depth), material, place)
    return _body(_box(float(wide), float(tall), depth), material, place)


def _body(
    geometry: Element, material: str, xyz: Vector = (0.0, 0.0, 0.0), rpy: Vector = (0.0, 0.0, 0.0)
) -> Element:
    visual = Element("visual")
    _child(visual, "origin", xyz=_text(xyz), rpy=_text(rpy))
    SubElement(visual, "geometry").append(geometry)
    _child(visual, "material", name=material)
    return visual


def _box(x: float, y: float, z: float) -> Element:
    return Element("box", size=_text((x, y, z)))


def _cylinder(radius: float, length: float) -> Element:
    """Along z, about the origin."""
    return Element("cylinder", radius=repr(radius), length=repr(length))


def _child(parent: Element, tag: str, **attributes: str) -> Element:
    return SubElement(parent, tag, attributes)


def _text(numbers: tuple[float, ...]) -> str:
    """Numbers to their last digit, so that other programs compute with the same."""
    return " ".join(repr(float(number)) for number in numbers)
