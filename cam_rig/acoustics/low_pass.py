"""What the structure makes of a force: q̇ = ω_c (F − q), solved exactly between samples.

The pressure is gain · ω_c (F − q). Between two samples the force is taken as straight.
"""

from __future__ import annotations

import math

import numpy as np

from cam_rig.arrays import FloatArray


def structure_response(
    corner_rate: float,
    sample_rate: float,
    start: float,
    previous: float,
    force: FloatArray,
    impulse: FloatArray,
) -> FloatArray:
    """Structure q (N) at the samples, ``(n,)``.

    Parameters
    ----------
    corner_rate : ω_c, rad/s
    sample_rate : Hz
    start, previous : q and force (N) at the sample before the first
    force : ``(n,)`` N, straight between samples
    impulse : ``(n,)`` N·s that falls at a sample: it lifts q by ω_c J
    """
    from scipy.signal import lfilter  # a second of imports, which only who listens should pay

    x = corner_rate / sample_rate
    keep = math.exp(-x)
    ramp = -math.expm1(-x) / x
    before, now = ramp - keep, 1.0 - ramp
    earlier = np.concatenate(([previous], force[:-1]))
    drive = before * earlier + now * force + corner_rate * impulse
    structure, _ = lfilter([1.0], [1.0, -keep], drive, zi=[keep * start])
    return np.asarray(structure)
