"""Results of designs: a law with its bound and cam file, and a Pareto front."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from cam_rig.laws import Law
from cam_rig.quantities.terms import Sense, Term, sign_of
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.schema.load import file_data, quantity_data, to_yaml, validate_cam
from cam_rig.show.result import (
    Column,
    Records,
    Result,
    subject_line,
)
from cam_rig.studies.design.convex_program import MAX_ORDINATE
from cam_rig.studies.design.request import DesignRequest, Multistart
from cam_rig.studies.design.space import DesignProblem, LawEvent, ScaledLimit
from cam_rig.units import TURN, FloatArray

#: Largest relative gap between the goal of a law and the proved bound of its class at which the
#: design is reported as certified.
CERTIFIED_RTOL = 2e-3
#: Relative excess of the start law over a limit above which a note reports that it violates the
#: limit.
EXCESS_RTOL = 1e-6


@dataclass(frozen=True)
class Measure:
    """Goal or limit of a design with its values, in SI (levels in dB).

    ``start`` and ``result`` are the values of the start law and of the designed law. ``bound`` is
    the proved bound of a goal, or None. ``limit`` is the value of a limit, None for a goal.
    ``active`` is True if the designed law reaches the limit.
    """

    term: Term
    sense: Sense
    start: float
    result: float
    bound: float | None = None
    limit: float | None = None
    active: bool = False

    def in_table_unit(self, value: float | None) -> float | None:
        """Convert a value from SI to the unit that tables use, or return None for None."""
        return None if value is None else value / self.term.quantity.factor

    @property
    def limit_text(self) -> str:
        """Value of the limit as text for tables, empty for a goal."""
        sign = "≤" if self.sense == "<=" else "≥"
        return "" if self.limit is None else f"{sign} {self.in_table_unit(self.limit):.5g}"


def _value_column(key: str, **how: str) -> Column:
    def cell(measure: Measure) -> float | None:
        return measure.in_table_unit(getattr(measure, key))

    return Column(key, "", ".5g", cell=cell, **how)  # type: ignore[arg-type]


@dataclass(frozen=True, eq=False, repr=False)
class LawDesign(Result):
    """Best law of a design, with its cam and the text of its cam file.

    An event is the motion between two dwells.

    Attributes
    ----------
    request : DesignRequest
        Goal, limits, class of laws and search options.
    start, law : Law
        Start law of the design, and the designed law.
    cam, text : CamConfig, str
        Designed cam, and the content of its file.
    rig : RigConfig
        Rig for which the law was designed.
    events : tuple of LawEvent
        Events of the law, which are the stretches between dwells.
    tops : tuple of float
        Cam angles (rad) inside events at which the law reaches the extreme lift of the start law.
    measures : tuple of Measure
        Goal first, then the limits.
    rounds : int
        Number of solved convex programs.
    multistart : Multistart or None
        Local search from several start laws. None for a convex design.
    spans_bound : float or None
        Bound for laws with the spans of this law, if the spans of the events were searched for.
    interrupted : bool
        True if the search was interrupted. The law is then without a bound.
    """

    schema = "cam_rig.design.1"
    plot_function = "cam_rig.studies.design.figures:figure"
    columns: ClassVar = {
        "measures": (
            Column("quantity", of="term.key", cell=lambda m: m.term.words),
            Column("unit", of="term.quantity.si", cell=lambda m: m.term.quantity.typeset),
            _value_column("start"),
            _value_column("result"),
            _value_column("bound", missing="–"),
            Column("limit", cell=lambda m: m.limit_text or None, missing="–"),
            Column("active", cell=lambda m: "yes" if m.active else ""),
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
            Column("certified", doc="true if the gap is at most 0.2 %"),
            Column("gap", doc="relative distance to the bound"),
            Column("starts", of="multistart.starts"),
            Column("seed", of="multistart.seed"),
            Column(
                "starts_agreeing",
                of="multistart.starts_agreeing",
                doc="number of starts with the same result",
            ),
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
    def subject(self) -> str:
        """Start and rig. The quantities of a design name their models."""
        return subject_line([self.start.name], self.rig.name)

    @property
    def goal(self) -> Measure:
        """Goal with its values for the start law and the designed law, and its bound."""
        return self.measures[0]

    @property
    def gap(self) -> float:
        """Relative distance between the goal of the designed law and its proved bound.

        It is infinite without a bound. For a sound level (dB) it is the relative distance of the
        sound pressures.
        """
        goal = self.goal
        if goal.bound is None:
            return math.inf
        if goal.term.quantity.unit == "dB":
            return float(10.0 ** (abs(goal.result - goal.bound) / 20.0) - 1.0)
        return abs(goal.result - goal.bound) / max(abs(goal.bound), 1e-300)

    @property
    def certified(self) -> bool:
        """True if the bound proves that no law is better by more than 0.2 %."""
        return self.gap <= CERTIFIED_RTOL

    def tables(self) -> list[Records]:
        """Return the tables ``measures``, ``events`` and ``design`` of the result.

        ``measures`` has one row per goal and limit, with the goal first. ``events`` has one row per
        event (motion between two dwells), and ``design`` a single row with the options and the
        outcome. The last two are written to files only.
        """
        angles = " and ".join(f"{math.degrees(angle):.4g}°" for angle in self.tops)
        kept_parts = " and ".join(what for what in self.request.keep if what != "events")
        kept_parts += f", reached at {angles}," if angles else ""
        notes = (
            f"start: {self.start.name}; class: {self.request.law_class.words}, with {kept_parts} "
            f"of the start; no ordinate beyond {MAX_ORDINATE:g} lifts",
            self._bound_line(),
            *self._compare_start(),
        )
        caption = f"Design on rig {self.rig.name}: {self.request.words}"
        return [
            self.table("measures", caption, self.measures, *notes),
            self.table("events", "Events", self.events, hidden=True),
            self.table("design", "Design", [self], single=True, hidden=True),
        ]

    def _compare_start(self) -> list[str]:
        """Return a note if the start law breaks a limit or is better than the result.

        Both are possible, because the start law need not belong to the class of laws. Otherwise the
        list is empty.
        """
        broken = [
            f"{x.term.words} {x.limit_text} {x.term.quantity.typeset}"
            for x in self.measures[1:]
            if x.limit is not None
            and (x.start - x.limit) * sign_of(x.sense) > EXCESS_RTOL * abs(x.limit)
        ]
        if broken:
            return [f"the start breaks {' and '.join(broken)}"]
        goal, sign = self.goal, sign_of(self.goal.sense)
        if not (math.isfinite(goal.start) and sign * (goal.result - goal.start) > 0.0):
            return []
        if goal.bound is not None and sign * (goal.bound - goal.start) > 0.0:
            return ["the start is better than any law of this class: use more pieces"]
        more = "more pieces" if self.multistart is None else "more pieces or more starts"
        return [f"the start is better than the law found: use {more}"]

    def _bound_line(self) -> str:
        """Return a line of text on the bound of the goal, and whether it is certified."""
        goal, search = self.goal, self.multistart
        if self.interrupted:
            return "interrupted: the best law so far, without a bound"
        bound = self.spans_bound if goal.bound is None else goal.bound
        if bound is None:
            assert search is not None  # a design without a bound is from a local search
            return f"{search.words}; no bound: another law may be better"
        limit_text = f"{'below' if goal.sense == '<=' else 'above'} {goal.in_table_unit(bound):.5g}"
        limit_text += f" {goal.term.quantity.typeset}"
        if goal.bound is None:
            assert search is not None
            return f"{search.words}; at these events no law is {limit_text}, at others one may be"
        proof = "certified" if self.certified else "not certified"
        return f"no law of the class is {limit_text}; {proof}: {100.0 * self.gap:.2g} % from it"


def _certified_text(design: LawDesign) -> str:
    if design.goal.bound is None:
        return "local"
    return "yes" if design.certified else "no"


@dataclass(frozen=True, repr=False)
class Front(Result):
    """Pareto front: the best designs for each allowed value of another quantity.

    ``other`` is the other quantity, and ``allowed`` ``(n,)`` its values in SI (levels in dB). They
    are ordered from its best value, or from the shortest span of an event. An interrupted front has
    fewer ``designs`` than ``requested_points``. An event is the motion between two dwells.
    """

    schema = "cam_rig.front.1"
    plot_function = "cam_rig.studies.design.figures:front_figure"
    columns: ClassVar = {
        "front": (
            Column("allowed", "", ".5g", doc="of the other quantity, SI", of="0"),
            Column("result", "", ".5g", doc="of the goal, SI", of="1.goal.result"),
            Column("bound", "", ".5g", of="1.goal.bound", missing="–"),
            Column("certified", of="1.certified", cell=lambda row: _certified_text(row[1])),
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
    requested_points: int
    interrupted: bool = False

    @property
    def subject(self) -> str:
        """Start and rig."""
        return self.designs[0].subject

    def tables(self) -> list[Records]:
        """Return the tables ``front`` (one row per point) and ``quantities``.

        The latter contains the names and units of the goal and of the other quantity.
        """
        goal = self.designs[0].goal.term

        def in_unit(column: Column, heading: str, term: Term) -> Column:
            def cell(row: Any) -> float | None:
                value = column.value(row)
                return None if value is None else value / term.quantity.factor

            return replace(column, heading=heading, unit=term.quantity.typeset, cell=cell)

        allowed, result, bound, certified = self.columns["front"]
        front_columns = (in_unit(allowed, self.other.words, self.other), in_unit(result, "", goal))
        columns = (*front_columns, in_unit(bound, "", goal), certified)
        rows = tuple(zip(self.allowed, self.designs, strict=True))
        caption = f"{goal.words} against {self.other.words}"
        front = Records("front", caption, columns, rows)
        return [front, self.table("quantities", "Quantities", [self], single=True, hidden=True)]

    def summary(self) -> list[str]:
        """Return a line with the number of computed points if the front is incomplete.

        The list is empty for a complete front.
        """
        text = f"interrupted: {len(self.designs)} of {self.requested_points} points"
        return [text] if self.interrupted else []


# Cam file of the designed law, with the dwells of the start law and a B-spline in each event.

#: Largest relative difference between the lift of a law and that of its file that counts as
#: rounding.
LIFT_RTOL = 1e-12


def designed_cam(
    problem: DesignProblem,
    unknowns: FloatArray,
    name: str,
    request: DesignRequest,
    limits: list[ScaledLimit],
    search: Multistart | None = None,
) -> tuple[CamConfig, str]:
    """Return the cam of a designed law, and the text of its cam file.

    ``unknowns`` describe the law. ``search`` are the options and the outcome of a local search,
    None for a convex program. ``request`` is the request of the design, and ``limits`` are its
    limits with values.
    """
    cam, space = problem.cam, problem.space
    law_class, goal = space.law_class, f"{request.verb} {request.goal.key}"
    knots = np.rint(law_class.knots[1:-1] * law_class.pieces).astype(int).tolist()
    source = f"designed to {goal} on rig {problem.rig.name}"
    splines = []
    for index in range(len(space.events)):
        ordinates = (space.coefficients(index)(unknowns) / space.start.lift).tolist()
        spline = {
            "degree": law_class.power,
            "knots": quantity_data("assumed", knots, "1", f"{law_class.pieces} equal pieces"),
            "ordinates": quantity_data("identified", ordinates, "1", source),
        }
        splines.append(spline)
    heading = "The law of its class that is best"
    if search is not None:
        heading = f"The best law found, seed {search.seed}, {search.words}, without a bound,"
    fixed_parts = [part for part in ("dwells", "events") if part not in problem.free]
    origin = f"{' and '.join(fixed_parts)} are" if fixed_parts else "the lift is"
    header = [
        f"# {heading} by this goal: {goal}.",
        f"# Start: {cam.name}; rig: {problem.rig.name}; {law_class.words}.",
        *(f"# Limit: {limit.name}." for limit in limits),
        f"# Made by cam-rig design; {origin} the start's.",
    ]
    title = f"{cam.title}, designed"
    data = spline_cam_data(cam, space.start, space.events, splines, name, title, problem.free)
    return validate_cam(data), "\n".join(header) + "\n" + to_yaml(data)


def spline_cam_data(
    cam: CamConfig,
    start: Law,
    events: list[LawEvent],
    splines: list[dict[str, Any]],
    name: str,
    title: str,
    free: tuple[str, ...] = (),
) -> dict[str, Any]:
    """Return the content of the file of a cam with a B-spline in each event.

    An event is the motion between two dwells.

    Parameters
    ----------
    cam : CamConfig
        Cam from which the follower and the lift are taken.
    start : Law
        Law of ``cam``.
    events : list of LawEvent
        Start and span of each event. The remaining angles become dwells.
    splines : list of dict
        Degree, knots and ordinates (in lifts) of each event, as in a cam file.
    name, title : str
        Name and title of the new cam.
    free : tuple of str, optional
        Which of ``dwells`` and ``events`` have other spans than those of ``cam`` (default:
        neither).

    Returns
    -------
    dict
        Content of the cam file.
    """
    data = file_data(cam)
    sections = {key: data[key] for key in ("follower", "contact") if key in data}
    file_lift = cam.lift
    lift = quantity_data(
        file_lift.origin,
        file_lift.numbers[0],
        file_lift.unit,
        f"as {cam.name}: {file_lift.source}",
        file_lift.residual,
    )
    # for example, if the law has errors of the profile
    if abs(file_lift.si - start.lift) > LIFT_RTOL * start.lift:
        lift = quantity_data("assumed", start.lift * 1e3, "mm", f"that of the law of {cam.name}")
    head = {"name": name, "title": title, "lift": lift}
    return head | sections | {"segments": _segments(cam, events, splines, free)}


def _segments(
    cam: CamConfig, events: list[LawEvent], splines: list[dict[str, Any]], free: tuple[str, ...]
) -> list[dict[str, Any]]:
    def span(angle: float, what: str) -> dict[str, Any]:
        origins = ("identified", "found with the law"), ("assumed", f"that of {cam.name}")
        kind, source = origins[what not in free]
        return quantity_data(kind, round(math.degrees(angle), 10), "deg", source)

    def dwell(start: float, end: float) -> list[dict[str, Any]]:
        return [{"law": "dwell", "span": span(end - start, "dwells")}] if end > start else []

    segments, position = [], 0.0
    for event, spline in zip(events, splines, strict=True):
        segments += dwell(position, event.start)
        position = event.start + event.span
        segments.append({"law": "b_spline", "span": span(event.span, "events"), **spline})
    return segments + dwell(position, TURN)
