"""The two-mass follower of eq. 14-19: a roller mass and an end mass, joined by the stem.

In contact z = s and the end mass alone is free:

    m₂ ÿ + (c₁ + c₂) ẏ + (k₁ + k₂) y = c₁ ṡ + k₁ s − preload
    F = m₁ s̈ + c₁ (ṡ − ẏ) + k₁ (s − y)

In flight F = 0 and both masses are. In contact the state is the vibration η of y about its static
place, y = α s − preload/(k₁ + k₂) + η with α = k₁/(k₁ + k₂), so that the rounding of the
lift is not multiplied by the stem's stiffness. k₁ is the stem, k₂ the closing spring (the paper's
names); z and y are measured from where the springs carry no force but the preload.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.dynamics.input_limits import require_number
from cam_rig.dynamics.linear.response import LinearResponse
from cam_rig.dynamics.linear.sampling import Outputs
from cam_rig.dynamics.parameters import si_or_none
from cam_rig.laws import Law
from cam_rig.schema import RigConfig

#: What two masses need of a rig beside what one needs, and what is said where it is missing.
NEEDED = ("roller_share", "stem_stiffness", "stem_damping")
BY, ONE_MASS = "two masses (the model two_mass)", "take one mass (the model one_mass)"


@dataclass(frozen=True)
class TwoMassParameters:
    """The numbers of the model, SI.

    Parameters
    ----------
    roller_mass, end_mass : m₁ and m₂, kg
    stem_stiffness, spring_stiffness : k₁ and k₂, N/m
    stem_damping, damping : c₁ (in the stem) and c₂ (end mass to ground), N·s/m
    preload : N, of the closing spring at zero lift
    restitution : Newton's coefficient of a landing of the roller mass; None if not told
    """

    roller_mass: float
    end_mass: float
    stem_stiffness: float
    spring_stiffness: float
    stem_damping: float
    damping: float
    preload: float
    restitution: float | None = 0.0

    def __post_init__(self) -> None:
        positive = ("roller_mass", "end_mass", "stem_stiffness", "spring_stiffness")
        words = dict.fromkeys(positive, "> 0") | {"restitution": "in [0, 1)"}
        for name, value in vars(self).items():
            if value is not None or name != "restitution":
                require_number(name, value, words.get(name, "≥ 0"))

    @classmethod
    def from_rig(cls, rig: RigConfig) -> TwoMassParameters:
        """Take the numbers of a rig file.

        Raises
        ------
        ConfigError : the file has no stem, or does not say how the mass is split
        """
        follower = rig.follower
        share, stem, stem_damping = (rig.need(key, BY, ONE_MASS).si for key in NEEDED)
        roller = follower.mass.si * share
        return cls(
            roller_mass=roller,
            end_mass=follower.mass.si - roller,
            stem_stiffness=stem,
            spring_stiffness=follower.spring_stiffness.si,
            stem_damping=stem_damping,
            damping=follower.damping.si,
            preload=follower.preload.si,
            restitution=si_or_none(follower.restitution),
        )

    @cached_property
    def stiffness(self) -> float:
        """k₁ + k₂, N/m."""
        return self.stem_stiffness + self.spring_stiffness

    @cached_property
    def share(self) -> float:
        """α, the static share of the lift that the end mass follows."""
        return self.stem_stiffness / self.stiffness

    def static_place(self, cam: FloatArray) -> FloatArray:
        """(y, ẏ) without vibration where s and ṡ are the first two rows of ``cam``."""
        return np.stack([self.share * cam[0] - self.preload / self.stiffness, self.share * cam[1]])

    @cached_property
    def flight_matrix(self) -> FloatArray:
        """A of (z, ż, y, ẏ) in flight."""
        m1, m2 = self.roller_mass, self.end_mass
        k1, k2, c1, c2 = (
            self.stem_stiffness,
            self.spring_stiffness,
            self.stem_damping,
            self.damping,
        )
        return np.array(
            [
                [0.0, 1.0, 0.0, 0.0],
                [-k1 / m1, -c1 / m1, k1 / m1, c1 / m1],
                [0.0, 0.0, 0.0, 1.0],
                [k1 / m2, c1 / m2, -(k1 + k2) / m2, -(c1 + c2) / m2],
            ]
        )

    @cached_property
    def inner_matrix(self) -> FloatArray:
        """A of flight in (w, ẇ, Y, Ẏ): stretch w = y − z of the stem, and centre of mass Y.

        In these the slow and the fast mode stand apart; in z and y the closing spring drowns in
        the rounding of the stem, 1e5 times as stiff.
        """
        m1, m2 = self.roller_mass, self.end_mass
        total, both = m1 + m2, 1.0 / m1 + 1.0 / m2
        share, end = m1 / total, 1.0 / m2
        k1, c1 = self.stem_stiffness, self.stem_damping
        k2, c2 = self.spring_stiffness, self.damping
        fast = [-k1 * both - k2 * share * end, -c1 * both - c2 * share * end, -k2 * end, -c2 * end]
        slow = [-k2 * share / total, -c2 * share / total, -k2 / total, -c2 / total]
        return np.array([[0.0, 1.0, 0.0, 0.0], fast, [0.0, 0.0, 0.0, 1.0], slow])

    @cached_property
    def flight_load(self) -> FloatArray:
        """Constant part of the state's rate in flight."""
        return np.array([0.0, 0.0, 0.0, -self.preload / self.end_mass])

    @cached_property
    def fastest_rate(self) -> float:
        """Largest |eigenvalue| of the free motion, rad/s."""
        return float(np.abs(np.linalg.eigvals(self.flight_matrix)).max())


@lru_cache(maxsize=64)
def contact_response(law: Law, parameters: TwoMassParameters, speed: float) -> LinearResponse:
    """The end mass while the roller is in contact; state (η, η̇).

    A jump of the law's velocity is for the caller: the roller may not stay on the cam.
    """
    p, damping = parameters, parameters.stem_damping + parameters.damping
    matrix = np.array([[0.0, 1.0], [-p.stiffness / p.end_mass, -damping / p.end_mass]])
    drive = np.zeros((2, 3))
    drive[1, 1:] = (p.stem_damping - damping * p.share) / p.end_mass, -p.share
    return LinearResponse(law, speed, matrix, drive, np.zeros(2))


@lru_cache(maxsize=64)
def force_output(parameters: TwoMassParameters) -> Outputs:
    """One row: the contact force."""
    p = parameters
    state = np.array([[-p.stem_stiffness, -p.stem_damping]])
    left = p.spring_stiffness / p.stiffness  # 1 − α, without its cancellation
    law = np.array([[p.stem_stiffness * left, p.stem_damping * left, p.roller_mass]])
    return Outputs(state, law, np.array([p.share * p.preload]))
