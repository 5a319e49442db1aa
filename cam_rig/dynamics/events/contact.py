"""When the contact force of a follower on a springy stem falls to zero.

In contact the state is the vibration (η, η̇) of the end mass. On each part of a turn it is a
polynomial of time and a free vibration, and so is the force.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple, TypeVar

import numpy as np

from cam_rig.dynamics.events.approach import BEFORE_1, MIN_STEP, is_clear, step
from cam_rig.dynamics.events.free_flight import (
    DAMPING,
    DRIFT,
    ENERGY,
    INVERSE,
    LEFT_OUT,
    LOAD,
    MATRIX,
    REACH,
    ROW,
    SEEN,
    SERIES,
    SHAPES,
    STIFFNESS,
    FreeTable,
    impulse_at,
)
from cam_rig.dynamics.events.law_table import ACCELERATION, LIFT, PLACE, Jumps, LawTable
from cam_rig.dynamics.events.law_table import BEND as LAW_BEND
from cam_rig.dynamics.events.polynomials import (
    NONE,
    elevated,
    fall,
    from_powers,
    horner,
    restricted,
    value_at,
)
from cam_rig.dynamics.events.rows import Row, Stack, binomials, borrowed, place_of, zeros
from cam_rig.dynamics.linear.exponential import FreeSystem
from cam_rig.dynamics.linear.response import LinearResponse, Part
from cam_rig.dynamics.linear.sampling import Outputs, polynomial_part
from cam_rig.dynamics.velocity_jumps import short_of_velocity_jump, velocity_jumps_ahead
from cam_rig.laws import Law, bernstein
from cam_rig.units import TURN

#: (η, η̇).
Pair = tuple[float, float]

#: Highest degree of a vibration's series in a window.
MOST_TERMS = 24

#: Places in a part's rows: its numbers; X, of η and of η̇; the force's polynomial part, the same
#: times binomials, and the ordinates of its rate (N/s) times theirs.
PART, PLACES, VELOCITIES, FORCE, WEIGHTED, RATES = range(6)

#: Places in a part's numbers: where it begins and its span (rad), its length (s), the number of its
#: ordinates, the force's least ordinate (N), its rounding, what its second derivative does not
#: exceed (N/s²), and e^{Ah} over the part, row by row.
LOW, SPAN, LENGTH, SIZE, LOWEST, ROUNDING, BEND, FLOW, NUMBERS = 0, 1, 2, 3, 4, 5, 6, 7, 11


class StemContactTable(NamedTuple):
    """A `LinearResponse` of two states and one output, the contact force; n parts a turn.

    Parameters
    ----------
    parts : ``(n, 6, q)``, rows as above; what a shorter one leaves is not used
    stiffness, damping : of η̈ = −stiffness η − damping η̇, in 1/s² and 1/s
    place, velocity : what η and η̇ contribute to the force
    """

    parts: Stack
    stiffness: float
    damping: float
    place: float
    velocity: float


class ContactStretch(NamedTuple):
    """A stretch of contact: ``local`` s into a part, with (η, η̇) less X there."""

    part: int
    local: float
    place: float
    velocity: float


class ContactLoss(NamedTuple):
    """When (s) contact is lost, negative where it is not; and the last stretch, and its begin."""

    time: float
    begin: float
    stretch: ContactStretch


def loss_of_contact(
    contact: StemContactTable,
    speed: float,
    angle: float,
    state: tuple[float, float],
    duration: float,
) -> ContactLoss:
    """Time after which the force is negative, from (η, η̇) at cam angle ``angle`` (rad) on."""
    inside = angle - math.floor(angle / TURN) * TURN
    first, now = place_of(contact.parts, inside), 0.0
    index, turn, local = first, 0.0, (inside - contact.parts[first][PART][LOW]) / speed
    while True:
        end = max(
            now,
            (contact.parts[index][PART][LOW] + turn + contact.parts[index][PART][SPAN] - inside)
            / speed,
        )
        x = forced(contact, index, local)
        stretch = ContactStretch(index, local, state[0] - x[0], state[1] - x[1])
        found = _fall_of_force(contact, stretch, min(end, duration) - now)
        if found >= 0.0:
            return ContactLoss(now + found, now, stretch)
        if end >= duration:
            return ContactLoss(NONE, now, stretch)
        # A part's own length, not end - now: the rounding of a late time would turn the phase.
        state = _end_of_part(contact, stretch)
        now, index, local = end, index + 1, 0.0
        if index == len(contact.parts):
            index, turn = 0, turn + TURN


def contact_loss(
    contact: StemContactTable,
    speed: float,
    angle: float,
    state: tuple[float, float],
    duration: float,
) -> tuple[float, float, float]:
    """Time of the loss alone, negative where there is none, and (η, η̇) then."""
    contact = borrowed(contact)
    loss = loss_of_contact(contact, speed, angle, state, duration)
    place, velocity = state_after(contact, loss.stretch, loss.time - loss.begin)
    return loss.time, place, velocity


def loss_in_part(contact: StemContactTable, place: float, velocity: float, limit: float) -> float:
    """The same in the only part of a table, from its beginning with (η, η̇) less X there."""
    contact = borrowed(contact)
    return _fall_of_force(contact, ContactStretch(0, 0.0, place, velocity), limit)


def _end_of_part(contact: StemContactTable, now: ContactStretch) -> Pair:
    """(η, η̇) where the part ends."""
    rows = contact.parts[now.part]
    numbers, last = rows[PART], int(rows[PART][SIZE]) - 1
    if now.local != 0.0:
        place, velocity = free_at(contact, now, numbers[LENGTH] - now.local)
    else:
        place = numbers[FLOW] * now.place + numbers[FLOW + 1] * now.velocity
        velocity = numbers[FLOW + 2] * now.place + numbers[FLOW + 3] * now.velocity
    return rows[PLACES][last] + place, rows[VELOCITIES][last] + velocity


def forced(contact: StemContactTable, part: int, local: float) -> Pair:
    """X at a time (s) since a part's start."""
    rows = contact.parts[part]
    if local == 0.0:
        return rows[PLACES][0], rows[VELOCITIES][0]
    u, size = local / rows[PART][LENGTH], int(rows[PART][SIZE])
    return value_at(rows[PLACES], size, u), value_at(rows[VELOCITIES], size, u)


def free_at(contact: StemContactTable, now: ContactStretch, time: float) -> Pair:
    """e^{At} (η, η̇) less X at a time (s) later."""
    impulse, rate, _ = impulse_at(contact.damping, contact.stiffness, time)
    own, place, velocity = rate + contact.damping * impulse, now.place, now.velocity
    bend = -contact.stiffness * place - contact.damping * velocity
    return place * own + velocity * impulse, velocity * own + bend * impulse


def state_after(contact: StemContactTable, now: ContactStretch, time: float) -> Pair:
    """(η, η̇) at a time (s) later in the same part."""
    x, free = forced(contact, now.part, now.local + time), free_at(contact, now, time)
    return x[0] + free[0], x[1] + free[1]


def _fall_of_force(contact: StemContactTable, now: ContactStretch, limit: float) -> float:
    """Time (s) of the zero after which the force is below rounding; `NONE` up to ``limit``."""
    numbers, rate = contact.parts[now.part][PART], math.sqrt(contact.stiffness)
    if numbers[LOWEST] > _largest(contact, rate * now.place, now.velocity):
        return NONE  # the vibration cannot lift it: no need to look
    window, noise = REACH / (rate + contact.damping), numbers[ROUNDING]
    begin = _above_until(contact, now, 0.0, limit, window)
    while begin < limit:
        end = min(begin + window, limit)
        at = fall(_series(contact, now, begin, end, window), noise)
        if at >= 0.0:
            return begin + at * (end - begin)
        begin = _above_until(contact, now, end, limit, window)
    return NONE


def _largest(contact: StemContactTable, place: float, velocity: float) -> float:
    """What |the vibration's share| does not exceed after (ω η, η̇): energy does not grow."""
    energy = math.sqrt(place * place + velocity * velocity)
    return energy * (abs(contact.place) / math.sqrt(contact.stiffness) + abs(contact.velocity))


def _series(
    contact: StemContactTable, now: ContactStretch, begin: float, end: float, window: float
) -> Row:
    """Bernstein ordinates of the force on [begin, end], no longer than a window."""
    rows, length = contact.parts[now.part], end - begin
    whole, size = rows[PART][LENGTH], int(rows[PART][SIZE])
    first = min((now.local + begin) / whole, BEFORE_1)
    last = min(max(first, (now.local + end) / whole), 1.0)
    force = restricted(rows[FORCE], size, first, last)
    degree, left_out = 0, 1.0
    while degree < MOST_TERMS and (left_out > LEFT_OUT or degree < size - 1):
        degree += 1
        left_out *= REACH * (length / window) / degree
    terms, weights = zeros(degree + 1), binomials(degree)
    place, velocity = free_at(contact, now, begin)
    for j in range(degree + 1):
        terms[j] = (contact.place * place + contact.velocity * velocity) / weights[j]
        bend, scale = -contact.stiffness * place - contact.damping * velocity, length / (j + 1)
        place, velocity = velocity * scale, bend * scale
    from_powers(terms)
    count = max(size, len(terms))
    terms, force = elevated(terms, count), elevated(force, count)
    for i in range(count):
        terms[i] += force[i]
    return terms


def _above_until(
    contact: StemContactTable, now: ContactStretch, begin: float, limit: float, window: float
) -> float:
    """Time from ``begin`` on up to which steps prove that the force is above rounding."""
    numbers, least = contact.parts[now.part][PART], MIN_STEP * window
    noise, omega = numbers[ROUNDING], math.sqrt(contact.stiffness)
    free = free_at(contact, now, begin)
    value, rate = _force(contact, now, begin, free)
    while begin < limit:
        bend = -contact.stiffness * free[0] - contact.damping * free[1]
        jerk = -contact.stiffness * free[1] - contact.damping * bend
        most = numbers[BEND] + _largest(contact, omega * bend, jerk)
        end = min(begin + step(value - noise, rate, most, least), limit)
        free = free_at(contact, now, end)
        reached, further = _force(contact, now, end, free)
        if not is_clear(value - noise, rate, reached - noise, further, end - begin, most):
            break
        begin, value, rate = end, reached, further
    return begin


def _force(contact: StemContactTable, now: ContactStretch, time: float, free: Pair) -> Pair:
    """The force (N) and its rate (N/s) at a time (s), when the vibration is (η, η̇)."""
    rows = contact.parts[now.part]
    degree, u = int(rows[PART][SIZE]) - 1, (now.local + time) / rows[PART][LENGTH]
    value, rate, scale = horner(rows[WEIGHTED], rows[RATES], degree, min(u, 1.0))
    power = 1.0
    for _ in range(degree - 1):
        power *= scale
    bend = -contact.stiffness * free[0] - contact.damping * free[1]
    vibration = contact.place * free[0] + contact.velocity * free[1]
    faster = contact.place * free[1] + contact.velocity * bend
    return value * power * scale + vibration, rate * power + faster


# Laws, free systems and contact as tables, in the form that the search takes: lists or arrays.

Table = TypeVar("Table")

#: A rounded force is known to so many rounding errors.
ROUNDING_ERRORS = 64.0


def table_of(kind: Callable[..., Table], arrays: bool, *values: Any) -> Table:
    """A table whose numbers are floats, its arrays contiguous arrays or lists of them.

    Compiled code is for one type each; a table inside it is in form already.
    """
    return kind(*(_in_form(value, arrays) for value in values))


def _in_form(value: Any, arrays: bool) -> Any:
    if isinstance(value, np.ndarray):
        return np.array(value, dtype=np.float64, order="C") if arrays else value.tolist()
    return value if isinstance(value, bool | int | tuple | list) else float(value)


@lru_cache(maxsize=64)
def law_table(law: Law, arrays: bool) -> LawTable:
    """The table of a law."""
    size = law.degree + 1
    pieces = np.zeros((law.spans.size, 5, max(size, 3)))
    pieces[:, PLACE, :3] = np.stack([law.breaks[:-1], law.spans, law.bends], axis=1)
    weighted = law.motion * bernstein.binomials(law.degree)[:, None]
    pieces[:, LIFT : LAW_BEND + 1, :size] = np.transpose(weighted, (2, 0, 1))
    pieces[:, ACCELERATION, :size] = law.motion[2].T
    largest, steepest, _ = law.bounds
    jumps = bool(law.velocity_jumps)
    return table_of(LawTable, arrays, pieces, size, largest, steepest, law.largest_step, jumps)


@lru_cache(maxsize=128)
def free_table(system: FreeSystem, arrays: bool) -> FreeTable:
    """The table of masses in the air."""
    pairs, size = system.pairs, system.load.size
    rows = np.zeros((SERIES + len(system.series), size))
    blocks = {MATRIX: system.matrix, LOAD: system.load, ROW: system.row, ENERGY: system.energy}
    if pairs is not None:
        blocks |= {SHAPES: pairs.shapes, INVERSE: pairs.inverse, DRIFT: pairs.inverse @ system.load}
        shown = np.vstack([system.row, system.energy]) @ pairs.shapes
        blocks |= {SEEN: shown}
        rows[DAMPING, : size // 2], rows[STIFFNESS, : size // 2] = pairs.damping, pairs.stiffness
    for first, block in (blocks | {SERIES: system.series}).items():
        rows[first : first + len(np.atleast_2d(block))] = block
    return table_of(FreeTable, arrays, rows, system.window, pairs is not None)


@lru_cache(maxsize=64)
def contact_table(
    response: LinearResponse, output: Outputs, arrays: bool, only: Part | None = None
) -> StemContactTable:
    """The table of a response of two states whose output is the contact force; or of one part."""
    known = response.parts if only is None else (only,)
    sizes = [part.particular.shape[1] for part in known]
    parts = np.zeros((len(sizes), 6, max(*sizes, NUMBERS)))
    for rows, part, size in zip(parts, known, sizes, strict=True):
        force = polynomial_part(response, part, output)[0]
        rates = bernstein.derivative(force) / part.length
        bend = np.abs(bernstein.derivative(rates)).max() / part.length
        rounding = ROUNDING_ERRORS * bernstein.EPS * np.abs(force).max()
        rows[PART, :FLOW] = part.low, part.span, part.length, size, force.min(), rounding, bend
        rows[PART, FLOW:NUMBERS] = part.flow.ravel()
        rows[PLACES : VELOCITIES + 1, :size], rows[FORCE, :size] = part.particular, force
        rows[WEIGHTED, :size] = bernstein.binomials(size - 1) * force
        rows[RATES, : rates.size] = bernstein.binomials(rates.size - 1) * rates
    _, (spring, damper) = response.matrix
    return table_of(StemContactTable, arrays, parts, -spring, -damper, *output.state[0])


def jumps_table(law: Law, angle: float, speed: float, duration: float, arrays: bool) -> Jumps:
    """The velocity jumps that an interval owns; see `cam_rig.dynamics.velocity_jumps`."""
    ahead = velocity_jumps_ahead(law, angle, speed, duration)
    end = angle + speed * duration
    before = short_of_velocity_jump(law, end)
    # By rounding an interval may end behind a joint of the next one; a lift-off there is not its.
    clear = duration if before == end else min(duration, (before - angle) / speed)
    rows = np.array([(jump.time, speed * jump.step) for jump in ahead]).reshape(-1, 2)
    return table_of(Jumps, arrays, rows, duration, clear)
