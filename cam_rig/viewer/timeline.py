"""Timelines of a recording: rig time, and three measures of the cam angle."""

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

#: Name of the timeline of the rig time since the start of the run, a duration.
RIG_TIME = "rig_time"
#: Name of the timeline of the unwrapped cam angle in whole degrees, a sequence.
CAM_DEGREES = "cam_degrees"
#: Name of the timeline of the whole turns of the cam since the start.
TURN = "turn"
#: Name of the timeline of the degrees within the turn, 0 to 359, on which turns are overlaid.
TURN_DEGREES = "turn_degrees"
#: An angle that is less than this value (degrees) below a whole degree counts as that degree. Rig
#: time has whole ns, and half a ns is 1.2e-6° at 400 rpm and 3e-5° at 10 000 rpm. The distance of
#: samples is larger than this tolerance.
ANGLE_ROUNDING_DEG = 1e-4
#: Function that returns the time columns of data at rig times (s) and unwrapped cam angles (rad).
Times = Callable[[FloatArray, FloatArray], list[rr.TimeColumn]]


def time_columns(time: FloatArray, angle: FloatArray) -> list[rr.TimeColumn]:
    """Return the columns of all timelines for rows of a recording.

    The rows are at ``time`` (s) and unwrapped cam ``angle`` (rad), ``(n,)`` each.
    """
    nanoseconds = np.rint(time * 1e9).astype("timedelta64[ns]")
    degrees = _floor_degrees(angle)
    turn = degrees // 360
    return [
        rr.TimeColumn(RIG_TIME, duration=nanoseconds),
        rr.TimeColumn(CAM_DEGREES, sequence=degrees),
        rr.TimeColumn(TURN, sequence=turn),
        rr.TimeColumn(TURN_DEGREES, sequence=degrees - 360 * turn),
    ]


def rig_time_alone(time: FloatArray, _angle: FloatArray) -> list[rr.TimeColumn]:
    """Return the column of the rig time only, for a live run.

    Further timelines would slow the page.
    """
    return time_columns(time, np.zeros_like(time))[:1]


def within_turn(_time: FloatArray, angle: FloatArray) -> list[rr.TimeColumn]:
    """Return a single time column: the cam angle modulo 360°, in whole degrees.

    Successive turns overlap on this timeline.
    """
    return [rr.TimeColumn(TURN_DEGREES, sequence=_floor_degrees(angle) % 360)]


def _floor_degrees(angle: FloatArray) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    return np.floor(np.degrees(angle) + ANGLE_ROUNDING_DEG).astype(np.int64)


@dataclass(frozen=True)
class Canvas:
    """Recording to draw into, with the timelines on which the drawn data appear.

    `times` returns the columns of these timelines for data at rig times (s) and cam angles (rad).
    """

    stream: rr.RecordingStream
    times: Times = time_columns

    def times_at(self, time: float, angle: float) -> list[rr.TimeColumn]:
        """Return the time columns of a row of data in a Rerun recording.

        The row is at a rig time (s) and an unwrapped cam angle (rad).
        """
        return self.times(np.array([time]), np.array([angle]))

    def times_of(self, state: CamState) -> list[rr.TimeColumn]:
        """Return the time columns of a single row of data, at the time of a cam state."""
        return self.times_at(state.time_ns / NS, state.unwrapped)

    def log_static(self, entity: str, shape: Any) -> None:
        """Send a shape, or the style of later shapes, as static data.

        Static data are visible at every time.
        """
        self.stream.log(entity, shape, static=True)

    def set_style(self, entity: str, kind: Any, **style: Any) -> None:
        """Set the common style and properties of all later shapes of an entity.

        `kind` is the Rerun archetype of the shapes, such as ``rr.Points2D``.
        """
        self.log_static(entity, kind.from_fields(**style))

    def rows(self, entity: str, times: list[rr.TimeColumn], columns: Any) -> None:
        """Send columns of data to an entity of the recording, with one row per time.

        `times` are the time columns of the rows.
        """
        self.stream.send_columns(entity, times, columns)

    def strips(
        self, entity: str, times: list[rr.TimeColumn], strips: Sequence[FloatArray], **style: float
    ) -> None:
        """Draw polylines ``(n, 2)`` of one style at one time.

        `times` has one row, and `style` contains values such as `radii` for all polylines. `entity`
        is the path in the recording, and `strips` are the polylines.
        """
        styles: dict[str, Any] = {name: [value] * len(strips) for name, value in style.items()}
        columns = rr.LineStrips2D.columns(strips=strips, **styles)
        self.rows(entity, times, columns.partition([len(strips)]))

    def points(
        self, entity: str, times: list[rr.TimeColumn], positions: Any, **columns: Any
    ) -> None:
        """Draw points ``(n, 2)`` at one time.

        `times` has one row, and `columns` contains further data of the points, such as labels.
        `entity` is the path in the recording.
        """
        points = rr.Points2D.columns(positions=positions, **columns)
        self.rows(entity, times, points.partition([len(positions)]))


# Rate of the pictures of a live run: that of a screen, or less while the page is behind.

#: Highest rate of pictures, per second of wall-clock time: a screen displays no more.
MAX_RATE = 30.0
#: Lowest rate at which pictures are sent to a page, per second of wall-clock time.
MIN_RATE = 0.6
#: Delay (s) of a page behind the run above which the picture rate is reduced. The period of the
#: pictures is not included.
LATE_S = 0.8
#: Delay (s) of a page behind the run below which the page is in time. The period of the pictures is
#: not included.
IN_TIME_S = 0.5
#: Factor by which the picture rate is reduced for a page with the delay `LATE_S`. The factor is
#: smaller for a longer delay.
SLOWER = 0.5
#: Factor by which the picture rate is increased for a page that is in time.
FASTER = 2.0
#: Shortest wall-clock time (s) between two reductions of the picture rate, so that the first can
#: take effect.
SETTLE_S = 2.0
#: Wall-clock time (s) during which a page must be in time before the picture rate is increased.
CALM_S = 5.0


class FramePace:
    """Rate of the pictures that are sent to a page, per second of wall-clock time.

    The newest picture is always sent. The rate is between 0.6 and 30 per second, and starts at 0.6.
    It is doubled when the page has been in time for 5 s, and halved or reduced further when the
    page is late. Otherwise it does not change.

    Parameters
    ----------
    behind : callable, optional
        Function that returns the delay of the page in s, or None if it is unknown (default: the
        rate is 30 per second).
    clock : callable
        Function that returns the wall-clock time in s.
    """

    def __init__(
        self,
        behind: Callable[[], float | None] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._behind, self._clock = behind, clock
        self._sent = self._changed = self._late = clock()
        #: Present rate at which pictures are sent to the page, per second of wall-clock time.
        self.rate = MAX_RATE if behind is None else MIN_RATE

    def is_due(self) -> bool:
        """Return True if the next picture must be sent now.

        The rate of the pictures is adapted to the delay of the page first.
        """
        now = self._clock()
        if self._behind is not None:
            self._adapt(self._behind(), now)
        return now - self._sent >= 1.0 / self.rate

    def chosen(self, count: int) -> NDArray[np.intp]:
        """Return the indices of the pictures to send, evenly among `count` new pictures.

        The newest picture is always among them.
        """
        now = self._clock()
        max_count = max(1, int((now - self._sent) * self.rate))
        self._sent = now
        return np.unique(np.linspace(count - 1, 0, min(max_count, count)).astype(np.intp))

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


# Last complete turn at each speed, for overlaid curves and for the results.


@dataclass(frozen=True, eq=False)
class Turn(NamedRows):
    """Samples of one turn of a cam at one speed.

    `speed` is in rad/s, and `angle` is the unwrapped cam angle in rad, shape (n,). `rows` contains
    time (s), lift (m), velocity (m/s), acceleration (m/s²), contact force (N) and landing impulse
    (N·s), shape (6, n), and the twist (rad) as a seventh row if the model has an elastic shaft.
    """

    cam: str
    speed: float
    angle: FloatArray
    rows: FloatArray

    @property
    def rpm(self) -> float:
        """Speed of the cam in rpm."""
        return to_rpm(self.speed)


class TurnCollector:
    """Collector that assembles the newest turn of the cam from ticks.

    A tick is the time between two cam states.
    """

    def __init__(self, ticks_per_turn: int) -> None:
        self._ticks: deque[tuple[CamState, FloatArray, FloatArray]] = deque(maxlen=ticks_per_turn)

    def add(self, start: CamState, angle: FloatArray, rows: FloatArray) -> None:
        """Add the samples of the next tick, which starts at a cam state.

        `angle` is the unwrapped cam angle in rad, shape (n,). `rows` contains the samples as in
        `Turn`. If the cam or its speed has changed, the earlier ticks are dropped. A tick is the
        time between two cam states.
        """
        last = self._ticks[-1][0] if self._ticks else start
        if (start.cam, start.speed) != (last.cam, last.speed):
            self._ticks.clear()
        self._ticks.append((start, angle, rows))

    def turn(self) -> Turn | None:
        """Return the newest complete turn at the present speed, or None without one."""
        if len(self._ticks) < (self._ticks.maxlen or 1):
            return None
        start, angles, rows = zip(*self._ticks, strict=True)
        state = start[0]
        return Turn(state.cam, state.speed, np.concatenate(angles), np.concatenate(rows, axis=1))


def sample_angles(start: CamState, end: CamState, time: FloatArray) -> FloatArray:
    """Return the unwrapped cam angles (rad) at rig times (s) within a tick, (n,).

    A tick is the time between two cam states.
    """
    interval, since = start.until(end), time - start.time_ns / NS
    return start.unwrapped + since * (interval.speed + 0.5 * interval.acceleration * since)


def lift_offs(force: FloatArray, was_off: bool) -> FloatArray:
    """Return True at the first sample of each loss of contact, shape (n,).

    Contact is lost while the force is zero. ``was_off`` is True if it was lost before the samples.
    """
    off = force == 0.0
    return np.asarray(off & ~np.append(was_off, off[:-1]))
