"""What one sees and hears of the rig at a speed: a turn of its steady state, and its contact."""

from __future__ import annotations

import numpy as np

from cam_rig.acoustics import RadiationParameters, SoundSource
from cam_rig.dynamics import MODELS, Block, Interval, TwoMassParameters
from cam_rig.dynamics.jump.any_follower import AnyFollower
from cam_rig.dynamics.two_mass.masses import contact_response
from cam_rig.laws import Law
from cam_rig.panel.bench.live_state import FULL_SCALE_PA, LEAST_RATE
from cam_rig.panel.lab.sheet import LabTurn
from cam_rig.quantities.steady import vibrating
from cam_rig.units import NS, RPM, TURN, FloatArray

#: Samples of the force a second, Hz; the sound has as many.
RATE_HZ = LEAST_RATE
#: Points of a turn that are shown.
POINTS = 720
#: What the force sensor resolves, N.
RESOLUTION_N = 0.1
#: Turns after which what is seen of a follower that lifts off is settled.
SETTLED = 6


def observe(law: Law, follower: AnyFollower, radiation: RadiationParameters, rpm: float) -> LabTurn:
    """A turn of a follower at a speed (rpm): its force (N), and the sound."""
    speed = rpm * RPM
    blocks = _turns(law, follower, speed)
    block = blocks[-1]
    grid = block.interval.grid(RATE_HZ)
    angles = block.interval.angle + speed * grid.since_start()
    source = SoundSource(radiation, RATE_HZ, LEAST_RATE)
    # Heard twice: the second time the structure is already in motion, and the ends meet.
    for _ in range(2):
        pressure = source.pressure(block.force, block.impulse, speed)
    seen = over_turn(angles, block.force, RESOLUTION_N)
    lost = len(blocks) > 1
    return LabTurn(lost, lost, seen, np.asarray(pressure / FULL_SCALE_PA))


def over_turn(angles: FloatArray, values: FloatArray, resolution: float) -> FloatArray:
    """``(POINTS,)`` of values at cam angles (rad) of a turn, as a sensor resolves them."""
    at = np.arange(POINTS) * (TURN / POINTS)
    return (
        np.asarray(np.round(np.interp(at, angles, values, period=TURN) / resolution)) * resolution
    )


def _turns(law: Law, follower: AnyFollower, speed: float) -> list[Block]:
    """One turn that keeps contact, or some in which it is lost."""
    model, state = MODELS["one_mass"], None
    if isinstance(follower, TwoMassParameters):  # from the steady state in which they are held
        model = MODELS["two_mass"]
        state = vibrating(contact_response(law, follower, speed).periodic())
    turn, blocks = round(TURN / speed * NS), list[Block]()
    for i in range(SETTLED):
        # Each turn begins at angle 0: what a turn in whole nanoseconds leaves is not added up.
        interval = Interval(i * turn, (i + 1) * turn, 0.0, speed, turns=i)
        state, block = model.advance(law, follower, state, interval, RATE_HZ)
        blocks.append(block)
        if i == 0 and not any(event.kind == "lift-off" for event in block.events):
            break
    return blocks
