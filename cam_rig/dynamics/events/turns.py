"""Motion of a follower over turns of a cam, and its derivative by the initial state.

The derivative of the state after one turn by the state before it determines if a bouncing motion is
stable, and how fast nearby motions diverge.

A perturbation is a small change of (z, ż) of the contact mass at the cam, and for two masses also
of (y, ẏ) of the end mass. In flight it is multiplied by the matrix exponential of the free motion,
and at a landing by the saltation matrix (Müller 1995; Leine and Nijmeijer 2004). With the approach
velocity u = ż⁻ − ṡ < 0, the restitution r, and the acceleration of the gap a⁻ before and a⁺ after
the landing, the saltation matrix is

    δ⁺ = [[−r, 0], [(r a⁻ + a⁺)/u, −r]] δ⁻

The end mass continues. Only the damping c₁ of the stem acts on it, because the other end of the
stem changes its velocity: δẏ⁺ = δẏ⁻ − (1 + r) c₁/m₂ δz⁻. A lift-off does not change a perturbation.
In contact the cam determines the motion of the contact mass. Therefore one mass loses its
perturbation there, and two masses keep only that of the end mass, which the free vibration on the
stem carries.

Invariant: after each phase the derivative in the result of the turn is that of the state at the end
of the phase by the state at the start of the turn, and the frame (the directions of largest growth)
is orthonormal.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cam_rig.dynamics.events.contact import StemVibration
from cam_rig.dynamics.events.free_flight import compute_flow, compute_impulse_response
from cam_rig.dynamics.events.law_table import cam_at
from cam_rig.dynamics.events.run_table import (
    EventCode,
    RunMode,
    RunRecord,
    RunTable,
    StemStretch,
)
from cam_rig.dynamics.events.runs import compute_stem_stretch, run_events
from cam_rig.laws.vectors import Matrix, Records, Vector, without_refcount

#: Record of the result of one turn of the cam. Its arrays have 4 elements per axis. A follower of
#: one mass uses the first 2 of them, two masses use all 4.
TURN_RESULT = np.dtype(
    [
        ("landings", "i8"),  # number of landings in the turn
        ("max_landing_speed", "f8"),  # fastest, relative to the cam, m/s; 0 without a landing
        ("min_landing_speed", "f8"),  # slowest, relative to the cam, m/s; infinite without one
        ("contact_time", "f8"),  # total duration of contact in the turn, s
        ("is_flying", "?"),  # True if the follower is in flight at the end of the turn
        # State at the end of the turn: gap (m) and its rate (m/s), for two masses also the stretch
        # of the stem (m) and its rate (m/s).
        ("state", "f8", (4,)),
        ("growth", "f8", (4,)),  # logarithms of the growth of n perturbations in the turn
        ("derivative", "f8", (4, 4)),  # derivative of ``state`` by the state before the turn
    ],
    align=True,
)


class Perturbation(NamedTuple):
    """Directions of small perturbations of the follower's n states, and work space."""

    frame: Matrix  #: directions of largest growth, orthonormal, ``(n − 1, n)``
    step: Matrix  #: derivative of the state after the next phase or landing by that before it
    #: Factors ``(n,)`` (1/s or 1) that convert the states to m/s, so that no state outweighs
    #: another.
    weights: Vector
    product: Vector  #: work space, ``(n,)``


class Landing(NamedTuple):
    """Data of a landing that determine its effect on small perturbations of the state."""

    time: float  #: time of the landing since the start of the turn, s
    approach: float  #: speed of the follower towards the cam, m/s
    restitution: float  #: coefficient of restitution of this landing, 0 if it does not rebound


def run_turns(
    run: RunTable, record: RunRecord, frame: Matrix, turns: Records, max_landings: float
) -> int:
    """Run the follower over turns of the cam, and return the number of turns completed.

    The run starts in the state of ``record``. One result per turn is written to ``turns``, records
    of `TURN_RESULT`. ``frame`` contains the directions whose growth is computed (see
    `Perturbation`), and is updated. The run ends early in a turn with more than ``max_landings``
    landings.
    """
    run, record = without_refcount(run), without_refcount(record)
    state, size = record.state[0], run.free[0]["size"]
    weights = np.zeros(size)
    weights[0], weights[1] = run.cam.speed, 1.0
    if run.has_stem:
        weights[2], weights[3] = math.sqrt(run.contact.stiffness), 1.0
    perturbation = Perturbation(frame, np.zeros((size, size)), weights, np.zeros(size))
    for i in range(len(turns)):
        turn = turns[i]
        _start_turn(turn, size, state["mode"] == RunMode.FLIGHT)
        state["time"], state["jumps_done"] = 0.0, 0
        state["initial_step"], state["has_started"] = 0.0, False
        if state["mode"] == RunMode.CONTACT:  # a velocity jump at angle 0 may lift it off at once
            _pass_contact(run, 0.0, perturbation, turn)
        while state["time"] < run.jumps.duration:
            record.counts[0]["phases"] = record.counts[0]["events"] = 0
            run_events(run, record)
            _pass_phases(run, record, perturbation, turn)
            if turn["landings"] > max_landings:
                return i
        _end_turn(run, state, turn)
    return len(turns)


def _start_turn(turn: np.void, size: int, is_flying: bool) -> None:
    """Initialise the result of a turn: no landings, and the initial derivative.

    The derivative is that of (z, ż, y, ẏ) by the field ``state`` at the start of the turn, which
    contains the gap and the stretch of the stem. ``size`` is the number of states, 2 for one mass
    and 4 for two. Only a follower in flight can be perturbed by its gap.
    """
    turn["landings"], turn["max_landing_speed"], turn["min_landing_speed"] = 0, 0.0, math.inf
    turn["contact_time"], turn["is_flying"] = 0.0, False
    state, growth, derivative = turn["state"], turn["growth"], turn["derivative"]
    for i in range(4):
        state[i] = growth[i] = 0.0
        for j in range(4):
            derivative[i][j] = 0.0
    for j in range(0 if is_flying else 2, size):
        derivative[j][j] = 1.0
    for j in range(size - 2 if is_flying else 0):  # y = z + w
        derivative[j + 2][j] = 1.0


def _end_turn(run: RunTable, state: np.void, turn: np.void) -> None:
    """Write the state at the end of a turn to the result ``turn``.

    This state contains the gap and the stretch of the stem. The derivative, so far that of
    (z, ż, y, ẏ), is converted to that of this state.
    """
    size, end, derivative = run.free[0]["size"], turn["state"], turn["derivative"]
    if state["mode"] == RunMode.FLIGHT:
        end[0], end[1], turn["is_flying"] = state["gap"], state["gap_rate"], True
    for i in range(2, size):  # w = y − z
        for j in range(size):
            derivative[i][j] -= derivative[i - 2][j]
    if run.has_stem:
        stem = _stem_of(run, state, run.jumps.duration)
        end[2], end[3] = stem.length, stem.rate


def _stem_of(run: RunTable, state: np.void, time: float) -> StemStretch:
    """Return the stretch of the stem of two masses at a time (s), and its rate.

    ``state`` is a record of `RUN_STATE` at that time, in contact or in flight.
    """
    vector = state["vector"]
    if state["mode"] == RunMode.FLIGHT:
        return StemStretch(vector[0], vector[1])
    vibration = StemVibration(vector[0], vector[1])
    return compute_stem_stretch(run, vibration, cam_at(run.cam, time))


def _pass_phases(
    run: RunTable, record: RunRecord, perturbation: Perturbation, turn: np.void
) -> None:
    """Update the perturbations over all phases (contact or flight) of a record.

    The derivative, the growth of the perturbations, the landing speeds and the contact time in
    ``turn`` are updated, and landings are counted.
    """
    count, event_count, passed = record.counts[0]["phases"], record.counts[0]["events"], 0
    # The impact of a velocity jump at the start of the turn precedes its first phase.
    while passed < event_count and record.events[passed]["time"] <= 0.0:
        _count_landing(run, record.events[passed], turn)
        passed += 1
    for i in range(count):
        phase = record.phases[i]
        length, approach, rebound = phase["phase_end"] - phase["time"], 0.0, 0.0
        while passed < event_count and record.events[passed]["time"] <= phase["phase_end"]:
            if record.events[passed]["code"] == EventCode.LANDING:
                approach, rebound = _count_landing(run, record.events[passed], turn)
            passed += 1
        if phase["mode"] == RunMode.CONTACT:
            if length > 0.0:
                turn["contact_time"] += length
                _pass_contact(run, length, perturbation, turn)
            continue
        _pass_flight(run, length, perturbation, turn)
        # A landing at a relative speed of 0 is a graze. The derivative is then that of a flight
        # that just misses the cam.
        if approach > 0.0:
            restitution = run.restitution if rebound > 0.5 * run.restitution * approach else 0.0
            after = record.phases[i + 1] if i + 1 < count else record.state[0]
            landing = Landing(phase["phase_end"], approach, restitution)
            _pass_landing(run, landing, after, perturbation, turn)


def _count_landing(run: RunTable, event: np.void, turn: np.void) -> tuple[float, float]:
    """Add a landing to a turn's result, and return the speeds before and after it.

    The speeds (m/s) are relative to the cam, and follow from the impulse and the energy loss. If
    ``event`` is a lift-off, nothing is added and both speeds are 0.
    """
    if event["code"] == EventCode.LIFT_OFF:
        return 0.0, 0.0
    # E = m (1 − e²) v²/2 and p = m (1 + e) v give v + e v and v − e v.
    impulse = event["impulse"]
    total = impulse / run.mass
    difference = 2.0 * event["energy_lost"] / impulse if impulse > 0.0 else 0.0
    approach = 0.5 * (total + difference)
    turn["landings"] += 1
    turn["max_landing_speed"] = max(turn["max_landing_speed"], approach)
    turn["min_landing_speed"] = min(turn["min_landing_speed"], approach)
    return approach, 0.5 * (total - difference)


def _pass_flight(run: RunTable, time: float, perturbation: Perturbation, turn: np.void) -> None:
    """Update the derivative and the perturbations over a flight that lasts ``time`` s.

    Their matrix is the exponential of the free motion, in the states (z, ż, y, ẏ). ``run`` contains
    the coefficients of the follower, and ``turn`` is the result of the present turn, which contains
    the derivative.
    """
    step, free, trace = perturbation.step, run.free[0], 0.0
    for i in range(len(step)):
        trace += free["matrix"][i][i]
    if not run.has_stem:
        damping, stiffness = free["pair_damping"][0], free["pair_stiffness"][0]
        response = compute_impulse_response(damping, stiffness, time)
        step[0][0], step[0][1] = response.rate + damping * response.value, response.value
        step[1][0], step[1][1] = -stiffness * response.value, response.rate
    else:
        flow, share = compute_flow(free, time), run.end_share
        for i in range(4):  # from (w, Y) to (z, y): w = y − z, Y = (1 − e) z + e y, and the rates
            for j in range(2):
                a, b = flow[i][j], flow[i][j + 2]
                step[i][j], step[i][j + 2] = (1.0 - share) * b - a, share * b + a
        for j in range(4):
            for i in range(2):
                a, b = step[i][j], step[i + 2][j]
                step[i][j], step[i + 2][j] = b - share * a, b + (1.0 - share) * a
    _apply_step(perturbation, turn, trace * time, False)


def _pass_landing(
    run: RunTable, landing: Landing, after: np.void, perturbation: Perturbation, turn: np.void
) -> None:
    """Update the derivative and the perturbations at a landing, by its saltation matrix.

    The module describes the matrix. ``after`` is the state or the phase that follows the landing, a
    record of `RUN_STATE`. ``run`` contains the coefficients of the follower, and ``turn`` is the
    result of the present turn, which contains the derivative.
    """
    step, free, restitution = perturbation.step, run.free[0], landing.restitution
    cam, size, approach = cam_at(run.cam, landing.time), len(step), landing.approach
    for i in range(size):
        for j in range(size):
            step[i][j] = 1.0 if i == j else 0.0
    step[0][0] = step[1][1] = -restitution
    if not run.has_stem:
        damping, stiffness = free["pair_damping"][0], free["pair_stiffness"][0]
        static = free["load"][1] - stiffness * cam.lift - cam.acceleration
        gap_before = static - damping * (cam.velocity - approach)
        gap_after = static - damping * (cam.velocity + restitution * approach)
    else:
        stem, contact = _stem_of(run, after, landing.time), run.contact
        damping, change = -contact.force_per_velocity / run.mass, (1.0 + restitution) * approach
        stiffness = contact.force_per_displacement / run.mass
        gap_after = damping * stem.rate - stiffness * stem.length - cam.acceleration
        gap_before = gap_after + damping * change
        step[3][0] = -(1.0 + restitution) * damping * (1.0 - run.end_share) / run.end_share
    step[1][0] = -(restitution * gap_before + gap_after) / approach
    log_determinant = 2.0 * math.log(restitution) if restitution > 0.0 else -math.inf
    _apply_step(perturbation, turn, log_determinant, False)


def _pass_contact(run: RunTable, time: float, perturbation: Perturbation, turn: np.void) -> None:
    """Update the derivative and the perturbations over ``time`` s of contact.

    The cam determines the motion of the contact mass, so only perturbations of the end mass of two
    masses remain. One mass loses its perturbation. ``run`` contains the coefficients of the
    follower, and ``turn`` is the result of the present turn, which contains the derivative.
    """
    step = perturbation.step
    for i in range(len(step)):
        for j in range(len(step)):
            step[i][j] = 0.0
    if run.has_stem:
        damping, stiffness = run.contact.damping, run.contact.stiffness
        response = compute_impulse_response(damping, stiffness, time)
        step[2][2], step[2][3] = response.rate + damping * response.value, response.value
        step[3][2], step[3][3] = -stiffness * response.value, response.rate
    _apply_step(perturbation, turn, -math.inf, True)


def _apply_step(
    perturbation: Perturbation, turn: np.void, log_determinant: float, in_contact: bool
) -> None:
    """Multiply the derivative of a turn by ``perturbation.step``, and update the frame.

    The logarithms of the growth of each direction are added to ``turn``. The growth of the last
    direction follows from ``log_determinant``, the logarithm of the determinant of the step. The
    frame of directions is made orthonormal by the Gram-Schmidt method. In contact there are two
    directions fewer, which are initialised again for the lift-off.
    """
    step, product, size = perturbation.step, perturbation.product, len(perturbation.step)
    derivative, growth = turn["derivative"], turn["growth"]
    for j in range(size):
        for i in range(size):
            product[i] = 0.0
            for k in range(size):
                product[i] += step[i][k] * derivative[k][j]
        for i in range(size):
            derivative[i][j] = product[i]
    count = size - 2 if in_contact else size - 1
    for k in range(count):
        length = _turn_direction(perturbation, k)
        log_length = math.log(length) if length > 0.0 else -math.inf
        growth[k] += log_length
        log_determinant -= log_length if length > 0.0 else 0.0
    for k in range(count, size):
        growth[k] += log_determinant
    if in_contact and size > 2:
        for i in range(size):
            perturbation.frame[2][i] = 1.0 if i == 0 else 0.0


def _turn_direction(perturbation: Perturbation, k: int) -> float:
    """Multiply direction k of the frame by the step matrix, and return its growth factor.

    The new direction is made orthogonal to the directions before it, and normalised. The growth
    factor is its length before the normalisation.
    """
    step, product, size = perturbation.step, perturbation.product, len(perturbation.step)
    frame, weights, length = perturbation.frame, perturbation.weights, 0.0
    for i in range(size):
        product[i] = 0.0
        for j in range(size):
            product[i] += weights[i] * step[i][j] / weights[j] * frame[k][j]
    for other in range(k):
        along = 0.0
        for i in range(size):
            along += frame[other][i] * product[i]
        for i in range(size):
            product[i] -= along * frame[other][i]
    for i in range(size):
        length += product[i] * product[i]
    length = math.sqrt(length)
    if length > 0.0:
        for i in range(size):
            frame[k][i] = product[i] / length
    return length
