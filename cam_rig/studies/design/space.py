"""Laws of a class: B-splines in each event of a start law, with its dwells.

Every law of the class is s₀ + Σ xⱼ bⱼ. Its derivatives, and all quantities that are linear in them,
have the same form. `Space` gives their Bernstein ordinates as functions of the unknowns. The
unknowns are the ordinates of each event, in lifts, and the ordinates of its s'' in addition,
because accelerations computed from the former would lose most digits by cancellation. `Space.link`
is the condition that both belong to one law.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from scipy import sparse
from scipy.interpolate import BSpline

from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.dynamics.jump.any_follower import follower_of
from cam_rig.errors import ConfigError
from cam_rig.laws import Law, bernstein
from cam_rig.laws.law import extremes
from cam_rig.laws.spline import bezier_pieces
from cam_rig.profile.contact import Element
from cam_rig.profile.disc import discs
from cam_rig.quantities.terms import Limit, Sense, Term, sign_of
from cam_rig.quantities.values import Subject, VibrationMode, mode_of
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.studies.design.convex_program import Affine
from cam_rig.studies.design.request import LawClass
from cam_rig.units import TURN, FloatArray

#: Largest difference of the ordinates of a dwell, as a fraction of the lift.
FLAT_RTOL = 1e-12
#: Largest relative difference between a derivative at the end and at the start of a turn.
CLOSURE_RTOL = 1e-9


@dataclass(frozen=True)
class LawEvent:
    """Event of the turn whose law is designed: start and span, rad.

    ``first`` and ``last`` are s and its derivatives at both ends, which are kept.
    """

    start: float
    span: float
    first: tuple[float, ...]
    last: tuple[float, ...]


def dwells(law: Law) -> list[tuple[float, float]]:
    """Return start and end (rad) of each dwell of a law.

    Flat pieces that meet at one level are one dwell.
    """
    flat = np.ptp(law.ordinates, axis=0) <= FLAT_RTOL * law.lift
    result: list[tuple[float, float]] = []
    for i in np.flatnonzero(flat):
        start, end = float(law.breaks[i]), float(law.breaks[i + 1])
        if result and result[-1][1] == start:
            start = result.pop()[0]
        result.append((start, end))
    return result


def events(law: Law, joints: int) -> list[LawEvent]:
    """Return the events between the dwells of a law.

    Their first and last derivatives are those of the neighbouring pieces.
    """

    def ends(piece: int, row: int) -> tuple[float, ...]:
        piece %= law.spans.size
        return tuple(float(law.derivative_ordinates(k)[row, piece]) for k in range(joints + 1))

    edges = [0.0, *(angle for dwell in dwells(law) for angle in dwell), TURN]
    result = []
    for start, end in zip(edges[::2], edges[1::2], strict=True):
        if end > start:
            first, next_piece = np.searchsorted(law.breaks, [start, end]).tolist()
            result.append(LawEvent(start, end - start, ends(first - 1, -1), ends(next_piece, 0)))
    if not result:
        raise ConfigError(
            f"cam {law.name!r} must have a lift, got one that rests for the whole turn"
        )
    if len(edges) == 2:
        _require_joined(law, joints)
    return result


def _require_joined(law: Law, joints: int) -> None:
    """Raise a `ConfigError` if a turn without dwells has a step in a kept derivative."""
    for order in range(joints + 1):
        ordinates = law.derivative_ordinates(order)
        if abs(ordinates[0, 0] - ordinates[-1, -1]) > CLOSURE_RTOL * np.abs(ordinates).max():
            raise ConfigError(
                f"cam {law.name!r} has no dwell, and its derivative {order} has a step between "
                f"two turns; use joints up to C{order - 1}"
            )


@lru_cache(maxsize=16)
def _to_bezier(law_class: LawClass, order: int = 0) -> Any:
    """Return the matrix from ordinates over an event to those of its Bézier pieces.

    The ordinates are those of a derivative of the law of the given order.
    """
    knots, degree = law_class.knots, law_class.power - order
    knots = knots[order : knots.size - order]
    _, columns = bezier_pieces(BSpline(knots, np.eye(knots.size - degree - 1), degree))
    return sparse.csr_array(np.concatenate(columns))


@lru_cache(maxsize=8)
def _second_derivative(law_class: LawClass) -> Any:
    """Return the matrix from ordinates over one event of unit length to those of s''."""
    knots, degree = law_class.knots, law_class.power
    matrix = np.eye(law_class.count)
    for _ in range(2):
        differences = (knots[degree + 1 : -1] - knots[1 : -degree - 1]) / degree
        matrix = np.diff(matrix, axis=0) / differences[:, None]
        knots, degree = knots[1:-1], degree - 1
    return sparse.csr_array(matrix)


#: Smallest number of parts per piece in the hull of a polynomial.
MIN_PARTS = 24
#: Largest number of parts per piece that follows from `PARTS_PER_PIECE`.
MAX_PARTS = 48
#: Smallest number of parts per turn in the hull of a polynomial.
PARTS_PER_TURN = 256
#: Number of parts of each piece, per piece of its event: laws with more pieces are closer to their
#: limits.
PARTS_PER_PIECE = 1.5


@dataclass(eq=False)
class Space:
    """Class of laws with the dwells and the ends of events of a start law.

    The ``unknowns`` are the ``free`` ordinates of each event in order, in lifts, then all ordinates
    of each event's s''. Pieces have joints at ``breaks`` ``(n + 1,)`` and ``spans`` ``(n,)``, rad.
    """

    start: Law
    law_class: LawClass

    def __post_init__(self) -> None:
        law_class = self.law_class
        self.events, self.degree = events(self.start, law_class.joints), law_class.power
        self.free = law_class.free * len(self.events)
        self.unknowns = self._offset(len(self.events))
        inner = np.arange(law_class.pieces) / law_class.pieces
        joints = [np.append(x.start + x.span * inner, x.start + x.span) for x in self.events]
        self.breaks = np.unique(np.concatenate([[0.0], *joints, [TURN]]))
        self.spans = np.diff(self.breaks)

    def _offset(self, index: int) -> int:
        """Return the index of the first ordinate of an event's s'' among the unknowns."""
        return self.free + (self.law_class.count - 2) * index

    @cached_property
    def link(self) -> Affine:
        """Condition that the ordinates of s and of s'' belong to one law: values of zero."""
        rows = []
        for index in range(len(self.events)):
            from_lift = self.coefficients(index).mapped(_second_derivative(self.law_class))
            rows.append((from_lift * (1.0 / self.start.lift)) + self._curvature(index) * -1.0)
        return Affine.stacked(rows)

    def _curvature(self, index: int) -> Affine:
        """Return the ordinates of s'' of one event, in lifts over its squared span."""
        count = self.law_class.count - 2
        matrix = sparse.eye_array(count, self.unknowns, k=self._offset(index), format="csr")
        return Affine(np.zeros(count), matrix)

    @property
    def turning_points(self) -> list[tuple[float, float]]:
        """Extreme lifts (m) of the start law within events, and their angles (rad).

        Extremes at an end of an event are left out.
        """
        ends = {level for event in self.events for level in (event.first[0], event.last[0])}
        tolerance = FLAT_RTOL * self.start.lift
        return [
            (extreme.value, extreme.angle)
            for extreme in extremes(self.start, 0)
            if all(abs(extreme.value - level) > tolerance for level in ends)
        ]

    def coefficients(self, index: int) -> Affine:
        """Return the ordinates (m) of one event, free and fixed, ``(count,)``."""
        event, law_class = self.events[index], self.law_class
        fixed = law_class.joints + 1
        constant = np.zeros(law_class.count)
        constant[:fixed] = self._end_ordinates(event, event.first, 0)
        constant[law_class.count - fixed :] = self._end_ordinates(event, event.last, -1)[::-1]
        rows = np.arange(fixed, law_class.count - fixed)
        columns = np.arange(law_class.free) + law_class.free * index
        scale = np.full(law_class.free, self.start.lift)
        shape = (law_class.count, self.unknowns)
        return Affine(constant, sparse.csr_array((scale, (rows, columns)), shape=shape))

    def _end_ordinates(
        self, event: LawEvent, derivatives: tuple[float, ...], end: int
    ) -> FloatArray:
        """Return the ordinates (m) at one end of an event, from the end inwards.

        ``derivatives`` are s and its derivatives at this end. ``end`` is 0 for the start, −1 for
        the end.
        """
        law_class = self.law_class
        if not any(derivatives[1:]):
            return np.full(law_class.joints + 1, derivatives[0])  # at rest, to the last digit
        table = _to_bezier(law_class)[: law_class.power + 1, : law_class.joints + 1].toarray()
        span = event.span / law_class.pieces * (1.0 if end == 0 else -1.0)
        matrix = np.empty((law_class.joints + 1, law_class.joints + 1))
        rows, scale = table, 1.0
        for order in range(law_class.joints + 1):
            matrix[order] = rows[0] * scale
            rows, scale = bernstein.derivative(rows), scale / span
        return np.asarray(np.linalg.solve(matrix, np.array(derivatives)))

    def _all_ordinates(self, order: int) -> Affine:
        """Return the ordinates of s or of s'' of every piece, including dwells."""
        parts: list[Affine] = []
        position = 0
        for index, event in enumerate(self.events):
            first = int(np.searchsorted(self.breaks, event.start))
            parts += [self._dwell(order, angle) for angle in self.breaks[position:first].tolist()]
            if order == 0:
                ordinates = self.coefficients(index)
            else:
                ordinates = self._curvature(index) * (self.start.lift / event.span**2)
            parts.append(ordinates.mapped(_to_bezier(self.law_class, order)))
            position = first + self.law_class.pieces
        parts += [self._dwell(order, angle) for angle in self.breaks[position:-1].tolist()]
        return Affine.stacked(parts)

    def _dwell(self, order: int, angle: float) -> Affine:
        level = self.start.at(angle)[0] if order == 0 else 0.0
        count = self.degree + 1 - order
        return Affine(np.full(count, level), sparse.csr_array((count, self.unknowns)))

    @lru_cache(maxsize=16)  # noqa: B019 - a space lives as long as its design
    def derivative(self, order: int) -> Affine:
        """Return the ordinates of the derivative dᵏs/dθᵏ (m/radᵏ) of every piece.

        Their degree is p − k, and their shape ``(n (p + 1 − k),)``.
        """
        if order in (0, 2):
            return self._all_ordinates(order)
        below, degree = self.derivative(order - 1), self.degree - order + 1
        step = bernstein.derivative(np.eye(degree + 1))
        blocks = sparse.csr_array(sparse.block_diag([step / span for span in self.spans]))
        return below.mapped(blocks)

    def joined(self, free: FloatArray) -> FloatArray:
        """Return all unknowns of a law from its free ordinates (in lifts)."""
        unknowns = np.zeros(self.unknowns)
        unknowns[: free.size] = free
        unknowns[free.size :] = self.link(unknowns)
        return unknowns

    def law(self, unknowns: FloatArray, name: str) -> Law:
        """Return the law that the unknowns describe, with a name."""
        ordinates = self.derivative(0)(unknowns).reshape(-1, self.degree + 1).T
        return Law(name, self.breaks, ordinates)

    def weighted(self, *weights: float) -> Affine:
        """Return the ordinates of the weighted sum Σ wₖ s⁽ᵏ⁾ of derivatives, of degree p."""
        terms = [self._elevated(order) * weight for order, weight in enumerate(weights)]
        return sum(terms[1:], terms[0])

    @lru_cache(maxsize=16)  # noqa: B019
    def _elevated(self, order: int) -> Affine:
        """Return the ordinates of a derivative, elevated to degree p."""
        elevation = bernstein.elevation_matrix(self.degree - order, self.degree)
        return self.derivative(order).mapped(self.blocks(elevation))

    def blocks(self, matrix: FloatArray) -> Any:
        """Return the block matrix that applies a matrix to the ordinates of every piece."""
        return sparse.kron(sparse.eye_array(self.spans.size), matrix, "csr")

    def bounds(self, ordinates: Affine, sufficient: bool) -> Affine:
        """Return bounds of a polynomial: its hull (sufficient) or its points (necessary).

        ``ordinates`` are those of every piece.
        """
        return self.hull(ordinates) if sufficient else self.points(ordinates)

    @property
    def parts(self) -> int:
        """Number of parts into which each piece is divided for bounds."""
        parts = min(MAX_PARTS, round(PARTS_PER_PIECE * self.law_class.pieces))
        return max(MIN_PARTS, parts, round(PARTS_PER_TURN / self.spans.size))

    def hull(self, ordinates: Affine, parts: int | None = None) -> Affine:
        """Return the ordinates of all pieces of a polynomial, each cut into parts.

        The polynomial lies in the convex hull of the ordinates.
        """
        parts = parts or self.parts
        degree = ordinates.constant.size // self.spans.size - 1
        return ordinates.mapped(self.blocks(np.concatenate(bernstein.parts(degree, parts))))

    def hull_over(self, order: int, low: float, high: float, parts: int) -> Affine:
        """Return the ordinates of a derivative over the range ``low`` to ``high`` (rad).

        They are those of the parts of all pieces, cut at the ends of the range. The derivative lies
        in their convex hull.
        """
        count = self.degree - order + 1
        blocks = []
        for start, span in zip(self.breaks[:-1], self.spans, strict=True):
            first, last = np.clip((np.array([low, high]) - start) / span, 0.0, 1.0)
            steps = np.arange(parts + 1) / parts
            inside = steps[(steps > first) & (steps < last)]
            edges = [first, *inside, last] if first < last else []
            restrictions = [bernstein.restrict(np.eye(count), a, b) for a, b in pairwise(edges)]
            blocks.append(np.concatenate(restrictions) if restrictions else np.empty((0, count)))
        matrix = sparse.csr_array(sparse.block_diag(blocks, "csr"))
        return self.derivative(order).mapped(matrix)

    def points(self, ordinates: Affine) -> Affine:
        """Return a polynomial's values at the ends of all parts, both sides of joints."""
        degree = ordinates.constant.size // self.spans.size - 1
        table = bernstein.basis(degree, np.linspace(0.0, 1.0, self.parts + 1))
        return ordinates.mapped(self.blocks(table))

    def at(self, order: int, angle: FloatArray) -> Affine:
        """Return a derivative of the lift at angles (rad), the right limit at a joint."""
        ordinates, degree = self.derivative(order), self.degree - order
        inside = np.mod(angle, TURN)
        piece = np.searchsorted(self.breaks[1:-1], inside, side="right")
        table = bernstein.basis(degree, (inside - self.breaks[piece]) / self.spans[piece])
        rows = np.repeat(np.arange(angle.size), degree + 1)
        columns = (piece[:, None] * (degree + 1) + np.arange(degree + 1)).ravel()
        shape = (angle.size, self.spans.size * (degree + 1))
        return ordinates.mapped(sparse.csr_array((table.ravel(), (rows, columns)), shape=shape))


# Problem of a design: the space of laws, the rig and the follower. Goals and limits.

#: Margin of the limits of a design, in their scales. It allows for the rounding of the solver and
#: of the file.
SPARE = 2e-8


@dataclass(eq=False)
class DesignProblem:
    """Problem of a design: the data from which the rows of a program are computed.

    ``free`` names the parts of the start's cam (dwells, events) whose angles differ. The
    ``follower`` has two masses if the rig defines their split. ``rigid`` has one mass.
    ``force_scale`` (N) is the preload, or the force of the spring at half the lift.
    """

    cam: CamConfig
    start: Law
    rig: RigConfig
    space: Space
    free: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        rigid = self.rigid = FollowerParameters.from_rig(self.rig)
        self.follower = follower_of(self.rig)
        self.two_masses = isinstance(self.follower, TwoMassParameters)
        self.force_scale = rigid.preload or 0.5 * rigid.spring_stiffness * self.start.lift

    @cached_property
    def mode(self) -> VibrationMode:
        """Vibration mode of the follower on its stem."""
        return mode_of(self.rig)

    @cached_property
    def element(self) -> Element | None:
        """Contact of a cam with one disc and without an inclined face, else None."""
        plates = discs(self.cam.follower, self.start)
        element = plates[0].element
        inclined = getattr(element, "inclination", 0.0) != 0.0
        return None if len(plates) > 1 or inclined else element


@lru_cache(maxsize=64)
def measured(problem: DesignProblem, law: Law, term: Term, sense: Sense) -> float:
    """Return the value of a quantity of a law, SI (levels in dB)."""
    events = [(event.start, event.span) for event in problem.space.events]
    return term.quantity.value(Subject(law, problem.rig, problem.cam, events), term, sense)


@dataclass(frozen=True)
class ScaledLimit(Limit):
    """Goal (``value`` None) or limit, with the scale (SI) of its rows."""

    scale: float

    @property
    def name(self) -> str:
        """Name of the goal or limit in the table of active limits."""
        return f"goal {self.term.key}" if self.value is None else self.words

    @property
    def weight(self) -> float:
        """Weight of the level t in the rows: −1 for a goal, 0 for a limit."""
        return -1.0 if self.value is None else 0.0

    def room(self, quantity: Affine, spare: float) -> Affine:
        """Return rows that are ≥ 0 if the limit is satisfied by more than ``spare``.

        ``quantity`` is the limited quantity. The rows are in units of the scale.
        """
        rows = quantity * (-sign_of(self.sense) / self.scale)
        if self.value is None:
            return rows
        return rows.plus(sign_of(self.sense) * self.value / self.scale - spare)
