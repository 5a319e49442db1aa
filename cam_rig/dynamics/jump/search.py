"""Where the least contact force of two masses first falls to zero, going up through the speeds.

That force is not monotone in speed: the stem is in resonance with the cam at each harmonic, where
the follower may lose contact and keep it again a little faster. None is stepped over, see
`cam_rig.dynamics.modal.first_zero`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from cam_rig.dynamics.free_masses import TwoMassParameters, contact_response, force_output
from cam_rig.dynamics.modal.first_zero import ABOVE, BELOW, PAUSED, UNTOLD, Climb
from cam_rig.dynamics.modal.run import ModalRun
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.units import RPM, TURN, to_rpm

#: Where the search begins and ends, rpm.
SLOWEST, FASTEST = 1.0, 1e5
#: A damping ratio below this counts as 0: a search in steady state would have no end.
UNDAMPED = 1e-7
#: A search looks at so many values of the force at most: half a minute's work.
MAX_LOOKS = 3e8


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


class NoJumpSpeedError(DynamicsError):
    """Contact is lost at every speed, ``speed`` 0, or at none, ``speed`` infinite."""

    def __init__(self, message: str, speed: float) -> None:
        super().__init__(message)
        self.speed = speed


def loses_contact(law: Law, slowest: float = SLOWEST) -> NoJumpSpeedError:
    """What is raised where contact is lost at the slowest speed (rpm) already."""
    return NoJumpSpeedError(
        f"cam {law.name!r}: the follower loses contact at {slowest:g} rpm already; allowed for a "
        "jump speed: a follower that is pressed on, so give it a preload",
        0.0,
    )


def keeps_contact(law: Law) -> NoJumpSpeedError:
    """What is raised where contact holds at every speed."""
    return NoJumpSpeedError(
        f"cam {law.name!r}: the follower keeps contact up to {FASTEST:g} rpm; allowed for a "
        "jump speed: a cam on which contact is lost",
        math.inf,
    )


def force_run(law: Law, parameters: TwoMassParameters, duration: float | None) -> ModalRun:
    """The contact force of the two-mass follower over a run, at any speeds."""
    return ModalRun.of(contact_response(law, parameters, RPM), force_output(parameters), duration)


def sought_speed(
    law: Law, parameters: TwoMassParameters, duration: float | None, slowest: float = SLOWEST
) -> float:
    """The jump speed (rad/s) alone; ``slowest`` (rpm) is where the search begins."""
    return sought(law, parameters, duration, slowest).speed


def sought(
    law: Law, parameters: TwoMassParameters, duration: float | None, slowest: float = SLOWEST
) -> Jump:
    """The lowest speed from ``slowest`` (rpm) on at which contact is lost, and where first."""
    found = touch(law, parameters, duration, slowest)
    first = found.first
    if duration is not None:  # a last digit faster the run is as much longer
        first = min(first, duration * found.speed)
    return Jump(found.speed, first % TURN, first / found.speed)


def touch(
    law: Law, parameters: TwoMassParameters, duration: float | None, slowest: float = SLOWEST
) -> Climb:
    """The same speed, and where the least force of the run is zero there."""
    run = force_run(law, parameters, duration)
    mode = run.mode
    if duration is None and mode.damping <= 2.0 * UNDAMPED * math.sqrt(mode.stiffness):
        raise DynamicsError(
            "no steady state: a stem without damping vibrates without end, at each harmonic of the "
            "speed louder turn after turn; allowed: damping, or a run from rest"
        )
    found = run.climb(RPM * slowest, RPM * FASTEST, MAX_LOOKS)
    if found.outcome == BELOW:
        raise loses_contact(law, slowest)
    if found.outcome == ABOVE:
        raise keeps_contact(law)
    if found.outcome == UNTOLD:
        raise _untold(law, parameters, found.low)
    if found.outcome == PAUSED:
        raise _too_many(law, parameters, found.low)
    return found


def _untold(law: Law, parameters: TwoMassParameters, speed: float) -> DynamicsError:
    """What is raised where contact holds as far (rad/s) as the force can be told."""
    times = parameters.damping_ratio
    how = f"is damped {times:.3g} times critical, with" if times > 1.0 else "has"
    return DynamicsError(
        f"cam {law.name!r}: contact holds up to {to_rpm(speed):.4g} rpm, but above it the stem "
        f"{how} too few periods in the law's shortest piece ({math.degrees(law.spans.min()):.3g} "
        f"deg, of degree {law.degree}) for double precision; allowed for a jump speed: a stiffer "
        f"stem, less {'damping' if times > 1.0 else 'preload'}, or a law of longer pieces"
    )


def _too_many(law: Law, parameters: TwoMassParameters, speed: float) -> DynamicsError:
    """What is raised where a search up from a speed (rad/s) takes too many looks."""
    times, rate = parameters.damping_ratio, math.sqrt(parameters.stiffness / parameters.end_mass)
    how, other = f"vibrates at {rate / TURN:.3g} Hz", "more damping"
    if times > 1.0:
        how, other = f"is damped {times:.3g} times critical", "less damping"
    return DynamicsError(
        f"cam {law.name!r}: contact holds up to {to_rpm(speed):.4g} rpm, but the follower {how} "
        f"and a search above takes more than {MAX_LOOKS:g} looks at its force; allowed for a jump "
        f"speed: a softer stem or spring, {other}, a shorter run from rest, or the steady state"
    )
