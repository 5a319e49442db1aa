"""Polynomials from boundary conditions, and the worked example with its printed numbers."""

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from cam_rig.errors import LawError
from cam_rig.laws import bernstein, build_law
from cam_rig.laws.segments import polynomial_through

INCH = 0.0254


def test_six_conditions_at_rest_are_the_345():
    """Level, velocity and acceleration at both ends: 10u³ − 15u⁴ + 6u⁵, exactly."""
    ordinates = polynomial_through([0, 0, 0, 1, 1, 1], [0, 1, 2, 0, 1, 2], [0, 0, 0, 1, 0, 0])
    np.testing.assert_array_equal(ordinates, [0, 0, 0, 1, 1, 1])


@pytest.mark.parametrize("seed", range(5))
def test_meets_its_conditions(seed):
    """Values, slopes and curvatures at random places: all met, of degree m − 1."""
    rng = np.random.default_rng(seed)
    places = np.sort(rng.uniform(size=4))
    u = np.repeat(places, 3)
    order = [0, 1, 2] * 4
    value = rng.normal(size=12)
    ordinates = polynomial_through(u.tolist(), order, value.tolist())
    assert ordinates.size == 12
    for at, r, wanted in zip(u, order, value, strict=True):
        derived = ordinates
        for _ in range(r):
            derived = bernstein.derivative(derived)
        found = bernstein.evaluate(derived, np.array([at]))[0]
        assert found == pytest.approx(wanted, abs=1e-13 * np.abs(derived).max())


def test_a_lone_high_derivative_is_a_condition():
    """Lacunary conditions that fix the polynomial are as good as any: s(0), s''(½), s(1)."""
    ordinates = polynomial_through([0.0, 0.5, 1.0], [0, 2, 0], [0.0, -2.0, 0.0])
    np.testing.assert_allclose(ordinates, [0.0, 0.5, 0.0], rtol=0, atol=1e-16)  # u − u²


@pytest.mark.parametrize(
    ("u", "order"),
    [([0.0, 0.5, 1.0], [0, 1, 0]), ([0.0, 1.0], [1, 1])],
    ids=["slope in the middle of a parabola", "no level at all"],
)
def test_conditions_that_fix_nothing_are_refused(u, order):
    """A singular set names its places and orders."""
    with pytest.raises(LawError, match="no single polynomial of degree") as caught:
        polynomial_through(u, order, [0.0] * len(u))
    assert f"({u[0]:g}, {order[0]})" in str(caught.value)


def test_refusal_names_the_cam(make_cam):
    """In a cam the error says which."""
    segment = {"law": "polynomial", "span": 360, "at": [0, 360], "order": [1, 1], "value": [0, 0]}
    with pytest.raises(LawError, match="cam 'made': no single polynomial"):
        build_law(make_cam(segment))


def test_worked_example_quintic_has_the_printed_coefficients(laws):
    """In x = θ/β from 1 to 2, in inches: a..f = −31, 120, −180, 130, −45, 6."""
    law = laws["worked_example_quintic"]
    x = 1.0 + np.linspace(0.0, 1.0, 6)
    at = np.radians(90.0) * x
    inches = np.append(law(at[:-1]), law.ordinates[-1, 1]) / INCH
    # six values fix the quintic; the powers of x are found by exact interpolation
    coefficients = Polynomial.fit(x, inches, 5, domain=[-1, 1], window=[-1, 1]).coef
    np.testing.assert_allclose(coefficients, [-31, 120, -180, 130, -45, 6], rtol=1e-9)


QUINTIC = Polynomial([-31, 120, -180, 130, -45, 6])
BETA, OMEGA = np.pi / 2, 2.0 * np.pi
SCHEMES = {
    "constant_velocity": lambda x: [x - 1, 1 / BETA + 0 * x, 0 * x, 0 * x],
    # printed: S = (1 − cos πθ/β)/2 and so on with θ counted from the start of the rise
    "harmonic": lambda x: [
        0.5 * (1 - np.cos(np.pi * (x - 1))),
        np.pi / (2 * BETA) * np.sin(np.pi * (x - 1)),
        np.pi**2 / (2 * BETA**2) * np.cos(np.pi * (x - 1)),
        -(np.pi**3) / (2 * BETA**3) * np.sin(np.pi * (x - 1)),
    ],
    "quintic": lambda x: [QUINTIC.deriv(r)(x) / BETA**r for r in range(4)],
}


@pytest.mark.parametrize("scheme", SCHEMES)
def test_worked_example_is_its_formulas(laws, cams, scheme):
    """S, V, A, J of the rise in inches and rad; lift 1 in at the edge, 0.0254 m inside."""
    name = f"worked_example_{scheme}"
    assert (cams[name].lift.raw, cams[name].lift.unit) == (1, "in")
    assert laws[name].lift == pytest.approx(INCH, rel=1e-15)
    x = np.linspace(1.0, 2.0, 41)[1:-1]
    for order, expected in enumerate(SCHEMES[scheme](x)):
        found = laws[name](BETA * x, order) / INCH
        np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-11)


def test_worked_example_in_time(laws):
    """At ω = 2π rad/s constant velocity is ω/β = 4 in/s, from 0.25 to 0.5 s."""
    time = np.linspace(0.25, 0.5, 11)[:-1]
    velocity = laws["worked_example_constant_velocity"](OMEGA * time, 1) * OMEGA / INCH
    np.testing.assert_allclose(velocity, 4.0, rtol=1e-14)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_worked_example_rests_and_falls(laws, scheme):
    """Dwells at 0 and 1 in; the fall ends at 0."""
    law = laws[f"worked_example_{scheme}"]
    degrees = np.array([0, 45, 89, 180, 225, 270])
    np.testing.assert_allclose(
        law(np.radians(degrees)) / INCH, [0, 0, 0, 1, 1, 1], rtol=0, atol=1e-15
    )
    assert law.largest_step < 1e-15
