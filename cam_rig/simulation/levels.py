"""Sound pressure level of each cam at each speed, from the ticks of a run."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from cam_rig.acoustics import level_db
from cam_rig.errors import CamRigError
from cam_rig.simulation.schedule import CamState
from cam_rig.units import NS, TURN


@dataclass(frozen=True)
class MeasuredTick:
    """The microphone's r.m.s. pressure (Pa) over one tick, from ``start`` to ``stop_ns``.

    ``steady`` is False along a ramp.
    """

    start: CamState
    stop_ns: int
    pressure: float
    steady: bool = True


def step_levels(
    ticks: Iterable[MeasuredTick], settle_turns: float
) -> dict[str, dict[float, float]]:
    """Level in dB by cam and speed (rad/s): the energy mean over the step's settled ticks.

    A step is a run of ticks of one cam at one speed; its first ``settle_turns`` are left out,
    and ramps are.
    """
    energy: dict[tuple[str, float], list[float]] = {}
    first: CamState | None = None
    for tick in ticks:
        state = tick.start
        if not tick.steady:
            continue
        if first is None or (state.cam, state.speed) != (first.cam, first.speed):
            first = state
        turned = state.since(first) / TURN
        if turned > settle_turns - 1e-6:
            duration = (tick.stop_ns - state.time_ns) / NS
            total = energy.setdefault((state.cam, state.speed), [0.0, 0.0])
            total[0] += tick.pressure**2 * duration
            total[1] += duration
    levels: dict[str, dict[float, float]] = {}
    for (cam, speed), (square, duration) in energy.items():
        levels.setdefault(cam, {})[speed] = float(level_db(np.sqrt(square / duration)))
    return levels


def require_ticks(levels: dict[str, dict[float, float]], where: str) -> None:
    """Raise when nothing was measured, naming where it was looked for."""
    if not levels:
        raise CamRigError(f"{where}: no settled tick to measure; run at least one whole step")
