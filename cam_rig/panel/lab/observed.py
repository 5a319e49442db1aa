"""What one sees and hears of the rig at a speed: a turn of its steady state, and its contact.

The steady state of the follower that is held on the cam begins the first turn. If its contact
force stays above zero, that turn is what is seen; else the follower lifts off, and the last of
some turns is shown.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cam_rig.acoustics import RadiationParameters, SoundSource
from cam_rig.arrays import FloatArray
from cam_rig.dynamics import MODELS, Block, FollowerState, Interval, TwoMassParameters
from cam_rig.dynamics.two_mass.parameters import contact_response, force_output
from cam_rig.laws import Law
from cam_rig.panel.bench.sound import FULL_SCALE_PA, LEAST_RATE
from cam_rig.schema import RigConfig
from cam_rig.studies.jump.any_rig import AnyFollower, follower_of
from cam_rig.units import NS, RPM, TURN

#: Samples of the force a second, Hz; the sound has as many.
RATE_HZ = LEAST_RATE
#: Points of a turn that are shown.
POINTS = 720
#: What the force sensor resolves, N.
RESOLUTION_N = 0.1
#: Turns after which what is seen of a follower that lifts off is settled.
SETTLED = 6


@dataclass(frozen=True, eq=False)
class LabTurn:
    """A turn as it is observed.

    Parameters
    ----------
    contact_lost : whether the follower leaves the cam in steady state
    force : `POINTS` at equal steps of the cam angle from 0 on, N, as the sensor resolves it
    sound : the turn's, 32-bit floats of full scale at `RATE_HZ`, to be repeated
    """

    contact_lost: bool
    force: FloatArray
    sound: FloatArray


def observe(law: Law, rig: RigConfig, rpm: float) -> LabTurn:
    """A turn on a rig at a speed (rpm).

    Raises
    ------
    DynamicsError : no steady state at this speed
    """
    follower, speed = follower_of(rig), rpm * RPM
    blocks = _turns(law, follower, speed)
    block = blocks[-1]
    grid = block.interval.grid(RATE_HZ)
    angles = block.interval.angle + speed * grid.since_start()
    at = np.arange(POINTS) * (TURN / POINTS)
    force = np.interp(at, angles, block.force, period=TURN)
    source = SoundSource(RadiationParameters.from_rig(rig), RATE_HZ, LEAST_RATE)
    # Heard twice: the second time the structure is already in motion, and the ends meet.
    for _ in range(2):
        pressure = source.pressure(block.force, block.impulse, speed)
    seen = np.round(force / RESOLUTION_N) * RESOLUTION_N
    return LabTurn(len(blocks) > 1, seen, np.asarray(pressure / FULL_SCALE_PA))


def _turns(law: Law, follower: AnyFollower, speed: float) -> list[Block]:
    """One turn that keeps contact, or some in which it is lost."""
    two = isinstance(follower, TwoMassParameters)
    model = MODELS["two_mass" if two else "one_mass"]
    state = _steady_start(law, follower, speed) if isinstance(follower, TwoMassParameters) else None
    turn, blocks = round(TURN / speed * NS), list[Block]()
    for i in range(SETTLED):
        # Each turn begins at angle 0: what a turn in whole nanoseconds leaves is not added up.
        interval = Interval(i * turn, (i + 1) * turn, 0.0, speed, turns=i)
        state, block = model.advance(law, follower, state, interval, RATE_HZ)
        blocks.append(block)
        if i == 0 and not any(event.kind == "lift-off" for event in block.events):
            break
    return blocks


def _steady_start(law: Law, follower: TwoMassParameters, speed: float) -> FollowerState:
    """Two masses at cam angle 0, in the steady state in which they are held on the cam."""
    vibration = contact_response(law, follower, speed).periodic()
    lift, slope, bend = law.at(0.0)
    motion = np.array([lift, slope * speed, bend * speed**2])
    output = force_output(follower)
    force = float((output.state @ vibration + output.law @ motion + output.constant)[0])
    return FollowerState(lift, slope * speed, force, True, inner=tuple(vibration.tolist()))
