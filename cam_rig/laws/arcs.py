"""A contour of circular arcs and straight lines, each tangent to the next.

Points are complex numbers in the cam's frame, y + ix, so that the argument of a point is the
cam angle at which a follower on the cam's centre line stands over it. A circle's radius is
signed: positive where the contour is convex, negative where it is concave. With the outward
normal n, the contour's points are c + ρn in both cases, and two circles touch where
c₁ + ρ₁n = c₂ + ρ₂n.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

import numpy as np

from cam_rig.errors import LawError
from cam_rig.units import FloatArray

#: Two given circles touch when they miss by less than this fraction of their size.
TOUCH = 1e-9


@dataclass(frozen=True)
class Circle:
    """A circle of a contour: centre in the cam's frame (y + ix) and signed radius, m."""

    centre: complex
    radius: float


@dataclass(frozen=True)
class Blend:
    """An arc of a signed radius (m), or a straight line (None), that joins its neighbours."""

    radius: float | None


@dataclass(frozen=True)
class StraightLine:
    """The straight line of all points z with Re(z·n*) = distance, n the outward unit normal."""

    normal: complex
    distance: float


Part = Circle | StraightLine


@dataclass(frozen=True)
class Chain:
    """A closed contour: parts by the cam angle, outward unit normals where each meets the next."""

    parts: tuple[Part, ...]
    normals: tuple[complex, ...]


def close(specs: list[Circle | Blend]) -> Chain:
    """Give every blend its place between its neighbours, and find where the parts touch."""
    parts: list[Part] = []
    for i, spec in enumerate(specs):
        if isinstance(spec, Circle):
            parts.append(spec)
            continue
        before, after = specs[i - 1], specs[(i + 1) % len(specs)]
        if not (isinstance(before, Circle) and isinstance(after, Circle)) or before == after:
            raise LawError(
                f"arcs[{i}]: has no centre and stands between parts that do not both have one; "
                "allowed: two different arcs with centres beside it"
            )
        join = _line if spec.radius is None else _arc
        parts.append(join(before, after, spec.radius or 0.0, f"arcs[{i}]"))
    ends = [*parts[1:], parts[0]]
    normals = [_touch(a, b, i) for i, (a, b) in enumerate(zip(parts, ends, strict=True))]
    return Chain(tuple(parts), tuple(normals))


def _line(before: Circle, after: Circle, _: float, name: str) -> StraightLine:
    """The common outer tangent that leads from one circle to the other."""
    apart = after.centre - before.centre
    difference = before.radius - after.radius
    if abs(apart) <= abs(difference):
        raise LawError(
            f"{name}: no straight line touches both its neighbours, one lies inside the other; "
            f"allowed: centres more than {abs(difference) * 1e3:g} mm apart, they are "
            f"{abs(apart) * 1e3:g} mm"
        )
    normal = cmath.rect(1.0, cmath.phase(apart) - math.acos(difference / abs(apart)))
    return StraightLine(normal, (before.centre * normal.conjugate()).real + before.radius)


def _arc(before: Circle, after: Circle, radius: float, name: str) -> Circle:
    """The arc that touches both circles and turns the normal the way its sign says."""
    apart = after.centre - before.centre
    one, other, between = radius - before.radius, radius - after.radius, abs(apart)
    if abs(one - other) >= between:
        raise LawError(
            f"{name}: no arc touches both its neighbours, one lies inside the other; allowed: "
            f"centres more than {abs(one - other) * 1e3:g} mm apart, they are "
            f"{between * 1e3:g} mm"
        )
    if radius < 0.0:
        least = max(0.0, 0.5 * (between - before.radius - after.radius))
    else:
        least = 0.5 * (between + before.radius + after.radius)
    if not abs(radius) > least:
        raise LawError(
            f"{name}: radius {radius * 1e3:g} mm is too small to touch both its neighbours; "
            f"allowed: more than {least * 1e3:g} mm"
        )
    along = 0.5 * (one**2 - other**2 + between**2) / between
    across = math.sqrt(max(0.0, one**2 - along**2))
    for side in (across, -across):
        circle = Circle(before.centre + apart / between * complex(along, side), radius)
        turn = _normal(circle, after) / _normal(before, circle)
        if turn.imag * radius > 0.0:
            return circle
    raise LawError(f"{name}: its neighbours touch each other; leave it out")


def _normal(one: Circle, other: Circle) -> complex:
    """Outward unit normal where two circles touch: n = (c₂ − c₁)/(ρ₁ − ρ₂)."""
    towards = (other.centre - one.centre) / (one.radius - other.radius)
    return towards / abs(towards)


def _touch(one: Part, other: Part, i: int) -> complex:
    if isinstance(one, StraightLine):
        return one.normal
    if isinstance(other, StraightLine):
        return other.normal
    apart, needed = abs(other.centre - one.centre), abs(one.radius - other.radius)
    size = abs(one.radius) + abs(other.radius)
    if needed == 0.0 or abs(apart - needed) > TOUCH * size:
        raise LawError(
            f"arcs[{i}] and the next do not touch: their centres are {apart * 1e3:.9g} mm apart, "
            f"their radii need {needed * 1e3:.9g} mm; allowed: arcs that touch, so leave out the "
            "centre of one and it is placed"
        )
    return _normal(one, other)


# The tangent-arc cam: base circle, concave flank and nose, each tangent to the next.


@dataclass(frozen=True)
class Arc:
    """One circular arc of a pitch curve; lengths in m, direction in rad."""

    distance: float
    direction: float
    radius: float
    concave: bool

    def __call__(self, angle: FloatArray, order: int) -> FloatArray:
        """Polar radius at cam angles (rad), or its derivative of order 1 to 3, m/rad^order."""
        delta = angle - self.direction
        sine, cosine = np.sin(delta), np.cos(delta)
        shift = self.distance * (cosine, -sine, -cosine, sine)[order]
        # q = √(ρ² − D² sin²δ) and its derivatives, with S = D² sin 2δ / 2 so that q' = −S/q
        root = q = np.sqrt(self.radius**2 - (self.distance * sine) ** 2)
        half = self.distance**2 * sine * cosine
        slope = self.distance**2 * (cosine**2 - sine**2)
        if order == 1:
            root = -half / q
        elif order == 2:
            root = -slope / q - half**2 / q**3
        elif order == 3:
            root = 4.0 * half / q - 3.0 * half * slope / q**3 - 3.0 * half**3 / q**5
        return np.asarray(shift - root if self.concave else shift + root)


@dataclass(frozen=True)
class ConcaveFlankCam:
    """A symmetric cam of base circle, concave flanks and nose, given by its event angles.

    base_radius, lift : m, of the pitch curve
    event_half_angle, nose_half_angle : rad, from the nose's middle to the flank's two ends
    """

    base_radius: float
    lift: float
    event_half_angle: float
    nose_half_angle: float

    def radii(self) -> tuple[float, float]:
        """Pitch radii (m) of flank and nose."""
        # The joint is on the line of the two centres, in a given direction: with the cosine rule
        # in the triangle of the three centres a quadratic in the flank's radius.
        base, top = self.base_radius, self.base_radius + self.lift
        psi, alpha = self.event_half_angle, self.nose_half_angle
        a = base**2 + top**2 - 2.0 * base * top * np.cos(psi)
        b = 2.0 * base - 2.0 * top * np.cos(psi)
        d = 2.0 * (top - base * np.cos(psi))
        e = 2.0 * (1.0 - np.cos(psi))
        s, k = np.sin(psi - alpha), np.sin(alpha)
        second, first = b * s - (top * e - b) * k, (a + b * base) * s - (top * d - a) * k
        for root in sorted(np.roots([second, first, a * base * s]), key=abs):
            flank = float(np.real(root))
            if abs(np.imag(root)) > 0.0 or flank <= 0.0:
                continue
            nose = float((a + b * flank) / (d + e * flank))
            if not 0.0 < nose < top:
                continue
            with np.errstate(invalid="ignore"):  # a follower could also come under an overhang
                before, after = (arc(np.array([-alpha]), 0)[0] for arc in self._arcs(flank, nose))
            if abs(after - before) < 1e-9 * base:
                return flank, nose
        raise LawError(
            f"tangent arcs: no concave flank joins base radius {base * 1e3:g} mm to lift "
            f"{self.lift * 1e3:g} mm with event half angle {np.degrees(psi):g}° and nose half "
            f"angle {np.degrees(alpha):g}°; move the nose half angle"
        )

    def arcs(self) -> tuple[Arc, Arc]:
        """Flank (on the rising side, direction measured from the nose) and nose."""
        return self._arcs(*self.radii())

    def _arcs(self, flank: float, nose: float) -> tuple[Arc, Arc]:
        centre = self.base_radius + self.lift - nose
        return (
            Arc(self.base_radius + flank, -self.event_half_angle, flank, concave=True),
            Arc(centre, 0.0, nose, concave=False),
        )
