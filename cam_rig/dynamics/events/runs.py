"""One mass, or a roller and an end mass, through an interval: contact, lift-off, flight, landing.

A landing stops the mass that meets the cam, or it rebounds with Newton's restitution; an end mass
goes on with the velocity it had.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from cam_rig.dynamics.events.approach import FlightOverCam, landing
from cam_rig.dynamics.events.contact import Pair, StemContactTable, loss_of_contact, state_after
from cam_rig.dynamics.events.free_flight import FreeTable, lift_off_state, moved
from cam_rig.dynamics.events.law_table import Cam, cam_at
from cam_rig.dynamics.velocity_jumps import SAME_PLACE
from cam_rig.laws.rows import Row, Rows, borrowed, zeros
from cam_rig.units import TURN

#: (s, ṡ, s̈).
Motion = tuple[float, float, float]
#: Angle (rad) of a loss interval too short to lift anything but a rounding error.
GRAZE = 1e-9


#: Places in the row of numbers that a run goes on from: the time, whether the follower flies,
#: whether its gap is known, the gap, the speed at which it opens, velocity jumps that are over,
#: the step of ṡ that is still to be met, whether the run has begun, and the state (contact or
#: flight).
TIME, FLYING, KNOWN, GAP, GAP_RATE, JUMPS_DONE, STEP, BEGUN, STATE = range(9)
#: Numbers of a phase: the run's row where it begins, up to four of the state, and when it ends.
PHASE_SIZE, END = STATE + 5, STATE + 4
#: Numbers of an event: 0 for a lift-off or 1 for a landing, time, impulse, energy lost.
EVENT_SIZE = 4


class Jumps(NamedTuple):
    """Velocity jumps of an interval."""

    ahead: Rows  #: ``(n, 2)``: when (s), what ṡ gains (m/s)
    duration: float  #: s
    clear: float  #: up to where the law is as before a velocity jump of the next interval, s


class RunRecord(NamedTuple):
    """What a run writes."""

    now: Row  #: its place, ``(9 + n,)``
    phases: Rows
    events: Rows
    counts: Row  #: how many phases and events there are


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


def fly_from(now: Row, known: bool, gap: float, gap_rate: float) -> None:
    """The follower is in the air; its state is there already."""
    now[FLYING], now[KNOWN] = 1.0, 1.0 if known else 0.0
    now[GAP], now[GAP_RATE] = gap, gap_rate


def rises(rebound: float, pull: float, least: float) -> bool:
    """Whether a rebound (m/s) against a deceleration (m/s²) comes higher than ``least`` (m)."""
    if rebound <= 0.0 or pull <= 0.0:
        return rebound > 0.0
    return 0.5 * rebound * rebound / pull > least


class RunTable(NamedTuple):
    """A follower on a turning cam: one rigid mass, or two masses where it has a stem.

    In contact the state of two masses is the end mass's vibration (η, η̇), that of one is the cam's;
    in flight it is (w, ẇ, Y, Ẏ) of two and (y, ẏ) of one, as in `FreeSystem`.
    """

    cam: Cam
    free: FreeTable
    jumps: Jumps
    mass: float  #: kg, of what meets the cam
    #: weights of s, ṡ, s̈ in the contact force, and its constant (N)
    force: tuple[float, float, float, float]
    #: ``(n, 2)`` cam angles in [0, 2π] between which the cam would have to pull one mass
    losses: Rows
    stem: bool  #: whether there are two masses; of one the five after it are not used
    contact: StemContactTable  #: the end mass while the roller is on the cam
    drive: Motion  #: what s, ṡ, s̈ contribute to η̈
    end_share: float  #: of the end mass in both
    left: float  #: 1 − α, the static share of the lift that the stem is compressed by
    sag: float  #: m, what the preload compresses
    restitution: float  #: of a landing
    force_noise: float  #: m/s², as in `FlightOverCam`
    least_bounce: float  #: m, below which a bounce is contact
    no_impact: float  #: m/s, below which a step of ṡ is rounding


def run_events(run: RunTable, record: RunRecord) -> None:
    """Phase after phase, up to the interval's end or as far as there is room for them."""
    run, record = borrowed(run), borrowed(record)
    now = record.now
    if now[BEGUN] == 0.0:
        now[BEGUN] = 1.0
        _velocity_step(run, record, 0.0, now[STEP] + take(run.jumps, now, 0.0))
    while now[TIME] < run.jumps.duration and has_room(record):
        if now[FLYING] != 0.0:
            _flight(run, record)
        elif run.stem:
            _contact_of_two(run, record)
        else:
            _contact_of_one(run, record)


def _contact_of_one(run: RunTable, record: RunRecord) -> None:
    now, last = record.now, bound(run.jumps, record.now)
    end, lift_off = last, _next_lift_off(run, now[TIME])
    if lift_off < run.jumps.clear:
        end = no_later(run.jumps, now, run.cam.speed, lift_off)
    add_phase(record, end)
    now[TIME] = end
    if end < last:
        _lift_off(run, record, end, cam_at(run.cam, end), (0.0, 0.0), 0.0)
    else:
        _velocity_step(run, record, end, take(run.jumps, now, end))


def _next_lift_off(run: RunTable, time: float) -> float:
    """Time (s) of the next lift-off of one mass, infinity when the cam never has to pull."""
    angle, count = run.cam.angle + run.cam.speed * time, len(run.losses)
    turn = math.floor(angle / TURN) * TURN
    for i in range(2 * count):
        whole = turn + TURN if i >= count else turn
        if whole + run.losses[i % count][1] - angle > GRAZE:
            return time + max(0.0, (whole + run.losses[i % count][0] - angle) / run.cam.speed)
    return math.inf


def _contact_of_two(run: RunTable, record: RunRecord) -> None:
    now, time, last = record.now, record.now[TIME], bound(run.jumps, record.now)
    start, angle = (now[STATE], now[STATE + 1]), run.cam.angle + run.cam.speed * time
    limit = min(last, run.jumps.clear) - time
    loss = loss_of_contact(run.contact, run.cam.speed, angle, start, limit)
    lost, end = loss.time >= 0.0, last
    if lost:
        end = no_later(run.jumps, now, run.cam.speed, time + loss.time)
    add_phase(record, end)
    impact = jump_at(run.jumps, now, end)
    gained, now[TIME] = take(run.jumps, now, end), end
    if lost and not impact:
        cam = cam_at(run.cam, end)
        vibration = state_after(run.contact, loss.stretch, loss.time - loss.begin)
        vibration = _continued(run, vibration, cam, (end - time) - loss.time)
        _lift_off(run, record, end, cam, stem_stretch(run, vibration, cam), 0.0)
        return
    vibration = state_after(run.contact, loss.stretch, (end - time) - loss.begin)
    now[STATE], now[STATE + 1] = vibration
    _velocity_step(run, record, end, gained)


def _continued(run: RunTable, vibration: Pair, cam: Motion, time: float) -> Pair:
    """(η, η̇) a rounding of time (s) later: what follows begins at a time that is a float."""
    contact, drive = run.contact, run.drive
    driven = drive[0] * cam[0] + drive[1] * cam[1] + drive[2] * cam[2]
    bend = driven - contact.stiffness * vibration[0] - contact.damping * vibration[1]
    return vibration[0] + time * vibration[1], vibration[1] + time * bend


def _flight(run: RunTable, record: RunRecord) -> None:
    """A phase of flight, at most to the next velocity jump, and what ends it."""
    now, begin, cam = record.now, record.now[TIME], run.cam
    last, start = bound(run.jumps, now), zeros(len(now) - STATE)
    for i in range(len(start)):
        start[i] = now[STATE + i]
    lift_off = lift_off_state(run.free, start)
    ahead = Cam(cam.law, cam.speed, cam.angle + cam.speed * begin)
    flight = FlightOverCam(
        lift_off, ahead, now[KNOWN] != 0.0, now[GAP], now[GAP_RATE], run.force_noise
    )
    found = landing(flight, last - begin)
    end = no_later(run.jumps, now, cam.speed, begin + found.time) if found.landed else last
    add_phase(record, end)
    gap_rate, now[TIME] = found.rate - take(run.jumps, now, end), end
    lands = found.landed and gap_rate <= 0.0
    if run.stem or not lands:  # where one mass lands the cam says where it is
        way = moved(lift_off, end - begin).way
        for i in range(len(start)):
            now[STATE + i] += way[i]
    if lands:
        _land(run, record, end, (now[STATE], now[STATE + 1]), gap_rate)
    else:
        fly_from(now, True, found.gap, gap_rate)


def _velocity_step(run: RunTable, record: RunRecord, time: float, gained: float) -> None:
    """Where ṡ gains (m/s): an impact on what is in contact, or its lift-off."""
    now = record.now
    if abs(gained) <= run.no_impact:
        return
    if now[FLYING] != 0.0:
        now[GAP_RATE] -= gained
        return
    s, rate, bend = cam_at(run.cam, time)
    before = (s, rate - gained, bend)
    stretch = stem_stretch(run, (now[STATE], now[STATE + 1]), before)
    if gained < 0.0:
        _lift_off(run, record, time, before, stretch, -gained)
    else:
        _land(run, record, time, stretch, -gained)


def stem_stretch(run: RunTable, vibration: Pair, cam: Motion) -> Pair:
    """(w, ẇ) of the stem of a roller on the cam: a small difference, without its rounding."""
    return vibration[0] - run.left * cam[0] - run.sag, vibration[1] - run.left * cam[1]


def _lift_off(
    run: RunTable, record: RunRecord, time: float, cam: Motion, stretch: Pair, gap_rate: float
) -> None:
    """What goes with the cam's motion lifts off at ``gap_rate`` m/s."""
    add_event(record, False, time, 0.0, 0.0)
    _fly(run, record, cam, stretch, 0.0, gap_rate)


def _fly(
    run: RunTable, record: RunRecord, cam: Motion, stretch: Pair, rising: float, gap_rate: float
) -> None:
    """What is on the cam, faster than it by ``rising`` m/s, flies off it at ``gap_rate`` m/s."""
    now, share, velocity = record.now, run.end_share, cam[1] + rising
    if run.stem:
        now[STATE], now[STATE + 1] = stretch
        now[STATE + 2] = cam[0] + share * stretch[0]
        now[STATE + 3] = velocity + share * stretch[1]
    else:
        now[STATE], now[STATE + 1] = cam[0], velocity
    fly_from(now, True, 0.0, gap_rate)


def _land(run: RunTable, record: RunRecord, time: float, stretch: Pair, rate: float) -> None:
    """A landing at ``rate`` ≤ 0 (m/s), of two masses from (w, ẇ): it flies on, or stays."""
    now, cam, approach, force = record.now, cam_at(run.cam, time), -rate, 0.0
    on_cam, vibration = (stretch[0], stretch[1] + rate), (0.0, 0.0)
    if run.stem:
        rest = stem_stretch(run, (0.0, 0.0), cam)
        vibration = (on_cam[0] - rest[0], on_cam[1] - rest[1])
        force = run.contact.place * vibration[0] + run.contact.velocity * vibration[1]
    force += run.force[0] * cam[0] + run.force[1] * cam[1] + run.force[2] * cam[2] + run.force[3]
    rebound = run.restitution * approach
    bounces = rises(rebound, force / run.mass, run.least_bounce)
    restitution = run.restitution if bounces else 0.0
    impulse = run.mass * (1.0 + restitution) * approach
    lost = 0.5 * run.mass * (1.0 - restitution * restitution) * approach * approach
    add_event(record, True, time, impulse, lost)
    if bounces:
        _fly(run, record, cam, (on_cam[0], on_cam[1] - rebound), rebound, rebound)
        return
    now[FLYING], now[STATE], now[STATE + 1] = 0.0, vibration[0], vibration[1]
