"""The jump speed of a cam that speeds up evenly from rest."""

from __future__ import annotations

import math

from cam_rig.dynamics import MODELS, Interval, TwoMassParameters
from cam_rig.dynamics.interval import FollowerState
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.studies.jump.any_rig import AnyFollower
from cam_rig.studies.jump.jump_speed import Jump
from cam_rig.studies.jump.search import FASTEST
from cam_rig.units import NS, RPM, TURN

#: Slowest and steepest ramp, rpm/s: hours of turns, and a jump within the first turn.
SLOWEST, STEEPEST = 1.0, 1e5
#: Events are exact at any rate; samples are not looked at.
SAMPLE_RATE_HZ = 1000


def jump_along_ramp(law: Law, parameters: AnyFollower, rate: float) -> Jump:
    """Where the follower first loses contact on a cam that starts from rest at θ = 0.

    Parameters
    ----------
    rate : rad/s², of the cam

    Raises
    ------
    DynamicsError : the rate is out of its limits, or contact is kept
    """
    if not SLOWEST <= rate / RPM * (1.0 + 1e-12) <= STEEPEST * (1.0 + 2e-12):
        raise DynamicsError(
            f"the ramp is {rate / RPM:g} rpm/s; allowed: {SLOWEST:g} to {STEEPEST:g} rpm/s"
        )
    two = isinstance(parameters, TwoMassParameters)
    advance = MODELS["two_mass" if two else "one_mass"].advance
    state: FollowerState | None = None
    start = 0
    if law.lift == 0.0:  # a disc: it would be turned to the fastest speed for nothing
        raise _stays(law)
    for turn in range(1, math.ceil((FASTEST * RPM) ** 2 / (2.0 * rate) / TURN) + 1):
        stop, begun = round(math.sqrt(2.0 * TURN * turn / rate) * NS), start / NS
        tick = Interval(start, stop, 0.5 * rate * begun**2, rate * begun, rate)
        state, block = advance(law, parameters, state, tick, SAMPLE_RATE_HZ)
        if block.events:
            first = block.events[0]
            return Jump(rate * first.time, first.angle % TURN, first.time)
        start = stop
    raise _stays(law)


def _stays(law: Law) -> DynamicsError:
    return DynamicsError(
        f"cam {law.name!r}: the follower keeps contact up to {FASTEST:g} rpm; allowed for a "
        "jump speed: a cam on which contact is lost"
    )
