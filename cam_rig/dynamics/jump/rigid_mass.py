"""Jump speed and least contact force of one rigid mass."""

from __future__ import annotations

import numpy as np

from cam_rig.dynamics.events.backend import dispatch
from cam_rig.dynamics.jump.rigid_zero import RigidMass, find_rigid_zero
from cam_rig.dynamics.modal.law_series import law_series
from cam_rig.dynamics.parameters import FollowerParameters
from cam_rig.dynamics.velocity_jumps import require_smooth
from cam_rig.laws import Law, bernstein
from cam_rig.laws.law import TIE, extremes
from cam_rig.units import TURN, FloatArray

#: Points per piece at which the least force is evaluated.
POINTS_PER_PIECE = 2049


def rigid_jump_speed(law: Law, follower: FollowerParameters) -> float:
    """Return the lowest speed (rad/s) at which m s'' Ω² + c s' Ω + k s + preload is zero, or ∞."""
    return rigid_jump(law, follower)[0]


def rigid_jump(law: Law, follower: FollowerParameters) -> tuple[float, float]:
    """Return the jump speed (rad/s) and the cam angle (rad) of the loss of contact; ∞, NaN if none.

    Without a preload the force is zero in a dwell on the base circle, where contact is kept. So
    only a force that is below the rounding of the lift counts as lost.
    """
    require_smooth(law, "")
    lift, stiffness = law.motion[0], follower.spring_stiffness
    rounding = TIE * stiffness * float(abs(lift).max())
    # An ordinate may be lower than the law itself.
    if follower.preload + stiffness * lift.min() < -rounding:
        low, _ = extremes(law, 0)
        if follower.preload + stiffness * low.value < -rounding:
            return 0.0, low.angle
    mass = RigidMass(
        mass=float(follower.mass),
        damping=float(follower.damping),
        stiffness=float(stiffness),
        preload=float(max(follower.preload, rounding)),
    )
    speed, angle = dispatch(find_rigid_zero, law_series(law), mass)
    return float(speed), float(angle) % TURN


def rigid_min_force(law: Law, follower: FollowerParameters, speeds: FloatArray) -> FloatArray:
    """Return the least contact force (N) of a turn at speeds (rad/s), ``(n,)``.

    It is evaluated at `POINTS_PER_PIECE` points of each piece.
    """
    u = np.linspace(0.0, 1.0, POINTS_PER_PIECE)
    lowest = np.full(speeds.size, np.inf)
    for piece in range(law.spans.size):
        s, slope, curvature = bernstein.evaluate(law.motion[:, :, piece].T, u).T
        static = follower.spring_stiffness * s + follower.preload
        for i, speed in enumerate(speeds.tolist()):
            force = (follower.mass * curvature * speed + follower.damping * slope) * speed + static
            lowest[i] = min(lowest[i], float(force.min()))
    return lowest
