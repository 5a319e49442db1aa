"""Inputs and outputs of the follower models: intervals, sample grids, states, blocks.

A model computes the motion of a follower in one interval of time. It takes an `Interval` of the
cam's motion and a `FollowerState`. It returns the state at the end of the interval and a `Block` of
samples and events.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal, NamedTuple, TypeVar

import numpy as np

from cam_rig.dynamics.parameters import is_number, require_angle, require_number
from cam_rig.errors import DynamicsError
from cam_rig.laws.sampling import samples_before
from cam_rig.units import NS, TURN, FloatArray

EventKind = Literal["lift-off", "landing"]
Time = TypeVar("Time", float, FloatArray)

#: Names and units of the rows of an array of follower samples.
COLUMNS = (
    "t [s]",
    "lift [m]",
    "velocity [m/s]",
    "acceleration [m/s^2]",
    "contact_force [N]",
    "contact_impulse [N*s]",
)


class NamedRows:
    """Named access to the array ``rows`` of n samples, ``(6, n)``.

    The rows are in the order of `COLUMNS`. Each property is a view of the array, with the shape
    ``(n,)`` unless stated otherwise.
    """

    rows: FloatArray

    @property
    def time(self) -> FloatArray:
        """Rig time (simulated time since the start of the run) of the samples, s."""
        return self.rows[0, :]

    @property
    def lift(self) -> FloatArray:
        """Follower displacement, m."""
        return self.rows[1, :]

    @property
    def velocity(self) -> FloatArray:
        """Follower velocity, m/s."""
        return self.rows[2, :]

    @property
    def acceleration(self) -> FloatArray:
        """Follower acceleration, m/s²."""
        return self.rows[3, :]

    @property
    def force(self) -> FloatArray:
        """Contact force, N, which is 0 in flight."""
        return self.rows[4, :]

    @property
    def impulse(self) -> FloatArray:
        """Impulse of the landings since the previous sample, N·s."""
        return self.rows[5, :]

    @property
    def motion(self) -> FloatArray:
        """Follower displacement (m), velocity (m/s) and acceleration (m/s²), ``(3, n)``."""
        return self.rows[1:4]


@dataclass(frozen=True, eq=False)
class Samples(NamedRows):
    """Array of samples with named rows.

    Parameters
    ----------
    rows : array, ``(6, n)``
        Samples in SI units, in the order of `COLUMNS`.
    """

    rows: FloatArray


#: Number of sample times that are computed together. Their data fit in the cache of a processor
#: core.
BATCH_SIZE = 8192

#: Indices 0, 1, … of the samples of a batch, as floats, ``(BATCH_SIZE,)``.
_INDICES = np.arange(BATCH_SIZE, dtype=np.float64)
#: Largest negative cam speed at an end of a speed ramp that counts as 0 (rounding), relative to the
#: speed at the other end.
REST_RTOL = 1e-9
#: Relative difference below which two cam speeds count as equal. A ramp reaches its last speed only
#: to rounding.
SPEED_RTOL = 1e-12
#: Largest difference between the cam angles (rad) at the end of an interval and at the start of the
#: next interval. The tolerance allows for rounding.
ANGLE_TOLERANCE = 1e-6


def wrap(angle: float, turns: int = 0) -> tuple[int, float]:
    """Return the whole turns of an angle (rad), and the remainder in [0, 2π) in rad.

    ``turns`` is added to the whole turns.

    Examples
    --------
    >>> wrap(7.0, 5)
    (6, 0.7168146928204138)
    """
    if 0.0 <= angle < TURN:
        return turns, angle
    whole = math.floor(angle / TURN)
    remainder = angle - whole * TURN
    if not 0.0 <= remainder < TURN:  # the rounding error of an angle of 1e18 rad is many turns
        remainder = math.fmod(angle, TURN)
        remainder = remainder + TURN if remainder < 0.0 else remainder
        whole = round((angle - remainder) / TURN)
    return (turns + whole, remainder) if remainder < TURN else (turns + whole + 1, 0.0)


@dataclass(frozen=True)
class Interval:
    """Interval of rig time (simulated time) with a constant acceleration of the cam.

    The cam angle is θ = angle + speed t + acceleration t²/2. The angle and the whole turns are
    stored separately, so that the angle keeps all its digits after many turns.

    Parameters
    ----------
    start_ns : int
        Start of the interval, ns of rig time.
    stop_ns : int
        End of the interval, ns of rig time, after the start.
    angle : float
        Cam angle at the start, rad. Its whole turns are moved to ``turns``.
    speed : float
        Cam speed at the start, rad/s.
    acceleration : float
        Cam acceleration, rad/s² (default: 0).
    turns : int
        Whole turns before the start (default: 0).

    Raises
    ------
    DynamicsError
        If the stamps do not increase, a number is out of range, or a ramp turns the cam backwards.
    """

    start_ns: int
    stop_ns: int
    angle: float  #: cam angle at the start, in [0, 2π), rad
    speed: float  #: cam speed at the start, rad/s
    acceleration: float = 0.0  #: cam acceleration, rad/s²
    turns: int = 0  #: whole turns of the cam before the start

    def __post_init__(self) -> None:
        for name in ("start_ns", "stop_ns"):
            if not isinstance(stamp := getattr(self, name), int | np.integer):
                raise DynamicsError(f"{name} is {stamp!r}; allowed: a whole number of ns")
        if self.stop_ns <= self.start_ns:
            raise DynamicsError(
                f"an interval from {self.start_ns} to {self.stop_ns} ns; allowed: stamps that "
                "rise (is a second drive at work?)"
            )
        require_angle(self.angle, "an interval whose angle")
        turns, angle = wrap(float(self.angle), self.turns)
        object.__setattr__(self, "turns", turns)
        object.__setattr__(self, "angle", angle)
        for name in ("speed", "acceleration"):
            require_number(f"an interval whose {name}", getattr(self, name), "of either sign")
            object.__setattr__(self, name, float(getattr(self, name)))
        require_angle(self.unwrapped_at(self.duration), "an interval whose last angle")
        end = self.speed_at(self.duration)
        if self.acceleration != 0.0 and min(self.speed, end) < -REST_RTOL * max(self.speed, end):
            raise DynamicsError(
                f"a ramp from {self.speed:g} to {end:g} rad/s; allowed: from rest or forwards"
            )

    @property
    def duration(self) -> float:
        """Duration of the interval, s."""
        return (self.stop_ns - self.start_ns) / NS

    @property
    def mean_speed(self) -> float:
        """Mean cam speed over the interval, rad/s."""
        return self.speed + 0.5 * self.acceleration * self.duration

    def angle_at(self, time: Time) -> Time:
        """Return the cam angle (rad) at times (s) since the start of the interval.

        The whole turns in ``turns`` are not included.
        """
        return self.angle + time * (self.speed + 0.5 * self.acceleration * time)

    def unwrapped_at(self, time: Time) -> Time:
        """Return the cam angle (rad) including all turns, at times (s) since the start.

        It is meant for display, because it loses digits with the number of turns.
        """
        return self.turns * TURN + self.angle_at(time)

    def speed_at(self, time: Time) -> Time:
        """Return the cam speed (rad/s) at times (s) since the start of an interval."""
        return self.speed + self.acceleration * time

    def time_at(self, angle: float) -> float:
        """Return the time (s) at which the cam reaches an angle (rad).

        It is measured from the start of the interval. It is infinite if the cam never reaches the
        angle at the acceleration of the interval. The end of the interval is not a limit.
        """
        ahead = angle - self.angle
        square = self.speed**2 + 2.0 * self.acceleration * ahead
        if square < 0.0 or self.speed + math.sqrt(square) <= 0.0:
            return 0.0 if ahead <= 0.0 else math.inf
        return 2.0 * ahead / (self.speed + math.sqrt(square))

    def split(self, max_angle: float) -> list[Interval]:
        """Split the interval into intervals of equal duration, to the nanosecond.

        Their number is such that the cam turns by at most ``max_angle`` rad in each of them, even
        at the highest speed of the whole interval.
        """
        max_speed = max(abs(self.speed), abs(self.speed_at(self.duration)))
        length = self.stop_ns - self.start_ns
        count = min(max(1, math.ceil(max_speed * self.duration / max_angle)), length)
        parts = []
        for a, b in pairwise(length * i // count for i in range(count + 1)):
            angle, speed = self.angle_at(a / NS), self.speed_at(a / NS)
            stamps = self.start_ns + a, self.start_ns + b
            parts.append(Interval(*stamps, angle, speed, self.acceleration, self.turns))
        return parts

    def grid(self, sample_rate: int) -> SampleGrid:
        """Return the grid of the samples in the interval [start, stop).

        Sample times are k / ``sample_rate`` (Hz) with whole k, so that all intervals share one grid
        of rig time.
        """
        rate: object = sample_rate  # the annotation is not checked at run time
        if not (isinstance(rate, int | np.integer) and 1 <= rate <= NS):
            raise DynamicsError(
                f"sample_rate is {sample_rate!r}; allowed: a whole number of Hz, 1 to {NS}"
            )
        first = -(-self.start_ns * sample_rate // NS)
        end = -(-self.stop_ns * sample_rate // NS)
        offset = (first * NS - self.start_ns * sample_rate) / (sample_rate * NS)
        return SampleGrid(first, end - first, offset, sample_rate, self.duration)


@dataclass(frozen=True)
class SampleGrid:
    """Sample times of one interval on the time grid that all intervals share.

    The grid contains the rig times k / ``sample_rate`` with whole k.
    """

    first: int  #: index k of the first sample, counted from rig time 0
    count: int  #: number of samples in the interval
    offset: float  #: time from the start of the interval to the first sample, s
    sample_rate: int  #: number of samples per second, Hz
    duration: float  #: duration of the interval, s

    def sample_times(self) -> FloatArray:
        """Return the sample times since the start of the interval, s, ``(count,)``."""
        return self.offset + np.arange(self.count) / self.sample_rate

    def new_rows(self) -> FloatArray:
        """Return a new array of samples in the order of `COLUMNS`, ``(6, count)``.

        Times are set and impulses are 0. The caller writes the rows from lift to contact force.
        """
        rows = np.empty((len(COLUMNS), self.count))
        for start in range(0, self.count, BATCH_SIZE):
            times = rows[0, start : start + BATCH_SIZE]
            np.add(_INDICES[: times.size], float(self.first + start), out=times)
            times /= self.sample_rate
        rows[5] = 0.0
        return rows

    def index_after(self, time: float) -> int:
        """Return the index of the first sample at or after a time (s).

        The time is measured from the start of the interval, and the index from the first sample of
        the interval.
        """
        return samples_before((time - self.offset) * self.sample_rate)

    def find_samples(self, start: float, end: float) -> tuple[slice, FloatArray] | None:
        """Return the samples between two times (s since the start of the interval).

        The results are the slice of their indices and their times (s). Returns None if no sample
        lies between the times.
        """
        # By rounding the last sample may be at the end of the interval. It belongs to the interval.
        last = self.count if end >= self.duration else min(self.index_after(end), self.count)
        first = self.index_after(start)
        if first >= last:
            return None
        return slice(first, last), self.offset + np.arange(first, last) / self.sample_rate


class Event(NamedTuple):
    """Lift-off or landing of the follower.

    Parameters
    ----------
    kind : {"lift-off", "landing"}
        Kind of the event.
    time : float
        Rig time, s.
    angle : float
        Cam angle with all turns, rad.
    impulse : float
        Impulse of the landing, N·s. It is 0 at a lift-off.
    energy_lost : float
        Energy lost in the landing, J. It is 0 at a lift-off.
    """

    kind: EventKind
    time: float  #: rig time, s
    angle: float  #: cam angle with all turns, rad
    impulse: float = 0.0  #: impulse of a landing, N·s, 0 at a lift-off
    energy_lost: float = 0.0  #: energy lost in a landing, J, 0 at a lift-off


@dataclass(frozen=True)
class FollowerState:
    """State of the follower at the end of an interval.

    The next interval must start at ``cam_angle``. If its speed differs from ``cam_speed``, the
    change of the cam's velocity is an impact on the follower or lifts it off.

    Parameters
    ----------
    displacement : float
        Displacement of the follower, m.
    velocity : float
        Velocity of the follower, m/s.
    contact_force : float
        Contact force, N.
    in_contact : bool
        True if the follower is on the cam.
    pending_impulse : float
        Impulse of landings after the last sample, N·s. The next block contains it (default: 0).
    inner : tuple of float
        Further state variables of the follower model, which defines them (default: empty).
    cam_angle : float, optional
        Cam angle in [0, 2π), rad. None if unknown (default).
    cam_speed : float, optional
        Cam speed, rad/s. None if unknown (default).

    Raises
    ------
    DynamicsError
        If a number is not finite.
    """

    displacement: float  #: displacement of the follower, m
    velocity: float  #: velocity of the follower, m/s
    contact_force: float  #: contact force, N
    in_contact: bool  #: True if the follower is on the cam
    pending_impulse: float = 0.0  #: impulse of landings after the last sample, N·s
    inner: tuple[float, ...] = ()  #: further state variables of the follower model
    cam_angle: float | None = None  #: cam angle in [0, 2π), rad, or None if unknown
    cam_speed: float | None = None  #: cam speed, rad/s, or None if unknown

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            numbers = value if isinstance(value, tuple) else (value,)
            for number in numbers:
                if number is None and name.startswith("cam_"):
                    continue
                if name != "in_contact" and not is_number(number):
                    raise DynamicsError(
                        f"a follower whose {name} is {number!r}; allowed: finite numbers"
                    )


@dataclass(frozen=True, eq=False)
class Block(NamedRows):
    """Samples and events of one interval.

    An event is a lift-off or a landing.

    Parameters
    ----------
    interval : Interval
        The interval of the run that the samples cover.
    rows : array, ``(6, n)``
        Samples in SI units, in the order of `COLUMNS`.
    events : tuple of Event
        Events in the order of time (default: empty).
    """

    interval: Interval
    rows: FloatArray
    events: tuple[Event, ...] = ()

    def with_impulse(self, impulse: float) -> Block:
        """Return a copy of the block with an impulse (N·s) added to its first sample.

        An impulse of 0 returns the block itself.
        """
        if impulse == 0.0:
            return self
        changed = replace(self, rows=self.rows.copy())
        changed.impulse[0] += impulse
        return changed


def add_cam_state(state: FollowerState, interval: Interval) -> FollowerState:
    """Return a follower state with the cam's angle and speed added.

    They are those at the end of ``interval``.
    """
    _, angle = wrap(interval.angle_at(interval.duration))
    speed = interval.speed_at(interval.duration)
    return replace(state, cam_angle=angle, cam_speed=speed)


def require_continuation(state: FollowerState | None, interval: Interval) -> None:
    """Raise a `DynamicsError` if an interval does not continue a follower state.

    It must start at the cam angle of ``state``. A state without a cam angle, or None, is always
    accepted.
    """
    if state is None or state.cam_angle is None:
        return
    difference = abs(math.remainder(interval.angle - state.cam_angle, TURN))
    # Twice the tolerance, because the check of incoming drive data with the single tolerance may
    # accept an angle that exceeds it by rounding.
    if difference > 2.0 * ANGLE_TOLERANCE:
        raise DynamicsError(
            f"an interval from {interval.angle:.9g} rad on, for a follower that ended at "
            f"{state.cam_angle:.9g} rad of its turn; allowed: {2.0 * ANGLE_TOLERANCE:g} rad apart, "
            "or no state, which starts a new run"
        )


def speed_change(state: FollowerState | None, interval: Interval) -> float:
    """Return the increase of the cam speed (rad/s) from a state to the next interval.

    It is 0 if the difference is rounding, if ``state`` is None, or if its cam speed is unknown.
    """
    if state is None or state.cam_speed is None:
        return 0.0
    same = is_same_speed(interval.speed, state.cam_speed)
    return 0.0 if same else interval.speed - state.cam_speed


def is_same_speed(first: float, second: float) -> bool:
    """Return True if two speeds (rad/s) are equal to rounding."""
    return abs(first - second) <= SPEED_RTOL * max(abs(first), abs(second))


def add_impulses(
    rows: FloatArray, grid: SampleGrid, events: Sequence[Event], pending: float
) -> float:
    """Add the impulse of each landing to the first sample at or after it.

    ``rows`` are the samples of an interval, ``(6, n)``. ``pending`` is the impulse (N·s) of
    landings after the last sample of the previous interval, which is added to the first sample.
    Returns the impulse (N·s) of the landings after the last sample of this interval. ``events`` are
    the lift-offs and landings, and ``grid`` contains the sample times.
    """
    late = 0.0
    due = [(0, pending)] + [(grid.index_after(event.time), event.impulse) for event in events]
    for index, impulse in due:
        if index < grid.count:
            Samples(rows).impulse[index] += impulse
        else:
            late += impulse
    return late
