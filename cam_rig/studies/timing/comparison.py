"""Cams by their events, and a Bézier curve beside a B-spline of the same lift and events."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.laws import Law, build_law
from cam_rig.schema import CamConfig
from cam_rig.studies.timing.events import TimedEvent, events
from cam_rig.studies.timing.ordinates import REACHED, Ordinates, ordinates_of, shift_matrix
from cam_rig.studies.timing.same_events import is_one_curve, with_same_events

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
