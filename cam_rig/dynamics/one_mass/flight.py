"""One mass in the air: m ÿ + c ẏ + k y + preload = 0."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from cam_rig.dynamics.linear.free_system import Flight, FreeSystem, Pairs
from cam_rig.dynamics.parameters import FollowerParameters


@lru_cache(maxsize=64)
def free_mass(parameters: FollowerParameters) -> FreeSystem:
    """The follower without the cam; its state is (y, ẏ) in m and m/s."""
    p = parameters
    stiffness, damping = p.spring_stiffness / p.mass, p.damping / p.mass
    return FreeSystem(
        matrix=np.array([[0.0, 1.0], [-stiffness, -damping]]),
        load=np.array([0.0, -p.preload / p.mass]),
        row=np.array([1.0, 0.0]),
        energy=np.diag([np.sqrt(stiffness), 1.0]),
        pairs=Pairs(np.eye(2), np.eye(2), np.array([damping]), np.array([stiffness])),
    )


def lifted_off(
    parameters: FollowerParameters,
    start: float,
    velocity: float,
    gap: float | None = None,
    opening: float | None = None,
) -> Flight:
    """The flight from a displacement (m) and a velocity (m/s); the rest as in `Flight`."""
    return Flight(free_mass(parameters), np.array([start, velocity]), gap, opening)
