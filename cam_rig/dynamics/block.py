"""What a follower model takes and gives: an interval of constant speed, a block of samples."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from cam_rig.errors import DynamicsError
from cam_rig.laws.bernstein import FloatArray

NS = 1_000_000_000
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
    """Rig time from ``start_ns`` to ``stop_ns`` while the cam turns at one speed.

    ``angle`` is the unwrapped cam angle (rad) at the start, ``speed`` in rad/s.
    """

    start_ns: int
    stop_ns: int
    angle: float
    speed: float

    def __post_init__(self) -> None:
        if self.stop_ns <= self.start_ns:
            raise DynamicsError(
                f"an interval from {self.start_ns} to {self.stop_ns} ns; allowed: stamps that "
                "rise (is a second drive at work?)"
            )

    @property
    def duration(self) -> float:
        """Length in s."""
        return (self.stop_ns - self.start_ns) / NS

    def grid(self, sample_rate: int) -> SampleGrid:
        """The instants k / ``sample_rate`` (Hz) in [start, stop), k whole: one grid for all."""
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


@dataclass(frozen=True, eq=False)
class Block:
    """The samples of one interval, ``(6, n)``, rows as in `COLUMNS`, and its events."""

    interval: Interval
    rows: FloatArray
    events: tuple[Event, ...] = field(default=())
