"""Jump speeds: the lowest, proved on both sides, and what they must not depend on."""

from dataclasses import asdict, replace

import numpy as np
import pytest

import cam_rig
from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.free_masses import contact_response
from cam_rig.dynamics.jump.any_follower import described, find_jump, follower_of
from cam_rig.dynamics.jump.rigid_mass import rigid_jump, rigid_jump_speed, rigid_min_force
from cam_rig.dynamics.jump.two_masses import find_jump_speed
from cam_rig.errors import ConfigError, DynamicsError
from cam_rig.laws import Law, build_law
from cam_rig.laws.law import extremes, peak
from cam_rig.units import RPM, TURN
from examples.paper.refit import Numbers, refitted

from ...conftest import rise
from ..helpers import lift_off, with_joints


def leaves(law, parameters, speed, duration):
    """Whether the exact model leaves the cam."""
    start = np.zeros(2)
    if duration is None:
        start = contact_response(law, parameters, speed).periodic()
    return lift_off(law, parameters, speed, start, duration or TURN / speed) is not None


@pytest.mark.parametrize("cam", ["bezier15", "poly345", "cycloidal"])
@pytest.mark.parametrize("duration", [1.7, None])
def test_jump_speed_is_the_exact_models(laws, two_mass, cam, duration):
    """The exact model stays on 0.005 rpm below and leaves 0.005 rpm above, at the told time."""
    law = laws[cam]
    found = find_jump(law, two_mass, duration)
    assert not leaves(law, two_mass, found.speed - 0.005 * RPM, duration)
    assert leaves(law, two_mass, found.speed + 0.005 * RPM, duration)
    turned = found.speed * found.time % (2.0 * np.pi)
    assert found.angle == pytest.approx(turned, rel=1e-4)


@pytest.mark.parametrize("slowest", [1.0, 249.0, 340.0])
def test_a_resonance_that_only_just_lifts(cams, two_mass, slowest):
    """A dip of the least force of a tenth of a newton is found from wherever the search begins."""
    # The force falls below zero between the points of its grid in time, and over 0.4 rpm alone.
    numbers = Numbers(2.0524121, 1433596.1, 0.3233099, 31.3206927)
    laws, follower = refitted({"poly345": cams["poly345"]}, two_mass, numbers)
    found = find_jump_speed(laws["poly345"], follower, 1.7, slowest)
    assert found / RPM == pytest.approx(348.55, abs=0.01)
    assert leaves(laws["poly345"], follower, 348.7 * RPM, 1.7)
    assert not leaves(laws["poly345"], follower, 349.1 * RPM, 1.7)
    assert not leaves(laws["poly345"], follower, 348.4 * RPM, 1.7)


def test_a_resonance_narrower_than_a_millionth(laws, two_mass):
    """With next to no damping the jump speed is that of the first resonance that throws off.

    The follower leaves in a band of a millionth of the speed, and next only far above it.
    """
    law, slack = laws["poly345"], replace(two_mass, stem_damping=0.003, damping=0.003)
    found = find_jump(law, slack, None).speed
    assert not leaves(law, slack, found * (1.0 - 1e-8), None)
    assert leaves(law, slack, found * (1.0 + 1e-8), None)
    assert not leaves(law, slack, found * 1.0001, None)


@pytest.mark.parametrize(
    ("changes", "duration", "words"),
    [
        ({"preload": 0.0}, 1.7, r"loses contact at 1 rpm already; allowed .* preload"),
        ({"stem_damping": 0.0, "damping": 0.0}, None, r"no steady state: .* allowed: damping, or"),
        ({"preload": 1e9}, None, "keeps contact up to 100000 rpm"),
    ],
)
def test_no_jump_speed(laws, two_mass, changes, duration, words):
    """A loose follower, a stem that rings for ever, and a preload that no lift overcomes."""
    with pytest.raises(DynamicsError, match=words):
        find_jump(laws["poly345"], replace(two_mass, **changes), duration)


# -- many rigs at once: each row is that rig's alone, and one without an answer harms no other


#: Rigs of a test.
COUNT = 12


@pytest.fixture(params=["paper_table2", "tm21"])
def shipped(request):
    """Two masses, and one."""
    return cam_rig.load_rig(request.param)


def test_a_row_is_the_rig_alone(laws, shipped):
    """Speed, angle and time of a random spring, preload, mass and damping: the same bits."""
    rng, law = np.random.default_rng(5), laws["poly345"]
    numbers = {
        "mass": rng.uniform(0.5, 2.0, COUNT),
        "spring_stiffness": rng.uniform(2e3, 8e3, COUNT),
        "damping": rng.uniform(1.0, 20.0, COUNT),
        "preload": rng.uniform(10.0, 60.0, COUNT),
    }
    found = cam_rig.jump_speed(law, shipped, duration=0.5, **numbers)
    for i, row in enumerate(found.rows):
        one = {name: float(values[i]) for name, values in numbers.items()}
        alone = cam_rig.jump_speed(law, shipped.with_follower(**one), duration=0.5)
        assert {name: getattr(row, name) for name in one} == one
        assert (row.rpm, row.angle, row.time) == (alone.rpm, alone.angle, alone.time)
    half = {name: values[: COUNT // 2] for name, values in numbers.items()}
    assert cam_rig.jump_speed(law, shipped, duration=0.5, **half).rows == found.rows[: COUNT // 2]


def test_a_rig_without_an_answer_says_why(laws, shipped):
    """A negative preload and NaN among others: rows with a reason."""
    preload = np.array([30.0, -1.0, np.nan, 30.0])
    found = cam_rig.jump_speed(laws["poly345"], shipped, preload=preload)
    first, *others, last = found.rows
    assert (first.rpm, first.reason) == (last.rpm, "")
    assert all(np.isnan(row.rpm) and "preload" in row.reason for row in others)
    assert found.rpm[0] == cam_rig.jump_speed(laws["poly345"], shipped, preload=30.0).rpm[0]


def test_arrays_go_together(laws, shipped):
    """Of one length each, or one number for all."""
    law = laws["poly345"]
    assert len(cam_rig.jump_speed(law, shipped, mass=1.0, preload=np.full(3, 30.0)).rows) == 3
    with pytest.raises(ConfigError, match="mass 2, preload 3 numbers; allowed: as many each"):
        cam_rig.jump_speed(law, shipped, mass=np.ones(2), preload=np.full(3, 30.0))
    words = r"preload: is an array of shape .*; allowed: a number, or several on one axis"
    with pytest.raises(ConfigError, match=words):
        cam_rig.jump_speed(law, shipped, preload=np.ones((2, 2)))


# -- the rigid jump speed against a closed form and against the rigid model's own loss of contact


def test_eccentric(make_cam, follower):
    """s = h/2 (1 − cos θ) without damping: the top lets go at Ω² = (k h + preload)/(m h/2)."""
    cam = make_cam(rise(180, 1, "simple_harmonic"), rise(180, 0, "simple_harmonic"))
    free = replace(follower, damping=0.0)
    expected = np.sqrt((free.spring_stiffness * 0.05 + free.preload) / (free.mass * 0.025))
    assert rigid_jump_speed(build_law(cam), free) == pytest.approx(expected, rel=1e-9)


def test_the_follower_is_the_rigs():
    """Two masses where a rig splits its mass, one where it does not; half a split is refused."""
    split, whole = cam_rig.load_rig("paper_table2"), cam_rig.load_rig("tm21")
    assert described(follower_of(split)) == "two masses"
    assert described(follower_of(whole)) == "one rigid mass"
    half = whole.with_follower(roller_share=0.4)
    with pytest.raises(ConfigError, match=r"follower\.stem_damping: is missing"):
        follower_of(half)


def damped(stem_stiffness, share, ratio):
    """The rig of Table 2 on another stem, of a damping ratio."""
    numbers = {"roller_share": share, "stem_stiffness": stem_stiffness, "damping": 0.0}
    whole = TwoMassParameters.from_rig(cam_rig.load_rig("paper_table2").with_follower(**numbers))
    return replace(whole, stem_damping=2.0 * ratio * (whole.stiffness * whole.end_mass) ** 0.5)


@pytest.mark.parametrize(
    ("stiffness", "share", "ratio"), [(1e5, 0.4, 3.0), (1e6, 0.05, 2.0), (1e12, 0.4, 10.0)]
)
def test_an_overdamped_stem(laws, stiffness, share, ratio):
    """The least force of the settled turn, by its harmonics, is 0."""
    law, p, count = laws["poly345"], damped(stiffness, share, ratio), 1 << 16
    lift = np.fft.rfft(law.motion_at(np.arange(count) * (TURN / count))[0])
    found = find_jump(law, p, None).speed
    least = []
    for speed in (found * 0.9999, found * 1.0001):
        z = 1j * speed * np.arange(lift.size)
        end = p.spring_stiffness + p.damping * z + p.end_mass * z**2
        stem = p.stem_stiffness + p.stem_damping * z
        force = np.fft.irfft((p.roller_mass * z**2 + stem * end / (stem + end)) * lift, count)
        least.append(force.min() + p.share * p.preload)
    assert least[0] > 0.0 > least[1]


def test_a_search_names_the_damping_that_is_in_its_way(laws):
    """Five times critical, on a law of high degree."""
    words = r"is damped 5 times critical, .*allowed.* less damping"
    with pytest.raises(DynamicsError, match=words):
        find_jump_speed(laws["modified_sine"], damped(1.26e6, 0.4, 5.0), None, 300.0)


@pytest.mark.parametrize("cam", ["poly345", "trigonometric", "tm21"])
def test_a_follower_without_preload(laws, follower, cam):
    """What the least preload leads to: on a dwell it rests with no force, and is not thrown off."""
    law, free = laws[cam], replace(follower, preload=0.0)
    found = find_jump(law, free, None)
    assert found.speed == pytest.approx(rigid_jump(law, replace(free, preload=1e-9))[0], rel=1e-9)
    rig = cam_rig.load_rig("tm21").with_follower(**asdict(free))
    parts = [cam_rig.simulate(law, rig, rpm=found.rpm * part).events for part in (0.99, 1.01)]
    assert [len(events) > 0 for events in parts] == [False, True]
    with pytest.raises(DynamicsError, match="loses contact at 1 rpm already"):
        find_jump(law, replace(free, damping=100.0 * follower.damping + 1e3), None)


def test_a_law_below_zero_falls_away_from_its_follower(laws, follower):
    """Where spring and preload do not reach, contact is lost at any speed."""
    law = laws["poly345"]
    below = Law("below", law.breaks, law.ordinates - 0.5 * peak(law, 0).value)
    assert rigid_jump(below, replace(follower, preload=0.0)) == (0.0, extremes(below, 0)[0].angle)
    reached = follower.spring_stiffness * peak(law, 0).value
    assert rigid_jump(below, replace(follower, preload=reached))[0] > 0.0


# Laws of many pieces: as the same law in few, and as exhaustive searches.


@pytest.mark.variants(3)
@pytest.mark.parametrize("seed", range(6))
def test_rigid_jump_is_the_exhaustive_one(laws, follower, seed):
    """A million points of a turn, and a parabola through the lowest three: 1e-10 of the speed."""
    rng = np.random.default_rng(seed)
    law = laws[("poly345", "tm21", "bezier15", "cycloidal", "trigonometric", "measured")[seed]]
    if seed % 2:
        law = with_joints(law, *rng.uniform(0.0, TURN, int(rng.integers(1, 400))))
    mass = replace(follower, damping=rng.uniform(0.0, 60.0), preload=rng.uniform(1.0, 200.0))
    angles = np.linspace(0.0, TURN, 1_000_001)
    speeds = first_zeros(law, mass, angles)
    at = int(np.argmin(speeds))
    low, least, high = (speeds[(at + i) % (angles.size - 1)] for i in (-1, 0, 1))
    bend, slope = low - 2.0 * least + high, 0.5 * (high - low)
    if abs(slope) < bend:  # else the lowest is at a joint where s'' falls
        least -= 0.5 * slope**2 / bend
    speed, angle = rigid_jump(law, mass)
    assert speed == pytest.approx(least, rel=1e-10 if abs(slope) < bend else 1e-5)
    assert first_zeros(law, mass, np.array([angle]))[0] >= speed * (1.0 - 1e-12)
    below, above = rigid_min_force(law, mass, speed * np.array([0.99, 1.01]))
    assert below > 0.0 > above


def first_zeros(law, mass, angles):
    """The least Ω > 0 with m s'' Ω² + c s' Ω + k s + F₀ = 0, infinite where there is none."""
    s, slope, bend = law.motion_at(angles)
    a, b, c = mass.mass * bend, mass.damping * slope, mass.spring_stiffness * s + mass.preload
    with np.errstate(all="ignore"):
        roots = 2.0 * c / (-b + np.array([[1.0], [-1.0]]) * np.sqrt(b**2 - 4.0 * a * c))
    return np.where(np.isfinite(roots) & (roots > 0.0), roots, np.inf).min(axis=0)


@pytest.mark.parametrize("duration", [1.7, None])
@pytest.mark.parametrize("rig", ["paper_table2", "tm21"])
def test_a_cam_of_dwells_keeps_contact(rig, duration):
    """Its law has degree 0; the preload is the force of one mass or two, at any speed."""
    flat = Law("flat", np.array([0.0, TURN]), np.zeros((1, 1)))
    with pytest.raises(DynamicsError, match="'flat': the follower keeps contact up to 100000 rpm"):
        find_jump(flat, follower_of(cam_rig.load_rig(rig)), duration)
