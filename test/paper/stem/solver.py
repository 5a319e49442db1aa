"""A chain of masses through the rig's exact solver, which the series is held against."""

import numpy as np

from cam_rig.dynamics.linear.response import LinearResponse
from cam_rig.dynamics.linear.sampling import Outputs, sample
from cam_rig.units import TURN


def chain_response(law, stem, speed):
    """A chain in contact through the rig's exact solver; outputs contact force and head, N and m.

    The state is displacement and velocity of each node behind the foot about their static place
    under the lift, in turn from the foot on: so the lift's rounding is not multiplied by the stem.
    """
    f, n = stem.follower, int(stem.elements)
    masses = np.full(n, stem.mass / n)
    masses[-1] = 0.5 * stem.mass / n + stem.head_mass
    ladder = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    ladder[-1, -1] = 1.0
    stiffness, damping = n * f.stem_stiffness * ladder, n * f.stem_damping * ladder
    stiffness[-1, -1] += f.spring_stiffness
    damping[-1, -1] += f.damping
    left = f.spring_stiffness / f.stiffness  # 1 − α
    static = 1.0 - left * np.arange(1, n + 1) / n
    matrix = np.zeros((2 * n, 2 * n))
    matrix[::2, 1::2] = np.eye(n)
    matrix[1::2, ::2] = -stiffness / masses[:, None]
    matrix[1::2, 1::2] = -damping / masses[:, None]
    drive = np.zeros((2 * n, 3))
    drive[1::2, 1] = -damping @ static
    drive[1, 1] += n * f.stem_damping
    drive[1::2, 1] /= masses
    drive[1::2, 2] = -static
    state, motion = np.zeros((2, 2 * n)), np.zeros((2, 3))
    state[0, :2] = -n * f.stem_stiffness, -n * f.stem_damping
    state[1, -2] = 1.0
    motion[0] = f.stem_stiffness * left, f.stem_damping * left, stem.on_cam
    motion[1, 0] = f.share
    preload = np.array([f.share * f.preload, -f.preload / f.stiffness])
    return LinearResponse(law, speed, matrix, drive, np.zeros(2 * n)), Outputs(
        state, motion, preload
    )


def exact(law, stem, speed, count):
    """Force and head of a steady turn, ``(2, count)``."""
    model, outputs = chain_response(law, stem, speed)
    return sample(model, model.periodic(), 0.0, 0.0, TURN / speed / count, count, outputs)
