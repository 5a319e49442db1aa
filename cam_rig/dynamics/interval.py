"""What a follower model takes and gives: an interval of the cam's motion, a block of samples."""

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

#: Rows of a block, with their units.
COLUMNS = (
    "t [s]",
    "lift [m]",
    "velocity [m/s]",
    "acceleration [m/s^2]",
    "contact_force [N]",
    "contact_impulse [N*s]",
)


class NamedRows:
    """The rows of a ``(6, n)`` array ``rows``, each ``(n,)`` by its name."""

    rows: FloatArray

    @property
    def time(self) -> FloatArray:
        """Rig time, s."""
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
        """Contact force, N; 0 in flight."""
        return self.rows[4, :]

    @property
    def impulse(self) -> FloatArray:
        """Impulse of the landings since the sample before, N·s."""
        return self.rows[5, :]

    @property
    def motion(self) -> FloatArray:
        """Lift, velocity and acceleration together, ``(3, n)``."""
        return self.rows[1:4]


@dataclass(frozen=True, eq=False)
class Samples(NamedRows):
    """The named rows of an array."""

    rows: FloatArray


#: Times that are reckoned together: they stay in a core's own memory from one step to the next.
IN_CACHE = 8192

_COUNTED = np.arange(IN_CACHE, dtype=np.float64)
#: A speed this small beside the other end's is rest: a ramp down to it ends there by rounding.
REST = 1e-9
#: Speeds that differ by less than this fraction are one: a ramp ends at its last speed to rounding.
SAME_SPEED = 1e-12
#: An interval may begin this far (rad) from the cam angle where the one before ended: rounding.
ANGLE_TOLERANCE = 1e-6


def wrap(angle: float, turns: int = 0) -> tuple[int, float]:
    """Whole turns and what is left of an angle (rad), in [0, 2π)."""
    if 0.0 <= angle < TURN:
        return turns, angle
    whole = math.floor(angle / TURN)
    rest = angle - whole * TURN
    if not 0.0 <= rest < TURN:  # by rounding, which is many turns of an angle of 1e18
        rest = math.fmod(angle, TURN)
        rest = rest + TURN if rest < 0.0 else rest
        whole = round((angle - rest) / TURN)
    return (turns + whole, rest) if rest < TURN else (turns + whole + 1, 0.0)


@dataclass(frozen=True)
class Interval:
    """A stretch of rig time: θ = angle + speed t + acceleration t²/2.

    Angle and turns apart keep every digit however long the cam turns: an angle given without turns
    has its own taken off. A `DynamicsError` for stamps that do not rise, a number out of range, or
    a cam that turns back.
    """

    start_ns: int
    stop_ns: int
    angle: float  #: of the cam at the start, within its turn, rad
    speed: float  #: at the start, rad/s
    acceleration: float = 0.0  #: rad/s²
    turns: int = 0  #: whole turns before

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
        if self.acceleration != 0.0 and min(self.speed, end) < -REST * max(self.speed, end):
            raise DynamicsError(
                f"a ramp from {self.speed:g} to {end:g} rad/s; allowed: from rest or forwards"
            )

    @property
    def duration(self) -> float:
        """Length in s."""
        return (self.stop_ns - self.start_ns) / NS

    @property
    def mean_speed(self) -> float:
        """Mean speed, rad/s."""
        return self.speed + 0.5 * self.acceleration * self.duration

    def angle_at(self, time: Time) -> Time:
        """Cam angle (rad) at times (s) since the start, from the turn it starts in."""
        return self.angle + time * (self.speed + 0.5 * self.acceleration * time)

    def unwrapped_at(self, time: Time) -> Time:
        """The same with all turns before: for people, as it loses digits turn by turn."""
        return self.turns * TURN + self.angle_at(time)

    def speed_at(self, time: Time) -> Time:
        """Speed (rad/s) at times (s) since the start."""
        return self.speed + self.acceleration * time

    def time_at(self, angle: float) -> float:
        """Time (s) since the start at which the cam comes to an angle (rad), infinity if never."""
        ahead = angle - self.angle
        square = self.speed**2 + 2.0 * self.acceleration * ahead
        if square < 0.0 or self.speed + math.sqrt(square) <= 0.0:
            return 0.0 if ahead <= 0.0 else math.inf
        return 2.0 * ahead / (self.speed + math.sqrt(square))

    def split(self, most: float) -> list[Interval]:
        """Parts of equal time, as many as hold the cam to ``most`` rad in each at full speed."""
        fastest = max(abs(self.speed), abs(self.speed_at(self.duration)))
        length = self.stop_ns - self.start_ns
        count = min(max(1, math.ceil(fastest * self.duration / most)), length)
        parts = []
        for a, b in pairwise(length * i // count for i in range(count + 1)):
            angle, speed = self.angle_at(a / NS), self.speed_at(a / NS)
            stamps = self.start_ns + a, self.start_ns + b
            parts.append(Interval(*stamps, angle, speed, self.acceleration, self.turns))
        return parts

    def grid(self, sample_rate: int) -> SampleGrid:
        """The instants k / ``sample_rate`` (Hz) in [start, stop), k whole: one grid for all."""
        rate: object = sample_rate  # whatever a caller gives
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
    """An interval's samples of the rig's time grid."""

    first: int  #: number of the first one
    count: int
    offset: float  #: of the first one from the interval's start, s
    sample_rate: int  #: Hz
    duration: float  #: of the interval, s

    def since_start(self) -> FloatArray:
        """Times since the interval's start, s."""
        return self.offset + np.arange(self.count) / self.sample_rate

    def open_rows(self) -> FloatArray:
        """``(6, count)`` as in `COLUMNS`, without impulses; lift to force are to be written."""
        rows = np.empty((len(COLUMNS), self.count))
        for begin in range(0, self.count, IN_CACHE):
            times = rows[0, begin : begin + IN_CACHE]
            np.add(_COUNTED[: times.size], float(self.first + begin), out=times)
            times /= self.sample_rate
        rows[5] = 0.0
        return rows

    def index_after(self, time: float) -> int:
        """Index of the first sample at or after ``time`` (s since the interval's start)."""
        return samples_before((time - self.offset) * self.sample_rate)

    def within(self, begin: float, end: float) -> tuple[slice, FloatArray] | None:
        """Which samples lie between two times (s since the interval's start), and when; or None."""
        # The last sample may be so near the interval's end that it is at it, and is this one's.
        last = self.count if end >= self.duration else min(self.index_after(end), self.count)
        first = self.index_after(begin)
        if first >= last:
            return None
        return slice(first, last), self.offset + np.arange(first, last) / self.sample_rate


class Event(NamedTuple):
    """A lift-off or a landing."""

    kind: EventKind
    time: float  #: s of rig time
    angle: float  #: of the cam, rad, with all its turns
    impulse: float = 0.0  #: N·s, 0 at a lift-off
    energy_lost: float = 0.0  #: J, 0 at a lift-off


@dataclass(frozen=True)
class FollowerState:
    """Where the follower is at the end of an interval.

    What goes on from here must begin at ``cam_angle``; a speed other than ``cam_speed`` is an
    impact on the follower, or lifts it off.
    """

    displacement: float  #: m
    velocity: float  #: m/s
    contact_force: float  #: N
    in_contact: bool
    pending_impulse: float = 0.0  #: N·s, after the last sample: the next block shows it
    inner: tuple[float, ...] = ()  #: what else the model remembers
    cam_angle: float | None = None  #: rad, within the turn; None: not known
    cam_speed: float | None = None  #: rad/s; None: not known

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
    """The samples of one interval, ``(6, n)``, rows as in `COLUMNS`, and its events."""

    interval: Interval
    rows: FloatArray
    events: tuple[Event, ...] = ()

    def with_impulse(self, impulse: float) -> Block:
        """The block with more impulse (N·s) at its first sample."""
        if impulse == 0.0:
            return self
        changed = replace(self, rows=self.rows.copy())
        changed.impulse[0] += impulse
        return changed


def ended(state: FollowerState, interval: Interval) -> FollowerState:
    """A state with the cam's angle and speed at the end of its interval."""
    _, angle = wrap(interval.angle_at(interval.duration))
    speed = interval.speed_at(interval.duration)
    return replace(state, cam_angle=angle, cam_speed=speed)


def require_joined(state: FollowerState | None, interval: Interval) -> None:
    """Refuse an interval that does not begin at the cam angle where the state ended."""
    if state is None or state.cam_angle is None:
        return
    away = abs(math.remainder(interval.angle - state.cam_angle, TURN))
    if away > 2.0 * ANGLE_TOLERANCE:  # a validator that lets half of it pass may round
        raise DynamicsError(
            f"an interval from {interval.angle:.9g} rad on, for a follower that ended at "
            f"{state.cam_angle:.9g} rad of its turn; allowed: {2.0 * ANGLE_TOLERANCE:g} rad apart, "
            "or no state, which puts it down anew"
        )


def speed_change(state: FollowerState | None, interval: Interval) -> float:
    """By how much (rad/s) the cam is faster than where the state ended; rounding counts as 0."""
    if state is None or state.cam_speed is None:
        return 0.0
    same = same_speed(interval.speed, state.cam_speed)
    return 0.0 if same else interval.speed - state.cam_speed


def same_speed(one: float, other: float) -> bool:
    """Whether two speeds (rad/s) are one, but for rounding."""
    return abs(one - other) <= SAME_SPEED * max(abs(one), abs(other))


def show_impulses(
    rows: FloatArray, grid: SampleGrid, events: Sequence[Event], pending: float
) -> float:
    """Add impulses to the samples at or after them; return what (N·s) comes after the last."""
    late = 0.0
    due = [(0, pending)] + [(grid.index_after(event.time), event.impulse) for event in events]
    for index, impulse in due:
        if index < grid.count:
            Samples(rows).impulse[index] += impulse
        else:
            late += impulse
    return late
