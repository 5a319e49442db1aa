"""Load, pressure and sliding: exact for circles and faces, by energy for all; cam-rig contact."""

import json
from functools import partial

import numpy as np
import pytest

from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.kinetostatic import shaft_torque
from cam_rig.errors import ProfileError
from cam_rig.laws import build_law
from cam_rig.paper.contact.comparison import contact_row
from cam_rig.paper.contact.surfaces import contact_case
from cam_rig.profile.contact import Motion
from cam_rig.profile.faces import SwungCentre, SwungFace
from cam_rig.schema import CamConfig, load_cam
from cam_rig.schema.load import named_path

from ...cli.conftest import call as run

RIG = FollowerParameters(
    mass=0.9, spring_stiffness=3000.0, damping=6.0, preload=80.0, stem_stiffness=1e7
)
SPEED = 21.0
ANGLES = np.random.default_rng(7).uniform(0.0, 2.0 * np.pi, 60)
SPRUNG = (
    "eccentric_roller",
    "flat",
    "inclined_flat",
    "oscillating_flat",
    "oscillating_point",
    "oscillating_roller",
    "tm21",
)


def case_of(name, base=None, **changes):
    """A shipped cam on the rig, with another section ``contact``, or on another base (mm)."""
    data = load_cam(named_path("cams", name)).model_dump(exclude_none=True)
    data["contact"] = {key: {"assumed": v, "unit": unit} for key, (v, unit) in changes.items()}
    if base is not None:
        data["follower"]["base_radius"] = {"assumed": base, "unit": "mm"}
    cam = CamConfig.model_validate(data)
    return contact_case(cam, build_law(cam), RIG, SPEED)


@pytest.mark.parametrize("name", SPRUNG)
def test_the_surfaces_do_not_part_nor_enter(name):
    """Along the normal both move alike; all the relative velocity is sliding."""
    case = case_of(name)
    motion, touch = case.at(ANGLES)
    moved = motion.slope * case.surfaces.element.moves(touch.contact)
    along_normal = ((1j * touch.contact - moved) * touch.normal.conj()).real
    np.testing.assert_allclose(along_normal, 0.0, atol=1e-15 + 1e-14 * np.abs(touch.contact).max())


@pytest.mark.parametrize("name", SPRUNG)
def test_power_in_is_power_out(name):
    """The normal force turns the cam back with the torque F s' of eq. 8."""
    case = case_of(name)
    motion, touch = case.at(ANGLES)
    lever = (1j * touch.contact * touch.normal.conj()).real
    torque = case.surfaces.normal_force(motion, touch) * lever
    expected = [shaft_torque(case.law, RIG, angle, SPEED) for angle in ANGLES]
    np.testing.assert_allclose(torque, expected, rtol=1e-12, atol=1e-12)


def on_the_follower(element, motion, contact):
    """The point of contact as the follower carries it along."""
    if isinstance(element, SwungCentre | SwungFace):
        return (contact - element.pivot) * np.exp(1j * element.arm_angle(motion.s))
    return contact - 1j * motion.s


@pytest.mark.parametrize("name", [name for name in SPRUNG if name != "tm21"])
def test_sliding_is_the_difference_of_both_ways(name):
    """The contact's way along the cam less its way along the follower, by differences."""
    case, step = case_of(name), 1e-6
    element = case.surfaces.element
    before, middle, after = (
        (motion, element.touch(motion))
        for motion in (Motion.at(case.law, ANGLES + d) for d in (-step, 0.0, step))
    )
    ends = [on_the_follower(element, motion, touch.contact) for motion, touch in (before, after)]
    ways = [element.touch(m).contact * np.exp(-1j * m.angle) for m in (before[0], after[0])]
    way_on_cam = np.abs(ways[1] - ways[0]) / (2 * step)
    moved = (ends[1] - ends[0]) / (2 * step)
    if isinstance(element, SwungCentre | SwungFace):
        moved = moved * np.exp(-1j * element.arm_angle(middle[0].s))
    way_on_follower = (moved * (-1j * middle[1].normal).conj()).real  # clockwise around the cam
    expected = np.abs(way_on_cam - way_on_follower) * SPEED
    np.testing.assert_allclose(case.surfaces.sliding(*middle), expected, rtol=2e-6, atol=1e-6)


def test_a_dwell_is_two_circles():
    """On the base circle: F₀ over the width, κ = 1/R_b + 1/R_r, no pressure angle."""
    case = case_of("tm21", face_width=(7.0, "mm"))
    follower, modulus = case.cam.follower, 206e9 / (2 * 0.91)
    curvature = 1.0 / follower.base_radius.si + 1.0 / follower.roller
    found = case.surfaces.pressure(*case.at(np.zeros(1)))[0]
    expected = np.sqrt(RIG.preload / 7e-3 * modulus * curvature / np.pi)
    assert found == pytest.approx(expected, rel=1e-12)


def test_a_sharper_tip_presses_harder_without_bound():
    """Pressure over the tip's radius goes as 1/√R: an actual point has infinite pressure."""
    at = np.array([0.1])
    coarse, fine = (
        case.surfaces.pressure(*case.at(at))[0]
        for case in (case_of("oscillating_point", tip_radius=(r, "mm")) for r in (1e-1, 1e-3))
    )
    assert fine / coarse == pytest.approx(10.0, rel=2e-3)


def test_a_tip_wider_than_a_hollow_is_refused():
    """It would touch at two places: radius, limit and angle are named."""
    with pytest.raises(ProfileError, match=r"tip_radius is 90 mm; allowed: less than .* mm at \d"):
        case_of("oscillating_point", base=20.0, tip_radius=(90.0, "mm"))


@pytest.mark.parametrize("name", SPRUNG)
def test_the_largest_pressure_is_no_sample(name):
    """None of 20,000 angles has more, both sides of each joint; load and width give the same."""
    case = case_of(name)
    row = contact_row(case)
    fine = case.surfaces.pressure(*case.at(np.linspace(0.0, 2.0 * np.pi, 20_000)))
    assert fine.max() <= row.pressure.value * (1 + 1e-12)
    assert fine.max() >= row.pressure.value * (1 - 1e-3)
    mean = row.load / (case.cam.parts.face_width.si * row.width)  # of p₀ √(1 − x²/b²): π/4 p₀
    assert mean == pytest.approx(np.pi / 4 * row.pressure.value, rel=1e-5)


def test_no_pressure_where_the_cam_would_have_to_pull():
    """Above the jump speed contact is lost, and said to be."""
    cam = load_cam(named_path("cams", "poly345"))
    row = contact_row(contact_case(cam, build_law(cam), RIG, 200.0))
    assert row.lost
    assert not contact_row(contact_case(cam, build_law(cam), RIG, 5.0)).lost


# The command.


call = partial(run, "contact")


def test_tables_json_and_nomogram(tmp_path, monkeypatch):
    """A face slides, a roller rolls; the nomogram's table comes with its figure; origins of all."""
    monkeypatch.setattr("cam_rig.paper.contact.figures.RADII", 6)
    plot, events, csv = (tmp_path / name for name in ("c.png", "e.svg", "c.csv"))
    files = ("--plot", plot, "--events", events, "--csv", csv)
    result = call("flat", "poly345", *files, "--json", "-")
    assert result.exit_code == 0, result.stderr
    for word in ("face_width", "youngs_modulus", "assumed", "most_sliding_speed"):
        assert word in result.stderr
    assert b"</svg>" in events.read_bytes()
    assert "120°" in result.stderr
    face = (tmp_path / "c.face_radii.csv").read_text(encoding="utf-8")
    assert face.startswith("rise,event_60,")
    data = json.loads(result.stdout[result.stdout.index("{") :])
    flat, roller = data["contact"]
    assert flat["sliding_speed"] == pytest.approx(0.047 * 300 * np.pi / 30)
    assert roller["sliding_speed"] is None
    flat, roller = data["bounds"]
    assert roller["sliding"] is None
    assert flat["sliding"] > flat["pressure"]
    assert data["run"] == {"rig": "paper_table2", "rpm": 300.0}
