"""When the contact force of a follower on a springy stem falls to zero.

In contact the state is the vibration (η, η̇) of the end mass. On each part of a turn it is a
polynomial of time and a free vibration, and so is the force.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from cam_rig.dynamics.events.approach import BEFORE_1, ahead, is_clear
from cam_rig.dynamics.events.free_flight import impulse_at
from cam_rig.laws.polynomials import NONE, elevated, fall, horner, restricted, value_at
from cam_rig.laws.rows import Row, Rows, Stack, borrowed, index_at, zeros
from cam_rig.units import TURN

#: (η, η̇).
Pair = tuple[float, float]
#: A look takes steps of this part of a window at least; below that a polynomial is cheaper.
MIN_STEP = 0.25
#: Places in a part's rows: its numbers; X, of η and of η̇; the force's polynomial part, the same
#: times binomials, the ordinates of its rate (N/s) times theirs, and by how much (N) it is above
#: rounding in each of so many equal cells.
PART, PLACES, VELOCITIES, FORCE, WEIGHTED, RATES, LEAST = range(7)
CELLS = 8
#: Places in a part's numbers: its span (rad), its length (s), the number of its ordinates, the
#: force's rounding (N), what its second derivative does not exceed (N/s²), and e^{Ah} over the
#: part, row by row.
SPAN, LENGTH, SIZE, ROUNDING, BEND, FLOW, NUMBERS = 0, 1, 2, 3, 4, 5, 9


class StemContactTable(NamedTuple):
    """A `LinearResponse` of two states and one output, the contact force; n parts a turn."""

    begins: Row  #: ``(n,)``, where each part begins, rad
    parts: Stack  #: ``(n, 7, q)``, rows as above; what a shorter one leaves is not used
    stiffness: float  #: of η̈ = −stiffness η − damping η̇, 1/s²
    damping: float  #: 1/s
    place: float  #: what η contributes to the force, N/m
    velocity: float  #: what η̇ contributes, N·s/m
    series: Rows  #: takes (η, η̇) to the ordinates of what they contribute in a window
    window: float  #: s


class ContactStretch(NamedTuple):
    """A stretch of contact within a part."""

    part: int
    local: float  #: s into the part
    place: float  #: η less X there, m
    velocity: float  #: η̇ less X there, m/s


class ContactLoss(NamedTuple):
    """A loss of contact, or none."""

    time: float  #: s, negative where contact is not lost
    begin: float  #: of the last stretch, s
    stretch: ContactStretch  #: the last one


def loss_of_contact(
    contact: StemContactTable, speed: float, angle: float, state: Pair, duration: float
) -> ContactLoss:
    """Time after which the force is negative, from (η, η̇) at cam angle ``angle`` (rad) on."""
    inside = angle - math.floor(angle / TURN) * TURN
    index, turn, now = index_at(contact.begins, inside), 0.0, 0.0
    local = (inside - contact.begins[index]) / speed
    while True:
        last = contact.begins[index] + turn + contact.parts[index][PART][SPAN]
        end = max(now, (last - inside) / speed)
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


def loss_in_part(contact: StemContactTable, place: float, velocity: float, limit: float) -> float:
    """`ContactLoss.time` in a table's only part, from its beginning, with (η, η̇) less X there."""
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
    begin = _above_until(contact, now, 0.0, limit)
    while begin < limit:
        length = min(contact.window, limit - begin)
        at = fall(_series(contact, now, begin, length), contact.parts[now.part][PART][ROUNDING])
        if at >= 0.0:
            return begin + at * length
        begin = _above_until(contact, now, min(begin + length, limit), limit)
    return NONE


def _held_until(rows: Rows, local: float, vibration: float) -> float:
    """Time (s) into a part up to which no vibration so large (N) can lift it: no need to look."""
    length = rows[PART][LENGTH] / CELLS
    cell = int(local / length)
    while cell < CELLS and rows[LEAST][cell] > vibration:
        cell += 1
    return cell * length if cell < CELLS else math.inf


def _largest(contact: StemContactTable, place: float, velocity: float) -> float:
    """What |the vibration's share| does not exceed after (ω η, η̇): energy does not grow."""
    energy = math.sqrt(place * place + velocity * velocity)
    return energy * (abs(contact.place) / math.sqrt(contact.stiffness) + abs(contact.velocity))


def _series(contact: StemContactTable, now: ContactStretch, begin: float, length: float) -> Row:
    """Bernstein ordinates of the force in ``length`` s from ``begin`` on, up to a window."""
    rows, count = contact.parts[now.part], len(contact.series)
    whole, size = rows[PART][LENGTH], int(rows[PART][SIZE])
    first = min((now.local + begin) / whole, BEFORE_1)
    last = min(max(first, (now.local + begin + length) / whole), 1.0)
    force, free = restricted(rows[FORCE], size, first, last), free_at(contact, now, begin)
    ordinates = zeros(count)
    for j in range(count):
        ordinates[j] = contact.series[j][0] * free[0] + contact.series[j][1] * free[1]
    if length < contact.window:
        ordinates = restricted(ordinates, count, 0.0, length / contact.window)
    force, ordinates = elevated(force, max(size, count)), elevated(ordinates, max(size, count))
    for i in range(len(force)):
        ordinates[i] += force[i]
    return ordinates


def _above_until(
    contact: StemContactTable, now: ContactStretch, begin: float, limit: float
) -> float:
    """Time from ``begin`` on up to which steps prove that the force is above rounding."""
    rows, omega = contact.parts[now.part], math.sqrt(contact.stiffness)
    noise, least = rows[PART][ROUNDING], MIN_STEP * contact.window
    free = free_at(contact, now, begin)
    vibration = noise + _largest(contact, omega * free[0], free[1])
    held = _held_until(rows, now.local + begin, vibration) - now.local
    if held >= limit:
        return limit
    value, rate = _force(contact, now, begin, free)
    while begin < limit:
        bend = -contact.stiffness * free[0] - contact.damping * free[1]
        jerk = -contact.stiffness * free[1] - contact.damping * bend
        most = rows[PART][BEND] + _largest(contact, omega * bend, jerk)
        end = max(begin + ahead(value, max(rate, 0.0), most), held)
        if end < begin + least:
            break
        end = min(end, limit)
        free = free_at(contact, now, end)
        reached, further = _force(contact, now, end, free)
        if end > held and not is_clear(value, rate, reached, further, end - begin, most):
            break
        begin, value, rate = end, reached, further
        held = _held_until(rows, now.local + begin, vibration) - now.local
    return begin


def _force(contact: StemContactTable, now: ContactStretch, time: float, free: Pair) -> Pair:
    """The force above its rounding (N), its rate (N/s) at a time (s) with the vibration (η, η̇)."""
    rows = contact.parts[now.part]
    degree, u = int(rows[PART][SIZE]) - 1, (now.local + time) / rows[PART][LENGTH]
    value, rate, scale = horner(rows[WEIGHTED], rows[RATES], degree, min(u, 1.0))
    power = 1.0
    for _ in range(degree - 1):
        power *= scale
    bend = -contact.stiffness * free[0] - contact.damping * free[1]
    vibration = contact.place * free[0] + contact.velocity * free[1]
    faster = contact.place * free[1] + contact.velocity * bend
    return value * power * scale + vibration - rows[PART][ROUNDING], rate * power + faster
