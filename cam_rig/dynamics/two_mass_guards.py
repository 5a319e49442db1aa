"""The two signed quantities whose zeros are the two-mass model's events: force and gap."""

from __future__ import annotations

import numpy as np

from cam_rig.dynamics.exponential import free_motion
from cam_rig.dynamics.linear import Run
from cam_rig.dynamics.scan import first_negative
from cam_rig.dynamics.two_mass import TwoMassParameters, contact_response, force_output
from cam_rig.dynamics.uniform import polynomial_part
from cam_rig.laws import TURN, Law, bernstein
from cam_rig.laws.bernstein import FloatArray

#: A gap or a force this many rounding errors below zero is below zero.
ROUNDING_ERRORS = 64.0
#: Fewest grid points of a scan over one turn: the slow part of force and gap.
LEAST_PER_TURN = 512
EPS = float(np.finfo(float).eps)


def fly(parameters: TwoMassParameters, state: FloatArray, times: FloatArray) -> FloatArray:
    """(z, ż, y, ẏ) of free motion at times (s) after ``state``, ``(4, len(times))``."""
    inner = free_motion(parameters.inner_matrix, parameters.to_inner(state), times)
    return parameters.from_inner(inner)


def lift_off_time(
    law: Law,
    parameters: TwoMassParameters,
    speed: float,
    angle: float,
    state: FloatArray,
    limit: float,
) -> float | None:
    """Time (s) after which the contact force is negative, None when not within ``limit``.

    ``state`` is (η, η̇) at cam angle ``angle`` (rad).
    """
    for run in contact_response(law, parameters, speed).walk(state, angle, limit):
        found = _force_root(law, parameters, speed, run)
        if found is not None:
            return run.begin + found
    return None


def _force_root(law: Law, p: TwoMassParameters, speed: float, run: Run) -> float | None:
    response, output, part = contact_response(law, p, speed), force_output(p), run.part
    ordinates = polynomial_part(response, part, output)[0][0]
    rate = p.stiffness / p.end_mass
    energy = rate * run.free[0] ** 2 + run.free[1] ** 2
    vibration = (p.stem_stiffness / np.sqrt(rate) + p.stem_damping) * np.sqrt(energy)
    if ordinates.min() > vibration:  # the vibration cannot lift it: no need to look
        return None
    rounding = ROUNDING_ERRORS * EPS * float(np.abs(ordinates).max())

    def force(time: FloatArray) -> FloatArray:
        forced = bernstein.evaluate(ordinates, (run.local + time) / part.length)
        free = free_motion(response.matrix, run.free, time)
        return np.asarray(forced + output.state[0] @ free)

    if force(np.zeros(1))[0] <= -rounding:
        return 0.0
    span = run.end - run.begin
    return first_negative(force, rounding, span, float(np.sqrt(rate)), _least(span, speed))


def landing_time(
    law: Law,
    parameters: TwoMassParameters,
    speed: float,
    angle: float,
    state: FloatArray,
    limit: float,
) -> float | None:
    """Time (s) at which the roller meets the cam, None when not within ``limit``.

    ``state`` is (z, ż, y, ẏ) at cam angle ``angle`` (rad).
    """
    size = float(np.abs(law.ordinates).max() + np.abs(state[[0, 2]]).max())
    size += (abs(angle) + TURN + speed * limit) * float(np.abs(law.motion[1]).max())
    rounding = ROUNDING_ERRORS * EPS * size + law.largest_step

    def gap(time: FloatArray) -> FloatArray:
        roller = fly(parameters, state, time)[0]
        return np.asarray(roller - law(angle + speed * time))

    return first_negative(gap, rounding, limit, parameters.fastest_rate, _least(limit, speed))


def _least(span: float, speed: float) -> int:
    return 8 + int(LEAST_PER_TURN * span * speed / TURN)
