"""How many samples of lift, velocity and acceleration the rig makes in a second."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.bench.cases.cases import DAMPING, MASS, SPRING, STEM, WEIGHT, law_of, rad_per_s
from cam_rig.dynamics import FollowerParameters, elastic_stem
from cam_rig.dynamics.linear.sampling import Outputs
from cam_rig.dynamics.linear.sampling import sample as sample_response
from cam_rig.laws import sampling

CAM, RPM, SAMPLE_RATE = "bezier15", 400.0, 48_000
#: Samples in one block, and blocks that are timed.
BLOCK, BLOCKS = 1 << 17, 15


def rates() -> dict[str, float]:
    """Samples (three numbers each) per second, by model: median over the blocks."""
    law, speed, step = law_of(CAM), rad_per_s(RPM), 1.0 / SAMPLE_RATE
    weights, offsets = np.diag([1.0, speed, speed**2]), np.zeros(3)
    follower = FollowerParameters(MASS, SPRING, DAMPING, WEIGHT, STEM)
    response, full = elastic_stem.response(law, follower, speed), elastic_stem.outputs(follower)
    rows = Outputs(full.state[:3], full.law[:3], full.constant[:3])
    return {
        "kinetostatic": _rate(
            lambda: sampling.sample(law, 0.0, speed * step, BLOCK, weights, offsets)
        ),
        "residual": _rate(
            lambda: sample_response(response, np.zeros(2), 0.0, 0.0, step, BLOCK, rows)
        ),
    }


def _rate(block: Callable[[], FloatArray]) -> float:
    block()
    times = []
    for _ in range(BLOCKS):
        begun = time.perf_counter()
        block()
        times.append(time.perf_counter() - begun)
    return BLOCK / statistics.median(times)
