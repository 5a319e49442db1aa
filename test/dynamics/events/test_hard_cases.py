"""What is hard for a search of events: long series, grazes, instants next to each other, NaN."""

import itertools
import math

import mpmath as mp
import numpy as np
import pytest

from cam_rig.dynamics import FollowerParameters, FollowerState, Interval, TwoMassParameters
from cam_rig.dynamics.events.free_flight import impulse_at
from cam_rig.dynamics.linear.exponential import response
from cam_rig.dynamics.one_mass import OneMassTrajectory, lifted_off
from cam_rig.dynamics.two_mass.trajectory import Separation, lift_off
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.units import NS, TURN

from ..one_flight import land

#: A dwell from 1 to 6 rad, at zero lift.
DWELL = Law(
    "dwell",
    [0.0, 0.5, 1.0, 6.0, TURN],
    [[0.0, 0.01, 0.0, 0.0], [0.0, 0.01, 0.0, 0.0], [0.01, 0.0, 0.0, 0.0], [0.01, 0.0, 0.0, 0.0]],
)


def thrown(velocity, p, seconds):
    """The events of a follower thrown up from the dwell at a velocity (m/s), without damping."""
    course = OneMassTrajectory(DWELL, p, Interval(0, round(seconds * NS), 1.2, 1e-3))
    course.run(FollowerState(0.0, velocity, 0.0, in_contact=False, inner=(0.0, velocity)))
    return course.events


def bounces(velocity, p, count):
    """Times and impulses of the bounces with 50 digits: tan(ω T/2) = v k/(ω F)."""
    with mp.workdps(50):
        rate = mp.sqrt(mp.mpf(p.spring_stiffness) / mp.mpf(p.mass))
        time, v, found = mp.mpf(0), mp.mpf(velocity), []
        for _ in range(count):
            time += 2 / rate * mp.atan(v * mp.mpf(p.spring_stiffness) / (rate * mp.mpf(p.preload)))
            found.append((time, mp.mpf(p.mass) * (1 + mp.mpf(p.restitution)) * v))
            v *= mp.mpf(p.restitution)
        return found


def test_four_hundred_bounces():
    """With e = 0.99, each from where the last ended: times to 1e-12 s, impulses to 1e-12."""
    p = FollowerParameters(1.3, 4030.0, 0.0, 12.753, 3.3e8, 0.99)
    found, exact = thrown(0.3, p, 40.0)[:400], bounces(0.3, p, 400)
    assert len(found) == 400
    for event, (time, impulse) in zip(found, exact, strict=True):
        assert event.kind == "landing"
        assert abs(float(event.time - time)) < 1e-12
        assert event.impulse == pytest.approx(float(impulse), rel=1e-12)


def test_events_within_a_nanosecond():
    """A hard spring's last bounces: in order, none at the time of another, none left out."""
    p = FollowerParameters(1.3, 4030.0, 0.0, 2.6e6, 3.3e8, 0.5)
    times = [event.time for event in thrown(0.1, p, 0.01)]
    exact = [float(time) for time, _ in bounces(0.1, p, len(times))]
    gaps = [b - a for a, b in itertools.pairwise(times)]
    assert 0.0 < min(gaps) < 1e-9
    assert times == pytest.approx(exact, abs=1e-15)


@pytest.mark.parametrize(("higher", "landed"), [(-1e-12, False), (1e-12, True)])
def test_a_joint_that_is_touched(higher, landed):
    """A peak at a joint, a picometre below or above the top of the flight over it."""
    p = FollowerParameters(1.3, 4030.0, 0.0, 12.753, 3.3e8)
    rate, speed = math.sqrt(p.spring_stiffness / p.mass), 30.0
    top, velocity = math.atan(0.3 * p.spring_stiffness / (rate * p.preload)) / rate, 0.3
    static = p.preload / p.spring_stiffness
    peak = math.hypot(velocity / rate, static) - static + higher
    joint, angle = 2.0, 2.0 - speed * top
    rise = [[0.0, 0.0, peak, 0.0], [0.0, 0.0, peak, 0.0], [0.0, peak, 0.0, 0.0]]
    breaks = [0.0, joint - 0.05, joint, joint + 0.05, TURN]
    law = Law("peak", breaks, [*rise, [0.0, peak, 0.0, 0.0]])
    flight = lifted_off(p, 0.0, velocity, 0.0, velocity)
    found = land(flight, law, angle, speed, 1.5 * top)
    assert found.landed == landed
    if landed:
        assert found.time == pytest.approx(top, abs=1e-6)


@pytest.mark.parametrize("damping", [0.0, 8.642, "critical", 1e4])
def test_any_damping(damping):
    """None, critical and much of it: the landing is a zero of the 50-digit motion."""
    mass, stiffness, preload, velocity = 1.3, 4030.0, 12.753, 0.3
    damping = 2.0 * math.sqrt(stiffness * mass) if damping == "critical" else damping
    p = FollowerParameters(mass, stiffness, damping, preload, 3.3e8)
    time = land(lifted_off(p, 0.0, velocity, 0.0, velocity), DWELL, 1.2, 1e-3, 5.0).time
    with mp.workdps(50):
        rows = [[0, 1, 0], [-stiffness, -damping, -preload], [0, 0, 0]]
        matrix = mp.matrix([[mp.mpf(x) for x in row] for row in rows])
        matrix[1, :] = matrix[1, :] / mp.mpf(mass)
        end = mp.expm(matrix * mp.mpf(time)) * mp.matrix([0, mp.mpf(velocity), 1])
        assert abs(float(end[0] / end[1])) < 1e-15 * max(1.0, 100.0 * time)


def test_one_time_is_as_many():
    """The impulse response at one time is that of `impulse_response`, to some roundings."""
    rng = np.random.default_rng(5)
    for _ in range(2000):
        stiffness, time = 10.0 ** rng.uniform(-3.0, 9.0), 10.0 ** rng.uniform(-9.0, 0.0)
        many = 10.0 ** rng.uniform(-3.0, 6.0)
        damping = float(rng.choice([0.0, many, 2.0 * math.sqrt(stiffness)]))
        one = np.array(impulse_at(damping, stiffness, time))
        other = np.array(response(damping, stiffness, np.array([time])))[:, 0]
        quick = min(time, 1.0 / math.sqrt(stiffness))
        sizes = np.maximum(abs(other), [1e-2 * quick, 1e-2, 1e-2 * quick * time])
        assert np.all(abs(one - other) <= 1e-13 * sizes)


def test_what_is_no_number_is_refused_before_the_search():
    """Parameters, states, limits and speeds: by name, in plain Python, before a table is made."""
    nan = math.nan
    two = TwoMassParameters(0.5, 0.5, 1e6, 4e3, 1.0, 1.0, 30.0)
    for numbers in itertools.product((1.3, nan), repeat=2):
        if nan in numbers:
            with pytest.raises(DynamicsError):
                FollowerParameters(numbers[0], 4030.0, numbers[1], 12.0, 3.3e8)
    with pytest.raises(DynamicsError, match="roller_mass is nan"):
        TwoMassParameters(nan, 0.5, 1e6, 4e3, 1.0, 1.0, 30.0)
    with pytest.raises(DynamicsError, match="state: has"):
        lift_off(DWELL, two, 1.0, 0.0, np.array([0.0, nan]), 1.0)
    with pytest.raises(DynamicsError, match="limit is nan"):
        lift_off(DWELL, two, 1.0, 0.0, np.zeros(2), nan)
    with pytest.raises(DynamicsError, match="speed is nan"):
        Separation(DWELL, two, nan)
    with pytest.raises(DynamicsError, match="state: has"):
        Separation(DWELL, two, 1.0).run(1.0, np.array([nan, 0.0]))
