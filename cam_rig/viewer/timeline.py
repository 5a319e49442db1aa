"""The timelines of a recording: rig time, and how far the cam has turned, in three ways."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from cam_rig.dynamics.interval import NamedRows
from cam_rig.simulation.schedule import CamState
from cam_rig.units import NS, FloatArray, to_rpm

#: Rig time since the start of the run, a duration.
RIG_TIME = "rig_time"
#: Cam angle in whole degrees, a sequence that runs on from turn to turn.
CAM_DEGREES = "cam_degrees"
#: Whole turns of the cam since the start.
TURN = "turn"
#: Degrees within the turn, 0 to 359: here turns lie over each other.
TURN_DEGREES = "turn_degrees"
#: An angle so little (degrees) below a whole degree is that one: rig time is in whole ns, and half
#: a ns is 1.2e-6° at 400 rpm, 3e-5° at 10 000. Samples lie farther from each other than this.
ROUNDING = 1e-4
#: Gives the time columns of rows at times (s) and unwrapped cam angles (rad).
Times = Callable[[FloatArray, FloatArray], list[rr.TimeColumn]]


def time_columns(time: FloatArray, angle: FloatArray) -> list[rr.TimeColumn]:
    """All timelines for rows at ``time`` (s) and unwrapped cam ``angle`` (rad)."""
    nanoseconds = np.rint(time * 1e9).astype("timedelta64[ns]")
    degrees = _whole_degrees(angle)
    turn = degrees // 360
    return [
        rr.TimeColumn(RIG_TIME, duration=nanoseconds),
        rr.TimeColumn(CAM_DEGREES, sequence=degrees),
        rr.TimeColumn(TURN, sequence=turn),
        rr.TimeColumn(TURN_DEGREES, sequence=degrees - 360 * turn),
    ]


def rig_time_alone(time: FloatArray, _angle: FloatArray) -> list[rr.TimeColumn]:
    """Rig time, for a run that is followed: each timeline more is work for the page that draws."""
    return time_columns(time, np.zeros_like(time))[:1]


def within_turn(_time: FloatArray, angle: FloatArray) -> list[rr.TimeColumn]:
    """The angle within the turn alone, for turns that are to lie over each other."""
    return [rr.TimeColumn(TURN_DEGREES, sequence=_whole_degrees(angle) % 360)]


def _whole_degrees(angle: FloatArray) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    return np.floor(np.degrees(angle) + ROUNDING).astype(np.int64)


@dataclass(frozen=True)
class Canvas:
    """A recording to draw into, and the timelines of what is drawn."""

    stream: rr.RecordingStream
    times: Times = time_columns

    def at(self, time: float, angle: float) -> list[rr.TimeColumn]:
        """One row at a rig time (s) and an unwrapped cam angle (rad)."""
        return self.times(np.array([time]), np.array([angle]))

    def state(self, state: CamState) -> list[rr.TimeColumn]:
        """One row at a state of the cam."""
        return self.at(state.time_ns / NS, state.unwrapped)

    def always(self, entity: str, shape: Any) -> None:
        """Draw what holds at every time: a shape, or how later ones look."""
        self.stream.log(entity, shape, static=True)

    def look(self, entity: str, kind: Any, **look: Any) -> None:
        """How shapes of a kind that come later look, and what else holds of them all."""
        self.always(entity, kind.from_fields(**look))

    def rows(self, entity: str, at: list[rr.TimeColumn], columns: Any) -> None:
        """Draw a row of columns at each time."""
        self.stream.send_columns(entity, at, columns)

    def strips(
        self, entity: str, at: list[rr.TimeColumn], strips: Sequence[FloatArray], **look: float
    ) -> None:
        """Draw lines ``(n, 2)`` that look alike in one row."""
        looks: dict[str, Any] = {name: [value] * len(strips) for name, value in look.items()}
        columns = rr.LineStrips2D.columns(strips=strips, **looks)
        self.rows(entity, at, columns.partition([len(strips)]))

    def points(self, entity: str, at: list[rr.TimeColumn], places: Any, **columns: Any) -> None:
        """Draw points ``(n, 2)`` in one row."""
        drawn = rr.Points2D.columns(positions=places, **columns)
        self.rows(entity, at, drawn.partition([len(places)]))


# How often a live picture is sent: as often as a screen shows it, less while a page is behind.

#: Pictures a second of wall time at most, as a screen shows, and at least.
MAX_RATE, MIN_RATE = 30.0, 0.6
#: A page so much (s) behind, beside the time from picture to picture, is late; one less is not.
LATE_S, IN_TIME_S = 0.8, 0.5
#: Factors of the rate: of a page that is just late, less for one that is later; of one in time.
SLOWER, FASTER = 0.5, 2.0
#: Wall time (s) that a slower rate has to show, and that a page must be in time for a faster one.
SETTLE_S, CALM_S = 2.0, 5.0


class FramePace:
    """How many pictures a second of wall time are worth sending; the newest always is.

    Between 0.6 a second, with which a page begins, and 30: doubled when the page has been in time
    for 5 s, halved or less when it is late. In between the rate stays. ``behind`` says how far (s)
    the page is behind, None while it is not known; without it every picture that a screen can show
    is sent.
    """

    def __init__(
        self,
        behind: Callable[[], float | None] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._behind, self._clock = behind, clock
        self._sent = self._changed = self._late = clock()
        #: Pictures a second that are sent now.
        self.rate = MAX_RATE if behind is None else MIN_RATE

    def is_due(self) -> bool:
        """Whether the next picture is to be sent, at the rate that fits the page now."""
        now = self._clock()
        if self._behind is not None:
            self._adapt(self._behind(), now)
        return now - self._sent >= 1.0 / self.rate

    def chosen(self, count: int) -> NDArray[np.intp]:
        """Which of so many pictures to send, evenly among them; the newest always."""
        now = self._clock()
        most = max(1, int((now - self._sent) * self.rate))
        self._sent = now
        return np.unique(np.linspace(count - 1, 0, min(most, count)).astype(np.intp))

    def _adapt(self, behind: float | None, now: float) -> None:
        if behind is None:
            return
        delay = behind - 1.0 / self.rate
        if delay > IN_TIME_S:
            self._late = now
        if delay > LATE_S and now - self._changed >= SETTLE_S:
            self._change(SLOWER * LATE_S / delay, now)
        elif now - max(self._late, self._changed) >= CALM_S:
            self._change(FASTER, now)

    def _change(self, factor: float, now: float) -> None:
        self.rate = min(max(factor * self.rate, MIN_RATE), MAX_RATE)
        self._changed = now


# The last whole turn at each speed: what is laid over others, and what the results say.


@dataclass(frozen=True, eq=False)
class Turn(NamedRows):
    """One turn of a cam: unwrapped ``angle`` (rad) and ``(6, n)`` rows of its samples, named."""

    cam: str
    speed: float
    angle: FloatArray
    rows: FloatArray

    @property
    def rpm(self) -> float:
        """The cam's speed."""
        return to_rpm(self.speed)


class TurnCollector:
    """Keeps the newest turn, tick by tick."""

    def __init__(self, ticks_per_turn: int) -> None:
        self._ticks: deque[tuple[CamState, FloatArray, FloatArray]] = deque(maxlen=ticks_per_turn)

    def add(self, start: CamState, angle: FloatArray, rows: FloatArray) -> None:
        """Take the samples of the next tick."""
        last = self._ticks[-1][0] if self._ticks else start
        if (start.cam, start.speed) != (last.cam, last.speed):
            self._ticks.clear()
        self._ticks.append((start, angle, rows))

    def turn(self) -> Turn | None:
        """The newest turn, when a whole one has been seen since the speed changed."""
        if len(self._ticks) < (self._ticks.maxlen or 1):
            return None
        start, angles, rows = zip(*self._ticks, strict=True)
        state = start[0]
        return Turn(state.cam, state.speed, np.concatenate(angles), np.concatenate(rows, axis=1))


def sample_angles(start: CamState, end: CamState, time: FloatArray) -> FloatArray:
    """``(n,)`` unwrapped cam angles (rad) at ``time`` (s) in the tick from ``start`` to ``end``."""
    interval, since = start.until(end), time - start.time_ns / NS
    return start.unwrapped + since * (interval.speed + 0.5 * interval.acceleration * since)


def lift_offs(force: FloatArray, was_off: bool) -> FloatArray:
    """``(n,)`` True at the first sample of each loss of contact, where the force becomes zero."""
    off = force == 0.0
    return np.asarray(off & ~np.append(was_off, off[:-1]))
