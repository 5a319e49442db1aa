"""Where a polynomial falls below zero: against a fine scan; and the forms it is written in."""

import numpy as np
import pytest

from cam_rig.dynamics.events import polynomials
from cam_rig.dynamics.events.polynomials import NONE, fall
from cam_rig.laws import bernstein


@pytest.mark.variants(8)
@pytest.mark.parametrize("seed", range(40))
def test_a_fall_is_the_first(seed):
    """Of a polynomial, against a fine scan; one that stays above has none."""
    rng = np.random.default_rng(seed)
    degree = int(rng.integers(2, 25))
    ordinates = rng.standard_normal(degree + 1) * 3.0 + 1.0
    ordinates[0] = abs(ordinates[0])
    u = np.linspace(0.0, 1.0, 20_001)
    values, found = bernstein.evaluate(ordinates, u), fall(ordinates.tolist(), 1e-12)
    below = np.flatnonzero(values < 0.0)
    if below.size == 0:
        assert found == NONE or abs(values).min() < 1e-6
    else:
        assert u[below[0] - 1] - 1e-12 <= found <= u[below[0]]
        assert abs(bernstein.scalar(ordinates)(found)) < 1e-12


def test_a_fall_from_within_noise():
    """Where it begins within rounding of zero it falls at once, or after it was above."""
    assert fall([-1e-13, -1.0], 1e-12) == 0.0
    assert fall([-1.0, 1.0], 1e-12) == 0.0
    rising = fall([-1e-13, 1.0, -1.0], 1e-12)
    assert rising == pytest.approx(2.0 / 3.0, abs=1e-6)
    assert fall([-1e-13, -1e-13, 1.0], 1e-12) == NONE
    assert fall([0.0, 0.0, 0.0], 0.0) == NONE


def test_a_touch_is_no_fall():
    """(u − 1/2)² touches zero, and stays above; a hair lower it falls, and rises again."""
    touching = [0.25, -0.25, 0.25]
    assert fall(touching, 1e-15) == NONE
    lowered = [x - 1e-12 for x in touching]
    assert fall(lowered, 1e-15) == pytest.approx(0.5 - 1e-6, abs=1e-9)


def test_a_root_next_to_zero_keeps_its_digits():
    """U of 1e-12 is found to its own last digits: a hop of nanometres has no other length."""
    for root in (1e-3, 1e-9, 1e-15):
        ordinates = bernstein.elevate(np.array([root, root - 1.0]), 26).tolist()
        assert polynomials.only_root(ordinates) == pytest.approx(root, rel=1e-14)


@pytest.mark.parametrize("seed", range(10))
def test_the_forms_are_those_of_the_laws(seed):
    """A restriction, an elevation, an integral and a value, as `bernstein` has them."""
    rng = np.random.default_rng(seed)
    size = int(rng.integers(2, 40))
    row, (first, last) = rng.standard_normal(size), np.sort(rng.uniform(0.0, 1.0, 2))
    ends = float(first), float(last)
    plain = row.tolist()
    near = pytest.approx
    assert polynomials.restricted(plain, size, *ends) == near(
        bernstein.restrict(row, *ends), abs=1e-13
    )
    assert polynomials.elevated(plain, 45) == near(bernstein.elevate(row, 44), abs=1e-13)
    whole = 0.3 * bernstein.antiderivative(row) + 0.7
    assert polynomials.integrated(plain, 0.3, 0.7) == near(whole, abs=1e-13)
    value = float(bernstein.evaluate(row, np.array([first]))[0])
    assert polynomials.value_at(plain, size, float(first)) == near(value, abs=1e-13)
