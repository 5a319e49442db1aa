"""The rigid jump speed against a closed form and against the rigid model's own loss of contact."""

from dataclasses import replace

import numpy as np
import pytest

import cam_rig
from cam_rig.dynamics import MODELS, FollowerParameters, Interval
from cam_rig.dynamics.jump.any_follower import described, find_jump, follower_of
from cam_rig.dynamics.jump.jump_speed import rigid_jump_speed, rigid_least
from cam_rig.dynamics.kinetostatic import loss_intervals
from cam_rig.errors import ConfigError, DynamicsError
from cam_rig.laws import build_law


def test_eccentric(make_cam, follower):
    """s = h/2 (1 − cos θ) without damping: the top lets go at Ω² = (k h + preload)/(m h/2)."""
    cam = make_cam(
        {"law": "simple_harmonic", "to": 1, "span": 180},
        {"law": "simple_harmonic", "to": 0, "span": 180},
    )
    free = replace(follower, damping=0.0)
    expected = np.sqrt((free.spring_stiffness * 0.05 + free.preload) / (free.mass * 0.025))
    assert rigid_jump_speed(build_law(cam), free) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("cam", ["poly345", "cycloidal", "bezier15", "tm21"])
def test_contact_is_lost_above_and_kept_below(laws, follower, cam):
    """On either side by 1e-6 the exact kinetostatic model says the same."""
    speed = rigid_jump_speed(laws[cam], follower)
    assert not loss_intervals(laws[cam], follower, speed * (1.0 - 1e-6))
    assert loss_intervals(laws[cam], follower, speed * (1.0 + 1e-6))


def test_any_law_on_any_rig(rng_rigs):
    """The one-mass jump: the exact model with landings lifts off just above, and nowhere below.

    Where the zero of the force is, its angle is the first lift-off's.
    """
    for law, mass in rng_rigs:
        found = find_jump(law, mass, None)
        assert not events(law, mass, found.speed * (1.0 - 1e-6))
        first, *_ = events(law, mass, found.speed * (1.0 + 1e-6))
        away = (first.angle - found.angle + np.pi) % (2.0 * np.pi) - np.pi
        assert first.kind == "lift-off"
        assert abs(away) < 0.02
        assert found.time * found.speed == pytest.approx(found.angle)
        least = rigid_least(law, mass, found.speed * np.array([0.99, 1.0, 1.01]))
        assert least[0] > 0.0 > least[2]
        assert abs(least[1]) < 1e-4 * (mass.preload + mass.spring_stiffness * law.lift)


def events(law, mass, speed):
    """Events of the one-mass model in two turns at a speed (rad/s)."""
    turn = round(2.0 * np.pi / speed * 1e9)
    state, found = None, []
    for i in range(2):
        tick = Interval(i * turn, (i + 1) * turn, speed * i * turn * 1e-9, speed)
        state, block = MODELS["one_mass"].advance(law, mass, state, tick, 1000)
        found += block.events
    return found


@pytest.fixture
def rng_rigs(laws):
    """Random followers, each under one of the shipped laws."""
    rng = np.random.default_rng(16)
    names = ("poly345", "cycloidal", "bezier15", "tm21", "poly4567")
    return [
        (
            laws[name],
            FollowerParameters(
                mass=rng.uniform(0.1, 5.0),
                spring_stiffness=10.0 ** rng.uniform(2.5, 4.5),
                damping=rng.uniform(0.0, 20.0),
                preload=rng.uniform(1.0, 200.0),
                stem_stiffness=1e8,
            ),
        )
        for name in names
        for _ in range(3)
    ]


def test_the_follower_is_the_rigs():
    """Two masses where a rig splits its mass, one where it does not; half a split is refused."""
    split, whole = cam_rig.load_rig("paper_table2"), cam_rig.load_rig("tm21")
    assert described(follower_of(split)) == "two masses"
    assert described(follower_of(whole)) == "one rigid mass"
    half = whole.with_follower(roller_share=0.4)
    with pytest.raises(ConfigError, match=r"follower\.stem_damping: is missing"):
        follower_of(half)


def test_a_stiff_stem_is_one_mass(laws):
    """Two masses on a stiffer and stiffer stem come to the one-mass jump speed.

    The excitation of the stem's vibration falls with its period, so with 1/sqrt(stiffness).
    """
    law, whole = laws["poly345"], cam_rig.load_rig("tm21")
    one = find_jump(law, follower_of(whole), None).rpm
    away = []
    for stiffness in (1e6, 1e8):
        rig = whole.with_follower(
            roller_share=0.4, stem_damping=2e2 * stiffness**0.25, stem_stiffness=stiffness
        )
        away.append(abs(find_jump(law, follower_of(rig), None).rpm / one - 1.0))
    assert away[1] < 0.2 * away[0]
    assert away[1] < 0.005


def test_a_follower_without_preload(laws, follower):
    """It rests on the dwell with no force: there is no lowest speed."""
    with pytest.raises(DynamicsError, match="give it a preload"):
        find_jump(laws["poly345"], replace(follower, preload=0.0), None)
