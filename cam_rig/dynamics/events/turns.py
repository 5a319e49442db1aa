"""One mass turn after turn on one cam, and the derivative of the motion with respect to its start.

In flight a small change of (y, ẏ) is carried on by the closed form of free motion, Φ. At a landing
it is carried over by the saltation matrix: with the approach u = ẏ⁻ − ṡ < 0, the restitution r, and
the gap's acceleration a⁻ before and a⁺ after it,

    δ⁺ = [[−r, 0], [(r a⁻ + a⁺)/u, −r]] δ⁻

(Müller 1995; Leine and Nijmeijer 2004). A lift-off leaves it as it is. On the cam the follower has
no freedom, and a stretch of contact, however it was reached, makes every change zero.
"""

from __future__ import annotations

import math

from cam_rig.dynamics.events.free_flight import DAMPING, LOAD, STIFFNESS, impulse_at
from cam_rig.dynamics.events.law_table import (
    BEGUN,
    END,
    FLYING,
    GAP,
    JUMPS_DONE,
    OPENING,
    STATE,
    STEP,
    TIME,
    RunRecord,
    cam_at,
)
from cam_rig.dynamics.events.rows import Row, Rows, borrowed
from cam_rig.dynamics.events.runs import RunTable, run_events

#: Places in a turn's row: what the turn ends with: the gap (m), the speed at which it opens (m/s),
#: whether the follower flies, its place (m) and velocity (m/s); its landings, the fastest of them
#: (m/s), the slowest (m/s); the seconds on the cam; what its two directions of change grow by, in
#: logarithms; and its derivative, row by row.
ENDS, FLIES, PLACE_AT_END, LANDINGS, HARDEST, SOFTEST, ON_CAM, GROWTH, DERIVATIVE = (
    *(0, 2, 3, 5, 6, 7, 8, 9, 11),
)
TURN_SIZE = DERIVATIVE + 4


def run_turns(run: RunTable, record: RunRecord, frame: Row, turns: Rows, most: float) -> int:
    """Turn after turn from the record's place: rows of ``turns`` filled, and how many are.

    ``frame`` is the direction that grows most, of unit length. Fewer are filled where one has more
    than ``most`` landings.
    """
    run, record = borrowed(run), borrowed(record)
    now = record.now
    for i in range(len(turns)):
        row = turns[i]
        for j in range(TURN_SIZE):
            row[j] = 0.0
        row[DERIVATIVE] = row[DERIVATIVE + 3] = 1.0
        row[SOFTEST] = math.inf
        now[TIME], now[JUMPS_DONE], now[STEP], now[BEGUN] = 0.0, 0.0, 0.0, 0.0
        if now[FLYING] == 0.0:  # a velocity jump at angle 0 may throw it at once
            _carry(frame, row, run.cam.speed, (0.0, 0.0, 0.0, 0.0))
        while now[TIME] < run.jumps.duration:
            record.counts[0] = record.counts[1] = 0.0
            run_events(run, record)
            _follow(run, record, frame, row)
            if row[LANDINGS] > most:
                return i
        if now[FLYING] != 0.0:
            row[ENDS], row[ENDS + 1], row[FLIES] = now[GAP], now[OPENING], 1.0
            row[PLACE_AT_END], row[PLACE_AT_END + 1] = now[STATE], now[STATE + 1]
    return len(turns)


def _follow(run: RunTable, record: RunRecord, frame: Row, row: Row) -> None:
    """Carry a change through the phases of a record."""
    count, met, passed = int(record.counts[0]), int(record.counts[1]), 0
    # The blow of a velocity jump at the turn's beginning comes before its first phase.
    while passed < met and record.events[passed][1] <= 0.0:
        _note(run, record.events[passed], row)
        passed += 1
    for i in range(count):
        phase = record.phases[i]
        length, approach, rebound = phase[END] - phase[TIME], 0.0, 0.0
        while passed < met and record.events[passed][1] <= phase[END]:
            if record.events[passed][0] != 0.0:
                approach, rebound = _note(run, record.events[passed], row)
            passed += 1
        if phase[FLYING] == 0.0:
            if length > 0.0:
                row[ON_CAM] += length
                _carry(frame, row, run.cam.speed, (0.0, 0.0, 0.0, 0.0))
            continue
        _carry(frame, row, run.cam.speed, _flown(run, length))
        if approach > 0.0:  # a graze has none: that of the flights which just miss
            restitution = run.restitution if rebound > 0.5 * run.restitution * approach else 0.0
            _carry(frame, row, run.cam.speed, _landed(run, phase[END], approach, restitution))


def _note(run: RunTable, event: Row, row: Row) -> tuple[float, float]:
    """Note a landing in a turn's row: its speeds (m/s) against the cam before and after it."""
    if event[0] == 0.0:
        return 0.0, 0.0
    # E = m (1 − e²) v²/2 of p = m (1 + e) v: v + e v, and v − e v.
    both = event[2] / run.mass
    less = 2.0 * event[3] / event[2] if event[2] > 0.0 else 0.0
    approach = 0.5 * (both + less)
    row[LANDINGS] += 1.0
    row[HARDEST] = max(row[HARDEST], approach)
    row[SOFTEST] = min(row[SOFTEST], approach)
    return approach, 0.5 * (both - less)


def _flown(run: RunTable, time: float) -> tuple[float, float, float, float]:
    """Φ of a flight of some seconds, row by row."""
    damping, stiffness = run.free.rows[DAMPING][0], run.free.rows[STIFFNESS][0]
    impulse, rate, _ = impulse_at(damping, stiffness, time)
    return rate + damping * impulse, impulse, -stiffness * impulse, rate


def _landed(
    run: RunTable, time: float, approach: float, restitution: float
) -> tuple[float, float, float, float]:
    """The saltation matrix of a landing, row by row."""
    s, velocity, bend = cam_at(run.cam, time)
    damping, stiffness = run.free.rows[DAMPING][0], run.free.rows[STIFFNESS][0]
    still = run.free.rows[LOAD][1] - stiffness * s - bend
    before = still - damping * (velocity - approach)
    after = still - damping * (velocity + restitution * approach)
    return -restitution, 0.0, -(restitution * before + after) / approach, -restitution


def _carry(frame: Row, row: Row, speed: float, by: tuple[float, float, float, float]) -> None:
    """Multiply the turn's derivative by a matrix, and turn the frame; Gram and Schmidt in two."""
    a, b, c, d = by
    for j in range(DERIVATIVE, DERIVATIVE + 2):
        one, two = row[j], row[j + 2]
        row[j], row[j + 2] = a * one + b * two, c * one + d * two
    # Lengths are measured in m/s, a gap by what it is in a radian: neither outweighs the other.
    one, two = a * frame[0] + b * speed * frame[1], c / speed * frame[0] + d * frame[1]
    size, area = math.hypot(one, two), abs(a * d - b * c)
    if size > 0.0:
        frame[0], frame[1] = one / size, two / size
    row[GROWTH] += math.log(size) if size > 0.0 else -math.inf
    row[GROWTH + 1] += math.log(area) - math.log(size) if area > 0.0 else -math.inf
