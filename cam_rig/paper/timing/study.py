"""Cams by their events and by the ordinates that move these; the result of cam-rig timing."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cam_rig.arguments import checked
from cam_rig.laws import Law, build_law
from cam_rig.laws.cam import law_of
from cam_rig.paper.timing.events import (
    LEVELS,
    REACHED,
    Ordinates,
    TimedEvent,
    events,
    ordinates_of,
    shift_matrix,
    with_same_events,
)
from cam_rig.schema import CamConfig
from cam_rig.schema.segments import Bezier
from cam_rig.show.result import Column, Records, Result
from cam_rig.simulation.asked import Cams, listed, named_cams
from cam_rig.units import FloatArray

# Cams by their events, and a Bézier curve beside a B-spline of the same lift and events.

#: Points over the turn at which the largest change of s is sought.
POINTS = 360


@dataclass(frozen=True, eq=False)
class CamTiming:
    """When a cam passes the timed heights, and the ordinates that move this."""

    cam: CamConfig
    law: Law
    events: tuple[TimedEvent, ...]
    ordinates: list[Ordinates]

    @classmethod
    def of(cls, cam: CamConfig, law: Law) -> CamTiming:
        """The timing of a cam and its law."""
        return cls(cam, law, events(law, cam.lift.si), ordinates_of(cam, law))

    def angle(self, level: float, rising: bool) -> float | None:
        """Cam angle (rad) of the first passage upwards or the last downwards; None without one."""
        found = [e.angle for e in self.events if e.level == level and e.rising == rising]
        return None if not found else found[0 if rising else -1]


@dataclass(frozen=True)
class Alone:
    """What it takes, to first order, to move one event by one degree and leave the others.

    The largest change of an ordinate, and that of s (``lift``), are in fractions of the lift; s
    changes by more than `REACHED` of it over ``reach`` rad of the turn.
    """

    event: TimedEvent
    ordinate: float
    lift: float
    reach: float


@dataclass(frozen=True, eq=False)
class EventControl:
    """How the free ordinates of one curve control its events.

    Each free ordinate reaches ``reaches`` ``(m,)`` rad of the turn and ``within`` ``(m,)`` events;
    ``alone`` has for each event the change of least sum of squares that moves it alone.
    """

    timing: CamTiming
    reaches: FloatArray
    within: FloatArray
    alone: tuple[Alone, ...]

    @classmethod
    def of(cls, timing: CamTiming) -> EventControl:
        """Of a cam whose one segment has free ordinates."""
        (ordinates,) = timing.ordinates
        free, lift = ordinates.free, timing.cam.lift.si
        at_events = np.stack([ordinates.at(event.angle) for event in timing.events])[:, free]
        shifts = shift_matrix(ordinates, timing.events, lift)[:, free]
        changes = np.zeros((ordinates.values.size, len(timing.events)))
        changes[free] = np.radians(1.0) * np.linalg.pinv(shifts)
        angles = np.linspace(ordinates.breaks[0], ordinates.breaks[-1], POINTS)
        moved = np.abs(np.stack([ordinates.at(angle) for angle in angles]) @ changes).max(axis=0)
        largest, most = np.abs(changes).max(axis=0).tolist(), moved.tolist()
        reach = [ordinates.reach(*one) for one in zip(changes.T, REACHED * moved, strict=True)]
        alone = map(Alone, timing.events, largest, most, reach)
        within = (at_events > REACHED).sum(axis=0)
        return cls(timing, ordinates.reaches()[free], within, tuple(alone))


def beside_b_spline(timing: CamTiming) -> list[EventControl]:
    """A cam of one Bézier curve, and the B-spline of its lift and events; empty for others."""
    segments = timing.cam.segments
    if len(segments) > 1 or not isinstance(segments[0], Bezier):
        return []
    cam = with_same_events(timing.cam, timing.law, timing.events)
    return [EventControl.of(timing), EventControl.of(CamTiming.of(cam, build_law(cam)))]


@dataclass(frozen=True)
class OrdinateRow:
    """An ordinate of a cam: its reach (rad), and what it shifts (rad per ordinate of one lift).

    ``shifts`` has the first event of the segment at each level, up and down, if it is in reach.
    """

    cam: str
    segment: int
    ordinate: int
    value: float
    free: bool
    reach: float
    shifts: dict[tuple[float, bool], float]


@dataclass(frozen=True)
class ShiftRow:
    """The shift of one event (rad per ordinate of one lift) with one ordinate."""

    cam: str
    segment: int
    ordinate: int
    event: TimedEvent
    shift: float


#: Levels and whether the follower rises there, in the order of a turn.
PASSAGES = [(level, True) for level in LEVELS] + [(level, False) for level in LEVELS[::-1]]


def _passage(level: float, rising: bool) -> tuple[str, str]:
    """Key and heading."""
    way = "up" if rising else "down"
    return f"{way}_{100.0 * level:g}", f"{100.0 * level:g} % {way}"


def _angle(level: float, rising: bool) -> Column:
    key, heading = _passage(level, rising)
    return Column(key, "°", ".3f", heading, lambda timing: timing.angle(level, rising))


def _shift(level: float, rising: bool) -> Column:
    key, heading = _passage(level, rising)

    def cell(row: OrdinateRow) -> float | None:
        shift = row.shifts.get((level, rising))
        return None if shift is None else 0.01 * math.degrees(shift)

    about = "shift for a change by one lift"
    at = level, rising
    return Column(key, "°", ".4f", heading, lambda row: row.shifts.get(at), cell, doc=about)


def _alone(i: int) -> tuple[Column, Column]:
    """What it takes to move the event of a level on the rising side alone by 1°."""
    key, heading = _passage(LEVELS[i], True)
    ordinate = f"{heading.removesuffix(' up')} alone: ordinate"
    return (
        Column(
            f"{key}_ordinate",
            "%/°",
            ".2f",
            ordinate,
            f"alone.{i}.ordinate",
            lambda row: 100.0 * row.alone[i].ordinate,
            doc="largest change of an ordinate, in lifts",
        ),
        Column(f"{key}_reach", "°", ".0f", "s changes over", f"alone.{i}.reach"),
    )


@dataclass(frozen=True, repr=False)
class TimingResult(Result):
    """The events of cams; of one alone what its ordinates move, and a B-spline beside it."""

    schema = "cam_rig.timing.1"
    plot_function = "cam_rig.paper.timing.figures:figure"
    columns: ClassVar = {
        "cams": (
            Column("cam", of="cam.name"),
            *(_angle(*passage) for passage in PASSAGES),
            Column(
                "free_ordinates",
                "",
                "d",
                of=lambda timing: sum(o.values[o.free].size for o in timing.ordinates),
            ),
        ),
        "ordinates": (
            Column("cam", hidden=True),
            Column("segment", "", "d"),
            Column("ordinate", "", "d"),
            Column("value", "", ".4g"),
            Column("free", cell=lambda row: "yes" if row.free else "held"),
            Column("reach", "°", ".1f"),
            *(_shift(*passage) for passage in PASSAGES),
        ),
        "control": (
            Column("cam", "", "", "law", "timing.cam.name", lambda row: row.timing.cam.title),
            Column("free_ordinates", "", "d", of="reaches.size"),
            Column("least_reach", "°", ".0f", "reach of one", lambda row: row.reaches.min().item()),
            Column("most_reach", "°", ".0f", "to", lambda row: row.reaches.max().item()),
            Column(
                "events_in_reach",
                "",
                ".1f",
                "events in reach of one",
                lambda row: row.within.mean().item(),
            ),
            *(column for i in range(len(LEVELS)) for column in _alone(i)),
        ),
        "events": (
            Column("cam", of="0"),
            Column("level", of="1.level", doc="in lifts"),
            Column("angle", "°", ".3f", of="1.angle"),
            Column("rising", of="1.rising"),
        ),
        "shifts": (
            Column("cam"),
            Column("segment"),
            Column("ordinate"),
            Column("level", of="event.level"),
            Column("angle", "°", of="event.angle"),
            Column("rising", of="event.rising"),
            Column("shift", "°", doc="for a change of the ordinate by one lift"),
        ),
    }

    timings: tuple[CamTiming, ...]
    control: list[EventControl]

    @classmethod
    def of(cls, cams: Iterable[tuple[CamConfig, Law]]) -> TimingResult:
        """The timing of cams and their laws."""
        found = tuple(CamTiming.of(cam, law) for cam, law in cams)
        return cls(found, beside_b_spline(found[0]) if len(found) == 1 else [])

    def tables(self) -> list[Records]:
        """``cams``, ``ordinates``, ``control``; every passage as ``events``, every shift."""
        several = len(self.timings) > 1
        events = [(timing.cam.name, event) for timing in self.timings for event in timing.events]
        title = self.timings[0].cam.title
        return [
            self.table(
                "cams",
                "Cam angles at which the lift is passed",
                self.timings,
                "Heights over the lowest place, in parts of the lift of the cam's file.",
                "Free: not held by a joint. Trigonometric rises have no ordinates.",
            ),
            self.table(
                "ordinates",
                f"{title}, segment {{segment}}: what each ordinate moves",
                (row for timing in self.timings for row in _ordinate_rows(timing)),
                "Shift of each event for a change of the ordinate by 1 % of the lift (exact "
                "derivative).",
                f"Reach: where s changes by more than {REACHED:g} of the ordinate's change. Empty: "
                "beyond.",
                group_by="segment",
                hidden=several,
            ),
            self.table(
                "control",
                "Control of the events, rising side",
                self.control,
                "Alone: that event moves by 1° (first order), the others stay. Of all such changes "
                "the one of least sum of squares is taken; its largest ordinate is shown, in parts "
                "of the lift.",
            ),
            self.table("events", "Every passage", events, hidden=True),
            self.table(
                "shifts",
                "What each ordinate moves",
                (
                    ShiftRow(timing.cam.name, o.segment, j, event, shift)
                    for timing in self.timings
                    for o in timing.ordinates
                    for event in timing.events
                    for j, shift in enumerate(o.shifts(event, timing.cam.lift.si).tolist())
                ),
                hidden=True,
            ),
        ]

    def summary(self) -> list[str]:
        """Of several cams, what is not shown."""
        words = "one cam alone is shown with what each of its ordinates moves"
        return [words] if len(self.timings) > 1 else []


def _ordinate_rows(timing: CamTiming) -> Iterator[OrdinateRow]:
    for o in timing.ordinates:
        reaches, free = o.reaches(), range(*o.free.indices(o.values.size))
        rows: list[dict[tuple[float, bool], float]] = [{} for _ in o.values]
        for event in timing.events:
            shifts, reached = o.shifts(event, timing.cam.lift.si), o.at(event.angle) > REACHED
            for j in np.flatnonzero(reached).tolist():
                rows[j].setdefault((event.level, event.rising), shifts[j].item())
        for j, shifted in enumerate(rows):
            value, reach = o.values[j].item(), reaches[j].item()
            yield OrdinateRow(timing.cam.name, o.segment, j, value, j in free, reach, shifted)


@checked
def timing(cams: Cams = None) -> TimingResult:
    """Cam angles of 1, 50 and 99 % of the lift; of one cam, how each ordinate moves them.

    Roots of the law; their change with an ordinate is exact, by implicit differentiation.

    The command is ``cam-rig timing``.

    Parameters
    ----------
    cams : a name, a path or a cam, or several; None: the paper's Table 2

    Raises
    ------
    ConfigError, LawError : an unknown cam, or one whose law does not join

    Examples
    --------
    >>> import cam_rig
    >>> found = cam_rig.timing(["poly345", "bezier15"])
    >>> [one.cam.name for one in found.timings]
    ['poly345', 'bezier15']
    """
    return TimingResult.of((cam, law_of(path, cam)) for path, cam in named_cams(listed(cams)))
