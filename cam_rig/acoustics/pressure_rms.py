"""Contact force to r.m.s. sound pressure, by energy: what the microphone node publishes.

It is the mean square of what `pressure_samples` gives, with the landings and the background at
their exact energy: no noise of measurement, and no need of a high sample rate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cam_rig.acoustics.low_pass import structure_response
from cam_rig.acoustics.radiation import RadiationParameters
from cam_rig.arrays import FloatArray


@dataclass(frozen=True)
class MicrophoneState:
    """The state of the structure from one block to the next: q and the last force, N."""

    structure: float
    force: float


def rms_pressure(
    parameters: RadiationParameters,
    state: MicrophoneState | None,
    force: FloatArray,
    impulse: FloatArray,
    sample_rate: float,
    speed: float,
) -> tuple[MicrophoneState, float]:
    """r.m.s. sound pressure (Pa) over one block.

    Parameters
    ----------
    state : as the block before left it; None starts with the structure at rest under the force
    force : ``(n,)`` contact force in N at the samples, taken as straight between them
    impulse : ``(n,)`` N·s, of the landings since the sample before
    sample_rate : Hz
    speed : rad/s, for the background
    """
    if force.size == 0:
        raise ValueError("a block must hold at least one sample")
    start = state or MicrophoneState(structure=float(force[0]), force=float(force[0]))
    structure = structure_response(
        parameters.corner_rate, sample_rate, start.structure, start.force, force, impulse
    )
    rate = parameters.corner_rate * (force - structure)
    contact = parameters.gain**2 * float(np.mean(rate**2))
    landings = float(np.sum(parameters.landing_energy(impulse))) * sample_rate / force.size
    power = parameters.background_power(speed) + contact + landings
    return MicrophoneState(float(structure[-1]), float(force[-1])), math.sqrt(power)
