"""Jump speeds against the exact model, closed forms and exhaustive searches.

The jump speed is the lowest speed at which the follower loses contact with the cam.
"""

from dataclasses import asdict, replace

import numpy as np
import pytest

import cam_rig
from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.free_masses import contact_response
from cam_rig.dynamics.jump.any_follower import describe_follower, find_jump, follower_of
from cam_rig.dynamics.jump.rigid_mass import rigid_jump, rigid_min_force
from cam_rig.dynamics.jump.two_masses import find_jump_speed
from cam_rig.errors import ConfigError, DynamicsError
from cam_rig.laws import Law
from cam_rig.laws.law import extremes, peak
from cam_rig.units import RPM, TURN
from examples.paper.refit import Numbers, refitted

from ..helpers import lift_off, with_joints


def loses_contact(law, parameters, speed, duration):
    """Return True if the exact simulation loses contact at this cam speed (rad/s).

    The run starts from rest and takes `duration` s. With the duration None it is one turn of the
    steady state.
    """
    start = np.zeros(2)
    if duration is None:
        start = contact_response(law, parameters, speed).periodic()
    return lift_off(law, parameters, speed, start, duration or TURN / speed) is not None


@pytest.mark.parametrize("cam", ["bezier15", "poly345", "cycloidal"])
@pytest.mark.parametrize("duration", [1.7, None])
def test_jump_speed_is_that_of_the_exact_model(laws, two_mass, cam, duration):
    """The exact simulation keeps contact 0.005 rpm below the computed jump speed.

    It loses contact 0.005 rpm above it, at the computed angle and time.
    """
    law = laws[cam]
    jump = find_jump(law, two_mass, duration)
    assert not loses_contact(law, two_mass, jump.speed - 0.005 * RPM, duration)
    assert loses_contact(law, two_mass, jump.speed + 0.005 * RPM, duration)
    assert jump.angle == pytest.approx(jump.speed * jump.time % (2.0 * np.pi), rel=1e-4)


def test_a_jump_has_numbers_of_python(laws, two_mass):
    """Speed, angle and time of a jump are Python floats, so that a page can send them as JSON."""
    jump = find_jump(laws["poly345"], two_mass, None)
    assert {type(value) for value in vars(jump).values()} == {float}


@pytest.mark.parametrize("slowest", [1.0, 249.0, 340.0])
def test_a_resonance_that_only_just_loses_contact(cams, two_mass, slowest):
    """A loss of contact that occurs only in a speed range of 0.4 rpm is found.

    The smallest force in it is −0.1 N. The result does not depend on the first speed of the search.
    """
    # A former search missed this case, because the force is negative only between two of its
    # samples.
    numbers = Numbers(2.0524121, 1433596.1, 0.3233099, 31.3206927)
    laws, follower = refitted({"poly345": cams["poly345"]}, two_mass, numbers)
    jump_speed = find_jump_speed(laws["poly345"], follower, 1.7, slowest)
    assert jump_speed / RPM == pytest.approx(348.55, abs=0.01)
    assert loses_contact(laws["poly345"], follower, 348.7 * RPM, 1.7)
    assert not loses_contact(laws["poly345"], follower, 349.1 * RPM, 1.7)
    assert not loses_contact(laws["poly345"], follower, 348.4 * RPM, 1.7)


def test_a_resonance_narrower_than_a_millionth(laws, two_mass):
    """The jump speed is found if contact is lost only in a very narrow range of speed.

    With little damping, contact is lost at a resonance just above the jump speed (relative 1e-8),
    and kept again 1e-4 above it.
    """
    law, follower = laws["poly345"], replace(two_mass, stem_damping=0.003, damping=0.003)
    jump_speed = find_jump(law, follower, None).speed
    assert not loses_contact(law, follower, jump_speed * (1.0 - 1e-8), None)
    assert loses_contact(law, follower, jump_speed * (1.0 + 1e-8), None)
    assert not loses_contact(law, follower, jump_speed * 1.0001, None)


@pytest.mark.parametrize(
    ("changes", "duration", "message"),
    [
        ({"preload": 0.0}, 1.7, r"loses contact at 1 rpm already; allowed .* preload"),
        ({"stem_damping": 0.0, "damping": 0.0}, None, r"no steady state: .* allowed: damping, or"),
        ({"preload": 1e9}, None, "keeps contact up to 100000 rpm"),
    ],
)
def test_no_jump_speed(laws, two_mass, changes, duration, message):
    """Rigs without a jump speed are refused with the reason.

    Reasons are no preload, no damping in steady state, and a preload so large that contact is never
    lost.
    """
    with pytest.raises(DynamicsError, match=message):
        find_jump(laws["poly345"], replace(two_mass, **changes), duration)


# -- jump speeds of many rigs in one call

#: Number of followers per call.
COUNT = 12


@pytest.fixture(params=["paper_table2", "tm21"])
def shipped(request):
    """Shipped rig with two masses, then the shipped rig with one mass."""
    return cam_rig.load_rig(request.param)


def test_each_row_is_that_of_a_single_call(laws, shipped):
    """`jump_speed` for arrays of 12 followers gives the results of 12 single calls.

    Speed, angle and time of the loss of contact are equal in all bits.
    """
    rng, law = np.random.default_rng(5), laws["poly345"]
    numbers = {
        "mass": rng.uniform(0.5, 2.0, COUNT),
        "spring_stiffness": rng.uniform(2e3, 8e3, COUNT),
        "damping": rng.uniform(1.0, 20.0, COUNT),
        "preload": rng.uniform(10.0, 60.0, COUNT),
    }
    result = cam_rig.jump_speed(law, shipped, duration=0.5, **numbers)
    for i, row in enumerate(result.rows):
        follower = {name: float(values[i]) for name, values in numbers.items()}
        single = cam_rig.jump_speed(law, shipped.with_follower(**follower), duration=0.5)
        assert {name: getattr(row, name) for name in follower} == follower
        assert (row.rpm, row.angle, row.time) == (single.rpm, single.angle, single.time)
    half = {name: values[: COUNT // 2] for name, values in numbers.items()}
    assert cam_rig.jump_speed(law, shipped, duration=0.5, **half).rows == result.rows[: COUNT // 2]


def test_a_rig_without_a_jump_speed_has_a_reason(laws, shipped):
    """In a call for many rigs, a rig with an invalid preload gets NaN and a reason.

    The results of the other rigs are complete.
    """
    preload = np.array([30.0, -1.0, np.nan, 30.0])
    result = cam_rig.jump_speed(laws["poly345"], shipped, preload=preload)
    first, *others, last = result.rows
    assert (first.rpm, first.reason) == (last.rpm, "")
    assert all(np.isnan(row.rpm) and "preload" in row.reason for row in others)
    assert result.rpm[0] == cam_rig.jump_speed(laws["poly345"], shipped, preload=30.0).rpm[0]


def test_arrays_must_have_one_length(laws, shipped):
    """Arrays of different lengths and arrays with two axes are refused."""
    law = laws["poly345"]
    assert len(cam_rig.jump_speed(law, shipped, mass=1.0, preload=np.full(3, 30.0)).rows) == 3
    with pytest.raises(ConfigError, match="must have the same size, got mass 2, preload 3"):
        cam_rig.jump_speed(law, shipped, mass=np.ones(2), preload=np.full(3, 30.0))
    message = r"preload: is an array of shape .*; allowed: a number, or several on one axis"
    with pytest.raises(ConfigError, match=message):
        cam_rig.jump_speed(law, shipped, preload=np.ones((2, 2)))


# -- rigid jump speed against a closed form, and the kind of follower of a rig


def test_the_follower_of_a_rig():
    """The follower of a rig with `roller_share` has two masses.

    The follower of any other rig has one mass.
    """
    split, whole = cam_rig.load_rig("paper_table2"), cam_rig.load_rig("tm21")
    assert describe_follower(follower_of(split)) == "two masses"
    assert describe_follower(follower_of(whole)) == "one rigid mass"
    half = whole.with_follower(roller_share=0.4)
    with pytest.raises(ConfigError, match=r"follower\.stem_damping: is missing"):
        follower_of(half)


def damped(stem_stiffness, share, ratio):
    """Return the two masses of the rig `paper_table2` with another stem.

    `stem_stiffness` is in N/m, `share` is the roller's share of the mass, and `ratio` is the
    damping ratio of the stem.
    """
    numbers = {"roller_share": share, "stem_stiffness": stem_stiffness, "damping": 0.0}
    whole = TwoMassParameters.from_rig(cam_rig.load_rig("paper_table2").with_follower(**numbers))
    return replace(whole, stem_damping=2.0 * ratio * (whole.stiffness * whole.end_mass) ** 0.5)


@pytest.mark.parametrize(
    ("stiffness", "share", "ratio"), [(1e5, 0.4, 3.0), (1e6, 0.05, 2.0), (1e12, 0.4, 10.0)]
)
def test_an_overdamped_stem(laws, stiffness, share, ratio):
    """With an overdamped stem the smallest steady force is zero at the jump speed.

    It is positive at 0.9999 and negative at 1.0001 of this speed. The force is computed
    independently, from the Fourier series of the lift.
    """
    law, p, count = laws["poly345"], damped(stiffness, share, ratio), 1 << 16
    lift = np.fft.rfft(law.motion_at(np.arange(count) * (TURN / count))[0])
    jump_speed = find_jump(law, p, None).speed
    min_forces = []
    for speed in (jump_speed * 0.9999, jump_speed * 1.0001):
        z = 1j * speed * np.arange(lift.size)
        end = p.spring_stiffness + p.damping * z + p.end_mass * z**2
        stem = p.stem_stiffness + p.stem_damping * z
        force = np.fft.irfft((p.roller_mass * z**2 + stem * end / (stem + end)) * lift, count)
        min_forces.append(force.min() + p.share * p.preload)
    assert min_forces[0] > 0.0 > min_forces[1]


def test_the_error_of_high_damping_has_the_damping_ratio(laws):
    """On a law of high degree a stem of five times critical damping is refused.

    The error states the damping ratio.
    """
    message = r"is damped 5 times critical, .*allowed.* less damping"
    with pytest.raises(DynamicsError, match=message):
        find_jump_speed(laws["modified_sine"], damped(1.26e6, 0.4, 5.0), None, 300.0)


@pytest.mark.parametrize("cam", ["poly345", "trigonometric", "tm21"])
def test_a_follower_without_preload(laws, follower, cam):
    """The jump speed without preload is the limit for a very small preload, to 1e-9.

    A force of zero in a dwell does not count as a loss of contact. With very high damping the error
    states that contact is lost at 1 rpm.
    """
    law, free = laws[cam], replace(follower, preload=0.0)
    jump = find_jump(law, free, None)
    assert jump.speed == pytest.approx(rigid_jump(law, replace(free, preload=1e-9))[0], rel=1e-9)
    rig = cam_rig.load_rig("tm21").with_follower(**asdict(free))
    runs = [cam_rig.simulate(law, rig, rpm=jump.rpm * factor).events for factor in (0.99, 1.01)]
    assert [len(events) > 0 for events in runs] == [False, True]
    with pytest.raises(DynamicsError, match="loses contact at 1 rpm already"):
        find_jump(law, replace(free, damping=100.0 * follower.damping + 1e3), None)


def test_contact_is_lost_at_rest_on_a_law_below_zero(laws, follower):
    """If the preload is too small for a law with negative lift, the jump speed is 0.

    Contact is then lost without any rotation.
    """
    law = laws["poly345"]
    below = Law("below", law.breaks, law.ordinates - 0.5 * peak(law, 0).value)
    assert rigid_jump(below, replace(follower, preload=0.0)) == (0.0, extremes(below, 0)[0].angle)
    sufficient = follower.spring_stiffness * peak(law, 0).value
    assert rigid_jump(below, replace(follower, preload=sufficient))[0] > 0.0


# -- rigid jump speeds of laws of many polynomial pieces, against exhaustive searches


@pytest.mark.variants(3)
@pytest.mark.parametrize("seed", range(6))
def test_rigid_jump_is_the_exhaustive_minimum(laws, follower, seed):
    """The jump speed of a rigid follower is the lowest of a million cam angles.

    At each angle it is the speed at which the contact force reaches zero there. A parabola through
    the three lowest values refines the minimum. The relative tolerance is 1e-10, or 1e-5 at a joint
    of two polynomial pieces, where no parabola fits.
    """
    rng = np.random.default_rng(seed)
    law = laws[("poly345", "tm21", "bezier15", "cycloidal", "trigonometric", "measured")[seed]]
    if seed % 2:
        law = with_joints(law, *rng.uniform(0.0, TURN, int(rng.integers(1, 400))))
    mass = replace(follower, damping=rng.uniform(0.0, 60.0), preload=rng.uniform(1.0, 200.0))
    angles = np.linspace(0.0, TURN, 1_000_001)
    speeds = first_zeros(law, mass, angles)
    index = int(np.argmin(speeds))
    low, least, high = (speeds[(index + i) % (angles.size - 1)] for i in (-1, 0, 1))
    curvature, slope = low - 2.0 * least + high, 0.5 * (high - low)
    if abs(slope) < curvature:  # else at a joint with a falling s''
        least -= 0.5 * slope**2 / curvature
    speed, angle = rigid_jump(law, mass)
    assert speed == pytest.approx(least, rel=1e-10 if abs(slope) < curvature else 1e-5)
    assert first_zeros(law, mass, np.array([angle]))[0] >= speed * (1.0 - 1e-12)
    below, above = rigid_min_force(law, mass, speed * np.array([0.99, 1.01]))
    assert below > 0.0 > above


def first_zeros(law, mass, angles):
    """Return at each angle the lowest cam speed (rad/s) with a contact force of zero.

    It is the smallest Ω > 0 with m s'' Ω² + c s' Ω + k s + F₀ = 0, or infinite if no such Ω exists.
    """
    s, slope, curvature = law.motion_at(angles)
    a, b, c = mass.mass * curvature, mass.damping * slope, mass.spring_stiffness * s + mass.preload
    with np.errstate(all="ignore"):
        roots = 2.0 * c / (-b + np.array([[1.0], [-1.0]]) * np.sqrt(b**2 - 4.0 * a * c))
    return np.where(np.isfinite(roots) & (roots > 0.0), roots, np.inf).min(axis=0)


@pytest.mark.parametrize("duration", [1.7, None])
@pytest.mark.parametrize("rig", ["paper_table2", "tm21"])
def test_a_cam_of_dwells_keeps_contact(rig, duration):
    """A cam without lift never loses contact, so its jump speed is an error.

    The contact force is the preload at every speed. The error states the highest speed, 1e5 rpm.
    """
    flat = Law("flat", np.array([0.0, TURN]), np.zeros((1, 1)))
    with pytest.raises(DynamicsError, match="'flat': the follower keeps contact up to 100000 rpm"):
        find_jump(flat, follower_of(cam_rig.load_rig(rig)), duration)
