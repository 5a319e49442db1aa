"""Radii that lifts do not determine: the roller radius, or the base radius of a flat follower.

An assumed radius with which the nose would have no radius is replaced. A given one is rejected.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

from cam_rig.errors import ConfigError
from cam_rig.studies.fit_cam.arcs.contour import Arcs

#: Radii that the user has given in addition to the readings, or None if neither is given.
GivenRadii = Literal["base", "roller", "both"] | None
#: Smallest radius of nose and base circle of the cam that an assumed roller radius may leave, as a
#: fraction of the smaller of both radii of the pitch curve. For flat followers it is a fraction of
#: the base radius. A smaller radius would be a cusp, as with a roller radius of half the lift on a
#: cam with a sharp nose.
MIN_RADIUS_LEFT = 0.1
#: An assumed radius that leaves too small a radius of nose or base circle is replaced. This radius
#: then remains, as a fraction of the same radius as in `MIN_RADIUS_LEFT`.
REPLACED_RADIUS_LEFT = 0.5
#: Lower limit of the radius of nose or base, as a fraction of the same radius of the pitch curve.
#: It keeps both radii positive until the given base radius is checked.
MIN_RADIUS_RATIO = 1e-6


class Radii(NamedTuple):
    """Roller radius and base radius in m, each given or a usual assumption.

    ``given`` states which of them are given.
    """

    roller: float
    base: float
    given: GivenRadii

    @property
    def is_base_given(self) -> bool:
        """True if the base radius is given."""
        return self.given in ("base", "both")

    @property
    def is_roller_given(self) -> bool:
        """True if the roller radius is given."""
        return self.given in ("roller", "both")


def contour_of_pitch_curve(
    pitch: Arcs, flat: bool, radii: Radii
) -> tuple[Arcs, float, float | None]:
    """Return the contour of a pitch curve, its roller radius, and a replaced radius.

    Parameters
    ----------
    pitch : Arcs
        Pitch curve: the contour enlarged by the roller radius.
    flat : bool
        True if all followers are flat, so that the lifts do not determine the base radius.
    radii : Radii
        Roller radius and base radius.

    Returns
    -------
    arcs : Arcs
        The contour.
    roller : float
        Its roller radius, m.
    replaced : float or None
        Radius in m that is usually assumed, if it leaves too little radius for nose or base and
        another radius was assumed, else None.
    """
    roller, base, given = radii
    replaced, smallest = None, min(pitch.nose_radius, pitch.base_radius)
    if flat:
        difference = pitch.base_radius - pitch.nose_radius
        if not radii.is_base_given and base - difference < MIN_RADIUS_LEFT * base:
            replaced, base = base, float(f"{difference / (1.0 - REPLACED_RADIUS_LEFT):.2g}")
        return pitch.offset(base - pitch.base_radius), roller, replaced
    if given == "base":
        # After the fit, `require_roller` rejects a base radius that leaves no roller or no nose.
        roller = min(max(pitch.base_radius - base, 0.0), (1.0 - MIN_RADIUS_RATIO) * smallest)
    elif given is None and smallest - roller < MIN_RADIUS_LEFT * smallest:
        replaced, roller = roller, float(f"{REPLACED_RADIUS_LEFT * smallest:.2g}")
    return pitch.offset(-roller), roller, replaced


def require_roller(base: float, pitch: Arcs, interval: str) -> None:
    """Raise ConfigError if a base radius (m) leaves no radius for roller or nose.

    ``pitch`` is the pitch curve (path of the roller centre). ``interval`` is the 95 % interval of
    its base radius as text.
    """
    prime, nose = pitch.base_radius, pitch.nose_radius
    together = f"{prime * 1e3:.4g} mm ({interval} with 95 %)"
    if base >= prime:
        raise ConfigError(
            f"--base-radius: is {base * 1e3:g} mm; allowed: below base and roller radius "
            f"together, {together}, or with --roller-radius"
        )
    if prime - base >= nose:
        raise ConfigError(
            f"--base-radius: is {base * 1e3:g} mm, which leaves a roller of "
            f"{(prime - base) * 1e3:.4g} mm of {together}; allowed: above "
            f"{(prime - nose) * 1e3:.4g} mm, because nose and roller radius are together "
            f"{nose * 1e3:.4g} mm, or with --roller-radius"
        )
