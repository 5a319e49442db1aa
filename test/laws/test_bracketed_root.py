"""The root between two signs: that of scipy's Brent, bit by bit."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from cam_rig.laws import bernstein
from cam_rig.laws.bernstein import bracketed_root


def rising(number):
    """Polynomials with one root in (0, 1), of every degree and size, some roots beside an end."""
    chance = np.random.default_rng(1)
    for _ in range(number):
        steps = chance.exponential(size=chance.integers(2, 17)) ** 3
        ordinates = np.cumsum(steps) * 10.0 ** chance.integers(-12, 3)
        zero = chance.random() ** chance.integers(1, 9)
        yield ordinates - ordinates[0] - zero * (ordinates[-1] - ordinates[0])


def test_the_bits_are_those_of_brent():
    """On polynomials as the rig has them."""
    found = 0
    for ordinates in rising(2000):
        if ordinates[0] * ordinates[-1] < 0.0:
            function = bernstein.scalar(ordinates)
            wanted = brentq(function, 0.0, 1.0, xtol=1e-300, rtol=2.0**-50, maxiter=2000)
            assert bracketed_root(function, 0.0, 1.0) == wanted
            found += 1
    assert found > 1900


@pytest.mark.parametrize(
    ("function", "root"),
    [
        (lambda x: x**3 - 8.0, 2.0),
        (lambda x: math.copysign(1.0, x - 1e-200), 1e-200),
        (lambda x: x - 5.0, 5.0),
        (lambda x: x + 5.0, -5.0),
    ],
)
def test_steps_flat_places_and_ends(function, root):
    """A jump beside 0 takes as many halvings as a float has; an end may be the root."""
    assert bracketed_root(function, -5.0, 5.0) == pytest.approx(root, rel=1e-14, abs=0.0)


def test_what_has_no_root_is_refused():
    """With both ends and the values there."""
    with pytest.raises(ValueError, match=r"no change of sign between 0 \(1\) and 2 \(5\)"):
        bracketed_root(lambda x: x * x + 1.0, 0.0, 2.0)
