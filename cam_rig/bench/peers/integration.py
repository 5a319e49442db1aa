"""Takes a peer through a case: interval after interval of the law, phase after phase."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from cam_rig.arrays import FloatArray
from cam_rig.bench.cases.case import Case, Solution
from cam_rig.bench.cases.models import BenchModel
from cam_rig.bench.cases.phase import Vector
from cam_rig.bench.peers.intervals import PeerInterval, Scalar, intervals
from cam_rig.bench.peers.problem import Arrival, Integrator, PeerError, Problem, linear_problem

#: No case has so many: a peer that finds more is lost.
MAX_EVENTS = 20_000
#: Weights of s, ṡ, s̈ and 1, one by one.
MOTION = np.eye(4).tolist()


@dataclass
class _Integration:
    case: Case
    model: BenchModel
    integrate: Integrator
    shown: list[tuple[FloatArray, FloatArray]] = field(default_factory=list)
    events: list[tuple[str, float]] = field(default_factory=list)
    _problems: dict[tuple[str, int], Problem] = field(default_factory=dict)
    _motions: dict[int, list[Scalar]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.phases = self.model.phases()

    def through(
        self, start: float, interval: PeerInterval, name: str, q: Vector
    ) -> tuple[str, Vector]:
        """One interval that begins at ``start`` (s)."""
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
        """Contact with nothing to integrate: the first sign change of the contact force."""
        force = interval.function(self.phases[name].guard_drive)
        grid = np.linspace(time, interval.duration, 65).tolist()
        for low, high in pairwise(grid):
            if force(high) < 0.0:
                at = low if force(low) <= 0.0 else float(brentq(force, low, high, xtol=1e-16))
                return Arrival(at, [], np.empty((0, np.count_nonzero(times <= at))), True)
        return Arrival(interval.duration, [], np.empty((0, times.size)), False)

    def _scale(self, size: int) -> FloatArray:
        """Usual size of the states: lift, and lift in the time of one radian."""
        positions = np.full(size // 2, self.case.law.lift)
        return np.concatenate([positions, positions * self.case.speed])

    def _show(self, interval: PeerInterval, name: str, times: FloatArray, arrival: Arrival) -> None:
        for time, q in zip(times, arrival.states.T, strict=False):
            motion = self._motion(interval, float(time))
            x, v = self.phases[name].shown(q.tolist(), motion)
            self.shown.append((np.array(x), np.array(v)))

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
    x, v = (np.array(rows).T for rows in zip(*run.shown, strict=True))
    return Solution(x, v, tuple(run.events))
