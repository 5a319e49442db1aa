"""The ring reads the cam angle, the arrow turns with the cam, the body fills its outline."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from cam_rig.profile import contours
from cam_rig.schema import CamConfig
from cam_rig.show.looks import NUMBER, body, closed, ring_numbers, rotation, turned


def test_the_cams_own_zero_points_to_its_angle() -> None:
    """What is up at cam angle 0 stands at the number of the angle, for every number."""
    places, words = ring_numbers(10.0)
    for place, word in zip(places, words, strict=True):
        up = turned(np.array([[0.0, 10.0 * NUMBER]]), np.radians(float(word)))
        np.testing.assert_allclose(up[0], place, atol=1e-12)


def test_the_arrow_turns_as_the_cam() -> None:
    """Counterclockwise, and its tip is its head's."""
    arc, head = rotation(1.0)
    x, y = arc.T
    assert np.all(x[:-1] * y[1:] - y[:-1] * x[1:] > 0.0)
    np.testing.assert_array_equal(head[1], arc[-1])


@pytest.mark.parametrize("name", ["poly345", "tm21", "flat", "arcs_convex", "oscillating_roller"])
def test_a_body_fills_its_outline(name: str, cams: dict[str, CamConfig], laws: dict) -> None:  # type: ignore[type-arg]
    """Every point of a fine net within the contour is under a strip, and no strip reaches out of
    it by more than a fiftieth of its radius."""
    contour = contours(cams[name].follower, laws[name], 360)[0].points.T
    outline = closed(contour)
    strips, half = body(outline)
    share = np.linspace(0.0, 1.0, 50)[:, None]
    lines = np.concatenate([a + share * (b - a) for s in strips for a, b in pairwise(s)])
    for part in np.linspace(0.02, 0.96, 40):
        away = (part * outline[::30])[:, None] - lines
        assert np.hypot(away[..., 0], away[..., 1]).min(axis=1).max() < half
    angle = np.arctan2(*contour.T[::-1])
    order = np.argsort(angle)
    radius = np.interp(
        np.arctan2(*strips[-1].T[::-1]), angle[order], np.hypot(*contour.T)[order], period=2 * np.pi
    )
    assert (np.hypot(*strips[-1].T) + half - radius).max() < 0.02 * radius.max()
