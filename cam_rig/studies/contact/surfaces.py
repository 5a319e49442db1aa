"""Force, Hertz pressure and sliding of cam and follower, and bounds on the base radius.

The force F along the guide, or along the arc of the arm, is that of a rigid follower in contact.
The normal force N follows from virtual work, N v·n = F ṡ, with the velocity v of the follower and
the contact normal n. In a guide N = F / cos α with the pressure angle α. Friction is neglected. If
the cam would have to pull, the force and the pressure are zero.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.kinetostatic import force_weights
from cam_rig.errors import ProfileError
from cam_rig.laws import Law, bernstein
from cam_rig.laws.bernstein import join_pieces
from cam_rig.laws.segments import NAMED_RISES, unit_rise
from cam_rig.profile import discs
from cam_rig.profile.cam_checks import max_pressure_angle, require_profile
from cam_rig.profile.checks import discs_on, find_min_base_radius, search_base_radius
from cam_rig.profile.contact import Element, Motion, Scan, Touch
from cam_rig.schema import CamConfig
from cam_rig.schema.cam import ContactParts, OscillatingPoint, Point
from cam_rig.units import FloatArray

# Hertz's line contact: two cylinders with parallel axes, pressed together without friction.


def hertz_pressure(load: FloatArray, curvature: FloatArray, modulus: float) -> FloatArray:
    """Return the largest Hertz pressure p₀ (Pa) of a line contact: √(F' E* κ / π).

    ``load`` is the force F' per face width in N/m. ``curvature`` is κ = 1/R₁ + 1/R₂ in 1/m, where a
    concave radius is negative. ``modulus`` is E* in Pa: 1/E* = (1 − ν₁²)/E₁ + (1 − ν₂²)/E₂.
    """
    return np.sqrt(load * modulus * curvature / np.pi)


def half_width(load: FloatArray, curvature: FloatArray, modulus: float) -> FloatArray:
    """Return half the width b of a Hertz line contact (m): √(4 F' / (π E* κ)).

    The parameters are those of `hertz_pressure`.
    """
    return np.sqrt(4.0 * load / (np.pi * modulus * curvature))


@dataclass(frozen=True)
class Surfaces:
    """Surfaces of a cam and its follower at one speed.

    The results of its methods have the shape of the motion.

    Parameters
    ----------
    element : Element
        Surface of the follower.
    radius : float
        Radius of the follower's surface in m: that of a roller or a tip, infinite for a face.
    rolls : bool
        True for a roller, which rolls instead of sliding.
    parts : ContactParts
        Face width, material and permissible values.
    rig : FollowerParameters
        Follower of the rig.
    speed : float
        Speed of the cam in rad/s.
    """

    element: Element
    radius: float
    rolls: bool
    parts: ContactParts
    rig: FollowerParameters
    speed: float

    def normal_force(self, motion: Motion, touch: Touch) -> FloatArray:
        """Return the force (N) along the common normal of cam and follower.

        It is 0 if the cam would have to pull. ``motion`` is the motion of the follower, and
        ``touch`` its contact with the cam.
        """
        orders = np.stack([motion.s, motion.slope, motion.curvature])
        force = np.tensordot(force_weights(self.rig, self.speed), orders, axes=1) + self.rig.preload
        lever = (self.element.moves(touch.contact) * touch.normal.conj()).real
        with np.errstate(divide="ignore"):  # a flat face that is touched at its pivot
            normal = np.where(lever > 0.0, np.asarray(force) / lever, np.inf)
        return np.maximum(normal, 0.0)

    def curvature(self, touch: Touch) -> FloatArray:
        """Return the relative curvature κ = 1/ρ + 1/R of cam and follower in 1/m.

        It is infinite if the follower does not fit into the cam, or if the cam is undercut.
        """
        with np.errstate(divide="ignore"):
            curvature = 1.0 / touch.radius + 1.0 / self.radius
        fits = (curvature > 0.0) & (touch.rate > 0.0)
        return np.where(fits, curvature, np.inf)

    def pressure(self, motion: Motion, touch: Touch) -> FloatArray:
        """Return the largest Hertz pressure p₀ in the contact (Pa).

        It is infinite if the curvature is infinite. ``motion`` is the motion of the follower, and
        ``touch`` its contact with the cam.
        """
        load, curvature = self.normal_force(motion, touch), self.curvature(touch)
        with np.errstate(invalid="ignore"):  # infinite curvature times zero load
            value = hertz_pressure(load / self.parts.face_width.si, curvature, self.parts.modulus)
        return np.where(np.isinf(curvature), np.inf, value)

    def width(self, motion: Motion, touch: Touch) -> FloatArray:
        """Return the full width 2b of the Hertz contact (m).

        ``motion`` is the motion of the follower, and ``touch`` its contact with the cam.
        """
        load = self.normal_force(motion, touch) / self.parts.face_width.si
        return 2.0 * half_width(load, self.curvature(touch), self.parts.modulus)

    def sliding(self, motion: Motion, touch: Touch) -> FloatArray:
        """Return the sliding speed of cam on follower (m/s).

        For a roller, which turns freely, it is the speed of its rim. ``motion`` is the motion of
        the follower, and ``touch`` its contact with the cam.
        """
        carried = motion.slope * self.element.moves(touch.contact)
        relative = 1j * touch.contact - carried
        return np.abs((relative * touch.normal.conj()).imag) * self.speed


@dataclass(frozen=True, eq=False)
class ContactCase:
    """Cam on a rig at one speed, with a profile that has been checked."""

    cam: CamConfig
    law: Law
    surfaces: Surfaces

    @cached_property
    def scan(self) -> Scan:
        """Motion and contact over the whole turn, sampled to search for extremes."""
        return Scan(self.law, self.surfaces.element)

    def at(self, angle: FloatArray) -> tuple[Motion, Touch]:
        """Return motion and contact at cam angles (rad) of shape (n,)."""
        motion = Motion.at(self.law, angle)
        return motion, self.surfaces.element.touch(motion)


def contact_case(cam: CamConfig, law: Law, rig: FollowerParameters, speed: float) -> ContactCase:
    """Check the profile of a cam, and return its contact at a ``speed`` in rad/s.

    Raises
    ------
    ProfileError
        If the profile is invalid, or the tip radius is larger than a concave radius of curvature.
    """
    require_profile(cam, law)
    radius, follower = np.inf, cam.follower
    if follower.roller > 0.0:
        radius = follower.roller
    elif isinstance(follower, Point | OscillatingPoint):
        radius = cam.parts.tip_radius.si
    element, rolls = discs(follower, law)[0].element, follower.roller > 0.0
    case = ContactCase(cam, law, Surfaces(element, radius, rolls, cam.parts, rig, speed))
    hollow = case.scan.greatest(lambda touch: -1.0 / touch.radius)
    if hollow.value * case.surfaces.radius >= 1.0:
        raise ProfileError(
            f"cam {cam.name!r}: contact.tip_radius must be less than the cam's concave radius of "
            f"curvature, {1e3 / hollow.value:.5g} mm at {np.degrees(hollow.angle):.4g}°, got "
            f"{case.surfaces.radius * 1e3:.5g}"
        )
    return case


# Lower and upper bounds on the base radius.

#: Function that returns the largest value of a quantity over a turn, such as the Hertz pressure,
#: for comparison with its limit.
Measure = Callable[[Surfaces, Scan], float]

#: Displayed names of the limits that give a lower bound on the base radius, by their key in
#: `BaseBounds`.
LOWER = {"curvature": "curvature", "pressure": "Hertz pressure", "pressure_angle": "pressure angle"}


@dataclass(frozen=True)
class BaseBounds:
    """Bounds on the base radius (m) of a cam at one speed.

    The other dimensions of the cam are fixed. A bound is None if no base radius satisfies the
    limit. A lower bound is 0 if every base radius down to a hundredth of the cam's satisfies the
    limit.

    Parameters
    ----------
    curvature : float, optional
        Smallest base radius without undercut and with the required radius of curvature.
    pressure_angle : float, optional
        Smallest base radius for the largest pressure angle.
    pressure : float, optional
        Smallest base radius for the permissible Hertz pressure.
    sliding : float, optional
        Largest base radius for the permissible sliding speed, infinite for a roller.
    """

    curvature: float | None
    pressure_angle: float | None
    pressure: float | None
    sliding: float | None

    @property
    def least(self) -> float | None:
        """Smallest base radius (m) that satisfies the three lower bounds.

        It is the largest of the bounds, or None if a limit cannot be satisfied.
        """
        lower = [getattr(self, key) for key in LOWER]
        return None if None in lower else max(lower)

    @property
    def governing(self) -> str:
        """Key of the limit that requires the largest base radius.

        If a limit cannot be satisfied by any base radius, it is the key of that limit. It is empty
        if all lower bounds are 0.
        """
        lower = {key: getattr(self, key) for key in LOWER}
        worst = max(LOWER, key=lambda key: np.inf if lower[key] is None else lower[key])
        return "" if lower[worst] == 0.0 else worst

    @property
    def feasible(self) -> bool:
        """True if at least one base radius satisfies all limits."""
        return self.least is not None and self.sliding is not None and self.least <= self.sliding


def base_bounds(case: ContactCase) -> BaseBounds:
    """Return all bounds on the base radius of a cam at one speed."""
    follower, limits = case.cam.follower, case.surfaces.parts
    radius = follower.base_radius.si

    def steepest(_: Surfaces, scan: Scan) -> float:
        return scan.greatest(lambda touch: np.abs(touch.pressure)).value

    def least(measure: Measure, limit: float) -> float | None:
        return search_base_radius(lambda base: -_excess(case, measure, limit, base, np.inf), radius)

    return BaseBounds(
        curvature=find_min_base_radius(follower, case.law),
        pressure_angle=least(steepest, max_pressure_angle(follower, case.surfaces.element)),
        pressure=least(peak_pressure, limits.most_pressure.si),
        sliding=_greatest(case, radius, limits.most_sliding_speed.si),
    )


def peak_pressure(surfaces: Surfaces, scan: Scan) -> float:
    """Return the largest Hertz pressure (Pa) over the turn."""
    return scan.greatest_of(surfaces.pressure).value


def peak_sliding(surfaces: Surfaces, scan: Scan) -> float:
    """Return the largest sliding speed (m/s) over the turn."""
    return scan.greatest_of(surfaces.sliding).value


def measured(case: ContactCase, measure: Measure, base: float) -> float | None:
    """Return the largest value of a quantity if the cam had another base radius.

    ``measure`` computes the value, for example `peak_pressure`. ``base`` is the base radius in m.
    Returns None if the follower does not reach the cam.
    """
    plates = discs_on(case.cam.follower, case.law, base)
    if not plates:
        return None
    surfaces = replace(case.surfaces, element=plates[0].element)
    return measure(surfaces, Scan(case.law, surfaces.element))


def _excess(
    case: ContactCase, measure: Measure, limit: float, base: float, missing: float
) -> float:
    """Return the relative excess of a quantity over its limit at a base radius (m).

    It is measure/limit − 1, clipped to ±1 for a root finder. ``missing`` replaces measure/limit if
    the follower does not reach the cam.
    """
    value = measured(case, measure, base)
    return float(np.clip((missing if value is None else value / limit) - 1.0, -1.0, 1.0))


def _greatest(case: ContactCase, radius: float, limit: float) -> float | None:
    """Return the largest base radius (m) within the limit of the sliding speed.

    `limit` is in m/s, and `radius` is the cam's base radius in m. Returns None if every base radius
    exceeds the limit. Returns infinity for a roller, and if no base radius that the follower
    reaches exceeds the limit.
    """
    if case.surfaces.rolls:
        return np.inf
    bound = search_base_radius(
        lambda base: _excess(case, peak_sliding, limit, base, np.inf if base > radius else 0.0),
        radius,
    )
    if bound == 0.0:
        return None
    reaches = bound is not None and measured(case, peak_sliding, bound * 1.001) is not None
    # If the follower does not reach the cam at the bound, the limit is not exceeded before.
    return bound if reaches else np.inf


# Nomogram of the cam handbooks: smallest base radius over the event angle, by law.
#: Names of the laws in the nomogram: every full rise with finite acceleration, without duplicates.
RISES = (
    "simple_harmonic",
    "modified_trapezoid",
    "modified_sine",
    "cycloidal",
    "poly345",
    "poly4567",
    "bezier9",
)

assert set(RISES) <= set(NAMED_RISES)

#: Number of bisections in the search for a radius of the nomogram. The accuracy is about 1e-12 of
#: the lift.
HALVINGS = 48
#: Number of samples of each polynomial piece of a rise in the nomogram. The relative accuracy of a
#: radius is 1e-5.
SAMPLES = 1001


def _scaled_rises(name: str, event: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return samples of s/h, s'/h and s''/h of a rise of lift h, each of shape (m, n).

    ``event`` are m event angles in rad. ``name`` is the law. There are n samples of each rise.
    """
    s, slope, second = _unit(name)
    beta = event[:, None]
    return np.broadcast_to(s, (event.size, s.size)), slope / beta, second / beta**2


@lru_cache(maxsize=len(NAMED_RISES))
def _unit(name: str) -> FloatArray:
    """Return samples of s, s' and s'' of a rise of lift 1 over angle 1, shape (3, n).

    ``name`` is that of the law. The dwells before and after the rise are included. At a joint
    between two polynomial pieces the values of both sides are included.
    """
    breaks, columns = unit_rise(name)
    ordinates, spans = join_pieces(columns), np.diff(breaks)
    u = np.linspace(0.0, 1.0, SAMPLES)
    rows = []
    for _ in range(3):
        rows.append(bernstein.evaluate(ordinates, u).ravel())
        ordinates = bernstein.derivative(ordinates) / spans
    dwells = np.array([[0.0, 1.0], [0.0, 0.0], [0.0, 0.0]])
    return np.concatenate([dwells, np.stack(rows)], axis=1)


def by_pressure_angle(name: str, event: FloatArray, most: float) -> FloatArray:
    """Return the smallest prime radius over the lift h for a pressure angle, ``(m,)``.

    The follower is a roller or point. The prime radius R_p is base radius plus roller radius. It
    follows from tan α = s' / (R_p + s) with the largest pressure angle ``most`` = α in rad.
    ``event`` are m event angles in rad.
    """
    s, slope, _ = _scaled_rises(name, event)
    return np.asarray((np.abs(slope) / np.tan(most) - s).max(axis=1))


def by_face(name: str, event: FloatArray) -> FloatArray:
    """Return the smallest (R_b − ρ_min) / h of a flat follower, ``(m,)``.

    There is one value per event angle (rad). ρ_min is the required radius of curvature. The value
    follows from ρ = R_b + s + s'' (eq. 2.42).
    """
    s, _, second = _scaled_rises(name, event)
    least = np.maximum(-(s + second).min(axis=1), 0.0)
    return np.asarray(least + 0.0)  # no negative zero


def by_curvature(name: str, event: FloatArray, radius: float) -> FloatArray:
    """Return the smallest prime radius over h for a limit of the curvature, ``(m,)``.

    The prime radius is base radius plus roller radius. ``event`` are m event angles in rad.
    ``radius`` is the smallest allowed radius of curvature of the pitch curve, relative to h: the
    roller radius plus the smallest radius of curvature of the contour. The result follows from eq.
    2.46 with the eccentricity ε = 0.
    """
    s, slope, second = _scaled_rises(name, event)

    def too_sharp(prime: FloatArray) -> FloatArray:
        high = prime[:, None] + s
        square = high**2 + slope**2
        curvature_term = square + slope**2 - high * second
        return np.asarray((radius * curvature_term > square**1.5).any(axis=1))

    # In a dwell, the radius of curvature of the pitch curve is the prime radius itself.
    low = np.full(event.shape, radius)
    high = low + 1.0
    while (rejected := too_sharp(high)).any():
        high = np.where(rejected, 2.0 * high, high)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        rejected = too_sharp(middle)
        low, high = np.where(rejected, middle, low), np.where(rejected, high, middle)
    return high
