"""What cam and follower are where they touch: width, material, and what they bear."""

from __future__ import annotations

from typing import Annotated

from cam_rig.schema.quantity import Quantity, Strict, must_be

Width = Annotated[Quantity, must_be("length", above=0.0, least=1e-6, most=10.0)]
Modulus = Annotated[Quantity, must_be("pressure", above=0.0, least=1e6, most=1e13)]
#: An incompressible solid has 0.5.
Poisson = Annotated[Quantity, must_be("ratio", least=0.0, most=0.5)]
Pressure = Annotated[Quantity, must_be("pressure", above=0.0, most=1e13)]
Sliding = Annotated[Quantity, must_be("linear speed", above=0.0, most=1e4)]


def _assumed(value: float, unit: str, source: str) -> Quantity:
    return Quantity(assumed=value, unit=unit, source=source)


class ContactParts(Strict):
    """The section ``contact`` of a cam file; every key may be left out.

    ``tip_radius`` is that of a point follower: an actual point would have infinite pressure. The
    follower is of the cam's material where ``follower_youngs_modulus`` and
    ``follower_poisson_ratio`` are not given. ``most_pressure`` and ``most_sliding_speed`` are what
    bounds the base radius from below and from above.
    """

    face_width: Width = _assumed(10.0, "mm", "no source prints it; a narrow cam of a test rig")
    tip_radius: Width = _assumed(1.0, "mm", "no source prints it; a rounded knife edge")
    youngs_modulus: Modulus = _assumed(206.0, "GPa", "steel; no source prints the material")
    poisson_ratio: Poisson = _assumed(0.3, "1", "steel")
    follower_youngs_modulus: Modulus | None = None
    follower_poisson_ratio: Poisson | None = None
    most_pressure: Pressure = _assumed(
        1000.0, "MPa", "free choice: hardened steel; the sources print no permissible pressure"
    )
    most_sliding_speed: Sliding = _assumed(
        2.0, "m/s", "free choice: the sources print no permissible sliding speed"
    )

    @property
    def modulus(self) -> float:
        """Contact modulus E* (Pa) of the pair: 1/E* = (1 − ν₁²)/E₁ + (1 − ν₂²)/E₂."""
        cam = (1.0 - self.poisson_ratio.si**2) / self.youngs_modulus.si
        poisson = self.follower_poisson_ratio or self.poisson_ratio
        young = self.follower_youngs_modulus or self.youngs_modulus
        return 1.0 / (cam + (1.0 - poisson.si**2) / young.si)
