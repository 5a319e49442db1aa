"""What both models' runs keep: where they are, the velocity jumps ahead, the rows they write."""

from __future__ import annotations

from typing import NamedTuple

from cam_rig.dynamics.events.rows import Row, Rows
from cam_rig.dynamics.velocity_jumps import SAME_PLACE

#: Places in the row of numbers that a run goes on from: the time, whether the follower flies,
#: whether its gap is known, the gap, the speed at which it opens, velocity jumps that are over,
#: the step of ṡ that is still to be met, whether the run has begun, and the state (contact or
#: flight).
TIME, FLYING, KNOWN, GAP, OPENING, JUMPS_DONE, STEP, BEGUN, STATE = range(9)
#: Numbers of a phase: the run's row where it begins, up to four of the state, and when it ends.
PHASE_SIZE, END = STATE + 5, STATE + 4
#: Numbers of an event: 0 for a lift-off or 1 for a landing, time, impulse, energy lost.
EVENT_SIZE = 4


class Jumps(NamedTuple):
    """Velocity jumps of an interval of ``duration`` s, ``(n, 2)``: when (s), what ṡ gains (m/s).

    ``clear`` is up to where the law is as before a velocity jump of the next interval.
    """

    ahead: Rows
    duration: float
    clear: float


class RunRecord(NamedTuple):
    """What a run writes: its place, ``(9 + n,)``, phases and events, and how many there are."""

    now: Row
    phases: Rows
    events: Rows
    counts: Row


def has_room(record: RunRecord) -> bool:
    """Whether one more phase and its events can be written."""
    phases, events = record.counts[0], record.counts[1]
    return phases + 1 <= len(record.phases) and events + 2 <= len(record.events)


def add_phase(record: RunRecord, end: float) -> None:
    """Note a phase from where the run is to ``end`` (s)."""
    row, now = record.phases[int(record.counts[0])], record.now
    for i in range(END):
        row[i] = now[i] if i < len(now) else 0.0
    row[END] = end
    record.counts[0] += 1.0


def add_event(record: RunRecord, landing: bool, time: float, impulse: float, lost: float) -> None:
    """Note a lift-off or a landing."""
    row = record.events[int(record.counts[1])]
    row[0], row[1], row[2], row[3] = 1.0 if landing else 0.0, time, impulse, lost
    record.counts[1] += 1.0


def bound(jumps: Jumps, now: Row) -> float:
    """Time of the next velocity jump, or the end."""
    done = int(now[JUMPS_DONE])
    return min(jumps.ahead[done][0], jumps.duration) if done < len(jumps.ahead) else jumps.duration


def no_later(jumps: Jumps, now: Row, speed: float, time: float) -> float:
    """``time``, or `bound` where it is later, or only by rounding before a jump there."""
    near = SAME_PLACE / speed if int(now[JUMPS_DONE]) < len(jumps.ahead) else 0.0
    last = bound(jumps, now)
    return time if time < last - near else last


def jump_at(jumps: Jumps, now: Row, time: float) -> bool:
    """Whether the next velocity jump is at a time, or before it."""
    done = int(now[JUMPS_DONE])
    return done < len(jumps.ahead) and jumps.ahead[done][0] <= time


def take(jumps: Jumps, now: Row, time: float) -> float:
    """Done with the velocity jumps up to a time: what ṡ gains by them, m/s."""
    gained = 0.0
    while jump_at(jumps, now, time):
        gained += jumps.ahead[int(now[JUMPS_DONE])][1]
        now[JUMPS_DONE] += 1.0
    return gained


def fly_from(now: Row, known: bool, gap: float, opening: float) -> None:
    """The follower is in the air; its state is there already."""
    now[FLYING], now[KNOWN] = 1.0, 1.0 if known else 0.0
    now[GAP], now[OPENING] = gap, opening


def rises(rebound: float, pull: float, least: float) -> bool:
    """Whether a rebound (m/s) against a deceleration (m/s²) comes higher than ``least`` (m)."""
    if rebound <= 0.0 or pull <= 0.0:
        return rebound > 0.0
    return 0.5 * rebound * rebound / pull > least
