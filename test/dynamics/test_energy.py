"""Energy: what the cam puts in is stored, burnt in the damper, or lost in landings."""

import dataclasses
import itertools

import numpy as np
import pytest

from cam_rig.dynamics import Interval
from cam_rig.dynamics.kinetostatic import force_weights
from cam_rig.dynamics.one_mass import OneMassTrajectory
from cam_rig.units import NS, TURN

NODES, WEIGHTS = np.polynomial.legendre.leggauss(20)


def integral(value, begin, end, parts):
    """∫ value dt by Gauss-Legendre on equal parts; 20 nodes are exact to degree 39."""
    edges = np.linspace(begin, end, parts + 1)
    half = 0.5 * np.diff(edges)
    times = (edges[:-1] + half)[:, None] + half[:, None] * NODES
    return float(np.sum(half[:, None] * WEIGHTS * value(times.ravel()).reshape(times.shape)))


class Account:
    """The four entries of the energy account of a run, J."""

    def __init__(self, course):
        self.course, self.law, self.p = course, course.law, course.parameters
        self.speed = course.interval.speed
        self.input = self.burnt = 0.0
        for phase in course.phases:
            if phase.flight is None:
                self.ride(phase.begin, phase.end)
            else:
                self.burnt += integral(
                    lambda t, f=phase: self.p.damping * f.flight.state(t - f.begin)[1] ** 2,
                    phase.begin,
                    phase.end,
                    8,
                )
        landings = [event for event in course.events if event.kind == "landing"]
        self.input += sum(e.impulse * course.on_cam(e.time).velocity for e in landings)
        self.lost = sum(event.energy_lost for event in landings)

    def ride(self, begin, end):
        """Work of the contact force, joint by joint."""
        turns = np.arange(0, 10)[:, None] * TURN
        joints = ((self.law.breaks[:-1] + turns) / self.speed).ravel()
        edges = [begin, *joints[(joints > begin) & (joints < end)], end]
        for a, b in itertools.pairwise(edges):
            self.input += integral(lambda t: self.force(t) * self.velocity(t), a, b, 1)
            self.burnt += integral(lambda t: self.p.damping * self.velocity(t) ** 2, a, b, 1)

    def velocity(self, t):
        return self.speed * self.law(self.speed * t, 1)

    def force(self, t):
        motion = np.stack([self.law(self.speed * t, order) for order in range(3)])
        return force_weights(self.p, self.speed) @ motion + self.p.preload

    def stored(self, y, v):
        p = self.p
        return 0.5 * p.mass * v**2 + 0.5 * p.spring_stiffness * y**2 + p.preload * y


@pytest.mark.variants(8)
@pytest.mark.parametrize("name", ["poly345", "poly4567", "cycloidal", "bezier15"])
@pytest.mark.parametrize("restitution", [0.0, 0.5, 0.9])
@pytest.mark.parametrize("milliseconds", [110, 300, 333])
def test_energy_balance(laws, follower, name, restitution, milliseconds):
    """Over a run with flights the account closes to 1e-10 of the work done."""
    p = dataclasses.replace(follower, restitution=restitution)
    interval = Interval(0, milliseconds * NS // 1000, 0.0, 600.0 * np.pi / 30.0)
    course = OneMassTrajectory(laws[name], p, interval)
    course.run(None)
    account = Account(course)
    assert any(event.kind == "landing" for event in course.events)
    begin = course.on_cam(0.0)
    last = course.phases[-1]
    if last.flight is None:
        end = course.on_cam(interval.duration)
        y, v = end.displacement, end.velocity
    else:
        y, v = (float(x[0]) for x in last.flight.state(np.array([last.end - last.begin])))
    change = account.stored(y, v) - account.stored(begin.displacement, begin.velocity)
    scale = abs(account.input) + account.lost + account.burnt
    balance = account.input - account.burnt - account.lost - change
    assert abs(balance) < 1e-10 * scale
