"""Bounces without end in a finite time: few events, then contact, and no loop."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from benchmark.speed import study
from benchmark.speed.cases import CASES
from cam_rig.dynamics import MODELS, FollowerParameters, FollowerState, Interval, TwoMassParameters
from cam_rig.dynamics.one_mass import OneMassTrajectory
from cam_rig.dynamics.two_mass import Separation, states
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.units import NS, TURN

SPEED, THROWN, PRELOAD = 0.1, 0.2, 30.0
#: The end mass is a wall, and the stem the roller's spring.
ROLLER, STEM = 0.5, 1e5
LIFT = 0.05


def law_of(name):
    """A dwell of 298° with a hump after it, or a disc."""
    if name == "disc":
        return Law("disc", np.array([0.0, TURN]), np.zeros((2, 1)))
    rise = LIFT * np.repeat([0.0, 1.0], 3)
    return Law("hump", np.array([0.0, 5.2, 5.7, TURN]), np.stack([0.0 * rise, rise, rise[::-1]], 1))


def landing_times(mass, stiffness, load, restitution, count):
    """Sum of 2 atan(vΩm/P)/Ω with v falling by e: thrown up on a spring Ω² = k/m, undamped."""
    rate = np.sqrt(stiffness / mass)
    velocities = THROWN * restitution ** np.arange(count)
    return np.cumsum(2.0 / rate * np.arctan(velocities * rate * mass / load))


def check(landings, times, accumulated, restitution, mass):
    """Each landing at its time, to 1e-5 of the whole series."""
    found = np.array([event.time for event in landings])
    np.testing.assert_allclose(found, times[: found.size], rtol=0, atol=1e-5 * accumulated)
    assert found[-1] == pytest.approx(accumulated, rel=1e-4)
    impulses = np.array([event.impulse for event in landings[:10]])
    wanted = mass * (1.0 + restitution) * THROWN * restitution ** np.arange(10)
    np.testing.assert_allclose(impulses, wanted, rtol=1e-4)


@pytest.mark.parametrize(
    ("cam", "restitution"), [("hump", 0.5), ("hump", 0.9), ("hump", 0.99), ("disc", 0.5)]
)
def test_one_mass(cam, restitution, monkeypatch):
    """ln(v₀/v)/ln(1/e) landings until a bounce is lower than rounding, then it sits."""
    monkeypatch.setattr(OneMassTrajectory, "max_events", 40.0 / np.log(1.0 / restitution))
    follower = FollowerParameters(1.3, 4030.0, 0.0, PRELOAD, 3.3e8, restitution)
    flying = FollowerState(0.0, THROWN, 0.0, in_contact=False)
    interval = Interval(0, 3 * NS, 0.0, SPEED)
    state, block = MODELS["one_mass"].advance(law_of(cam), follower, flying, interval, 1000)
    landings = [event for event in block.events if event.kind == "landing"]
    times = landing_times(1.3, 4030.0, PRELOAD, restitution, 100_000)
    check(landings, times, times[-1], restitution, 1.3)
    assert state.in_contact
    lost = sum(event.energy_lost for event in landings)
    assert lost == pytest.approx(0.5 * 1.3 * THROWN**2, rel=1e-9)
    assert len(landings) < 15.0 / np.log(1.0 / restitution)
    after = block.rows[0] > times[-1]
    np.testing.assert_allclose(block.rows[4, after], PRELOAD, rtol=1e-12)


@pytest.mark.parametrize(("cam", "restitution"), [("hump", 0.5), ("hump", 0.9), ("disc", 0.5)])
def test_two_masses(cam, restitution, monkeypatch):
    """The roller alone bounces, pressed on by a stem whose other end does not move."""
    # An end mass of 1e9 kg gives way by 1e-8 of what the roller does.
    monkeypatch.setattr(Separation, "max_events", 200)
    p = TwoMassParameters(ROLLER, 1e9, STEM, 4030.0, 0.0, 0.0, PRELOAD, restitution=restitution)
    rest = -p.preload / p.stiffness
    found = Separation(law_of(cam), p, SPEED)
    found.run(1.0, np.array([0.0, THROWN, rest, 0.0]), contact=False)
    landings = [event for event in found.events if event.kind == "landing"]
    times = landing_times(ROLLER, STEM, -STEM * rest, restitution, 100_000)
    check(landings, times, times[-1], restitution, ROLLER)
    assert isinstance(found.last, np.ndarray)
    assert found.phases[-1].end - found.phases[-1].begin > 0.9


def test_too_many_bounces_are_said(monkeypatch):
    """More than an interval takes is an error that says how many and where, not a loop."""
    monkeypatch.setattr(OneMassTrajectory, "max_events", 100)
    follower = FollowerParameters(1.3, 4030.0, 0.0, PRELOAD, 3.3e8, 0.99)
    flying = FollowerState(0.0, THROWN, 0.0, in_contact=False)
    interval = Interval(0, 30 * NS, 0.0, SPEED)
    words = r"more than 100 events in 30 s at 0\.1 rad/s; allowed: "
    with pytest.raises(DynamicsError, match=words):
        MODELS["one_mass"].advance(law_of("hump"), follower, flying, interval, 100)


# After a landing the stiff stem throws the roller up again and again, at 25 kHz.

FAST = 450.0 * np.pi / 30.0


@pytest.mark.parametrize("name", ["two_mass_soft", "two_mass_stem", "one_mass_arc"])
def test_events_are_those_of_fifty_digits(name):
    """All of them, in order, each to 1e-13 s; the motion between to 2e-12 of its largest."""
    # Not one of the bounces is lost or invented, though each begins where the last left off, and
    # each hands on its error: sixty of them on the stem enlarge a rounding a hundred times, so that
    # the last digit of its stiffness, or of the speed, is worth 1e-13 s. Where it weighs more, five
    # times its weight is the limit: the processor chooses how sums are rounded.
    case = CASES[name]()
    wanted, got = study.read(case), study.solve(case)
    assert [kind for kind, _ in got.events] == [kind for kind, _ in wanted.events]
    event_s, motion = last_digit(case, got)
    assert got.event_error(wanted) < max(1e-13, 5.0 * event_s)
    assert got.error(wanted) < max(2e-12, 5.0 * motion)


def last_digit(case, got):
    """What one in the last digit of a number does to event times (s) and to the motion."""
    name = "stem_stiffness" if hasattr(case.model, "stem_stiffness") else "stiffness"
    found = []
    for last in (-1e-15, 1e-15):
        model = replace(case.model, **{name: getattr(case.model, name) * (1.0 + last)})
        for nudged in (replace(case, model=model), replace(case, speed=case.speed * (1.0 + last))):
            other = study.solve(nudged)
            found.append((other.event_error(got), other.error(got)))
    return np.max(found, axis=0)


# The contact force comes down to zero and touches it, or goes a hair below. Near its minimum
# F = ½F''(θ² − θ₀²). The follower leaves at −θ₀, and since the gap's second derivative is −F/m, the
# gap is closed again at exactly +3θ₀, with the impulse (8/3) F'' θ₀³/ω.

FOLLOWER = FollowerParameters(1.3, 4030.0, 8.642, 0.0, 3.3e8)
TWO = TwoMassParameters(0.52, 0.78, 1.26e6, 4030.0, 8.642, 8.642, 1000.0)


@pytest.fixture(scope="module")
def minimum(laws):
    """Angle and depth of the least force of the one mass without preload, and F'' there."""
    law, p = laws["poly345"], FOLLOWER

    def force(angle, order):
        derivatives = (float(law(angle, order + k)) for k in (2, 1, 0))
        weights = p.mass * FAST**2, p.damping * FAST, p.spring_stiffness
        return sum(w * s for w, s in zip(weights, derivatives, strict=True))

    grid = np.linspace(3.7, 4.6, 2001)  # the fall after the high dwell
    i = int(np.argmin([force(a, 0) for a in grid]))
    angle = brentq(lambda a: force(a, 1), grid[i - 1], grid[i + 1], xtol=1e-15)
    return angle, force(angle, 0), force(angle, 2)


def one_turn(law, preload):
    p = replace(FOLLOWER, preload=preload)
    interval = Interval(0, round(TURN / FAST * NS), 0.0, FAST)
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
    assert on.impulse == pytest.approx(8.0 / 3.0 * bend * half**3 / FAST, rel=0.02)


@pytest.mark.parametrize("hair", [1e-12, 1e-9, 1e-7])
def test_less_than_a_gap_can_show(laws, minimum, hair):
    """The gap stays below rounding: one pair all the same, and a landing that nobody feels."""
    off, on = one_turn(laws["poly345"], abs(minimum[1]) * (1.0 - hair))
    assert (off.kind, on.kind) == ("lift-off", "landing")
    assert off.angle < minimum[0] < on.angle
    assert 0.0 <= on.impulse < 1e-8 * FOLLOWER.mass * FAST * laws["poly345"].lift


@pytest.fixture(scope="module")
def two_mass_touch(laws):
    """The preload at which the vibrating two-mass force just touches zero on the first turn."""
    found = Separation(laws["poly345"], TWO, FAST)
    found.run(TURN / FAST)
    assert found.events == []
    times = np.linspace(0.0, TURN / FAST, 20_001)
    forces = states(found, times)[4]
    i = int(np.argmin(forces))
    near = np.linspace(times[i - 1], times[i + 1], 20_001)
    return TWO.preload - float(states(found, near)[4].min()) / TWO.share


@pytest.mark.parametrize("hair", [0.0, 1e-12, 1e-9, -1e-6, -1e-5, -1e-4])
def test_two_masses_touch(laws, two_mass_touch, hair):
    """Zero is touched within 64 rounding errors of a force of 1e3 N; lower, there is a flight."""
    found = Separation(laws["poly345"], replace(TWO, preload=two_mass_touch * (1.0 + hair)), FAST)
    found.run(TURN / FAST)
    assert [event.kind for event in found.events] == ["lift-off", "landing"] * (hair < 0.0)
    assert all(event.impulse > 0.0 for event in found.events[1:])
