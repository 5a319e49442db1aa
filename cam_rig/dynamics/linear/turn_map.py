"""What one turn of the cam does to a linear model's state: x becomes Φ x + r."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cam_rig.arrays import FloatArray

#: A mode that a turn changes by less than this (in phase and size) is in resonance.
RESONANT = 1e-11


@dataclass(frozen=True, eq=False)
class TurnMap:
    """Φ ``(n, n)`` and r ``(n,)`` of one turn from θ = 0."""

    flow: FloatArray
    rest: FloatArray

    def after(self, state: FloatArray, turns: int) -> FloatArray:
        """The state ``(n,)`` after whole turns: as many products as their number has bits."""
        flow, rest = self.flow, self.rest
        while turns:
            if turns % 2:
                state = flow @ state + rest
            rest, flow, turns = flow @ rest + rest, flow @ flow, turns // 2
        return state

    def fixed_point(self) -> FloatArray | None:
        """The state that a turn brings back, by one linear solve; None at resonance."""
        gap = np.eye(self.rest.size) - self.flow
        if np.abs(np.linalg.eigvals(gap)).min() < RESONANT:
            return None
        return np.asarray(np.linalg.solve(gap, self.rest))
