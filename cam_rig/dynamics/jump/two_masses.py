"""Jump speed of two masses: the lowest speed at which their least contact force is zero.

That force is not monotonic in the speed: the stem resonates with the cam at each harmonic, where
the follower may lose contact, and keep it again at a slightly higher speed. The search misses none
of these resonances; see `cam_rig.dynamics.modal.first_zero`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from cam_rig.dynamics.free_masses import TwoMassParameters, contact_response, force_output
from cam_rig.dynamics.modal.first_zero import Climb, ClimbStatus
from cam_rig.dynamics.modal.run import ModalRun
from cam_rig.errors import ConfigError, DynamicsError
from cam_rig.laws import Law
from cam_rig.units import RPM, TURN, to_rpm

#: Speed at which the search starts, rpm.
SLOWEST = 1.0
#: Speed at which the search ends, rpm.
FASTEST = 1e5
#: Damping ratio below which a follower is undamped: its search in steady state would not end.
MIN_DAMPING_RATIO = 1e-7
#: Largest number of evaluations of a search, about half a minute.
MAX_EVALUATIONS = 3e8
#: Duration of a run from rest, s, as in Table 2 of the paper.
FROM_REST = 1.7
#: Longest run from rest, s: after a minute little but the steady state is left.
MAX_DURATION = 60.0


def require_run(duration: float) -> None:
    """Raise `ConfigError` unless a run from rest lasts more than 0 and at most 60 s."""
    if not 0.0 < duration <= MAX_DURATION:
        raise ConfigError(
            f"the run from rest lasts {duration:g} s; allowed: above 0, to {MAX_DURATION:g} s, or "
            "the steady state"
        )


@dataclass(frozen=True)
class Jump:
    """A jump speed and the first loss of contact."""

    speed: float  #: rad/s
    angle: float  #: of the cam in its turn, rad
    time: float  #: since the start of the run, or of a turn in steady state, s

    @property
    def rpm(self) -> float:
        """Jump speed in rpm."""
        return self.speed / RPM


class NoJumpSpeedError(DynamicsError):
    """Contact is lost at every speed (``speed`` is 0) or at none (``speed`` is infinite)."""

    def __init__(self, message: str, speed: float) -> None:
        super().__init__(message)
        self.speed = speed


def loses_contact(law: Law, slowest: float = SLOWEST) -> NoJumpSpeedError:
    """Return the error for a follower that loses contact at the slowest speed (rpm)."""
    return NoJumpSpeedError(
        f"cam {law.name!r}: the follower loses contact at {slowest:g} rpm already; allowed for a "
        "jump speed: a follower that is pressed on, so give it a preload",
        0.0,
    )


def keeps_contact(law: Law) -> NoJumpSpeedError:
    """Return the error for a follower that keeps contact at every speed."""
    return NoJumpSpeedError(
        f"cam {law.name!r}: the follower keeps contact up to {FASTEST:g} rpm; allowed for a "
        "jump speed: a cam on which contact is lost",
        math.inf,
    )


def force_run(law: Law, parameters: TwoMassParameters, duration: float | None) -> ModalRun:
    """Return the run whose output is the contact force of two masses, at any speed."""
    return ModalRun.of(contact_response(law, parameters, RPM), force_output(parameters), duration)


def find_jump_speed(
    law: Law, parameters: TwoMassParameters, duration: float | None, slowest: float = SLOWEST
) -> float:
    """Return the jump speed (rad/s); the search starts at ``slowest`` (rpm)."""
    return find_two_mass_jump(law, parameters, duration, slowest).speed


def find_two_mass_jump(
    law: Law, parameters: TwoMassParameters, duration: float | None, slowest: float = SLOWEST
) -> Jump:
    """Return the lowest speed at which contact is lost, and its first loss.

    The search starts at ``slowest`` (rpm). The run takes ``duration`` s from rest, or is in steady
    state for None.
    """
    zero = solve_threshold(law, parameters, duration, slowest)
    angle = zero.first_angle
    if duration is not None:  # the angle is that of a slightly faster run
        angle = min(angle, duration * zero.speed)
    return Jump(zero.speed, angle % TURN, angle / zero.speed)


def solve_threshold(
    law: Law, parameters: TwoMassParameters, duration: float | None, slowest: float = SLOWEST
) -> Climb:
    """Return the lowest speed at which the least contact force is zero, and its angle."""
    run = force_run(law, parameters, duration)
    mode = run.mode
    if duration is None and mode.damping <= 2.0 * MIN_DAMPING_RATIO * math.sqrt(mode.stiffness):
        raise DynamicsError(
            "no steady state: a stem without damping vibrates without end, at each harmonic of the "
            "speed louder turn after turn; allowed: damping, or a run from rest"
        )
    result = run.climb(RPM * slowest, RPM * FASTEST, MAX_EVALUATIONS)
    if result.status == ClimbStatus.NEGATIVE:
        raise loses_contact(law, slowest)
    if result.status == ClimbStatus.POSITIVE:
        raise keeps_contact(law)
    if result.status == ClimbStatus.UNRESOLVED:
        raise _unresolved(law, parameters, result.low)
    if result.status == ClimbStatus.PAUSED:
        raise _too_many_evaluations(law, parameters, result.low)
    return result


def _unresolved(law: Law, parameters: TwoMassParameters, speed: float) -> DynamicsError:
    """Return the error for a force that is positive up to a speed and lost in rounding above."""
    times = parameters.damping_ratio
    how = f"is damped {times:.3g} times critical, with" if times > 1.0 else "has"
    return DynamicsError(
        f"cam {law.name!r}: contact holds up to {to_rpm(speed):.4g} rpm, but above it the stem "
        f"{how} too few periods in the law's shortest piece ({math.degrees(law.spans.min()):.3g} "
        f"deg, of degree {law.degree}) for double precision; allowed for a jump speed: a stiffer "
        f"stem, less {'damping' if times > 1.0 else 'preload'}, or a law of longer pieces"
    )


def _too_many_evaluations(law: Law, parameters: TwoMassParameters, speed: float) -> DynamicsError:
    """Return the error for a search that takes too many evaluations above a speed."""
    times, rate = parameters.damping_ratio, math.sqrt(parameters.stiffness / parameters.end_mass)
    how, other = f"vibrates at {rate / TURN:.3g} Hz", "more damping"
    if times > 1.0:
        how, other = f"is damped {times:.3g} times critical", "less damping"
    return DynamicsError(
        f"cam {law.name!r}: contact holds up to {to_rpm(speed):.4g} rpm, but the follower {how} "
        f"and a search above takes more than {MAX_EVALUATIONS:g} looks at its force; allowed for a "
        f"jump speed: a softer stem or spring, {other}, a shorter run from rest, or the steady "
        "state"
    )
