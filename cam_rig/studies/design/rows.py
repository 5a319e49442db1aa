"""Representation of each quantity in a design: rows of a program, or functions.

The rows limit or optimise the quantity, the functions are used by a local search. There are two
kinds of rows. Rows at points are necessary, so the bound of their program is valid for the whole
class. Rows on the ordinates of subdivided pieces (``sufficient``) enforce the limit at every angle,
so the law satisfies it: (38) of docs/proofs.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import sparse

from cam_rig.dynamics.jump.two_masses import REST_DURATION_S
from cam_rig.dynamics.kinetostatic import force_weights
from cam_rig.errors import ConfigError
from cam_rig.laws import bernstein
from cam_rig.laws.law import extremes, peak
from cam_rig.profile.contact import Motion, Touch
from cam_rig.profile.disc import discs
from cam_rig.profile.faces import GuidedCentre, GuidedFace
from cam_rig.quantities.terms import Sense, Term
from cam_rig.quantities.values import SPEEDS, Branches, level_of, rate_of, torques
from cam_rig.studies.design.convex_program import Affine, ConvexProgram
from cam_rig.studies.design.space import SPARE, DesignProblem, ScaledLimit, measured
from cam_rig.units import TURN, FloatArray

#: Number of parts of a piece in the hull of the lift if the lift has no extremes within an event.
LIFT_PARTS = 2
#: Number of parts of a piece for a limit over a range of angles.
RANGE_PARTS = 16
#: Relative excess of a lift that is allowed near an angle within an event at which the lift is
#: reached. The ordinates are above the curve there.
TURNING_RTOL = 1e-4
#: Number of orders of the turn that are included in a sound level.
HARMONICS = 96
#: Upper bound of the relative contribution of the omitted higher orders to a sound level.
LEFT_OUT = 2e-4
#: Largest phase (rad) by which the highest order changes over a Gauss cell.
CELL_PHASE = 6.0


def force_parts(problem: DesignProblem, speed: float, sufficient: bool) -> Affine:
    """Return one rigid mass's contact force at a speed (rad/s), in the force scale."""
    return _force(problem, speed, sufficient) * (1.0 / problem.force_scale)


def _force(problem: DesignProblem, speed: float, sufficient: bool) -> Affine:
    weights, space = force_weights(problem.rigid, speed).tolist(), problem.space
    return space.bounds(space.weighted(*weights), sufficient).plus(problem.rigid.preload)


def keep_lift(program: ConvexProgram, problem: DesignProblem, sufficient: bool) -> None:
    """Add the limits of the lift to a program.

    The lift is within the range of the start's lift, and equal to it at extremes within an event.
    """
    space, scale = problem.space, 1.0 / problem.start.lift
    low, high = (end.value for end in extremes(problem.start, 0))
    turning = space.turning_points
    spare = SPARE if sufficient else 0.0
    if turning:  # ordinates lie above a curve that turns
        spare = TURNING_RTOL
    parts, ordinates = space.parts if turning else LIFT_PARTS, space.derivative(0)
    lift = space.hull(ordinates, parts) if sufficient else space.points(ordinates)
    lift *= scale
    for room in (lift.plus(spare - low * scale), (lift * -1.0).plus(spare + high * scale)):
        program.at_least("lift", room, necessary=not sufficient)
    for level, angle in turning:
        lift_at_angle = space.at(0, np.array([angle])) * scale
        program.equal("lift", lift_at_angle.plus(-level * scale))


# Rows that are linear in the unknowns.


def _peak(problem: DesignProblem, target: ScaledLimit, sufficient: bool) -> list[Affine]:
    rows = problem.space.bounds(problem.space.derivative(target.term.quantity.order), sufficient)
    return [rows, rows * -1.0]


def _at_angles(problem: DesignProblem, target: ScaledLimit, sufficient: bool) -> list[Affine]:
    """Return rows for a derivative of the lift at an angle, or over a range of angles."""
    space, term, order = problem.space, target.term, target.term.quantity.order
    if term.low == term.high:
        return [space.at(order, np.array([term.low]))]
    if sufficient:
        return [space.hull_over(order, term.low, term.high, RANGE_PARTS)]
    steps = np.arange(RANGE_PARTS) / RANGE_PARTS
    starts = (space.breaks[:-1, None] + space.spans[:, None] * steps).ravel()
    edges = np.unique(np.concatenate([starts, [term.low, term.high]]))
    return [space.at(order, edges[(edges >= term.low) & (edges <= term.high)])]


def _forces(problem: DesignProblem, target: ScaledLimit, sufficient: bool) -> list[Affine]:
    speeds = sorted({target.term.low, target.term.high})
    return [_force(problem, speed, sufficient) for speed in speeds]


def _pressure(problem: DesignProblem, target: ScaledLimit, sufficient: bool) -> list[Affine]:
    """Return rows for the pressure angle of a guided roller or point.

    They are at most α if tan α (d + s) ∓ (s' − e) ≥ 0 for the limit α.
    """
    element, max_angle = problem.element, target.value
    assert isinstance(element, GuidedCentre) and max_angle is not None
    space, tangent = problem.space, math.tan(max_angle)
    height = tangent * element.height(np.zeros(1))[0]
    rows = []
    for sign in (1.0, -1.0):
        room = space.bounds(space.weighted(tangent, -sign), sufficient)
        rows.append((room.plus(height + sign * element.eccentricity) * -1.0).plus(max_angle))
    return rows


def _radius(problem: DesignProblem, _: ScaledLimit, sufficient: bool) -> list[Affine]:
    """Return rows for the radius of curvature R_b + s + s'' under a flat face.

    The radius is not linear for other followers.
    """
    element, space = problem.element, problem.space
    assert isinstance(element, GuidedFace)
    return [space.bounds(space.weighted(1.0, 0.0, 1.0), sufficient).plus(element.base_radius)]


# Values whose sum of squares is the square of a quantity.


def _rms_acceleration(problem: DesignProblem, _: Term) -> Affine:
    """Return weighted values of s'' whose squares add up exactly to its mean square."""
    space = problem.space
    degree = space.degree - 2
    points, weights = np.polynomial.legendre.leggauss(degree + 1)
    table = bernstein.basis(degree, 0.5 * (points + 1.0)) * np.sqrt(0.5 * weights)[:, None]
    blocks = [table * math.sqrt(span / TURN) for span in space.spans]
    values = space.derivative(2).mapped(sparse.csr_array(sparse.block_diag(blocks)))
    return values.rows(np.flatnonzero(np.abs(values.constant) + abs(values.matrix).sum(axis=1)))


def _sound(problem: DesignProblem, term: Term) -> Affine:
    """Return weighted harmonics of s'' whose squares add up to the sound's power.

    The follower stays on the cam. The sound pressure is the rate of the force, low-pass filtered by
    the corner frequency of the structure.
    """
    rigid = problem.rigid
    corner = TURN * problem.rig.need_radiation(f"the goal or limit {term.key}").corner_frequency.si
    order = np.arange(1.0, HARMONICS + 1.0)
    power = np.zeros(HARMONICS)
    for speed in np.linspace(term.low, term.high, SPEEDS):
        rate = 1j * order * speed
        force_of = rigid.spring_stiffness + rigid.damping * rate + rigid.mass * rate**2
        radiated = corner * rate / (corner + rate) * force_of / order**2
        power += 2.0 * np.abs(radiated) ** 2 / SPEEDS
    gain = np.concatenate([np.sqrt(power)] * 2)
    return _fourier(problem, order).mapped(sparse.diags_array(gain))


def _fourier(problem: DesignProblem, order: FloatArray) -> Affine:
    """Return real and imaginary parts of the Fourier coefficients of s''.

    ``order`` are the orders of the harmonics. The coefficients are integrated by Gauss points.
    """
    space = problem.space
    parts = math.ceil(float(space.spans.max() * order.max()) / CELL_PHASE)
    points, weights = np.polynomial.legendre.leggauss(12)
    u = ((np.arange(parts)[:, None] + 0.5 * (points + 1.0)) / parts).ravel()
    values = space.derivative(2).mapped(space.blocks(bernstein.basis(space.degree - 2, u)))
    angles = (space.breaks[:-1, None] + space.spans[:, None] * u).ravel()
    share = (space.spans[:, None] * np.tile(0.5 * weights / parts, parts)).ravel() / TURN
    turning = np.exp(-1j * order[:, None] * angles) * share
    return values.mapped(sparse.csr_array(np.concatenate([turning.real, turning.imag])))


# Functions of s, s' and s'' at one cam angle that are not convex. They are linearised near a law.


def _angle(problem: DesignProblem, term: Term) -> Branches:
    """Return the branches of the pressure angle: ± the angle (rad) on each disc."""
    if isinstance(problem.element, GuidedFace):
        raise ConfigError(
            f"{term.key} requires a roller, a point or an arm, got {problem.cam.follower.type}, "
            "whose pressure angle does not depend on the law"
        )
    return _on_discs(problem, lambda touch: [touch.pressure, -touch.pressure])


def _curvature(problem: DesignProblem, _: Term) -> Branches:
    """Return the branches of the radius of curvature.

    They are the curvature of the pitch curve (1/m) on each disc. Under a face they are minus the
    radius of curvature (m).
    """
    return _on_discs(
        problem,
        lambda touch: [-touch.radius if touch.pitch_curvature is None else touch.pitch_curvature],
    )


def _on_discs(problem: DesignProblem, quantity: Callable[[Touch], list[FloatArray]]) -> Branches:
    elements = [plate.element for plate in discs(problem.cam.follower, problem.start)]

    def branches(motion: Motion) -> FloatArray:
        return np.array([row for element in elements for row in quantity(element.touch(motion))])

    return branches


def _as_curvature(problem: DesignProblem, _: Term, radius: float) -> float:
    """Convert a limit of the radius of curvature (m) to a limit of its branches."""
    motion = Motion.on_pieces(problem.start, np.zeros(1))
    element = discs(problem.cam.follower, problem.start)[0].element
    has_centre = element.touch(motion).pitch_curvature is not None
    return 1.0 / (radius + element.roller) if has_centre else -radius


# Table of the quantities. A quantity without an entry is searched for by differences.


def _value_of_start(problem: DesignProblem, term: Term, sense: Sense) -> float:
    value = measured(problem, problem.start, term, sense)
    return rows_of(term).to_rows(problem, term, value)


class JumpRun(NamedTuple):
    """Run to which a jump speed belongs: number of masses, and duration from rest.

    ``rigid`` is True for one mass. ``duration`` is in s, None for the steady state.
    """

    rigid: bool
    duration: float | None


Conversion = Callable[[DesignProblem, Term, float], float]


def _unchanged(_problem: DesignProblem, _term: Term, value: float) -> float:
    return value


@dataclass(frozen=True)
class QuantityRows:
    """Representation of a quantity in a design.

    A goal or limit is convex if it has ``linear``, ``squares``, ``in_rounds`` or ``run`` and
    ``convex`` is True. Otherwise it is searched for locally, by ``branches`` or by differences.
    """

    #: Linear rows of a goal or limit.
    linear: Callable[[DesignProblem, ScaledLimit, bool], list[Affine]] | None = None
    #: Values whose squares add to the square of the quantity.
    squares: Callable[[DesignProblem, Term], Affine] | None = None
    #: True if rows are added in rounds, such as those of the residual vibration.
    in_rounds: bool = False
    #: Run of a jump speed, whose contact force is linear.
    run: JumpRun | None = None
    #: Functions of the motion whose maximum is the quantity.
    branches: Callable[[DesignProblem, Term], Branches] | None = None
    #: Conversion of a limit (SI) to a limit on the branches.
    on_branches: Conversion = _unchanged
    #: Function that returns True if the rows apply to a problem, as a goal (True) or limit.
    convex: Callable[[DesignProblem, bool], bool] = lambda _problem, _goal: True
    #: Scale of the rows, by default the value of the start.
    scale: Callable[[DesignProblem, Term, Sense], float] = _value_of_start
    #: Conversion of a value (SI, dB) to the unit of the rows. `from_rows` is the inverse
    #: conversion.
    to_rows: Conversion = _unchanged
    from_rows: Conversion = _unchanged

    def is_local(self, problem: DesignProblem, goal: bool = False) -> bool:
        """Return True if a goal or limit must be searched for locally, without a bound.

        It then has no rows for this follower.
        """
        rows = self.linear or self.squares or self.in_rounds or self.run
        return not (rows and self.convex(problem, goal))


def _peak_of_start(problem: DesignProblem, term: Term, _: Sense) -> float:
    return abs(peak(problem.start, term.quantity.order).value)


def _lift_of_start(problem: DesignProblem, *_: object) -> float:
    return problem.start.lift


_PEAK = QuantityRows(_peak, scale=_peak_of_start)
_FORCE = QuantityRows(_forces, scale=lambda problem, *_: problem.force_scale)

ROWS = {
    "jump_speed": QuantityRows(run=JumpRun(False, REST_DURATION_S)),
    "jump_speed_steady": QuantityRows(run=JumpRun(False, None)),
    "jump_speed_rigid": QuantityRows(run=JumpRun(True, None)),
    "residual_vibration": QuantityRows(in_rounds=True),
    "peak_velocity": _PEAK,
    "peak_acceleration": _PEAK,
    "peak_jerk": _PEAK,
    "rms_acceleration": QuantityRows(squares=_rms_acceleration),
    "peak_contact_force_rigid": _FORCE,
    "least_contact_force_rigid": _FORCE,
    "shaft_torque": QuantityRows(branches=lambda problem, term: torques(problem.rigid, term)),
    "sound_level_rigid": QuantityRows(
        squares=_sound,
        to_rows=lambda p, term, level: rate_of(p.rig, term, level),
        from_rows=lambda p, term, rate: level_of(p.rig, term, rate)),
    "pressure_angle": QuantityRows(
        _pressure, branches=_angle, scale=_lift_of_start,
        convex=lambda p, goal: not goal and isinstance(p.element, GuidedCentre)),
    "radius_of_curvature": QuantityRows(
        _radius, branches=_curvature, on_branches=_as_curvature, scale=_lift_of_start,
        convex=lambda p, _: isinstance(p.element, GuidedFace)),
    "lift": QuantityRows(_at_angles, scale=_lift_of_start),
    "velocity": QuantityRows(_at_angles, scale=_peak_of_start),
    "acceleration": QuantityRows(_at_angles, scale=_peak_of_start),
}  # fmt: skip


def rows_of(term: Term) -> QuantityRows:
    """Return the representation of a term's quantity, empty if the table has no entry."""
    return ROWS.get(term.name, QuantityRows())


def scale_limit(
    problem: DesignProblem, term: Term, sense: Sense, value: float | None
) -> ScaledLimit:
    """Convert the value of a goal or limit (SI, dB) to the unit of its rows.

    The result contains the scale of the rows. ``value`` is None for a goal.
    """
    rows = rows_of(term)
    if value is not None:
        value = rows.to_rows(problem, term, value)
        if value <= 0.0 and rows.squares is _sound:
            raise ConfigError(f"limit {term.key} must be above the level of the background")
        if not math.isfinite(value):
            raise ConfigError(f"limit {term.key}: the start has no such value; use a number")
    scale = 1.0 if rows.run else rows.scale(problem, term, sense)
    if not (math.isfinite(scale) and scale > 0.0):  # the start's value cannot be a scale
        scale = 1.0 if value is None else abs(value) or 1.0
    return ScaledLimit(term, sense, value, scale)


def add(
    program: ConvexProgram, problem: DesignProblem, target: ScaledLimit, sufficient: bool
) -> None:
    """Add the rows of a goal or limit to a program.

    The rows are ``sufficient`` for a law to satisfy a limit, or else necessary.
    """
    rows = rows_of(target.term)
    if rows.squares is not None:
        parts, radius = rows.squares(problem, target.term), 0.0
        if target.value is not None:  # a level omits the orders above the highest
            radius = target.value / target.scale * (1.0 - (LEFT_OUT if sufficient else 0.0))
        program.within(target.name, parts * (1.0 / target.scale), radius, target.weight)
        return
    assert rows.linear is not None  # other quantities have no rows in a program
    for quantity in rows.linear(problem, target, sufficient):
        room = target.room(quantity, SPARE if sufficient else 0.0)
        program.at_least(target.name, room, target.weight, not sufficient)
