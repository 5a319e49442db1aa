"""The laws of a class: B-splines in each event of a start law, with its dwells and its lift.

Every law of the class is s₀ + Σ xⱼ bⱼ, and so are its derivatives and all that is linear in them:
`Space` gives their Bernstein ordinates as functions of the unknowns. These are the ordinates of
each event, in lifts, and beside them those of its s'': what depends on accelerations would cancel
to a few digits in the former. `Space.link` says that they are of one law.
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

#: A piece of a law whose ordinates differ by no more than this part of the lift is a dwell.
FLAT = 1e-12
#: A turn's end meets its start where they differ by no more than this part of a derivative.
MEETS = 1e-9


@dataclass(frozen=True)
class LawEvent:
    """A stretch of the turn to change; s and its derivatives stay at its ``first`` and ``last``."""

    start: float
    span: float
    first: tuple[float, ...]
    last: tuple[float, ...]


def dwells(law: Law) -> list[tuple[float, float]]:
    """Where a law rests, from and to (rad), joined where pieces meet at one level."""
    flat = np.ptp(law.ordinates, axis=0) <= FLAT * law.lift
    found: list[tuple[float, float]] = []
    for i in np.flatnonzero(flat):
        begin, end = float(law.breaks[i]), float(law.breaks[i + 1])
        if found and found[-1][1] == begin:
            begin = found.pop()[0]
        found.append((begin, end))
    return found


def events(law: Law, joints: int) -> list[LawEvent]:
    """What lies between the dwells of a law; their ends are those of their neighbours."""

    def ends(piece: int, place: int) -> tuple[float, ...]:
        piece %= law.spans.size
        return tuple(float(law.derivative_ordinates(k)[place, piece]) for k in range(joints + 1))

    edges = [0.0, *(angle for dwell in dwells(law) for angle in dwell), TURN]
    found = []
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        if end > begin:
            first, after = np.searchsorted(law.breaks, [begin, end]).tolist()
            found.append(LawEvent(begin, end - begin, ends(first - 1, -1), ends(after, 0)))
    if not found:
        raise ConfigError(f"cam {law.name!r}: it rests all around; allowed: a cam with a lift")
    if len(edges) == 2:
        _require_joined(law, joints)
    return found


def _require_joined(law: Law, joints: int) -> None:
    """Refuse a turn without a dwell whose end and start differ in a derivative that stays."""
    for order in range(joints + 1):
        ordinates = law.derivative_ordinates(order)
        if abs(ordinates[0, 0] - ordinates[-1, -1]) > MEETS * np.abs(ordinates).max():
            raise ConfigError(
                f"cam {law.name!r}: it has no dwell, and derivative {order} at the turn's end is "
                f"not that at its start; allowed: joints up to C{order - 1}"
            )


@lru_cache(maxsize=16)
def _to_bezier(law_class: LawClass, order: int = 0) -> Any:
    """Ordinates of a derivative over one event to those of its Bézier pieces."""
    knots, degree = law_class.knots, law_class.power - order
    knots = knots[order : knots.size - order]
    _, columns = bezier_pieces(BSpline(knots, np.eye(knots.size - degree - 1), degree))
    return sparse.csr_array(np.concatenate(columns))


@lru_cache(maxsize=8)
def _second_derivative(law_class: LawClass) -> Any:
    """Ordinates over one event of unit length to those of the second derivative."""
    knots, degree = law_class.knots, law_class.power
    found = np.eye(law_class.count)
    for _ in range(2):
        apart = (knots[degree + 1 : -1] - knots[1 : -degree - 1]) / degree
        found = np.diff(found, axis=0) / apart[:, None]
        knots, degree = knots[1:-1], degree - 1
    return sparse.csr_array(found)


#: Parts of a piece for the polygon's bound, at least, at most, of a turn, and for each piece of an
#: event: its ordinates are then near the polynomial. More pieces press harder on their limits.
PARTS, MOST_PARTS, PARTS_OF_TURN, PARTS_A_PIECE = 24, 48, 256, 1.5


@dataclass(eq=False)
class Space:
    """All laws of a class that rest where a start law does, and have its ends of events.

    The ``unknowns`` are the ``free`` ordinates of each event in turn, in lifts, then all of each
    one's s''. Pieces have joints at ``breaks`` ``(n + 1,)`` and ``spans`` ``(n,)``, rad.
    """

    start: Law
    law_class: LawClass

    def __post_init__(self) -> None:
        own = self.law_class
        self.events, self.degree = events(self.start, own.joints), own.power
        self.free = own.free * len(self.events)
        self.unknowns = self._second(len(self.events))
        inner = np.arange(own.pieces) / own.pieces
        joints = [np.append(x.start + x.span * inner, x.start + x.span) for x in self.events]
        self.breaks = np.unique(np.concatenate([[0.0], *joints, [TURN]]))
        self.spans = np.diff(self.breaks)

    def _second(self, index: int) -> int:
        """Where the ordinates of s'' of an event begin among the unknowns."""
        return self.free + (self.law_class.count - 2) * index

    @cached_property
    def link(self) -> Affine:
        """What is zero where ordinates of s and of s'' are of one law."""
        rows = []
        for index in range(len(self.events)):
            of_lift = self.coefficients(index).mapped(_second_derivative(self.law_class))
            rows.append((of_lift * (1.0 / self.start.lift)) + self._curvature(index) * -1.0)
        return Affine.stacked(rows)

    def _curvature(self, index: int) -> Affine:
        """The ordinates of s'' of one event, in lifts over its span squared."""
        count = self.law_class.count - 2
        matrix = sparse.eye_array(count, self.unknowns, k=self._second(index), format="csr")
        return Affine(np.zeros(count), matrix)

    @property
    def turning_points(self) -> list[tuple[float, float]]:
        """Highest and lowest lift (m) and where (rad), those that no end of an event has."""
        ends = {level for event in self.events for level in (event.first[0], event.last[0])}
        near = FLAT * self.start.lift
        return [
            (found.value, found.angle)
            for found in extremes(self.start, 0)
            if all(abs(found.value - level) > near for level in ends)
        ]

    def coefficients(self, index: int) -> Affine:
        """The ordinates (m) of one event, fixed ones too, ``(count,)``."""
        event, own = self.events[index], self.law_class
        fixed = own.joints + 1
        constant = np.zeros(own.count)
        constant[:fixed] = self._clamped(event, event.first, 0)
        constant[own.count - fixed :] = self._clamped(event, event.last, -1)[::-1]
        rows = np.arange(fixed, own.count - fixed)
        columns = np.arange(own.free) + own.free * index
        scale = np.full(own.free, self.start.lift)
        shape = (own.count, self.unknowns)
        return Affine(constant, sparse.csr_array((scale, (rows, columns)), shape=shape))

    def _clamped(self, event: LawEvent, derivatives: tuple[float, ...], end: int) -> FloatArray:
        """The ordinates at one end, from it inwards, that give it its derivatives."""
        own = self.law_class
        if not any(derivatives[1:]):
            return np.full(own.joints + 1, derivatives[0])  # at rest, to the last digit
        table = _to_bezier(own)[: own.power + 1, : own.joints + 1].toarray()
        span = event.span / own.pieces * (1.0 if end == 0 else -1.0)
        matrix = np.empty((own.joints + 1, own.joints + 1))
        rows, scale = table, 1.0
        for order in range(own.joints + 1):
            matrix[order] = rows[0] * scale
            rows, scale = bernstein.derivative(rows), scale / span
        return np.asarray(np.linalg.solve(matrix, np.array(derivatives)))

    def _around(self, order: int) -> Affine:
        """Ordinates of s or of s'' of every piece, dwells among them."""
        parts: list[Affine] = []
        at = 0
        for index, event in enumerate(self.events):
            first = int(np.searchsorted(self.breaks, event.start))
            parts += [self._rest(order, angle) for angle in self.breaks[at:first].tolist()]
            if order == 0:
                own = self.coefficients(index)
            else:
                own = self._curvature(index) * (self.start.lift / event.span**2)
            parts.append(own.mapped(_to_bezier(self.law_class, order)))
            at = first + self.law_class.pieces
        parts += [self._rest(order, angle) for angle in self.breaks[at:-1].tolist()]
        return Affine.stacked(parts)

    def _rest(self, order: int, angle: float) -> Affine:
        level = self.start.at(angle)[0] if order == 0 else 0.0
        count = self.degree + 1 - order
        return Affine(np.full(count, level), sparse.csr_array((count, self.unknowns)))

    @lru_cache(maxsize=16)  # noqa: B019 - a space lives as long as its design
    def derivative(self, order: int) -> Affine:
        """Ordinates of dᵏs/dθᵏ (m/radᵏ), of degree p − k, piece by piece, ``(n (p + 1 − k),)``."""
        if order in (0, 2):
            return self._around(order)
        below, degree = self.derivative(order - 1), self.degree - order + 1
        step = bernstein.derivative(np.eye(degree + 1))
        blocks = sparse.csr_array(sparse.block_diag([step / span for span in self.spans]))
        return below.mapped(blocks)

    def joined(self, free: FloatArray) -> FloatArray:
        """All unknowns where the free ordinates of the events (in lifts) are these."""
        unknowns = np.zeros(self.unknowns)
        unknowns[: free.size] = free
        unknowns[free.size :] = self.link(unknowns)
        return unknowns

    def law(self, unknowns: FloatArray, name: str) -> Law:
        """The law of some unknowns."""
        ordinates = self.derivative(0)(unknowns).reshape(-1, self.degree + 1).T
        return Law(name, self.breaks, ordinates)

    def weighted(self, *weights: float) -> Affine:
        """Ordinates of Σ wₖ s⁽ᵏ⁾, of degree p."""
        terms = [self._elevated(order) * weight for order, weight in enumerate(weights)]
        return sum(terms[1:], terms[0])

    @lru_cache(maxsize=16)  # noqa: B019
    def _elevated(self, order: int) -> Affine:
        """A derivative's ordinates written with degree p."""
        up = bernstein.elevation_matrix(self.degree - order, self.degree)
        return self.derivative(order).mapped(self.blocks(up))

    def blocks(self, matrix: FloatArray) -> Any:
        """One matrix for the ordinates of every piece."""
        return sparse.kron(sparse.eye_array(self.spans.size), matrix, "csr")

    def bounds(self, ordinates: Affine, hull: bool) -> Affine:
        """What bounds a polynomial of these ordinates from both sides: its hull, or its points."""
        return self.hull(ordinates) if hull else self.points(ordinates)

    @property
    def parts(self) -> int:
        """Of a piece, for its bounds."""
        own = min(MOST_PARTS, round(PARTS_A_PIECE * self.law_class.pieces))
        return max(PARTS, own, round(PARTS_OF_TURN / self.spans.size))

    def hull(self, ordinates: Affine, parts: int | None = None) -> Affine:
        """Ordinates of all pieces cut in parts: the polynomial lies in their convex hull."""
        parts = parts or self.parts
        degree = ordinates.constant.size // self.spans.size - 1
        return ordinates.mapped(self.blocks(np.concatenate(bernstein.parts(degree, parts))))

    def hull_over(self, order: int, low: float, high: float, parts: int) -> Affine:
        """Return ordinates of a derivative on the parts of all pieces within `low` to `high` (rad).

        The range ends at its own angles, not at the ends of the parts around it.
        """
        count = self.degree - order + 1
        blocks = []
        for begin, span in zip(self.breaks[:-1], self.spans, strict=True):
            first, last = np.clip((np.array([low, high]) - begin) / span, 0.0, 1.0)
            steps = np.arange(parts + 1) / parts
            inside = steps[(steps > first) & (steps < last)]
            edges = [first, *inside, last] if first < last else []
            cut = [bernstein.restrict(np.eye(count), a, b) for a, b in pairwise(edges)]
            blocks.append(np.concatenate(cut) if cut else np.empty((0, count)))
        matrix = sparse.csr_array(sparse.block_diag(blocks, "csr"))
        return self.derivative(order).mapped(matrix)

    def points(self, ordinates: Affine) -> Affine:
        """Values at the ends of the parts of all pieces, at joints on both sides."""
        degree = ordinates.constant.size // self.spans.size - 1
        table = bernstein.basis(degree, np.linspace(0.0, 1.0, self.parts + 1))
        return ordinates.mapped(self.blocks(table))

    def at(self, order: int, angle: FloatArray) -> Affine:
        """A derivative at angles (rad); at a joint the right limit."""
        ordinates, degree = self.derivative(order), self.degree - order
        inside = np.mod(angle, TURN)
        piece = np.searchsorted(self.breaks[1:-1], inside, side="right")
        table = bernstein.basis(degree, (inside - self.breaks[piece]) / self.spans[piece])
        rows = np.repeat(np.arange(angle.size), degree + 1)
        columns = (piece[:, None] * (degree + 1) + np.arange(degree + 1)).ravel()
        shape = (angle.size, self.spans.size * (degree + 1))
        return ordinates.mapped(sparse.csr_array((table.ravel(), (rows, columns)), shape=shape))


# A design's problem: the space of laws, the rig and the follower; a goal or a limit of it.

#: Limits are kept with so much of their scale to spare: rounding of the solver and of the file.
SPARE = 2e-8


@dataclass(eq=False)
class DesignProblem:
    """What rows of a program are made of; ``free`` is what the start's cam has elsewhere.

    The ``follower`` is of two masses where the rig says how they split, ``rigid`` of one;
    ``force_scale`` (N) measures forces: the preload, or the spring at half the lift.
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
        """Of that follower on its stem."""
        return mode_of(self.rig)

    @cached_property
    def element(self) -> Element | None:
        """The contact of a cam of one disc whose follower has no inclined face."""
        plates = discs(self.cam.follower, self.start)
        element = plates[0].element
        inclined = getattr(element, "inclination", 0.0) != 0.0
        return None if len(plates) > 1 or inclined else element


@lru_cache(maxsize=64)
def measured(problem: DesignProblem, law: Law, term: Term, sense: Sense) -> float:
    """A quantity of a law, SI; the level in dB."""
    events = [(event.start, event.span) for event in problem.space.events]
    return term.quantity.value(Subject(law, problem.rig, problem.cam, events), term, sense)


@dataclass(frozen=True)
class Asked(Limit):
    """A goal (``value`` None) or a limit, with what its rows are measured by (SI)."""

    scale: float

    @property
    def name(self) -> str:
        """As the request says it, for the table of active limits."""
        return f"goal {self.term.key}" if self.value is None else self.words

    @property
    def weight(self) -> float:
        """Of the level t in the rows."""
        return -1.0 if self.value is None else 0.0

    def room(self, quantity: Affine, spare: float) -> Affine:
        """Rows that are ≥ 0 where the limit is kept."""
        rows = quantity * (-sign_of(self.sense) / self.scale)
        if self.value is None:
            return rows
        return rows.plus(sign_of(self.sense) * self.value / self.scale - spare)
