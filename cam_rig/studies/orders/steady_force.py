"""The contact force of a steady state, piece by piece: polynomials, vibrations and landings."""

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

#: Fraction of a turn that the contacts of two turns must share to count as overlapping.
OVERLAP = 1e-9


@dataclass(frozen=True, eq=False)
class FreeForce:
    """A force c e^{At} z: ``matrix`` A ``(2, 2)``, ``row`` c and ``start`` z ``(2,)``."""

    matrix: FloatArray
    row: FloatArray
    start: FloatArray


@dataclass(frozen=True, eq=False)
class ForcePiece:
    """A stretch of contact, in s since θ = 0: its polynomial (N), and the vibration on it."""

    begin: float
    length: float
    ordinates: FloatArray
    free: FreeForce | None = None

    def at(self, times: FloatArray) -> FloatArray:
        """The force (N) at times in s within the piece."""
        since = times - self.begin
        force = bernstein.evaluate(self.ordinates, since / self.length)
        if self.free is not None:
            v = self.free
            force = force + v.row @ free_motion(v.matrix, v.start, since)
        return np.asarray(force)


@dataclass(frozen=True, eq=False)
class SteadyForce:
    """The contact force over ``turns`` turns, after which it comes back to itself.

    ``turns`` are more than 1 for a follower that lands otherwise in every turn of so many. Between
    the ``pieces`` it flies and the force is zero; ``landings`` are (time in s since θ = 0, impulse
    in N·s). Not ``settled``, it is the last turn that was run. ``speed`` in rad/s.
    """

    speed: float
    turns: int
    pieces: tuple[ForcePiece, ...]
    landings: tuple[tuple[float, float], ...] = ()
    settled: bool = True

    @property
    def natural_frequency(self) -> float | None:
        """Of the stem in contact, Hz; None where the model's stem is rigid."""
        free = next((piece.free for piece in self.pieces if piece.free is not None), None)
        return None if free is None else math.sqrt(float(np.linalg.det(free.matrix))) / TURN

    @property
    def duration(self) -> float:
        """Of all its turns, s."""
        return self.turns * TURN / self.speed

    def at(self, times: FloatArray) -> FloatArray:
        """The force (N) without the landings, at any times in s since θ = 0, ``(n,)``."""
        first = self.pieces[0].begin if self.pieces else 0.0
        inside = first + np.mod(times - first, self.duration)
        force = np.zeros(times.size)
        for piece in self.pieces:
            here = (inside >= piece.begin) & (inside < piece.begin + piece.length)
            force[here] = piece.at(inside[here])
        return force


def steady_force(law: Law, model: str, rig: RigConfig, speed: float) -> SteadyForce:
    """The steady contact force of a model at a speed (rad/s)."""
    if model not in BUILDERS:
        raise ConfigError(
            f"model {model}: its force is no closed form of the cam angle; allowed for orders: "
            f"{', '.join(BUILDERS)}"
        )
    if model == "one_mass" and rig.follower.restitution is None:
        # without a landing the force does not depend on the restitution
        rigid = FollowerParameters.from_rig(rig)
        if not law.velocity_jumps and force_extremes(law, rigid, speed)[0] > 0.0:
            return _kinetostatic(law, rigid, speed)
    return BUILDERS[model](law, MODELS[model].parameters(rig), speed)


def _kinetostatic(law: Law, p: FollowerParameters, speed: float) -> SteadyForce:
    require_smooth(law)
    forces = force_ordinates(law, p, speed)
    return SteadyForce(speed, 1, tuple(_contact_pieces(law, forces, speed, 0.0, TURN / speed)))


def _one_mass(law: Law, p: FollowerParameters, speed: float) -> SteadyForce:
    """On the cam it has forgotten what was: two contacts at one angle are the same motion."""
    turn, found = TURN / speed, None
    for run in SPECTRUM_TURNS:
        course = OneMassTrajectory(law, p, Interval(0, math.ceil(run * turn * NS) + 1, 0.0, speed))
        course.run(None)
        contacts = [(x.begin, x.end) for x in course.phases if x.flight is None]
        found = _repeated(contacts, turn)
        if found is not None:
            break
    begin, turns = found or ((run - 1) * turn, 1)
    forces, end = force_ordinates(law, p, speed), begin + turns * turn
    pieces = [
        piece
        for a, b in contacts
        for piece in _contact_pieces(law, forces, speed, max(a, begin), min(b, end))
    ]
    landings = _landings(course.events, begin, end)
    return SteadyForce(speed, turns, tuple(pieces), landings, found is not None)


def _repeated(contacts: list[tuple[float, float]], turn: float) -> tuple[float, int] | None:
    """A time (s) and after how many turns the follower is on the cam again; None if it is not."""
    for turns in range(1, MAX_PERIOD_TURNS + 1):
        later = turns * turn
        for a, b in contacts:
            for c, d in contacts:
                low, high = max(a + later, c), min(b + later, d)
                if high - low > OVERLAP * turn:
                    return 0.5 * (low + high) - later, turns
    return None


def _contact_pieces(
    law: Law, forces: FloatArray, speed: float, begin: float, end: float
) -> Iterator[ForcePiece]:
    """The law's pieces from ``begin`` to ``end`` s, with force ordinates ``(p + 1, n)`` in N."""
    if end <= begin:
        return
    for whole in range(math.floor(speed * begin / TURN), math.floor(speed * end / TURN) + 1):
        for i, (low, span) in enumerate(zip(law.breaks[:-1], law.spans, strict=True)):
            first, length = (whole * TURN + float(low)) / speed, float(span) / speed
            a, b = max(begin, first), min(end, first + length)
            if b > a:
                u = (a - first) / length, min(1.0, (b - first) / length)
                yield ForcePiece(a, b - a, _restricted(forces[:, i], *u))


def _restricted(ordinates: FloatArray, begin: float, end: float) -> FloatArray:
    whole = begin == 0.0 and end == 1.0
    return ordinates if whole else bernstein.restrict(ordinates, begin, end)


def _landings(events: list[Event], begin: float, end: float) -> tuple[tuple[float, float], ...]:
    inside = (event for event in events if begin < event.time <= end)
    return tuple((event.time, event.impulse) for event in inside if event.kind == "landing")


def _elastic_stem(law: Law, p: FollowerParameters, speed: float) -> SteadyForce:
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
    """The last output of a linear model from a state at an angle (rad), ``begin`` s after θ = 0."""
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
    model, turn = contact_response(law, p, speed), TURN / speed
    start = model.turn.fixed_point()
    stays = start is not None and not law.velocity_jumps
    if start is not None and stays and first_lift_off(law, p, speed, start, turn) is None:
        contact = tuple(_linear_pieces(model, force_output(p), start, 0.0, 0.0, turn))
        return SteadyForce(speed, 1, contact)
    for run in SPECTRUM_TURNS:
        course = Separation(law, p, speed)
        course.run_from((run + MAX_PERIOD_TURNS) * turn, np.zeros(2) if start is None else start)
        turns = _period(course, run, turn)
        if turns is not None:
            break
    end = (run + MAX_PERIOD_TURNS - 1) * turn
    begin = end - (turns or 1) * turn
    pieces = tuple(_phase_pieces(course, model, begin, end))
    landings = _landings(course.events, begin, end)
    return SteadyForce(speed, turns or 1, pieces, landings, turns is not None)


def _period(course: Separation, run: int, turn: float) -> int | None:
    """After how many turns the states at θ = 0 come back; None if they do not."""
    found = states(course, turn * np.arange(run - 1.0, run + MAX_PERIOD_TURNS))[:4]
    lift, slope, _ = course.law.bounds
    scale = np.array([lift, course.speed * slope] * 2)[:, None]
    away = (np.abs(found[:, -1:] - found[:, -2::-1]) / scale).max(axis=0)
    same = np.flatnonzero(away < STATE_RTOL)
    return int(same[0]) + 1 if same.size else None


def _phase_pieces(
    course: Separation, model: LinearResponse, begin: float, end: float
) -> Iterator[ForcePiece]:
    for phase in course.phases:
        a, b = max(phase.begin, begin), min(phase.end, end)
        if phase.flight is not None or b <= a:
            continue
        start = phase.vibration
        if a > phase.begin:
            start = model.end(start, course.speed * phase.begin, a - phase.begin)
        outputs = force_output(course.parameters)
        yield from _linear_pieces(model, outputs, start, course.speed * a, a, b - a)


#: What finds the steady force, by the model's name in a scene.
BUILDERS: dict[str, Callable[[Law, Any, float], SteadyForce]] = {
    "kinetostatic": _kinetostatic,
    "one_mass": _one_mass,
    "elastic_stem": _elastic_stem,
    "two_mass": _two_mass,
}
