"""Jump speed and least contact force of one rigid mass."""

from __future__ import annotations

import numpy as np

from cam_rig.dynamics.events.backend import dispatch
from cam_rig.dynamics.jump.rigid_zero import RigidMass, find_rigid_zero
from cam_rig.dynamics.modal.law_series import law_series
from cam_rig.dynamics.parameters import FollowerParameters
from cam_rig.dynamics.velocity_jumps import require_smooth
from cam_rig.laws import Law, bernstein
from cam_rig.laws.law import TIE_RTOL, extremes
from cam_rig.units import TURN, FloatArray

#: Number of points per polynomial piece of the law at which the contact force is evaluated to find
#: its minimum.
POINTS_PER_PIECE = 2049


def rigid_jump_speed(law: Law, follower: FollowerParameters) -> float:
    """Return the jump speed (rad/s) of a follower of one rigid mass.

    It is infinite if contact is kept at every speed, and 0 if contact is lost at every speed.
    """
    return rigid_jump(law, follower)[0]


def rigid_jump(law: Law, follower: FollowerParameters) -> tuple[float, float]:
    """Return the jump speed of one rigid mass, and the cam angle of the contact loss.

    The speed is in rad/s and the angle in rad. They are infinite and NaN if contact is kept at
    every speed. The speed is 0 if contact is lost at every speed. Without a preload the force is
    zero in a dwell on the base circle, and contact is kept there. Therefore a force counts as
    negative only beyond the rounding error of the lift.
    """
    require_smooth(law, "")
    lift, stiffness = law.motion[0], follower.spring_stiffness
    rounding = TIE_RTOL * stiffness * float(abs(lift).max())
    # An ordinate may be lower than the law itself, so the exact minimum decides.
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
    """Return the least contact force (N) of one rigid mass over a turn, shape (n,).

    ``speeds`` are n cam speeds in rad/s. The force is evaluated at `POINTS_PER_PIECE` points of
    each polynomial piece of the law.
    """
    u = np.linspace(0.0, 1.0, POINTS_PER_PIECE)
    minima = np.full(speeds.size, np.inf)
    for piece in range(law.spans.size):
        s, slope, curvature = bernstein.evaluate(law.motion[:, :, piece].T, u).T
        static = follower.spring_stiffness * s + follower.preload
        for i, speed in enumerate(speeds.tolist()):
            force = (follower.mass * curvature * speed + follower.damping * slope) * speed + static
            minima[i] = min(minima[i], float(force.min()))
    return minima
