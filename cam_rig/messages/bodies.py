"""Boxes and cylinders of a URDF: to look at, to collide with, and with a mass."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from cam_rig.messages.frames import Vector
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
        density = MATERIALS[self.material].density
        return density * (math.prod(self.size) if len(self.size) == 3 else self._volume)

    @property
    def _volume(self) -> float:
        radius, length = self.size
        return math.pi * radius**2 * length

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
        turn = rotation(self.rpy)
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
                radius, length = self.size
                SubElement(geometry, "cylinder", radius=text((radius,)), length=text((length,)))
        SubElement(visual, "material", name=self.material)
        return visual, collision


def inertial(bodies: Sequence[Body], mass: float | None = None) -> Element:
    """Mass, its centre and its inertia: of solid bodies, or of ``mass`` (kg) spread as theirs.

    A link without a body has a gram: no program takes one without.
    """
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


def rotation(rpy: Vector) -> FloatArray:
    """``(3, 3)`` of roll, pitch and yaw (rad) about the parent's axes, in this order."""
    (sr, cr), (sp, cp), (sy, cy) = ((math.sin(a), math.cos(a)) for a in rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def lengths(numbers: Sequence[float] | FloatArray) -> str:
    """Numbers in m, to the nanometre."""
    return text([round(float(number), 9) for number in numbers])


def text(numbers: Sequence[float], digits: int = 6) -> str:
    """Numbers to so many digits; zero has no sign."""
    return " ".join(f"{float(number) + 0.0:.{digits}g}" for number in numbers)
