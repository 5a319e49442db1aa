"""Inequalities and functions by which a design limits or optimises a quantity.

A quantity is represented by rows (inequalities) of a convex program, or by functions for a local
search. There are two kinds of rows. Rows at single angles are necessary for a limit, so the bound
of their program is valid for the whole class. Rows on the Bernstein ordinates of subdivided pieces
are ``sufficient``: they enforce the limit at every angle, by (38) of docs/proofs.md.
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

#: Number of parts into which each polynomial piece of the law is cut to bound the lift. It applies
#: if the lift has no maximum or minimum between two dwells.
LIFT_PARTS = 2
#: Number of parts into which each polynomial piece of the law is cut for a limit over a range of
#: cam angles.
RANGE_PARTS = 16
#: Relative excess over the start law's lift that the limited Bernstein ordinates may have, if the
#: lift has its maximum between two dwells. The ordinates (control values) lie above the curve
#: there.
TURNING_RTOL = 1e-4
#: Number of harmonics per turn from which a sound level is computed.
HARMONICS = 96
#: Upper bound of the contribution of the omitted higher harmonics to a sound level, relative to it.
LEFT_OUT = 2e-4
#: Largest phase change (rad) of the highest harmonic over an interval of the Gauss integration.
CELL_PHASE = 6.0


def force_parts(problem: DesignProblem, speed: float, sufficient: bool) -> Affine:
    """Return values that bound the contact force of one rigid mass at a speed (rad/s).

    They are functions of the design's unknowns, in units of ``problem.force_scale``. If
    ``sufficient``, values ≥ 0 imply contact at every angle. Otherwise they are the forces at single
    angles.
    """
    return _force(problem, speed, sufficient) * (1.0 / problem.force_scale)


def _force(problem: DesignProblem, speed: float, sufficient: bool) -> Affine:
    weights, space = force_weights(problem.rigid, speed).tolist(), problem.space
    return space.bounds(space.weighted(*weights), sufficient).plus(problem.rigid.preload)


def keep_lift(program: ConvexProgram, problem: DesignProblem, sufficient: bool) -> None:
    """Add the limits on the lift of the law to a program.

    The lift stays within the range of the start law's lift. If that reaches its minimum or maximum
    inside an event, the lift is equal to it at this angle. An event is the motion between two
    dwells.
    """
    space, scale = problem.space, 1.0 / problem.start.lift
    low, high = (end.value for end in extremes(problem.start, 0))
    turning = space.turning_points
    spare = SPARE if sufficient else 0.0
    if turning:  # the Bernstein ordinates lie above the curve there
        spare = TURNING_RTOL
    parts, ordinates = space.parts if turning else LIFT_PARTS, space.derivative(0)
    lift = space.hull(ordinates, parts) if sufficient else space.points(ordinates)
    lift *= scale
    for room in (lift.plus(spare - low * scale), (lift * -1.0).plus(spare + high * scale)):
        program.at_least("lift", room, necessary=not sufficient)
    for level, angle in turning:
        lift_at_angle = space.at(0, np.array([angle])) * scale
        program.equal("lift", lift_at_angle.plus(-level * scale))


# Quantities that are linear in the unknowns of a law. Each function returns their values in SI
# units.


def _peak(problem: DesignProblem, target: ScaledLimit, sufficient: bool) -> list[Affine]:
    rows = problem.space.bounds(problem.space.derivative(target.term.quantity.order), sufficient)
    return [rows, rows * -1.0]


def _at_angles(problem: DesignProblem, target: ScaledLimit, sufficient: bool) -> list[Affine]:
    """Return a derivative of the lift at a cam angle or over a range, as functions.

    The functions depend on the unknowns of the design, and a program limits each of their values.
    The order of the derivative and the range (rad) are those of the term of ``target``, the goal or
    limit. If ``sufficient``, the values bound the derivative over the whole range. Otherwise they
    are its values at single angles.
    """
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
    """Return functions for a limit on the pressure angle of a guided roller or point.

    The angle is at most α, the value of ``target``, if tan α (d + s) ∓ (s' − e) ≥ 0, where d is the
    height of the centre at zero lift and e its eccentricity. The functions are α minus these
    left-hand sides, so they are at most α if the limit is satisfied. If ``sufficient``, this is
    true at every cam angle, otherwise at single angles.
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
    """Return functions that bound the cam's radius of curvature (m) for a flat face.

    The radius is R_b + s + s'', which is linear in the law for a flat face only. If ``sufficient``,
    limits on the values of the functions apply at every cam angle, otherwise at single angles.
    """
    element, space = problem.element, problem.space
    assert isinstance(element, GuidedFace)
    return [space.bounds(space.weighted(1.0, 0.0, 1.0), sufficient).plus(element.base_radius)]


# Quantities whose square is a sum of squares. Each function returns the values to be squared, which
# are linear in the unknowns.


def _rms_acceleration(problem: DesignProblem, _: Term) -> Affine:
    """Return functions of the unknowns whose squares add up to the mean square of s''.

    They are weighted values of s'' at Gauss points, so the sum is exact for polynomials.
    """
    space = problem.space
    degree = space.degree - 2
    points, weights = np.polynomial.legendre.leggauss(degree + 1)
    table = bernstein.basis(degree, 0.5 * (points + 1.0)) * np.sqrt(0.5 * weights)[:, None]
    blocks = [table * math.sqrt(span / TURN) for span in space.spans]
    values = space.derivative(2).mapped(sparse.csr_array(sparse.block_diag(blocks)))
    return values.rows(np.flatnonzero(np.abs(values.constant) + abs(values.matrix).sum(axis=1)))


def _sound(problem: DesignProblem, term: Term) -> Affine:
    """Return functions of the unknowns whose squares add up to the power of a sound.

    They are weighted harmonics of s''. The follower is one rigid mass that stays on the cam. The
    sound pressure is the rate of change of the contact force, low-pass filtered with the corner
    frequency of the structure.
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
    """Return the Fourier coefficients of s'': all real parts, then imaginary parts.

    ``order`` are the orders of the harmonics. The coefficients are integrated with Gauss points.
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


# Quantities that are not convex, as functions of s, s' and s'' at one cam angle. A local search
# linearises them at a law.


def _angle(problem: DesignProblem, term: Term) -> Branches:
    """Return the function that computes ± the pressure angle on each disc.

    The function has the arguments s, s' and s'' at one cam angle, and its results are in rad. The
    largest of them is the absolute pressure angle.
    """
    if isinstance(problem.element, GuidedFace):
        raise ConfigError(
            f"{term.key} requires a roller, a point or an arm, got {problem.cam.follower.type}, "
            "whose pressure angle does not depend on the law"
        )
    return _on_discs(problem, lambda touch: [touch.pressure, -touch.pressure])


def _curvature(problem: DesignProblem, _: Term) -> Branches:
    """Return the function whose maximum over the turn limits the radius of curvature.

    Its results at one cam angle, from s, s' and s'', are the curvature of the pitch curve (1/m) on
    each disc. For a flat face they are minus the radius of curvature (m).
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
    """Convert a limit on the radius of curvature (m) to a limit on `_curvature`.

    The result is a curvature of the pitch curve (1/m), or minus a radius (m) for a flat face.
    """
    motion = Motion.on_pieces(problem.start, np.zeros(1))
    element = discs(problem.cam.follower, problem.start)[0].element
    has_centre = element.touch(motion).pitch_curvature is not None
    return 1.0 / (radius + element.roller) if has_centre else -radius


# Table of the quantities. For a quantity without an entry, a local search uses finite differences.


def _value_of_start(problem: DesignProblem, term: Term, sense: Sense) -> float:
    value = measured(problem, problem.start, term, sense)
    return rows_of(term).to_rows(problem, term, value)


class JumpRun(NamedTuple):
    """Kind of run that a jump speed is defined for.

    ``rigid`` is True for a follower of one rigid mass, and False for two masses. ``duration`` is
    the length of the run from rest in s, or None for the steady state.
    """

    rigid: bool
    duration: float | None


Conversion = Callable[[DesignProblem, Term, float], float]


def _unchanged(_problem: DesignProblem, _term: Term, value: float) -> float:
    return value


@dataclass(frozen=True)
class QuantityRows:
    """Representation of a quantity in a design, as inequalities or functions.

    A goal or limit is convex if it has ``linear``, ``squares``, ``in_rounds`` or ``run``, and
    ``convex`` returns True. Otherwise a local search uses its ``branches``, or finite differences.
    """

    #: Function that returns affine functions of the unknowns, the values of which are limited.
    linear: Callable[[DesignProblem, ScaledLimit, bool], list[Affine]] | None = None
    #: Function that returns affine functions of the unknowns whose squares add up to the square of
    #: the quantity.
    squares: Callable[[DesignProblem, Term], Affine] | None = None
    #: True if inequalities of the quantity are added to a program after each solution that violates
    #: them, as for the residual vibration.
    in_rounds: bool = False
    #: Kind of run for which the jump speed (lowest speed with loss of contact) is defined, None for
    #: other quantities. At a fixed speed, the contact force is linear in the unknowns of a law.
    run: JumpRun | None = None
    #: Function that returns functions of s, s' and s'' at one cam angle (branches). Their maximum
    #: over the turn is the quantity.
    branches: Callable[[DesignProblem, Term], Branches] | None = None
    #: Conversion of a limit (SI) on the quantity to a limit on the maximum of `branches`.
    on_branches: Conversion = _unchanged
    #: Function that returns True if the inequalities of the quantity apply to a problem. Its second
    #: argument is True for a goal and False for a limit.
    convex: Callable[[DesignProblem, bool], bool] = lambda _problem, _goal: True
    #: Function that returns the scale by which inequalities are divided (default: the value of the
    #: start law).
    scale: Callable[[DesignProblem, Term, Sense], float] = _value_of_start
    #: Conversion of a value (SI, levels in dB) to the unit in which the inequalities state it.
    #: `from_rows` is the inverse.
    to_rows: Conversion = _unchanged
    from_rows: Conversion = _unchanged

    def is_local(self, problem: DesignProblem, goal: bool = False) -> bool:
        """Return True if the quantity needs a local search, which gives no bound.

        This is the case if it is not convex for the follower of the problem. ``goal`` is True for a
        goal and False for a limit.
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
    """Return how a design represents a quantity: as inequalities or as functions.

    A term is a quantity with its speeds or angles. The result is empty if the table `ROWS` has no
    entry for the quantity.
    """
    return ROWS.get(term.name, QuantityRows())


def scale_limit(
    problem: DesignProblem, term: Term, sense: Sense, value: float | None
) -> ScaledLimit:
    """Return a goal or limit, prepared for the linear inequalities of the optimisation.

    ``term`` is the quantity with its speeds or angles, and ``sense`` the direction of the limit.
    ``value`` is in SI (levels in dB), or None for a goal. The value of the result is in the unit of
    the quantity that is linear in the law, such as sound power instead of dB. The result also
    contains the scale by which the inequalities are divided, so that their numbers are near 1.
    """
    rows = rows_of(term)
    if value is not None:
        value = rows.to_rows(problem, term, value)
        if value <= 0.0 and rows.squares is _sound:
            raise ConfigError(f"limit {term.key} must be above the level of the background")
        if not math.isfinite(value):
            raise ConfigError(f"limit {term.key}: the start has no such value; use a number")
    scale = 1.0 if rows.run else rows.scale(problem, term, sense)
    # the value of the start law is 0, infinite or NaN
    if not (math.isfinite(scale) and scale > 0.0):
        scale = 1.0 if value is None else abs(value) or 1.0
    return ScaledLimit(term, sense, value, scale)


def add(
    program: ConvexProgram, problem: DesignProblem, target: ScaledLimit, sufficient: bool
) -> None:
    """Add the inequalities of a convex goal or limit to a program.

    ``target`` is the goal or limit. If ``sufficient``, a law that satisfies the inequalities
    satisfies the limit at every angle. Otherwise every law that satisfies the limit satisfies the
    inequalities.
    """
    rows = rows_of(target.term)
    if rows.squares is not None:
        parts, radius = rows.squares(problem, target.term), 0.0
        if target.value is not None:  # a sound level omits the harmonics above the highest
            radius = target.value / target.scale * (1.0 - (LEFT_OUT if sufficient else 0.0))
        program.within(target.name, parts * (1.0 / target.scale), radius, target.weight)
        return
    assert rows.linear is not None  # only convex goals and limits are added
    for quantity in rows.linear(problem, target, sufficient):
        room = target.room(quantity, SPARE if sufficient else 0.0)
        program.at_least(target.name, room, target.weight, not sufficient)
