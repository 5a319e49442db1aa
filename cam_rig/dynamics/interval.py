"""What a follower model takes and gives: an interval of the cam's motion, a block of samples."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from cam_rig.dynamics.parameters import (
    is_number,
    require_angle,
    require_number,
    require_rate,
    require_stamp,
)
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.laws.sampling import samples_before
from cam_rig.units import NS, TURN, FloatArray

# The columns of a block of samples, and of /follower/samples, by name: ``samples.force``.

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
    """The rows of a ``(6, n)`` array ``rows``, each ``(n,)`` by its name: views, never copies."""

    rows: FloatArray

    def _row(self, index: int) -> FloatArray:
        row: FloatArray = self.rows[index]
        return row

    @property
    def time(self) -> FloatArray:
        """Rig time, s."""
        return self._row(0)

    @property
    def lift(self) -> FloatArray:
        """Follower displacement, m."""
        return self._row(1)

    @property
    def velocity(self) -> FloatArray:
        """Follower velocity, m/s."""
        return self._row(2)

    @property
    def acceleration(self) -> FloatArray:
        """Follower acceleration, m/s²."""
        return self._row(3)

    @property
    def force(self) -> FloatArray:
        """Contact force, N; 0 in flight."""
        return self._row(4)

    @property
    def impulse(self) -> FloatArray:
        """Impulse of the landings since the sample before, N·s."""
        return self._row(5)

    @property
    def motion(self) -> FloatArray:
        """Lift, velocity and acceleration together, ``(3, n)``."""
        return self.rows[1:4]


@dataclass(frozen=True, eq=False)
class Samples(NamedRows):
    """The named rows of an array.

    Examples
    --------
    >>> import numpy as np
    >>> rows = np.zeros((6, 100))
    >>> Samples(rows).force[:10] = 25.0
    >>> float(rows[4, 9])
    25.0
    """

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
    """Rig time from ``start_ns`` to ``stop_ns``: θ = angle + speed t + acceleration t²/2.

    ``angle`` is the cam angle (rad) at the start, within its turn; ``turns`` are the whole turns
    before. Apart they keep every digit however long the cam turns: an angle given without turns
    has its own taken off. ``speed`` in rad/s at the start, ``acceleration`` in rad/s².

    Raises
    ------
    DynamicsError : stamps that do not rise, a number out of range, or a cam that turns back
    """

    start_ns: int
    stop_ns: int
    angle: float
    speed: float
    acceleration: float = 0.0
    turns: int = 0

    def __post_init__(self) -> None:
        for name in ("start_ns", "stop_ns"):
            require_stamp(name, getattr(self, name))
        if self.stop_ns <= self.start_ns:
            raise DynamicsError(
                f"an interval from {self.start_ns} to {self.stop_ns} ns; allowed: stamps that "
                "rise (is a second drive at work?)"
            )
        require_angle(self.angle, "an interval whose angle")
        turns, angle = wrap(self.angle, self.turns)
        object.__setattr__(self, "turns", turns)
        object.__setattr__(self, "angle", angle)
        for name in ("speed", "acceleration"):
            require_number(f"an interval whose {name}", getattr(self, name), "of either sign")
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

    def angle_at(self, time: float) -> float:
        """Cam angle (rad) at a time (s) since the start, from the turn it starts in."""
        return self.angle + time * (self.speed + 0.5 * self.acceleration * time)

    def unwrapped_at(self, time: float) -> float:
        """The same with all turns before: for people, as it loses digits turn by turn."""
        return self.turns * TURN + self.angle_at(time)

    def unwrapped(self, times: FloatArray) -> FloatArray:
        """`unwrapped_at` of many times ``(n,)``."""
        since = times * (self.speed + 0.5 * self.acceleration * times)
        return self.turns * TURN + (self.angle + since)

    def speed_at(self, time: float) -> float:
        """Speed (rad/s) at a time (s) since the start."""
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
        for i in range(count):
            since, until = length * i // count, length * (i + 1) // count
            at = since / NS
            start, stop = self.start_ns + since, self.start_ns + until
            part = replace(
                self, start_ns=start, stop_ns=stop, angle=self.angle_at(at), speed=self.speed_at(at)
            )
            parts.append(part)
        return parts

    def grid(self, sample_rate: int) -> SampleGrid:
        """The instants k / ``sample_rate`` (Hz) in [start, stop), k whole: one grid for all."""
        require_rate(sample_rate)
        first = -(-self.start_ns * sample_rate // NS)
        end = -(-self.stop_ns * sample_rate // NS)
        offset = (first * NS - self.start_ns * sample_rate) / (sample_rate * NS)
        return SampleGrid(first, end - first, offset, sample_rate)


@dataclass(frozen=True)
class SampleGrid:
    """``count`` samples of the rig's time grid; ``offset`` s from the interval's start."""

    first: int
    count: int
    offset: float
    sample_rate: int

    def since_start(self) -> FloatArray:
        """Times since the interval's start, s."""
        return self.offset + np.arange(self.count) / self.sample_rate

    def rows(self, motion: FloatArray | float = 0.0) -> FloatArray:
        """``(6, count)`` as in `COLUMNS`, of lift to contact force ``(4, count)``; no impulses."""
        rows = self.open_rows()
        rows[1:5] = motion
        return rows

    def open_rows(self) -> FloatArray:
        """``(6, count)`` with times and no impulses; lift to contact force are to be written."""
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
        first, last = self.index_after(begin), min(self.index_after(end), self.count)
        if first >= last:
            return None
        return slice(first, last), self.offset + np.arange(first, last) / self.sample_rate


EventKind = Literal["lift-off", "landing"]


@dataclass(frozen=True)
class Event:
    """A lift-off or a landing.

    ``time`` in s of rig time, ``angle`` of the cam in rad with all its turns, ``impulse`` in N·s
    and ``energy_lost`` in J (both zero at a lift-off).
    """

    kind: EventKind
    time: float
    angle: float
    impulse: float = 0.0
    energy_lost: float = 0.0


@dataclass(frozen=True)
class FollowerState:
    """Where the follower is at the end of an interval.

    ``pending_impulse`` (N·s) fell after the interval's last sample: the next block shows it.
    ``inner`` is what else the model remembers. ``cam_angle`` (rad, within the turn) and
    ``cam_speed`` (rad/s) are the cam's there: what goes on from here must begin at that angle,
    and a speed other than that is an impact on the follower, or lifts it off. None: not known.
    """

    displacement: float
    velocity: float
    contact_force: float
    in_contact: bool
    pending_impulse: float = 0.0
    inner: tuple[float, ...] = ()
    cam_angle: float | None = None
    cam_speed: float | None = None

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
    """The samples of one interval, ``(6, n)``, rows as in `COLUMNS`, and its events.

    Each row by its name: ``block.time``, ``.lift``, ``.velocity``, ``.acceleration``, ``.force``,
    ``.impulse``.
    """

    interval: Interval
    rows: FloatArray
    events: tuple[Event, ...] = field(default=())

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


# Landing impulses on the sample grid.


def show_impulses(
    rows: FloatArray, grid: SampleGrid, events: Sequence[Event], pending: float
) -> float:
    """Add each impulse to the sample at or after it; return what comes after the last one.

    ``events`` have times in s since the interval's start; ``pending`` (N·s) is what the interval
    before could not show.
    """
    late = 0.0
    due = [(0, pending)] + [(grid.index_after(event.time), event.impulse) for event in events]
    for index, impulse in due:
        if index < grid.count:
            Samples(rows).impulse[index] += impulse
        else:
            late += impulse
    return late


#: A change of the cam's velocity below this fraction of (cam speed x lift) is rounding: no step.
NO_IMPACT = 1e-12

#: A bounce is contact when it is lower than this fraction of the lift, or than so many metres,
#: a hundred thousandth of an atom.
MIN_OF_LIFT, MIN_HEIGHT = 1e-12, 1e-15


def least_bounce(law: Law) -> float:
    """Height (m) below which a bounce is contact."""
    return max(MIN_OF_LIFT * law.lift, MIN_HEIGHT)
