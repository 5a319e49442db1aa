"""Steady contact force over a period, in pieces with closed forms.

A piece is an interval of time in contact, in which the force is a polynomial plus a free vibration
of the stem. Landings add impulses.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from cam_rig.dynamics import MODELS, FollowerParameters, Interval, elastic_stem
from cam_rig.dynamics.free_masses import TwoMassParameters, contact_response, force_output
from cam_rig.dynamics.interval import Event
from cam_rig.dynamics.kinetostatic import force_extremes, force_ordinates
from cam_rig.dynamics.linear.exponential import free_motion
from cam_rig.dynamics.linear.response import LinearResponse, Outputs, polynomial_part
from cam_rig.dynamics.one_mass import OneMassTrajectory
from cam_rig.dynamics.steady_rules import MAX_PERIOD_TURNS, SPECTRUM_TURNS, STATE_RTOL
from cam_rig.dynamics.two_mass import Separation, first_lift_off, states
from cam_rig.dynamics.velocity_jumps import require_smooth
from cam_rig.errors import ConfigError
from cam_rig.laws import Law, bernstein
from cam_rig.schema import RigConfig
from cam_rig.units import NS, TURN, FloatArray

#: Smallest overlap of the contact phases of two turns at which they count as the same contact, as a
#: fraction of a turn. It is above rounding.
OVERLAP = 1e-9


@dataclass(frozen=True, eq=False)
class FreeForce:
    """Contact force c e^{At} z due to a free vibration of the stem, t in s.

    `matrix` is A of shape (2, 2), `row` is c and `start` is the initial state z, both of shape
    (2,).
    """

    matrix: FloatArray
    row: FloatArray
    start: FloatArray


@dataclass(frozen=True, eq=False)
class ForcePiece:
    """Contact force in an interval of time: a polynomial (N) plus a free vibration.

    `begin` is the time in s since θ = 0, and `length` the duration in s. `ordinates` are the
    Bernstein ordinates of the polynomial, shape (p + 1,). `free` is None for a rigid stem.
    """

    begin: float
    length: float
    ordinates: FloatArray
    free: FreeForce | None = None

    def at(self, times: FloatArray) -> FloatArray:
        """Return the contact force (N) at times within the interval of this piece.

        The times are in s since θ = 0.
        """
        since = times - self.begin
        force = bernstein.evaluate(self.ordinates, since / self.length)
        if self.free is not None:
            vibration = self.free
            force = force + vibration.row @ free_motion(vibration.matrix, vibration.start, since)
        return np.asarray(force)


@dataclass(frozen=True, eq=False)
class SteadyForce:
    """Periodic contact force over `turns` turns at `speed` (rad/s).

    `turns` is greater than 1 if the follower lands differently in successive turns. `pieces` are
    the intervals in contact. Between them the follower is in flight and the force is zero.
    `landings` are pairs of time (s since θ = 0) and impulse (N·s). If `settled` is False, the force
    is not periodic, and the values are those of the last simulated turn.
    """

    speed: float
    turns: int
    pieces: tuple[ForcePiece, ...]
    landings: tuple[tuple[float, float], ...] = ()
    settled: bool = True

    @property
    def natural_frequency(self) -> float | None:
        """Natural frequency of the stem in contact, Hz.

        It is None for a model with a rigid stem.
        """
        free = next((piece.free for piece in self.pieces if piece.free is not None), None)
        return None if free is None else math.sqrt(float(np.linalg.det(free.matrix))) / TURN

    @property
    def duration(self) -> float:
        """Duration (s) of the period after which the contact force repeats."""
        return self.turns * TURN / self.speed

    def at(self, times: FloatArray) -> FloatArray:
        """Return the force (N) without the impulses of landings, shape (n,).

        `times` are any times in s since θ = 0, shape (n,).
        """
        first = self.pieces[0].begin if self.pieces else 0.0
        inside = first + np.mod(times - first, self.duration)
        force = np.zeros(times.size)
        for piece in self.pieces:
            is_inside = (inside >= piece.begin) & (inside < piece.begin + piece.length)
            force[is_inside] = piece.at(inside[is_inside])
        return force


def steady_force(law: Law, model: str, rig: RigConfig, speed: float) -> SteadyForce:
    """Return the steady contact force of a follower at a speed (rad/s).

    ``model`` is the name of the follower's model. Raises ConfigError for a model whose force has no
    closed form.
    """
    if model not in BUILDERS:
        raise ConfigError(
            f"orders require a model with a force in closed form: {', '.join(BUILDERS)}, got "
            f"{model}"
        )
    if model == "one_mass" and rig.follower.restitution is None:
        # Without a landing the force does not depend on the restitution.
        rigid = FollowerParameters.from_rig(rig)
        if not law.velocity_jumps and force_extremes(law, rigid, speed)[0] > 0.0:
            return _kinetostatic(law, rigid, speed)
    return BUILDERS[model](law, MODELS[model].parameters(rig), speed)


def _kinetostatic(law: Law, p: FollowerParameters, speed: float) -> SteadyForce:
    """Return the steady force of a follower that always keeps contact."""
    require_smooth(law)
    forces = force_ordinates(law, p, speed)
    return SteadyForce(speed, 1, tuple(_contact_pieces(law, forces, speed, 0.0, TURN / speed)))


def _one_mass(law: Law, p: FollowerParameters, speed: float) -> SteadyForce:
    """Return the steady force of the model with one rigid mass.

    In contact the motion does not depend on the past. If the follower is in contact at the same cam
    angle in two turns, its motion therefore repeats.
    """
    turn, repetition = TURN / speed, None
    for run in SPECTRUM_TURNS:
        trajectory = OneMassTrajectory(
            law, p, Interval(0, math.ceil(run * turn * NS) + 1, 0.0, speed)
        )
        trajectory.run(None)
        contacts = [(x.begin, x.end) for x in trajectory.phases if x.flight is None]
        repetition = _find_repetition(contacts, turn)
        if repetition is not None:
            break
    start, turns = repetition or ((run - 1) * turn, 1)
    forces, end = force_ordinates(law, p, speed), start + turns * turn
    pieces = [
        piece
        for a, b in contacts
        for piece in _contact_pieces(law, forces, speed, max(a, start), min(b, end))
    ]
    landings = _landings(trajectory.events, start, end)
    return SteadyForce(speed, turns, tuple(pieces), landings, repetition is not None)


def _find_repetition(contacts: list[tuple[float, float]], turn: float) -> tuple[float, int] | None:
    """Return a time (s) in contact, and the number of turns after which it repeats.

    A contact repeats if the follower is in contact at the same cam angle after this number of
    turns. ``contacts`` are start and end times (s), ``turn`` is the duration of a turn (s). Returns
    None if no contact repeats.
    """
    for turns in range(1, MAX_PERIOD_TURNS + 1):
        later = turns * turn
        for a, b in contacts:
            for c, d in contacts:
                low, high = max(a + later, c), min(b + later, d)
                if high - low > OVERLAP * turn:
                    return 0.5 * (low + high) - later, turns
    return None


def _contact_pieces(
    law: Law, forces: FloatArray, speed: float, start: float, end: float
) -> Iterator[ForcePiece]:
    """Yield the polynomial pieces of the contact force from `start` to `end` (s).

    `forces` are the Bernstein ordinates of the force in N on the n pieces of the law, shape (p + 1,
    n).
    """
    if end <= start:
        return
    for turn in range(math.floor(speed * start / TURN), math.floor(speed * end / TURN) + 1):
        for i, (low, span) in enumerate(zip(law.breaks[:-1], law.spans, strict=True)):
            first, length = (turn * TURN + float(low)) / speed, float(span) / speed
            a, b = max(start, first), min(end, first + length)
            if b > a:
                u = (a - first) / length, min(1.0, (b - first) / length)
                yield ForcePiece(a, b - a, _restricted(forces[:, i], *u))


def _restricted(ordinates: FloatArray, start: float, end: float) -> FloatArray:
    """Return a polynomial on a part of its interval [0, 1], by Bernstein ordinates.

    ``ordinates`` are those on [0, 1]. The results are those on ``start`` to ``end``.
    """
    is_complete = start == 0.0 and end == 1.0
    return ordinates if is_complete else bernstein.restrict(ordinates, start, end)


def _landings(events: list[Event], start: float, end: float) -> tuple[tuple[float, float], ...]:
    """Return time (s) and impulse (N·s) of each landing from `start` to `end` (s)."""
    inside = (event for event in events if start < event.time <= end)
    return tuple((event.time, event.impulse) for event in inside if event.kind == "landing")


def _elastic_stem(law: Law, p: FollowerParameters, speed: float) -> SteadyForce:
    """Return the steady force of a mass on an elastic stem that keeps contact."""
    model, outputs = elastic_stem.response(law, p, speed), elastic_stem.outputs(p)
    runs = _linear_pieces(model, outputs, model.periodic(), 0.0, 0.0, TURN / speed)
    return SteadyForce(speed, 1, tuple(runs))


def _linear_pieces(
    model: LinearResponse,
    outputs: Outputs,
    start: FloatArray,
    angle: float,
    begin: float,
    duration: float,
) -> Iterator[ForcePiece]:
    """Yield the pieces of the contact force of a linear model while contact is kept.

    The motion starts from the state `start` at the cam angle `angle` (rad) and lasts `duration`
    (s). `begin` is the time of the start in s since θ = 0. The contact force is the last of
    `outputs`.
    """
    for run in model.walk(start, angle, duration):
        length = run.end - run.begin
        if length <= 0.0:
            continue
        ordinates = polynomial_part(model, run.part, outputs)[-1]
        first, last = run.local / run.part.length, (run.local + length) / run.part.length
        vibration = FreeForce(model.matrix, outputs.state[-1], run.free)
        inside = _restricted(ordinates, first, 1.0 if last > 1.0 - 1e-15 else last)
        yield ForcePiece(begin + run.begin, length, inside, vibration)


def _two_mass(law: Law, p: TwoMassParameters, speed: float) -> SteadyForce:
    """Return the steady force of two masses and a stem, with flights if it lifts off."""
    model, turn = contact_response(law, p, speed), TURN / speed
    start = model.turn.fixed_point()
    can_stay = start is not None and not law.velocity_jumps
    if start is not None and can_stay and first_lift_off(law, p, speed, start, turn) is None:
        contact = tuple(_linear_pieces(model, force_output(p), start, 0.0, 0.0, turn))
        return SteadyForce(speed, 1, contact)
    for run in SPECTRUM_TURNS:
        trajectory = Separation(law, p, speed)
        trajectory.run_from(
            (run + MAX_PERIOD_TURNS) * turn, np.zeros(2) if start is None else start
        )
        turns = _period(trajectory, run, turn)
        if turns is not None:
            break
    end = (run + MAX_PERIOD_TURNS - 1) * turn
    period_start = end - (turns or 1) * turn
    pieces = tuple(_phase_pieces(trajectory, model, period_start, end))
    landings = _landings(trajectory.events, period_start, end)
    return SteadyForce(speed, turns or 1, pieces, landings, turns is not None)


def _period(trajectory: Separation, run: int, turn: float) -> int | None:
    """Return the number of turns after which the states at θ = 0 repeat, or None.

    The states at the turns from number `run` on are compared. ``turn`` is the duration of a turn
    (s).
    """
    period_states = states(trajectory, turn * np.arange(run - 1.0, run + MAX_PERIOD_TURNS))[:4]
    lift, slope, _ = trajectory.law.bounds
    scale = np.array([lift, trajectory.speed * slope] * 2)[:, None]
    distance = (np.abs(period_states[:, -1:] - period_states[:, -2::-1]) / scale).max(axis=0)
    repeated = np.flatnonzero(distance < STATE_RTOL)
    return int(repeated[0]) + 1 if repeated.size else None


def _phase_pieces(
    trajectory: Separation, model: LinearResponse, period_start: float, end: float
) -> Iterator[ForcePiece]:
    """Yield the force of two masses in all contacts from `period_start` to `end` (s).

    It is yielded in pieces with a closed form. ``trajectory`` contains the contacts and flights,
    and ``model`` the linear model in contact.
    """
    for phase in trajectory.phases:
        a, b = max(phase.begin, period_start), min(phase.end, end)
        if phase.flight is not None or b <= a:
            continue
        start = phase.vibration
        if a > phase.begin:
            start = model.end(start, trajectory.speed * phase.begin, a - phase.begin)
        outputs = force_output(trajectory.parameters)
        yield from _linear_pieces(model, outputs, start, trajectory.speed * a, a, b - a)


#: Functions that compute the steady force, by the name of the follower's model in a scene.
BUILDERS: dict[str, Callable[[Law, Any, float], SteadyForce]] = {
    "kinetostatic": _kinetostatic,
    "one_mass": _one_mass,
    "elastic_stem": _elastic_stem,
    "two_mass": _two_mass,
}
