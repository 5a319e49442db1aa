"""The tangent-arc cam: base circle, concave flank and nose, each tangent to the next.

Lengths are those of the pitch curve (the path of the roller's centre or of the point), on
which arcs stay arcs. Seen from the cam's centre, an arc of radius ρ whose centre stands at
distance D in direction φ has the polar radius

    r(θ) = D cos(θ − φ) ± √(ρ² − D² sin²(θ − φ)),

plus for a convex arc (nose), minus for a concave one (flank). At every joint r and r' agree
and r'' jumps: that is the cam of fig. 1 of the paper.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.errors import LawError


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
        root = np.sqrt(self.radius**2 - (self.distance * sine) ** 2)
        side = -1.0 if self.concave else 1.0
        shift = self.distance * (cosine, -sine, -cosine, sine)[order]
        return np.asarray(shift + side * _root_derivative(self.distance, sine, cosine, root, order))


def _root_derivative(
    distance: float, sine: FloatArray, cosine: FloatArray, q: FloatArray, order: int
) -> FloatArray:
    """Derivatives of q = √(ρ² − D² sin²δ), with S = D² sin 2δ / 2 so that q' = −S/q."""
    half = distance**2 * sine * cosine
    slope = distance**2 * (cosine**2 - sine**2)
    if order == 0:
        return q
    if order == 1:
        return -half / q
    if order == 2:
        return -slope / q - half**2 / q**3
    return 4.0 * half / q - 3.0 * half * slope / q**3 - 3.0 * half**3 / q**5


@dataclass(frozen=True)
class ConcaveFlankCam:
    """A symmetric cam of base circle, concave flanks and nose, given by its event angles.

    Parameters
    ----------
    base_radius : pitch radius of the base circle, m
    lift : m
    event_half_angle : cam angle from the nose's middle to where the flank leaves the base, rad
    nose_half_angle : cam angle from the nose's middle to the joint of nose and flank, rad

    Raises
    ------
    LawError : no pair of tangent arcs joins the base circle to the nose with these numbers
    """

    base_radius: float
    lift: float
    event_half_angle: float
    nose_half_angle: float

    def radii(self) -> tuple[float, float]:
        """Pitch radii (m) of flank and nose.

        Tangency at the joint puts it on the line of the two centres, and its direction is
        given; with the cosine rule in the triangle of the three centres that is a quadratic
        in the flank's radius.
        """
        base, top = self.base_radius, self.base_radius + self.lift
        psi, alpha = self.event_half_angle, self.nose_half_angle
        a = base**2 + top**2 - 2.0 * base * top * np.cos(psi)
        b = 2.0 * base - 2.0 * top * np.cos(psi)
        d = 2.0 * (top - base * np.cos(psi))
        e = 2.0 * (1.0 - np.cos(psi))
        s, k = np.sin(psi - alpha), np.sin(alpha)
        quadratic = [
            b * s - (top * e - b) * k,
            (a + b * base) * s - (top * d - a) * k,
            a * base * s,
        ]
        for root in sorted(np.roots(quadratic), key=abs):
            flank = float(np.real(root))
            if abs(np.imag(root)) > 0.0 or flank <= 0.0:
                continue
            nose = float((a + b * flank) / (d + e * flank))
            if 0.0 < nose < top and self._joins(flank, nose):
                return flank, nose
        raise LawError(
            f"tangent arcs: no concave flank joins base radius {base * 1e3:g} mm to lift "
            f"{self.lift * 1e3:g} mm with event half angle {np.degrees(psi):g}° and nose half "
            f"angle {np.degrees(alpha):g}°; move the nose half angle"
        )

    def _joins(self, flank: float, nose: float) -> bool:
        """Whether a follower goes from flank to nose: it could also come under an overhang."""
        joint = np.array([-self.nose_half_angle])
        with np.errstate(invalid="ignore"):
            before, after = (arc(joint, 0)[0] for arc in self._arcs(flank, nose))
        return bool(abs(after - before) < 1e-9 * self.base_radius)

    def arcs(self) -> tuple[Arc, Arc]:
        """Flank (on the rising side, direction measured from the nose) and nose."""
        return self._arcs(*self.radii())

    def _arcs(self, flank: float, nose: float) -> tuple[Arc, Arc]:
        centre = self.base_radius + self.lift - nose
        return (
            Arc(self.base_radius + flank, -self.event_half_angle, flank, concave=True),
            Arc(centre, 0.0, nose, concave=False),
        )
