"""Load, pressure and sliding of cam and follower over the turn.

The force along the guide, or along the arc of the arm, is that of a rigid follower in contact. By
virtual work N v·n = F ṡ it presses along the common normal: N = F / cos α in a guide. Friction is
left out. Where the cam would have to pull there is no contact and no pressure.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.contact_force import force_weights
from cam_rig.errors import ProfileError
from cam_rig.laws import Law
from cam_rig.profile import discs
from cam_rig.profile.checks.all_checks import require_profile
from cam_rig.profile.contact import Element, Touch
from cam_rig.profile.extremes import Scan
from cam_rig.profile.motion import Motion
from cam_rig.schema import CamConfig
from cam_rig.schema.contact_parts import ContactParts
from cam_rig.schema.follower import Follower, OscillatingPoint, Point
from cam_rig.studies.contact.hertz import half_width, peak_pressure


@dataclass(frozen=True)
class Surfaces:
    """One cam under its follower at one speed; arrays have the shape of the motion.

    Parameters
    ----------
    element : what touches the cam
    radius : m, of the follower's surface: a roller's, a point's tip, infinite for a face
    rolls : whether it is a roller, which turns instead of sliding
    parts : width and material
    rig : the follower's mechanics
    speed : rad/s
    """

    element: Element
    radius: float
    rolls: bool
    parts: ContactParts
    rig: FollowerParameters
    speed: float

    def normal_force(self, motion: Motion, touch: Touch) -> FloatArray:
        """N along the common normal (N); 0 where the cam would have to pull."""
        row = np.stack([motion.s, motion.slope, motion.bend])
        force = np.tensordot(force_weights(self.rig, self.speed), row, axes=1) + self.rig.preload
        lever = (self.element.moves(touch.contact) * touch.normal.conj()).real
        with np.errstate(divide="ignore"):  # a face that the cam touches at its pivot
            held = np.where(lever > 0.0, np.asarray(force) / lever, np.inf)
        return np.maximum(held, 0.0)

    def curvature(self, touch: Touch) -> FloatArray:
        """κ = 1/ρ + 1/R of the pair (1/m); infinite where they do not fit or the cam is undercut.

        Concave parts of the cam have a negative ρ and press less.
        """
        with np.errstate(divide="ignore"):
            found = 1.0 / touch.radius + 1.0 / self.radius
        fits = (found > 0.0) & (touch.rate > 0.0)
        return np.where(fits, found, np.inf)

    def pressure(self, motion: Motion, touch: Touch) -> FloatArray:
        """Largest Hertz pressure p₀ (Pa); infinite where they do not fit, loaded or not."""
        load, curvature = self.normal_force(motion, touch), self.curvature(touch)
        with np.errstate(invalid="ignore"):  # no load on what does not fit
            found = peak_pressure(load / self.parts.face_width.si, curvature, self.parts.modulus)
        return np.where(np.isinf(curvature), np.inf, found)

    def width(self, motion: Motion, touch: Touch) -> FloatArray:
        """Width 2b of the contact (m)."""
        load = self.normal_force(motion, touch) / self.parts.face_width.si
        return 2.0 * half_width(load, self.curvature(touch), self.parts.modulus)

    def sliding(self, motion: Motion, touch: Touch) -> FloatArray:
        """Speed (m/s) of the cam's surface along the follower's.

        A roller that turns freely takes it as the speed of its rim, and only slides if it jams.
        """
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


def surfaces_of(
    follower: Follower, element: Element, parts: ContactParts, rig: FollowerParameters, speed: float
) -> Surfaces:
    """The surfaces of a follower that a spring alone holds on its cam; ``speed`` in rad/s."""
    radius = np.inf
    if follower.roller > 0.0:
        radius = follower.roller
    elif isinstance(follower, Point | OscillatingPoint):
        radius = parts.tip_radius.si
    return Surfaces(element, radius, follower.roller > 0.0, parts, rig, speed)


def contact_case(cam: CamConfig, law: Law, rig: FollowerParameters, speed: float) -> ContactCase:
    """A cam whose contact can be asked for; ``speed`` in rad/s.

    Raises
    ------
    ProfileError, ReachError : a cam that cannot exist, or a tip wider than a hollow of it
    """
    require_profile(cam, law)
    element = discs(cam.follower, law)[0].element
    found = ContactCase(cam, law, surfaces_of(cam.follower, element, cam.parts, rig, speed))
    hollow = found.scan.greatest(lambda touch: -1.0 / touch.radius)
    if hollow.value * found.surfaces.radius >= 1.0:
        raise ProfileError(
            f"cam {cam.name!r}: contact.tip_radius is {found.surfaces.radius * 1e3:.5g} mm; "
            f"allowed: less than the cam's concave radius of curvature, {1e3 / hollow.value:.5g} mm"
            f" at {np.degrees(hollow.angle):.4g}°"
        )
    return found
