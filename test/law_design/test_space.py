"""The laws of a class: smooth, resting where the start rests, and linear in their unknowns."""

from __future__ import annotations

import numpy as np
import pytest

from cam_rig.errors import ConfigError
from cam_rig.law_design.request import LawClass
from cam_rig.law_design.space import Space, dwells
from cam_rig.laws import Law, build_law
from cam_rig.schema import load_cam
from cam_rig.schema.load import config_root

RNG = np.random.default_rng(11)


def shipped(name: str) -> Law:
    return build_law(load_cam(config_root() / "cams" / f"{name}.yaml"))


@pytest.mark.parametrize(
    ("cam", "law_class"),
    [
        ("poly345", LawClass(16, 3)),
        ("poly345", LawClass(5, 1)),
        ("poly345", LawClass(3, 2, 9)),
        ("cycloidal", LawClass(7, 4)),
        ("bezier15", LawClass(1, 3, 15)),
        ("b_spline", LawClass(4, 2)),
    ],
)
def test_a_law_of_any_unknowns_is_smooth_and_has_the_starts_ends(
    cam: str, law_class: LawClass
) -> None:
    """Derivatives up to C are continuous around the turn, so zero at the ends of dwells."""
    start = shipped(cam)
    space = Space(start, law_class)
    unknowns = space.joined(RNG.uniform(-0.5, 1.5, law_class.free * len(space.events)))
    law = space.law(unknowns, "any")
    for order in range(law_class.joints + 1):
        ordinates = law.derivative_ordinates(order)
        apart = np.abs(ordinates[0] - np.roll(ordinates[-1], 1)).max()
        assert apart <= 1e-8 * np.abs(ordinates).max()
    for begin, end in dwells(start):
        angle = np.linspace(begin, end, 7)[1:-1]
        np.testing.assert_allclose(law(angle), start(angle), atol=1e-15)


@pytest.mark.parametrize("order", range(5))
def test_the_derivatives_in_the_unknowns_are_the_laws(order: int) -> None:
    """Ordinates of s'' come from unknowns of their own, those of s from others: one law."""
    space = Space(shipped("poly345"), LawClass(9, 3))
    unknowns = space.joined(RNG.uniform(0.0, 1.0, 2 * space.law_class.free))
    law, angle = space.law(unknowns, "any"), RNG.uniform(0.0, 2.0 * np.pi, 200)
    found = space.at(order, angle)(unknowns)
    scale = np.abs(law(angle, order)).max()
    np.testing.assert_allclose(found, law(angle, order), atol=1e-9 * scale)


def test_the_hull_holds_the_curve_and_shrinks_to_it() -> None:
    """Ordinates of cut pieces bound the polynomial, nearer with more parts."""
    space = Space(shipped("poly345"), LawClass(6, 3))
    unknowns = space.joined(RNG.uniform(0.0, 1.0, 2 * space.law_class.free))
    values = space.at(2, np.linspace(0.0, 2.0 * np.pi, 5001))(unknowns)
    reach = []
    for parts in (1, 4, 16):
        hull = space.hull(space.derivative(2), parts)(unknowns)
        assert hull.min() <= values.min() + 1e-12
        assert hull.max() >= values.max() - 1e-12
        reach.append(np.ptp(hull) - np.ptp(values))
    assert reach[0] > 4.0 * reach[1] > 16.0 * reach[2] > 0.0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"pieces": 0}, "pieces is 0; allowed: 1 to 200"),
        ({"pieces": 201}, "pieces is 201"),
        ({"joints": 0}, "joints is 0; allowed: 1 to 6"),
        ({"joints": 3, "degree": 3}, "allowed: a degree above 3"),
        ({"degree": 16}, "degree is 16; allowed: 2 to 15"),
        ({"pieces": 1}, "so more pieces or a higher degree"),
        ({"pieces": 200, "degree": 9}, "so fewer pieces"),
    ],
)
def test_a_class_that_is_none_is_refused(arguments: dict[str, int], words: str) -> None:
    """The message names the number, its limits and what to change."""
    with pytest.raises(ConfigError, match=words):
        LawClass(**arguments)


def test_a_cam_that_rests_all_around_has_nothing_to_design() -> None:
    """A circle has no event."""
    circle = Law("circle", np.array([0.0, 2.0 * np.pi]), np.zeros((2, 1)))
    with pytest.raises(ConfigError, match="it rests all around"):
        Space(circle, LawClass())
