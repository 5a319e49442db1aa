"""Sound pressure level of each cam at each speed, from the ticks of a run."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from cam_rig.acoustics import level_db
from cam_rig.errors import CamRigError
from cam_rig.simulation.schedule import CamState
from cam_rig.units import TURN


@dataclass(frozen=True)
class MeasuredTick:
    """The microphone's r.m.s. pressure (Pa) over one tick, from ``start`` to ``stop_ns``.

    ``samples`` are those of the tick, of which the pressure is the mean. ``steady`` is False along
    a ramp.
    """

    start: CamState
    stop_ns: int
    pressure: float
    samples: int
    steady: bool = True

    @classmethod
    def between(
        cls, start: CamState, end: CamState, pressure: float, sample_rate: int
    ) -> MeasuredTick:
        """The tick from one cam state to the next, of samples at ``sample_rate`` (Hz)."""
        interval = start.until(end)
        count = interval.grid(sample_rate).count
        return cls(start, end.time_ns, pressure, count, interval.acceleration == 0.0)


@dataclass
class Settling:
    """Which ticks of a run are settled.

    A step is a run of ticks of one cam at one speed; its first ``turns`` are left out, and ramps
    are.
    """

    turns: float
    _first: CamState | None = field(default=None, init=False)

    def is_over(self, start: CamState, steady: bool) -> bool:
        """Whether the tick that begins at ``start`` is settled; to be asked of each in order."""
        if not steady:
            return False
        if self._first is None or (start.cam, start.speed) != (self._first.cam, self._first.speed):
            self._first = start
        return start.since(self._first) / TURN > self.turns - 1e-6


def step_levels(
    ticks: Iterable[MeasuredTick], settle_turns: float
) -> dict[str, dict[float, float]]:
    """Level in dB by cam and speed (rad/s): the energy mean over the step's settled samples.

    Each tick counts by its samples, not by its time: short ticks of one length may have two or
    three, and every sample weighs the same however the turn is divided.
    """
    energy: dict[tuple[str, float], list[float]] = {}
    settling = Settling(settle_turns)
    for tick in ticks:
        if settling.is_over(tick.start, tick.steady):
            total = energy.setdefault((tick.start.cam, tick.start.speed), [0.0, 0.0])
            total[0] += tick.pressure**2 * tick.samples
            total[1] += tick.samples
    levels: dict[str, dict[float, float]] = {}
    for (cam, speed), (square, samples) in energy.items():
        levels.setdefault(cam, {})[speed] = float(level_db(np.sqrt(square / samples)))
    return levels


def require_ticks(levels: dict[str, dict[float, float]], where: str) -> None:
    """Raise when nothing was measured, naming where it was looked for."""
    if not levels:
        raise CamRigError(f"{where}: no settled tick to measure; run at least one whole step")
