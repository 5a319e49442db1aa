"""What a run of many turns is: on the cam, periodic, irregular, or not told; and its exponent."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.turn_map import StroboscopicMap, TurnsRun
from cam_rig.schema import RigConfig
from cam_rig.units import FloatArray

IN_CONTACT, PERIODIC, IRREGULAR, NOT_TOLD = "in contact", "periodic", "irregular", "not told"
#: Two turns are alike where gap and rate differ by no more than this part of the lift, and of the
#: lift times the cam's speed.
ALIKE = 1e-9
#: The longest period is this part of the turns that are kept: it is seen so often.
SEEN = 4
#: Growth is averaged by so many blocks of turns; what Student's t of them is at 95 %.
BLOCKS, STUDENT = 10, 2.262


@dataclass(frozen=True)
class TurnMotion:
    """What a follower does, turn after turn.

    The exponent is the mean logarithm by which a small change grows in a turn: −∞ where the
    follower comes to rest on the cam, on which it has no freedom; NaN where nothing is told.
    """

    kind: str
    period: int | None  #: turns after which it repeats
    settled: int | None  #: the turn from which on it does
    exponent: float  #: 1/turn
    error: float  #: of the exponent, 95 %, by its convergence over the turns


def bouncing(rig: RigConfig, restitution: float | None) -> FollowerParameters:
    """One rigid mass of a rig, with another restitution than its own, or with its own for None.

    Raises
    ------
    ConfigError : neither tells a restitution
    """
    if restitution is None:
        rig.need("restitution", "bouncing", "give --restitution, in Python restitution")
        return FollowerParameters.from_rig(rig)
    return replace(FollowerParameters.from_rig(rig), restitution=restitution)


def motion_of(turn_map: StroboscopicMap, run: TurnsRun, kept: int) -> TurnMotion:
    """The motion in the last ``kept`` turns of a run."""
    landings, on_cam = run.landings[-kept:], run.on_cam[-kept:]
    if not landings.any():
        if not on_cam.all():  # it flies, and did not land in all these turns
            return TurnMotion(NOT_TOLD, None, None, math.nan, math.nan)
        first = int(np.flatnonzero(run.landings)[-1]) + 1 if run.landings.any() else 0
        return TurnMotion(IN_CONTACT, None, first, -math.inf, 0.0)
    states = run.states / (turn_map.law.lift * np.array([1.0, turn_map.speed]))
    period = _period(states[-kept:])
    if period is None:
        return _without_period(run.growth[-kept:, 0])
    apart = np.abs(states[period:] - states[:-period]).max(axis=1)
    settled = int(np.flatnonzero(apart > ALIKE)[-1]) + 1 if (apart > ALIKE).any() else 0
    last, before = (_exponent(run.derivatives[i:][:period]) for i in (-period, -2 * period))
    error = abs(last - before) if math.isfinite(last) else 0.0
    return TurnMotion(PERIODIC, period, settled, last, error)


def _period(states: FloatArray) -> int | None:
    """The fewest turns after which states ``(n, 2)`` repeat in all the second half of them."""
    half = len(states) // 2
    for turns in range(1, len(states) // SEEN + 1):
        if np.abs(states[-half:] - states[-half - turns : -turns]).max() <= ALIKE:
            return turns
    return None


def _exponent(derivatives: FloatArray) -> float:
    """Ln |μ| a turn, of the largest multiplier of a period."""
    product = np.eye(2)
    for one in derivatives:
        product = one @ product
    largest = float(np.abs(np.linalg.eigvals(product)).max())
    return math.log(largest) / len(derivatives) if largest > 0.0 else -math.inf


def _without_period(growth: FloatArray) -> TurnMotion:
    """Irregular if the mean growth ``(n,)`` is above its error; else nothing is told."""
    if not np.isfinite(growth).all():  # a turn began on the cam, or rests there now and then
        return TurnMotion(NOT_TOLD, None, None, math.nan, math.nan)
    means = np.array([block.mean() for block in np.array_split(growth, BLOCKS)])
    exponent = float(growth.mean())
    error = STUDENT * float(means.std(ddof=1)) / math.sqrt(BLOCKS)
    return TurnMotion(IRREGULAR if exponent > error else NOT_TOLD, None, None, exponent, error)
