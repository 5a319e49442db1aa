"""URDF of the rig: the links and joints of `cam_rig.messages.frames`, with bodies.

The contour, roller, face and arm, the mass of the follower and the joints are taken from the files.
Thicknesses, shaft, stem, bearing, motor, microphone and wall are for display only. The masses and
inertias that follow from them are assumed, which a comment in the URDF states.
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
from cam_rig.live.state_validation import speed_limits
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
from cam_rig.messages.topics import JOINT_COMMANDS, JOINT_STATES
from cam_rig.show import looks as colours
from cam_rig.units import FloatArray

#: Number of sides of the prism that approximates a cam in the URDF.
PRISM_SIDES = 72


class Material(NamedTuple):
    """Material of a body: colour (0xRRGGBBAA) and assumed density in kg/m³."""

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
    """Body of a link: a box (lengths along x, y and z) or a cylinder (radius, length).

    A cylinder is along z. Sizes and the position `xyz` in the link are in m, `rpy` is roll, pitch
    and yaw in rad.
    """

    size: tuple[float, ...]
    material: str
    xyz: Vector = (0.0, 0.0, 0.0)
    rpy: Vector = (0.0, 0.0, 0.0)

    @property
    def mass(self) -> float:
        """Mass of the solid body in kg."""
        volume = math.prod(self.size)
        if len(self.size) == 2:
            volume *= math.pi * self.size[0]
        return MATERIALS[self.material].density * volume

    @property
    def inertia(self) -> FloatArray:
        """Inertia of the body about its centre, along the link's axes, (3, 3), kg m²."""
        if len(self.size) == 3:
            x, y, z = np.square(self.size) / 12.0
            principal = np.array([y + z, x + z, x + y])
        else:
            radius, length = self.size
            transverse = radius**2 / 4.0 + length**2 / 12.0
            principal = np.array([transverse, transverse, radius**2 / 2.0])
        (cr, cp, cy), (sr, sp, sy) = np.cos(self.rpy), np.sin(self.rpy)
        about_x = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
        about_y = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
        about_z = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
        # without scipy, whose import would delay the first tick of a bag
        rotation = about_z @ about_y @ about_x
        return np.asarray(self.mass * rotation @ np.diag(principal) @ rotation.T)

    def elements(self) -> tuple[Element, Element]:
        """Return the URDF elements of the body for display and for collision.

        Both have the same geometry.
        """
        visual, collision = Element("visual"), Element("collision")
        for element in (visual, collision):
            SubElement(
                element, "origin", xyz=format_lengths(self.xyz), rpy=format_numbers(self.rpy)
            )
            geometry = SubElement(element, "geometry")
            if len(self.size) == 3:
                SubElement(geometry, "box", size=format_lengths(self.size))
            else:
                radius, length = (format_numbers((number,)) for number in self.size)
                SubElement(geometry, "cylinder", radius=radius, length=length)
        SubElement(visual, "material", name=self.material)
        return visual, collision


def inertial(bodies: Sequence[Body], mass: float | None = None) -> Element:
    """Return the URDF element with mass, centre and inertia of solid bodies.

    A `mass` (kg) replaces the total mass of the bodies, and is distributed in proportion to their
    masses. Without bodies the mass is 1 g, because every link needs a mass.
    """
    solids = bodies or (Body((0.05, 0.05, 0.05), "steel"),)
    masses, positions = np.array([b.mass for b in solids]), np.array([b.xyz for b in solids])
    total = 1e-3 if not bodies else float(masses.sum()) if mass is None else mass
    masses, scale = masses * (total / masses.sum()), total / masses.sum()
    centre = masses @ positions / total
    offset = positions - centre
    squares = masses * np.sum(offset**2, axis=1)
    inertia = scale * sum(b.inertia for b in solids) + squares.sum() * np.eye(3)
    inertia -= (masses * offset.T) @ offset
    inertia[np.abs(inertia) < 1e-9 * np.trace(inertia)] = 0.0  # rounding
    element = Element("inertial")
    SubElement(element, "origin", xyz=format_lengths(centre), rpy="0 0 0")
    SubElement(element, "mass", value=format_numbers((total,)))
    pairs = (("xx", 0, 0), ("xy", 0, 1), ("xz", 0, 2), ("yy", 1, 1), ("yz", 1, 2), ("zz", 2, 2))
    values = {f"i{name}": format_numbers((inertia[i, j],)) for name, i, j in pairs}
    SubElement(element, "inertia", values)
    return element


def prism(outline: FloatArray, radius: float, thickness: float, material: str) -> list[Body]:
    """Return boxes that approximate a cam with a clockwise contour, shape (n, 2), m.

    One face of each box is on a chord of the contour. The boxes reach inwards to the base circle of
    `radius` (m), which a cylinder fills. URDF does not support polygons, and a mesh would be a file
    that cannot be sent with a message. `outline` is the contour, `thickness` the size along the
    shaft (m), and `material` the name of the material.
    """
    start = outline[np.arange(PRISM_SIDES) * len(outline) // PRISM_SIDES]
    along = np.roll(start, -1, axis=0) - start
    chord = np.hypot(*along.T)
    unit = along / chord[:, None]
    outward = np.column_stack([-unit[:, 1], unit[:, 0]])
    middle = start + 0.5 * along
    height, offset = np.sum(middle * outward, axis=1), np.sum(middle * unit, axis=1)
    base = np.sqrt(np.maximum(radius**2 - offset**2, 0.0))  # height of the base circle
    depth = np.clip(height - base, 0.1 * radius, height)
    centre = middle - 0.5 * depth[:, None] * outward
    yaw = np.arctan2(unit[:, 1], unit[:, 0])
    boxes = np.column_stack([chord, depth, centre, yaw]).tolist()
    return [
        Body((box_length, box_depth, thickness), material, (x, y, 0.0), (0.0, 0.0, box_yaw))
        for box_length, box_depth, x, y, box_yaw in boxes
    ]


def format_lengths(numbers: Sequence[float] | FloatArray) -> str:
    """Return numbers in m, rounded to 1 nm, as text."""
    return format_numbers([round(float(number), 9) for number in numbers])


def format_numbers(numbers: Sequence[float], digits: int = 6) -> str:
    """Return numbers with `digits` significant digits as text, zero without sign."""
    return " ".join(f"{float(number) + 0.0:.{digits}g}" for number in numbers)


#: Thickness of the cam along the shaft, relative to the size of the robot (display only).
DISC_THICKNESS = 0.24
#: Thickness of the follower's bodies along the shaft, relative to the size of the robot.
BODY_THICKNESS = 0.12
#: Thickness of bodies that stand for lines, such as the stem, relative to the size of the robot.
LINE_THICKNESS = 0.04
#: Size of the robot (m) to which wall, motor and microphone are scaled. It is the same for all
#: cams.
BENCH_SIZE = 0.125
#: Number of significant digits of joints, from which other programs compute the positions of the
#: links. All other numbers have six digits.
JOINT_DIGITS = 12
#: Hardware component of the package joint_state_topic_hardware_interface, which exchanges commands
#: and states through topics.
CONTROL_PLUGIN = "joint_state_topic_hardware_interface/JointStateTopicSystem"


def urdf(robot: Robot, namespace: str | None = None) -> str:
    """Return the URDF of a rig, which is the content of /robot_description.

    With a `namespace` of the rig's topics ("" for the root) the URDF also contains the element
    ``ros2_control`` for the hardware component `CONTROL_PLUGIN`.
    """
    root = Element("robot", name="cam_rig")
    for name, (rgba, _) in MATERIALS.items():
        channels = [(rgba >> shift & 0xFF) / 255.0 for shift in (24, 16, 8)]
        SubElement(
            SubElement(root, "material", name=name), "color", rgba=format_numbers([*channels, 1.0])
        )
    joints, bodies = [*robot.fixed, *robot.moving], _bodies(robot)
    arc = [joint.child for joint in joints if joint.child == ARC]
    for link in (BASE, GUIDE, MOTOR, MICROPHONE, CAM, FOLLOWER, *robot.cams, *arc):
        _link(root, robot, link, bodies.get(link, []))
    for joint in joints:
        _joint(root, robot, joint)
    if namespace is not None:
        root.append(_ros2_control(robot, namespace))
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _link(root: Element, robot: Robot, name: str, bodies: list[Body]) -> None:
    """Add a URDF link with bodies, mass, inertia and a comment on the assumptions.

    `root` is the URDF element of the robot, and `name` the name of the link.
    """
    element, mass = SubElement(root, "link", name=name), None
    comment = "mass and inertia assumed: of solid bodies" if bodies else "1 g assumed: no body"
    if name == FOLLOWER:
        rig = robot.loaded.rig
        mass, origin = rig.follower.mass.si, rig.follower.mass.origin
        comment = f"mass {origin} in rig {rig.name}; inertia assumed: spread as in solid bodies"
    element.append(Comment(f" {comment} "))
    element.append(inertial(bodies, mass))
    for body in bodies:
        element.extend(body.elements())


def _joint(root: Element, robot: Robot, joint: RobotJoint) -> None:
    element = SubElement(root, "joint", name=joint.name, type=joint.kind)
    xyz, rpy = (format_numbers(numbers, JOINT_DIGITS) for numbers in (joint.xyz, joint.rpy))
    SubElement(element, "origin", xyz=xyz, rpy=rpy)
    SubElement(element, "parent", link=joint.parent)
    SubElement(element, "child", link=joint.child)
    if joint.kind == "fixed":
        return
    SubElement(element, "axis", xyz="0 1 0" if joint.kind == "prismatic" else "0 0 1")
    if joint.kind == "continuous":
        speed_text = format_numbers((_max_speed(robot),), JOINT_DIGITS)
        limits = {"effort": format_numbers((robot.max_torque,)), "velocity": speed_text}
        SubElement(element, "limit", limits)
    if joint.limits is not None:
        # load at the scene's highest speed, in N and m/s, or in N m and rad/s of an arm
        ratio = abs(joint.follows or 1.0)
        force, velocity = robot.max_force_and_velocity
        names = ("lower", "upper", "effort", "velocity")
        values = (*joint.limits, force / ratio, ratio * velocity)
        limits = {name: format_numbers((value,)) for name, value in zip(names, values, strict=True)}
        SubElement(element, "limit", limits)
    if joint.follows is not None:
        follows = format_numbers((joint.follows,), JOINT_DIGITS)
        SubElement(element, "mimic", joint=FOLLOWER, multiplier=follows, offset="0")


def _ros2_control(robot: Robot, namespace: str) -> Element:
    """Return the URDF element for ros2_control, with commands and states of joints.

    `namespace` is that of the topics of the rig.
    """
    element = Element("ros2_control", name="cam_rig", type="system")
    hardware = SubElement(element, "hardware")
    SubElement(hardware, "plugin").text = CONTROL_PLUGIN
    for name, topic in (
        ("joint_commands_topic", JOINT_COMMANDS),
        ("joint_states_topic", JOINT_STATES),
    ):
        SubElement(hardware, "param", name=name).text = topic.within(namespace)
    cam = SubElement(element, "joint", name=CAM)
    command = SubElement(cam, "command_interface", name="velocity")
    for name, speed in (("min", 0.0), ("max", _max_speed(robot))):
        SubElement(command, "param", name=name).text = format_numbers((speed,), JOINT_DIGITS)
    for joint in (cam, SubElement(element, "joint", name=FOLLOWER)):
        for quantity in ("position", "velocity", "effort"):
            SubElement(joint, "state_interface", name=quantity)
    return element


def _max_speed(robot: Robot) -> float:
    """Return the highest speed of commands (rad/s), less a margin for the rounding of its text."""
    return (1.0 - 10.0**-JOINT_DIGITS) * speed_limits(robot.loaded.scene)[1]


def _bodies(robot: Robot) -> dict[str, list[Body]]:
    """Return the bodies of each link of the rig that has bodies, by name."""
    size, bench, cam, shape = robot.size, BENCH_SIZE, robot.mounted, robot.shape
    disc, line = DISC_THICKNESS * size, LINE_THICKNESS * size
    radius = cam.follower.base_radius.si
    wall = (LINE_THICKNESS * bench, 2.4 * bench, 3.0 * bench)
    motor_x = 0.75 * (size - bench)  # the distance of the motor's link depends on the cam's size
    along_shaft = (0.0, 0.5 * math.pi, 0.0)
    front, back = 0.15 * size, -0.75 * bench  # ends of the shaft
    middle = (0.0, 0.0, 0.5 * (front + back))
    contour = contour_of(cam, robot.law).T
    return {
        BASE: [Body(wall, "wall", (-0.5 * bench, 0.0, 0.4 * bench))],
        GUIDE: [_strip(strip, disc, line, "wall") for strip in shape.support()],
        MOTOR: [Body((0.35 * bench, 0.4 * bench), "black", (motor_x, 0.0, 0.0), along_shaft)],
        MICROPHONE: [Body((0.05 * bench, 0.4 * bench), "black")],
        CAM: [
            Body((radius, 0.9 * disc), "steel"),
            Body((0.25 * radius, front - back), "steel", middle),
        ],
        FOLLOWER: [
            _strip(robot.body(strip), BODY_THICKNESS * size, line, "brass")
            for strip in shape.outline()
        ],
        cam.name: prism(contour, radius, 0.9 * disc, "steel"),
    }


def _strip(strip: FloatArray, depth: float, line: float, material: str) -> Body:
    """Return the body of a polyline of the rig, with lengths in m.

    It is a bar for two points, a cylinder for more than five points (a circle), and otherwise the
    bounding box. `depth` is its size along the shaft, and `line` the thickness of a bar. `strip`
    contains the points, and `material` is the name of the material.
    """
    low, high = strip.min(axis=0), strip.max(axis=0)
    (x, y), (width, height) = 0.5 * (low + high), high - low
    centre = float(x), float(y), 0.0
    if len(strip) == 2:
        yaw, length = np.arctan2(*(strip[1] - strip[0])[::-1]), np.hypot(width, height)
        return Body((float(length), line, depth), material, centre, (0.0, 0.0, float(yaw)))
    if len(strip) > 5:
        return Body((0.5 * float(width), depth), material, centre)
    return Body((float(width), float(height), depth), material, centre)
