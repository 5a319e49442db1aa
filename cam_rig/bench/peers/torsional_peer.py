"""Takes a peer through the torsional case; the joints of the law are its events.

The peer's state is the twist φ and its rate. Its time begins, in each interval, where an untwisted
cam would pass the joint, so that the right-hand side is the same in every turn.
"""

from __future__ import annotations

from bisect import bisect_right

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.bench.cases.case import Case, Solution
from cam_rig.bench.cases.models import Twist
from cam_rig.bench.peers.intervals import PeerInterval, intervals
from cam_rig.bench.peers.problem import Floats, Integrator, Problem

#: Usual size of a twist, rad.
TWIST = 1e-3
#: The joint comes within this angle (rad) of where an untwisted cam would reach it.
REACH = 0.1


def joint_problem(model: Twist, interval: PeerInterval, speed: float) -> Problem:
    """The equation of motion on one interval, with the joint at its end as the guard.

    ``interval`` is made for a speed of 1 rad/s: its time is the cam's angle.
    """
    m, c, k, preload = model.mass, model.damping, model.stiffness, model.preload
    inertia, shaft, span = model.inertia, model.shaft_stiffness, interval.duration
    law = _LawInAngle(interval)

    def rate(time: float, q: list[float]) -> Floats:
        twist, twist_rate = q
        s, s1, s2 = law.motion(speed * time + twist)
        turning = speed + twist_rate
        force = (m * s2 * turning + c * s1) * turning + k * s + preload
        return twist_rate, -(shaft * twist + force * s1) / (inertia + m * s1 * s1)

    def jacobian(time: float, q: list[float]) -> FloatArray:
        twist, twist_rate = q
        angle, turning = speed * time + twist, speed + twist_rate
        s, s1, s2 = law.motion(angle)
        s3 = law.third(angle)
        mass = inertia + m * s1 * s1
        force = (m * s2 * turning + c * s1) * turning + k * s + preload
        slope = (m * s3 * turning + c * s2) * turning + k * s1
        load = shaft * twist + force * s1
        by_twist = -(shaft + slope * s1 + force * s2) / mass + load * 2 * m * s1 * s2 / mass**2
        by_rate = -(2.0 * m * s2 * turning + c * s1) * s1 / mass
        return np.array([[0.0, 1.0], [by_twist, by_rate]])

    scale = np.array([TWIST, TWIST * np.sqrt(shaft / inertia)])
    return Problem(rate, jacobian, False, lambda t, q: span - speed * t - q[0], scale)


class _LawInAngle:
    """The law at an angle since the interval's beginning, by Horner's rule."""

    def __init__(self, interval: PeerInterval) -> None:
        ends = interval.ends.tolist()
        self._inner = ends[:-1]
        lows = [0.0, *self._inner]
        self._middles = [0.5 * (low + high) for low, high in zip(lows, ends, strict=True)]
        self._terms = [
            np.trim_zeros(row, "b").tolist()[::-1] or [0.0] for row in interval.series[:, 0]
        ]

    def motion(self, angle: float) -> tuple[float, float, float]:
        """Lift and its first two derivatives."""
        i = bisect_right(self._inner, angle) if self._inner else 0
        x = angle - self._middles[i]
        s = s1 = s2 = 0.0
        for term in self._terms[i]:
            s2 = s2 * x + s1
            s1 = s1 * x + s
            s = s * x + term
        return s, s1, 2.0 * s2

    def third(self, angle: float) -> float:
        """Third derivative."""
        i = bisect_right(self._inner, angle) if self._inner else 0
        x, terms = angle - self._middles[i], self._terms[i]
        total, degree = 0.0, len(terms) - 1
        for j, term in enumerate(terms[:-3]):
            power = degree - j
            total = total * x + power * (power - 1) * (power - 2) * term
        return total


def integrate_case(case: Case, integrate: Integrator) -> Solution:
    """Solve the torsional case with a peer."""
    assert isinstance(case.model, Twist)
    problems: dict[int, Problem] = {}
    state: Floats = (0.0, 0.0)
    now, shown = 0.0, []
    for low, interval in intervals(case.law, 1.0, case.turns):
        if id(interval) not in problems:
            problems[id(interval)] = joint_problem(case.model, interval, case.speed)
        origin = low / case.speed
        latest = min(origin + (interval.duration + REACH) / case.speed, case.duration)
        if now >= latest:
            break
        ahead = case.times[(case.times > now) & (case.times < latest)] - origin
        done = integrate(problems[id(interval)], state, now - origin, latest - origin, ahead)
        shown.append(done.states)
        now, state = origin + done.time, done.state
    rows = np.hstack(shown)
    return Solution(rows[:1], rows[1:])
