"""Where a flying follower meets the cam again: the first root of a certified polynomial gap."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cam_rig.dynamics.flight import SERIES_DEGREE, Flight
from cam_rig.laws import TURN, Law, bernstein
from cam_rig.laws.bernstein import FloatArray

#: The follower has landed when it is this many rounding errors below the cam: at lift-off the
#: gap and its first derivatives are zero, and rounding must not look like a landing.
ROUNDING_ERRORS = 16.0


def landing_time(
    flight: Flight, law: Law, angle: float, speed: float, limit: float
) -> float | None:
    """Time since lift-off at which the follower meets the cam, None when not before ``limit``.

    In each window flight and law are both polynomials of time in Bernstein form; their
    difference has no root where all its ordinates are positive, so no landing is skipped.

    Parameters
    ----------
    angle, speed : cam angle (rad) at lift-off, and cam speed (rad/s)
    limit : s since lift-off
    """
    degree = max(SERIES_DEGREE, law.degree)
    for begin, end, piece, low, high in _windows(flight, law, angle, speed, limit):
        follower = bernstein.elevate(flight.ordinates(begin, end), degree)
        cam = bernstein.restrict(law.ordinates[:, piece], low, high)
        reached = angle + speed * end
        noise = _rounding(follower, law, reached)
        gap = follower - bernstein.elevate(cam, degree) + noise
        if gap[0] <= 0.0:
            return begin
        roots = bernstein.crossings(gap)
        if roots or gap[-1] <= 0.0:
            below = roots[0] if roots else 1.0
            return begin + (end - begin) * _zero_before(gap, noise, below)
    return None


def _zero_before(gap: FloatArray, noise: float, below: float) -> float:
    """The gap's own zero before it is below −noise, when it was clearly open before that."""
    zeros = [u for u in bernstein.crossings(gap - noise) if u <= below]
    return zeros[-1] if zeros and gap[0] > 2.0 * noise else below


def _rounding(follower: FloatArray, law: Law, angle: float) -> float:
    """Bound (m) on the error of a gap: of both displacements, the angle, the law's own joints."""
    size = max(float(np.abs(follower).max()), float(np.abs(law.ordinates).max()))
    size += abs(angle) * float(np.abs(law.motion[1]).max())
    return ROUNDING_ERRORS * float(np.finfo(float).eps) * size + law.largest_step


def _windows(
    flight: Flight, law: Law, angle: float, speed: float, limit: float
) -> Iterator[tuple[float, float, int, float, float]]:
    """Windows in time, each inside one piece of the law: begin, end, piece, and u of both."""
    turn = np.floor(angle / TURN)
    piece = int(np.searchsorted(law.breaks, angle - turn * TURN, side="right")) - 1
    begin = 0.0
    while begin < limit:
        index = piece % law.spans.size
        low = float(law.breaks[index] + (turn + piece // law.spans.size) * TURN)
        span = float(law.spans[index])
        to_joint = (low + span - angle) / speed
        end = min(begin + flight.window, to_joint, limit)
        if end > begin:
            u = [(angle + speed * t - low) / span for t in (begin, end)]
            yield begin, end, index, min(max(u[0], 0.0), 1.0 - 1e-16), min(u[1], 1.0)
            begin = end
        if begin >= to_joint:
            piece += 1
