"""The jump speed: the lowest at which the follower loses contact.

Contact holds at a speed as long as the least contact force of the run is positive. The first zero
of that force is sought at many speeds at once, and then proved by the exact model on either side.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cam_rig.dynamics.two_mass.events import first_lift_off
from cam_rig.dynamics.two_mass.parameters import TwoMassParameters, contact_response
from cam_rig.dynamics.velocity_jumps import require_smooth
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.studies.jump.search import Sought, sought
from cam_rig.units import RPM, TURN

#: Half of what a speed is known to, relative: 0.002 rpm at 400 rpm.
TOLERANCE = 5e-6


#: Longest run from rest, s: after a minute little but the steady state is left.
LONGEST = 60.0


@dataclass(frozen=True)
class Jump:
    """A jump speed (rad/s); where (rad of cam angle in its turn) and when (s) contact is lost.

    ``time`` counts from rest, or from the beginning of a turn in steady state.
    """

    speed: float
    angle: float
    time: float

    @property
    def rpm(self) -> float:
        """The speed in rpm."""
        return self.speed / RPM


def require_run(duration: float) -> None:
    """Refuse a run from rest that does not last, or for ever.

    Raises
    ------
    DynamicsError : with its length (s) and the limits
    """
    if not 0.0 < duration <= LONGEST:
        raise DynamicsError(
            f"the run from rest lasts {duration:g} s; allowed: above 0, to {LONGEST:g} s, or the "
            "steady state"
        )


def jump_speed(law: Law, parameters: TwoMassParameters, duration: float | None = 1.7) -> Jump:
    """The lowest speed at which the two-mass follower loses contact.

    Parameters
    ----------
    duration : s of a run from rest at θ = 0, at one speed; None for the steady state

    Raises
    ------
    DynamicsError : a duration out of its limits; contact lost at every speed or at none; or no
        steady state
    """
    if duration is not None:
        require_run(duration)
    require_smooth(law, "; where it falls contact is lost at any speed")
    found = sought(law, parameters, duration)

    def lift_off_time(speed: float) -> float | None:
        return _leaves(law, parameters, speed, duration)

    low, high, time = _prove(lift_off_time, found)
    return Jump(0.5 * (low + high), float((high * time) % TURN), time)


def _prove(
    lift_off_time: Callable[[float], float | None], found: Sought
) -> tuple[float, float, float]:
    """A speed at which the exact model keeps contact, one at which it does not, and when that is.

    They are `TOLERANCE` on either side of what was found, or bisected down to that. Upwards they
    stay in the bracket: a resonance of little damping is narrower than `TOLERANCE`, and beyond it
    the follower stays on again.

    Raises
    ------
    DynamicsError : the exact model loses contact nowhere in the bracket, nor `TOLERANCE` above
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
    law: Law, parameters: TwoMassParameters, speed: float, duration: float | None
) -> float | None:
    """When (s) the exact model first loses contact, None where it keeps it."""
    start, length = np.zeros(2), duration
    if length is None:
        start, length = contact_response(law, parameters, speed).periodic(), TURN / speed
    return first_lift_off(law, parameters, speed, start, length)
