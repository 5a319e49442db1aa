"""The columns of an exported run: names, units, and where each comes from."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from cam_rig.arrays import FloatArray
from cam_rig.simulation.tick_samples import TickSamples

#: Rows that are written at once, at least: a tick alone may have a few.
CHUNK_ROWS = 1 << 16
#: The column of text; the others are numbers.
CAM = "cam"


@dataclass(frozen=True)
class ExportColumn:
    """A column of numbers: its name with the unit in it, the unit, and what it is."""

    name: str
    unit: str
    meaning: str
    of: Callable[[TickSamples], FloatArray]


COLUMNS = (
    ExportColumn("time_s", "s", "rig time", lambda tick: tick.time),
    ExportColumn("rpm", "rpm", "cam speed", lambda tick: np.round(tick.rpm, 9)),
    ExportColumn("angle_rad", "rad", "cam angle θ with all its turns", lambda tick: tick.angle),
    ExportColumn(
        "angle_in_turn_rad", "rad", "cam angle θ from 0 to 2π", lambda tick: tick.angle_in_turn
    ),
    ExportColumn("lift_m", "m", "follower displacement", lambda tick: tick.lift),
    ExportColumn("velocity_m_s", "m/s", "follower velocity", lambda tick: tick.velocity),
    ExportColumn(
        "acceleration_m_s2", "m/s²", "follower acceleration", lambda tick: tick.acceleration
    ),
    ExportColumn("force_N", "N", "contact force, 0 in flight", lambda tick: tick.force),
    ExportColumn(
        "impulse_N_s", "N·s", "landings since the sample before", lambda tick: tick.impulse
    ),
)


@dataclass(frozen=True, eq=False)
class Chunk:
    """Some rows: ``numbers`` ``(k, n)`` as in `COLUMNS`; ``cams`` and ``counts`` run by run."""

    numbers: FloatArray
    cams: tuple[str, ...]
    counts: tuple[int, ...]

    @property
    def names(self) -> NDArray[np.str_]:
        """The cam of each row, ``(n,)``."""
        return np.repeat(np.array(self.cams), self.counts)


@dataclass
class Contents:
    """What an export held, known when it is over.

    ``rows``, ``begin`` and ``end`` (s, of first and last sample) and ``gaps``: how often samples
    are missing between two, where messages were lost, the cam stood, or a step was left out.
    """

    rate: int
    rows: int = 0
    gaps: int = 0
    begin: float = 0.0
    end: float = 0.0
    there: dict[str, None] = field(default_factory=dict)

    def follow(self, chunks: Iterable[Chunk]) -> Iterator[Chunk]:
        """The same chunks, taken note of."""
        for chunk in chunks:
            number = np.rint(chunk.numbers[0] * self.rate)
            if not self.rows:
                self.begin = float(chunk.numbers[0, 0])
            else:
                self.gaps += int(number[0] != np.rint(self.end * self.rate) + 1.0)
            self.gaps += int(np.count_nonzero(np.diff(number) != 1.0))
            self.rows += number.size
            self.end = float(chunk.numbers[0, -1])
            yield chunk


def chunks(ticks: Iterable[TickSamples]) -> Iterator[Chunk]:
    """The ticks as chunks of rows; no more than one chunk is held."""
    held: list[TickSamples] = []
    count = 0
    for tick in ticks:
        held.append(tick)
        count += tick.time.size
        if count >= CHUNK_ROWS:
            yield _joined(held)
            held, count = [], 0
    if count:
        yield _joined(held)


def _joined(ticks: list[TickSamples]) -> Chunk:
    numbers = [np.hstack([column.of(tick) for tick in ticks]) for column in COLUMNS]
    cams, counts = zip(*((tick.cam, tick.time.size) for tick in ticks), strict=True)
    return Chunk(np.stack(numbers), cams, counts)
