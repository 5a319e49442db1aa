"""Zero offset of the force sensor, estimated from samples in which the follower is in flight."""

from __future__ import annotations

import math

import numpy as np

from cam_rig.studies.fit_rig.run.instruments import FORCE_ZERO
from cam_rig.studies.fit_rig.run.search import Candidate, continue_from
from cam_rig.units import FloatArray

#: Smallest number of force samples in flight from which the sensor's zero offset is estimated. With
#: fewer samples, a single sample next to a landing would decide the result.
MIN_FLYING_SAMPLES = 4
#: The zero offset of the force sensor is significant if it exceeds this number of standard errors
#: plus `MIN_ZERO_FRACTION` of the preload.
MIN_ZERO_ERRORS = 6.0
#: Fraction of the preload in the limit of a significant zero offset of the force sensor (see
#: `MIN_ZERO_ERRORS`).
MIN_ZERO_FRACTION = 0.005
#: Number of times that the zero offset of the force sensor is estimated. Each estimate uses the
#: flights that follow from the preload of the previous estimate.
ZERO_ROUNDS = 5


def add_zero_offset(fit: Candidate) -> Candidate:
    """Return a start for a search in which the force sensor's zero offset is free.

    In flight the contact force is zero, so the sensor shows its zero offset. A candidate with fewer
    than `MIN_FLYING_SAMPLES` samples in flight is returned unchanged. Case: a sensor with an
    offset, which otherwise becomes part of the preload
    (``test_a_sensor_shows_its_zero_in_flight``).
    """
    like, in_flight = fit.likelihood, forces_in_flight(fit)
    start = continue_from(fit, like.free, fit.values, zero_offset=True)
    if in_flight.size < MIN_FLYING_SAMPLES:
        return fit
    x, index = start.x, start.likelihood.instruments.index[FORCE_ZERO]
    x[index] = float(np.median(in_flight))
    if "preload" in like.free:
        k = like.free.index("preload")
        x[k] = max(0.0, x[k] - x[index])
    return start


def find_zero_in_flight(flying: Candidate) -> float | None:
    """Return the zero offset of the force sensor (N), estimated from the flights.

    It is None if it is not significant, if there are too few samples in flight, or if the preload
    is fixed. Case: two masses fitted to the speeds in contact
    (``test_a_stem_that_leaves_a_cam_of_arcs``).
    """
    like, x, zero = flying.likelihood, flying.x.copy(), 0.0
    if "preload" not in like.free:
        return None
    index, in_flight = like.free.index("preload"), np.empty(0)
    for _ in range(ZERO_ROUNDS):
        in_flight = forces_in_flight(Candidate(like, x.copy()))
        if in_flight.size < MIN_FLYING_SAMPLES:
            return None
        zero = float(np.median(in_flight))
        x[index] = max(0.0, flying.x[index] - zero)
    error = float(np.abs(in_flight - zero).mean()) / math.sqrt(in_flight.size)
    return (
        zero if abs(zero) > MIN_ZERO_ERRORS * error + MIN_ZERO_FRACTION * flying.x[index] else None
    )


def forces_in_flight(fit: Candidate) -> FloatArray:
    """Return the measured forces (N) while the computed follower is off the cam.

    The shape is ``(n,)``, over all steady-speed segments.
    """
    flying = [
        fit.likelihood.samples(i)[1].value[predicted.turn.evaluate(predicted.force.angle)[1] == 0.0]
        for i, predicted in enumerate(fit.predicted)
        if predicted is not None
    ]
    return np.concatenate([np.empty(0), *flying])
