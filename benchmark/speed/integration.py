"""Solution of a case by a peer, interval by interval and phase by phase.

An interval is a part of the law without a joint, and a phase is contact or flight.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from benchmark.speed.models import BenchModel, Case, Solution, Twist, Vector
from benchmark.speed.problem import (
    Arrival,
    Floats,
    Integrator,
    PeerError,
    PeerInterval,
    Problem,
    Scalar,
    intervals,
    linear_problem,
)
from cam_rig.units import FloatArray

#: Number of events above which a peer has failed. All cases have fewer.
MAX_EVENTS = 20_000

#: Weights of s, ṡ, s̈ and 1, one quantity per row.
MOTION = np.eye(4).tolist()


@dataclass
class _Integration:
    case: Case
    model: BenchModel
    integrate: Integrator
    outputs: list[tuple[FloatArray, FloatArray]] = field(default_factory=list)
    events: list[tuple[str, float]] = field(default_factory=list)
    _problems: dict[tuple[str, int], Problem] = field(default_factory=dict)
    _motions: dict[int, list[Scalar]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.phases = self.model.phases()

    def through(
        self, start: float, interval: PeerInterval, name: str, q: Vector
    ) -> tuple[str, Vector]:
        """Integrate an interval that starts at ``start`` (s)."""
        local = self.case.times - start
        local = local[(local >= 0.0) & (local < interval.duration)]
        time = 0.0
        phase = self.phases[name]
        if phase.on_cam and phase.guard_value(q, self._motion(interval, time)) < 0.0:
            name, q = self._switch(name, q, interval, time, start)
        while True:
            times = local[local > time]
            arrival = self._advance(interval, name, q, time, times)
            self._show(interval, name, times, arrival)
            time, q = arrival.time, arrival.state
            if not arrival.hit:
                return name, q
            name, q = self._switch(name, q, interval, time, start)

    def _advance(
        self, interval: PeerInterval, name: str, q: Vector, time: float, times: FloatArray
    ) -> Arrival:
        if self.phases[name].size == 0:
            return self._in_contact(interval, name, time, times)
        key = (name, id(interval))
        if key not in self._problems:
            phase = self.phases[name]
            self._problems[key] = linear_problem(phase, interval, self._scale(phase.size))
        return self.integrate(self._problems[key], q, time, interval.duration, times)

    def _in_contact(
        self, interval: PeerInterval, name: str, time: float, times: FloatArray
    ) -> Arrival:
        """Find the first sign change of the contact force, which needs no integration."""
        force = interval.function(self.phases[name].guard_drive)
        grid = np.linspace(time, interval.duration, 65).tolist()
        for low, high in pairwise(grid):
            if force(high) < 0.0:
                crossing = low if force(low) <= 0.0 else float(brentq(force, low, high, xtol=1e-16))
                return Arrival(
                    crossing, [], np.empty((0, np.count_nonzero(times <= crossing))), True
                )
        return Arrival(interval.duration, [], np.empty((0, times.size)), False)

    def _scale(self, size: int) -> FloatArray:
        """Return the usual size of the states: the lift, and the lift times the speed."""
        positions = np.full(size // 2, self.case.law.lift)
        return np.concatenate([positions, positions * self.case.speed])

    def _show(self, interval: PeerInterval, name: str, times: FloatArray, arrival: Arrival) -> None:
        for time, q in zip(times, arrival.states.T, strict=False):
            motion = self._motion(interval, float(time))
            x, v = self.phases[name].outputs(q.tolist(), motion)
            self.outputs.append((np.array(x), np.array(v)))

    def _switch(
        self, name: str, q: Vector, interval: PeerInterval, time: float, start: float
    ) -> tuple[str, Vector]:
        name, q, kinds = self.model.switch(name, q, self._motion(interval, time))
        self.events += [(kind, start + time) for kind in kinds]
        if len(self.events) > MAX_EVENTS:
            raise PeerError(f"more than {MAX_EVENTS} events")
        return name, q

    def _motion(self, interval: PeerInterval, time: float) -> list[float]:
        if id(interval) not in self._motions:
            self._motions[id(interval)] = [interval.function(row) for row in MOTION]
        return [function(time) for function in self._motions[id(interval)]]


def integrate_case(case: Case, integrate: Integrator) -> Solution:
    """Solve a case of linear phases with a peer."""
    assert isinstance(case.model, BenchModel)
    run = _Integration(case, case.model, integrate)
    name, q = case.model.begin()
    for start, interval in intervals(case.law, case.speed, case.turns):
        name, q = run.through(start, interval, name, q)
    x, v = (np.array(rows).T for rows in zip(*run.outputs, strict=True))
    return Solution(x, v, tuple(run.events))


# -- solution of the torsional case by a peer, with the joints of the law as events

#: Usual size of a twist (rad).
TWIST = 1e-3

#: Angle (rad) beyond the joint of an untwisted cam by which a joint is reached.
REACH = 0.1


def joint_problem(model: Twist, interval: PeerInterval, speed: float) -> Problem:
    """Return the equation of motion on an interval. The guard is the next joint.

    ``interval`` is computed for a speed of 1 rad/s, so its time is the cam angle.
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
    """Law at an angle since the start of the interval (Horner's rule)."""

    def __init__(self, interval: PeerInterval) -> None:
        ends = interval.ends.tolist()
        self._inner = ends[:-1]
        lows = [0.0, *self._inner]
        self._middles = [0.5 * (low + high) for low, high in zip(lows, ends, strict=True)]
        self._terms = [
            np.trim_zeros(row, "b").tolist()[::-1] or [0.0] for row in interval.series[:, 0]
        ]

    def motion(self, angle: float) -> tuple[float, float, float]:
        """Return lift and its first two derivatives."""
        i = bisect_right(self._inner, angle) if self._inner else 0
        x = angle - self._middles[i]
        s = s1 = s2 = 0.0
        for term in self._terms[i]:
            s2 = s2 * x + s1
            s1 = s1 * x + s
            s = s * x + term
        return s, s1, 2.0 * s2

    def third(self, angle: float) -> float:
        """Return the third derivative."""
        i = bisect_right(self._inner, angle) if self._inner else 0
        x, terms = angle - self._middles[i], self._terms[i]
        total, degree = 0.0, len(terms) - 1
        for j, term in enumerate(terms[:-3]):
            power = degree - j
            total = total * x + power * (power - 1) * (power - 2) * term
        return total


def integrate_torsion(case: Case, integrate: Integrator) -> Solution:
    """Solve the torsional case with a peer."""
    assert isinstance(case.model, Twist)
    problems: dict[int, Problem] = {}
    state: Floats = (0.0, 0.0)
    time, outputs = 0.0, []
    for low, interval in intervals(case.law, 1.0, case.turns):
        if id(interval) not in problems:
            problems[id(interval)] = joint_problem(case.model, interval, case.speed)
        origin = low / case.speed
        latest = min(origin + (interval.duration + REACH) / case.speed, case.duration)
        if time >= latest:
            break
        ahead = case.times[(case.times > time) & (case.times < latest)] - origin
        done = integrate(problems[id(interval)], state, time - origin, latest - origin, ahead)
        outputs.append(done.states)
        time, state = origin + done.time, done.state
    rows = np.hstack(outputs)
    return Solution(rows[:1], rows[1:])
