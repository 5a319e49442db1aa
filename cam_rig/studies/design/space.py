"""The laws of a class: B-splines in each event of a start law, with its dwells and its lift.

Every law of the class is s₀ + Σ xⱼ bⱼ, and so are its derivatives and all that is linear in them:
`Space` gives their Bernstein ordinates as functions of the unknowns. These are the ordinates of
each event, in lifts, and beside them those of its s'': what depends on accelerations would cancel
to a few digits in the former. `Space.link` says that they are of one law.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np
from scipy import sparse
from scipy.interpolate import BSpline

from cam_rig.arrays import FloatArray
from cam_rig.errors import ConfigError
from cam_rig.laws import Law, bernstein
from cam_rig.laws.families.b_spline import bezier_pieces
from cam_rig.laws.peaks import extremes
from cam_rig.studies.design.affine import Affine
from cam_rig.units import TURN

#: Pieces and degree of a class, and how smooth its joints may be.
MAX_PIECES, MAX_DEGREE, MAX_JOINTS = 200, 15, 6
#: An event of more ordinates than this is not written to a cam file.
MAX_ORDINATES = 500
#: A piece of a law whose ordinates differ by no more than this part of the lift is a dwell.
FLAT = 1e-12
#: A turn's end meets its start where they differ by no more than this part of a derivative.
MEETS = 1e-9
#: Parts of a piece for the polygon's bound, at least, and of a turn: its ordinates are then near
#: the polynomial.
PARTS, PARTS_OF_TURN = 24, 256


@dataclass(frozen=True)
class LawClass:
    """B-splines of a degree in equal pieces of each event, Cᵏ where they meet.

    Parameters
    ----------
    pieces : of each event
    joints : k, derivatives that are continuous at joints and at the ends of events
    degree : of the pieces; by default k + 2

    Raises
    ------
    ConfigError : out of the limits, a degree not above ``joints``, or nothing left to choose

    Examples
    --------
    >>> LawClass(pieces=16, joints=3).free
    28
    """

    pieces: int = 16
    joints: int = 3
    degree: int | None = None

    def __post_init__(self) -> None:
        limits = {"pieces": (1, MAX_PIECES), "joints": (1, MAX_JOINTS), "degree": (2, MAX_DEGREE)}
        for name, (least, most) in limits.items():
            value = self.power if name == "degree" else getattr(self, name)
            if not isinstance(value, int) or not least <= value <= most:
                raise ConfigError(f"class: {name} is {value}; allowed: {least} to {most}")
        if self.power <= self.joints:
            raise ConfigError(
                f"class: degree is {self.power} with joints C{self.joints}; allowed: a degree "
                f"above {self.joints}"
            )
        if self.free < 1:
            raise ConfigError(
                f"class: {self.count} ordinates, of which the ends take {2 * self.joints + 2}; "
                f"allowed: at least {2 * self.joints + 3}, so more pieces or a higher degree"
            )
        if self.count > MAX_ORDINATES:
            raise ConfigError(
                f"class: {self.count} ordinates an event; allowed: {MAX_ORDINATES}, so fewer "
                "pieces, a lower degree or smoother joints"
            )

    @classmethod
    def of(cls, pieces: int, joints: str, degree: int | None) -> LawClass:
        """From words: joints such as C3.

        Raises
        ------
        ConfigError : as the class, or joints that are not written so
        """
        if not (joints[:1] in ("C", "c") and joints[1:].isdecimal()):
            raise ConfigError(f"joints: are {joints!r}; allowed: C1 to C{MAX_JOINTS}")
        return cls(pieces, int(joints[1:]), degree)

    @property
    def power(self) -> int:
        """The degree."""
        return self.joints + 2 if self.degree is None else self.degree

    @property
    def knots(self) -> FloatArray:
        """Of one event of unit length, the ends ``degree + 1`` times."""
        inner = np.repeat(np.arange(1.0, self.pieces) / self.pieces, self.power - self.joints)
        ends = self.power + 1
        return np.concatenate([np.zeros(ends), inner, np.ones(ends)])

    @property
    def count(self) -> int:
        """Ordinates of one event."""
        return (self.pieces - 1) * (self.power - self.joints) + self.power + 1

    @property
    def free(self) -> int:
        """Those that the ends do not take."""
        return self.count - 2 * (self.joints + 1)

    @property
    def words(self) -> str:
        """The class as a table says it."""
        if self.pieces == 1:
            return f"Bézier curves of degree {self.power}"
        return f"B-splines of degree {self.power} in {self.pieces} pieces, C{self.joints} joints"


@lru_cache(maxsize=16)
def to_bezier(law_class: LawClass, order: int = 0) -> sparse.csr_array:
    """Ordinates of a derivative over one event to those of its Bézier pieces."""
    knots, degree = law_class.knots, law_class.power - order
    knots = knots[order : knots.size - order]
    _, columns = bezier_pieces(BSpline(knots, np.eye(knots.size - degree - 1), degree))
    return sparse.csr_array(np.concatenate(columns))


@lru_cache(maxsize=8)
def second_derivative(law_class: LawClass) -> sparse.csr_array:
    """Ordinates over one event of unit length to those of the second derivative."""
    knots, degree = law_class.knots, law_class.power
    found = np.eye(law_class.count)
    for _ in range(2):
        apart = (knots[degree + 1 : -1] - knots[1 : -degree - 1]) / degree
        found = np.diff(found, axis=0) / apart[:, None]
        knots, degree = knots[1:-1], degree - 1
    return sparse.csr_array(found)


@dataclass(frozen=True)
class Event:
    """A stretch of the turn that a design may change.

    ``start`` and ``span`` in rad; ``first`` and ``last`` are s and its derivatives (m/radᵏ) at
    both ends, as many as stay.
    """

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


def events(law: Law, joints: int) -> list[Event]:
    """What lies between the dwells of a law; their ends are those of their neighbours.

    Raises
    ------
    ConfigError : the law rests all around, or has no dwell and a turn that does not join itself
    """
    edges = [0.0, *(angle for dwell in dwells(law) for angle in dwell), TURN]
    found = []
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        if end > begin:
            pieces = np.searchsorted(law.breaks, [begin, end])
            before, after = (int(pieces[0]) - 1) % law.spans.size, int(pieces[1]) % law.spans.size
            first, last = _end(law, before, -1, joints), _end(law, after, 0, joints)
            found.append(Event(begin, end - begin, first, last))
    if not found:
        raise ConfigError(f"cam {law.name!r}: it rests all around; allowed: a cam with a lift")
    if len(edges) == 2:
        _require_joined(law, joints)
    return found


def _end(law: Law, piece: int, end: int, joints: int) -> tuple[float, ...]:
    """S and its derivatives at the start (0) or at the end (−1) of a piece."""
    return tuple(float(law.derivative_ordinates(k)[end, piece]) for k in range(joints + 1))


def _require_joined(law: Law, joints: int) -> None:
    """Refuse a turn without a dwell whose end and start differ in a derivative that stays."""
    for order in range(joints + 1):
        ordinates = law.derivative_ordinates(order)
        if abs(ordinates[0, 0] - ordinates[-1, -1]) > MEETS * np.abs(ordinates).max():
            raise ConfigError(
                f"cam {law.name!r}: it has no dwell, and derivative {order} at the turn's end is "
                f"not that at its start; allowed: joints up to C{order - 1}"
            )


@dataclass(frozen=True, eq=False)
class Space:
    """All laws of a class that rest where a start law does, and have its ends of events.

    Unknowns are the free ordinates of each event in turn, in lifts.
    """

    start: Law
    law_class: LawClass
    events: list[Event] = field(default_factory=list)

    def __post_init__(self) -> None:
        if not self.events:
            object.__setattr__(self, "events", events(self.start, self.law_class.joints))

    @property
    def unknowns(self) -> int:
        """How many there are: the free ordinates of each event, then those of each one's s''."""
        return self._second(len(self.events))

    def _second(self, index: int) -> int:
        """Where the ordinates of s'' of an event begin among the unknowns."""
        own = self.law_class
        return own.free * len(self.events) + (own.count - 2) * index

    @cached_property
    def link(self) -> Affine:
        """What is zero where ordinates of s and of s'' are of one law."""
        rows = []
        for index in range(len(self.events)):
            of_lift = self.coefficients(index).mapped(second_derivative(self.law_class))
            rows.append((of_lift * (1.0 / self.start.lift)) + self._bend(index) * -1.0)
        return Affine.stacked(rows)

    def _bend(self, index: int) -> Affine:
        """The ordinates of s'' of one event, in lifts over its span squared."""
        count = self.law_class.count - 2
        columns = self._second(index) + np.arange(count)
        entries = (np.ones(count), (np.arange(count), columns))
        matrix = sparse.csr_array(entries, shape=(count, self.unknowns))
        return Affine(np.zeros(count), matrix)

    @property
    def degree(self) -> int:
        """Of all pieces."""
        return self.law_class.power

    @cached_property
    def levels(self) -> tuple[float, float]:
        """Lowest and highest lift (m) of the start law."""
        low, high = extremes(self.start, 0)
        return low.value, high.value

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

    @cached_property
    def breaks(self) -> FloatArray:
        """``(n + 1,)`` joints of the laws, rad."""
        inner = np.arange(self.law_class.pieces) / self.law_class.pieces
        parts = [[0.0]]
        for event in self.events:
            parts.append((event.start + event.span * inner).tolist())
            parts.append([event.start + event.span])
        joints = np.array(sorted({angle for part in parts for angle in part} | {TURN}))
        return joints

    @property
    def spans(self) -> FloatArray:
        """``(n,)`` rad."""
        return np.diff(self.breaks)

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

    def _clamped(self, event: Event, derivatives: tuple[float, ...], end: int) -> FloatArray:
        """The ordinates at one end, from it inwards, that give it its derivatives."""
        own = self.law_class
        table = to_bezier(own)[: own.power + 1, : own.joints + 1].toarray()
        span = event.span / own.pieces * (1.0 if end == 0 else -1.0)
        matrix = np.empty((own.joints + 1, own.joints + 1))
        rows, scale = table, 1.0
        for order in range(own.joints + 1):
            matrix[order] = rows[0] * scale
            rows, scale = bernstein.derivative(rows), scale / span
        return np.asarray(np.linalg.solve(matrix, np.array(derivatives)))

    @property
    def lift(self) -> Affine:
        """Ordinates of s (m) of every piece in turn, ``(n · (p + 1),)``."""
        return self.derivative(0)

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
                own = self._bend(index) * (self.start.lift / event.span**2)
            parts.append(own.mapped(to_bezier(self.law_class, order)))
            at = first + self.law_class.pieces
        parts += [self._rest(order, angle) for angle in self.breaks[at:-1].tolist()]
        return Affine.stacked(parts)

    def _rest(self, order: int, angle: float) -> Affine:
        level = self.start.lift_at(angle) if order == 0 else 0.0
        count = self.degree + 1 - order
        return Affine(np.full(count, level), sparse.csr_array((count, self.unknowns)))

    @lru_cache(maxsize=16)  # noqa: B019 - a space lives as long as its design
    def derivative(self, order: int) -> Affine:
        """Ordinates of d^order s/dθ^order (m/rad^order), of degree p − order, piece by piece."""
        if order in (0, 2):
            return self._around(order)
        below, degree = self.derivative(order - 1), self.degree - order + 1
        step = bernstein.derivative(np.eye(degree + 1))
        blocks = sparse.block_diag([step / span for span in self.spans], format="csr")
        return below.mapped(sparse.csr_array(blocks))

    def joined(self, free: FloatArray) -> FloatArray:
        """All unknowns where the free ordinates of the events (in lifts) are these."""
        unknowns = np.zeros(self.unknowns)
        unknowns[: free.size] = free
        unknowns[free.size :] = self.link(unknowns)
        return unknowns

    def law(self, unknowns: FloatArray, name: str) -> Law:
        """The law of some unknowns."""
        ordinates = self.lift(unknowns).reshape(-1, self.degree + 1).T
        return Law(name, self.breaks, ordinates)

    def weighted(self, weights: tuple[float, ...]) -> Affine:
        """Ordinates of Σ wₖ s⁽ᵏ⁾, of degree p."""
        total: Affine | None = None
        for order, weight in enumerate(weights):
            term = self.elevated(order) * weight
            total = term if total is None else total + term
        assert total is not None
        return total

    @lru_cache(maxsize=16)  # noqa: B019
    def elevated(self, order: int) -> Affine:
        """A derivative's ordinates written with degree p."""
        up = bernstein.elevation_matrix(self.degree - order, self.degree)
        return self.derivative(order).mapped(self._blocks(up))

    def _blocks(self, matrix: FloatArray) -> sparse.csr_array:
        """One matrix for the ordinates of every piece."""
        return sparse.csr_array(sparse.kron(sparse.eye_array(self.spans.size), matrix, "csr"))

    @property
    def parts(self) -> int:
        """Of a piece, for its bounds."""
        return max(PARTS, round(PARTS_OF_TURN / self.spans.size))

    def hull(self, ordinates: Affine, parts: int | None = None) -> Affine:
        """Ordinates of all pieces cut in parts: the polynomial lies in their convex hull."""
        parts = parts or self.parts
        degree = ordinates.constant.size // self.spans.size - 1
        cuts = [
            bernstein.restrict(np.eye(degree + 1), i / parts, (i + 1) / parts) for i in range(parts)
        ]
        return ordinates.mapped(self._blocks(np.concatenate(cuts)))

    def points(self, ordinates: Affine) -> Affine:
        """Values at the ends of the parts of all pieces, at joints on both sides."""
        degree = ordinates.constant.size // self.spans.size - 1
        table = bernstein.basis(degree, np.linspace(0.0, 1.0, self.parts + 1))
        return ordinates.mapped(self._blocks(table))

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
