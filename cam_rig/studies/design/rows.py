"""How a design keeps each quantity, or makes it best: rows of a program, or a local search.

Rows are made twice. At points they are necessary, so the program's bound is one for the whole
class; on the ordinates of cut pieces (``hull``) they are sufficient, so the law keeps them at every
angle: (38) of docs/proofs.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import sparse

from cam_rig.dynamics.jump.two_masses import FROM_REST
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
from cam_rig.studies.design.space import SPARE, Asked, DesignProblem, measured
from cam_rig.units import TURN, FloatArray

#: Parts of a piece where only the polygon of the lift itself is asked for.
FEW_PARTS = 2
#: Parts of a piece for a limit over a range of angles.
RANGE_PARTS = 16
#: By this part of itself a lift that is reached within an event may be passed beside that place.
TURNING = 1e-4
#: Orders of the turn that a sound level takes, and what part of it those above are at most.
HARMONICS, LEFT_OUT = 96, 2e-4
#: Phase (rad) of the highest order between two Gauss cells, at most.
CELL_PHASE = 6.0


def force_parts(problem: DesignProblem, speed: float, hull: bool) -> Affine:
    """The contact force of one rigid mass at a speed (rad/s), in parts of the problem's scale."""
    return _force(problem, speed, hull) * (1.0 / problem.force_scale)


def _force(problem: DesignProblem, speed: float, hull: bool) -> Affine:
    weights, space = force_weights(problem.rigid, speed).tolist(), problem.space
    return space.bounds(space.weighted(*weights), hull).plus(problem.rigid.preload)


def keep_lift(program: ConvexProgram, problem: DesignProblem, hull: bool) -> None:
    """Between the start's lowest and highest lift, which is reached where the start reaches it."""
    space, scale = problem.space, 1.0 / problem.start.lift
    low, high = (end.value for end in extremes(problem.start, 0))
    turning = space.turning_points
    spare = SPARE if hull else 0.0
    if turning:  # ordinates stand above a curve that turns
        spare = TURNING
    parts, ordinates = space.parts if turning else FEW_PARTS, space.derivative(0)
    lift = space.hull(ordinates, parts) if hull else space.points(ordinates)
    lift *= scale
    for room in (lift.plus(spare - low * scale), (lift * -1.0).plus(spare + high * scale)):
        program.at_least("lift", room, necessary=not hull)
    for level, angle in turning:
        at = space.at(0, np.array([angle])) * scale
        program.equal("lift", at.plus(-level * scale))


# Rows that are linear in the unknowns: what has to keep the limit.


def _peak(problem: DesignProblem, asked: Asked, hull: bool) -> list[Affine]:
    found = problem.space.bounds(problem.space.derivative(asked.term.quantity.order), hull)
    return [found, found * -1.0]


def _at_angles(problem: DesignProblem, asked: Asked, hull: bool) -> list[Affine]:
    """A derivative at an angle, or over a range of angles."""
    space, term, order = problem.space, asked.term, asked.term.quantity.order
    if term.low == term.high:
        return [space.at(order, np.array([term.low]))]
    if hull:
        return [space.hull_over(order, term.low, term.high, RANGE_PARTS)]
    steps = np.arange(RANGE_PARTS) / RANGE_PARTS
    begin = (space.breaks[:-1, None] + space.spans[:, None] * steps).ravel()
    edges = np.unique(np.concatenate([begin, [term.low, term.high]]))
    return [space.at(order, edges[(edges >= term.low) & (edges <= term.high)])]


def _forces(problem: DesignProblem, asked: Asked, hull: bool) -> list[Affine]:
    return [_force(problem, speed, hull) for speed in sorted({asked.term.low, asked.term.high})]


def _pressure(problem: DesignProblem, asked: Asked, hull: bool) -> list[Affine]:
    """Tan α (d + s) ∓ (s' − e) ≥ 0, given as what is at most α: the limit less the room."""
    element, most = problem.element, asked.value
    assert isinstance(element, GuidedCentre) and most is not None
    space, tangent = problem.space, math.tan(most)
    height = tangent * element.height(np.zeros(1))[0]
    found = []
    for sign in (1.0, -1.0):
        room = space.bounds(space.weighted(tangent, -sign), hull)
        found.append((room.plus(height + sign * element.eccentricity) * -1.0).plus(most))
    return found


def _radius(problem: DesignProblem, _: Asked, hull: bool) -> list[Affine]:
    """R_b + s + s'' under a flat face; of any other follower it is not linear."""
    element, space = problem.element, problem.space
    assert isinstance(element, GuidedFace)
    return [space.bounds(space.weighted(1.0, 0.0, 1.0), hull).plus(element.base_radius)]


# Parts whose squares add to a quantity's own.


def _rms_acceleration(problem: DesignProblem, _: Term) -> Affine:
    """Weighted values of s'' whose squares add to its mean square over the turn, exactly."""
    space = problem.space
    degree = space.degree - 2
    points, weights = np.polynomial.legendre.leggauss(degree + 1)
    table = bernstein.basis(degree, 0.5 * (points + 1.0)) * np.sqrt(0.5 * weights)[:, None]
    blocks = [table * math.sqrt(span / TURN) for span in space.spans]
    found = space.derivative(2).mapped(sparse.csr_array(sparse.block_diag(blocks)))
    return found.rows(np.flatnonzero(np.abs(found.constant) + abs(found.matrix).sum(axis=1)))


def _sound(problem: DesignProblem, term: Term) -> Affine:
    """Weighted harmonics of s'' whose squares add to the mean power of the contact force's rate."""
    # of a follower that stays on the cam; pressure follows its rate through the structure's corner
    rigid = problem.rigid
    corner = TURN * problem.rig.need_radiation(f"the goal or limit {term.key}").corner.si
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
    """Real and imaginary parts of the Fourier coefficients of s'', by Gauss points."""
    space = problem.space
    parts = math.ceil(float(space.spans.max() * order.max()) / CELL_PHASE)
    points, weights = np.polynomial.legendre.leggauss(12)
    u = ((np.arange(parts)[:, None] + 0.5 * (points + 1.0)) / parts).ravel()
    values = space.derivative(2).mapped(space.blocks(bernstein.basis(space.degree - 2, u)))
    angles = (space.breaks[:-1, None] + space.spans[:, None] * u).ravel()
    share = (space.spans[:, None] * np.tile(0.5 * weights / parts, parts)).ravel() / TURN
    turning = np.exp(-1j * order[:, None] * angles) * share
    return values.mapped(sparse.csr_array(np.concatenate([turning.real, turning.imag])))


# What depends on s, s' and s'' at one cam angle, and is not convex: linear near a law.


def _angle(problem: DesignProblem, term: Term) -> Branches:
    """± the pressure angle (rad) on each disc."""
    if isinstance(problem.element, GuidedFace):
        raise ConfigError(
            f"{term.key}: the follower is {problem.cam.follower.type}, whose pressure angle no "
            "law changes; allowed: a roller, a point, or an arm"
        )
    return _on_discs(problem, lambda touch: [touch.pressure, -touch.pressure])


def _curvature(problem: DesignProblem, _: Term) -> Branches:
    """Of the pitch curve (1/m) on each disc; under a face less the radius (m)."""
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
    """A limit's radius (m) as one on the branches."""
    motion = Motion.on_pieces(problem.start, np.zeros(1))
    element = discs(problem.cam.follower, problem.start)[0].element
    has_centre = element.touch(motion).pitch_curvature is not None
    return 1.0 / (radius + element.roller) if has_centre else -radius


# The table: a quantity that stands in none of its columns is searched for by differences.


def _at_start(problem: DesignProblem, term: Term, sense: Sense) -> float:
    value = measured(problem, problem.start, term, sense)
    return rows_of(term).to_rows(problem, term, value)


class Run(NamedTuple):
    """What a jump speed is of: one rigid mass, or two, from rest (s) or in steady state (None)."""

    rigid: bool
    duration: float | None


Converted = Callable[[DesignProblem, Term, float], float]


def _as_it_is(_problem: DesignProblem, _term: Term, value: float) -> float:
    return value


@dataclass(frozen=True)
class Rows:
    """What a design knows of a quantity.

    ``linear`` has to keep the limit, for the limit itself; ``squares`` are parts whose squares add
    to its own; rows ``in_rounds`` are made where a law is seen to need them, as of residual
    vibration; of a jump speed's ``run`` the force is linear; of ``branches``, functions of the
    motion, the greatest counts, and ``on_branches`` is a limit as one on them. Rows hold where it
    is ``convex`` for a problem, of a goal or of a limit; ``scale`` measures them, by default the
    start's own value; ``to_rows`` and ``from_rows`` take a value (SI; dB) there and back.
    """

    linear: Callable[[DesignProblem, Asked, bool], list[Affine]] | None = None
    squares: Callable[[DesignProblem, Term], Affine] | None = None
    in_rounds: bool = False
    run: Run | None = None
    branches: Callable[[DesignProblem, Term], Branches] | None = None
    on_branches: Converted = _as_it_is
    convex: Callable[[DesignProblem, bool], bool] = lambda _problem, _goal: True
    scale: Callable[[DesignProblem, Term, Sense], float] = _at_start
    to_rows: Converted = _as_it_is
    from_rows: Converted = _as_it_is

    def is_local(self, problem: DesignProblem, goal: bool = False) -> bool:
        """Whether a goal or a limit has no rows for the cam's follower, and so no bound."""
        rows = self.linear or self.squares or self.in_rounds or self.run
        return not (rows and self.convex(problem, goal))


def _largest(problem: DesignProblem, term: Term, _: Sense) -> float:
    return abs(peak(problem.start, term.quantity.order).value)


def _lift(problem: DesignProblem, *_: object) -> float:
    return problem.start.lift


_PEAK = Rows(_peak, scale=_largest)
_FORCE = Rows(_forces, scale=lambda problem, *_: problem.force_scale)

ROWS = {
    "jump_speed": Rows(run=Run(False, FROM_REST)),
    "jump_speed_steady": Rows(run=Run(False, None)),
    "jump_speed_rigid": Rows(run=Run(True, None)),
    "residual_vibration": Rows(in_rounds=True),
    "peak_velocity": _PEAK,
    "peak_acceleration": _PEAK,
    "peak_jerk": _PEAK,
    "rms_acceleration": Rows(squares=_rms_acceleration),
    "peak_contact_force_rigid": _FORCE,
    "least_contact_force_rigid": _FORCE,
    "shaft_torque": Rows(branches=lambda problem, term: torques(problem.rigid, term)),
    "sound_level_rigid": Rows(
        squares=_sound,
        to_rows=lambda p, term, level: rate_of(p.rig, term, level),
        from_rows=lambda p, term, rate: level_of(p.rig, term, rate)),
    "pressure_angle": Rows(
        _pressure, branches=_angle, scale=_lift,
        convex=lambda p, goal: not goal and isinstance(p.element, GuidedCentre)),
    "radius_of_curvature": Rows(
        _radius, branches=_curvature, on_branches=_as_curvature, scale=_lift,
        convex=lambda p, _: isinstance(p.element, GuidedFace)),
    "lift": Rows(_at_angles, scale=_lift),
    "velocity": Rows(_at_angles, scale=_largest),
    "acceleration": Rows(_at_angles, scale=_largest),
}  # fmt: skip


def rows_of(term: Term) -> Rows:
    """What is known of a term's quantity; nothing but its value where it is not in the table."""
    return ROWS.get(term.name, Rows())


def asked_of(problem: DesignProblem, term: Term, sense: Sense, value: float | None) -> Asked:
    """A goal or a limit (SI; dB) in the units of its rows, and what they are measured by."""
    rows = rows_of(term)
    if value is not None:
        value = rows.to_rows(problem, term, value)
        if value <= 0.0 and rows.squares is _sound:
            raise ConfigError(f"limit {term.key}: the background alone is as loud")
        if not math.isfinite(value):
            raise ConfigError(f"limit {term.key}: the start has none; allowed: a number")
    scale = 1.0 if rows.run else rows.scale(problem, term, sense)
    if not (math.isfinite(scale) and scale > 0.0):  # a start without that quantity
        scale = 1.0 if value is None else abs(value) or 1.0
    return Asked(term, sense, value, scale)


def add(program: ConvexProgram, problem: DesignProblem, asked: Asked, hull: bool) -> None:
    """Add the rows of one goal or limit."""
    rows = rows_of(asked.term)
    if rows.squares is not None:
        parts, radius = rows.squares(problem, asked.term), 0.0
        if asked.value is not None:  # orders above the highest are left out of a level
            radius = asked.value / asked.scale * (1.0 - (LEFT_OUT if hull else 0.0))
        program.within(asked.name, parts * (1.0 / asked.scale), radius, asked.weight)
        return
    assert rows.linear is not None  # others are no rows of a program
    for quantity in rows.linear(problem, asked, hull):
        room = asked.room(quantity, SPARE if hull else 0.0)
        program.at_least(asked.name, room, asked.weight, not hull)
