"""Laws that a design can choose, as affine functions of unknown numbers.

A law of the class has the dwells of a start law, and a B-spline in each event (the stretch of the
turn between two dwells). Every such law is s₀ + Σ xⱼ bⱼ with fixed functions s₀ and bⱼ, so its
derivatives and all quantities that are linear in them are affine in the unknowns x. `Space` returns
their Bernstein ordinates as such functions. Bernstein ordinates are the control values of a
polynomial, which lies in their convex hull.

The unknowns are the B-spline ordinates of each event, in units of the lift, followed by the
B-spline ordinates of its s''. The latter are unknowns too, because accelerations computed from the
ordinates of s would lose most digits by cancellation. `Space.link` is the condition that both
belong to one law.
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

#: Largest difference between the Bernstein ordinates of a polynomial piece that counts as a dwell,
#: as a fraction of the lift.
FLAT_RTOL = 1e-12
#: Largest difference between a derivative of the lift at 0 and at 2π that counts as continuous,
#: relative to the largest Bernstein ordinate of the derivative.
CLOSURE_RTOL = 1e-9


@dataclass(frozen=True)
class LawEvent:
    """Event of a law (the stretch of the turn between two dwells), which is designed.

    ``start`` (cam angle) and ``span`` are in rad. ``first`` and ``last`` contain s and its
    derivatives by the cam angle (m/radᵏ) at the two ends. The design keeps these values.
    """

    start: float
    span: float
    first: tuple[float, ...]
    last: tuple[float, ...]


def dwells(law: Law) -> list[tuple[float, float]]:
    """Return start and end (rad) of each dwell of a law.

    A dwell is a stretch of constant lift. Adjacent constant pieces of the law are merged.
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
    """Return the events of a law, which are the motions between its dwells.

    ``joints`` is the highest order of the derivatives of s that are stored for the two ends of each
    event. At an end they are the derivatives of the polynomial piece outside the event.
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
    """Raise a `ConfigError` if a law without dwells is not smooth from turn to turn.

    The lift and its derivatives up to the order ``joints`` must have the same values at 0 and 2π.
    """
    for order in range(joints + 1):
        ordinates = law.derivative_ordinates(order)
        if abs(ordinates[0, 0] - ordinates[-1, -1]) > CLOSURE_RTOL * np.abs(ordinates).max():
            raise ConfigError(
                f"cam {law.name!r} has no dwell, and its derivative {order} has a step between "
                f"two turns; use joints up to C{order - 1}"
            )


@lru_cache(maxsize=16)
def _to_bezier(law_class: LawClass, order: int = 0) -> Any:
    """Return the sparse matrix from B-spline ordinates to Bernstein ordinates.

    It applies to one event, the motion between two dwells. The B-spline is the derivative of s of
    the given ``order``. The Bernstein ordinates (control values) are those of the event's
    polynomial pieces, piece by piece.
    """
    knots, degree = law_class.knots, law_class.power - order
    knots = knots[order : knots.size - order]
    _, columns = bezier_pieces(BSpline(knots, np.eye(knots.size - degree - 1), degree))
    return sparse.csr_array(np.concatenate(columns))


@lru_cache(maxsize=8)
def _second_derivative(law_class: LawClass) -> Any:
    """Return the sparse matrix from the B-spline ordinates of s to those of s''.

    It is for one event of unit length. For a span β the result must be divided by β². An event is
    the motion between two dwells.
    """
    knots, degree = law_class.knots, law_class.power
    matrix = np.eye(law_class.count)
    for _ in range(2):
        differences = (knots[degree + 1 : -1] - knots[1 : -degree - 1]) / degree
        matrix = np.diff(matrix, axis=0) / differences[:, None]
        knots, degree = knots[1:-1], degree - 1
    return sparse.csr_array(matrix)


#: Smallest number of equal parts into which each polynomial piece of a law is cut. The parts give
#: bounds of its values.
MIN_PARTS = 24
#: Largest number of parts of a polynomial piece that may follow from `PARTS_PER_PIECE`.
MAX_PARTS = 48
#: Smallest number of parts into which all polynomial pieces of a turn together are cut for bounds.
PARTS_PER_TURN = 256
#: Number of parts into which each polynomial piece of a law is cut, divided by the number of pieces
#: per event (motion between two dwells). Laws with more pieces come closer to their limits, so that
#: their values need tighter bounds.
PARTS_PER_PIECE = 1.5


@dataclass(eq=False)
class Space:
    """Class of laws that share the dwells and the ends of events of a start law.

    An event is the stretch of the turn between two dwells. Laws are described by ``unknowns``
    numbers. The first ``free`` of them are the free B-spline ordinates of the events in order, in
    units of the lift. They are followed by all B-spline ordinates of each event's s''. The
    polynomial pieces of a law, including dwells, have the joints ``breaks`` ``(n + 1,)`` and the
    ``spans`` ``(n,)``, both in rad.
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
        """Return where the s'' ordinates of an event start in the vector of unknowns.

        The vector contains the free B-spline ordinates of s of all events, then the B-spline
        ordinates of s'' of each event. The result is the index of the first s'' ordinate of event
        number ``index``, counted from 0. An event is the motion between two dwells.
        """
        return self.free + (self.law_class.count - 2) * index

    @cached_property
    def link(self) -> Affine:
        """Condition that the unknown B-spline ordinates of s and of s'' fit together.

        Both are unknowns of the design. The condition is a function of the unknowns, whose values
        are zero if the ordinates of s'' are those of the second derivative of s.
        """
        rows = []
        for index in range(len(self.events)):
            from_lift = self.coefficients(index).mapped(_second_derivative(self.law_class))
            rows.append((from_lift * (1.0 / self.start.lift)) + self._curvature(index) * -1.0)
        return Affine.stacked(rows)

    def _curvature(self, index: int) -> Affine:
        """Return the B-spline ordinates of s'' of one event as a function of the unknowns.

        Their unit is the lift divided by the squared span of the event. They are unknowns
        themselves, so the function only selects them. ``index`` is the number of the event, from 0.
        An event is the motion between two dwells.
        """
        count = self.law_class.count - 2
        matrix = sparse.eye_array(count, self.unknowns, k=self._offset(index), format="csr")
        return Affine(np.zeros(count), matrix)

    @property
    def turning_points(self) -> list[tuple[float, float]]:
        """Lowest and highest point of the start law, if they lie inside an event.

        The start law is the law that the design starts from. Each point is a pair of lift (m) and
        cam angle (rad). An extreme lift that is also the lift at an end of an event is omitted,
        because it is fixed already. An event is the motion between two dwells.
        """
        ends = {level for event in self.events for level in (event.first[0], event.last[0])}
        tolerance = FLAT_RTOL * self.start.lift
        return [
            (extreme.value, extreme.angle)
            for extreme in extremes(self.start, 0)
            if all(abs(extreme.value - level) > tolerance for level in ends)
        ]

    def coefficients(self, index: int) -> Affine:
        """Return the B-spline ordinates (m) of one event, shape ``(count,)``.

        They are a function of the unknowns. The first and last ``joints`` + 1 ordinates are fixed
        by the ends of the event and do not depend on the unknowns. ``index`` is the number of the
        event, from 0. An event is the motion between two dwells.
        """
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
        """Return the B-spline ordinates (m) that are fixed at one end of an event.

        They follow from the values of s and its derivatives at this end, ``derivatives``. They are
        ordered from the end inwards, shape ``(joints + 1,)``. ``end`` is 0 for the start of the
        event and −1 for its end. An event is the motion between two dwells.
        """
        law_class = self.law_class
        if not any(derivatives[1:]):
            # the law is at rest, so they are exactly equal
            return np.full(law_class.joints + 1, derivatives[0])
        table = _to_bezier(law_class)[: law_class.power + 1, : law_class.joints + 1].toarray()
        span = event.span / law_class.pieces * (1.0 if end == 0 else -1.0)
        matrix = np.empty((law_class.joints + 1, law_class.joints + 1))
        rows, scale = table, 1.0
        for order in range(law_class.joints + 1):
            matrix[order] = rows[0] * scale
            rows, scale = bernstein.derivative(rows), scale / span
        return np.asarray(np.linalg.solve(matrix, np.array(derivatives)))

    def _all_ordinates(self, order: int) -> Affine:
        """Return the Bernstein ordinates of s or s'' of all polynomial pieces of the turn.

        ``order`` is 0 for s (m) or 2 for s'' (m/rad²). Dwells are included as constant pieces.
        """
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
        """Return the Bernstein ordinates of dᵏs/dθᵏ (m/radᵏ) of all n polynomial pieces.

        They are a function of the unknowns, piece by piece, with shape ``(n (p + 1 − k),)``. Here k
        is ``order``, and p is the degree of the law, so that each piece has the degree p − k.
        """
        if order in (0, 2):
            return self._all_ordinates(order)
        below, degree = self.derivative(order - 1), self.degree - order + 1
        step = bernstein.derivative(np.eye(degree + 1))
        blocks = sparse.csr_array(sparse.block_diag([step / span for span in self.spans]))
        return below.mapped(blocks)

    def joined(self, free: FloatArray) -> FloatArray:
        """Return all unknowns of a law from its free B-spline ordinates of s.

        ``free`` are these ordinates in units of the lift. The other unknowns, the B-spline
        ordinates of s'', are computed from the condition `link`.
        """
        unknowns = np.zeros(self.unknowns)
        unknowns[: free.size] = free
        unknowns[free.size :] = self.link(unknowns)
        return unknowns

    def law(self, unknowns: FloatArray, name: str) -> Law:
        """Return the motion law that the unknowns of a design describe.

        ``name`` is the name of the law.
        """
        ordinates = self.derivative(0)(unknowns).reshape(-1, self.degree + 1).T
        return Law(name, self.breaks, ordinates)

    def weighted(self, *weights: float) -> Affine:
        """Return the Bernstein ordinates of Σ wₖ dᵏs/dθᵏ for all polynomial pieces.

        ``weights`` are w₀, w₁ and so on. All terms have the degree p of the law.
        """
        terms = [self._elevated(order) * weight for order, weight in enumerate(weights)]
        return sum(terms[1:], terms[0])

    @lru_cache(maxsize=16)  # noqa: B019
    def _elevated(self, order: int) -> Affine:
        """Return the Bernstein ordinates of a derivative, in the degree of the law.

        They describe the same polynomial with more ordinates, which allows derivatives of different
        orders to be added.
        """
        elevation = bernstein.elevation_matrix(self.degree - order, self.degree)
        return self.derivative(order).mapped(self.blocks(elevation))

    def blocks(self, matrix: FloatArray) -> Any:
        """Return the sparse block matrix that applies ``matrix`` to every piece.

        The matrix acts on the Bernstein ordinates of one polynomial piece.
        """
        return sparse.kron(sparse.eye_array(self.spans.size), matrix, "csr")

    def bounds(self, ordinates: Affine, sufficient: bool) -> Affine:
        """Return values from which limits on a piecewise polynomial can be stated.

        ``ordinates`` are its Bernstein ordinates. If ``sufficient``, the values are the ordinates
        of subdivided pieces. If these satisfy a limit, so does the polynomial at every angle.
        Otherwise the values are those of the polynomial at many angles. They satisfy every limit
        that the polynomial satisfies.
        """
        return self.hull(ordinates) if sufficient else self.points(ordinates)

    @property
    def parts(self) -> int:
        """Number of equal parts into which each polynomial piece is cut for bounds.

        More parts give tighter bounds, but larger programs.
        """
        parts = min(MAX_PARTS, round(PARTS_PER_PIECE * self.law_class.pieces))
        return max(MIN_PARTS, parts, round(PARTS_PER_TURN / self.spans.size))

    def hull(self, ordinates: Affine, parts: int | None = None) -> Affine:
        """Return the Bernstein ordinates of a piecewise polynomial after subdivision.

        Each piece is cut into ``parts`` equal parts (default: `parts` of the space). The polynomial
        lies in the convex hull of the returned ordinates, which is narrower for more parts.
        """
        parts = parts or self.parts
        degree = ordinates.constant.size // self.spans.size - 1
        return ordinates.mapped(self.blocks(np.concatenate(bernstein.parts(degree, parts))))

    def hull_over(self, order: int, low: float, high: float, parts: int) -> Affine:
        """Return Bernstein ordinates that bound a derivative over a range of cam angles.

        The range extends from ``low`` to ``high`` (rad). It is cut at the joints of the polynomial
        pieces, and each piece into ``parts`` equal parts. The derivative of s of the given
        ``order`` lies in the convex hull of the returned ordinates.
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
        """Return the values of a piecewise polynomial at many points of each piece.

        Each piece is divided into equal parts (see `parts`), and the points are the ends of the
        parts. ``ordinates`` are the Bernstein ordinates of the polynomial. At a joint between two
        pieces both one-sided values are returned.
        """
        degree = ordinates.constant.size // self.spans.size - 1
        table = bernstein.basis(degree, np.linspace(0.0, 1.0, self.parts + 1))
        return ordinates.mapped(self.blocks(table))

    def at(self, order: int, angle: FloatArray) -> Affine:
        """Return a derivative of the lift at cam angles (rad).

        It is a function of the unknowns, with one value (m/radᵏ) per angle. ``order`` is the order
        k of the derivative. At a joint between two pieces it is the right-hand limit.
        """
        ordinates, degree = self.derivative(order), self.degree - order
        inside = np.mod(angle, TURN)
        piece = np.searchsorted(self.breaks[1:-1], inside, side="right")
        table = bernstein.basis(degree, (inside - self.breaks[piece]) / self.spans[piece])
        rows = np.repeat(np.arange(angle.size), degree + 1)
        columns = (piece[:, None] * (degree + 1) + np.arange(degree + 1)).ravel()
        shape = (angle.size, self.spans.size * (degree + 1))
        return ordinates.mapped(sparse.csr_array((table.ravel(), (rows, columns)), shape=shape))


# Input of a design: the start law, the rig and the class of laws, and its scaled goal and limits.

#: Margin by which a designed law must satisfy its limits, relative to the scale of each limit. It
#: allows for the rounding of the solver and of the cam file.
SPARE = 2e-8


@dataclass(eq=False)
class DesignProblem:
    """Input of a design that does not depend on its goal: cam, rig and class of laws.

    ``free`` contains ``dwells`` and ``events`` if the spans of these differ from those of the start
    cam. The ``follower`` has two masses if the rig defines how its mass is split. ``rigid`` is the
    follower as one rigid mass. ``force_scale`` (N), the unit of contact forces in programs, is the
    preload. Without a preload it is the force of the spring at half the lift. An event is the
    motion between two dwells.
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
        """Vibration mode of the follower's mass on its elastic stem."""
        return mode_of(self.rig)

    @cached_property
    def element(self) -> Element | None:
        """Contact geometry between cam and follower, if the cam has one disc.

        None if the cam has several discs or the follower has an inclined face.
        """
        plates = discs(self.cam.follower, self.start)
        element = plates[0].element
        inclined = getattr(element, "inclination", 0.0) != 0.0
        return None if len(plates) > 1 or inclined else element


@lru_cache(maxsize=64)
def measured(problem: DesignProblem, law: Law, term: Term, sense: Sense) -> float:
    """Return the exact value of a quantity for a law, in SI units (levels in dB).

    ``term`` is the quantity with its speeds or angles. ``sense`` selects the worst value of a
    range: ``<=`` for a quantity to keep small, ``>=`` for one to keep large.
    """
    events = [(event.start, event.span) for event in problem.space.events]
    return term.quantity.value(Subject(law, problem.rig, problem.cam, events), term, sense)


@dataclass(frozen=True)
class ScaledLimit(Limit):
    """Goal (``value`` None) or limit of a design, with the scale of its inequalities.

    ``scale`` (SI) divides the inequalities of a convex program, so that their values are of order
    1.
    """

    scale: float

    @property
    def name(self) -> str:
        """Name by which the list of active limits refers to a goal or limit."""
        return f"goal {self.term.key}" if self.value is None else self.words

    @property
    def weight(self) -> float:
        """Weight of a program's level t in the inequalities: −1 for a goal, 0 for a limit.

        The level is the variable that the convex program maximises.
        """
        return -1.0 if self.value is None else 0.0

    def room(self, quantity: Affine, spare: float) -> Affine:
        """Return the distance of a quantity from its limit, which must not be negative.

        ``quantity`` is the limited quantity as a function of the unknowns, in the unit of the
        limit. The result is relative to the scale of the limit, and is ≥ 0 if the limit is
        satisfied by more than ``spare`` scales. For a goal it is the quantity itself, with a sign
        such that larger is better.
        """
        rows = quantity * (-sign_of(self.sense) / self.scale)
        if self.value is None:
            return rows
        return rows.plus(sign_of(self.sense) * self.value / self.scale - spare)
