"""Limits of size and duration at which a recording continues in a new file."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

from cam_rig.errors import ConfigError
from cam_rig.units import NS

#: Smallest accepted limit of the size of a file, bytes. Every file repeats the scene and its cams.
MIN_FILE_BYTES = 1_000_000
#: Smallest accepted limit of the duration of a file, s of rig time.
MIN_FILE_S = 1.0
#: Largest number of a file in a bag for which the file name must have room. This is checked before
#: a run.
MAX_NUMBER = 99_999
#: Largest accepted limit of the duration of a file, s: ten years.
MAX_FILE_S = 3.2e8
#: Accepted units for the limit of a file's size, with their factors to bytes.
SIZES = {"MB": 1e6, "GB": 1e9, "MiB": 2.0**20, "GiB": 2.0**30}
#: Accepted units for the limit of a file's duration, with their factors to s.
TIMES = {"s": 1.0, "min": 60.0, "h": 3600.0}
#: Pattern of a limit of a file's size or duration: number and unit.
AMOUNT = re.compile(r"\s*(\d{1,12}(?:\.\d{1,9})?)\s*([A-Za-z]+)\s*")


@dataclass(frozen=True)
class Split:
    """Limits of each file of a bag, as in `ros2 bag record`.

    The value 0 is no limit. `size` is the number of bytes of messages, without the files that are
    attached. `duration` is rig time in s. A file ends with the tick that reaches a limit. The next
    cam state starts the next file, so that a tick is never divided. A tick is the time between two
    cam states.
    """

    size: int = 0
    duration: float = 0.0

    @property
    def last_number(self) -> int:
        """Largest file number for which the name of a file must have room.

        It is 0 if the bag is not divided into several files.
        """
        return MAX_NUMBER if self.size or self.duration else 0

    @property
    def parameters(self) -> dict[str, float]:
        """Limits of file size (bytes) and duration (s), by rosbag2's parameter names."""
        return {"max_bagfile_size": self.size, "max_bagfile_duration": self.duration}

    def is_due(self, size: int, start: int, stamp: int) -> bool:
        """Return True if a file has to end before the time `stamp` (ns).

        `size` is the number of bytes of the file, and `start` its first log time (ns).
        """
        by_size = self.size > 0 and size >= self.size
        return by_size or (self.duration > 0.0 and stamp - start > self.duration * NS)

    @classmethod
    def parse(cls, size: str | None, duration: str | None) -> Split:
        """Parse limits with units, such as ``1.5 GiB`` for the size and ``60s`` for time.

        Raises ConfigError for another text, or an amount that is out of range. `size` and
        `duration` are texts, None for no limit.
        """
        limits = cls()
        if size is not None:
            size_bytes = round(_amount("max-bag-size", size, SIZES))
            _require_size(size_bytes, "max-bag-size", size)
            limits = replace(limits, size=size_bytes)
        if duration is not None:
            seconds = _amount("max-bag-duration", duration, TIMES)
            _require_duration(seconds, "max-bag-duration", duration)
            limits = replace(limits, duration=seconds)
        return limits


def _amount(option: str, text: str, units: dict[str, float]) -> float:
    """Parse a number with a unit, and return it in the base unit (bytes or s).

    `units` contains the factor of each accepted unit. `option` is the name of the option in an
    error message.
    """
    match = AMOUNT.fullmatch(text)
    if match is None or match[2] not in units:
        raise ConfigError(
            f"{option} must be a number with a unit ({', '.join(units)}), got {text[:40]!r}"
        )
    return float(match[1]) * units[match[2]]


def _require_size(size: int, name: str, text: str) -> None:
    if not MIN_FILE_BYTES <= size < 2**63:
        raise ConfigError(
            f"{name} must be at least {MIN_FILE_BYTES / 1e6:g} MB, because each file repeats the "
            f"scene and its cams, got {text}"
        )


def _require_duration(duration: float, name: str, text: str) -> None:
    if not MIN_FILE_S <= duration <= MAX_FILE_S:
        raise ConfigError(
            f"{name} must be between {MIN_FILE_S:g} and {MAX_FILE_S:g} s of rig time, got {text}"
        )


def check_parameter_size(size: int) -> None:
    """Raise ConfigError if a value of max_bagfile_size is not allowed.

    The value is in bytes. The value 0 is no limit.
    """
    if size != 0:
        _require_size(size, "max_bagfile_size", f"{size} bytes")


def check_parameter_duration(duration: float) -> None:
    """Raise ConfigError if a value of max_bagfile_duration is not allowed.

    The value is in s. The value 0 is no limit.
    """
    if duration != 0.0:
        _require_duration(duration, "max_bagfile_duration", f"{duration:g} s")
