"""Bounces without end in a finite time: few events, then contact, and no loop."""

import numpy as np
import pytest

from cam_rig.dynamics import MODELS, FollowerParameters, FollowerState, Interval
from cam_rig.dynamics import one_mass as course
from cam_rig.dynamics.two_mass import trajectory as two_mass
from cam_rig.dynamics.two_mass.masses import TwoMassParameters
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
    ("cam", "restitution"),
    [("hump", 0.5), ("hump", 0.9), ("hump", 0.99), ("disc", 0.5)],
)
def test_one_mass(cam, restitution, monkeypatch):
    """ln(v₀/v)/ln(1/e) landings until a bounce is lower than rounding, then it sits."""
    monkeypatch.setattr(course, "MAX_EVENTS", 40.0 / np.log(1.0 / restitution))
    follower = FollowerParameters(1.3, 4030.0, 0.0, PRELOAD, 3.3e8, restitution)
    lifted_off = FollowerState(0.0, THROWN, 0.0, in_contact=False)
    interval = Interval(0, 3 * NS, 0.0, SPEED)
    state, block = MODELS["one_mass"].advance(law_of(cam), follower, lifted_off, interval, 1000)
    landings = [event for event in block.events if event.kind == "landing"]
    times = landing_times(1.3, 4030.0, PRELOAD, restitution, 100_000)
    check(landings, times, times[-1], restitution, 1.3)
    assert state.in_contact
    assert len(landings) < 15.0 / np.log(1.0 / restitution)
    after = block.rows[0] > times[-1]
    np.testing.assert_allclose(block.rows[4, after], PRELOAD, rtol=1e-12)


@pytest.mark.parametrize(
    ("cam", "restitution"),
    [
        ("hump", 0.5),
        ("hump", 0.9),
        ("disc", 0.5),
    ],
)
def test_two_masses(cam, restitution, monkeypatch):
    """The roller alone bounces, pressed on by a stem whose other end does not move.

    An end mass of 1e9 kg gives way by 1e-8 of what the roller does.
    """
    monkeypatch.setattr(two_mass, "MAX_EVENTS", 200)
    p = TwoMassParameters(ROLLER, 1e9, STEM, 4030.0, 0.0, 0.0, PRELOAD, restitution=restitution)
    rest = -p.preload / p.stiffness
    found = two_mass.Separation(law_of(cam), p, SPEED)
    found.run(1.0, np.array([0.0, THROWN, rest, 0.0]), contact=False)
    landings = [event for event in found.events if event.kind == "landing"]
    times = landing_times(ROLLER, STEM, -STEM * rest, restitution, 100_000)
    check(landings, times, times[-1], restitution, ROLLER)
    assert found.ends_in_contact
    assert found.phases[-1].end - found.phases[-1].begin > 0.9


def jumping(law, stem, rpm):
    """One turn of a cam that throws the two masses off, e = 0.9."""
    p = TwoMassParameters(0.52, 0.78, stem, 4030.0, 8.642, 8.642, 12.753, restitution=0.9)
    speed = rpm * np.pi / 30.0
    found = two_mass.Separation(law, p, speed)
    found.run(TURN / speed)
    assert found.phases[-1].end == TURN / speed
    return found.events


@pytest.mark.parametrize("stem", [1.26e6, 3.3e8])
@pytest.mark.parametrize("rpm", [450.0, 600.0])
def test_two_masses_on_a_jumping_cam(laws, stem, rpm):
    """Bounces on bounces, and yet finitely many, in order."""
    times = [event.time for event in jumping(laws["poly345"], stem, rpm)]
    assert 4 < len(times) < 5000
    assert times == sorted(times)


@pytest.mark.parametrize("stem", [1.26e6, 3.3e8])
@pytest.mark.parametrize("rpm", [450.0, 600.0])
def test_a_landing_never_pulls(laws, stem, rpm):
    """The cam can only push: no impulse is negative."""
    assert min(event.impulse for event in jumping(laws["poly345"], stem, rpm)) >= 0.0


def test_too_many_bounces_are_said(monkeypatch):
    """More than an interval takes is an error that says how many and where, not a loop."""
    monkeypatch.setattr(course, "MAX_EVENTS", 100)
    follower = FollowerParameters(1.3, 4030.0, 0.0, PRELOAD, 3.3e8, 0.99)
    lifted_off = FollowerState(0.0, THROWN, 0.0, in_contact=False)
    interval = Interval(0, 30 * NS, 0.0, SPEED)
    with pytest.raises(
        DynamicsError, match=r"more than 100 events in 30 s at 0.1 rad/s; allowed: "
    ):
        MODELS["one_mass"].advance(law_of("hump"), follower, lifted_off, interval, 100)
