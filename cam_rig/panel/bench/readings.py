"""What the bench reads: speed and level tick by tick, and a level that may be noted."""

from __future__ import annotations

import csv
import io
import math
from collections import deque
from dataclasses import asdict, dataclass, fields

import numpy as np

from cam_rig.acoustics import level_db
from cam_rig.acoustics.level import pressure_pa
from cam_rig.errors import RefusedError
from cam_rig.units import NS

#: Rig time (s) over which a noted level is the mean, or somewhat more, as it is of whole turns.
MEAN_S = 1.0
#: What must have passed at that speed before: so many times the meter's time constant, by which
#: what it read before has fallen by 35 dB.
SETTLED = 8.0
#: Speeds (rpm) are the same when they differ by no more than this part.
SAME_SPEED = 1e-6
#: Ticks that are kept.
MAX_TICKS = 4096
#: Readings that a bench notes, at most.
MAX_READINGS = 10_000


@dataclass(frozen=True)
class LevelOfTick:
    """One tick: when it ended (ns of rig time), how fast the cam turned (rpm), the level (dB)."""

    time_ns: int
    rpm: float
    level: float


@dataclass(frozen=True)
class NotedReading:
    """A reading as a person notes it: the mean level at a steady speed, and the set-up."""

    cam: str
    model: str
    rpm: float
    level_db: float
    weighting: str
    contact: str
    added_mass_kg: float
    spring_stiffness_n_m: float
    preload_n: float


class Meter:
    """Speeds and levels as they come, of which the last second can be noted."""

    def __init__(self) -> None:
        self._speeds: deque[tuple[int, float]] = deque(maxlen=MAX_TICKS)
        self._ticks: deque[LevelOfTick] = deque(maxlen=MAX_TICKS)

    def state(self, time_ns: int, rpm: float) -> None:
        """The cam turns at a speed from a rig time on."""
        self._speeds.append((time_ns, rpm))

    def level(self, time_ns: int, level: float) -> None:
        """The level of the tick that ends at a rig time."""
        before = [rpm for start, rpm in self._speeds if start < time_ns]
        if before:
            self._ticks.append(LevelOfTick(time_ns, before[-1], level))

    def forget(self) -> None:
        """What was read is of something else: another cam, or another weighting."""
        self._ticks.clear()

    @property
    def latest(self) -> LevelOfTick | None:
        """The newest tick."""
        return self._ticks[-1] if self._ticks else None

    def steady(self, time_constant: float) -> tuple[float, float, int]:
        """Speed (rpm) and level (dB, mean square) of the last turns, a second or more of them.

        And when they began (ns). ``time_constant`` (s) is that of the meter's time weighting.

        Raises
        ------
        RefusedError : the cam has not turned as fast for long enough
        """
        last = self.latest
        if last is None or last.rpm == 0.0:
            raise RefusedError("reading: nothing turns; allowed: start, and wait some seconds")
        same = [last]
        for tick in list(self._ticks)[-2::-1]:
            if abs(tick.rpm - last.rpm) > SAME_SPEED * last.rpm:
                break
            same.append(tick)
        span = (last.time_ns - same[-1].time_ns) / NS
        # Whole turns: the level swings within one.
        needed = math.ceil(MEAN_S * last.rpm / 60.0) * 60.0 / last.rpm
        settled = max(needed, SETTLED * time_constant) + needed
        if span < settled:
            raise RefusedError(
                f"reading: {last.rpm:.5g} rpm for {span:.1f} s of rig time; allowed: after "
                f"{settled:.1f} s"
            )
        levels = [t.level for t in same if last.time_ns - t.time_ns < (1 - 1e-6) * needed * NS]
        square = float((pressure_pa(np.array(levels)) ** 2).mean())
        return last.rpm, float(level_db(math.sqrt(square))), last.time_ns - round(needed * NS)


def to_csv(readings: list[NotedReading]) -> str:
    """The readings as CSV, a row each."""
    out = io.StringIO()
    writer = csv.DictWriter(out, [f.name for f in fields(NotedReading)], lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(reading) for reading in readings)
    return out.getvalue()
