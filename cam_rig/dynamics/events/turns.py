"""A follower turn after turn on one cam, and the derivative of the motion by its start.

A small change is one of (z, ż) of what meets the cam, and of two masses of (y, ẏ) of the end mass
too. In flight it is carried on by the closed form of free motion, Φ. At a landing it is carried
over by the saltation matrix (Müller 1995; Leine and Nijmeijer 2004): with the approach
u = ż⁻ − ṡ < 0, the restitution r, and the gap's acceleration a⁻ before and a⁺ after it,

    δ⁺ = [[−r, 0], [(r a⁻ + a⁺)/u, −r]] δ⁻

The end mass goes on as it did, but for the damping c₁ of the stem, whose other end has another
velocity from the landing on: δẏ⁺ = δẏ⁻ − (1 + r) c₁/m₂ δz⁻. A lift-off leaves a change as it is.
On the cam what meets it has no freedom: there one mass has no change, and of two only that of the
end mass is left, which its free vibration on the stem carries on.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cam_rig.dynamics.events.contact import Vibration
from cam_rig.dynamics.events.free_flight import compute_flow, compute_impulse_response
from cam_rig.dynamics.events.law_table import cam_at
from cam_rig.dynamics.events.run_table import (
    EventCode,
    Mode,
    RunRecord,
    RunTable,
    StemStretch,
)
from cam_rig.dynamics.events.runs import compute_stem_stretch, run_events
from cam_rig.laws.vectors import Matrix, Vector, without_refcount

#: Places in a turn's row: its landings, the fastest of them (m/s), the slowest (m/s); the seconds
#: on the cam; whether the follower flies at the end; and the n numbers that the turn ends with: the
#: gap (m), the speed at which it opens (m/s), of two masses the stem's stretch (m) and its rate
#: (m/s). Behind them what n directions of change grow by, in logarithms; and the derivative of
#: these numbers by those before the turn, ``(n, n)``, row by row.
LANDINGS, HARDEST, SOFTEST, ON_CAM, FLIES, ENDS = range(6)


class Change(NamedTuple):
    """Small changes on their way, and the numbers that carry them on."""

    #: ``(n − 1, n)`` directions that grow most, unit vectors at right angles to one another
    frame: Matrix
    step: Matrix  #: ``(n, n)``, what comes next
    weights: (
        Vector  #: ``(n,)`` 1/s or 1: lengths are measured in m/s, so that none outweighs another
    )
    moved: Vector  #: ``(n,)``, for a product


def run_turns(run: RunTable, record: RunRecord, frame: Matrix, turns: Matrix, most: float) -> int:
    """Turn after turn from the record's place: rows of ``turns`` filled, and how many are.

    ``frame`` is as in `Change`. Fewer are filled where one has more than ``most`` landings.
    """
    run, record = without_refcount(run), without_refcount(record)
    state, size = record.state[0], run.free[0]["size"]
    weights = np.zeros(size)
    weights[0], weights[1] = run.cam.speed, 1.0
    if run.has_stem:
        weights[2], weights[3] = math.sqrt(run.contact.stiffness), 1.0
    change = Change(frame, np.zeros((size, size)), weights, np.zeros(size))
    for i in range(len(turns)):
        row = turns[i]
        _begin(row, size, state["mode"] == Mode.FLIGHT)
        state["time"], state["jumps_done"] = 0.0, 0
        state["initial_step"], state["has_started"] = 0.0, False
        if state["mode"] == Mode.CONTACT:  # a velocity jump at angle 0 may lift it off at once
            _hold(run, 0.0, change, row)
        while state["time"] < run.jumps.duration:
            record.counts[0]["phases"] = record.counts[0]["events"] = 0
            run_events(run, record)
            _follow(run, record, change, row)
            if row[LANDINGS] > most:
                return i
        _end(run, state, row)
    return len(turns)


def _begin(row: Vector, size: int, flies: bool) -> None:
    """No landing yet, and the derivative of (z, ż, y, ẏ) by the numbers that a turn ends with."""
    first = ENDS + 2 * size
    for j in range(len(row)):
        row[j] = 0.0
    row[SOFTEST] = math.inf
    for j in range(0 if flies else 2, size):
        row[first + j * size + j] = 1.0
    for j in range(size - 2 if flies else 0):  # y = z + w
        row[first + (j + 2) * size + j] = 1.0


def _end(run: RunTable, state: np.void, row: Vector) -> None:
    """What a turn ends with, and the derivative of it."""
    size = run.free[0]["size"]
    first = ENDS + 2 * size
    if state["mode"] == Mode.FLIGHT:
        row[ENDS], row[ENDS + 1], row[FLIES] = state["gap"], state["gap_rate"], 1.0
    for j in range(size * (size - 2)):  # w = y − z
        row[first + 2 * size + j] -= row[first + j]
    if run.has_stem:
        stem = _stem_of(run, state, run.jumps.duration)
        row[ENDS + 2], row[ENDS + 3] = stem.length, stem.rate


def _stem_of(run: RunTable, state: np.void, time: float) -> StemStretch:
    """Return the stretch of the stem in a state at a time (s)."""
    vector = state["vector"]
    if state["mode"] == Mode.FLIGHT:
        return StemStretch(vector[0], vector[1])
    vibration = Vibration(vector[0], vector[1])
    return compute_stem_stretch(run, vibration, cam_at(run.cam, time))


def _follow(run: RunTable, record: RunRecord, change: Change, row: Vector) -> None:
    """Carry a change through the phases of a record."""
    count, met, passed = record.counts[0]["phases"], record.counts[0]["events"], 0
    # The blow of a velocity jump at the turn's beginning comes before its first phase.
    while passed < met and record.events[passed]["time"] <= 0.0:
        _note(run, record.events[passed], row)
        passed += 1
    for i in range(count):
        phase = record.phases[i]
        length, approach, rebound = phase["phase_end"] - phase["time"], 0.0, 0.0
        while passed < met and record.events[passed]["time"] <= phase["phase_end"]:
            if record.events[passed]["code"] == EventCode.LANDING:
                approach, rebound = _note(run, record.events[passed], row)
            passed += 1
        if phase["mode"] == Mode.CONTACT:
            if length > 0.0:
                row[ON_CAM] += length
                _hold(run, length, change, row)
            continue
        _fly(run, length, change, row)
        if approach > 0.0:  # a graze has none: that of the flights which just miss
            restitution = run.restitution if rebound > 0.5 * run.restitution * approach else 0.0
            after = record.phases[i + 1] if i + 1 < count else record.state[0]
            _land(run, (phase["phase_end"], approach, restitution), after, change, row)


def _note(run: RunTable, event: np.void, row: Vector) -> tuple[float, float]:
    """Note a landing in a turn's row: its speeds (m/s) against the cam before and after it."""
    if event["code"] == EventCode.LIFT_OFF:
        return 0.0, 0.0
    # E = m (1 − e²) v²/2 of p = m (1 + e) v: v + e v, and v − e v.
    impulse = event["impulse"]
    both = impulse / run.mass
    less = 2.0 * event["energy_lost"] / impulse if impulse > 0.0 else 0.0
    approach = 0.5 * (both + less)
    row[LANDINGS] += 1.0
    row[HARDEST] = max(row[HARDEST], approach)
    row[SOFTEST] = min(row[SOFTEST], approach)
    return approach, 0.5 * (both - less)


def _fly(run: RunTable, time: float, change: Change, row: Vector) -> None:
    """Φ of a flight of some seconds."""
    step, free, trace = change.step, run.free[0], 0.0
    for i in range(len(step)):
        trace += free["matrix"][i][i]
    if not run.has_stem:
        damping, stiffness = free["pair_damping"][0], free["pair_stiffness"][0]
        impulse, rate, _ = compute_impulse_response(damping, stiffness, time)
        step[0][0], step[0][1] = rate + damping * impulse, impulse
        step[1][0], step[1][1] = -stiffness * impulse, rate
    else:
        flow, share = compute_flow(free, time), run.end_share
        for i in range(4):  # of (z, y) and their rates; of them w = y − z, Y = (1 − e) z + e y
            for j in range(2):
                one, two = flow[i][j], flow[i][j + 2]
                step[i][j], step[i][j + 2] = (1.0 - share) * two - one, share * two + one
        for j in range(4):
            for i in range(2):
                one, two = step[i][j], step[i + 2][j]
                step[i][j], step[i + 2][j] = two - share * one, two + (1.0 - share) * one
    _carry(change, row, trace * time, False)


def _land(
    run: RunTable, landing: tuple[float, float, float], after: np.void, change: Change, row: Vector
) -> None:
    """The saltation matrix of a landing: its time (s), its approach (m/s), its restitution.

    ``after`` is the state, or the phase, of the follower from then on.
    """
    (time, approach, restitution), step, free = landing, change.step, run.free[0]
    cam, size = cam_at(run.cam, time), len(step)
    for i in range(size):
        for j in range(size):
            step[i][j] = 1.0 if i == j else 0.0
    step[0][0] = step[1][1] = -restitution
    if not run.has_stem:
        damping, stiffness = free["pair_damping"][0], free["pair_stiffness"][0]
        still = free["load"][1] - stiffness * cam.lift - cam.acceleration
        before = still - damping * (cam.velocity - approach)
        then = still - damping * (cam.velocity + restitution * approach)
    else:
        stem, contact = _stem_of(run, after, time), run.contact
        damping, both = -contact.force_per_velocity / run.mass, (1.0 + restitution) * approach
        stiffness = contact.force_per_displacement / run.mass
        then = damping * stem.rate - stiffness * stem.length - cam.acceleration
        before = then + damping * both
        step[3][0] = -(1.0 + restitution) * damping * (1.0 - run.end_share) / run.end_share
    step[1][0] = -(restitution * before + then) / approach
    area = 2.0 * math.log(restitution) if restitution > 0.0 else -math.inf
    _carry(change, row, area, False)


def _hold(run: RunTable, time: float, change: Change, row: Vector) -> None:
    """Some seconds on the cam, where the end mass alone is free."""
    step = change.step
    for i in range(len(step)):
        for j in range(len(step)):
            step[i][j] = 0.0
    if run.has_stem:
        damping, stiffness = run.contact.damping, run.contact.stiffness
        impulse, rate, _ = compute_impulse_response(damping, stiffness, time)
        step[2][2], step[2][3] = rate + damping * impulse, impulse
        step[3][2], step[3][3] = -stiffness * impulse, rate
    _carry(change, row, -math.inf, True)


def _carry(change: Change, row: Vector, area: float, held: bool) -> None:
    """Multiply the turn's derivative by the step, and turn the frame (Gram and Schmidt).

    ``area`` is the logarithm of the step's determinant; what is ``held`` on the cam has two
    directions fewer, which begin anew when it lets go.
    """
    step, moved, size = change.step, change.moved, len(change.step)
    first, growth = ENDS + 2 * size, ENDS + size
    for j in range(size):
        for i in range(size):
            moved[i] = 0.0
            for k in range(size):
                moved[i] += step[i][k] * row[first + k * size + j]
        for i in range(size):
            row[first + i * size + j] = moved[i]
    alive = size - 2 if held else size - 1
    for k in range(alive):
        length = _turned(change, k)
        grown = math.log(length) if length > 0.0 else -math.inf
        row[growth + k] += grown
        area -= grown if length > 0.0 else 0.0
    for k in range(alive, size):
        row[growth + k] += area
    if held and size > 2:
        for i in range(size):
            change.frame[2][i] = 1.0 if i == 0 else 0.0


def _turned(change: Change, k: int) -> float:
    """Carry a direction on, at right angles to those before it; what it grows by."""
    step, moved, size = change.step, change.moved, len(change.step)
    frame, weights, length = change.frame, change.weights, 0.0
    for i in range(size):
        moved[i] = 0.0
        for j in range(size):
            moved[i] += weights[i] * step[i][j] / weights[j] * frame[k][j]
    for other in range(k):
        along = 0.0
        for i in range(size):
            along += frame[other][i] * moved[i]
        for i in range(size):
            moved[i] -= along * frame[other][i]
    for i in range(size):
        length += moved[i] * moved[i]
    length = math.sqrt(length)
    if length > 0.0:
        for i in range(size):
            frame[k][i] = moved[i] / length
    return length
