"""The sound level where contact may be lost: flights and landings of one mass, exactly simulated.

What a landing adds depends on when and how fast the follower lands, so the level is no convex
function of the law, and steps where a flight begins. Near a law it is taken as linear.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy import sparse

from cam_rig.acoustics import RadiationParameters
from cam_rig.arrays import FloatArray
from cam_rig.laws import Law
from cam_rig.simulation.settled_turns import Acoustics, settled_turns
from cam_rig.studies.design.problem import DesignProblem
from cam_rig.studies.design.programs.affine import Affine
from cam_rig.studies.design.terms import Term

#: Speeds over which the mean power of a range is taken: a turn of each is simulated.
SPEEDS = 13
#: Slopes are central differences over this part of the lift: flights begin and end within it.
STEP = 1e-3


def level_with_jumps(problem: DesignProblem, law: Law, term: Term) -> float:
    """The level (dB) of the mean power over a range of speeds, settled turns, with landings.

    Raises
    ------
    DynamicsError : the law's velocity jumps
    """
    count = 1 if term.low == term.high else SPEEDS
    turns = settled_turns(law, "one_mass", problem.rigid, np.linspace(term.low, term.high, count))
    levels = Acoustics(RadiationParameters.from_rig(problem.rig)).levels(turns)
    power = float(np.mean(10.0 ** (0.1 * (levels - levels.max()))))
    return float(levels.max() + 10.0 * np.log10(power))


@dataclass(frozen=True, eq=False)
class FlightLevel:
    """A goal (``allowed`` None) or a limit on that level, dB."""

    problem: DesignProblem
    name: str
    term: Term
    allowed: float | None
    scale: float = 10.0

    def worst(self, law: Law) -> float:
        """The level."""
        return level_with_jumps(self.problem, law, self.term)

    def rows(self, unknowns: FloatArray, tried: list[FloatArray]) -> Affine:
        """The level near a law; the exact one of the last law that was tried from there."""
        at, slope = tried[-1] if tried else unknowns, self._slope(unknowns.tobytes())
        constant = self._level(at) - slope @ at
        return Affine(constant, sparse.csr_array(slope))

    @lru_cache(maxsize=1)  # noqa: B019 - a term lives as long as its search
    def _slope(self, unknowns: bytes) -> FloatArray:
        """By how much the level grows with each unknown, ``(1, m)``; a step is tried more often."""
        space = self.problem.space
        free = np.frombuffer(unknowns)[: space.unknowns - space.link.constant.size]
        slope = np.zeros((1, space.unknowns))
        for index in range(free.size):
            step = np.zeros(free.size)
            step[index] = STEP
            high, low = (self._level(space.joined(free + sign * step)) for sign in (1.0, -1.0))
            slope[0, index] = (high - low) / (2.0 * STEP)
        return slope

    def _level(self, unknowns: FloatArray) -> float:
        return self.worst(self.problem.space.law(unknowns, "design"))
