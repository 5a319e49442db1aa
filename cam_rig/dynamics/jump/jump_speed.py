"""The jump speed: the lowest at which the follower loses contact.

Contact holds at a speed as long as the least contact force of the run is positive.
"""

from __future__ import annotations

import math

import numpy as np

from cam_rig.dynamics.events.search import call
from cam_rig.dynamics.free_masses import TwoMassParameters
from cam_rig.dynamics.jump.rigid import RigidMass, rigid_zero
from cam_rig.dynamics.jump.search import SLOWEST, Jump, force_run, sought, sought_speed
from cam_rig.dynamics.modal.run import law_series
from cam_rig.dynamics.parameters import FollowerParameters
from cam_rig.dynamics.velocity_jumps import require_smooth
from cam_rig.errors import ConfigError, DynamicsError
from cam_rig.laws import Law, bernstein
from cam_rig.laws.law import TIE, extremes
from cam_rig.schema import RigConfig
from cam_rig.units import RPM, TURN, FloatArray

#: Longest run from rest, s: after a minute little but the steady state is left.
LONGEST = 60.0


def require_run(duration: float) -> None:
    """Refuse a run from rest that does not last, or for ever."""
    if not 0.0 < duration <= LONGEST:
        raise ConfigError(
            f"the run from rest lasts {duration:g} s; allowed: above 0, to {LONGEST:g} s, or the "
            "steady state"
        )


def jump_speed(law: Law, parameters: TwoMassParameters, duration: float | None = 1.7) -> Jump:
    """The lowest speed at which two masses lose contact, in ``duration`` s from rest or steady."""
    if duration is not None:
        require_run(duration)
    require_smooth(law, "; where it falls contact is lost at any speed")
    return sought(law, parameters, duration)


#: Points of a piece for the least force.
POINTS = 2049


def rigid_jump_speed(law: Law, follower: FollowerParameters) -> float:
    """Lowest speed (rad/s) at which m s'' Ω² + c s' Ω + k s + preload is zero; ∞ if at none."""
    return rigid_jump(law, follower)[0]


def rigid_jump(law: Law, follower: FollowerParameters) -> tuple[float, float]:
    """The same with the cam angle (rad) at which contact is lost; NaN where it nowhere is.

    Without a preload the force of a dwell on the base circle is zero, and contact is kept there: a
    force is lost that falls below what the lift's rounding is worth.
    """
    require_smooth(law, "")
    lift, stiffness = law.motion[0], follower.spring_stiffness
    rounding = TIE * stiffness * float(abs(lift).max())
    if follower.preload + stiffness * lift.min() < -rounding:  # an ordinate; the law too?
        low, _ = extremes(law, 0)
        if follower.preload + stiffness * low.value < -rounding:
            return 0.0, low.angle
    preload = max(follower.preload, rounding)
    mass = RigidMass(*map(float, (follower.mass, follower.damping, stiffness, preload)))
    speed, where = call(rigid_zero, law_series(law), mass)
    return float(speed), float(where) % TURN


def rigid_least(law: Law, follower: FollowerParameters, speeds: FloatArray) -> FloatArray:
    """The least contact force (N) of a turn at speeds (rad/s), ``(n,)``, on `POINTS` a piece."""
    u = np.linspace(0.0, 1.0, POINTS)
    least = np.full(speeds.size, np.inf)
    for piece in range(law.spans.size):
        s, slope, bend = bernstein.evaluate(law.motion[:, :, piece].T, u).T
        still = follower.spring_stiffness * s + follower.preload
        for i, speed in enumerate(speeds.tolist()):
            force = (follower.mass * bend * speed + follower.damping * slope) * speed + still
            least[i] = min(least[i], float(force.min()))
    return least


#: Length of the run from rest, s, as in Table 2.
FROM_REST = 1.7


def contact_lost_speed(law: Law, rig: RigConfig) -> float:
    """Jump speed (rad/s) on a rig, from rest: 0 where contact is lost at any speed, ∞ at none."""
    if law.velocity_jumps:  # where the velocity jumps down the follower lifts off
        return 0.0
    follower = rig.follower
    if None in (follower.roller_share, follower.stem_stiffness, follower.stem_damping):
        rigid = FollowerParameters.from_rig(rig)
        return rigid_jump_speed(law, rigid)
    parameters = TwoMassParameters.from_rig(rig)
    try:
        return sought_speed(law, parameters, FROM_REST)
    except DynamicsError:  # below the slowest speed that is looked at, or above the fastest
        slow = force_run(law, parameters, FROM_REST).lowest(SLOWEST * RPM)
        return 0.0 if slow <= 0.0 else math.inf
