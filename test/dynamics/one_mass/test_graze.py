"""The contact force comes down to zero and touches it, or goes a hair below.

Near its minimum F = ½F''(θ² − θ₀²). The follower leaves at −θ₀, and since the gap's second
derivative is −F/m, the gap is closed again at exactly +3θ₀, with the impulse (8/3) F'' θ₀³/ω.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from cam_rig.dynamics import MODELS, FollowerParameters, Interval, TwoMassParameters
from cam_rig.dynamics.two_mass.model import states
from cam_rig.dynamics.two_mass.trajectory import Separation
from cam_rig.units import NS, TURN

SPEED = 450.0 * np.pi / 30.0
FOLLOWER = FollowerParameters(1.3, 4030.0, 8.642, 0.0, 3.3e8)
TWO = TwoMassParameters(0.52, 0.78, 1.26e6, 4030.0, 8.642, 8.642, 1000.0)


@pytest.fixture(scope="module")
def minimum(laws):
    """Angle and depth of the least force of the one mass without preload, and F'' there."""
    law, p = laws["poly345"], FOLLOWER

    def force(angle, order):
        derivatives = (float(law(angle, order + k)) for k in (2, 1, 0))
        weights = p.mass * SPEED**2, p.damping * SPEED, p.spring_stiffness
        return sum(w * s for w, s in zip(weights, derivatives, strict=True))

    grid = np.linspace(3.7, 4.6, 2001)  # the fall after the high dwell
    i = int(np.argmin([force(a, 0) for a in grid]))
    angle = brentq(lambda a: force(a, 1), grid[i - 1], grid[i + 1], xtol=1e-15)
    return angle, force(angle, 0), force(angle, 2)


def one_turn(law, preload):
    p = replace(FOLLOWER, preload=preload)
    interval = Interval(0, round(TURN / SPEED * NS), 0.0, SPEED)
    return MODELS["one_mass"].advance(law, p, None, interval, 1000)[1].events


@pytest.mark.parametrize("hair", [1e-13, 1e-12, 1e-9])
def test_a_touch_is_no_event(laws, minimum, hair):
    """Zero reached to the rounding of a force of 400 N, not crossed: the follower stays."""
    assert one_turn(laws["poly345"], -minimum[1] * (1.0 + hair)) == ()


@pytest.mark.parametrize("hair", [1e-5, 1e-4])
def test_a_hair_lower_is_a_flight(laws, minimum, hair):
    """Off at −θ₀, back at 3θ₀: to the next order in θ₀ and what rounding makes of a 1e-14 m gap."""
    angle, depth, bend = minimum
    half = np.sqrt(2.0 * hair * abs(depth) / bend)
    off, on = one_turn(laws["poly345"], abs(depth) * (1.0 - hair))
    assert (off.kind, on.kind) == ("lift-off", "landing")
    assert (off.angle - angle) / half == pytest.approx(-1.0, abs=1e-3)
    assert (on.angle - angle) / half == pytest.approx(3.0, abs=0.02)
    assert on.impulse == pytest.approx(8.0 / 3.0 * bend * half**3 / SPEED, rel=0.02)


@pytest.mark.parametrize("hair", [1e-12, 1e-9, 1e-7])
def test_less_than_a_gap_can_show(laws, minimum, hair):
    """The gap stays below rounding: one pair all the same, and a landing that nobody feels."""
    off, on = one_turn(laws["poly345"], abs(minimum[1]) * (1.0 - hair))
    assert (off.kind, on.kind) == ("lift-off", "landing")
    assert off.angle < minimum[0] < on.angle
    assert 0.0 <= on.impulse < 1e-8 * FOLLOWER.mass * SPEED * laws["poly345"].lift


@pytest.fixture(scope="module")
def two_mass_touch(laws):
    """The preload at which the vibrating two-mass force just touches zero on the first turn."""
    found = Separation(laws["poly345"], TWO, SPEED)
    found.run(TURN / SPEED)
    assert found.events == []
    times = np.linspace(0.0, TURN / SPEED, 20_001)
    forces = states(found, times)[4]
    i = int(np.argmin(forces))
    near = np.linspace(times[i - 1], times[i + 1], 20_001)
    return TWO.preload - float(states(found, near)[4].min()) / TWO.share


def two_mass_turn(law, preload):
    found = Separation(law, replace(TWO, preload=preload), SPEED)
    found.run(TURN / SPEED)
    return found.events


@pytest.mark.parametrize("hair", [0.0, 1e-12, 1e-9])
def test_two_masses_touch(laws, two_mass_touch, hair):
    """Within 64 rounding errors of a force of 1e3 N, zero is touched, not crossed."""
    assert two_mass_turn(laws["poly345"], two_mass_touch * (1.0 + hair)) == []


@pytest.mark.parametrize("hair", [1e-6, 1e-5, 1e-4])
def test_two_masses_a_hair_lower(laws, two_mass_touch, hair):
    """One lift-off and one landing, and an impulse that pushes."""
    events = two_mass_turn(laws["poly345"], two_mass_touch * (1.0 - hair))
    assert [event.kind for event in events] == ["lift-off", "landing"]
    assert events[1].impulse > 0.0
