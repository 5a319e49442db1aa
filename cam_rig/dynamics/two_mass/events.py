"""What ends contact in the two-mass model: the force falls to zero.

What ends a flight is the same for both models that leave the cam: `cam_rig.dynamics.events`.
"""

from __future__ import annotations

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.dynamics.events.contact import contact_loss
from cam_rig.dynamics.events.search import call
from cam_rig.dynamics.events.tables import ROUNDING_ERRORS, contact_table
from cam_rig.dynamics.input_limits import require_angle, require_number, state_of
from cam_rig.dynamics.two_mass.flight import free_masses, from_inner, to_inner
from cam_rig.dynamics.two_mass.parameters import TwoMassParameters, contact_response, force_output
from cam_rig.laws import Law
from cam_rig.laws.bernstein import EPS


def fly(parameters: TwoMassParameters, state: FloatArray, times: FloatArray) -> FloatArray:
    """(z, ż, y, ẏ) of free motion at times (s) after ``state``, ``(4, len(times))``."""
    start = to_inner(parameters, state)
    way, _ = free_masses(parameters).moved(start, times)
    return from_inner(parameters, start[:, None] + way)


def lift_off(
    law: Law,
    parameters: TwoMassParameters,
    speed: float,
    angle: float,
    state: FloatArray,
    limit: float,
) -> tuple[float, FloatArray] | None:
    """Time (s) after which the contact force is negative, and (η, η̇) then.

    None when not within ``limit``; ``state`` is (η, η̇) at cam angle ``angle`` (rad).
    """
    require_angle(angle)
    require_number("limit", limit, "≥ 0")
    response, output = contact_response(law, parameters, speed), force_output(parameters)
    place, velocity = state_of(state, 2).tolist()
    found, *vibration = call(
        contact_loss,
        lambda arrays: contact_table(response, output, arrays),
        speed,
        float(angle),
        (place, velocity),
        float(limit),
    )
    return None if found < 0.0 else (found, np.array(vibration))


def force_noise(law: Law, p: TwoMassParameters, speed: float) -> float:
    """By how much the roller's acceleration may be wrong where the force falls to zero, m/s²."""
    lift, slope, bend = law.bounds
    force = p.roller_mass * (speed**2 * bend) + p.share * p.preload
    force += p.spring_stiffness * lift + (p.stem_damping + p.damping) * speed * slope
    return ROUNDING_ERRORS * EPS * force / p.roller_mass
