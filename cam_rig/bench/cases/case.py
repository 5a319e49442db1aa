"""A case of the study, and a solution of it by whichever solver."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.bench.cases.models import BenchModel, Twist
from cam_rig.laws import Law
from cam_rig.units import TURN


@dataclass(frozen=True, eq=False)
class Case:
    """One model on one law at one speed.

    Parameters
    ----------
    model : its numbers, and through them its equations
    speed : rad/s
    turns : of the cam, from angle 0
    times : ``(n,)`` output times in s
    quick_turns : what is left of the turns in a quick study
    """

    name: str
    title: str
    law: Law
    model: BenchModel | Twist
    speed: float
    turns: int
    quick_turns: int
    times: FloatArray

    @property
    def duration(self) -> float:
        """Length in s."""
        return self.turns * TURN / self.speed

    def first_turns(self, turns: int) -> Case:
        """The beginning of the case, with the output times that fall into it."""
        short = replace(self, turns=min(turns, self.turns))
        return replace(short, times=self.times[self.times <= short.duration])

    def fresh(self) -> Case:
        """The same case with a law for which nothing has been computed yet."""
        return replace(self, law=Law(self.law.name, self.law.breaks, self.law.ordinates))


def output_times(speed: float, turns: int, per_turn: int) -> FloatArray:
    """``per_turn`` times in each turn, none at its ends."""
    count = turns * per_turn
    return np.asarray((np.arange(count) + 0.5) * (turns * TURN / speed / count))


@dataclass(frozen=True, eq=False)
class Solution:
    """What is compared.

    Parameters
    ----------
    displacement, velocity : ``(k, n)`` at the case's output times, SI units
    events : kind and time (s), in order
    """

    displacement: FloatArray
    velocity: FloatArray
    events: tuple[tuple[str, float], ...] = ()

    def error(self, reference: Solution) -> float:
        """Largest difference relative to the largest value, the worse of the two kinds."""
        pairs = (
            (self.displacement, reference.displacement),
            (self.velocity, reference.velocity),
        )
        return max(float(np.abs(x - y).max() / np.abs(y).max()) for x, y in pairs)

    def event_error(self, reference: Solution) -> float | None:
        """Largest time (s) from an event to the nearest one of its kind in the other solution.

        A missed or an invented event so counts with its distance. None without any events,
        infinite where only one of the two has a kind.
        """
        kinds = {kind for kind, _ in (*self.events, *reference.events)}
        return max((self._apart(reference, kind) for kind in kinds), default=None)

    def _apart(self, reference: Solution, kind: str) -> float:
        mine, other = (
            np.array([time for k, time in events if k == kind])
            for events in (self.events, reference.events)
        )
        if not (mine.size and other.size):
            return float("inf")
        distance = np.abs(mine[:, None] - other[None, :])
        return float(max(distance.min(axis=0).max(), distance.min(axis=1).max()))
