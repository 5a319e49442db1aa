"""Events, ordinates and their control: as tables and as plain data."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from cam_rig.laws import Law, build_law
from cam_rig.paper.timing.events import (
    LEVELS,
    REACHED,
    Ordinates,
    TimedEvent,
    events,
    is_one_curve,
    ordinates_of,
    shift_matrix,
    with_same_events,
)
from cam_rig.schema import CamConfig
from cam_rig.show.tables import Cell, DataTable, Head, tabulate
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

    Parameters
    ----------
    event : that is moved
    ordinate : the largest change of an ordinate, in fractions of the lift
    lift : the largest change of s, in fractions of the lift
    reach : rad of the turn over which s changes by more than `REACHED` of that
    """

    event: TimedEvent
    ordinate: float
    lift: float
    reach: float


@dataclass(frozen=True, eq=False)
class EventControl:
    """How the free ordinates of one curve control its events.

    Parameters
    ----------
    reaches : ``(m,)`` rad of the turn that each free ordinate reaches
    within : ``(m,)`` how many events each reaches
    alone : for each event, the change of least sum of squares that moves it alone
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
        alone = (
            Alone(
                event,
                float(np.abs(change).max()),
                float(most),
                ordinates.reach(change, REACHED * most),
            )
            for event, change, most in zip(timing.events, changes.T, moved, strict=True)
        )
        within = (at_events > REACHED).sum(axis=0)
        return cls(timing, ordinates.reaches()[free], within, tuple(alone))


def beside_b_spline(timing: CamTiming) -> list[EventControl]:
    """A cam of one Bézier curve, and the B-spline of its lift and events; empty for others."""
    if not is_one_curve(timing.cam):
        return []
    cam = with_same_events(timing.cam, timing.law, timing.events)
    return [EventControl.of(timing), EventControl.of(CamTiming.of(cam, build_law(cam)))]


def events_table(found: Iterable[CamTiming], by_name: bool = False) -> DataTable:
    """One row for each cam: where it passes the heights, up and down."""

    def angle(level: float, rising: bool) -> Callable[[CamTiming], Cell]:
        return lambda row: _degrees(row.angle(level, rising))

    passages = [(level, True) for level in LEVELS] + [(level, False) for level in LEVELS[::-1]]
    return tabulate(
        "Cam angles at which the lift is passed",
        found,
        (
            (Head("cam"), lambda row: row.cam.name if by_name else row.cam.title),
            *(
                (
                    Head(f"{_percent(level)} {'up' if up else 'down'}", "°", ".3f"),
                    angle(level, up),
                )
                for level, up in passages
            ),
            (Head("free ordinates", "", "d"), lambda row: sum(map(_free, row.ordinates))),
        ),
        "Heights over the lowest place, in parts of the lift of the cam's file.",
        "Free: not held by a joint. Trigonometric rises have no ordinates.",
    )


def ordinates_table(timing: CamTiming, ordinates: Ordinates) -> DataTable:
    """One row for each ordinate: its reach, and the shift of each event that one of them moves."""
    shifts = np.stack([ordinates.shifts(event, timing.cam.lift.si) for event in timing.events])
    shown = [i for i in range(len(timing.events)) if shifts[i].any()]
    free, reaches = ordinates.free, ordinates.reaches()

    def shift(event: int) -> Callable[[int], Cell]:
        reached = ordinates.at(timing.events[event].angle) > REACHED
        return lambda j: 0.01 * math.degrees(shifts[event, j]) if reached[j] else None

    return tabulate(
        f"{timing.cam.title}, segment {ordinates.segment}: what each ordinate moves",
        range(ordinates.values.size),
        (
            (Head("ordinate", "", "d"), lambda j: j),
            (Head("value", "", ".4g"), lambda j: float(ordinates.values[j])),
            (Head("free"), lambda j: "yes" if free.start <= j < free.stop else "held"),
            (Head("reach", "°", ".1f"), lambda j: math.degrees(reaches[j])),
            *((Head(_name(timing.events[i]), "°", ".4f"), shift(i)) for i in shown),
        ),
        "Shift of each event for a change of the ordinate by 1 % of the lift (exact derivative).",
        f"Reach: where s changes by more than {REACHED:g} of the ordinate's change. Empty: beyond.",
    )


def control_table(found: Iterable[EventControl]) -> DataTable:
    """One row for each curve: how local its control is."""
    rows = list(found)
    risings = range(len(LEVELS)) if rows else range(0)
    return tabulate(
        "Control of the events, rising side",
        rows,
        (
            (Head("law"), lambda row: row.timing.cam.title),
            (Head("free ordinates", "", "d"), lambda row: row.reaches.size),
            (Head("reach of one", "°", ".0f"), lambda row: math.degrees(row.reaches.min())),
            (Head("to", "°", ".0f"), lambda row: math.degrees(row.reaches.max())),
            (Head("events in reach of one", "", ".1f"), lambda row: float(row.within.mean())),
            *(
                column
                for i in risings
                for column in (
                    (
                        Head(f"{_percent(LEVELS[i])} alone: ordinate", "%/°", ".2f"),
                        lambda row, i=i: 100.0 * row.alone[i].ordinate,
                    ),
                    (
                        Head("s changes over", "°", ".0f"),
                        lambda row, i=i: math.degrees(row.alone[i].reach),
                    ),
                )
            ),
        ),
        "Alone: that event moves by 1° (first order), the others stay. Of all such changes the one "
        "of least sum of squares is taken; its largest ordinate is shown, in parts of the lift.",
    )


def _name(event: TimedEvent) -> str:
    return f"{_percent(event.level)} {'up' if event.rising else 'down'}"


def _percent(level: float) -> str:
    return f"{100.0 * level:g} %"


def _degrees(angle: float | None) -> float | None:
    return None if angle is None else math.degrees(angle)


def _free(ordinates: Ordinates) -> int:
    return len(range(ordinates.values.size)[ordinates.free])


def to_json(found: Iterable[CamTiming]) -> dict[str, Any]:
    """As plain data, by cam."""
    return {timing.cam.name: _plain(timing) for timing in found}


def _plain(timing: CamTiming) -> dict[str, Any]:
    lift = timing.cam.lift.si
    return {
        "events": [
            {"level": e.level, "angle_deg": math.degrees(e.angle), "rising": e.rising}
            for e in timing.events
        ],
        "ordinates": [
            {
                "segment": o.segment,
                "values": o.values.tolist(),
                "reach_deg": np.degrees(o.reaches()).tolist(),
                "shift_deg_per_lift": [
                    np.degrees(o.shifts(event, lift)).tolist() for event in timing.events
                ],
            }
            for o in timing.ordinates
        ],
    }
