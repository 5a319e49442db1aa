"""What ends contact in the two-mass model: the force falls to zero.

What ends a flight is the same for both models that leave the cam: `cam_rig.dynamics.events`.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np
from numpy.typing import NDArray

from cam_rig.arrays import FloatArray
from cam_rig.dynamics.events.contact import contact_loss, loss_in_part
from cam_rig.dynamics.events.search import call
from cam_rig.dynamics.events.tables import ROUNDING_ERRORS, contact_table
from cam_rig.dynamics.input_limits import require_angle, require_number, state_of
from cam_rig.dynamics.linear.response import LinearResponse
from cam_rig.dynamics.linear.sampling import polynomial_parts
from cam_rig.dynamics.two_mass.flight import free_masses, from_inner, to_inner
from cam_rig.dynamics.two_mass.parameters import TwoMassParameters, contact_response, force_output
from cam_rig.laws import Law, bernstein
from cam_rig.laws.bernstein import EPS
from cam_rig.units import TURN


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


def first_lift_off(
    law: Law, parameters: TwoMassParameters, speed: float, state: FloatArray, limit: float
) -> float | None:
    """Time (s) of the first lift-off of a run from θ = 0 on, None when not within ``limit``.

    As `lift_off`, but all parts of all turns are bounded at once, and the root is sought only in
    those that the bound leaves.
    """
    response, output = contact_response(law, parameters, speed), force_output(parameters)
    turns = max(1, math.ceil(limit * speed / TURN))
    free = response.free_starts(state, turns)
    for turn, i in np.argwhere(may_fall(response, parameters, free)).tolist():
        part = response.parts[i]
        begin = (turn * TURN + part.low) / speed
        left = min(part.length, limit - begin)
        if left <= 0.0:
            break
        table = partial(contact_table, response, output, only=part)
        found = float(call(loss_in_part, table, *free[turn, i].tolist(), left))
        if found >= 0.0:
            return begin + found
    return None


def may_fall(
    response: LinearResponse, parameters: TwoMassParameters, free: FloatArray
) -> NDArray[np.bool_]:
    """Whether the force may fall to zero in each part of each turn, ``(turns, parts)``.

    It is no lower than at the lower end of a part less what a curve of so much bend may sag, nor
    than the polynomial's least ordinate less the vibration, whose energy does not grow.
    """
    output, matrix = force_output(parameters), response.matrix
    ordinates = polynomial_parts(response, output)
    width = max(rows.shape[1] for rows in ordinates)
    forced = np.stack([bernstein.elevate(rows[0], width - 1) for rows in ordinates])
    lengths = np.array([part.length for part in response.parts])
    change = np.abs(np.diff(forced, n=2, axis=1)).max(axis=1)
    bend = (width - 1) * (width - 2) * change / lengths**2
    row, rate = output.state[0], math.sqrt(-matrix[1, 0])
    reach = abs(float(row[0])) / rate + abs(float(row[1]))
    flows = np.stack([part.flow for part in response.parts])
    ends = np.einsum("pij,tpj->tpi", flows, free)
    acceleration = free @ (matrix @ matrix).T
    bend = bend + reach * np.hypot(rate * acceleration[..., 0], acceleration[..., 1])
    vibration = reach * np.hypot(rate * free[..., 0], free[..., 1])
    lower = np.minimum(forced[:, 0] + free @ row, forced[:, -1] + ends @ row)
    noise = ROUNDING_ERRORS * EPS * np.abs(forced).max(axis=1)
    above = np.maximum(lower - bend * lengths**2 / 8.0, forced.min(axis=1) - vibration)
    return np.asarray(above <= noise)


def force_noise(law: Law, p: TwoMassParameters, speed: float) -> float:
    """By how much the roller's acceleration may be wrong where the force falls to zero, m/s²."""
    lift, slope, bend = law.bounds
    force = p.roller_mass * (speed**2 * bend) + p.share * p.preload
    force += p.spring_stiffness * lift + (p.stem_damping + p.damping) * speed * slope
    return ROUNDING_ERRORS * EPS * force / p.roller_mass
