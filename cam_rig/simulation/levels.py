"""Level against rpm: from ticks to steps, cubic regressions, and the published curves."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from cam_rig.acoustics import level_db
from cam_rig.arrays import FloatArray
from cam_rig.errors import CamRigError
from cam_rig.schema import PublishedNoise
from cam_rig.simulation.schedule import CamState
from cam_rig.units import NS, TURN

#: Regressions are cubic, as the paper's.
REGRESSION_DEGREE = 3
#: A number of a polynomial below this part of its largest is rounding; and such an imaginary part.
ROUNDING, ALMOST_REAL = 1e-12, 1e-9


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
        turned = state.since(first) / (TURN)
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
        rpm = np.array(sorted(steps)) * 30.0 / np.pi
        level = np.array([steps[speed] for speed in sorted(steps)])
        curves[cam] = NoiseCurve(
            cam, roles[cam], rpm, level, regression(rpm, level), _rmse(cam, rpm, level, published)
        )
    return NoiseResult(curves, _crossover(curves, published))


def regression(rpm: FloatArray, level: FloatArray) -> FloatArray:
    """Least-squares coefficients c0 … c3 of level in dB over rpm."""
    if rpm.size <= REGRESSION_DEGREE:
        return np.full(REGRESSION_DEGREE + 1, np.nan)
    fit = np.polynomial.Polynomial.fit(rpm, level, REGRESSION_DEGREE)
    found = fit.convert().coef  # without trailing zeros
    return np.pad(found, (0, REGRESSION_DEGREE + 1 - found.size))


def cubic(rpm: FloatArray) -> FloatArray:
    """``(n, n)``: takes levels at the speeds to the values of their regression there."""
    powers = np.polynomial.polynomial.polyvander(rpm / rpm.mean() - 1.0, REGRESSION_DEGREE)
    return np.asarray(powers @ np.linalg.pinv(powers))


def real_roots(coefficients: FloatArray) -> FloatArray:
    """Real roots of c0 + c1 x + …, for x of about one.

    A leading number of mere rounding is taken for zero: its own root would drown the others.
    """
    kept = np.polynomial.polynomial.polytrim(coefficients, ROUNDING * np.abs(coefficients).max())
    roots = np.polynomial.polynomial.polyroots(kept)
    return np.asarray(roots.real[np.abs(roots.imag) < ALMOST_REAL])


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
    difference = level[inside] - published.level(cam, rpm[inside])
    return float(np.sqrt(np.mean(difference**2)))


def _crossover(curves: dict[str, NoiseCurve], published: PublishedNoise | None) -> float | None:
    """Speed (rpm) where the regressions of the two published cams meet, None when nowhere."""
    if published is None or not set(published.crossover.between) <= set(curves):
        return None
    one, two = (curves[cam] for cam in published.crossover.between)
    difference = one.coefficients - two.coefficients
    if not np.isfinite(difference).all():
        return None
    low, high = max(one.rpm[0], two.rpm[0]), min(one.rpm[-1], two.rpm[-1])
    roots = real_roots(difference * high ** np.arange(difference.size)) * high
    real = [float(root) for root in roots if low <= root <= high]
    return min(real, key=lambda r: abs(r - published.crossover.rpm), default=None)


def require_ticks(levels: dict[str, dict[float, float]], where: str) -> None:
    """Raise when nothing was measured, naming where it was looked for."""
    if not levels:
        raise CamRigError(f"{where}: no settled tick to measure; run at least one whole step")
