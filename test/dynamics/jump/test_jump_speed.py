"""Jump speeds: the lowest, proved on both sides, and what they must not depend on."""

from dataclasses import asdict, replace

import numpy as np
import pytest

import cam_rig
from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.jump.jump_speed import jump_speed
from cam_rig.dynamics.jump.search import sought_speed
from cam_rig.dynamics.two_mass.masses import contact_response
from cam_rig.errors import ConfigError, DynamicsError
from cam_rig.laws import build_law
from cam_rig.paper.jump.refit import Numbers, refitted
from cam_rig.units import RPM

from ..helpers import lift_off


def leaves(law, parameters, speed, duration):
    """Whether the exact model leaves the cam."""
    start, length = np.zeros(2), duration
    if duration is None:
        start = contact_response(law, parameters, speed).periodic()
        length = 2.0 * np.pi / speed
    return lift_off(law, parameters, speed, start, length) is not None


@pytest.mark.parametrize("cam", ["bezier15", "poly345", "cycloidal"])
@pytest.mark.parametrize("duration", [1.7, None])
def test_jump_speed_is_the_exact_models(laws, two_mass, cam, duration):
    """The exact model stays on 0.005 rpm below and leaves 0.005 rpm above, at the told time."""
    law = laws[cam]
    found = jump_speed(law, two_mass, duration)
    assert not leaves(law, two_mass, found.speed - 0.005 * RPM, duration)
    assert leaves(law, two_mass, found.speed + 0.005 * RPM, duration)
    turned = found.speed * found.time % (2.0 * np.pi)
    assert found.angle == pytest.approx(turned, rel=1e-4)


def test_a_faster_cam_may_be_followed_again(laws, two_mass):
    """Contact is not lost for good: 3-4-5 is left at 420 rpm, not at 435, and again at 450."""
    law = laws["poly345"]
    lost = [leaves(law, two_mass, rpm * RPM, 1.7) for rpm in (410.0, 420.0, 435.0, 450.0)]
    assert lost == [False, True, False, True]


@pytest.mark.parametrize("slowest", [1.0, 249.0, 340.0])
def test_a_resonance_that_only_just_lifts(cams, two_mass, slowest):
    """A dip of the least force of a tenth of a newton is found from wherever the search begins."""
    # The force falls below zero between the points of its grid in time, and over 0.4 rpm alone.
    numbers = Numbers(2.0524121, 1433596.1, 0.3233099, 31.3206927)
    laws, follower = refitted({"poly345": cams["poly345"]}, two_mass, numbers)
    found = sought_speed(laws["poly345"], follower, 1.7, slowest)
    assert found / RPM == pytest.approx(348.55, abs=0.01)
    assert leaves(laws["poly345"], follower, 348.7 * RPM, 1.7)
    assert not leaves(laws["poly345"], follower, 349.1 * RPM, 1.7)
    assert not leaves(laws["poly345"], follower, 348.4 * RPM, 1.7)


def test_a_resonance_narrower_than_a_millionth(laws, two_mass):
    """With next to no damping the jump speed is that of the first resonance that throws off.

    The follower leaves in a band of a millionth of the speed, and next only far above it.
    """
    law, slack = laws["poly345"], replace(two_mass, stem_damping=0.003, damping=0.003)
    found = jump_speed(law, slack, None).speed
    assert not leaves(law, slack, found * (1.0 - 1e-8), None)
    assert leaves(law, slack, found * (1.0 + 1e-8), None)
    assert not leaves(law, slack, found * 1.0001, None)


def test_forces_in_proportion(laws, two_mass):
    """All masses, stiffnesses, dampers and the preload times seven: the same jump."""
    seven = TwoMassParameters(**{k: 7.0 * v for k, v in asdict(two_mass).items()})
    one, other = (jump_speed(laws["poly4567"], p) for p in (two_mass, seven))
    assert other.speed == pytest.approx(one.speed, rel=1e-5)
    assert other.time == pytest.approx(one.time, rel=1e-3)


def test_a_longer_run_leaves_no_later(laws, two_mass):
    """What leaves within a short run leaves within a long one: speeds fall with the length."""
    speeds = [jump_speed(laws["poly345"], two_mass, t).speed for t in (0.1, 0.3, 1.7)]
    assert speeds[1] <= speeds[0] * (1.0 + 1e-12)
    assert speeds[2] <= speeds[1] * (1.0 + 1e-12)


@pytest.mark.parametrize(
    ("changes", "duration", "words"),
    [
        ({"preload": 0.0}, 1.7, r"loses contact at 1 rpm already; allowed .* preload"),
        ({"stem_damping": 0.0, "damping": 0.0}, None, r"no steady state: .* allowed: damping, or"),
    ],
)
def test_no_jump_speed(laws, two_mass, changes, duration, words):
    """A follower that is not pressed on, or a stem that rings for ever, has none: said so."""
    with pytest.raises(DynamicsError, match=words):
        jump_speed(laws["poly345"], replace(two_mass, **changes), duration)


def test_a_cam_that_throws_nothing(make_cam, two_mass):
    """A lift of a picometre never overcomes the preload."""
    cam = make_cam(
        {"law": "dwell", "span": 120},
        {"law": "poly345", "to": 1, "span": 120},
        {"law": "poly345", "to": 0, "span": 120},
        lift=1e-12,
    )
    with pytest.raises(DynamicsError, match="keeps contact up to 100000 rpm"):
        jump_speed(build_law(cam), two_mass, None)


# -- many rigs at once: each row is that rig's alone, and one without an answer harms no other


#: Rigs of a test.
COUNT = 12


@pytest.fixture(params=["paper_table2", "tm21"])
def rig(request):
    """Two masses, and one."""
    return cam_rig.load_rig(request.param)


def test_a_row_is_the_rig_alone(laws, rig):
    """Speed, angle and time of a random spring, preload, mass and damping: the same bits."""
    rng, law = np.random.default_rng(5), laws["poly345"]
    numbers = {
        "mass": rng.uniform(0.5, 2.0, COUNT),
        "spring_stiffness": rng.uniform(2e3, 8e3, COUNT),
        "damping": rng.uniform(1.0, 20.0, COUNT),
        "preload": rng.uniform(10.0, 60.0, COUNT),
    }
    found = cam_rig.jump_speed(law, rig, duration=0.5, **numbers)
    for i, row in enumerate(found.rows):
        one = {name: float(values[i]) for name, values in numbers.items()}
        alone = cam_rig.jump_speed(law, rig.with_follower(**one), duration=0.5)
        assert {name: getattr(row, name) for name in one} == one
        assert (row.rpm, row.angle, row.time) == (alone.rpm, alone.angle, alone.time)
    half = {name: values[: COUNT // 2] for name, values in numbers.items()}
    assert cam_rig.jump_speed(law, rig, duration=0.5, **half).rows == found.rows[: COUNT // 2]


def test_a_rig_without_an_answer_says_why(laws, rig):
    """No preload, a negative one and NaN among others: rows with a reason."""
    preload = np.array([30.0, 0.0, -1.0, np.nan, 30.0])
    found = cam_rig.jump_speed(laws["poly345"], rig, preload=preload)
    first, *others, last = found.rows
    assert (first.rpm, first.reason) == (last.rpm, "")
    assert all(np.isnan(row.rpm) and "preload" in row.reason for row in others)
    assert found.rpm[0] == cam_rig.jump_speed(laws["poly345"], rig, preload=30.0).rpm[0]


def test_arrays_go_together(laws, rig):
    """Of one length each, or one number for all."""
    law = laws["poly345"]
    assert len(cam_rig.jump_speed(law, rig, mass=1.0, preload=np.full(3, 30.0)).rows) == 3
    with pytest.raises(ConfigError, match="mass 2, preload 3 numbers; allowed: as many each"):
        cam_rig.jump_speed(law, rig, mass=np.ones(2), preload=np.full(3, 30.0))
    with pytest.raises(
        ConfigError,
        match=r"preload: is an array of shape .*; allowed: a number, or several on one axis",
    ):
        cam_rig.jump_speed(law, rig, preload=np.ones((2, 2)))
