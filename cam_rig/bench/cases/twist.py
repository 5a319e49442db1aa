"""The torsional model of the study: a cam on an elastic shaft that a flywheel turns evenly.

Eq. 10 of the paper with θ_v = ωt, the law taken at the twisted angle θ = ωt + φ:

    (I + m s'²) φ̈ = −k_s φ − (m s'' θ̇² + c s' θ̇ + k s + preload) s'.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Twist:
    """Numbers of the torsional model.

    Parameters
    ----------
    inertia : of the cam, kg·m²
    shaft_stiffness : N·m/rad
    mass, damping, stiffness, preload : the follower's, SI units
    """

    inertia: float
    shaft_stiffness: float
    mass: float
    damping: float
    stiffness: float
    preload: float
