"""Kind and Lyapunov exponents of a bouncing motion, from a run of many turns.

The kind is in contact, periodic, irregular or undetermined.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.dynamics.steady_rules import PERIOD_RTOL
from cam_rig.dynamics.turn_map import StroboscopicMap, TurnsRun
from cam_rig.schema import RigConfig
from cam_rig.units import FloatArray

#: Parameters of followers that can bounce: one rigid mass, or a roller and an end mass on an
#: elastic stem.
Bouncing = FollowerParameters | TwoMassParameters
#: Name of the model of one rigid mass.
ONE_MASS = "one_mass"
#: Name of the model of two masses and a stem.
TWO_MASS = "two_mass"
#: Kind of a motion that does not leave the cam, as written in tables and JSON.
IN_CONTACT = "in contact"
#: Kind of a motion that repeats after a whole number of turns.
PERIODIC = "periodic"
#: Kind of a motion whose largest Lyapunov exponent is positive.
IRREGULAR = "irregular"
#: Kind of a motion that does not repeat, and whose largest Lyapunov exponent is not positive by
#: more than its error.
UNDETERMINED = "undetermined"
#: Smallest number of periods that the evaluated turns must contain for a motion to count as
#: periodic.
MIN_REPEATS = 4
#: Rounding error of a follower's state, relative to the scale of the state.
STATE_RTOL = 1e-16
#: Number of blocks into which the turns are divided. The error of an exponent follows from the
#: scatter of the means of the blocks.
BLOCKS = 10
#: Student's t for the 95 % confidence interval (two-sided) of a mean of `BLOCKS` values.
STUDENT = 2.262


@dataclass(frozen=True, eq=False)
class TurnMotion:
    """Motion of a follower, classified from its state at the end of each turn.

    A Lyapunov exponent is the mean logarithm of the growth of a small change per turn. The largest
    exponent is first, and an exponent is NaN if it is undetermined. While a mass rests on the cam
    it cannot move freely, so changes of its state are lost. One mass that rests in each period thus
    has two exponents of −∞. With two masses the last two are then −∞, and the first two describe
    the end mass on its stem.
    """

    motion: str
    period: int | None  #: turns after which the motion repeats, None if it does not
    settled: int | None  #: first turn from which on the motion repeats, None if it does not
    exponents: tuple[float, ...]  #: Lyapunov exponents, 1/turn
    #: error of the largest exponent, 1/turn: its change over the last period, or a 95 % half-width
    exponent_error: float

    @property
    def lyapunov_exponent(self) -> float:
        """Largest Lyapunov exponent, 1/turn."""
        return self.exponents[0]


def bouncing(rig: RigConfig, restitution: float | None, model: str = ONE_MASS) -> Bouncing:
    """Return the follower of a rig with a coefficient of restitution.

    ``restitution`` None selects the value of the rig, and raises a `ConfigError` if the rig has
    none. ``model`` is `ONE_MASS` or `TWO_MASS`.
    """
    if restitution is None:
        rig.need("restitution", "bouncing", "set --restitution, in Python restitution")
    kind = TwoMassParameters if model == TWO_MASS else FollowerParameters
    follower = kind.from_rig(rig)
    return follower if restitution is None else replace(follower, restitution=restitution)


def motion_of(turn_map: StroboscopicMap, run: TurnsRun, turns: int) -> TurnMotion:
    """Return the class of the motion in the last ``turns`` turns of a run.

    The class is in contact, periodic, irregular or undetermined. ``turn_map`` is the map of one
    turn with which ``run`` was computed.
    """
    landings = run.landings[-turns:]
    flies_on = not landings.any() and not run.contact_times[-turns:].all()
    if flies_on or _rounding_grows(run, turn_map.scale, turns):
        return TurnMotion(UNDETERMINED, None, None, (math.nan,) * run.size, math.nan)
    states = run.states / turn_map.scale
    period = _find_period(states[-turns:])
    if period is None:
        return _without_period(run.growth[-turns:])
    differs = np.abs(states[period:] - states[:-period]).max(axis=1) > PERIOD_RTOL
    settled = int(np.flatnonzero(differs)[-1]) + 1 if differs.any() else 0
    last, before = (_largest_exponent(run.derivatives[i:][:period]) for i in (-period, -2 * period))
    error = abs(last - before) if math.isfinite(last) else 0.0
    exponents = _all_exponents(last, run.growth[-(turns - turns % period) :].mean(axis=0))
    if landings.any():
        return TurnMotion(PERIODIC, period, settled, exponents, error)
    landed = int(np.flatnonzero(run.landings)[-1]) + 1 if run.landings.any() else 0
    return TurnMotion(IN_CONTACT, None, max(settled, landed), exponents, error)


def _rounding_grows(run: TurnsRun, scale: FloatArray, turns: int) -> bool:
    """Return True if rounding errors can grow to `PERIOD_RTOL` before the next rest.

    A rest on the cam removes all earlier differences, so a motion with rests repeats exactly or not
    at all. If a small change grows too much from one rest to the next, a repetition is not reliable
    and the motion cannot be classified. The last ``turns`` turns are evaluated. ``scale`` contains
    the magnitudes of the state.
    """
    product = None
    derivatives = run.derivatives[-turns:] / scale[:, None] * scale
    for rests, derivative in zip(run.contact_times[-turns:] > 0.0, derivatives, strict=True):
        if rests:
            product = np.eye(scale.size)
        elif product is not None:
            product = derivative @ product
            if np.abs(product).max() * STATE_RTOL > PERIOD_RTOL:
                return True
    return False


def _find_period(states: FloatArray) -> int | None:
    """Return the least number of turns after which the states repeat, or None.

    ``states`` are the scaled states at the ends of the turns, ``(turns, n)``. They must repeat in
    the whole second half of the turns, and at least `MIN_REPEATS` periods must fit into the turns.
    """
    half = len(states) // 2
    for turns in range(1, len(states) // MIN_REPEATS + 1):
        if np.abs(states[-half:] - states[-half - turns : -turns]).max() <= PERIOD_RTOL:
            return turns
    return None


def _largest_exponent(derivatives: FloatArray) -> float:
    """Return the largest Lyapunov exponent of a periodic motion, 1/turn.

    It is ln |μ| divided by the period in turns. The multiplier μ is the largest eigenvalue of the
    derivative over the period. The exponent is −∞ for μ = 0. ``derivatives`` are those of the turns
    of a period, ``(turns, n, n)``.
    """
    product = np.eye(derivatives.shape[1])
    for derivative in derivatives:
        product = derivative @ product
    largest = float(np.abs(np.linalg.eigvals(product)).max())
    return math.log(largest) / len(derivatives) if largest > 0.0 else -math.inf


def _all_exponents(largest: float, growth: FloatArray) -> tuple[float, ...]:
    """Return all Lyapunov exponents of a periodic motion, 1/turn.

    ``largest`` is the largest exponent, from the eigenvalues of the derivative over a period.
    ``growth`` is the mean logarithm of the growth of each of n directions. The first two directions
    span an area, whose growth is exact, so the second exponent is the growth of the area minus
    ``largest``. It is not computed from the small eigenvalues, because these are below the rounding
    error of a long product of derivatives.
    """
    if largest == -math.inf:
        return (largest,) * growth.size
    first, second, *others = growth.tolist()
    return (largest, first + second - largest, *others)


def _without_period(growth: FloatArray) -> TurnMotion:
    """Return the classified motion of turns that do not repeat.

    It is irregular if the largest Lyapunov exponent exceeds its error, otherwise undetermined.
    ``growth`` is the logarithm of the growth of each direction per turn, ``(turns, n)``.
    """
    largest = growth[:, 0]
    if not np.isfinite(largest).all():  # in a turn with a rest on the cam the growth is −∞
        undetermined = (math.nan,) * growth.shape[1]
        return TurnMotion(UNDETERMINED, None, None, undetermined, math.nan)
    means = np.array([block.mean() for block in np.array_split(largest, BLOCKS)])
    exponents = tuple(growth.mean(axis=0).tolist())
    error = STUDENT * float(means.std(ddof=1)) / math.sqrt(BLOCKS)
    kind = IRREGULAR if exponents[0] > error else UNDETERMINED
    return TurnMotion(kind, None, None, exponents, error)
