"""Load, pressure and sliding of cam and follower over the turn.

The force along the guide, or along the arc of the arm, is that of a rigid follower in contact. By
virtual work N v·n = F ṡ it presses along the common normal: N = F / cos α in a guide. Friction is
left out. Where the cam would have to pull there is no contact and no pressure.
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
from cam_rig.laws.bernstein import joined
from cam_rig.laws.segments import NAMED_RISES, unit_rise
from cam_rig.profile import discs
from cam_rig.profile.cam_checks import greatest_allowed, require_profile
from cam_rig.profile.checks import least_base, least_base_radius, plates_on
from cam_rig.profile.contact import Element, Motion, Scan, Touch
from cam_rig.schema import CamConfig
from cam_rig.schema.cam import ContactParts, OscillatingPoint, Point
from cam_rig.units import FloatArray

# Hertz's line contact: two cylinders with parallel axes, pressed together without friction.


def hertz_pressure(load: FloatArray, curvature: FloatArray, modulus: float) -> FloatArray:
    """Largest pressure p₀ (Pa), in the middle of the contact: √(F' E* κ / π).

    F' in N/m is the force over the face width, κ = 1/R₁ + 1/R₂ with a negative radius where it is
    concave, E* in Pa: 1/E* = (1 − ν₁²)/E₁ + (1 − ν₂²)/E₂.
    """
    return np.sqrt(load * modulus * curvature / np.pi)


def half_width(load: FloatArray, curvature: FloatArray, modulus: float) -> FloatArray:
    """Half the width of the contact b (m): √(4 F' / (π E* κ))."""
    return np.sqrt(4.0 * load / (np.pi * modulus * curvature))


@dataclass(frozen=True)
class Surfaces:
    """One cam under its follower at one speed (rad/s); arrays have the shape of the motion.

    ``radius`` (m) is of the follower's surface: a roller's, which ``rolls`` instead of sliding, a
    point's tip, infinite for a face.
    """

    element: Element
    radius: float
    rolls: bool
    parts: ContactParts
    rig: FollowerParameters
    speed: float

    def normal_force(self, motion: Motion, touch: Touch) -> FloatArray:
        """N along the common normal (N); 0 where the cam would have to pull."""
        row = np.stack([motion.s, motion.slope, motion.curvature])
        force = np.tensordot(force_weights(self.rig, self.speed), row, axes=1) + self.rig.preload
        lever = (self.element.moves(touch.contact) * touch.normal.conj()).real
        with np.errstate(divide="ignore"):  # a face that the cam touches at its pivot
            held = np.where(lever > 0.0, np.asarray(force) / lever, np.inf)
        return np.maximum(held, 0.0)

    def curvature(self, touch: Touch) -> FloatArray:
        """κ = 1/ρ + 1/R of the pair; infinite where they do not fit or the cam is undercut."""
        with np.errstate(divide="ignore"):
            found = 1.0 / touch.radius + 1.0 / self.radius
        fits = (found > 0.0) & (touch.rate > 0.0)
        return np.where(fits, found, np.inf)

    def pressure(self, motion: Motion, touch: Touch) -> FloatArray:
        """Largest Hertz pressure p₀ (Pa); infinite where they do not fit, loaded or not."""
        load, curvature = self.normal_force(motion, touch), self.curvature(touch)
        with np.errstate(invalid="ignore"):  # no load on what does not fit
            found = hertz_pressure(load / self.parts.face_width.si, curvature, self.parts.modulus)
        return np.where(np.isinf(curvature), np.inf, found)

    def width(self, motion: Motion, touch: Touch) -> FloatArray:
        """Width 2b of the contact (m)."""
        load = self.normal_force(motion, touch) / self.parts.face_width.si
        return 2.0 * half_width(load, self.curvature(touch), self.parts.modulus)

    def sliding(self, motion: Motion, touch: Touch) -> FloatArray:
        """Speed of the cam's surface along the follower's, of a free roller's rim (m/s)."""
        carried = motion.slope * self.element.moves(touch.contact)
        relative = 1j * touch.contact - carried
        return np.abs((relative * touch.normal.conj()).imag) * self.speed


@dataclass(frozen=True, eq=False)
class ContactCase:
    """A cam on a rig at a speed (rad/s), checked: the contact exists all the way round."""

    cam: CamConfig
    law: Law
    surfaces: Surfaces

    @cached_property
    def scan(self) -> Scan:
        """The contact over the whole turn."""
        return Scan(self.law, self.surfaces.element)

    def at(self, angle: FloatArray) -> tuple[Motion, Touch]:
        """Motion and contact at cam angles, rad."""
        motion = Motion.at(self.law, angle)
        return motion, self.surfaces.element.touch(motion)


def contact_case(cam: CamConfig, law: Law, rig: FollowerParameters, speed: float) -> ContactCase:
    """A cam whose contact can be asked for; ``speed`` in rad/s."""
    require_profile(cam, law)
    radius, follower = np.inf, cam.follower
    if follower.roller > 0.0:
        radius = follower.roller
    elif isinstance(follower, Point | OscillatingPoint):
        radius = cam.parts.tip_radius.si
    element, rolls = discs(follower, law)[0].element, follower.roller > 0.0
    found = ContactCase(cam, law, Surfaces(element, radius, rolls, cam.parts, rig, speed))
    hollow = found.scan.greatest(lambda touch: -1.0 / touch.radius)
    if hollow.value * found.surfaces.radius >= 1.0:
        raise ProfileError(
            f"cam {cam.name!r}: contact.tip_radius is {found.surfaces.radius * 1e3:.5g} mm; "
            f"allowed: less than the cam's concave radius of curvature, {1e3 / hollow.value:.5g} mm"
            f" at {np.degrees(hollow.angle):.4g}°"
        )
    return found


# The base radius that a contact asks for, from below and from above.

#: A number of the whole turn, larger than its limit when it is bad.
Measure = Callable[[Surfaces, Scan], float]

#: Lower bounds, those of the thesis first, and what a sentence calls them.
LOWER = {"curvature": "curvature", "pressure": "Hertz pressure", "pressure_angle": "pressure angle"}


@dataclass(frozen=True)
class BaseBounds:
    """Base radii (m) of one cam at one speed; each holds with the cam's other numbers unchanged.

    The least without undercut and sharper parts than asked for, for the most pressure angle and
    Hertz pressure; the greatest for the most sliding speed, infinite for a roller. None where none
    will do, 0 where every one down to a hundredth of the cam's own does.
    """

    curvature: float | None
    pressure_angle: float | None
    pressure: float | None
    sliding: float | None

    @property
    def least(self) -> float | None:
        """The largest of the three lower bounds, None where one cannot be met."""
        lower = [getattr(self, key) for key in LOWER]
        return None if None in lower else max(lower)

    @property
    def governing(self) -> str:
        """Key of the largest lower bound, or of one that no base radius meets; "" for none."""
        lower = {key: getattr(self, key) for key in LOWER}
        worst = max(LOWER, key=lambda key: np.inf if lower[key] is None else lower[key])
        return "" if lower[worst] == 0.0 else worst

    @property
    def feasible(self) -> bool:
        """Whether a base radius meets all of them."""
        return self.least is not None and self.sliding is not None and self.least <= self.sliding


def base_bounds(case: ContactCase) -> BaseBounds:
    """All bounds on the base radius of a cam."""
    follower, limits = case.cam.follower, case.surfaces.parts
    own = follower.base_radius.si

    def steepest(_: Surfaces, scan: Scan) -> float:
        return scan.greatest(lambda touch: np.abs(touch.pressure)).value

    def least(measure: Measure, limit: float) -> float | None:
        return least_base(lambda base: -_excess(case, measure, limit, base, np.inf), own)

    return BaseBounds(
        curvature=least_base_radius(follower, case.law),
        pressure_angle=least(steepest, greatest_allowed(follower, case.surfaces.element)),
        pressure=least(peak_pressure, limits.most_pressure.si),
        sliding=_greatest(case, own, limits.most_sliding_speed.si),
    )


def peak_pressure(surfaces: Surfaces, scan: Scan) -> float:
    """Largest Hertz pressure (Pa) over the turn."""
    return scan.greatest_of(surfaces.pressure).value


def peak_sliding(surfaces: Surfaces, scan: Scan) -> float:
    """Largest sliding speed (m/s) over the turn."""
    return scan.greatest_of(surfaces.sliding).value


def measured(case: ContactCase, measure: Measure, base: float) -> float | None:
    """A measure of the cam on another base radius (m); None where the follower does not reach."""
    plates = plates_on(case.cam.follower, case.law, base)
    if not plates:
        return None
    surfaces = replace(case.surfaces, element=plates[0].element)
    return measure(surfaces, Scan(case.law, surfaces.element))


def _excess(
    case: ContactCase, measure: Measure, limit: float, base: float, missing: float
) -> float:
    """Measure over its limit less 1, within ±1 for the root finder; ``missing`` out of reach."""
    value = measured(case, measure, base)
    return float(np.clip((missing if value is None else value / limit) - 1.0, -1.0, 1.0))


def _greatest(case: ContactCase, own: float, limit: float) -> float | None:
    """Above this base radius (m) the follower slides too fast; None where it does on every one."""
    if case.surfaces.rolls:
        return np.inf
    found = least_base(
        lambda base: _excess(case, peak_sliding, limit, base, np.inf if base > own else 0.0), own
    )
    if found == 0.0:
        return None
    reaches = found is not None and measured(case, peak_sliding, found * 1.001) is not None
    return found if reaches else np.inf  # the follower ends before the bound does


# Least base radius over the event angle, law by law: the nomogram of the cam handbooks.

#: Laws of the diagram: every full rise without an infinite acceleration, each once.
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

#: Halvings of the search for a radius: to 1e-12 of the lift.
HALVINGS = 48
#: Samples of each piece of a rise: a radius comes out to 1e-5 of itself.
SAMPLES = 1001


def _spread(name: str, event: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """S, s', s'' of a rise over its lift at event angles ``(m,)`` in rad, ``(m, n)`` each."""
    s, slope, bend = _unit(name)
    beta = event[:, None]
    return np.broadcast_to(s, (event.size, s.size)), slope / beta, bend / beta**2


@lru_cache(maxsize=len(NAMED_RISES))
def _unit(name: str) -> FloatArray:
    """``(3, n)``: s, s', s'' of the unit rise, joints with both limits, and of the dwells."""
    breaks, columns = unit_rise(name)
    ordinates, spans = joined(columns), np.diff(breaks)
    u = np.linspace(0.0, 1.0, SAMPLES)
    rows = []
    for _ in range(3):
        rows.append(bernstein.evaluate(ordinates, u).ravel())
        ordinates = bernstein.derivative(ordinates) / spans
    rest = np.array([[0.0, 1.0], [0.0, 0.0], [0.0, 0.0]])
    return np.concatenate([rest, np.stack(rows)], axis=1)


def by_pressure_angle(name: str, event: FloatArray, most: float) -> FloatArray:
    """Least prime radius over h of a roller or point: tan α = s' / (R_p + s), α in rad."""
    s, slope, _ = _spread(name, event)
    return np.asarray((np.abs(slope) / np.tan(most) - s).max(axis=1))


def by_face(name: str, event: FloatArray) -> FloatArray:
    """Least (R_b − ρ_min) / h of a flat follower: ρ = R_b + s + s'' (eq. 2.42)."""
    s, _, bend = _spread(name, event)
    least = np.maximum(-(s + bend).min(axis=1), 0.0)
    return np.asarray(least + 0.0)  # no negative zero


def by_curvature(name: str, event: FloatArray, radius: float) -> FloatArray:
    """Least prime radius over h at which the pitch curve is nowhere sharper than ``radius`` (/ h).

    Eq. 2.46 with ε = 0. The radius is the roller's and the least one of the contour together.
    """
    s, slope, bend = _spread(name, event)

    def sharp(prime: FloatArray) -> FloatArray:
        high = prime[:, None] + s
        square = high**2 + slope**2
        bent = square + slope**2 - high * bend
        return np.asarray((radius * bent > square**1.5).any(axis=1))

    low = np.full(event.shape, radius)  # the dwell's circle is as sharp
    high = low + 1.0
    while (still := sharp(high)).any():
        high = np.where(still, 2.0 * high, high)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        bad = sharp(middle)
        low, high = np.where(bad, middle, low), np.where(bad, high, middle)
    return high
