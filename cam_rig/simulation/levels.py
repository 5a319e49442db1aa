"""Level against rpm: from ticks to steps, and beside the published curves."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from cam_rig.acoustics import level_db
from cam_rig.arrays import FloatArray, rms
from cam_rig.errors import CamRigError
from cam_rig.schema import PublishedNoise
from cam_rig.simulation.regression import nearest_crossing, regression
from cam_rig.simulation.schedule import CamState
from cam_rig.units import NS, TURN, to_rpm


@dataclass(frozen=True)
class HeardTick:
    """One tick as the microphone heard it: r.m.s. pressure in Pa from ``start`` to ``stop_ns``.

    ``steady`` is False along a ramp.
    """

    start: CamState
    stop_ns: int
    pressure: float
    steady: bool = True


@dataclass(frozen=True, eq=False)
class NoiseCurve:
    """Measured level (dB) of one cam at each speed, and its cubic regression in rpm."""

    cam: str
    role: str
    rpm: FloatArray
    level_db: FloatArray
    coefficients: FloatArray
    rmse_db: float | None


@dataclass(frozen=True, eq=False)
class NoiseResult:
    """The noise comparison of a run."""

    curves: dict[str, NoiseCurve]
    crossover_rpm: float | None


def step_levels(ticks: Iterable[HeardTick], settle_turns: float) -> dict[str, dict[float, float]]:
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


def compare(
    levels: dict[str, dict[float, float]],
    roles: dict[str, str],
    published: PublishedNoise | None,
) -> NoiseResult:
    """Regressions of all cams, their r.m.s. difference to the published ones, the crossover."""
    curves = {}
    for cam, steps in levels.items():
        rpm = to_rpm(np.array(sorted(steps)))
        level = np.array([steps[speed] for speed in sorted(steps)])
        curves[cam] = NoiseCurve(
            cam, roles[cam], rpm, level, regression(rpm, level), _rmse(cam, rpm, level, published)
        )
    return NoiseResult(curves, _crossover(curves, published))


def _rmse(
    cam: str, rpm: FloatArray, level: FloatArray, published: PublishedNoise | None
) -> float | None:
    """r.m.s. of simulated level minus published regression, within the published range."""
    if published is None or cam not in published.regression_db:
        return None
    low, high = published.range_rpm
    inside = (rpm > low - 1e-6) & (rpm < high + 1e-6)
    if not inside.any():
        return None
    return rms(level[inside] - published.level(cam, rpm[inside]))


def _crossover(curves: dict[str, NoiseCurve], published: PublishedNoise | None) -> float | None:
    """Speed (rpm) where the regressions of the two published cams meet, None when nowhere."""
    if published is None or not set(published.crossover.between) <= set(curves):
        return None
    one, two = (curves[cam] for cam in published.crossover.between)
    difference = one.coefficients - two.coefficients
    if not np.isfinite(difference).all():
        return None
    low, high = max(one.rpm[0], two.rpm[0]), min(one.rpm[-1], two.rpm[-1])
    scaled = difference * high ** np.arange(difference.size)
    return nearest_crossing(scaled, (low, high), published.crossover.rpm, scale=high)


def require_ticks(levels: dict[str, dict[float, float]], where: str) -> None:
    """Raise when nothing was measured, naming where it was looked for."""
    if not levels:
        raise CamRigError(f"{where}: no settled tick to measure; run at least one whole step")
