"""When a recording goes on in a new file of its bag."""

from __future__ import annotations

import re
from dataclasses import dataclass

from cam_rig.errors import ConfigError
from cam_rig.units import NS

#: Least size (bytes) and duration (s) of a file: every file repeats the scene and its cams.
MIN_FILE_BYTES, MIN_FILE_S = 1_000_000, 1.0
#: Files of a bag whose names are sure to have room.
MAX_NUMBER = 99_999
#: Greatest duration of a file, s: ten years.
MAX_FILE_S = 3.2e8
#: Factors of the units in which a file's size or duration may be given.
SIZES = {"MB": 1e6, "GB": 1e9, "MiB": 2.0**20, "GiB": 2.0**30}
TIMES = {"s": 1.0, "min": 60.0, "h": 3600.0}
AMOUNT = re.compile(r"\s*(\d{1,12}(?:\.\d{1,9})?)\s*([A-Za-z]+)\s*")


@dataclass(frozen=True)
class Split:
    """The limits of each file of a bag, as `ros2 bag record` has them; 0 is none.

    ``size`` is bytes of messages, without what is attached to each file; ``duration`` rig time, s.
    A file ends with the tick in which it comes to a limit: the next state of the cam begins the
    next file, so that a tick is never divided.
    """

    size: int = 0
    duration: float = 0.0

    @property
    def last_number(self) -> int:
        """The greatest number that a file's name must have room for."""
        return MAX_NUMBER if self.size or self.duration else 0

    @property
    def parameters(self) -> dict[str, float]:
        """The recorder's parameters, by the names that rosbag2 has for them."""
        return {"max_bagfile_size": self.size, "max_bagfile_duration": self.duration}

    def is_due(self, size: int, begin: int, now: int) -> bool:
        """Whether a file of some size that begins at a log time (ns) is to end before ``now``."""
        by_size = self.size > 0 and size >= self.size
        return by_size or (self.duration > 0.0 and now - begin > self.duration * NS)

    @classmethod
    def parsed(cls, text: str) -> Split:
        """The limits by words: ``100MB``, ``1.5 GiB``, ``60s``, ``10min``."""
        found = AMOUNT.fullmatch(text)
        units = ", ".join((*SIZES, *TIMES))
        if found is None or found[2] not in SIZES | TIMES:
            raise ConfigError(
                f"split: is {text[:40]!r}; allowed: a number and one of {units}, as 100MB or 60s"
            )
        amount, what = float(found[1]), f"split: is {text.strip()}"
        if found[2] in SIZES:
            return cls(size=_checked_size(round(amount * SIZES[found[2]]), what))
        return cls(duration=_checked_duration(amount * TIMES[found[2]], what))


def _checked_size(size: int, what: str) -> int:
    if not MIN_FILE_BYTES <= size < 2**63:
        raise ConfigError(
            f"{what}; allowed: a file of {MIN_FILE_BYTES} bytes ({MIN_FILE_BYTES / 1e6:g} MB) or "
            "more, as it repeats the scene and its cams"
        )
    return size


def _checked_duration(duration: float, what: str) -> float:
    if not MIN_FILE_S <= duration <= MAX_FILE_S:
        raise ConfigError(
            f"{what}; allowed: a file of {MIN_FILE_S:g} to {MAX_FILE_S:g} s of rig time"
        )
    return duration


def check_parameter_size(size: int) -> None:
    """Refuse a value of the parameter max_bagfile_size; 0 is no limit."""
    if size != 0:
        _checked_size(size, f"max_bagfile_size: is {size}")


def check_parameter_duration(duration: float) -> None:
    """Refuse a value of the parameter max_bagfile_duration; 0 is no limit."""
    if duration != 0.0:
        _checked_duration(duration, f"max_bagfile_duration: is {duration:g}")
