"""Loss of contact of a follower of two masses: the first zero of its contact force F.

The follower has a contact mass at the cam and an end mass on an elastic stem. In contact its state
is the vibration (η, η̇) of the end mass about its static position. A turn of the cam is divided into
parts, and in each part

    η = X(t) + η_free(t),    F(t) = P(t) + p η_free(t) + q η̇_free(t)

with polynomials X and P and a free vibration η̈ = −κ η − 2δ η̇. `find_loss_of_contact` searches part
after part. In each part it first takes time steps that bounds prove to have F > 0. If the force is
close to zero, it expresses F as a polynomial in a short interval of time, a window, and searches
for the zero of this polynomial.

Numbers in brackets are the inequalities of docs/proofs.md, part 1.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from cam_rig.dynamics.events.approach import (
    MAX_PIECE_POSITION,
    is_positive_between,
    positive_duration,
)
from cam_rig.dynamics.events.free_flight import compute_impulse_response
from cam_rig.laws.polynomials import elevate, find_fall, horner, restrict, value_at
from cam_rig.laws.vectors import Matrices, Matrix, Records, Vector, index_at, without_refcount
from cam_rig.units import TURN

#: Shortest time step in which contact is proven by lower bounds of the contact force, (3) and (8)
#: of docs/proofs.md, as a fraction of the interval `StemContactTable.window` (s). If the bounds
#: allow only a shorter step, the zero of the force is searched for with a polynomial, which is then
#: cheaper (measured).
MIN_STEP_FRACTION = 0.25
#: Number of equal cells into which each part of a turn is divided. For each cell a lower bound of
#: the contact force without free vibration is stored.
CELLS = 8

#: Record of the scalar coefficients of one part of a turn, for a follower in contact.
CONTACT_PART = np.dtype(
    [
        ("start", "f8"),  # cam angle at the start of the part, rad
        ("span", "f8"),  # cam angle that the part covers, rad
        ("duration", "f8"),  # duration of the part, s
        ("size", "i8"),  # number of Bernstein ordinates of its polynomials
        ("force_rounding", "f8"),  # ε_F, upper bound of the rounding error of the contact force, N
        ("max_force_curvature", "f8"),  # upper bound of |P̈|, P is the force without vibration, N/s²
        ("flow", "f8", (2, 2)),  # matrix e^{Ah} of the free vibration (η, η̇) over the part
        ("cell_minima", "f8", (CELLS,)),  # lower bound of P − ε_F in each cell, N
    ],
    align=True,
)


class StemContactRow(IntEnum):
    """Index of a row in the coefficients of one part of a turn.

    `StemContactTable.polynomials` contains five rows of Bernstein ordinates (control values of a
    polynomial) for each part of the turn. In rows named WEIGHTED each ordinate is multiplied by its
    binomial coefficient.
    """

    DISPLACEMENT = 0  #: forced vibration X of the end mass, m
    VELOCITY = 1  #: its rate Ẋ, m/s
    FORCE = 2  #: contact force P without free vibration, N
    WEIGHTED_FORCE = 3  #: P, weighted, N
    WEIGHTED_FORCE_RATE = 4  #: rate Ṗ of P, weighted, N/s


class StemVibration(NamedTuple):
    """Vibration of the end mass about its static position, in contact."""

    displacement: float  #: displacement η from the static position, m
    velocity: float  #: rate η̇ of the displacement, m/s


class StemContactTable(NamedTuple):
    """Coefficients of a follower of two masses in contact with the cam.

    They are taken from a `LinearResponse` of the end mass's vibration (η, η̇), whose output is the
    contact force. It divides the turn into n parts, in each of which the motion is one polynomial.
    The rows of ``polynomials`` have the length of the longest polynomial. Part i uses the first
    ``parts[i]["size"]`` numbers of its rows.
    """

    parts: Records  #: scalars of the parts, records of `CONTACT_PART`, ``(n,)``
    polynomials: Matrices  #: forced motion and force, rows of `StemContactRow`, ``(n, 5, size)``
    stiffness: float  #: κ of the free vibration η̈ = −κ η − 2δ η̇, 1/s²
    damping: float  #: 2δ of the free vibration, 1/s
    force_per_displacement: float  #: p, contact force per η, N/m
    force_per_velocity: float  #: q, contact force per η̇, N·s/m
    #: Matrix from the free vibration (η, η̇) at a time to its share p η + q η̇ of the contact force
    #: in the following ``window`` seconds, as Bernstein ordinates (N), ``(d + 1, 2)``.
    series: Matrix
    window: float  #: duration for which ``series`` is exact to rounding, s


class ContactStretch(NamedTuple):
    """Start of a search for a loss of contact within one part of the turn."""

    part: int  #: index of the part of the turn
    offset: float  #: start time of the search, since the start of the part, s
    free: StemVibration  #: free vibration at that time: (η, η̇) less the forced (X, Ẋ)


class ContactLoss(NamedTuple):
    """Result of the search for a loss of contact of two masses."""

    is_lost: bool  #: True if contact is lost within the duration of the search
    time: float  #: time of the loss since the start of the search, s, infinite if contact is kept
    stretch_start: float  #: time at which ``stretch`` starts, since the start of the search, s
    stretch: ContactStretch  #: initial state in the last part of the turn that was searched


def find_loss_of_contact(
    contact: StemContactTable, speed: float, angle: float, vibration: StemVibration, duration: float
) -> ContactLoss:
    """Find the time at which a follower of two masses loses contact with the cam.

    It is the first time after which the contact force is negative. The search starts at cam angle
    ``angle`` (rad) with the vibration ``vibration`` of the end mass, and covers ``duration`` s at
    the cam speed ``speed`` (rad/s).
    """
    angle_in_turn = angle - math.floor(angle / TURN) * TURN
    index, turn, time = index_at(contact.parts["start"], angle_in_turn), 0.0, 0.0
    offset = (angle_in_turn - contact.parts[index]["start"]) / speed
    while True:
        part = contact.parts[index]
        last_angle = part["start"] + turn + part["span"]
        end = max(time, (last_angle - angle_in_turn) / speed)
        x = forced_vibration(contact, index, offset)
        free = StemVibration(
            vibration.displacement - x.displacement, vibration.velocity - x.velocity
        )
        stretch = ContactStretch(index, offset, free)
        loss = _find_loss_in_stretch(contact, stretch, min(end, duration) - time)
        if loss < math.inf:
            return ContactLoss(True, time + loss, time, stretch)
        if end >= duration:
            return ContactLoss(False, math.inf, time, stretch)
        # Use the stored duration of the part, because the rounding of end - time at a late time
        # would change the phase of a fast vibration.
        last = part["size"] - 1
        if offset != 0.0:
            free = free_vibration(contact, stretch, part["duration"] - offset)
        else:
            flow = part["flow"]
            free = StemVibration(
                flow[0][0] * free.displacement + flow[0][1] * free.velocity,
                flow[1][0] * free.displacement + flow[1][1] * free.velocity,
            )
        rows = contact.polynomials[index]
        vibration = StemVibration(
            rows[StemContactRow.DISPLACEMENT][last] + free.displacement,
            rows[StemContactRow.VELOCITY][last] + free.velocity,
        )
        time, index, offset = end, index + 1, 0.0
        if index == len(contact.parts):
            index, turn = 0, turn + TURN


def find_loss_in_part(
    contact: StemContactTable, displacement: float, velocity: float, limit: float
) -> float:
    """Return the time (s) at which contact is lost in a single part of a turn.

    ``contact`` contains only this part, and the search starts at its start. The result is infinite
    if contact is kept up to ``limit`` (s). ``displacement`` (m) and ``velocity`` (m/s) are those of
    the free vibration at the start.
    """
    contact = without_refcount(contact)
    stretch = ContactStretch(0, 0.0, StemVibration(displacement, velocity))
    return _find_loss_in_stretch(contact, stretch, limit)


def forced_vibration(contact: StemContactTable, part: int, offset: float) -> StemVibration:
    """Return the forced vibration (X, Ẋ) of the end mass in a part of the turn.

    ``part`` is the index of the part, and ``offset`` is the time since its start, s.
    """
    rows = contact.polynomials[part]
    displacement, velocity = rows[StemContactRow.DISPLACEMENT], rows[StemContactRow.VELOCITY]
    if offset == 0.0:
        return StemVibration(displacement[0], velocity[0])
    u, size = offset / contact.parts[part]["duration"], contact.parts[part]["size"]
    return StemVibration(value_at(displacement, size, u), value_at(velocity, size, u))


def free_vibration(
    contact: StemContactTable, stretch: ContactStretch, time: float
) -> StemVibration:
    """Return the free vibration of the end mass a time (s) after the start of a search.

    It is e^{At} times the free vibration at the start, ``stretch.free``.
    """
    response = compute_impulse_response(contact.damping, contact.stiffness, time)
    diagonal = response.rate + contact.damping * response.value
    displacement, velocity = stretch.free.displacement, stretch.free.velocity
    acceleration = -contact.stiffness * displacement - contact.damping * velocity
    return StemVibration(
        displacement * diagonal + velocity * response.value,
        velocity * diagonal + acceleration * response.value,
    )


def vibration_after(
    contact: StemContactTable, stretch: ContactStretch, time: float
) -> StemVibration:
    """Return the vibration (η, η̇) of the end mass a time (s) after the start of a search.

    It is the sum of the forced and the free vibration. The time must lie in the same part of the
    turn as the start. ``contact`` contains the coefficients of the follower, and ``stretch`` is the
    start of the search.
    """
    x = forced_vibration(contact, stretch.part, stretch.offset + time)
    free = free_vibration(contact, stretch, time)
    return StemVibration(x.displacement + free.displacement, x.velocity + free.velocity)


def _find_loss_in_stretch(
    contact: StemContactTable, stretch: ContactStretch, limit: float
) -> float:
    """Return the time (s) at which contact is lost within one part of the turn.

    After this time the contact force is below −ε_F, its rounding error. The time is measured from
    the start of the search. It is infinite if contact is kept up to ``limit`` (s). Steps with
    proven contact and short intervals in which the zero is searched for follow each other without a
    gap, so that no zero is skipped (theorem A of docs/proofs.md).
    """
    force_rounding = contact.parts[stretch.part]["force_rounding"]
    time = _step_while_pressed(contact, stretch, 0.0, limit)
    while time < limit:
        duration = min(contact.window, limit - time)
        u = find_fall(
            _force_ordinates(contact, stretch, time, duration), force_rounding
        )  # by (6) and (7) of docs/proofs.md
        if u >= 0.0:
            return time + u * duration
        time = _step_while_pressed(contact, stretch, min(time + duration, limit), limit)
    return math.inf


def _force_ordinates(
    contact: StemContactTable, stretch: ContactStretch, time: float, duration: float
) -> Vector:
    """Return the Bernstein ordinates (N) of the contact force as a polynomial of time.

    They cover ``duration`` s from ``time`` on, at most ``contact.window``. The share of the free
    vibration is a truncated power series, with an error bounded by (10) of docs/proofs.md.
    """
    part, rows = contact.parts[stretch.part], contact.polynomials[stretch.part]
    size, count = part["size"], len(contact.series)
    first = min((stretch.offset + time) / part["duration"], MAX_PIECE_POSITION)
    last = min(max(first, (stretch.offset + time + duration) / part["duration"]), 1.0)
    force = restrict(rows[StemContactRow.FORCE], size, first, last)
    free = free_vibration(contact, stretch, time)
    ordinates = np.zeros(count)
    for j in range(count):
        weights = contact.series[j]
        ordinates[j] = weights[0] * free.displacement + weights[1] * free.velocity
    if duration < contact.window:
        ordinates = restrict(ordinates, count, 0.0, duration / contact.window)
    force, ordinates = elevate(force, max(size, count)), elevate(ordinates, max(size, count))
    for i in range(len(force)):
        ordinates[i] += force[i]
    return ordinates


def _step_while_pressed(
    contact: StemContactTable, stretch: ContactStretch, time: float, limit: float
) -> float:
    """Return the time (s) up to which bounds prove that contact is kept.

    Times are measured from the start of the search. From ``time`` on, the function takes steps in
    which the contact force is proven to exceed its rounding error ε_F, and ends when no step is
    proven, or at ``limit``. A step is proven by the stored minima of the force without free
    vibration (8), or by the force and its rate at both ends (3).
    """
    part, frequency = contact.parts[stretch.part], math.sqrt(contact.stiffness)
    min_step = MIN_STEP_FRACTION * contact.window
    free = free_vibration(contact, stretch, time)
    # One bound serves all later times, because the energy of a free vibration never grows (4).
    share = part["force_rounding"] + bound_share(
        contact, frequency * free.displacement, free.velocity
    )
    pressed_until = _pressed_until(part, stretch.offset + time, share) - stretch.offset
    if pressed_until >= limit:
        return limit
    force, rate = _force_above_rounding(contact, stretch, time, free)
    while time < limit:
        acceleration = -contact.stiffness * free.displacement - contact.damping * free.velocity
        jerk = -contact.stiffness * free.velocity - contact.damping * acceleration
        curvature = part["max_force_curvature"] + bound_share(
            contact, frequency * acceleration, jerk
        )
        end = max(time + positive_duration(force, max(rate, 0.0), curvature), pressed_until)
        if end < time + min_step:
            break
        end = min(end, limit)
        free = free_vibration(contact, stretch, end)
        end_force, end_rate = _force_above_rounding(contact, stretch, end, free)
        if end > pressed_until and not is_positive_between(
            force, rate, end_force, end_rate, end - time, curvature
        ):
            break
        time, force, rate = end, end_force, end_rate
        pressed_until = _pressed_until(part, stretch.offset + time, share) - stretch.offset
    return time


def _pressed_until(part: np.void, offset: float, share: float) -> float:
    """Return the time (s) up to which contact is proven by the minima of its cells.

    A cell of a part of the turn is proven if the least force without free vibration in it is larger
    than ``share`` (N), the largest possible share of the free vibration. This is (8) of
    docs/proofs.md. Times are measured from the start of the part. The search starts at ``offset``
    s. The result is infinite if the remainder of the part is proven.
    """
    cell_duration, minima = part["duration"] / CELLS, part["cell_minima"]
    cell = int(offset / cell_duration)
    while cell < CELLS and minima[cell] > share:
        cell += 1
    return cell * cell_duration if cell < CELLS else math.inf


def bound_share(contact: StemContactTable, scaled_displacement: float, velocity: float) -> float:
    """Return an upper bound (N) of the contact force due to the free vibration.

    This share of the force is |p η + q η̇|. ``scaled_displacement`` is √κ η and ``velocity`` is η̇,
    both in m/s. The bound applies to this and all later times, because the energy of a free
    vibration never grows (inequality (4) of docs/proofs.md).
    """
    energy = math.sqrt(scaled_displacement * scaled_displacement + velocity * velocity)
    return energy * (
        abs(contact.force_per_displacement) / math.sqrt(contact.stiffness)
        + abs(contact.force_per_velocity)
    )


def _force_above_rounding(
    contact: StemContactTable, stretch: ContactStretch, time: float, free: StemVibration
) -> tuple[float, float]:
    """Return the contact force less its rounding error, F − ε_F (N), and its rate Ḟ (N/s).

    ``time`` (s) is measured from the start of the search, and ``free`` is the free vibration of the
    end mass at that time.
    """
    part, rows = contact.parts[stretch.part], contact.polynomials[stretch.part]
    degree, u = part["size"] - 1, (stretch.offset + time) / part["duration"]
    weighted, weighted_rate = (
        rows[StemContactRow.WEIGHTED_FORCE],
        rows[StemContactRow.WEIGHTED_FORCE_RATE],
    )
    value, rate, scale = horner(weighted, weighted_rate, degree, min(u, 1.0))
    power = 1.0
    for _ in range(degree - 1):
        power *= scale
    acceleration = -contact.stiffness * free.displacement - contact.damping * free.velocity
    p, q = contact.force_per_displacement, contact.force_per_velocity
    share = p * free.displacement + q * free.velocity
    share_rate = p * free.velocity + q * acceleration
    return value * power * scale + share - part["force_rounding"], rate * power + share_rate
