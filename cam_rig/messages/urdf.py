"""The rig as a URDF: links and joints of `cam_rig.messages.frames`, with bodies.

Given by the files are the contour, roller, face and arm, the follower's mass, and all that the
joints say. Only looks are thicknesses, shaft, stem, bearing, motor, microphone and the wall behind
them; masses and inertias that follow from looks are assumed, and a comment says so.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Comment, Element, SubElement

import numpy as np

from cam_rig.live.law_server import contour_of
from cam_rig.messages.frames import (
    ARC,
    BASE,
    CAM,
    FOLLOWER,
    GUIDE,
    MICROPHONE,
    MOTOR,
    Robot,
    RobotJoint,
    Vector,
)
from cam_rig.show import looks as colours
from cam_rig.units import FloatArray

#: Sides of the prism that a cam is drawn as.
SIDES = 72


class Material(NamedTuple):
    """Colour, and density in kg/m³, which is assumed."""

    rgba: int
    density: float


MATERIALS = {
    "steel": Material(colours.GREY, 7850.0),
    "brass": Material(colours.FOLLOWER, 8500.0),
    "wall": Material(colours.LIGHT_GREY, 2700.0),
    "black": Material(colours.BLACK, 2000.0),
}


@dataclass(frozen=True)
class Body:
    """A box of x, y, z, or a cylinder of radius and length along z; m and rad in its link."""

    size: tuple[float, ...]
    material: str
    xyz: Vector = (0.0, 0.0, 0.0)
    rpy: Vector = (0.0, 0.0, 0.0)

    @property
    def mass(self) -> float:
        """Of solid material, kg."""
        volume = math.prod(self.size)
        if len(self.size) == 2:
            volume *= math.pi * self.size[0]
        return MATERIALS[self.material].density * volume

    @property
    def inertia(self) -> FloatArray:
        """``(3, 3)`` about its own centre, along the link's axes, kg m²."""
        if len(self.size) == 3:
            x, y, z = np.square(self.size) / 12.0
            own = np.array([y + z, x + z, x + y])
        else:
            radius, length = self.size
            across = radius**2 / 4.0 + length**2 / 12.0
            own = np.array([across, across, radius**2 / 2.0])
        (cr, cp, cy), (sr, sp, sy) = np.cos(self.rpy), np.sin(self.rpy)
        about_x = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
        about_y = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
        about_z = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
        turn = about_z @ about_y @ about_x  # scipy's import would hold a bag's first tick
        return np.asarray(self.mass * turn @ np.diag(own) @ turn.T)

    def elements(self) -> tuple[Element, Element]:
        """What is seen, and the same to collide with."""
        visual, collision = Element("visual"), Element("collision")
        for element in (visual, collision):
            SubElement(element, "origin", xyz=lengths(self.xyz), rpy=text(self.rpy))
            geometry = SubElement(element, "geometry")
            if len(self.size) == 3:
                SubElement(geometry, "box", size=lengths(self.size))
            else:
                radius, length = (text((number,)) for number in self.size)
                SubElement(geometry, "cylinder", radius=radius, length=length)
        SubElement(visual, "material", name=self.material)
        return visual, collision


def inertial(bodies: Sequence[Body], mass: float | None = None) -> Element:
    """Mass (a gram at least), centre and inertia of solid bodies; ``mass`` (kg) is spread."""
    alone = bodies or (Body((0.05, 0.05, 0.05), "steel"),)
    masses, places = np.array([b.mass for b in alone]), np.array([b.xyz for b in alone])
    whole = 1e-3 if not bodies else float(masses.sum()) if mass is None else mass
    masses, share = masses * (whole / masses.sum()), whole / masses.sum()
    centre = masses @ places / whole
    away = places - centre
    squares = masses * np.sum(away**2, axis=1)
    about = share * sum(b.inertia for b in alone) + squares.sum() * np.eye(3)
    about -= (masses * away.T) @ away
    about[np.abs(about) < 1e-9 * np.trace(about)] = 0.0  # rounding
    element = Element("inertial")
    SubElement(element, "origin", xyz=lengths(centre), rpy="0 0 0")
    SubElement(element, "mass", value=text((whole,)))
    pairs = (("xx", 0, 0), ("xy", 0, 1), ("xz", 0, 2), ("yy", 1, 1), ("yz", 1, 2), ("zz", 2, 2))
    SubElement(element, "inertia", {f"i{name}": text((about[i, j],)) for name, i, j in pairs})
    return element


def prism(outline: FloatArray, radius: float, thickness: float, material: str) -> list[Body]:
    """A cam's contour ``(n, 2)``, clockwise, as boxes each with a face on a chord of it.

    They reach inwards to the base circle's ``radius`` (m), which a cylinder fills. URDF has no
    polygon, and a mesh would be a file that a message cannot bring along.
    """
    start = outline[np.arange(SIDES) * len(outline) // SIDES]
    along = np.roll(start, -1, axis=0) - start
    chord = np.hypot(*along.T)
    unit = along / chord[:, None]
    outward = np.column_stack([-unit[:, 1], unit[:, 0]])
    middle = start + 0.5 * along
    height, aside = np.sum(middle * outward, axis=1), np.sum(middle * unit, axis=1)
    inside = np.sqrt(np.maximum(radius**2 - aside**2, 0.0))
    depth = np.clip(height - inside, 0.1 * radius, height)
    place = middle - 0.5 * depth[:, None] * outward
    yaw = np.arctan2(unit[:, 1], unit[:, 0])
    rows = np.column_stack([chord, depth, place, yaw]).tolist()
    return [
        Body((length, deep, thickness), material, (x, y, 0.0), (0.0, 0.0, turn))
        for length, deep, x, y, turn in rows
    ]


def lengths(numbers: Sequence[float] | FloatArray) -> str:
    """Numbers in m, to the nanometre."""
    return text([round(float(number), 9) for number in numbers])


def text(numbers: Sequence[float], digits: int = 6) -> str:
    """Numbers to so many digits; zero has no sign."""
    return " ".join(f"{float(number) + 0.0:.{digits}g}" for number in numbers)


#: Thicknesses along the shaft as shares of the robot's size; only looks.
DISC, BODY, LINE = 0.24, 0.12, 0.04
#: What wall, motor and microphone are in proportion to, m: the bench is one for all cams.
BENCH = 0.125
#: Digits of joints, of which others compute where the links are; of all else there are six.
JOINT_DIGITS = 12


def urdf(robot: Robot) -> str:
    """The URDF of a rig, as /robot_description has it."""
    root = Element("robot", name="cam_rig")
    for name, (rgba, _) in MATERIALS.items():
        channels = [(rgba >> shift & 0xFF) / 255.0 for shift in (24, 16, 8)]
        SubElement(SubElement(root, "material", name=name), "color", rgba=text([*channels, 1.0]))
    joints, bodies = [*robot.fixed, *robot.moving], _bodies(robot)
    arc = [joint.child for joint in joints if joint.child == ARC]
    for link in (BASE, GUIDE, MOTOR, MICROPHONE, CAM, FOLLOWER, *robot.cams, *arc):
        _link(root, robot, link, bodies.get(link, []))
    for joint in joints:
        _joint(root, robot, joint)
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _link(root: Element, robot: Robot, name: str, bodies: list[Body]) -> None:
    """A link with its bodies, its mass and its inertia; a comment says what is assumed."""
    element, mass = SubElement(root, "link", name=name), None
    words = "mass and inertia assumed: of solid bodies" if bodies else "1 g assumed: no body"
    if name == FOLLOWER:
        rig = robot.loaded.rig
        mass, origin = rig.follower.mass.si, rig.follower.mass.origin
        words = f"mass {origin} in rig {rig.name}; inertia assumed: spread as in solid bodies"
    element.append(Comment(f" {words} "))
    element.append(inertial(bodies, mass))
    for body in bodies:
        element.extend(body.elements())


def _joint(root: Element, robot: Robot, joint: RobotJoint) -> None:
    element = SubElement(root, "joint", name=joint.name, type=joint.kind)
    xyz, rpy = text(joint.xyz, JOINT_DIGITS), text(joint.rpy, JOINT_DIGITS)
    SubElement(element, "origin", xyz=xyz, rpy=rpy)
    SubElement(element, "parent", link=joint.parent)
    SubElement(element, "child", link=joint.child)
    if joint.kind == "fixed":
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


def _bodies(robot: Robot) -> dict[str, list[Body]]:
    """The bodies of each link that has some."""
    size, cam, shape = robot.size, robot.mounted, robot.shape
    disc, line, radius = DISC * size, LINE * size, cam.follower.base_radius.si
    wall = (LINE * BENCH, 2.4 * BENCH, 3.0 * BENCH)
    behind = 0.75 * (size - BENCH)  # the motor's link is as far off as the cam is large
    along_shaft = (0.0, 0.5 * math.pi, 0.0)
    front, back = 0.15 * size, -0.75 * BENCH  # of the shaft
    middle = (0.0, 0.0, 0.5 * (front + back))
    contour = contour_of(cam, robot.law).T
    return {
        BASE: [Body(wall, "wall", (-0.5 * BENCH, 0.0, 0.4 * BENCH))],
        GUIDE: [_strip(strip, disc, line, "wall") for strip in shape.support()],
        MOTOR: [Body((0.35 * BENCH, 0.4 * BENCH), "black", (behind, 0.0, 0.0), along_shaft)],
        MICROPHONE: [Body((0.05 * BENCH, 0.4 * BENCH), "black")],
        CAM: [
            Body((radius, 0.9 * disc), "steel"),
            Body((0.25 * radius, front - back), "steel", middle),
        ],
        FOLLOWER: [
            _strip(robot.body(strip), BODY * size, line, "brass") for strip in shape.outline()
        ],
        cam.name: prism(contour, radius, 0.9 * disc, "steel"),
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
