"""What the structure makes of a force: q̇ = ω_c (F − q), solved exactly between samples.

The pressure is gain · ω_c (F − q). Between two samples the force is taken as straight.
"""

from __future__ import annotations

import math

import numpy as np

from cam_rig.arrays import FloatArray

#: Samples that `first_order` takes together, a power of two.
BLOCK = 64


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
    x = corner_rate / sample_rate
    keep = math.exp(-x)
    ramp = -math.expm1(-x) / x
    before, now = ramp - keep, 1.0 - ramp
    earlier = np.concatenate(([previous], force[:-1]))
    drive = before * earlier + now * force + corner_rate * impulse
    return first_order(keep, drive, start)


def first_order(keep: float, drive: FloatArray, start: float) -> FloatArray:
    """The recursion y ← keep · y + drive from y = ``start`` on, ``(n,)``.

    In blocks, all of which go forward together from rest, by doubling; each then gets what the one
    before has left. As quick as scipy's filter, whose import takes half a second.

    >>> first_order(0.5, np.array([1.0, 1.0, 1.0]), 2.0).tolist()
    [2.0, 2.0, 2.0]
    """
    blocks = np.zeros((-(-drive.size // BLOCK), BLOCK))
    blocks.reshape(-1)[: drive.size] = drive
    steps = blocks.T.copy()
    shift, kept = 1, keep
    while shift < BLOCK:
        steps[shift:] += kept * steps[:-shift]
        shift, kept = 2 * shift, kept * kept
    powers = np.array([keep**k for k in range(1, BLOCK + 1)])
    left, whole = [start], float(powers[-1])
    for own in steps[-1, :-1].tolist():
        left.append(own + whole * left[-1])
    if drive.size:
        steps += powers[:, None] * np.array(left)
    return np.asarray(steps.T.reshape(-1)[: drive.size])
