"""Limits and goals as rows of a program: those that are linear, and mean squares.

Each is made twice. At points it is necessary, so the program's bound is one for the whole class;
on the ordinates of cut pieces (``hull``) it is sufficient, so the law keeps it at every angle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.dynamics.jump.any_follower import AnyFollower, follower_of
from cam_rig.dynamics.kinetostatic import force_weights
from cam_rig.law_design.convex_program import Affine, ConvexProgram, RowBlock
from cam_rig.law_design.modal_amplitude import Mode
from cam_rig.law_design.space import Space
from cam_rig.law_design.terms import ORDERS, PEAKS, Limit, Sense, Term
from cam_rig.laws import Law, bernstein
from cam_rig.profile.contact import Element
from cam_rig.profile.disc import discs
from cam_rig.profile.faces import GuidedCentre, GuidedFace
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.units import TURN, FloatArray

# A design's problem: the space of laws, the rig, the cam's follower, and who is asked what.


@dataclass(frozen=True, eq=False)
class DesignProblem:
    """What rows of a program are made of; ``free`` is what the start's cam has elsewhere."""

    cam: CamConfig
    start: Law
    rig: RigConfig
    space: Space
    free: tuple[str, ...] = ()

    @cached_property
    def rigid(self) -> FollowerParameters:
        """The follower as one rigid mass."""
        return FollowerParameters.from_rig(self.rig)

    @cached_property
    def follower(self) -> AnyFollower:
        """Of two masses where the rig says how they split."""
        return follower_of(self.rig)

    @property
    def two_masses(self) -> bool:
        """Whether it is."""
        return isinstance(self.follower, TwoMassParameters)

    @cached_property
    def mode(self) -> Mode:
        """Of that follower on its stem."""
        self.rig.need("stem_stiffness", "a goal or limit of vibration")
        return Mode.of(self.follower)

    @cached_property
    def force_scale(self) -> float:
        """The force (N) that forces are measured by: preload, or the spring at half the lift."""
        spring = 0.5 * self.rigid.spring_stiffness * self.start.lift
        return self.rigid.preload or spring


#: Limits are kept with so much of their scale to spare: rounding of the solver and of the file.
SPARE = 2e-8

#: Parts of a piece where only the polygon of the lift itself is asked for.
FEW_PARTS = 2

#: By this part of itself a lift that is reached within an event may be passed beside that place.
TURNING = 1e-4

#: Speeds over which the mean power of a range is taken.
SPEEDS = 41

#: Orders of the turn that a sound level takes, and what part of it those above are at most.
HARMONICS, LEFT_OUT = 96, 2e-4

#: Phase (rad) of the highest order between two Gauss cells, at most.
CELL_PHASE = 6.0


@dataclass(frozen=True)
class Asked:
    """A goal (``value`` None) or a limit, with what its rows are measured by (SI)."""

    term: Term
    sense: Sense
    value: float | None
    scale: float

    @property
    def name(self) -> str:
        """As the request says it, for the table of active limits."""
        if self.value is None:
            return f"goal {self.term.key}"
        return Limit(self.term, self.sense, self.value).words

    @property
    def weight(self) -> float:
        """Of the level t in the rows."""
        return -1.0 if self.value is None else 0.0

    def room(self, quantity: Affine, spare: float) -> Affine:
        """Rows that are ≥ 0 where the limit is kept."""
        sign = -1.0 if self.sense == "<=" else 1.0
        rows = quantity * (sign / self.scale)
        return rows if self.value is None else rows.plus(-sign * self.value / self.scale - spare)


def add(program: ConvexProgram, problem: DesignProblem, asked: Asked, hull: bool) -> None:
    """Add the rows of one goal or limit."""
    if asked.term.name in MEAN_SQUARES:
        parts = MEAN_SQUARES[asked.term.name](problem, asked.term)
        radius = np.zeros(1)
        if asked.value is not None:  # orders above the highest are left out of a level
            radius += asked.value / asked.scale * (1.0 - (LEFT_OUT if hull else 0.0))
        none = sparse.csr_array((1, problem.space.unknowns))
        cone = Affine.stacked([Affine(radius, none), parts * (1.0 / asked.scale)])
        weight = np.zeros(cone.constant.size)
        weight[0] = asked.weight
        program.blocks.append(RowBlock(asked.name, cone, weight, "cone", weight.size))
        return
    spare = SPARE if hull else 0.0
    for quantity in _rows(problem, asked, hull):
        rows = asked.room(quantity, spare)
        program.at_least(asked.name, rows, asked.weight, not hull)


def _rows(problem: DesignProblem, asked: Asked, hull: bool) -> list[Affine]:
    term, space = asked.term, problem.space
    cut = space.hull if hull else space.points
    if term.name in PEAKS:
        quantity = cut(space.derivative(PEAKS[term.name]))
        return [quantity, quantity * -1.0]
    if term.name in ORDERS:
        return [_at_angles(problem, term, hull)]
    if term.name.endswith("contact_force_rigid"):
        return [force(problem, speed, hull) for speed in sorted({term.low, term.high})]
    if term.name == "pressure_angle":
        assert asked.value is not None
        return _pressure(problem, asked.value, hull)
    if term.name == "radius_of_curvature":
        element = one_element(problem)
        assert isinstance(element, GuidedFace)  # under any other it is not convex
        radius = cut(space.weighted((1.0, 0.0, 1.0)))
        return [radius.plus(element.base_radius)]
    raise AssertionError(term.name)


def force(problem: DesignProblem, speed: float, hull: bool) -> Affine:
    """The contact force (N) of one rigid mass at a speed (rad/s), in hulls or at points."""
    weights = tuple(force_weights(problem.rigid, speed).tolist())
    cut = problem.space.hull if hull else problem.space.points
    return cut(problem.space.weighted(weights)).plus(problem.rigid.preload)


def keep_lift(program: ConvexProgram, problem: DesignProblem, hull: bool) -> None:
    """Between the start's lowest and highest lift, which is reached where the start reaches it."""
    space = problem.space
    low, high = space.levels
    turning = space.turning_points
    spare = SPARE if hull else 0.0
    if turning:  # ordinates stand above a curve that turns
        spare = TURNING
    parts = space.parts if turning else FEW_PARTS
    lift = space.hull(space.lift, parts) if hull else space.points(space.lift)
    lift = lift * (1.0 / problem.start.lift)
    scale = 1.0 / problem.start.lift
    for room in (lift.plus(spare - low * scale), (lift * -1.0).plus(spare + high * scale)):
        program.at_least("lift", room, necessary=not hull)
    for level, angle in turning:
        at = space.at(0, np.array([angle])) * scale
        program.equal("lift", at.plus(-level * scale))


def _at_angles(problem: DesignProblem, term: Term, hull: bool) -> Affine:
    """A derivative at an angle, or over a range of angles."""
    space, order = problem.space, ORDERS[term.name]
    if term.low == term.high:
        return space.at(order, np.array([term.low]))
    parts = 16
    ordinates = space.derivative(order)
    begin = np.concatenate(
        [a + s * np.arange(parts) / parts for a, s in zip(space.breaks, space.spans, strict=False)]
    )
    end = np.append(begin[1:], TURN)
    count = 1 + space.degree - order
    if hull:
        inside = np.flatnonzero((end > term.low) & (begin < term.high))
        rows = (inside[:, None] * count + np.arange(count)).ravel()
        return space.hull(ordinates, parts).rows(rows)
    edges = np.unique(np.concatenate([begin, [term.low, term.high]]))
    return space.at(order, edges[(edges >= term.low) & (edges <= term.high)])


def one_element(problem: DesignProblem) -> Element | None:
    """The contact of a cam of one disc whose follower has no inclined face."""
    plates = discs(problem.cam.follower, problem.start)
    element = plates[0].element
    inclined = getattr(element, "inclination", 0.0) != 0.0
    return None if len(plates) > 1 or inclined else element


def _pressure(problem: DesignProblem, most: float, hull: bool) -> list[Affine]:
    """Tan α (d + s) ∓ (s' − e) ≥ 0, given as what is at most ``most``: the limit less the room."""
    element = one_element(problem)
    assert isinstance(element, GuidedCentre)
    space, tangent = problem.space, math.tan(most)
    cut = space.hull if hull else space.points
    height = element.height(np.zeros(1))[0]
    found = []
    for sign in (1.0, -1.0):
        room = cut(space.weighted((tangent, -sign))).plus(
            tangent * height + sign * element.eccentricity
        )
        found.append((room * -1.0).plus(most))
    return found


def _rms_acceleration(problem: DesignProblem, _: Term) -> Affine:
    """Weighted values of s'' whose squares add to its mean square over the turn, exactly."""
    space = problem.space
    degree = space.degree - 2
    points, weights = np.polynomial.legendre.leggauss(degree + 1)
    table = bernstein.basis(degree, 0.5 * (points + 1.0)) * np.sqrt(0.5 * weights)[:, None]
    blocks = [table * math.sqrt(span / TURN) for span in space.spans]
    found = space.derivative(2).mapped(sparse.csr_array(sparse.block_diag(blocks, "csr")))
    return found.rows(np.flatnonzero(np.abs(found.constant) + abs(found.matrix).sum(axis=1)))


def _sound(problem: DesignProblem, term: Term) -> Affine:
    """Weighted harmonics of s'' whose squares add to the mean power of the contact force's rate.

    Of a follower that stays on the cam, mean over speeds; pressure follows that rate through the
    structure's corner.
    """
    rigid = problem.rigid
    corner = TURN * problem.rig.need_radiation(f"the goal or limit {term.key}").corner.si
    order = np.arange(1.0, HARMONICS + 1.0)
    power = np.zeros(HARMONICS)
    for speed in np.linspace(term.low, term.high, SPEEDS):
        rate = 1j * order * speed
        force_of = rigid.spring_stiffness + rigid.damping * rate + rigid.mass * rate**2
        radiated = corner * rate / (corner + rate) * force_of / order**2
        power += 2.0 * np.abs(radiated) ** 2 / SPEEDS
    second = fourier(problem, order)
    gain = np.concatenate([np.sqrt(power)] * 2)
    return Affine(second.constant * gain, sparse.csr_array(second.matrix * gain[:, None]))


def fourier(problem: DesignProblem, order: FloatArray) -> Affine:
    """Real and imaginary parts of the Fourier coefficients of s'', by Gauss points."""
    space = problem.space
    parts = math.ceil(float(space.spans.max() * order.max()) / CELL_PHASE)
    points, weights = np.polynomial.legendre.leggauss(12)
    u = ((np.arange(parts)[:, None] + 0.5 * (points + 1.0)) / parts).ravel()
    table = bernstein.basis(space.degree - 2, u)
    values = space.derivative(2).mapped(
        sparse.csr_array(sparse.kron(sparse.eye(space.spans.size), table, "csr"))
    )
    angles = (space.breaks[:-1, None] + space.spans[:, None] * u).ravel()
    share = (space.spans[:, None] * np.tile(0.5 * weights / parts, parts)).ravel() / TURN
    turning = np.exp(-1j * order[:, None] * angles) * share
    matrix = np.concatenate([turning.real, turning.imag])
    return values.mapped(sparse.csr_array(matrix))


MEAN_SQUARES = {"rms_acceleration": _rms_acceleration, "sound_level_rigid": _sound}
