"""Jump speed of a follower of two masses: the lowest cam speed at which it loses contact.

At the jump speed the least contact force over the run is zero. The least force is not monotonic in
the speed. The stem resonates with each harmonic of the cam, so the follower may lose contact in a
narrow range of speeds and keep it at a slightly higher speed. The search finds the lowest speed of
the first such range, see `cam_rig.dynamics.modal.first_zero`.
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

#: Cam speed at which the search for a jump speed starts, rpm.
MIN_RPM = 1.0
#: Cam speed at which the search for a jump speed ends, rpm.
MAX_RPM = 1e5
#: Smallest damping ratio with which the jump speed in steady state is searched for. With a smaller
#: ratio the search would not end.
MIN_DAMPING_RATIO = 1e-7
#: Largest number of evaluations of the contact force in the search for a jump speed. They take
#: about half a minute.
MAX_EVALUATIONS = 3e8
#: Default duration of a run from rest, s, as in Table 2 of the paper.
REST_DURATION_S = 1.7
#: Longest accepted run from rest, s. After a minute the motion is close to the steady state.
MAX_REST_DURATION_S = 60.0


def require_run(duration: float) -> None:
    """Raise `ConfigError` unless a run from rest lasts more than 0 and at most 60 s.

    The upper limit is `MAX_REST_DURATION_S`. ``duration`` is in s.
    """
    if not 0.0 < duration <= MAX_REST_DURATION_S:
        raise ConfigError(
            f"the run from rest lasts {duration:g} s; allowed: above 0, to {MAX_REST_DURATION_S:g} "
            "s, or the steady state"
        )


@dataclass(frozen=True)
class Jump:
    """Jump speed of a follower, and the first loss of contact at this speed."""

    speed: float  #: jump speed, rad/s
    angle: float  #: cam angle of the loss of contact, within a turn, rad
    time: float  #: time of the loss since the start of the run, or of a turn in steady state, s

    @property
    def rpm(self) -> float:
        """Jump speed in rpm."""
        return self.speed / RPM


class NoJumpSpeedError(DynamicsError):
    """Error of a follower that loses, or keeps, contact at every speed.

    Its attribute ``speed`` is 0 if contact is lost, and infinite if it is kept.
    """

    def __init__(self, message: str, speed: float) -> None:
        super().__init__(message)
        self.speed = speed


def lost_contact_error(law: Law, slowest: float = MIN_RPM) -> NoJumpSpeedError:
    """Return the error for a follower that loses contact at the lowest speed already.

    ``slowest`` is the speed at which the search starts, rpm. ``law`` is the law of the cam.
    """
    return NoJumpSpeedError(
        f"cam {law.name!r}: the follower loses contact at {slowest:g} rpm already; allowed for a "
        "jump speed: a follower with a larger preload",
        0.0,
    )


def no_jump_error(law: Law) -> NoJumpSpeedError:
    """Return the error for a follower that keeps contact at every speed up to `MAX_RPM`."""
    return NoJumpSpeedError(
        f"cam {law.name!r}: the follower keeps contact up to {MAX_RPM:g} rpm; allowed for a "
        "jump speed: a cam on which contact is lost",
        math.inf,
    )


def force_run(law: Law, parameters: TwoMassParameters, duration: float | None) -> ModalRun:
    """Return the run of a follower of two masses, with the contact force (N) as output.

    It lasts ``duration`` s from rest. None means the steady state. The cam speed is an argument of
    the methods of the result.
    """
    return ModalRun.of(contact_response(law, parameters, RPM), force_output(parameters), duration)


def find_jump_speed(
    law: Law, parameters: TwoMassParameters, duration: float | None, slowest: float = MIN_RPM
) -> float:
    """Return the jump speed (rad/s) of a follower of two masses.

    The parameters and errors are those of `find_two_mass_jump`.
    """
    return find_two_mass_jump(law, parameters, duration, slowest).speed


def find_two_mass_jump(
    law: Law, parameters: TwoMassParameters, duration: float | None, slowest: float = MIN_RPM
) -> Jump:
    """Return the jump speed of a follower of two masses, and the first loss of contact.

    The search starts at ``slowest`` (rpm). The run lasts ``duration`` s from rest. None means the
    steady state. `solve_threshold` lists the errors.
    """
    zero = solve_threshold(law, parameters, duration, slowest)
    angle = zero.first_angle
    if duration is not None:  # ``first_angle`` is from a slightly faster run
        angle = min(angle, duration * zero.speed)
    # JSON has no numbers of NumPy
    return Jump(float(zero.speed), float(angle % TURN), float(angle / zero.speed))


def solve_threshold(
    law: Law, parameters: TwoMassParameters, duration: float | None, slowest: float = MIN_RPM
) -> Climb:
    """Search for the lowest cam speed at which the least contact force is zero.

    The result contains this speed and the cam angle of the zero. Its status is FOUND, because every
    other result raises an error. The run lasts ``duration`` s from rest. None means the steady
    state.

    Raises
    ------
    NoJumpSpeedError
        If the force is negative at ``slowest`` (rpm), or positive up to `MAX_RPM`.
    DynamicsError
        If there is no steady state, the rounding error is too large, or the search takes more than
        `MAX_EVALUATIONS`.
    """
    run = force_run(law, parameters, duration)
    mode = run.mode
    if duration is None and mode.damping <= 2.0 * MIN_DAMPING_RATIO * math.sqrt(mode.stiffness):
        raise DynamicsError(
            "no steady state: without damping the vibration of the stem does not fade, and grows "
            "in each turn if a harmonic of the speed is at its frequency; allowed: damping, or a "
            "run from rest"
        )
    result = run.climb(RPM * slowest, RPM * MAX_RPM, MAX_EVALUATIONS)
    if result.status == ClimbStatus.NEGATIVE:
        raise lost_contact_error(law, slowest)
    if result.status == ClimbStatus.POSITIVE:
        raise no_jump_error(law)
    if result.status == ClimbStatus.UNRESOLVED:
        raise _unresolved_error(law, parameters, result.low)
    if result.status == ClimbStatus.PAUSED:
        raise _evaluations_error(law, parameters, result.low)
    return result


def _unresolved_error(law: Law, parameters: TwoMassParameters, speed: float) -> DynamicsError:
    """Return the error for a jump speed that double precision cannot resolve.

    Contact is proven up to ``speed`` (rad/s). Above it the rounding errors are too large.
    """
    ratio = parameters.damping_ratio
    predicate = f"is damped {ratio:.3g} times critical, with" if ratio > 1.0 else "has"
    return DynamicsError(
        f"cam {law.name!r}: contact holds up to {to_rpm(speed):.4g} rpm, but above it the stem "
        f"{predicate} too few periods in the law's shortest piece "
        f"({math.degrees(law.spans.min()):.3g} deg, of degree {law.degree}) for double precision; "
        "allowed for a jump speed: a stiffer stem, less "
        f"{'damping' if ratio > 1.0 else 'preload'}, or a law of longer pieces"
    )


def _evaluations_error(law: Law, parameters: TwoMassParameters, speed: float) -> DynamicsError:
    """Return the error for a search that needs more than `MAX_EVALUATIONS`.

    Contact is proven up to ``speed`` (rad/s), where the search stopped.
    """
    ratio, rate = parameters.damping_ratio, math.sqrt(parameters.stiffness / parameters.end_mass)
    predicate, remedy = f"vibrates at {rate / TURN:.3g} Hz", "more damping"
    if ratio > 1.0:
        predicate, remedy = f"is damped {ratio:.3g} times critical", "less damping"
    return DynamicsError(
        f"cam {law.name!r}: contact holds up to {to_rpm(speed):.4g} rpm, but the follower "
        f"{predicate}, and a search above takes more than {MAX_EVALUATIONS:g} evaluations of its "
        f"force; allowed for a jump speed: a softer stem or spring, {remedy}, a shorter run from "
        "rest, or the steady state"
    )
