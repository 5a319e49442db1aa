"""Energy balance: the cam's work is stored, dissipated or lost in landings.

The integrals use the Gauss-Legendre rule between the joints of the law and the events, where it is
exact to rounding. Any missing or wrong lift-off or landing would violate the balance.
"""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from cam_rig.dynamics import Interval, TwoMassParameters
from cam_rig.dynamics.one_mass import OneMassTrajectory
from cam_rig.dynamics.torsional.model import TorsionalParameters, TorsionalState
from cam_rig.dynamics.torsional.motion import solve
from cam_rig.dynamics.two_mass import Separation, states
from cam_rig.laws import Law
from cam_rig.units import RPM, TURN

from . import helpers
from .helpers import CALM, MS, cut_at_joints, gauss

SPEED = 350.0 * RPM
SOFT = helpers.TWO
STEM = TwoMassParameters(0.52, 0.78, 3.3e8, 4030.0, 8.642, 8.642, 12.753)
FREE = replace(STEM, stem_damping=0.0, damping=0.0)


def balance_error(law, p, speed, milliseconds):
    """Return the error of the energy balance of one mass, and its trajectory.

    The error is relative to work, losses and dissipation together. `speed` is in rad/s.
    """
    trajectory = OneMassTrajectory(law, p, Interval(0, milliseconds * MS, 0.0, speed))
    trajectory.run(None)
    work = dissipated = 0.0
    for phase in trajectory.phases:
        for a, b in itertools.pairwise(cut_at_joints(law, speed, phase.begin, phase.end)):
            t, weights = gauss(np.linspace(a, b, 3), 20)
            if phase.flight is None:
                s, v, acceleration = (law(speed * t, k) * speed**k for k in range(3))
                force = p.mass * acceleration + p.damping * v + p.spring_stiffness * s + p.preload
                work += weights @ (force * v)
            else:
                v = phase.flight.motion(t - phase.begin)[1]
            dissipated += weights @ (p.damping * v**2)
    landings = [event for event in trajectory.events if event.kind == "landing"]
    work += sum(e.impulse * law.at(e.angle)[1] * speed for e in landings)
    lost = sum(e.energy_lost for e in landings)

    def stored(y, v):
        return 0.5 * p.mass * v**2 + 0.5 * p.spring_stiffness * y**2 + p.preload * y

    last = trajectory.phases[-1]
    end = [x * speed**k for k, x in enumerate(law.at(speed * last.end)[:2])]
    if last.flight is not None:
        end = [float(x[0]) for x in last.flight.motion(np.array([last.end - last.begin]))[:2]]
    s, slope, _ = law.at(0.0)
    change = stored(*end) - stored(s, slope * speed)
    total = abs(work) + lost + dissipated
    return abs(work - dissipated - lost - change) / total, trajectory


@pytest.mark.variants(4)
@pytest.mark.parametrize("name", ["poly345", "poly4567", "cycloidal", "bezier15"])
@pytest.mark.parametrize("restitution", [0.0, 0.5, 0.9])
@pytest.mark.parametrize("milliseconds", [110, 300, 333])
def test_one_mass(laws, follower, name, restitution, milliseconds):
    """A run of one mass with flights satisfies the energy balance to 1e-10, relative.

    This applies also if the run ends in a flight.
    """
    p = replace(follower, restitution=restitution)
    error, trajectory = balance_error(laws[name], p, 600.0 * RPM, milliseconds)
    assert any(event.kind == "landing" for event in trajectory.events)
    assert error < 1e-10


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_one_mass_with_velocity_jumps(edge, restitution):
    """At a velocity jump of the cam, the work is the impulse times the new velocity.

    The energy balance is satisfied to 1e-10.
    """
    p = replace(helpers.ONE, restitution=restitution)
    error, trajectory = balance_error(edge, p, 100.0 * RPM, 550)
    assert sum(event.energy_lost for event in trajectory.events) > 0.1
    assert error < 1e-10


def stored_in_two(p, state):
    """Return the energy (J) that two masses, both springs and the preload store.

    `state` has positions and velocities.
    """
    z, v, y, w = state[:4]
    kinetic = 0.5 * p.roller_mass * v**2 + 0.5 * p.end_mass * w**2
    springs = 0.5 * p.stem_stiffness * (z - y) ** 2 + 0.5 * p.spring_stiffness * y**2
    return kinetic + springs + p.preload * y


TWO = [
    ("poly345", SOFT, 450.0, 2.3, 1e-12),
    ("poly345", STEM, 600.0, 1.0, 1e-12),
    ("poly345", FREE, 450.0, 2.3, 1e-12),
    ("poly345", replace(FREE, stem_stiffness=1e10), 600.0, 1.0, 1e-12),
    ("tm21", STEM, 450.0, 1.3, 1e-12),  # lifts off at a joint
    ("poly345", replace(SOFT, restitution=0.5), 600.0, 1.0, 1e-10),
    ("poly345", replace(SOFT, restitution=0.9), 450.0, 1.0, 1e-10),
    ("poly345", replace(STEM, restitution=0.5), 450.0, 1.0, 1e-10),
    ("edge", CALM, 100.0, 0.96, 1e-10),
]


@pytest.mark.parametrize(("cam", "p", "rpm", "turns", "limit"), TWO)
def test_two_masses(laws, edge, cam, p, rpm, turns, limit):
    """Runs of two masses satisfy the energy balance within the limit of each case.

    Each landing loses the relative kinetic energy of the roller times (1 − e²), with the
    restitution e. The limit is relative to ∫|F ṡ| dt of the contact force F.
    """
    law, speed = edge if cam == "edge" else laws[cam], rpm * RPM
    trajectory = Separation(law, p, speed)
    trajectory.run(turns * TURN / speed)
    assert len(trajectory.events) >= 4
    work = flow = dissipated = 0.0
    max_rate = float(np.abs(np.linalg.eigvals(p.inner_matrix)).max())  # of the free motion, rad/s
    for phase in trajectory.phases:
        for a, b in itertools.pairwise(cut_at_joints(law, speed, phase.begin, phase.end)):
            edges = np.linspace(a, b, 3 + int((b - a) * max_rate / 2.0))
            times, weights = gauss(edges, 16)
            _, v, _, w, force = states(trajectory, times)
            power = force * speed * law(speed * times, 1)
            work, flow = work + weights @ power, flow + weights @ np.abs(power)
            dissipated += weights @ (p.stem_damping * (v - w) ** 2 + p.damping * w**2)
    for event in trajectory.events:  # an impulse works at the cam's velocity
        by_impulse = event.impulse * speed * law.at(event.angle)[1]
        work, flow = work + by_impulse, flow + abs(by_impulse)
    first, last = trajectory.phases[0], trajectory.phases[-1]
    start = stored_in_two(p, states(trajectory, np.array([first.begin])))[0]
    end = stored_in_two(p, states(trajectory, np.array([last.end])))[0]
    lost = sum(event.energy_lost for event in trajectory.events)
    assert abs(work - dissipated - lost - (end - start)) / flow < limit


# -- cam on an elastic shaft


def stored_in_shaft(motion, times):
    """Return the stored energy (J) of cam, follower, spring and shaft.

    `times` are in s.
    """
    p, f = motion.parameters, motion.parameters.follower
    twist, _, angle, speed = motion.at(times)[:4]
    s, s1 = motion.law(angle), motion.law(angle, 1)
    energy = 0.5 * (p.cam_inertia + f.mass * s1**2) * speed**2
    spring = (0.5 * f.spring_stiffness * s + f.preload) * s
    return energy + spring + 0.5 * p.shaft_stiffness * twist**2


@pytest.mark.variants(3)
def test_shaft(law, follower):
    """The work of a flywheel at constant speed is stored or dissipated.

    The energy balance of the elastic shaft is satisfied to 1e-11 of the total work.
    """
    shaft, duration = TorsionalParameters(follower, 0.02, 8e3, 0.4), 2.3 * TURN / SPEED
    motion = solve(law, shaft, TorsionalState(2e-4, -0.1, 0.7, SPEED), 0.0, duration)
    times, weights = gauss(motion.path.edges, 48)
    power = -SPEED * motion.shaft_torque(times)
    change = float(np.diff(stored_in_shaft(motion, np.array([0.0, duration])))[0])
    _, twist_rate, angle, speed = motion.at(times)[:4]
    velocity = law(angle, 1) * speed
    lost = weights @ (shaft.shaft_damping * twist_rate**2 + follower.damping * velocity**2)
    assert lost > 0.0
    assert weights @ power == pytest.approx(change + lost, abs=1e-11 * (weights @ np.abs(power)))


@pytest.mark.variants(4)
@pytest.mark.parametrize("speed", [0.0, 3.0])
def test_shaft_without_damping(law, follower, speed):
    """Without damping the stored energy changes only by the work of the flywheel.

    The energy is stored in shaft and follower. The flywheel has a constant speed.
    """
    p = TorsionalParameters(replace(follower, damping=0.0), 0.02, 5e3)
    motion = solve(law, p, TorsionalState(0.05, 5.0, 2.6, speed), 0.0, 0.3)
    instants = np.linspace(0.0, 0.3, 2000)
    total, speeds = stored_in_shaft(motion, instants), motion.at(instants)[3]
    times, weights = gauss(motion.path.edges, 48)
    work = -speed * (weights @ motion.shaft_torque(times))
    assert total[-1] - total[0] == pytest.approx(work, abs=1e-9 * total.max())
    assert speeds.min() < 0.0 < speeds.max()
    if speed == 0.0:  # a flywheel at rest does no work
        np.testing.assert_allclose(total, total[0], rtol=1e-11)


def test_free_vibration_of_a_shaft_is_exact(follower):
    """The free twist of a shaft is exact to 2e-13 of its peak.

    The twist ψ satisfies I ψ̈ + c ψ̇ + k ψ = 0. The damping is weak, critical (c = 20 N·m·s/rad)
    and strong.
    """
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
