"""Closed contours of circular arcs and straight lines, each tangent to the next.

Points are complex numbers y + ix in the cam's frame. The argument of a point is therefore the cam
angle at which a follower on the cam's centre line touches it. A circle's radius is signed: positive
for a convex arc, negative for a concave one. With the outward unit normal n, the contour's points
are c + ρn in both cases, and two circles are tangent if c₁ + ρ₁n = c₂ + ρ₂n.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

import numpy as np

from cam_rig.errors import LawError
from cam_rig.units import FloatArray

#: Largest gap or overlap of two circles that count as tangent, as a fraction of the sum of their
#: radii. It is far above rounding and far below manufacturing tolerances.
TANGENCY_RTOL = 1e-9


@dataclass(frozen=True)
class Circle:
    """Circle of a contour: centre y + ix in the cam's frame and signed radius, in m."""

    centre: complex
    radius: float


@dataclass(frozen=True)
class Blend:
    """Arc of a signed radius (m), or straight line (None), that joins its neighbours."""

    radius: float | None


@dataclass(frozen=True)
class StraightLine:
    """Straight line of all points z with Re(z·n*) = ``distance`` (m).

    ``normal`` is the outward unit normal n.
    """

    normal: complex
    distance: float


Part = Circle | StraightLine


@dataclass(frozen=True)
class Chain:
    """Closed contour of circles and straight lines in the order of the cam angle.

    ``normals[i]`` is the outward unit normal where part i ends and the next one starts.
    """

    parts: tuple[Part, ...]
    normals: tuple[complex, ...]


def close_chain(specs: list[Circle | Blend]) -> Chain:
    """Fit each blend between its neighbours, and return the closed contour.

    Parameters
    ----------
    specs : list of Circle or Blend
        Circles and blends in the order of the cam angle, the last joined to the first.

    Returns
    -------
    Chain
        The closed contour, with a circle or a straight line in place of each blend.

    Raises
    ------
    LawError
        If a blend is not between two circles, or cannot touch both, or two adjacent circles are not
        tangent.
    """
    parts: list[Part] = []
    for i, spec in enumerate(specs):
        if isinstance(spec, Circle):
            parts.append(spec)
            continue
        before, after = specs[i - 1], specs[(i + 1) % len(specs)]
        if not (isinstance(before, Circle) and isinstance(after, Circle)) or before == after:
            raise LawError(
                f"arcs[{i}]: has no centre, and its neighbours do not both have one; "
                "allowed: two different arcs with centres next to it"
            )
        blend = _blend_line if spec.radius is None else _blend_arc
        parts.append(blend(before, after, spec.radius or 0.0, f"arcs[{i}]"))
    next_parts = [*parts[1:], parts[0]]
    normals = [
        _joint_normal(part, next_part, i)
        for i, (part, next_part) in enumerate(zip(parts, next_parts, strict=True))
    ]
    return Chain(tuple(parts), tuple(normals))


def _blend_line(before: Circle, after: Circle, _: float, name: str) -> StraightLine:
    """Return the common outer tangent that leads from one circle to the other."""
    offset = after.centre - before.centre
    difference = before.radius - after.radius
    if abs(offset) <= abs(difference):
        raise LawError(
            f"{name}: no straight line touches both its neighbours, one is inside the other; "
            f"allowed: centres more than {abs(difference) * 1e3:g} mm apart, they are "
            f"{abs(offset) * 1e3:g} mm"
        )
    normal = cmath.rect(1.0, cmath.phase(offset) - math.acos(difference / abs(offset)))
    return StraightLine(normal, (before.centre * normal.conjugate()).real + before.radius)


def _blend_arc(before: Circle, after: Circle, radius: float, name: str) -> Circle:
    """Return the arc of a signed radius (m) that touches both circles.

    Two arcs touch them. The result turns the normal in the direction of the radius's sign.
    """
    offset = after.centre - before.centre
    to_before, to_after, distance = radius - before.radius, radius - after.radius, abs(offset)
    if abs(to_before - to_after) >= distance:
        raise LawError(
            f"{name}: no arc touches both its neighbours, one is inside the other; allowed: "
            f"centres more than {abs(to_before - to_after) * 1e3:g} mm apart, they are "
            f"{distance * 1e3:g} mm"
        )
    if radius < 0.0:
        min_radius = max(0.0, 0.5 * (distance - before.radius - after.radius))
    else:
        min_radius = 0.5 * (distance + before.radius + after.radius)
    if not abs(radius) > min_radius:
        raise LawError(
            f"{name}: radius {radius * 1e3:g} mm is too small to touch both its neighbours; "
            f"allowed: more than {min_radius * 1e3:g} mm"
        )
    along = 0.5 * (to_before**2 - to_after**2 + distance**2) / distance
    across = math.sqrt(max(0.0, to_before**2 - along**2))
    for side in (across, -across):
        circle = Circle(before.centre + offset / distance * complex(along, side), radius)
        turn = _tangent_normal(circle, after) / _tangent_normal(before, circle)
        if turn.imag * radius > 0.0:
            return circle
    raise LawError(f"{name}: its neighbours touch each other; leave it out")


def _tangent_normal(circle: Circle, following: Circle) -> complex:
    """Return the outward unit normal where two circles touch.

    It is n = (c₂ − c₁)/(ρ₁ − ρ₂), normalised.
    """
    direction = (following.centre - circle.centre) / (circle.radius - following.radius)
    return direction / abs(direction)


def _joint_normal(part: Part, following: Part, i: int) -> complex:
    """Return the outward unit normal at the joint of part ``i`` and the next part."""
    if isinstance(part, StraightLine):
        return part.normal
    if isinstance(following, StraightLine):
        return following.normal
    distance, needed = abs(following.centre - part.centre), abs(part.radius - following.radius)
    size = abs(part.radius) + abs(following.radius)
    if needed == 0.0 or abs(distance - needed) > TANGENCY_RTOL * size:
        raise LawError(
            f"arcs[{i}] and the next do not touch: their centres are {distance * 1e3:.9g} mm "
            f"apart, their radii need {needed * 1e3:.9g} mm; allowed: arcs that touch, so leave "
            "out the centre of one and it is placed"
        )
    return _tangent_normal(part, following)


# Tangent-arc cam: base circle, concave flank and nose, each tangent to the next.


@dataclass(frozen=True)
class Arc:
    """Circular arc of a pitch curve: polar radius as a function of the cam angle.

    ``distance`` (m) and ``direction`` (rad) locate the centre of its circle, and ``radius`` is in
    m. ``concave`` is True for the side of the circle that faces the cam's centre.
    """

    distance: float
    direction: float
    radius: float
    concave: bool

    def __call__(self, angle: FloatArray, order: int) -> FloatArray:
        """Return the polar radius (m) at cam angles (rad), or one of its derivatives.

        ``order`` is 0 to 3, and the unit of the derivative is m/rad^order.
        """
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
    """Symmetric cam of base circle, concave flanks and nose, by its event angles.

    ``base_radius`` and ``lift`` are in m, of the pitch curve. ``event_half_angle`` and
    ``nose_half_angle`` are in rad, from the middle of the nose to the two ends of a flank.
    """

    base_radius: float
    lift: float
    event_half_angle: float
    nose_half_angle: float

    def radii(self) -> tuple[float, float]:
        """Return the radii (m) of flank and nose of the pitch curve.

        Raises
        ------
        LawError
            If no concave flank joins base circle and nose at these angles.
        """
        # The joint lies on the line through the centres of flank and nose, in a given direction.
        # The cosine rule in the triangle of the three centres gives a quadratic in the flank's
        # radius.
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
            with np.errstate(invalid="ignore"):  # not a number under an overhang
                before, after = (arc(np.array([-alpha]), 0)[0] for arc in self._arcs(flank, nose))
            if abs(after - before) < 1e-9 * base:
                return flank, nose
        raise LawError(
            f"tangent arcs: no concave flank joins base radius {base * 1e3:g} mm to lift "
            f"{self.lift * 1e3:g} mm with event half angle {np.degrees(psi):g}° and nose half "
            f"angle {np.degrees(alpha):g}°; move the nose half angle"
        )

    def arcs(self) -> tuple[Arc, Arc]:
        """Return flank and nose of the pitch curve as arcs.

        The flank is that of the rising side. Directions are measured from the middle of the nose.
        """
        return self._arcs(*self.radii())

    def _arcs(self, flank: float, nose: float) -> tuple[Arc, Arc]:
        centre = self.base_radius + self.lift - nose
        return (
            Arc(self.base_radius + flank, -self.event_half_angle, flank, concave=True),
            Arc(centre, 0.0, nose, concave=False),
        )
