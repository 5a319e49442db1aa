"""Where the least contact force of a run first falls to zero, going through the speeds upwards.

That force is not monotone in speed: the stem is in resonance with the cam at each harmonic, where
the follower may lose contact and keep it again a little faster. So the search takes all speeds
from the slowest on, in steps in which the phase of the free vibration turns by no more than half
a radian over its decay time: half of a resonance's half-width in steady state. A cheap bound comes
first, over as wide a range of speeds as it holds for.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize_scalar

from cam_rig.dynamics.modal_minimum import ModalRun, TooManyLooksError
from cam_rig.dynamics.modal_response import ModalResponse
from cam_rig.dynamics.two_mass.masses import TwoMassParameters, contact_response, force_output
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.units import RPM, TURN, FloatArray, to_rpm

#: Where the search begins and ends, rpm.
SLOWEST, FASTEST = 1.0, 1e5
#: The phase of the free vibration turns by this much (rad) from one speed to the next.
PHASE_STEP = 0.5
#: Speeds looked at together, and a dip's second look.
TOGETHER, CLOSER = 64, 33
#: Of these so many are looked at in one step.
FEW = 12
#: A damping ratio below this counts as 0: a search in steady state would have no end.
UNDAMPED = 1e-7
#: A zero is polished to this part of the speed, and of the bracket it was found in.
POLISHED, POLISHED_IN = 5e-7, 1e-3
#: A search looks at so many values of the force at most: half a minute's work.
MAX_LOOKS = 5e7
#: Finer than this rounding decides.
MAX_POLISHED = 1e-13


@dataclass(frozen=True)
class Sought:
    """A zero of the least force in a bracket narrower than a resonance, however little damped."""

    low: float  #: where the least force is above zero, rad/s
    speed: float
    high: float  #: where it is below


class NoJumpSpeedError(DynamicsError):
    """Contact is lost at every speed, ``speed`` 0, or at none, ``speed`` infinite."""

    def __init__(self, message: str, speed: float) -> None:
        super().__init__(message)
        self.speed = speed


def loses_contact(law: Law, slowest: float = SLOWEST) -> NoJumpSpeedError:
    """What is raised where contact is lost at the slowest speed (rpm) already."""
    return NoJumpSpeedError(
        f"cam {law.name!r}: the follower loses contact at {slowest:g} rpm already; allowed for a "
        "jump speed: a follower that is pressed on, so give it a preload",
        0.0,
    )


def keeps_contact(law: Law) -> NoJumpSpeedError:
    """What is raised where contact holds at every speed."""
    return NoJumpSpeedError(
        f"cam {law.name!r}: the follower keeps contact up to {FASTEST:g} rpm; allowed for a "
        "jump speed: a cam on which contact is lost",
        math.inf,
    )


def force_run(law: Law, parameters: TwoMassParameters, duration: float | None) -> ModalRun:
    """The contact force of the two-mass follower over a run, at any speeds."""
    model = ModalResponse.of(contact_response(law, parameters, RPM), force_output(parameters))
    return ModalRun(model, duration)


def _too_many(law: Law, run: ModalRun, first: float) -> DynamicsError:
    """What is raised where a search up from a speed (rpm) takes too many looks."""
    hertz = float(np.abs(run.model.rates).max()) / TURN
    return DynamicsError(
        f"cam {law.name!r}: contact holds up to {first:.4g} rpm, but the follower vibrates at "
        f"{hertz:.3g} Hz and a search above takes more than {MAX_LOOKS:g} looks at its force; "
        "allowed for a jump speed: a softer stem or spring, more damping, a shorter run from rest, "
        "or the steady state"
    )


def sought_speed(
    law: Law, parameters: TwoMassParameters, duration: float | None, slowest: float = SLOWEST
) -> float:
    """The jump speed (rad/s) without its proof; ``slowest`` (rpm) is where the search begins."""
    return sought(law, parameters, duration, slowest).speed


def sought(
    law: Law, parameters: TwoMassParameters, duration: float | None, slowest: float = SLOWEST
) -> Sought:
    """The same with the bracket it was found in."""
    run = force_run(law, parameters, duration)
    run.looks.most = MAX_LOOKS
    if duration is None and run.model.rates.real.max() > -UNDAMPED * np.abs(run.model.rates).max():
        raise DynamicsError(
            "no steady state: a stem without damping vibrates without end, at each harmonic of the "
            "speed louder turn after turn; allowed: damping, or a run from rest"
        )
    low, high = _bracket(run, law, slowest)
    run.looks.most = math.inf  # polishing takes few
    fine = max(MAX_POLISHED, min(POLISHED, POLISHED_IN * (high / low - 1.0)))
    return Sought(low, float(brentq(run.lowest, low, high, rtol=fine)), high)


def step(run: ModalRun) -> float:
    """Relative step of the speed from which the force is as good as continuous."""
    rates = run.model.rates
    decay_time = 1.0 / max(float(-rates.real.max()), 1e-300)
    if run.duration is not None:
        decay_time = min(decay_time, run.duration)
    return min(0.02, PHASE_STEP / (float(np.abs(rates).max()) * decay_time))


def _bracket(run: ModalRun, law: Law, slowest: float) -> tuple[float, float]:
    """Two speeds (rad/s): the least force is above zero at the lower and below at the upper."""
    ratio = 1.0 + step(run)
    block = ratio**TOGETHER
    first, stride = slowest, block
    while first < FASTEST:
        if _clear(run, first, first * stride):
            first, stride = first * stride, stride**2
            continue
        if stride > block:
            stride = max(block, math.sqrt(stride))
            continue
        speeds = RPM * first * ratio ** np.arange(TOGETHER + 1.0)
        clear = run.model.resolved(speeds)
        speeds = speeds[: speeds.size if clear.all() else int(np.argmin(clear))]
        try:
            found = _first_below(run, speeds, RPM * slowest) if speeds.size else None
        except TooManyLooksError:
            raise _too_many(law, run, first) from None
        if found is not None:
            if found[0] <= RPM * slowest:
                raise loses_contact(law, slowest)
            return found
        if not clear.all():
            raise _unresolved(law, float(speeds[-1]) if speeds.size else 0.0)
        first *= block
    raise keeps_contact(law)


def _unresolved(law: Law, speed: float) -> DynamicsError:
    """What is raised where contact holds as far (rad/s) as the force can be told."""
    return DynamicsError(
        f"cam {law.name!r}: contact holds up to {to_rpm(speed):.4g} rpm, but above it the stem has "
        f"too few periods in the law's shortest piece ({math.degrees(law.spans.min()):.3g} deg, of "
        f"degree {law.degree}) for double precision; allowed for a jump speed: a stiffer stem, "
        "less preload, or a law of longer pieces"
    )


def _clear(run: ModalRun, low: float, high: float) -> bool:
    """Whether contact is proved to hold from one speed to another (rpm), without a look at each."""
    high = min(high, FASTEST)
    return bool(run.model.resolved(RPM * np.array([high]))[0]) and run.above(RPM * low, RPM * high)


def _least_to_zero(run: ModalRun, speeds: FloatArray) -> FloatArray:
    """The least force at speeds, up to a few after the first at which it is not above zero."""
    found: list[FloatArray] = []
    for i in range(0, speeds.size, FEW):
        found.append(run.least(speeds[i : i + FEW]))
        if (found[-1] <= 0.0).any():
            break
    return np.concatenate(found)


def _first_below(run: ModalRun, speeds: FloatArray, slowest: float) -> tuple[float, float] | None:
    """The first bracket of a zero among neighbouring speeds, in a dip between two of them too."""
    least = _least_to_zero(run, speeds)
    speeds = speeds[: least.size]
    below = np.flatnonzero(least <= 0.0)
    stop = int(below[0]) if below.size else speeds.size
    for i in dips(least):
        if i < stop:
            closer = _with_lowest(run, np.linspace(speeds[i - 1], speeds[i + 1], CLOSER))
            if closer is not None:
                speeds, stop = closer
                break
    if stop == speeds.size:
        return None
    low = float(speeds[max(0, stop - 1)])
    while run.lowest(low) <= 0.0 and low > slowest:  # it hid between grid points
        low *= 1.0 - step(run)
    return low, float(speeds[stop])


def _with_lowest(run: ModalRun, speeds: FloatArray) -> tuple[FloatArray, int] | None:
    """The speeds, and which is the first below zero; None where none is.

    Where the grid leaves it open the lowest place is sought between its points, and put among the
    speeds.
    """
    least = run.least(speeds)
    found = np.flatnonzero(least <= 0.0)
    if found.size:
        return speeds, int(found[0])
    at = int(np.clip(np.argmin(least), 1, speeds.size - 2))
    if least[at] > run.missed(speeds[at : at + 1])[0]:
        return None
    near = minimize_scalar(run.lowest, bounds=(speeds[at - 1], speeds[at + 1]), method="bounded")
    if near.fun > 0.0:
        return None
    return np.array([*speeds[:at], near.x]), at


def dips(values: FloatArray) -> NDArray[np.intp]:
    """Inner points that are minima and could hide a sign change beside them."""
    left, mid, right = values[:-2], values[1:-1], values[2:]
    bend = left - 2.0 * mid + right
    hidden = (mid > 0.0) & (mid <= left) & (mid <= right) & (mid < bend)
    return np.asarray(np.flatnonzero(hidden) + 1)
