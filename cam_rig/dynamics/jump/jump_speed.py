"""The jump speed: the lowest at which the follower loses contact.

Contact holds at a speed as long as the least contact force of the run is positive. The first zero
of that force is sought at many speeds at once, and then proved by the exact model on either side.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from cam_rig.dynamics.jump.search import SLOWEST, Sought, force_run, sought, sought_speed
from cam_rig.dynamics.parameters import FollowerParameters
from cam_rig.dynamics.two_mass.masses import TwoMassParameters, contact_response
from cam_rig.dynamics.two_mass.trajectory import first_lift_off
from cam_rig.dynamics.velocity_jumps import require_smooth
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law, bernstein
from cam_rig.schema import RigConfig
from cam_rig.units import RPM, TURN, FloatArray

#: Half of what a speed is known to, relative: 0.002 rpm at 400 rpm.
TOLERANCE = 5e-6
#: Longest run from rest, s: after a minute little but the steady state is left.
LONGEST = 60.0


@dataclass(frozen=True)
class Jump:
    """A jump speed, and where contact is lost."""

    speed: float  #: rad/s
    angle: float  #: of the cam in its turn, rad
    time: float  #: from rest, or from the beginning of a turn in steady state, s

    @property
    def rpm(self) -> float:
        """The speed in rpm."""
        return self.speed / RPM


def require_run(duration: float) -> None:
    """Refuse a run from rest that does not last, or for ever."""
    if not 0.0 < duration <= LONGEST:
        raise DynamicsError(
            f"the run from rest lasts {duration:g} s; allowed: above 0, to {LONGEST:g} s, or the "
            "steady state"
        )


def jump_speed(law: Law, parameters: TwoMassParameters, duration: float | None = 1.7) -> Jump:
    """The lowest speed at which two masses lose contact, in ``duration`` s from rest or steady."""
    if duration is not None:
        require_run(duration)
    require_smooth(law, "; where it falls contact is lost at any speed")
    found = sought(law, parameters, duration)
    low, high, time = _prove(partial(_leaves, law, parameters, duration), found)
    return Jump(0.5 * (low + high), float((high * time) % TURN), time)


def _prove(
    lift_off_time: Callable[[float], float | None], found: Sought
) -> tuple[float, float, float]:
    """A speed at which the exact model keeps contact, one at which it does not, and when that is.

    They are `TOLERANCE` on either side of what was found, or bisected down to that. Upwards they
    stay in the bracket: a resonance of little damping is narrower than `TOLERANCE`, and beyond it
    the follower stays on again.
    """
    most = found.high / found.speed - 1.0
    for away in (min(TOLERANCE, 0.5 * most), most, TOLERANCE):
        high = found.speed * (1.0 + away)
        if (time := lift_off_time(high)) is not None:
            break
    else:
        raise DynamicsError(
            f"jump speed: sought {found.speed / RPM:.9g} rpm, but the exact model keeps contact "
            f"up to {found.high / RPM:.9g} rpm; allowed: a resonance that can be resolved, so give "
            "the stem more damping"
        )
    away = TOLERANCE
    while (earlier := lift_off_time(found.speed * (1.0 - away))) is not None:
        high, time = found.speed * (1.0 - away), earlier
        away *= 4.0
    low = found.speed * (1.0 - away)
    while high - low > 4.0 * TOLERANCE * high:
        middle = 0.5 * (low + high)
        at = lift_off_time(middle)
        low, high, time = (middle, high, time) if at is None else (low, middle, at)
    return low, high, time


def _leaves(
    law: Law, parameters: TwoMassParameters, duration: float | None, speed: float
) -> float | None:
    """When (s) the exact model first loses contact, None where it keeps it."""
    start, length = np.zeros(2), duration
    if length is None:
        start, length = contact_response(law, parameters, speed).periodic(), TURN / speed
    return first_lift_off(law, parameters, speed, start, length)


#: A piece is halved no more often: 2^-40 of it is rounding.
HALVINGS = 40
#: Parts that may lower the speed, at most: more are a force of zero all along.
MAX_PARTS = 1 << 16
#: A force below zero by so much of its parts is zero.
ROUNDING = 1e-14
#: Points of a piece for the least force.
POINTS = 2049


def rigid_jump_speed(law: Law, follower: FollowerParameters) -> float:
    """Lowest speed (rad/s) at which m s'' Ω² + c s' Ω + k s + preload is zero; ∞ if at none."""
    return rigid_jump(law, follower)[0]


def rigid_jump(law: Law, follower: FollowerParameters) -> tuple[float, float]:
    """The same with the cam angle (rad) at which contact is lost; NaN where it nowhere is.

    All pieces are bounded at once. What keeps contact up to the lowest speed found so far is left,
    the rest is halved, until rounding decides.
    """
    require_smooth(law, "")
    best, where = math.inf, math.nan
    parts = law.motion.transpose(1, 2, 0)
    begin, width = law.breaks[:-1], law.spans
    for _ in range(HALVINGS):
        speeds = _speeds(follower, np.concatenate([parts[0], parts[-1]]))
        at = int(np.argmin(speeds))
        if speeds[at] < best:
            best, where = float(speeds[at]), float(np.concatenate([begin, begin + width])[at])
        low = may_pull(follower, parts, best)
        if not 0 < low.sum() < MAX_PARTS:
            break
        left, right = bernstein.split(parts[:, low].reshape(len(parts), -1), 0.5)
        parts = np.concatenate([x.reshape(len(parts), -1, 3) for x in (left, right)], axis=1)
        begin, width = begin[low], 0.5 * width[low]
        begin, width = np.concatenate([begin, begin + width]), np.concatenate([width, width])
    return best, where % TURN


def may_pull(follower: FollowerParameters, parts: FloatArray, speed: float) -> NDArray[np.bool_]:
    """Whether the force may be below zero in parts ``(p + 1, n, 3)`` at some speed up to one.

    Each ordinate a Ω² + b Ω + c is taken at the speed where it is least; the force is no lower
    than the lowest of them.
    """
    a, b, c = _quadratic(follower, parts)
    if not math.isfinite(speed):
        return np.asarray(((a < 0.0) | (b < 0.0) | (c < 0.0)).any(axis=0))
    with np.errstate(divide="ignore", invalid="ignore"):
        lowest = np.where(a > 0.0, np.clip(-0.5 * b / a, 0.0, speed), speed)
    least = np.minimum((a * lowest + b) * lowest, (a * speed + b) * speed) + c
    size = (np.abs(a) * speed + np.abs(b)) * speed + np.abs(c)
    return np.asarray((least < -ROUNDING * size).any(axis=0))


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


def _quadratic(
    follower: FollowerParameters, motion: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """a, b, c of the force a Ω² + b Ω + c where s, s', s'' are ``(..., 3)``."""
    s, slope, bend = np.moveaxis(motion, -1, 0)
    c = follower.spring_stiffness * s + follower.preload
    return follower.mass * bend, follower.damping * slope, c


def _speeds(follower: FollowerParameters, motion: FloatArray) -> FloatArray:
    """The least positive root at points ``(n, 3)``, infinite where there is none."""
    a, b, c = _quadratic(follower, motion)
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(b**2 - 4.0 * a * c)
        found = 2.0 * c / np.where(-b + root > 0.0, -b + root, np.nan)
    return np.where(np.isfinite(found) & (found > 0.0), found, np.inf)


#: Length of the run from rest, s, as in Table 2.
FROM_REST = 1.7


def contact_lost_speed(law: Law, rig: RigConfig) -> float:
    """Jump speed (rad/s) on a rig, from rest: 0 where contact is lost at any speed, ∞ at none."""
    if law.velocity_jumps:  # where the velocity jumps down the follower lifts off
        return 0.0
    follower = rig.follower
    if None in (follower.roller_share, follower.stem_stiffness, follower.stem_damping):
        rigid = FollowerParameters.from_rig(rig)
        return 0.0 if rigid.preload == 0.0 else rigid_jump_speed(law, rigid)
    parameters = TwoMassParameters.from_rig(rig)
    try:
        return sought_speed(law, parameters, FROM_REST)
    except DynamicsError:  # below the slowest speed that is looked at, or above the fastest
        slow = force_run(law, parameters, FROM_REST).lowest(SLOWEST * RPM)
        return 0.0 if slow <= 0.0 else math.inf
