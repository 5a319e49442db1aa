"""Infinite series of bounces in a finite time end in contact after few events.

The tests also cover rapid bounces on a stiff stem, and a force that just touches zero.
"""

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
#: Roller mass (kg) and stem stiffness (N/m). The end mass is so large that it acts as a wall, so
#: that the stem is the spring of the roller.
ROLLER, STEM = 0.5, 1e5
LIFT = 0.05


def law_of(name):
    """Return the law "hump" (a dwell of 298° and a hump) or "disc" (no lift)."""
    if name == "disc":
        return Law("disc", np.array([0.0, TURN]), np.zeros((2, 1)))
    rise = LIFT * np.repeat([0.0, 1.0], 3)
    return Law("hump", np.array([0.0, 5.2, 5.7, TURN]), np.stack([0.0 * rise, rise, rise[::-1]], 1))


def landing_times(mass, stiffness, load, restitution, count):
    """Return the landing times (s) of an undamped mass that is thrown up once.

    They are sums of 2 atan(v Ω m/P)/Ω with Ω² = k/m and the preload P. Each landing multiplies the
    speed v by the restitution e.
    """
    rate = np.sqrt(stiffness / mass)
    velocities = THROWN * restitution ** np.arange(count)
    return np.cumsum(2.0 / rate * np.arctan(velocities * rate * mass / load))


def check(landings, times, accumulated, restitution, mass):
    """Assert that each landing is at its exact time, and has the exact impulse.

    `accumulated` (s) is the finite time in which infinitely many bounces occur. The tolerance of
    the times is 1e-5 of it, and that of the first ten impulses is 1e-4, relative.
    """
    actual = np.array([event.time for event in landings])
    np.testing.assert_allclose(actual, times[: actual.size], rtol=0, atol=1e-5 * accumulated)
    assert actual[-1] == pytest.approx(accumulated, rel=1e-4)
    impulses = np.array([event.impulse for event in landings[:10]])
    expected = mass * (1.0 + restitution) * THROWN * restitution ** np.arange(10)
    np.testing.assert_allclose(impulses, expected, rtol=1e-4)


@pytest.mark.parametrize(
    ("cam", "restitution"), [("hump", 0.5), ("hump", 0.9), ("hump", 0.99), ("disc", 0.5)]
)
def test_one_mass(cam, restitution, monkeypatch):
    """A series of bounces of one mass ends in contact after few landings.

    After ln(v₀/v)/ln(1/e) landings the speed falls from v₀ to v, where a bounce is below rounding.
    e is the restitution. The landings dissipate the initial kinetic energy.
    """
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
    """A roller on a stem whose other end is fixed bounces like one mass on a spring."""
    # An end mass of 1e9 kg moves by 1e-8 of the motion of the roller.
    monkeypatch.setattr(Separation, "max_events", 200)
    p = TwoMassParameters(ROLLER, 1e9, STEM, 4030.0, 0.0, 0.0, PRELOAD, restitution=restitution)
    static = -p.preload / p.stiffness
    trajectory = Separation(law_of(cam), p, SPEED)
    trajectory.run(1.0, np.array([0.0, THROWN, static, 0.0]), contact=False)
    landings = [event for event in trajectory.events if event.kind == "landing"]
    times = landing_times(ROLLER, STEM, -STEM * static, restitution, 100_000)
    check(landings, times, times[-1], restitution, ROLLER)
    assert isinstance(trajectory.last, np.ndarray)
    assert trajectory.phases[-1].end - trajectory.phases[-1].begin > 0.9


def test_too_many_events_are_an_error(monkeypatch):
    """A run with more lift-offs and landings than allowed raises an error.

    It contains the limit, the duration of the run and the cam speed.
    """
    monkeypatch.setattr(OneMassTrajectory, "max_events", 100)
    follower = FollowerParameters(1.3, 4030.0, 0.0, PRELOAD, 3.3e8, 0.99)
    flying = FollowerState(0.0, THROWN, 0.0, in_contact=False)
    interval = Interval(0, 30 * NS, 0.0, SPEED)
    message = r"more than 100 events in 30 s at 0\.1 rad/s; allowed: "
    with pytest.raises(DynamicsError, match=message):
        MODELS["one_mass"].advance(law_of("hump"), follower, flying, interval, 100)


# -- chatter: after a landing the stiff stem throws the roller up repeatedly, at 25 kHz

FAST = 450.0 * np.pi / 30.0


@pytest.mark.parametrize(
    "name", ["two_mass_soft", "two_mass_stem", "one_mass_arc", "ball_on_table"]
)
def test_events_are_those_of_fifty_digits(name):
    """All lift-offs and landings agree with 50-digit arithmetic to 1e-13 s.

    The motion agrees to 2e-12 of its largest value.
    """
    # No bounce may be lost or added, although each bounce starts from the result of the previous
    # one. Sixty bounces on the stem amplify a rounding error a hundred times, so that a change of
    # the last digit of stiffness or speed changes a time by 1e-13 s. If it changes more, the limit
    # is five times this change, because rounding depends on the processor.
    case = CASES[name]()
    wanted, got = study.read_reference(case), study.solve(case)
    assert [kind for kind, _ in got.events] == [kind for kind, _ in wanted.events]
    event_s, motion = last_digit(case, got)
    assert got.event_error(wanted) < max(1e-13, 5.0 * event_s)
    assert got.error(wanted) < max(2e-12, 5.0 * motion)


def last_digit(case, got):
    """Return how event times (s) and motion change with the last digit of an input.

    The changed input is the stem or spring stiffness, or the cam speed, each times 1 ± 1e-15. The
    change of the motion is relative to its largest value.
    """
    name = "stem_stiffness" if hasattr(case.model, "stem_stiffness") else "stiffness"
    changes = []
    for last in (-1e-15, 1e-15):
        model = replace(case.model, **{name: getattr(case.model, name) * (1.0 + last)})
        for nudged in (replace(case, model=model), replace(case, speed=case.speed * (1.0 + last))):
            other = study.solve(nudged)
            changes.append((other.event_error(got), other.error(got)))
    return np.max(changes, axis=0)


# -- the contact force touches zero, or falls slightly below it. Near its minimum at θ = 0 it is F =
# ½F''(θ² − θ₀²). The follower lifts off at −θ₀. As the second derivative of the gap is −F/m, it
# lands at exactly +3θ₀, with the impulse (8/3) F'' θ₀³/ω.

FOLLOWER = FollowerParameters(1.3, 4030.0, 8.642, 0.0, 3.3e8)
TWO = TwoMassParameters(0.52, 0.78, 1.26e6, 4030.0, 8.642, 8.642, 1000.0)


@pytest.fixture(scope="module")
def minimum(laws):
    """Minimum of one mass's contact force without preload: angle (rad), value, F''."""
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
    """Return the lift-offs and landings of one mass in one turn with this preload (N)."""
    p = replace(FOLLOWER, preload=preload)
    interval = Interval(0, round(TURN / FAST * NS), 0.0, FAST)
    return MODELS["one_mass"].advance(law, p, None, interval, 1000)[1].events


@pytest.mark.parametrize("hair", [1e-13, 1e-12, 1e-9])
def test_a_force_that_touches_zero_gives_no_event(laws, minimum, hair):
    """The follower stays on the cam if its smallest force is at most 1e-9 above zero.

    The preload is larger, by this fraction, than the preload at which the force just touches zero.
    """
    assert one_turn(laws["poly345"], -minimum[1] * (1.0 + hair)) == ()


@pytest.mark.parametrize("hair", [1e-5, 1e-4])
def test_a_slightly_negative_force_gives_a_flight(laws, minimum, hair):
    """A preload that is slightly too small gives a flight of the predicted length.

    It is 1e-5 or 1e-4 below the preload at which the smallest force is zero. If the force is
    negative within ±θ₀ of its minimum, the follower lifts off at −θ₀ and lands at 3θ₀, within 2 %
    of θ₀. The impulse has a closed form, too.
    """
    angle, depth, curvature = minimum
    half = np.sqrt(2.0 * hair * abs(depth) / curvature)
    off, on = one_turn(laws["poly345"], abs(depth) * (1.0 - hair))
    assert (off.kind, on.kind) == ("lift-off", "landing")
    assert (off.angle - angle) / half == pytest.approx(-1.0, abs=1e-3)
    assert (on.angle - angle) / half == pytest.approx(3.0, abs=0.02)
    assert on.impulse == pytest.approx(8.0 / 3.0 * curvature * half**3 / FAST, rel=0.02)


@pytest.mark.parametrize("hair", [1e-12, 1e-9, 1e-7])
def test_a_gap_below_rounding_gives_two_events(laws, minimum, hair):
    """A flight with a gap below rounding has a lift-off and a landing of impulse 0."""
    off, on = one_turn(laws["poly345"], abs(minimum[1]) * (1.0 - hair))
    assert (off.kind, on.kind) == ("lift-off", "landing")
    assert off.angle < minimum[0] < on.angle
    assert 0.0 <= on.impulse < 1e-8 * FOLLOWER.mass * FAST * laws["poly345"].lift


@pytest.fixture(scope="module")
def two_mass_touch(laws):
    """Preload (N) at which the smallest force of two masses is zero in the first turn."""
    trajectory = Separation(laws["poly345"], TWO, FAST)
    trajectory.run(TURN / FAST)
    assert trajectory.events == []
    times = np.linspace(0.0, TURN / FAST, 20_001)
    forces = states(trajectory, times)[4]
    i = int(np.argmin(forces))
    near = np.linspace(times[i - 1], times[i + 1], 20_001)
    return TWO.preload - float(states(trajectory, near)[4].min()) / TWO.share


@pytest.mark.parametrize("hair", [0.0, 1e-12, 1e-9, -1e-6, -1e-5, -1e-4])
def test_two_masses_touch(laws, two_mass_touch, hair):
    """Two masses lift off if the preload is too small to keep the force above zero.

    The cases are 1e-6 to 1e-4 below the preload at which the force just touches zero. At this
    preload, or up to 1e-9 above it, there is no event.
    """
    p = replace(TWO, preload=two_mass_touch * (1.0 + hair))
    trajectory = Separation(laws["poly345"], p, FAST)
    trajectory.run(TURN / FAST)
    assert [event.kind for event in trajectory.events] == ["lift-off", "landing"] * (hair < 0.0)
    assert all(event.impulse > 0.0 for event in trajectory.events[1:])
