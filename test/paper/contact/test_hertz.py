"""Hertz's line contact: elasticity in 50 digits, and the constants that handbooks print."""

import mpmath as mp
import numpy as np
import pytest

from cam_rig.paper.contact.surfaces import half_width
from cam_rig.paper.contact.surfaces import hertz_pressure as peak_pressure
from cam_rig.schema.cam import ContactParts

#: Load (N/m), radii (m; negative: concave), E* (Pa).
CASES = [(1.0e5, 0.020, 0.040, 113e9), (2.3e4, 0.010, -0.055, 113e9), (7.7e5, 0.150, np.inf, 60e9)]


@pytest.mark.parametrize(("load", "one", "other", "modulus"), CASES)
def test_the_pressure_is_that_of_elasticity(load, one, other, modulus):
    """The semi-ellipse carries the load, and bends both surfaces until their gap is closed.

    u'(x) = −2/(π E*) ∮ p(ξ)/(x − ξ) dξ = −x κ, the principal value with x = b sin φ, ξ = b sin t.
    """
    curvature = 1.0 / one + 1.0 / other
    peak = mp.mpf(float(peak_pressure(load, curvature, modulus)))
    half = mp.mpf(float(half_width(load, curvature, modulus)))
    with mp.workdps(50):
        carried = mp.quad(lambda t: peak * half * mp.cos(t) ** 2, [-mp.pi / 2, mp.pi / 2])
        assert abs(carried / load - 1) < 1e-14
        for at in (mp.mpf("0.3"), mp.mpf("-0.8")):
            # p(ξ)/(x − ξ) less p(x)/(x − ξ), whose principal value is known, has no pole.
            here = mp.sqrt(1 - at**2)
            smooth = mp.quad(
                lambda z, at=at, here=here: (mp.sqrt(1 - z**2) - here) / (at - z), [-1, at, 1]
            )
            principal = smooth + here * mp.log((1 + at) / (1 - at))
            slope = 2 / (mp.pi * mp.mpf(modulus)) * peak * principal
            assert abs(slope / (at * half * mp.mpf(curvature)) - 1) < 1e-14


def test_the_constants_of_the_handbook():
    """Roark's Formulas for Stress and Strain, two cylinders, with its printed constants.

    σ = 0.798 √(p / (K_D C_E)), b = 1.60 √(p K_D C_E) for the whole width; for equal materials with
    ν = 0.3 σ = 0.591 √(p E / K_D), b = 2.15 √(p K_D / E). K_D = D₁ D₂ / (D₁ + D₂).
    """
    load, one, other, young = 87_500.0, 0.30, 0.12, 207e9  # N/m, diameters in m, Pa
    together = one * other / (one + other)
    curvature = 2.0 / one + 2.0 / other
    modulus = young / (2.0 * (1.0 - 0.3**2))
    peak = float(peak_pressure(load, curvature, modulus))
    width = 2.0 * float(half_width(load, curvature, modulus))
    assert peak == pytest.approx(0.798 * (load * modulus / together) ** 0.5, rel=5e-4)
    assert width == pytest.approx(1.60 * (load * together / modulus) ** 0.5, rel=5e-3)
    assert peak == pytest.approx(0.591 * (load * young / together) ** 0.5, rel=1e-3)
    assert width == pytest.approx(2.15 * (load * together / young) ** 0.5, rel=3e-3)


def test_modulus_of_a_pair():
    """The follower is of the cam's material unless it says; a rigid one halves the compliance."""
    steel = {"youngs_modulus": {"assumed": 206, "unit": "GPa"}}
    parts = ContactParts.model_validate(steel)
    assert parts.modulus == pytest.approx(206e9 / (2 * 0.91), rel=1e-15)
    stiff = ContactParts.model_validate(
        steel | {"follower_youngs_modulus": {"assumed": 1e13, "unit": "Pa"}}
    )
    assert stiff.modulus == pytest.approx(206e9 / 0.91 / (1 + 206e9 / 1e13), rel=1e-15)
