"""What a run of many turns is: on the cam, periodic, irregular, or not told; and its exponent."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.dynamics.steady_rules import PERIOD_RTOL
from cam_rig.dynamics.turn_map import StroboscopicMap, TurnsRun
from cam_rig.schema import RigConfig
from cam_rig.units import FloatArray

#: What bounces: one rigid mass, or a roller and an end mass on an elastic stem.
Bouncing = FollowerParameters | TwoMassParameters
ONE_MASS, TWO_MASS = "one_mass", "two_mass"
IN_CONTACT, PERIODIC, IRREGULAR, NOT_TOLD = "in contact", "periodic", "irregular", "not told"
#: The longest period is this part of the turns that are kept: it is seen so often.
SEEN = 4
#: Relative rounding error of a state.
ROUNDING = 1e-16
#: Growth is averaged by so many blocks of turns; what Student's t of them is at 95 %.
BLOCKS, STUDENT = 10, 2.262


@dataclass(frozen=True, eq=False)
class TurnMotion:
    """What a follower does, turn after turn.

    An exponent is the mean logarithm by which a small change grows in a turn, the largest first.
    What meets the cam and comes to rest there has no freedom: of one mass both are −∞, of two
    masses the last two, and the others are of the end mass on its stem. NaN: nothing is told.
    """

    motion: str
    period: int | None  #: turns after which it repeats
    settled: int | None  #: the turn from which on it does
    exponents: tuple[float, ...]  #: 1/turn
    exponent_error: float  #: of the largest, 95 %, by its convergence over the turns

    @property
    def exponent(self) -> float:
        """The largest."""
        return self.exponents[0]


def bouncing(rig: RigConfig, restitution: float | None, model: str = ONE_MASS) -> Bouncing:
    """A rig's follower, with another restitution than its own; None is its own, refused if none."""
    if restitution is None:
        rig.need("restitution", "bouncing", "give --restitution, in Python restitution")
    kind = TwoMassParameters if model == TWO_MASS else FollowerParameters
    found = kind.from_rig(rig)
    return found if restitution is None else replace(found, restitution=restitution)


def motion_of(turn_map: StroboscopicMap, run: TurnsRun, kept: int) -> TurnMotion:
    """The motion in the last ``kept`` turns of a run."""
    landings, untold = run.landings[-kept:], (math.nan,) * run.size
    if not landings.any() and not run.contact_times[-kept:].all():  # it flies, and did not land
        return TurnMotion(NOT_TOLD, None, None, untold, math.nan)
    states = run.states / turn_map.scale
    if _rounding_grows(run, turn_map.scale, kept):
        return TurnMotion(NOT_TOLD, None, None, untold, math.nan)
    period = _period(states[-kept:])
    if period is None:
        return _without_period(run.growth[-kept:])
    apart = np.abs(states[period:] - states[:-period]).max(axis=1)
    settled = int(np.flatnonzero(apart > PERIOD_RTOL)[-1]) + 1 if (apart > PERIOD_RTOL).any() else 0
    last, before = (_exponent(run.derivatives[i:][:period]) for i in (-period, -2 * period))
    error = abs(last - before) if math.isfinite(last) else 0.0
    exponents = _with_others(last, run.growth[-(kept - kept % period) :].mean(axis=0))
    if landings.any():
        return TurnMotion(PERIODIC, period, settled, exponents, error)
    landed = int(np.flatnonzero(run.landings)[-1]) + 1 if run.landings.any() else 0
    return TurnMotion(IN_CONTACT, None, max(settled, landed), exponents, error)


def _rounding_grows(run: TurnsRun, scale: FloatArray, kept: int) -> bool:
    """Return True if rounding exceeds `PERIOD_RTOL` between two rests in the last turns.

    A rest on the cam removes what came before, so that a motion with rests repeats exactly or not
    at all. The growth of a change from one rest to the next decides if that is determined.
    """
    product = None
    derivatives = run.derivatives[-kept:] / scale[:, None] * scale
    for rests, derivative in zip(run.contact_times[-kept:] > 0.0, derivatives, strict=True):
        if rests:
            product = np.eye(scale.size)
        elif product is not None:
            product = derivative @ product
            if np.abs(product).max() * ROUNDING > PERIOD_RTOL:
                return True
    return False


def _period(states: FloatArray) -> int | None:
    """The fewest turns after which states ``(turns, n)`` repeat in all the second half of them."""
    half = len(states) // 2
    for turns in range(1, len(states) // SEEN + 1):
        if np.abs(states[-half:] - states[-half - turns : -turns]).max() <= PERIOD_RTOL:
            return turns
    return None


def _exponent(derivatives: FloatArray) -> float:
    """Ln |μ| a turn, of the largest multiplier of a period."""
    product = np.eye(derivatives.shape[1])
    for one in derivatives:
        product = one @ product
    largest = float(np.abs(np.linalg.eigvals(product)).max())
    return math.log(largest) / len(derivatives) if largest > 0.0 else -math.inf


def _with_others(largest: float, growth: FloatArray) -> tuple[float, ...]:
    """The others by what directions grow by: two together as areas do, a pair of multipliers too.

    The smallest multipliers of a long product are below its rounding.
    """
    if largest == -math.inf:
        return (largest,) * growth.size
    first, second, *rest = growth.tolist()
    return (largest, first + second - largest, *rest)


def _without_period(growth: FloatArray) -> TurnMotion:
    """Irregular if the mean of the largest growth is above its error; else nothing is told."""
    largest = growth[:, 0]
    if not np.isfinite(largest).all():  # a turn began on the cam, or rests there now and then
        untold = (math.nan,) * growth.shape[1]
        return TurnMotion(NOT_TOLD, None, None, untold, math.nan)
    means = np.array([block.mean() for block in np.array_split(largest, BLOCKS)])
    exponents = tuple(growth.mean(axis=0).tolist())
    error = STUDENT * float(means.std(ddof=1)) / math.sqrt(BLOCKS)
    kind = IRREGULAR if exponents[0] > error else NOT_TOLD
    return TurnMotion(kind, None, None, exponents, error)
