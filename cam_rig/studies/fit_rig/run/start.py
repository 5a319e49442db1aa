"""Start values of a fit from samples in contact: encoder zero, lift zero, and follower."""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import nnls

from cam_rig.laws import Law
from cam_rig.studies.fit_rig.run.turns import MIN_PRESS_FRACTION, MeasuredSegment
from cam_rig.units import TURN, FloatArray

#: Number of equally spaced cam angles that are tried as the encoder's zero: one per degree.
ENCODER_PHASES = 360
#: Stride of the samples in the search for start values: every eighth sample is used, for speed.
SAMPLE_STRIDE = 8
#: Rig-file keys of the parameters on which the contact force of one mass depends linearly, in the
#: order of the columns of `force_columns`.
FORCE_PARTS = ("mass", "damping", "spring_stiffness", "preload")


def rough_start(
    law: Law, segments: tuple[MeasuredSegment, ...], base: dict[str, float]
) -> tuple[dict[str, float], float, float]:
    """Return start values, the encoder's phase (rad) and the zero of the lift (m).

    The start values are the follower's parameters by name, with those of ``base`` where the run
    does not identify them. In contact and at a fixed phase, lift and force are linear in the
    parameters: s + zero, and m ω² s'' + c ω s' + k s + preload. The phase is the best of
    `ENCODER_PHASES` equally spaced values. Case: a force alone, which gives a negative mass or
    spring at a wrong phase (``test_a_force_alone_finds_the_encoder_s_zero``).
    """
    lift = np.hstack(
        [
            np.stack([segment.angle + segment.speed * segment.lift.since, segment.lift.value])[
                :, ::SAMPLE_STRIDE
            ]
            for segment in segments
        ]
    )
    force = np.hstack([_pressed(segment) for segment in segments])
    min_sse, result = math.inf, (dict(base), 0.0, 0.0)
    for phase in np.arange(ENCODER_PHASES) * (TURN / ENCODER_PHASES):
        sse, zero, values = 0.0, 0.0, dict(base)
        if lift.size:
            zero, lift_sse = _fit_lift(law, lift[0] + phase, lift[1])
            sse += lift_sse
        if force.size:
            fitted, force_sse = _fit_force(law, force[0] + phase, force[1], force[2])
            values |= fitted
            sse += force_sse
        if sse < min_sse:
            min_sse, result = sse, (values, float(phase), zero)
    return result


def _fit_lift(law: Law, angle: FloatArray, lift: FloatArray) -> tuple[float, float]:
    """Return the zero of the lift (m) that fits readings at one encoder phase.

    ``angle`` (rad) and ``lift`` (m) are the readings. The second result is the sum of squared
    errors relative to the variance of the readings.
    """
    difference = lift - law.motion_at(angle)[0]
    zero = float(np.median(difference))
    return zero, float(((difference - zero) ** 2).sum()) / float(lift.var())


def _fit_force(
    law: Law, angle: FloatArray, speed: FloatArray, force: FloatArray
) -> tuple[dict[str, float], float]:
    """Fit non-negative parameters of one mass to forces in contact.

    Returns the parameters by name, and the sum of squared errors relative to the variance of the
    forces. A mass or a spring of zero is omitted from the result.
    """
    parts, sizes = force_columns(law, speed, angle)
    _, triangle = np.linalg.qr(np.column_stack([parts, force]))
    fitted, residual_norm = nnls(triangle[:, :-1], triangle[:, -1])
    values = dict(zip(FORCE_PARTS, (fitted / sizes).tolist(), strict=True))
    values = {n: v for n, v in values.items() if v > 0.0 or n in ("preload", "damping")}
    return values, float(residual_norm) ** 2 / float(force.var())


def force_columns(law: Law, speed: FloatArray, angle: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the force per parameter as unit columns ``(n, 4)``, and their norms.

    The columns are those of the linear contact force of one mass, in the order of `FORCE_PARTS`, at
    n samples of speed (rad/s) and cam angle (rad). A column divided by its norm has the length 1.
    The norm of a zero column is given as 1. Case: all samples in contact are on a dwell
    (``test_force_on_a_dwell_alone_is_fitted``).
    """
    s, slope, curvature = law.motion_at(angle)
    parts = np.stack([curvature * speed**2, slope * speed, s, np.ones_like(s)], axis=1)
    sizes = np.linalg.norm(parts, axis=0)
    sizes[sizes == 0.0] = 1.0
    return parts / sizes, sizes


def _pressed(segment: MeasuredSegment) -> FloatArray:
    """Return every eighth force sample in which the follower presses on the cam.

    The rows of the result, ``(3, n)``, are cam angle (rad), speed (rad/s) and force (N) of the
    samples in one steady-speed segment.
    """
    since, force = segment.force.since, segment.force.value
    pressing = np.flatnonzero(force > MIN_PRESS_FRACTION * force.max(initial=0.0))[::SAMPLE_STRIDE]
    return np.stack(
        [
            segment.angle + segment.speed * since[pressing],
            np.full(pressing.size, segment.speed),
            force[pressing],
        ]
    )
