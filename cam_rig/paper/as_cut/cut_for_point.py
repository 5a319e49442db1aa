"""The law that a roller follows on a contour that was cut for a point.

A contour drawn in polar coordinates as R_b + s (`PolarPlot[s + R_b]`, fig. 12 of the paper) is that
of a point follower (profile thesis, eq. 2.19 with R_r = 0 and ε = 0). A roller of radius R_r on it
touches beside its guide: its centre follows not s but the curve at R_r outside of the contour.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cam_rig.errors import ProfileError
from cam_rig.laws import Law, bernstein
from cam_rig.laws.bernstein import Pieces, joined, turned_to_zero
from cam_rig.laws.sampling import fit
from cam_rig.profile.checks import sharpest_concave
from cam_rig.profile.contact import Scan
from cam_rig.profile.faces import GuidedCentre
from cam_rig.units import TURN, FloatArray

#: Steps of Newton's method, with bisection as its guard; the guard alone would take 53.
STEPS, CONVERGED = 60, 2e-15
#: Degree of the fitted third derivative, and its accepted relative tail: s'' is then known to
#: 1e-12 of its size. Pieces come out short, and a high degree there would lose digits of the force.
THIRD_DEGREE, TAIL = 10, 1e-10
#: Points a piece at which the fitted law is held against the closed form.
COMPARED = 33


@dataclass(frozen=True, eq=False)
class FollowedLaw:
    """The law of a roller on a contour cut for a point, 0 on the base circle.

    ``error`` ``(3,)`` is the largest difference of s (m), s' (m/rad) and s'' (m/rad²) to the closed
    form, at `COMPARED` points of each piece.
    """

    law: Law
    error: FloatArray


@dataclass(frozen=True, eq=False)
class _CutPiece:
    """One piece of the law that was cut, and the roller's centre while it touches there.

    φ is the polar angle of the contour, ρ = R_b + s(φ) its radius, θ the cam angle: the polar
    angle of the roller's centre, at the distance d. ``ordinates`` ``(4, p + 1)`` are of ρ to its
    third derivative, m/rad^order.
    """

    start: float
    span: float
    ordinates: FloatArray
    roller: float

    def rows(self, polar: FloatArray) -> FloatArray:
        """``(4, n)``: ρ and its derivatives at polar angles φ, rad."""
        u = np.clip((polar - self.start) / self.span, 0.0, 1.0)
        return np.asarray(self.ordinates @ bernstein.basis(self.ordinates.shape[1] - 1, u).T)

    def cam_angle(self, polar: FloatArray) -> FloatArray:
        """θ (rad) at which the roller touches at φ."""
        rho, slope = self.rows(polar)[:2]
        share = self.roller / np.hypot(rho, slope)
        return np.asarray(polar - np.arctan2(share * slope, rho * (1.0 + share)))

    def polar(self, angle: FloatArray) -> FloatArray:
        """φ (rad) at which the roller touches at θ; θ grows with φ where the roller fits."""
        low = np.full(angle.shape, self.start)
        high = low + self.span
        at = np.clip(angle, low, high)
        for _ in range(STEPS):
            over = self.cam_angle(at) - angle
            low, high = np.where(over <= 0.0, at, low), np.where(over >= 0.0, at, high)
            newton = at - over / roller_centre(self.rows(at), self.roller)[1]
            guarded = np.where((newton >= low) & (newton <= high), newton, 0.5 * (low + high))
            moved, at = np.abs(guarded - at).max(), guarded
            if moved <= CONVERGED:
                break
        return at

    def distance(self, angle: FloatArray) -> FloatArray:
        """``(4, n)``: distance d of the roller's centre (m), and three derivatives, at θ (rad)."""
        return roller_centre(self.rows(self.polar(angle)), self.roller)[0]


def roller_centre(rows: FloatArray, roller: float) -> tuple[FloatArray, FloatArray]:
    """The centre of a roller that touches a polar contour, and its derivatives in the cam angle.

    Of ``rows`` ``(4, n)``, ρ and its first three derivatives in φ, m/rad^order, and a radius in m
    come ``(4, n)`` d and its first three derivatives in θ, m/rad^order, and ``(n,)`` dθ/dφ.

    With q² = ρ² + ρ'², t = d'/d the tangent of the pressure angle and κ_p = κ/(1 + R_r κ) the
    curvature of the pitch curve: t = ρρ'/(ρ² + R_r q), d'' = d (1 + 2t²) − κ_p d² (1 + t²)^(3/2).
    """
    rho, slope, bend, third = rows
    q = np.hypot(rho, slope)
    turned = rho**2 + 2.0 * slope**2 - rho * bend
    curvature = turned / q**3
    along = 2.0 * rho * slope + 3.0 * slope * bend - rho * third
    curving = along / q**3 - 3.0 * turned * slope * (rho + bend) / q**5
    grown = 1.0 + roller * curvature
    d = np.sqrt(rho**2 + 2.0 * roller * rho**2 / q + roller**2)
    rate = grown * (rho**2 + roller * q) / d**2
    t = rho * slope / (rho**2 + roller * q)
    pitch, pitch_along = curvature / grown, curving / (grown**2 * rate)
    root = np.sqrt(1.0 + t**2)
    d1 = d * t
    d2 = d * (1.0 + 2.0 * t**2) - pitch * d**2 * root**3
    turning = t * (d2 / d - t**2)  # t dt/dθ
    d3 = (
        d1 * (1.0 + 2.0 * t**2)
        + 4.0 * d * turning
        - d * root * (pitch_along * d * root**2 + 2.0 * pitch * d1 * root**2)
        - 3.0 * pitch * d**2 * root * turning
    )
    return np.stack([d, d1, d2, d3]), rate


def followed_law(law: Law, base_radius: float, roller: float) -> FollowedLaw:
    """The law of a roller's centre on the contour R_b + s(φ) that was cut for a point; radii in m.

    It is fitted to rounding (`cam_rig.laws.sampling`), with the error it was found to have. Its
    lift is that of s, as the two curves are parallel; a dwell stays one.
    """
    _require_room(law, base_radius, roller)
    breaks: list[float] = []
    columns: list[FloatArray] = []
    errors = [np.zeros(3)]
    ordinates = np.stack([law.derivative_ordinates(order) for order in range(4)])
    ordinates[0] += base_radius
    for i, (start, span) in enumerate(zip(law.breaks[:-1], law.spans, strict=True)):
        piece = _CutPiece(float(start), float(span), ordinates[:, :, i], roller)
        (edges, fitted), error = _fit(piece, base_radius + roller)
        errors.append(error)
        breaks += edges if not breaks else edges[1:]
        columns += fitted
    breaks[-1] = breaks[0] + TURN
    edges, columns = turned_to_zero((breaks, columns), TURN)
    edges[-1] = TURN
    return FollowedLaw(Law(law.name, np.array(edges), joined(columns)), np.max(errors, axis=0))


def _fit(piece: _CutPiece, prime: float) -> tuple[Pieces, FloatArray]:
    """Pieces of the roller's lift over θ, and their largest errors ``(3,)``; a dwell exactly."""
    ends = piece.cam_angle(piece.start + np.array([0.0, piece.span])).tolist()
    if not piece.ordinates[1].any():
        height = piece.ordinates[0, 0] + piece.roller - prime
        return (ends, [np.array([height])]), np.zeros(3)

    def lift(angle: FloatArray, order: int) -> FloatArray:
        return np.asarray(piece.distance(angle)[order] - (prime if order == 0 else 0.0))

    breaks, columns = fit(lift, ends[0], ends[1], THIRD_DEGREE, TAIL)
    u = np.linspace(0.0, 1.0, COMPARED)
    error = np.zeros(3)
    for start, stop, column in zip(breaks[:-1], breaks[1:], columns, strict=True):
        exact = piece.distance(start + (stop - start) * u)
        exact[0] -= prime
        ordinates = column
        for order in range(3):
            off = np.abs(bernstein.evaluate(ordinates, u) - exact[order]).max()
            error[order] = max(error[order], float(off))
            ordinates = bernstein.derivative(ordinates) / (stop - start)
    return (breaks, columns), error


def _require_room(law: Law, base_radius: float, roller: float) -> None:
    if not (base_radius > 0.0 and roller >= 0.0):
        raise ProfileError(
            f"base radius is {base_radius * 1e3:g} mm, roller radius {roller * 1e3:g} mm; allowed: "
            "a base radius above 0, and a roller radius of 0 (a point) or more"
        )
    if law.velocity_jumps:
        where = np.degrees(law.breaks[next(iter(law.velocity_jumps))])
        raise ProfileError(
            f"cam {law.name!r}: its contour has a corner at {where:.4g}°, where the velocity "
            "jumps; allowed: a law without such jumps, or a follower without a roller"
        )
    found = sharpest_concave(Scan(law, GuidedCentre.on_base(base_radius, 0.0, 0.0)))
    if found is not None and found.value <= roller:
        raise ProfileError(
            f"cam {law.name!r}: roller radius is {roller * 1e3:.6g} mm; allowed: less than the "
            f"contour's concave radius of curvature {found.value * 1e3:.6g} mm at "
            f"{np.degrees(found.angle):.4g}°; let the roller be smaller or the base circle larger"
        )
