"""State machine of a follower of one or two masses: contact, lift-off, flight, landing.

    CONTACT → lift-off → FLIGHT → landing → CONTACT, or FLIGHT again if the landing rebounds

The follower is one mass, or a contact mass at the cam and an end mass on an elastic stem. In the
table ṡ is the velocity of the cam surface, e is the coefficient of restitution, and the gap is the
distance of the follower from the cam.

| from    | condition                                   | to      | event, gap rate afterwards    |
|---------|---------------------------------------------|---------|-------------------------------|
| CONTACT | contact force falls to 0                    | FLIGHT  | lift-off, 0                   |
| CONTACT | ṡ jumps down by Δ                           | FLIGHT  | lift-off, Δ                   |
| CONTACT | ṡ jumps up by Δ, rebound is high enough     | FLIGHT  | landing (impact), e Δ         |
| CONTACT | ṡ jumps up by Δ, rebound is too low         | CONTACT | landing (impact)              |
| FLIGHT  | gap falls to 0 at rate −v, high enough      | FLIGHT  | landing, e v                  |
| FLIGHT  | gap falls to 0 at rate −v, too low          | CONTACT | landing                       |
| FLIGHT  | ṡ jumps by ±Δ                               | FLIGHT  | no event, rate ∓ Δ            |

`run_events` repeats three steps: find the end of the phase, record the phase, apply the event at
its end. A phase ends at its event, at the next velocity jump, or at the end of the interval.

Invariants after each repetition, with the inequalities of docs/proofs.md, part 1:

1. The recorded phases follow each other without a gap. The last phase ends at ``state["time"]``.
2. The force was not below −ε_F in CONTACT, nor the gap below −ε_g in FLIGHT (theorem A).
3. In FLIGHT ``gap`` and ``gap_rate`` are the follower less the cam at ``time``, after all velocity
   jumps up to ``time``. Each jump is subtracted exactly once (13).
4. A flight that starts at an event starts with a gap of exactly 0 and a gap rate ≥ 0.
5. A rebound has e times the speed of its landing relative to the cam. Bounces end, because a
   follower that would stay below ``min_bounce_height`` stops on the cam (14).

A landing stops the contact mass on the cam or rebounds with Newton's restitution e. The end mass
of two masses keeps its velocity.
"""

from __future__ import annotations

import math

import numpy as np

from cam_rig.dynamics.events.approach import FlightOverCam, find_landing, rate_before_jump
from cam_rig.dynamics.events.contact import StemVibration, find_loss_of_contact, vibration_after
from cam_rig.dynamics.events.free_flight import advance, start_free_motion
from cam_rig.dynamics.events.law_table import Cam, CamMotion, cam_at
from cam_rig.dynamics.events.run_table import (
    EventCode,
    Jumps,
    RunMode,
    RunRecord,
    RunTable,
    StemStretch,
)
from cam_rig.dynamics.velocity_jumps import SAME_ANGLE_RAD
from cam_rig.laws.vectors import without_refcount
from cam_rig.units import TURN

#: Smallest range of cam angles (rad) with a negative contact force that causes a lift-off. In a
#: smaller range the negative force is rounding.
MIN_LOSS_ANGLE = 1e-9


def run_events(run: RunTable, record: RunRecord) -> None:
    """Advance the follower through contacts and flights, and record them.

    ``run`` contains the coefficients of the follower and the cam in one interval of constant cam
    speed. The state in ``record`` is updated, and phases (contact or flight) and events (lift-off
    or landing) are appended, until the interval ends or the record is full.
    """
    run, record = without_refcount(run), without_refcount(record)
    state, counts = record.state[0], record.counts[0]
    if not state["has_started"]:
        state["has_started"] = True
        step = state["initial_step"] + _consume_jumps(run.jumps, state, 0.0)
        _apply_velocity_step(run, record, 0.0, step)
    while (
        state["time"] < run.jumps.duration
        and counts["phases"] + 1 <= len(record.phases)
        and counts["events"] + 2 <= len(record.events)
    ):
        if state["mode"] == RunMode.FLIGHT:
            _fly(run, record)
        elif run.has_stem:
            _ride_two_masses(run, record)
        else:
            _ride_one_mass(run, record)


def start_flight(state: np.void, gap_known: bool, gap: float, gap_rate: float) -> None:
    """Set a state of `RUN_STATE` to flight, with the gap (m) and its rate (m/s).

    The field ``vector`` of the state, which contains the displacements and velocities, must already
    be set. ``gap_known`` is True if the gap is more accurate than a difference of displacements.
    """
    state["mode"], state["gap_known"] = RunMode.FLIGHT, gap_known
    state["gap"], state["gap_rate"] = gap, gap_rate


def _ride_one_mass(run: RunTable, record: RunRecord) -> None:
    """Advance a follower of one mass through a phase of contact.

    The phase ends at its lift-off, at a velocity jump of the law, or at the end of the interval.
    The phase and the event at its end are recorded.
    """
    state = record.state[0]
    time, limit = state["time"], _next_limit(run.jumps, state)
    lift_off, angle = math.inf, run.cam.angle + run.cam.speed * time
    turn, count = math.floor(angle / TURN) * TURN, len(run.losses)
    for i in range(2 * count):  # this turn and the next one
        loss, turn_start = run.losses[i % count], turn + TURN if i >= count else turn
        if turn_start + loss["end"] - angle > MIN_LOSS_ANGLE:
            lift_off = time + max(0.0, (turn_start + loss["start"] - angle) / run.cam.speed)
            break
    end = limit
    if lift_off < run.jumps.contact_limit:
        end = _limit_event_time(run, state, lift_off)
    _record_phase(record, end)
    state["time"] = end
    if end < limit:
        _lift_off(run, record, end, cam_at(run.cam, end), StemStretch(0.0, 0.0), 0.0)
    else:
        _apply_velocity_step(run, record, end, _consume_jumps(run.jumps, state, end))


def _ride_two_masses(run: RunTable, record: RunRecord) -> None:
    """Advance a follower of two masses through a phase of contact.

    The phase ends at its lift-off, at a velocity jump of the law, or at the end of the interval.
    The phase and the event at its end are recorded.
    """
    state, contact = record.state[0], run.contact
    time, limit = state["time"], _next_limit(run.jumps, state)
    vibration = StemVibration(state["vector"][0], state["vector"][1])
    angle = run.cam.angle + run.cam.speed * time
    duration = min(limit, run.jumps.contact_limit) - time
    loss = find_loss_of_contact(contact, run.cam.speed, angle, vibration, duration)
    end = _limit_event_time(run, state, time + loss.time) if loss.is_lost else limit
    _record_phase(record, end)
    jumps_before = state["jumps_done"]
    step, state["time"] = _consume_jumps(run.jumps, state, end), end
    if loss.is_lost and state["jumps_done"] == jumps_before:
        cam = cam_at(run.cam, end)
        vibration = vibration_after(contact, loss.stretch, loss.time - loss.stretch_start)
        # The flight starts at the float ``end``, which differs by rounding from the time of the
        # contact loss. One Euler step corrects the vibration.
        rounding = (end - time) - loss.time
        driven = run.drive.lift * cam.lift + run.drive.velocity * cam.velocity
        driven += run.drive.acceleration * cam.acceleration
        acceleration = driven - contact.stiffness * vibration.displacement
        acceleration -= contact.damping * vibration.velocity
        vibration = StemVibration(
            vibration.displacement + rounding * vibration.velocity,
            vibration.velocity + rounding * acceleration,
        )
        _lift_off(run, record, end, cam, compute_stem_stretch(run, vibration, cam), 0.0)
        return
    vibration = vibration_after(contact, loss.stretch, (end - time) - loss.stretch_start)
    state["vector"][0], state["vector"][1] = vibration.displacement, vibration.velocity
    _apply_velocity_step(run, record, end, step)


def _fly(run: RunTable, record: RunRecord) -> None:
    """Advance a follower of one or two masses through a flight.

    The flight ends at its landing, at a velocity jump of the law, or at the end of the interval.
    The phase and the event at its end are recorded.
    """
    state, vector, cam = record.state[0], record.state[0]["vector"], run.cam
    time, limit = state["time"], _next_limit(run.jumps, state)
    start = np.zeros(run.free[0]["size"])
    for i in range(len(start)):
        start[i] = vector[i]
    lift_off = start_free_motion(run.free, start)
    flight = FlightOverCam(
        lift_off=lift_off,
        cam=Cam(law=cam.law, speed=cam.speed, angle=cam.angle + cam.speed * time),
        gap_known=state["gap_known"],
        gap=state["gap"],
        gap_rate=state["gap_rate"],
        acceleration_rounding=run.acceleration_rounding,
    )
    landing = find_landing(flight, limit - time)
    end = _limit_event_time(run, state, time + landing.time) if landing.has_landed else limit
    _record_phase(record, end)
    gap_rate, state["time"] = landing.rate - _consume_jumps(run.jumps, state, end), end
    if not landing.has_landed and end == run.jumps.duration > run.jumps.contact_limit:
        # The velocity jump at the end belongs to the next interval, which subtracts it from the
        # rate of the gap.
        gap_rate = rate_before_jump(flight, end - time, run.jumps.contact_limit - time)
    has_landed = landing.has_landed and gap_rate <= 0.0
    if run.has_stem or not has_landed:  # one mass that lands has the displacement of the cam
        change = advance(lift_off, end - time).change
        for i in range(len(start)):
            vector[i] += change[i]
    if has_landed:
        _land(run, record, end, StemStretch(vector[0], vector[1]), gap_rate)
    else:
        start_flight(state, True, landing.gap, gap_rate)


def _apply_velocity_step(run: RunTable, record: RunRecord, time: float, step: float) -> None:
    """Apply an abrupt change of the cam's velocity ṡ to the follower.

    In contact a positive ``step`` (m/s) is an impact, and a negative one is a lift-off. In flight
    it changes the rate of the gap. A step within rounding has no effect. ``time`` is in s. ``run``
    contains the coefficients of the follower, and ``record`` its present state.
    """
    state = record.state[0]
    if abs(step) <= run.min_velocity_step:
        return
    if state["mode"] == RunMode.FLIGHT:
        state["gap_rate"] -= step
        return
    cam = cam_at(run.cam, time)
    before = CamMotion(cam.lift, cam.velocity - step, cam.acceleration)
    vibration = StemVibration(state["vector"][0], state["vector"][1])
    stretch = compute_stem_stretch(run, vibration, before)
    if step < 0.0:
        _lift_off(run, record, time, before, stretch, -step)
    else:
        _land(run, record, time, stretch, -step)


def _lift_off(
    run: RunTable,
    record: RunRecord,
    time: float,
    cam: CamMotion,
    stretch: StemStretch,
    gap_rate: float,
) -> None:
    """Record a lift-off, and start the flight of a follower that moves with the cam.

    ``cam`` is the motion of the cam surface at the lift-off, and ``stretch`` that of the stem of
    two masses. ``gap_rate`` is the initial rate of the gap between follower and cam, m/s. ``run``
    contains the coefficients of the follower, and ``record`` its state and the recorded events.
    ``time`` is in s.
    """
    _record_event(record, EventCode.LIFT_OFF, time, 0.0, 0.0)
    _launch(run, record.state[0], cam, stretch, 0.0, gap_rate)


def _land(run: RunTable, record: RunRecord, time: float, stretch: StemStretch, rate: float) -> None:
    """Record a landing, after which the follower rebounds or stays on the cam.

    ``rate`` is the gap rate before the landing, at most 0 m/s. ``stretch`` is the stretch of the
    stem just before the landing, for two masses. ``run`` contains the coefficients of the follower,
    and ``record`` its state and the recorded events. ``time`` is in s.
    """
    state, cam, approach, force = record.state[0], cam_at(run.cam, time), -rate, 0.0
    on_cam, vibration = StemStretch(stretch.length, stretch.rate + rate), StemVibration(0.0, 0.0)
    if run.has_stem:
        static = compute_stem_stretch(run, StemVibration(0.0, 0.0), cam)
        vibration = StemVibration(on_cam.length - static.length, on_cam.rate - static.rate)
        force = run.contact.force_per_displacement * vibration.displacement
        force += run.contact.force_per_velocity * vibration.velocity
    weights = run.force
    force += (
        weights.lift * cam.lift
        + weights.velocity * cam.velocity
        + weights.acceleration * cam.acceleration
        + weights.constant
    )
    # The contact force at rest on the cam decelerates a rebound. If the rebound would be lower than
    # ``min_bounce_height``, the follower stays on the cam (14).
    rebound, deceleration = run.restitution * approach, force / run.mass
    rebounds = rebound > 0.0
    if rebounds and deceleration > 0.0:
        rebounds = 0.5 * rebound * rebound / deceleration > run.min_bounce_height
    restitution = run.restitution if rebounds else 0.0
    impulse = run.mass * (1.0 + restitution) * approach
    energy_lost = 0.5 * run.mass * (1.0 - restitution * restitution) * approach * approach
    _record_event(record, EventCode.LANDING, time, impulse, energy_lost)
    if rebounds:
        launched = StemStretch(on_cam.length, on_cam.rate - rebound)
        _launch(run, state, cam, launched, rebound, rebound)
        return
    state["mode"] = RunMode.CONTACT
    state["vector"][0], state["vector"][1] = vibration.displacement, vibration.velocity


def _launch(
    run: RunTable,
    state: np.void,
    cam: CamMotion,
    stretch: StemStretch,
    rebound: float,
    gap_rate: float,
) -> None:
    """Set the state to a flight that starts at the cam surface.

    The contact mass starts with the velocity in ``cam`` plus ``rebound`` (m/s). ``stretch`` is that
    of the stem of two masses. ``gap_rate`` (m/s) is the initial rate of the gap. It differs from
    ``rebound`` at a lift-off by a velocity jump of the law, where ``cam`` is the motion before the
    jump and ``gap_rate`` is the rate after it.
    """
    vector, velocity = state["vector"], cam.velocity + rebound
    if run.has_stem:
        vector[0], vector[1] = stretch.length, stretch.rate
        vector[2] = cam.lift + run.end_share * stretch.length
        vector[3] = velocity + run.end_share * stretch.rate
    else:
        vector[0], vector[1] = cam.lift, velocity
    start_flight(state, True, 0.0, gap_rate)


def compute_stem_stretch(run: RunTable, vibration: StemVibration, cam: CamMotion) -> StemStretch:
    """Return the stretch of the stem of two masses in contact, and its rate.

    ``vibration`` is that of the end mass, and ``cam`` the motion of the cam surface. The formula
    w = η − (1 − α) s − preload / (k₁ + k₂) has no cancellation, although the stretch w is small
    compared with the displacements of both masses.
    """
    length = vibration.displacement - run.spring_share * cam.lift - run.preload_compression
    return StemStretch(length, vibration.velocity - run.spring_share * cam.velocity)


def _next_limit(jumps: Jumps, state: np.void) -> float:
    """Return the time (s) at which the present contact or flight ends at the latest.

    It is the time of the next velocity jump of the law, or the end of the interval.
    """
    done = state["jumps_done"]
    if done == len(jumps.ahead):
        return jumps.duration
    time: float = jumps.ahead[done]["time"]
    return min(time, jumps.duration)


def _limit_event_time(run: RunTable, state: np.void, time: float) -> float:
    """Return the time (s) of an event, limited to the end that `_next_limit` returns.

    An event within rounding of a velocity jump is moved to the jump. An event is a lift-off or a
    landing. ``run`` contains the velocity jumps ahead, and ``state`` is the present state of the
    follower.
    """
    has_jump = state["jumps_done"] < len(run.jumps.ahead)
    limit, rounding = _next_limit(run.jumps, state), SAME_ANGLE_RAD / run.cam.speed
    return time if time < limit - (rounding if has_jump else 0.0) else limit


def _consume_jumps(jumps: Jumps, state: np.void, time: float) -> float:
    """Return the sum (m/s) of the cam's velocity jumps that are due up to a time (s).

    They are marked as applied in ``state``, so that each jump is applied once.
    """
    step, done = 0.0, state["jumps_done"]
    while done < len(jumps.ahead) and jumps.ahead[done]["time"] <= time:
        step += jumps.ahead[done]["step"]
        done += 1
    state["jumps_done"] = done
    return step


def _record_phase(record: RunRecord, end: float) -> None:
    """Append a phase to a record: the current state of the follower and the end time.

    ``end`` is the end of the phase, s since the start of the interval.
    """
    counts = record.counts[0]
    index = counts["phases"]
    record.phases[index] = record.state[0]
    record.phases[index]["phase_end"] = end
    counts["phases"] += 1


def _record_event(
    record: RunRecord, code: EventCode, time: float, impulse: float, energy_lost: float
) -> None:
    """Append a lift-off or a landing to a record.

    ``time`` is in s since the start of the interval. The ``impulse`` (N·s) and the ``energy_lost``
    (J) of a landing are 0 at a lift-off.
    """
    counts = record.counts[0]
    event = record.events[counts["events"]]
    event["code"], event["time"] = code, time
    event["impulse"], event["energy_lost"] = impulse, energy_lost
    counts["events"] += 1
