"""Event angles as unknowns: the best law for some spans is a design of its own, and spans are few.

For given spans the design is the one of `design`, convex where it is; the spans are searched by
simplexes from several places. Dwells keep their lengths and the events share what is left, or
events keep their middles (one at the turn's start or end keeps that) and the dwells have what
they leave.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.optimize import brentq, minimize

from cam_rig.arrays import FloatArray
from cam_rig.errors import ConfigError, DesignError
from cam_rig.studies.design.events import retimed
from cam_rig.studies.design.local.multistart import SAME, Multistart
from cam_rig.studies.design.measure import measured
from cam_rig.studies.design.problem import DesignProblem
from cam_rig.studies.design.space import Space
from cam_rig.studies.design.terms import Limit
from cam_rig.units import TURN

#: A span is at least and at most so many times the start's, where no limit says otherwise.
SHORTEST, LONGEST = 0.5, 2.0
#: A dwell that gives way keeps so much (rad); a search ends where spans (rad) and goal (in parts
#: of it) are within so much; spans are whole multiples of the last (degrees).
LEAST_DWELL, NEAR, LEVEL, STEP_DEG = 1e-3, 5e-4, 1e-5, 1e-4
#: Designs of one descent, at most, for each span that is free.
DESIGNS = 30
#: Spans without a law are halved so often towards those nearest to the start's.
NEARER = 4


@dataclass(eq=False)
class EventSpans:
    """The spans (rad) that the events of a problem may have, and their search.

    Raises
    ------
    ConfigError : an event that does not begin and end at rest, limits that leave no spans
    """

    problem: DesignProblem
    keep_dwells: bool
    limits: list[Limit]
    value: Callable[[DesignProblem], float]
    _known: dict[tuple[float, ...], float] = field(default_factory=dict)
    _why: str = "no room for them"

    def __post_init__(self) -> None:
        events = self.problem.space.events
        self.start = np.array([event.span for event in events])
        if self.keep_dwells and len(events) == 1:
            raise ConfigError(
                f"keep: {self.problem.cam.name!r} has one event, whose span is what the dwells "
                "leave; allowed: lift alone, or events,dwells,lift"
            )
        for number, event in enumerate(events, 1):
            if any((*event.first[1:], *event.last[1:])):
                raise ConfigError(
                    f"keep: event {number} of {self.problem.cam.name!r} does not begin and end at "
                    "rest; allowed: events,dwells,lift"
                )
        self.low, self.high = SHORTEST * self.start, LONGEST * self.start
        for limit in self.limits:
            assert limit.value is not None
            measured(self.problem, self.problem.start, limit.term, limit.sense)  # there is one
            own = self.low if limit.sense == ">=" else self.high
            own[limit.term.event - 1] = limit.value
        self.base = self._base()

    def _base(self) -> FloatArray:
        """The spans that limits allow, nearest to the start's."""

        def total(more: float) -> float:
            return float(np.clip(self.start + more, self.low, self.high).sum() - self.start.sum())

        more, most = 0.0, float(np.abs(self.high - self.low).max() + self.start.max())
        if self.keep_dwells and total(-most) <= 0.0 <= total(most):
            more = float(brentq(total, -most, most, xtol=1e-14))
        found = self._rounded(np.clip(self.start + more, self.low, self.high))
        if not self.possible(found):
            raise ConfigError(
                "limits on event_angle: no spans of events keep them and the dwells; allowed: "
                "looser limits"
            )
        return found

    def _rounded(self, spans: FloatArray) -> FloatArray:
        """As a file has them; the last one is what the others leave where dwells stay."""
        step = np.radians(STEP_DEG)
        found = step * np.rint(spans / step)
        if self.keep_dwells:
            found[-1] = self.start.sum() - found[:-1].sum()
        return np.asarray(found)

    def possible(self, spans: FloatArray) -> bool:
        """Whether limits and dwells leave these spans (rad)."""
        slack = np.radians(STEP_DEG)
        if (spans < self.low - slack).any() or (spans > self.high + slack).any():
            return False
        rests = np.diff(self._edges(spans))[::2]
        return self.keep_dwells or bool((rests >= np.where(self._rests, LEAST_DWELL, 0.0)).all())

    @property
    def _rests(self) -> FloatArray:
        """The dwells (rad) before, between and behind the events."""
        return np.diff(self._edges(self.start))[::2]

    def _edges(self, spans: FloatArray) -> FloatArray:
        """The turn's start, both ends of each event in turn, and the turn's end (rad)."""
        events = self.problem.space.events
        begin = np.array([event.start for event in events])
        if self.keep_dwells:
            begin = begin + np.concatenate([[0.0], np.cumsum(spans - self.start)[:-1]])
        else:
            begin = begin + self._before * (self.start - spans)
        ends = np.stack([begin, begin + spans], axis=1).ravel()
        return np.concatenate([[0.0], ends, [TURN]])

    @cached_property
    def _before(self) -> FloatArray:
        """What part of an event's growth is before it: half, and none at the turn's ends."""
        events = self.problem.space.events
        before = np.full(len(events), 0.5)
        if events[0].start == 0.0:
            before[0] = 0.0
        if events[-1].start + events[-1].span == TURN:
            before[-1] = 1.0
        return before

    def moved(self, spans: FloatArray) -> DesignProblem:
        """The problem with these spans."""
        law = retimed(self.problem.start, self.problem.space.events, self._edges(spans))
        space = Space(law, self.problem.space.law_class)
        free = ("events",) if self.keep_dwells else ("events", "dwells")
        return replace(self.problem, start=law, space=space, free=free)

    def _value(self, unknowns: FloatArray) -> float:
        """What is to be small; infinite where no law was found."""
        spans = self._rounded(np.append(unknowns, 0.0) if self.keep_dwells else unknowns)
        key = tuple(spans.tolist())
        if key not in self._known:
            self._known[key] = np.inf
            if self.possible(spans):
                try:
                    self._known[key] = self.value(self.moved(spans))
                except DesignError as error:  # no law at these spans; at others there may be
                    self._why = str(error)
                    return np.inf
        return self._known[key]

    def best(self, asked: Multistart) -> tuple[DesignProblem, Multistart]:
        """The problem with the best spans, and how many of the searches came to the same.

        Raises
        ------
        DesignError : no spans have a law that keeps the limits
        """
        size = self._size
        bounds = list(zip(self.low[:size], self.high[:size], strict=True))
        found = []
        for place in self._places(asked):
            first = self._value(place)
            if np.isfinite(first):
                end = minimize(
                    self._value,
                    place,
                    method="Nelder-Mead",
                    bounds=bounds,
                    options={
                        "xatol": NEAR,
                        "fatol": LEVEL * abs(first),
                        "maxfev": DESIGNS * size,
                    },
                )
                found.append((float(end.fun), end.x))
        if not found:
            raise DesignError(
                f"no spans of events that were tried have a law; of the last: {self._why}"
            )
        value, unknowns = min(found, key=lambda pair: pair[0])
        near = sum(other <= value + SAME * abs(value) for other, _ in found)
        spans = self._rounded(np.append(unknowns, 0.0) if self.keep_dwells else unknowns)
        return self.moved(spans), replace(asked, near=near)

    def _places(self, asked: Multistart) -> Iterator[FloatArray]:
        """Unknowns to begin from: spans nearest to the start's, and random ones that have a law."""
        random, size = np.random.default_rng(asked.seed), self._size
        yield self.base[:size]
        for _ in range(asked.starts - 1):
            way = random.uniform(self.low, self.high) - self.base
            if self.keep_dwells:
                way -= way.mean()
            while not self.possible(place := self._rounded(self.base + way)):
                way *= 0.7
            for _ in range(NEARER):
                if np.isfinite(self._value(place[:size])):
                    break
                way *= 0.5
                place = self._rounded(self.base + way)
            yield place[:size]

    @property
    def _size(self) -> int:
        """How many spans are unknown: where dwells stay the last is what the others leave."""
        return self.start.size - (1 if self.keep_dwells else 0)
