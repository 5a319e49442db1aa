"""How much of a cam's advantage is its lower acceleration, and how much less residual vibration.

A rigid follower feels the law's slopes alone. So the logarithm of a ratio of jump speeds, or
of peak accelerations, is exactly the sum of two: that of the rigid follower, and the rest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from cam_rig.studies.factorial.design import Factorial
from cam_rig.studies.factorial.measures import Measures


@dataclass(frozen=True)
class Advantage:
    """By how much the proposed cam is better than ``cam``, as logarithms (0.01 is about 1 %).

    ``jump`` = ``jump_slopes`` + vibration, the same for acceleration; ``residual`` is vibration.
    ``noise`` in dB: of the slopes alone, on a rigid follower.
    """

    cam: str
    jump: float
    jump_slopes: float
    acceleration: float
    acceleration_slopes: float
    residual: float
    noise: float

    @property
    def jump_share(self) -> float:
        """Share of the slopes in the jump speed's advantage."""
        return self.jump_slopes / self.jump

    @property
    def acceleration_share(self) -> float:
        """Share of the slopes in the acceleration's advantage."""
        return self.acceleration_slopes / self.acceleration


def advantages(found: Factorial) -> list[Advantage]:
    """The proposed cam against each other cam of a study."""
    proposed = found.config.proposed
    best = found.cams[proposed]
    return [_over(cam, best, other) for cam, other in found.cams.items() if cam != proposed]


def _over(cam: str, best: Measures, other: Measures) -> Advantage:
    return Advantage(
        cam=cam,
        jump=math.log(best.jump / other.jump),
        jump_slopes=math.log(best.rigid_jump / other.rigid_jump),
        acceleration=math.log(other.acceleration / best.acceleration),
        acceleration_slopes=math.log(other.own_acceleration / best.own_acceleration),
        residual=math.log(other.residual / best.residual),
        noise=other.noise - best.noise,
    )
