"""One mass on a rigid stem through an interval: contact, lift-off, flight, landing, and so on.

In contact the follower is the law. It lifts off where the contact force crosses zero from above,
flies freely, and lands where the gap closes: plastically, or with Newton's restitution.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from cam_rig.dynamics.events.approach import Hop, landing
from cam_rig.dynamics.events.course import (
    BEGUN,
    FLYING,
    GAP,
    KNOWN,
    OPENING,
    STATE,
    STEP,
    TIME,
    Jumps,
    RunRecord,
    add_event,
    add_phase,
    bound,
    fly_from,
    has_room,
    no_later,
    rises,
    take,
)
from cam_rig.dynamics.events.free_flight import FreeTable, launched, moved
from cam_rig.dynamics.events.law_table import Cam, cam_at
from cam_rig.dynamics.events.rows import Row, Rows, borrowed, zeros
from cam_rig.units import TURN

#: Angle (rad) of a loss interval too short to lift anything but a rounding error.
GRAZE = 1e-9


class OneMassTable(NamedTuple):
    """A one-mass follower on a turning cam.

    Parameters
    ----------
    losses : ``(n, 2)`` cam angles in [0, 2π] between which the cam would have to pull
    force : ``(4,)`` weights of s, ṡ, s̈ in the contact force, and the preload (N)
    mass : kg
    restitution : of a landing
    force_noise : m/s², as in `Hop`
    least_bounce : m, below which a bounce is contact
    no_impact : m/s, below which a step of ṡ is rounding
    """

    cam: Cam
    free: FreeTable
    jumps: Jumps
    losses: Rows
    force: Row
    mass: float
    restitution: float
    force_noise: float
    least_bounce: float
    no_impact: float


def run_one_mass(run: OneMassTable, record: RunRecord) -> None:
    """Phase after phase, up to the interval's end or as far as there is room for them."""
    run, record = borrowed(run), borrowed(record)
    now = record.now
    if now[BEGUN] == 0.0:
        now[BEGUN] = 1.0
        gained = now[STEP] + take(run.jumps, now, 0.0)
        if now[FLYING] == 0.0:
            _impact(run, record, 0.0, gained)
        else:
            now[OPENING] -= gained
    while now[TIME] < run.jumps.duration and has_room(record):
        if now[FLYING] == 0.0:
            _contact(run, record)
        else:
            _flight(run, record)


def _contact(run: OneMassTable, record: RunRecord) -> None:
    """A phase of contact, and what ends it."""
    now, time, last = record.now, record.now[TIME], bound(run.jumps, record.now)
    end, lift_off = last, _next_lift_off(run, time)
    if lift_off < run.jumps.clear:
        end = no_later(run.jumps, now, run.cam.speed, lift_off)
    add_phase(record, end)
    now[TIME] = end
    if end < last:
        _lift_off(run, record, end, 0.0)
    else:
        _impact(run, record, end, take(run.jumps, now, end))


def _next_lift_off(run: OneMassTable, time: float) -> float:
    """Time (s) of the next lift-off from contact, infinity when the cam never has to pull."""
    angle, count = run.cam.angle + run.cam.speed * time, len(run.losses)
    turn = math.floor(angle / TURN) * TURN
    for i in range(2 * count):
        whole = turn + TURN if i >= count else turn
        if whole + run.losses[i % count][1] - angle > GRAZE:
            return time + max(0.0, (whole + run.losses[i % count][0] - angle) / run.cam.speed)
    return math.inf


def _flight(run: OneMassTable, record: RunRecord) -> None:
    """A phase of flight, at most to the next velocity jump, and what ends it."""
    now, begin, cam = record.now, record.now[TIME], run.cam
    last, start = bound(run.jumps, now), zeros(2)
    start[0], start[1] = now[STATE], now[STATE + 1]
    launch = launched(run.free, start)
    ahead = Cam(cam.law, cam.speed, cam.angle + cam.speed * begin)
    hop = Hop(launch, ahead, now[KNOWN] != 0.0, now[GAP], now[OPENING], run.force_noise)
    found = landing(hop, last - begin)
    end = no_later(run.jumps, now, cam.speed, begin + found.time) if found.landed else last
    add_phase(record, end)
    opening = found.rate - take(run.jumps, now, end)
    now[TIME] = end
    if found.landed and opening <= 0.0:
        _meet(run, record, end, -opening)
        return
    way = moved(launch, end - begin).way
    now[STATE] += way[0]
    now[STATE + 1] += way[1]
    fly_from(now, True, found.gap, opening)


def _impact(run: OneMassTable, record: RunRecord, time: float, gained: float) -> None:
    """The velocity of the cam under a follower in contact gains ``gained`` (m/s)."""
    if abs(gained) <= run.no_impact:
        return
    if gained > 0.0:
        _meet(run, record, time, gained)
    else:
        _lift_off(run, record, time, -gained)


def _lift_off(run: OneMassTable, record: RunRecord, time: float, opening: float) -> None:
    """The follower lifts off, faster than the cam by ``opening`` m/s."""
    add_event(record, False, time, 0.0, 0.0)
    _fly(record, cam_at(run.cam, time), opening)


def _fly(record: RunRecord, cam: tuple[float, float, float], opening: float) -> None:
    now = record.now
    now[STATE], now[STATE + 1] = cam[0], cam[1] + opening
    fly_from(now, True, 0.0, opening)


def _meet(run: OneMassTable, record: RunRecord, time: float, approach: float) -> None:
    """The follower meets the cam at ``approach`` m/s: it flies on, or is in contact."""
    cam = cam_at(run.cam, time)
    force = run.force[0] * cam[0] + run.force[1] * cam[1] + run.force[2] * cam[2] + run.force[3]
    rebound = run.restitution * approach
    bounces = rises(rebound, force / run.mass, run.least_bounce)
    restitution = run.restitution if bounces else 0.0
    impulse = run.mass * (1.0 + restitution) * approach
    lost = 0.5 * run.mass * (1.0 - restitution * restitution) * approach * approach
    add_event(record, True, time, impulse, lost)
    record.now[FLYING] = 0.0
    if bounces:
        _fly(record, cam, rebound)
