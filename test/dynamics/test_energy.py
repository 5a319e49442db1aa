"""Energy: what the cam puts in is stored, burnt in the dampers, or lost in landings.

Gauss and Legendre's rule on stretches without a joint or an event inside is exact to rounding: the
account closes to 1e-10 and below where every event is one.
"""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from cam_rig.dynamics import Interval, TwoMassParameters
from cam_rig.dynamics.one_mass import OneMassTrajectory
from cam_rig.dynamics.torsional.model import TorsionalParameters, TorsionalState
from cam_rig.dynamics.torsional.motion import solve
from cam_rig.dynamics.two_mass import Separation, phase_states
from cam_rig.laws import Law
from cam_rig.units import RPM, TURN

from . import helpers
from .helpers import CALM, MS, cut_at_joints, gauss

SPEED = 350.0 * RPM
SOFT = helpers.TWO
STEM = TwoMassParameters(0.52, 0.78, 3.3e8, 4030.0, 8.642, 8.642, 12.753)
FREE = replace(STEM, stem_damping=0.0, damping=0.0)


def missing_of_one(law, p, speed, milliseconds):
    """What the account of one mass does not explain, relative to what flowed; and the course."""
    course = OneMassTrajectory(law, p, Interval(0, milliseconds * MS, 0.0, speed))
    course.run(None)
    work = burnt = 0.0
    for phase in course.phases:
        for a, b in itertools.pairwise(cut_at_joints(law, speed, phase.begin, phase.end)):
            t, weights = gauss(np.linspace(a, b, 3), 20)
            if phase.flight is None:
                s, v, acceleration = (law(speed * t, k) * speed**k for k in range(3))
                force = p.mass * acceleration + p.damping * v + p.spring_stiffness * s + p.preload
                work += weights @ (force * v)
            else:
                v = phase.flight.motion(t - phase.begin)[1]
            burnt += weights @ (p.damping * v**2)
    landings = [event for event in course.events if event.kind == "landing"]
    work += sum(e.impulse * law.at(e.angle)[1] * speed for e in landings)
    lost = sum(e.energy_lost for e in landings)

    def stored(y, v):
        return 0.5 * p.mass * v**2 + 0.5 * p.spring_stiffness * y**2 + p.preload * y

    last = course.phases[-1]
    end = [x * speed**k for k, x in enumerate(law.at(speed * last.end)[:2])]
    if last.flight is not None:
        end = [float(x[0]) for x in last.flight.motion(np.array([last.end - last.begin]))[:2]]
    s, slope, _ = law.at(0.0)
    change = stored(*end) - stored(s, slope * speed)
    return abs(work - burnt - lost - change) / (abs(work) + lost + burnt), course


@pytest.mark.variants(4)
@pytest.mark.parametrize("name", ["poly345", "poly4567", "cycloidal", "bezier15"])
@pytest.mark.parametrize("restitution", [0.0, 0.5, 0.9])
@pytest.mark.parametrize("milliseconds", [110, 300, 333])
def test_one_mass(laws, follower, name, restitution, milliseconds):
    """Over a run with flights, some that the end cuts: to 1e-10 of the work done."""
    p = replace(follower, restitution=restitution)
    gap, course = missing_of_one(laws[name], p, 600.0 * RPM, milliseconds)
    assert any(event.kind == "landing" for event in course.events)
    assert gap < 1e-10


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_one_mass_struck_by_an_edge(edge, restitution):
    """The cam's blows work at its new velocity."""
    p = replace(helpers.ONE, restitution=restitution)
    gap, course = missing_of_one(edge, p, 100.0 * RPM, 550)
    assert sum(event.energy_lost for event in course.events) > 0.1
    assert gap < 1e-10


def stored_in_two(p, state):
    """Kinetic energy of both masses, of both springs, and of the loads, J."""
    z, v, y, w = state[:4]
    kinetic = 0.5 * p.roller_mass * v**2 + 0.5 * p.end_mass * w**2
    springs = 0.5 * p.stem_stiffness * (z - y) ** 2 + 0.5 * p.spring_stiffness * y**2
    return kinetic + springs + p.preload * y


TWO = [
    ("poly345", SOFT, 450.0, 2.3, 1e-12),
    ("poly345", STEM, 600.0, 1.0, 1e-12),
    ("poly345", FREE, 450.0, 2.3, 1e-12),
    ("poly345", replace(FREE, stem_stiffness=1e10), 600.0, 1.0, 1e-12),
    ("tm21", STEM, 450.0, 1.3, 1e-12),  # forces that jump, and a roller that leaves at a joint
    ("poly345", replace(SOFT, restitution=0.5), 600.0, 1.0, 1e-10),
    ("poly345", replace(SOFT, restitution=0.9), 450.0, 1.0, 1e-10),
    ("poly345", replace(STEM, restitution=0.5), 450.0, 1.0, 1e-10),
    ("edge", CALM, 100.0, 0.96, 1e-10),
]


@pytest.mark.parametrize(("cam", "p", "rpm", "turns", "limit"), TWO)
def test_two_masses(laws, edge, cam, p, rpm, turns, limit):
    """The roller's relative kinetic energy, or (1 − e²) of it, is gone with each landing.

    The limit is relative to ∫|F ṡ| dt.
    """
    law, speed = edge if cam == "edge" else laws[cam], rpm * RPM
    found = Separation(law, p, speed)
    found.run(turns * TURN / speed)
    assert len(found.events) >= 4
    work = flowed = burnt = 0.0
    fastest = float(np.abs(np.linalg.eigvals(p.inner_matrix)).max())  # of the free motion, rad/s
    for phase in found.phases:
        for a, b in itertools.pairwise(cut_at_joints(law, speed, phase.begin, phase.end)):
            edges = np.linspace(a, b, 3 + int((b - a) * fastest / 2.0))
            times, weights = gauss(edges, 16)
            _, v, _, w, force = phase_states(found, phase, times)
            power = force * speed * law(speed * times, 1)
            work, flowed = work + weights @ power, flowed + weights @ np.abs(power)
            burnt += weights @ (p.stem_damping * (v - w) ** 2 + p.damping * w**2)
    for event in found.events:  # an impulse works at the velocity of the cam
        by_impulse = event.impulse * speed * law.at(event.angle)[1]
        work, flowed = work + by_impulse, flowed + abs(by_impulse)
    first, last = found.phases[0], found.phases[-1]
    begun = stored_in_two(p, phase_states(found, first, np.array([first.begin])))[0]
    ended = stored_in_two(p, phase_states(found, last, np.array([last.end])))[0]
    lost = sum(event.energy_lost for event in found.events)
    assert abs(work - burnt - lost - (ended - begun)) / flowed < limit


# A cam on its shaft.


def stored_in_shaft(motion, times):
    """Energy (J) of cam, follower, its spring, and the shaft's twist."""
    p, f = motion.parameters, motion.parameters.follower
    twist, _, angle, speed = motion.at(times)[:4]
    s, s1 = motion.law(angle), motion.law(angle, 1)
    energy = 0.5 * (p.cam_inertia + f.mass * s1**2) * speed**2
    spring = (0.5 * f.spring_stiffness * s + f.preload) * s
    return energy + spring + 0.5 * p.shaft_stiffness * twist**2


@pytest.mark.variants(3)
def test_shaft(law, follower):
    """What the flywheel of fixed speed gives is stored or burnt, to 1e-11 of what flows."""
    shaft, duration = TorsionalParameters(follower, 0.02, 8e3, 0.4), 2.3 * TURN / SPEED
    motion = solve(law, shaft, TorsionalState(2e-4, -0.1, 0.7, SPEED), 0.0, duration)
    times, weights = gauss(motion.path.edges, 48)
    given = -SPEED * motion.shaft_torque(times)
    change = float(np.diff(stored_in_shaft(motion, np.array([0.0, duration])))[0])
    _, twist_rate, angle, speed = motion.at(times)[:4]
    velocity = law(angle, 1) * speed
    lost = weights @ (shaft.shaft_damping * twist_rate**2 + follower.damping * velocity**2)
    assert lost > 0.0
    assert weights @ given == pytest.approx(change + lost, abs=1e-11 * (weights @ np.abs(given)))


@pytest.mark.variants(4)
@pytest.mark.parametrize("speed", [0.0, 3.0])
def test_shaft_without_damping(law, follower, speed):
    """No damper: what is stored changes by the flywheel's work alone, turning back too."""
    p = TorsionalParameters(replace(follower, damping=0.0), 0.02, 5e3)
    motion = solve(law, p, TorsionalState(0.05, 5.0, 2.6, speed), 0.0, 0.3)
    instants = np.linspace(0.0, 0.3, 2000)
    total, speeds = stored_in_shaft(motion, instants), motion.at(instants)[3]
    times, weights = gauss(motion.path.edges, 48)
    given = -speed * (weights @ motion.shaft_torque(times))
    assert total[-1] - total[0] == pytest.approx(given, abs=1e-9 * total.max())
    assert speeds.min() < 0.0 < speeds.max()
    if speed == 0.0:  # a flywheel at rest does no work
        np.testing.assert_allclose(total, total[0], rtol=1e-11)


def test_free_vibration_of_a_shaft_is_exact(follower):
    """I ψ̈ + c ψ̇ + k ψ = 0 from weakly damped through critical (c = 20) to creeping."""
    disc, times = Law("round", np.array([0.0, TURN]), np.zeros((1, 1))), np.linspace(0.0, 0.2, 501)
    for damping in (0.0, 0.4, 19.9, 20.0, 300.0):
        p = TorsionalParameters(follower, 0.02, 5e3, damping)
        got = solve(disc, p, TorsionalState(1e-3, 0.4, 0.0, SPEED), 0.0, 0.2).at(times)
        if damping == 20.0:
            twist = (1e-3 + (0.4 + 0.5) * times) * np.exp(-500.0 * times)
        else:
            roots = np.roots([p.cam_inertia, damping, p.shaft_stiffness]).astype(complex)
            a = np.linalg.solve(np.stack([np.ones(2), roots]), np.array([1e-3, 0.4]))
            twist = (np.exp(np.outer(times, roots)) @ a).real
        np.testing.assert_allclose(got[0], twist, rtol=0, atol=2e-13 * np.abs(twist).max())
        np.testing.assert_allclose(got[2] - got[0], SPEED * times, rtol=0, atol=1e-14)
