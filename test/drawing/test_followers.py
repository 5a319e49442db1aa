"""Where a follower touches its cam: instant centres against contours and envelopes."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cam_rig.arrays import FloatArray
from cam_rig.drawing.follower import FollowerShape
from cam_rig.drawing.followers import follower_shape
from cam_rig.drawing.outlines import turned
from cam_rig.laws import Law, build_law
from cam_rig.profile import contours_at, turn_angles
from cam_rig.schema.load import config_root, load_cam
from cam_rig.schema.quantity import Quantity

BASE, ROLLER, LIFT = 0.065, 0.010, 0.05
ANGLES = turn_angles(720)


def metres(value: float) -> Quantity:
    return Quantity(assumed=value, unit="m")


def make(law: Law, kind: str, **sizes: float) -> FollowerShape:
    """A follower of any kind, whether or not the cam file knows it yet."""
    fields: dict[str, Any] = {key: metres(value) for key, value in sizes.items()}
    if "inclination" in sizes:
        fields["inclination"] = Quantity(assumed=sizes["inclination"], unit="rad")
    roller = sizes.get("roller_radius", 0.0)
    config = SimpleNamespace(type=kind, base_radius=metres(BASE), roller=roller, **fields)
    return follower_shape(SimpleNamespace(follower=config), law)  # type: ignore[arg-type]


KINDS = {
    "point": {},
    "roller": {"roller_radius": ROLLER},
    "roller beside": {"roller_radius": ROLLER, "eccentricity": 0.015},
    "flat": {},
    "inclined_flat": {"inclination": 0.2, "eccentricity": 0.01},
    "oscillating_point": {"pivot_distance": 0.16, "arm": 0.14},
    "oscillating_roller": {"pivot_distance": 0.16, "arm": 0.14, "roller_radius": ROLLER},
    "oscillating_flat": {"pivot_distance": 0.2, "arm": 0.2, "face_offset": 0.01},
}


@pytest.fixture(scope="module")
def smooth(laws: dict[str, Law]) -> Law:
    return laws["poly345"]


@pytest.fixture(scope="module", params=KINDS)
def shape(request: pytest.FixtureRequest, smooth: Law) -> FollowerShape:
    return make(smooth, request.param.split()[0], **KINDS[request.param])


@pytest.mark.parametrize(
    "name",
    [
        "poly345",
        "eccentric_roller",
        "flat",
        "inclined_flat",
        "oscillating_point",
        "oscillating_roller",
        "oscillating_flat",
    ],
)
def test_contact_is_on_the_contour(name: str) -> None:
    """Contact by instant centre is the point of the cam's contour by its own formula, turned."""
    cam = load_cam(config_root() / "cams" / f"{name}.yaml")
    law = build_law(cam)
    angles = ANGLES + 1e-3  # beside the joints, where a limit is taken
    points, _ = follower_shape(cam, law).contact(law(angles), law(angles, 1))
    outline = contours_at(cam.follower, law, angles)[0].points.T
    expected = np.stack([turned(p[None], a)[0] for p, a in zip(outline, angles, strict=True)])
    np.testing.assert_allclose(np.hypot(*points.T), np.hypot(*expected.T), rtol=1e-12)
    turn = np.angle((points @ [1.0, 1j]) / (expected @ [1.0, 1j]))
    np.testing.assert_allclose(turn, turn[0], rtol=0, atol=1e-12)


def test_the_contact_rolls_off_the_cam_without_a_gap(shape: FollowerShape, smooth: Law) -> None:
    """The path of contact in the cam's frame is the cam: its tangent is square to the normal."""
    points, normals = shape.contact(smooth(ANGLES), smooth(ANGLES, 1))
    back = [turned(p[None], -a)[0] for p, a in zip(points, ANGLES, strict=True)]
    square = [turned(n[None], -a)[0] for n, a in zip(normals, ANGLES, strict=True)]
    along = np.gradient(np.array(back), axis=0)
    along /= np.hypot(*along.T)[:, None]
    across = np.abs(np.sum(along * np.array(square), axis=1))[2:-2]
    assert np.quantile(across, 0.95) < 0.01


def test_at_rest_the_follower_touches_the_base_circle(shape: FollowerShape) -> None:
    """At no lift and no slope the contact is one base radius from the cam's axis."""
    points, normals = shape.contact(np.zeros(1), np.zeros(1))
    np.testing.assert_allclose(np.hypot(*points[0]), BASE, rtol=1e-12)
    np.testing.assert_allclose(np.hypot(*normals[0]), 1.0, rtol=1e-12)
    assert points[0, 1] > 0.0


def test_the_place_moves_by_the_lift(shape: FollowerShape) -> None:
    """A small rise moves the place by itself, the way `upward` says."""
    lift, rise = np.array([0.3 * LIFT]), np.array([1e-7])
    moved = shape.place(lift + rise) - shape.place(lift)
    offset = 0.01 if shape.face and shape.config.type.startswith("osc") else 0.0
    np.testing.assert_allclose(moved / 1e-7, shape.upward(lift), atol=1e-6 + 1.1 * offset / 0.2)


def test_a_carried_point_keeps_its_place_on_the_follower(shape: FollowerShape) -> None:
    """Carrying is a rigid motion: the place itself goes where the follower's place is."""
    start, end = np.array([0.1 * LIFT]), np.array([0.6 * LIFT])
    carried = shape.carried(shape.place(start), start, end)
    np.testing.assert_allclose(carried, shape.place(end), atol=1e-15)


def test_every_kind_can_be_drawn(shape: FollowerShape) -> None:
    """Finite strips of points, and a reach around them."""
    strips: list[FloatArray] = [*shape.outline(), *shape.support()]
    assert all(strip.ndim == 2 and np.isfinite(strip).all() for strip in strips)
    assert BASE < shape.reach < 10.0 * BASE


@pytest.mark.parametrize("name", ["tm21", "poly345", "eccentric_roller", "flat"])
def test_what_the_stem_carries_stays_below_its_bearing(name: str) -> None:
    """At the highest lift and a tenth more, as in flight; the stem is in it at rest."""
    cam = load_cam(config_root() / "cams" / f"{name}.yaml")
    shape = follower_shape(cam, build_law(cam))
    low = min(strip[:, 1].min() for strip in shape.support())
    high = max(strip[:, 1].max() for strip in shape.support())
    head, stem = shape.outline()[0], shape.outline()[-1]
    highest, rest = (
        shape.place(np.array([lift]))[0, 1] for lift in (1.1 * shape.greatest_lift, 0.0)
    )
    assert head[:, 1].max() + highest < low
    assert stem[:, 1].max() + rest > high
