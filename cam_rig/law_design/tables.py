"""A design as a table, and as JSON."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

from cam_rig.law_design.convex_program import BOX
from cam_rig.law_design.request import DesignRequest, Multistart
from cam_rig.law_design.space import LawEvent
from cam_rig.law_design.terms import Sense, Term
from cam_rig.laws import Law
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.show.tables import Cell, DataTable, Head
from cam_rig.units import TURN

# A designed law: beside its start, with what was asked of it, and the bound where there is one.

#: A result within this part of its bound is called certified.
CERTIFIED = 2e-3


@dataclass(frozen=True)
class Measure:
    """A goal or a limit of a design, SI (dB for levels).

    ``bound`` is what no law of the class passes, for the goal alone; ``limit`` for limits alone.
    """

    term: Term
    sense: Sense
    start: float
    result: float
    bound: float | None = None
    limit: float | None = None
    active: bool = False


@dataclass(frozen=True, eq=False)
class LawDesign:
    """The best law found, its cam and file; ``measures`` has the goal first.

    ``tops`` are the cam angles (rad) within events where start and law reach their lift;
    ``rounds`` is how many programs were solved; ``multistart`` is of a design that is not convex,
    which has no bound, and ``spans_bound`` of one whose events have other spans: what no law with
    just these spans passes. One whose search was interrupted is not ``ended``.
    """

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
    ended: bool = True

    @property
    def goal(self) -> Measure:
        """The goal's."""
        return self.measures[0]

    @property
    def gap(self) -> float:
        """How far the result is from its bound, in parts of it; of a level, of its pressure.

        Infinite where there is no bound.
        """
        if self.goal.bound is None:
            return math.inf
        if self.goal.term.name == "sound_level_rigid":
            return float(10.0 ** (abs(self.goal.result - self.goal.bound) / 20.0) - 1.0)
        size = max(abs(self.goal.bound), 1e-300)
        return abs(self.goal.result - self.goal.bound) / size

    @property
    def certified(self) -> bool:
        """Whether the bound proves that little could be better."""
        return self.gap <= CERTIFIED


#: A start breaks a limit that it is over by more than this part of.
OVER = 1e-6


def design_table(design: LawDesign) -> DataTable:
    """The goal and the limits: start, result, bound, which limits are active."""
    columns = (
        Head("", ""),
        Head("unit"),
        Head("start", shown=".5g"),
        Head("result", shown=".5g"),
        Head("bound", shown=".5g", missing="–"),
        Head("limit", missing="–"),
        Head("active"),
    )
    rows: list[tuple[Cell, ...]] = [_row(design, measure) for measure in design.measures]
    notes = (
        f"start: {design.start.name}; class: {design.request.law_class.words}, with "
        f"{kept(design)} of the start; no ordinate beyond {BOX:g} lifts",
        verdict(design),
        *_start_breaks(design),
        *_start_better(design),
    )
    return DataTable(
        f"Design on rig {design.rig.name}: {design.request.words}", columns, tuple(rows), notes
    )


def kept(design: LawDesign) -> str:
    """What a class has of its start."""
    angles = " and ".join(f"{math.degrees(angle):.4g}°" for angle in design.tops)
    kept = " and ".join(what for what in design.request.keep if what != "events")
    return kept + (f", reached at {angles}," if angles else "")


def _start_better(design: LawDesign) -> list[str]:
    """A line where the start, which need not be of the class, is better than what was found."""
    goal = design.goal
    sign = 1.0 if goal.sense == "<=" else -1.0
    worse = math.isfinite(goal.start) and sign * (goal.result - goal.start) > 0.0
    if not worse or _start_breaks(design):
        return []
    if goal.bound is not None and sign * (goal.bound - goal.start) > 0.0:
        return ["the start is better than any law of this class: more pieces have more"]
    more = "more pieces" if design.multistart is None else "more pieces, or more starts,"
    return [f"the start is better than the law found: {more} may have more"]


def _start_breaks(design: LawDesign) -> list[str]:
    """A line with the limits that the start, which may, does not keep."""
    broken = [
        f"{x.term.words} {'≤' if x.sense == '<=' else '≥'} {_shown(x.limit, x.term)}"
        for x in design.measures[1:]
        if x.limit is not None
        and (x.start - x.limit) * (1.0 if x.sense == "<=" else -1.0) > OVER * abs(x.limit)
    ]
    return [f"the start breaks {' and '.join(broken)}"] if broken else []


def _shown(value: float, term: Term) -> str:
    return f"{value / term.quantity.shown:.5g} {in_words(term)}"


def in_words(term: Term) -> str:
    """The unit of a quantity as a table shows it."""
    unit = term.quantity.unit
    return {"deg": "°", "um": "µm"}.get(
        unit, unit.replace("^2", "²").replace("^3", "³").replace("*", "·")
    )


def _row(design: LawDesign, measure: Measure) -> tuple[Cell, ...]:
    unit, factor = in_words(measure.term), measure.term.quantity.shown
    limit: Cell = None
    if measure.limit is not None:
        sign = "≤" if measure.sense == "<=" else "≥"
        limit = f"{sign} {measure.limit / factor:.5g}"
    return (
        measure.term.words,
        unit,
        measure.start / factor,
        measure.result / factor,
        None if measure.bound is None else measure.bound / factor,
        limit,
        "yes" if measure.active else "",
    )


def verdict(design: LawDesign) -> str:
    """What the bound proves, in a line."""
    goal = design.goal
    if not design.ended:
        return "interrupted: the best law so far, without a bound"
    if goal.bound is None:
        assert design.multistart is not None
        return f"{design.multistart.words}; {_other_spans(design)}"
    factor, unit = goal.term.quantity.shown, in_words(goal.term)
    side = "below" if goal.sense == "<=" else "above"
    gap = f"{100.0 * design.gap:.2g} % from it"
    proof = "certified" if design.certified else "not certified"
    return f"no law of the class is {side} {goal.bound / factor:.5g} {unit}; {proof}: {gap}"


def _other_spans(design: LawDesign) -> str:
    """What is known of better laws where there is no bound for all of them."""
    if design.spans_bound is None:
        return "no bound: another law may be better"
    shown = design.spans_bound / design.goal.term.quantity.shown
    side = "below" if design.goal.sense == "<=" else "above"
    return (
        f"at these events no law is {side} {shown:.5g} {in_words(design.goal.term)}, at others one "
        "may be"
    )


def _si(term: Term) -> str:
    """The unit of a quantity's numbers."""
    return next(unit for unit, factor in term.quantity.units.items() if factor == 1.0)


def to_json(design: LawDesign) -> dict[str, Any]:
    """Everything of a design that is a number, in SI; levels in dB."""
    own = design.request.law_class
    return {
        "cam": design.cam.name,
        "start": design.start.name,
        "rig": design.rig.name,
        design.request.verb: design.goal.term.key,
        "class": {"pieces": own.pieces, "joints": own.joints, "degree": own.power},
        "ended": design.ended,
        "certified": design.certified,
        "gap": None if design.goal.bound is None else design.gap,
        "local": None if design.multistart is None else asdict(design.multistart),
        "bound_at_these_events": design.spans_bound,
        "programs": design.rounds,
        "measures": [
            {
                "quantity": measure.term.key,
                "unit": _si(measure.term),
                "start": measure.start,
                "result": measure.result,
                "bound": measure.bound,
                "limit": measure.limit,
                "active": measure.active,
            }
            for measure in design.measures
        ],
        "events_deg": [
            {"start": event.start * 360.0 / TURN, "span": event.span * 360.0 / TURN}
            for event in design.events
        ],
    }
