"""What a design gives: the law beside its start, its bound and its cam file; a front of designs."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from cam_rig.laws import Law
from cam_rig.quantities.terms import Sense, Term, sign_of
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.schema.load import file_data, quantity, to_yaml, valid_cam
from cam_rig.show.result import Column, Records, Result
from cam_rig.studies.design.convex_program import BOX
from cam_rig.studies.design.request import DesignRequest, Multistart
from cam_rig.studies.design.space import Asked, DesignProblem, LawEvent
from cam_rig.units import TURN, FloatArray

#: A result within this part of its bound is called certified.
CERTIFIED = 2e-3
#: A start breaks a limit that it is over by more than this part of.
OVER = 1e-6


@dataclass(frozen=True)
class Measure:
    """A goal, with what no law of the class passes, or a limit of a design, SI (dB for levels)."""

    term: Term
    sense: Sense
    start: float
    result: float
    bound: float | None = None
    limit: float | None = None
    active: bool = False

    def shown(self, value: float | None) -> float | None:
        """A value in the unit of tables."""
        return None if value is None else value / self.term.quantity.factor

    @property
    def kept(self) -> str:
        """The limit as a table says it; empty for a goal."""
        sign = "≤" if self.sense == "<=" else "≥"
        return "" if self.limit is None else f"{sign} {self.shown(self.limit):.5g}"


def _shown(key: str, **how: str) -> Column:
    def cell(measure: Measure) -> float | None:
        return measure.shown(getattr(measure, key))

    return Column(key, "", ".5g", cell=cell, **how)  # type: ignore[arg-type]


@dataclass(frozen=True, eq=False, repr=False)
class LawDesign(Result):
    """The best law found: ``law``, ``cam``, the ``text`` of its file, and ``measures``, goal first.

    ``tops`` are the cam angles (rad) within events where start and law reach their lift;
    ``rounds`` is how many programs were solved; ``multistart`` is of a design that is not convex,
    which has no bound, and ``spans_bound`` of one whose events have other spans: what no law with
    just these spans passes.
    """

    schema = "cam_rig.design.1"
    plot_function = "cam_rig.studies.design.figures:figure"
    columns: ClassVar = {
        "measures": (
            Column("quantity", of="term.key", cell=lambda one: one.term.words),
            Column("unit", of="term.quantity.si", cell=lambda one: one.term.quantity.typeset),
            _shown("start"),
            _shown("result"),
            _shown("bound", missing="–"),
            Column("limit", cell=lambda one: one.kept or None, missing="–"),
            Column("active", cell=lambda one: "yes" if one.active else ""),
        ),
        "events": (Column("start", "°", ".6g"), Column("span", "°", ".6g")),
        "design": (
            Column("cam", of="cam.name"),
            Column("start", of="start.name"),
            Column("rig", of="rig.name"),
            Column("verb", of="request.verb", doc="minimise or maximise"),
            Column("goal", of="goal.term.key"),
            Column("pieces", of="request.law_class.pieces", doc="of each event"),
            Column("joints", of="request.law_class.joints", doc="continuous derivatives"),
            Column("degree", of="request.law_class.power"),
            Column("interrupted"),
            Column("certified", doc="whether the gap is at most 0.2 %"),
            Column("gap", doc="to the bound, in parts of it"),
            Column("starts", of="multistart.starts"),
            Column("seed", of="multistart.seed"),
            Column("near", of="multistart.near", doc="how many starts came to the same"),
            Column("bound_at_these_events", of="spans_bound"),
            Column("programs", of="rounds", doc="solved"),
        ),
    }

    request: DesignRequest
    start: Law
    law: Law
    cam: CamConfig
    text: str
    rig: RigConfig
    events: tuple[LawEvent, ...]
    tops: tuple[float, ...]
    measures: tuple[Measure, ...]
    rounds: int
    multistart: Multistart | None = None
    spans_bound: float | None = None
    interrupted: bool = False

    @property
    def goal(self) -> Measure:
        """The goal's."""
        return self.measures[0]

    @property
    def gap(self) -> float:
        """How far the result is from its bound, in parts of it; of a level in pressure; else ∞."""
        goal = self.goal
        if goal.bound is None:
            return math.inf
        if goal.term.quantity.unit == "dB":
            return float(10.0 ** (abs(goal.result - goal.bound) / 20.0) - 1.0)
        return abs(goal.result - goal.bound) / max(abs(goal.bound), 1e-300)

    @property
    def certified(self) -> bool:
        """Whether the bound proves that little could be better."""
        return self.gap <= CERTIFIED

    def tables(self) -> list[Records]:
        """``measures``, a row for the goal and for each limit, ``events``, and ``design``."""
        angles = " and ".join(f"{math.degrees(angle):.4g}°" for angle in self.tops)
        kept = " and ".join(what for what in self.request.keep if what != "events")
        kept += f", reached at {angles}," if angles else ""
        notes = (
            f"start: {self.start.name}; class: {self.request.law_class.words}, with {kept} of the "
            f"start; no ordinate beyond {BOX:g} lifts",
            self._bound_line(),
            *self._start_beside(),
        )
        caption = f"Design on rig {self.rig.name}: {self.request.words}"
        return [
            self.table("measures", caption, self.measures, *notes),
            self.table("events", "Events", self.events, hidden=True),
            self.table("design", "Design", [self], single=True, hidden=True),
        ]

    def _start_beside(self) -> list[str]:
        """Lines where the start, which need not be of the class, breaks limits, or is better."""
        broken = [
            f"{x.term.words} {x.kept} {x.term.quantity.typeset}"
            for x in self.measures[1:]
            if x.limit is not None and (x.start - x.limit) * sign_of(x.sense) > OVER * abs(x.limit)
        ]
        if broken:
            return [f"the start breaks {' and '.join(broken)}"]
        goal, sign = self.goal, sign_of(self.goal.sense)
        if not (math.isfinite(goal.start) and sign * (goal.result - goal.start) > 0.0):
            return []
        if goal.bound is not None and sign * (goal.bound - goal.start) > 0.0:
            return ["the start is better than any law of this class: more pieces have more"]
        more = "more pieces" if self.multistart is None else "more pieces, or more starts,"
        return [f"the start is better than the law found: {more} may have more"]

    def _bound_line(self) -> str:
        """What the bound proves, in a line."""
        goal, several = self.goal, self.multistart
        if self.interrupted:
            return "interrupted: the best law so far, without a bound"
        bound = self.spans_bound if goal.bound is None else goal.bound
        if bound is None:
            assert several is not None  # what is local has one
            return f"{several.words}; no bound: another law may be better"
        passed = f"{'below' if goal.sense == '<=' else 'above'} {goal.shown(bound):.5g}"
        passed += f" {goal.term.quantity.typeset}"
        if goal.bound is None:
            assert several is not None
            return f"{several.words}; at these events no law is {passed}, at others one may be"
        proof = "certified" if self.certified else "not certified"
        return f"no law of the class is {passed}; {proof}: {100.0 * self.gap:.2g} % from it"


def _certified(found: LawDesign) -> str:
    if found.goal.bound is None:
        return "local"
    return "yes" if found.certified else "no"


@dataclass(frozen=True, repr=False)
class Front(Result):
    """Designs by rising values of the other quantity: ``allowed`` ``(n,)``, SI (dB for levels)."""

    schema = "cam_rig.front.1"
    plot_function = "cam_rig.studies.design.figures:front_figure"
    columns: ClassVar = {
        "front": (
            Column("allowed", "", ".5g", doc="of the other quantity, SI", of="0"),
            Column("result", "", ".5g", doc="of the goal, SI", of="1.goal.result"),
            Column("bound", "", ".5g", of="1.goal.bound", missing="–"),
            Column("certified", of="1.certified", cell=lambda row: _certified(row[1])),
        ),
        "quantities": (
            Column("goal", of="designs.0.goal.term.key"),
            Column("goal_unit", of="designs.0.goal.term.quantity.si"),
            Column("other", of="other.key"),
            Column("other_unit", of="other.quantity.si"),
        ),
    }

    other: Term
    allowed: tuple[float, ...]
    designs: tuple[LawDesign, ...]
    asked: int
    interrupted: bool = False

    def tables(self) -> list[Records]:
        """``front``, a row a point, and what its columns are."""
        goal = self.designs[0].goal.term

        def named(column: Column, words: str, term: Term) -> Column:
            def cell(row: Any) -> float | None:
                value = column.value(row)
                return None if value is None else value / term.quantity.factor

            return replace(column, heading=words, unit=term.quantity.typeset, cell=cell)

        allowed, result, bound, certified = self.columns["front"]
        shown = (named(allowed, self.other.words, self.other), named(result, "", goal))
        columns = (*shown, named(bound, "", goal), certified)
        rows = tuple(zip(self.allowed, self.designs, strict=True))
        caption = f"{goal.words} against {self.other.words}"
        front = Records("front", caption, columns, rows)
        return [front, self.table("quantities", "Quantities", [self], single=True, hidden=True)]

    def summary(self) -> list[str]:
        """How far it came where it was interrupted."""
        words = f"interrupted: {len(self.designs)} of {self.asked} points"
        return [words] if self.interrupted else []


# The designed law as a cam file: B-splines between the dwells of its start.

#: A law's lift is its file's where they differ by no more than this part.
SAME = 1e-12


def designed_cam(
    problem: DesignProblem,
    unknowns: FloatArray,
    name: str,
    request: DesignRequest,
    limits: list[Asked],
    search: Multistart | None = None,
) -> tuple[CamConfig, str]:
    """The cam of some unknowns, and its file; ``search`` is of what is local."""
    cam, space = problem.cam, problem.space
    own, goal = space.law_class, f"{request.verb} {request.goal.key}"
    knots = np.rint(own.knots[1:-1] * own.pieces).astype(int).tolist()
    source = f"designed to {goal} on rig {problem.rig.name}"
    splines = []
    for index in range(len(space.events)):
        ordinates = (space.coefficients(index)(unknowns) / space.start.lift).tolist()
        spline = {
            "degree": own.power,
            "knots": quantity("assumed", knots, "1", f"{own.pieces} equal pieces"),
            "ordinates": quantity("identified", ordinates, "1", source),
        }
        splines.append(spline)
    found = "The law of its class that is best"
    if search is not None:
        found = f"The best law found, seed {search.seed}, {search.words}, without a bound,"
    kept = " and ".join(what for what in ("dwells", "events") if what not in problem.free)
    header = [
        f"# {found} by this goal: {goal}.",
        f"# Start: {cam.name}; rig: {problem.rig.name}; {own.words}.",
        *(f"# Limit: {limit.name}." for limit in limits),
        f"# Made by cam-rig design; {kept + ' are' if kept else 'the lift is'} the start's.",
    ]
    title = f"{cam.title}, designed"
    data = spline_cam_data(cam, space.start, space.events, splines, name, title, problem.free)
    return valid_cam(data), "\n".join(header) + "\n" + to_yaml(data)


def spline_cam_data(
    cam: CamConfig,
    start: Law,
    events: list[LawEvent],
    splines: list[dict[str, Any]],
    name: str,
    title: str,
    free: tuple[str, ...] = (),
) -> dict[str, Any]:
    """The content of the file of a B-spline in each event, with dwells between them.

    ``cam`` and its law ``start`` give follower and lift; ``splines`` of each event degree, knots
    and ordinates in lifts, as a file has them; ``free`` is what of dwells and events is elsewhere.
    """
    data = file_data(cam)
    parts = {key: data[key] for key in ("follower", "contact") if key in data}
    own = cam.lift
    lift = quantity(
        own.origin, own.numbers[0], own.unit, f"as {cam.name}: {own.source}", own.residual
    )
    if abs(own.si - start.lift) > SAME * start.lift:  # a law may have another than its file's
        lift = quantity("assumed", start.lift * 1e3, "mm", f"that of the law of {cam.name}")
    head = {"name": name, "title": title, "lift": lift}
    return head | parts | {"segments": _segments(cam, events, splines, free)}


def _segments(
    cam: CamConfig, events: list[LawEvent], splines: list[dict[str, Any]], free: tuple[str, ...]
) -> list[dict[str, Any]]:
    def span(angle: float, what: str) -> dict[str, Any]:
        found = ("identified", "found with the law"), ("assumed", f"that of {cam.name}")
        kind, source = found[what not in free]
        return quantity(kind, round(math.degrees(angle), 10), "deg", source)

    def dwell(start: float, end: float) -> list[dict[str, Any]]:
        return [{"law": "dwell", "span": span(end - start, "dwells")}] if end > start else []

    found, at = [], 0.0
    for event, spline in zip(events, splines, strict=True):
        found += dwell(at, event.start)
        at = event.start + event.span
        found.append({"law": "b_spline", "span": span(event.span, "events"), **spline})
    return found + dwell(at, TURN)
