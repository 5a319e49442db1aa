"""What a follower model takes and gives: an interval of constant speed, a block of samples."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from cam_rig.dynamics.numbers import (
    is_number,
    require_angle,
    require_number,
    require_rate,
    require_stamp,
)
from cam_rig.errors import DynamicsError
from cam_rig.laws.bernstein import FloatArray

NS = 1_000_000_000
#: A speed this small beside the other end's is rest: a ramp down to it ends there by rounding.
REST = 1e-9
#: Rows of a block, with their units.
COLUMNS = (
    "t [s]",
    "lift [m]",
    "velocity [m/s]",
    "acceleration [m/s^2]",
    "contact_force [N]",
    "contact_impulse [N*s]",
)


@dataclass(frozen=True)
class Interval:
    """Rig time from ``start_ns`` to ``stop_ns``: θ = angle + speed t + acceleration t²/2.

    ``angle`` is the unwrapped cam angle (rad) at the start, ``speed`` in rad/s there,
    ``acceleration`` in rad/s².

    Raises
    ------
    DynamicsError : stamps that do not rise, a number out of range, or a cam that turns back
    """

    start_ns: int
    stop_ns: int
    angle: float
    speed: float
    acceleration: float = 0.0

    def __post_init__(self) -> None:
        for name in ("start_ns", "stop_ns"):
            require_stamp(name, getattr(self, name))
        if self.stop_ns <= self.start_ns:
            raise DynamicsError(
                f"an interval from {self.start_ns} to {self.stop_ns} ns; allowed: stamps that "
                "rise (is a second drive at work?)"
            )
        require_angle(self.angle, "an interval whose angle")
        for name in ("speed", "acceleration"):
            require_number(f"an interval whose {name}", getattr(self, name), "of either sign")
        require_angle(self.angle_at(self.duration), "an interval whose last angle")
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
        """Cam angle (rad) at a time (s) since the start."""
        return self.angle + time * (self.speed + 0.5 * self.acceleration * time)

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

    def index_after(self, time: float) -> int:
        """Index of the first sample at or after ``time`` (s since the interval's start)."""
        return max(0, int(np.ceil((time - self.offset) * self.sample_rate)))


EventKind = Literal["lift-off", "landing"]


@dataclass(frozen=True)
class Event:
    """The follower leaves the cam or meets it again.

    ``time`` in s of rig time, ``angle`` of the cam in rad, ``impulse`` in N·s and
    ``energy_lost`` in J (both zero at a lift-off).
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
    ``inner`` is what else the model remembers: (y, ẏ) of the two-mass model's end mass.
    """

    displacement: float
    velocity: float
    contact_force: float
    in_contact: bool
    pending_impulse: float = 0.0
    inner: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            numbers = value if isinstance(value, tuple) else (value,)
            for number in numbers:
                if name != "in_contact" and not is_number(number):
                    raise DynamicsError(
                        f"a follower whose {name} is {number!r}; allowed: finite numbers"
                    )


@dataclass(frozen=True, eq=False)
class Block:
    """The samples of one interval, ``(6, n)``, rows as in `COLUMNS`, and its events."""

    interval: Interval
    rows: FloatArray
    events: tuple[Event, ...] = field(default=())
