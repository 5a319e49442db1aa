"""Tests of contact load, Hertz pressure and sliding, and of `cam-rig contact`.

The references are closed forms, energy balances and the theory of elasticity.
"""

import json
from dataclasses import replace

import mpmath as mp
import numpy as np
import pytest

from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.kinetostatic import shaft_torque
from cam_rig.errors import ProfileError
from cam_rig.laws import build_law
from cam_rig.laws.segments import up_and_down
from cam_rig.profile.cam_checks import max_pressure_angle
from cam_rig.profile.checks import discs_on, find_min_base_radius
from cam_rig.profile.contact import Motion, Scan
from cam_rig.profile.faces import SwungCentre, SwungFace
from cam_rig.schema import CamConfig, load_cam
from cam_rig.schema.cam import ContactParts
from cam_rig.schema.load import resolve_path
from cam_rig.studies.contact.study import contact_row
from cam_rig.studies.contact.surfaces import (
    RISES,
    base_bounds,
    by_curvature,
    by_face,
    by_pressure_angle,
    contact_case,
    half_width,
    hertz_pressure,
    measured,
    peak_pressure,
    peak_sliding,
)

from ...cli.conftest import done
from ...conftest import assumed

RIG = FollowerParameters(0.9, 3000.0, 6.0, 80.0, 1e7)
SPEED = 21.0
ANGLES = np.random.default_rng(7).uniform(0.0, 2.0 * np.pi, 60)
SPRUNG = (
    *("eccentric_roller", "flat", "inclined_flat", "oscillating_flat"),
    *("oscillating_point", "oscillating_roller", "tm21"),
)


def case_of(name, base=None, **changes):
    """Return the contact of a shipped cam with changed contact numbers or base radius.

    `base` is in mm. Each keyword has a (value, unit) pair.
    """
    data = load_cam(resolve_path("cams", name)).model_dump(exclude_none=True)
    data["contact"] = {key: assumed(*number) for key, number in changes.items()}
    if base is not None:
        data["follower"]["base_radius"] = assumed(base, "mm")
    cam = CamConfig.model_validate(data)
    return contact_case(cam, build_law(cam), RIG, SPEED)


@pytest.mark.parametrize("name", SPRUNG)
def test_the_relative_velocity_is_tangential(name):
    """At the contact, cam and follower have the same velocity along the normal.

    The tolerance is rounding.
    """
    case = case_of(name)
    motion, touch = case.at(ANGLES)
    moved = motion.slope * case.surfaces.element.moves(touch.contact)
    along_normal = ((1j * touch.contact - moved) * touch.normal.conj()).real
    np.testing.assert_allclose(along_normal, 0.0, atol=1e-15 + 1e-14 * np.abs(touch.contact).max())


@pytest.mark.parametrize("name", SPRUNG)
def test_power_in_is_power_out(name):
    """The torque of the normal contact force on the cam equals F s'.

    This is eq. 8 of the paper. This is the balance of power between shaft and follower, to
    rounding.
    """
    case = case_of(name)
    motion, touch = case.at(ANGLES)
    lever = (1j * touch.contact * touch.normal.conj()).real
    torque = case.surfaces.normal_force(motion, touch) * lever
    expected = [shaft_torque(case.law, RIG, angle, SPEED) for angle in ANGLES]
    np.testing.assert_allclose(torque, expected, rtol=1e-12, atol=1e-12)


def on_the_follower(element, motion, contact):
    """Return the contact point, a complex number in m, in the frame of the follower."""
    if isinstance(element, SwungCentre | SwungFace):
        return (contact - element.pivot) * np.exp(1j * element.arm_angle(motion.s))
    return contact - 1j * motion.s


@pytest.mark.parametrize("name", [name for name in SPRUNG if name != "tm21"])
def test_sliding_is_the_difference_of_both_paths(name):
    """The sliding speed is the difference of the contact's speeds on both surfaces.

    The speeds are those at which the contact point moves along cam and follower, differentiated
    numerically (relative 2e-6).
    """
    case, step = case_of(name), 1e-6
    element = case.surfaces.element
    before, middle, after = (
        (motion, element.touch(motion))
        for motion in (Motion.at(case.law, ANGLES + d) for d in (-step, 0.0, step))
    )
    ends = [on_the_follower(element, motion, touch.contact) for motion, touch in (before, after)]
    points = [element.touch(m).contact * np.exp(-1j * m.angle) for m in (before[0], after[0])]
    path_on_cam = np.abs(points[1] - points[0]) / (2 * step)
    moved = (ends[1] - ends[0]) / (2 * step)
    if isinstance(element, SwungCentre | SwungFace):
        moved = moved * np.exp(-1j * element.arm_angle(middle[0].s))
    path_on_follower = (moved * (-1j * middle[1].normal).conj()).real  # clockwise around the cam
    expected = np.abs(path_on_cam - path_on_follower) * SPEED
    np.testing.assert_allclose(case.surfaces.sliding(*middle), expected, rtol=2e-6, atol=1e-6)


def test_a_dwell_is_two_circles():
    """In a dwell the pressure is that of two circles pressed by the preload.

    Their relative curvature is κ = 1/R_b + 1/R_r, of base circle and roller.
    """
    case = case_of("tm21", face_width=(7.0, "mm"))
    follower, modulus = case.cam.follower, 206e9 / (2 * 0.91)
    curvature = 1.0 / follower.base_radius.si + 1.0 / follower.roller
    found = case.surfaces.pressure(*case.at(np.zeros(1)))[0]
    expected = np.sqrt(RIG.preload / 7e-3 * modulus * curvature / np.pi)
    assert found == pytest.approx(expected, rel=1e-12)


def test_a_tip_with_a_radius_above_the_concave_radius_is_refused():
    """A follower tip that is blunter than a concave part of the cam is refused.

    It would touch at two points. The message has the radius, its limit and the cam angle.
    """
    with pytest.raises(ProfileError, match=r"tip_radius must be less than .* mm at \d.*got 90"):
        case_of("oscillating_point", base=20.0, tip_radius=(90.0, "mm"))


@pytest.mark.parametrize("name", SPRUNG)
def test_the_largest_pressure_is_not_exceeded_at_any_sample(name):
    """The reported peak pressure is not exceeded at any of 20 000 angles.

    It is at most 0.1 % above the largest sample, and agrees with the load and the width of the
    contact.
    """
    case = case_of(name)
    row = contact_row(case)
    fine = case.surfaces.pressure(*case.at(np.linspace(0.0, 2.0 * np.pi, 20_000)))
    assert fine.max() <= row.pressure.value * (1 + 1e-12)
    assert fine.max() >= row.pressure.value * (1 - 1e-3)
    mean = row.load / (case.cam.parts.face_width.si * row.width)  # mean of p₀ √(1 − x²/b²): π/4 p₀
    assert mean == pytest.approx(np.pi / 4 * row.pressure.value, rel=1e-5)


def test_no_pressure_where_the_cam_would_have_to_pull():
    """Contact is reported as lost at 200 rad/s, where the cam would have to pull.

    At 5 rad/s it is not.
    """
    cam = load_cam(resolve_path("cams", "poly345"))
    row = contact_row(contact_case(cam, build_law(cam), RIG, 200.0))
    assert row.lost
    assert not contact_row(contact_case(cam, build_law(cam), RIG, 5.0)).lost


# -- the command `cam-rig contact`


def test_tables_json_and_nomogram(tmp_path, monkeypatch):
    """`cam-rig contact` writes tables, JSON and figures with sliding and bounds.

    The table lists the assumed numbers. A roller has no sliding speed.
    """
    monkeypatch.setattr("cam_rig.studies.contact.figures.RADII", 6)
    plot, events, csv = (tmp_path / name for name in ("c.png", "e.svg", "c.csv"))
    files = ("--plot", plot, "--events", events, "--csv", csv)
    result = done("contact", "flat", "poly345", *files, "--json", "-")
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


# -- bounds on the base radius: at the bound the measure equals its limit, and closed forms


@pytest.mark.parametrize("name", ["flat", "inclined_flat", "oscillating_flat", "oscillating_point"])
def test_at_a_bound_the_measure_equals_its_limit(name):
    """At the reported bound of the base radius a measure equals its limit.

    The measures are pressure and sliding speed. The limits are random numbers near the cam's
    values. The tolerance of the sliding speed is a relative 1e-9. The pressure is checked at 0.999
    and 1.001 of the bound.
    """
    rng = np.random.default_rng(11)
    case = case_of(name)
    radius = case.cam.follower.base_radius.si
    pressure, sliding = (measured(case, m, radius) for m in (peak_pressure, peak_sliding))
    limits = {
        "most_pressure": (pressure * rng.uniform(1.02, 1.3), "Pa"),
        "most_sliding_speed": (sliding * rng.uniform(0.85, 1.2), "m/s"),
    }
    bounds = base_bounds(case_of(name, **limits))
    found, least = measured(case, peak_sliding, bounds.sliding), bounds.pressure
    assert found == pytest.approx(limits["most_sliding_speed"][0], rel=1e-9)
    assert least < radius
    if measured(case, peak_pressure, least) is not None:
        low, high = (measured(case, peak_pressure, least * f) for f in (0.999, 1.001))
        assert high < limits["most_pressure"][0]
        assert low is None or low > limits["most_pressure"][0]


def test_pressure_of_a_still_face_in_closed_form():
    """A flat face under its preload alone has a closed-form smallest base radius.

    The radius of curvature is then F' E* / (π p²), with the load F' per width, the effective
    modulus E* and the pressure limit p (relative tolerance 1e-7).
    """
    case = case_of("flat", most_pressure=(60.0, "MPa"))
    weightless = replace(RIG, mass=1e-12, spring_stiffness=1e-9, damping=0.0)
    case = replace(case, surfaces=replace(case.surfaces, rig=weightless))
    least = RIG.preload / 0.01 * case.cam.parts.modulus / (np.pi * 60e6**2)
    angle = np.linspace(0.0, 2.0 * np.pi, 200_001)
    expected = least - (case.law(angle) + case.law(angle, 2)).min()
    assert base_bounds(case).pressure == pytest.approx(expected, rel=1e-7)


def test_a_limit_that_no_base_radius_satisfies():
    """The bound on the base radius is None if no base radius satisfies the limit.

    The sliding bound of a roller, which rolls, is infinite.
    """
    roller = base_bounds(case_of("tm21", most_pressure=(10.0, "MPa")))
    assert (roller.pressure, roller.sliding) == (None, np.inf)
    bounds = base_bounds(case_of("flat", most_sliding_speed=(1e-3, "m/s")))
    assert bounds.sliding is None
    assert not bounds.feasible


@pytest.mark.parametrize("seed", range(14))
def test_the_least_base_radius_satisfies_all_limits(seed):
    """At the reported smallest base radius, every measure is within its limit.

    The measures are pressure, pressure angle and undercut. Followers, rigs and limits are random.
    """
    rng = np.random.default_rng(seed)
    name = SPRUNG[seed % len(SPRUNG)]
    case = case_of(name, most_pressure=(10.0 ** rng.uniform(2.0, 3.2), "MPa"))
    rig = replace(RIG, mass=10.0 ** rng.uniform(-1.0, 1.0), preload=10.0 ** rng.uniform(1.0, 2.5))
    case = replace(case, surfaces=replace(case.surfaces, rig=rig))
    bounds, limit = base_bounds(case), case.surfaces.parts.most_pressure.si
    if bounds.least is None:
        assert bounds.governing
        return
    base = max(1.001 * bounds.least, 0.01 * case.cam.follower.base_radius.si)
    assert measured(case, peak_pressure, base) <= limit * (1 + 1e-9)
    scan = Scan(case.law, discs_on(case.cam.follower, case.law, base)[0].element)
    steepest = scan.greatest(lambda touch: np.abs(touch.pressure)).value
    limit_angle = max_pressure_angle(case.cam.follower, scan.element)
    assert steepest <= limit_angle * (1 + 1e-9)
    assert scan.greatest(lambda touch: -touch.rate).value < 0.0  # not undercut


EVENT = np.radians([47.0, 83.0, 121.0])


def test_simple_harmonic_in_closed_form():
    """The smallest base radii of simple harmonic rises equal their closed forms.

    Roller: h/2 (√(1 + (π/(β tan α))²) − 1). Flat face: h (π²/(2 β²) − 1), at least 0. h is the
    lift, β the angle of the rise and α the pressure angle.
    """
    found = by_pressure_angle("simple_harmonic", EVENT, 0.5)
    expected = 0.5 * (np.sqrt(1.0 + (np.pi / (EVENT * np.tan(0.5))) ** 2) - 1.0)
    np.testing.assert_allclose(found, expected, rtol=1e-5)
    expected = np.maximum(0.5 * (np.pi / EVENT) ** 2 - 1.0, 0.0)
    np.testing.assert_allclose(by_face("simple_harmonic", EVENT), expected, rtol=1e-12)


@pytest.mark.parametrize("rise", RISES)
def test_the_nomogram_agrees_with_the_checks_of_cams(rise, cams, make_cam):
    """The base radii of the nomogram equal those that the contour checks find.

    The nomogram shows the smallest radii over the span for unit lift, the checks use a cam with
    this rise (relative 1e-5).
    """
    beta, law = np.radians([52.0]), up_and_down(rise, np.radians(52.0), 0.01)
    flat = cams["flat"].follower
    least = find_min_base_radius(flat, law) - flat.least_curvature_radius.si
    assert by_face(rise, beta)[0] * 0.01 == pytest.approx(least, rel=1e-5)
    roller = make_cam({"law": "dwell", "span": 360.0}, roller_radius=0.02).follower
    least = find_min_base_radius(roller, law)
    assert by_curvature(rise, beta, 2.0)[0] * 0.01 - 0.02 == pytest.approx(least, rel=1e-5)


# -- Hertz's line contact: theory of elasticity in 50 digits, and constants from handbooks


#: Cases: load (N/m), radius of curvature of each body (m, negative if concave), effective modulus
#: (Pa).
CASES = [(1.0e5, 0.020, 0.040, 113e9), (2.3e4, 0.010, -0.055, 113e9), (7.7e5, 0.150, np.inf, 60e9)]


@pytest.mark.parametrize(("load", "first", "second", "modulus"), CASES)
def test_the_pressure_satisfies_the_theory_of_elasticity(load, first, second, modulus):
    """The contact pressure satisfies the theory of elasticity in 50 digits.

    Its integral is the load, and its deformation closes the gap between the bodies: u'(x) = −2/(π
    E*) ∮ p(ξ)/(x − ξ) dξ = −x κ. The integral is a principal value, with x = b sin φ and ξ = b sin
    t.
    """
    curvature = 1.0 / first + 1.0 / second
    peak = mp.mpf(float(hertz_pressure(load, curvature, modulus)))
    half = mp.mpf(float(half_width(load, curvature, modulus)))
    with mp.workdps(50):
        carried = mp.quad(lambda t: peak * half * mp.cos(t) ** 2, [-mp.pi / 2, mp.pi / 2])
        assert abs(carried / load - 1) < 1e-14
        for x in (mp.mpf("0.3"), mp.mpf("-0.8")):
            # The difference of p(ξ)/(x − ξ) and p(x)/(x − ξ) is finite. The second has a known
            # principal value.
            y = mp.sqrt(1 - x**2)
            smooth = mp.quad(lambda z, x=x, y=y: (mp.sqrt(1 - z**2) - y) / (x - z), [-1, x, 1])
            principal = smooth + y * mp.log((1 + x) / (1 - x))
            slope = 2 / (mp.pi * mp.mpf(modulus)) * peak * principal
            assert abs(slope / (x * half * mp.mpf(curvature)) - 1) < 1e-14


def test_modulus_of_a_pair():
    """The effective modulus combines the materials of cam and follower.

    The follower has the cam's material by default.
    """
    steel = {"youngs_modulus": assumed(206, "GPa")}
    parts = ContactParts.model_validate(steel)
    assert parts.modulus == pytest.approx(206e9 / (2 * 0.91), rel=1e-15)
    rigid = {"follower_youngs_modulus": assumed(1e13, "Pa")}
    stiff = ContactParts.model_validate(steel | rigid)
    assert stiff.modulus == pytest.approx(206e9 / 0.91 / (1 + 206e9 / 1e13), rel=1e-15)
