"""Where a flying follower meets the cam again: the first root of a certified polynomial gap."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cam_rig.dynamics.flight import SERIES_DEGREE, Flight
from cam_rig.laws import TURN, Law, bernstein
from cam_rig.laws.bernstein import FloatArray

#: The follower has landed when it is this many rounding errors below the cam: at lift-off the
#: gap and its first derivatives are zero, and rounding must not look like a landing.
ROUNDING_ERRORS = 16.0
#: Samples of one glance, and of one window.
GLANCE, PER_WINDOW = 33, 8
#: Part of a window in which a gap that closes clearly is a straight line.
NEAR = 1e-6


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
    now = _open_until(flight, law, angle, speed, 0.0, limit)
    while now < limit:
        window = _window(flight, law, angle, speed, now, limit)
        if window.end > now:
            landing = _in_window(flight, law, angle + speed * window.end, window)
            if landing is not None:
                return landing
        now = _open_until(flight, law, angle, speed, window.end, limit)
    return None


def _open_until(
    flight: Flight, law: Law, angle: float, speed: float, begin: float, limit: float
) -> float:
    """Time from ``begin`` on up to which a glance shows that the gap is open.

    Between two samples the gap g is no lower than the lower one less M h²/8, with M the largest
    |g̈|; just after lift-off it is no lower than ġ t − M t²/2.
    """
    step = flight.window / PER_WINDOW
    bend = flight.largest_acceleration + speed**2 * law.bounds[2]
    while begin < limit:
        time = np.minimum(begin + step * np.arange(GLANCE), limit)
        y = flight.state(time)[0]
        cam, error = law.glance(angle + speed * time)
        gap = y - cam
        if begin == 0.0 and flight.velocity - speed * law.at(angle)[1] > bend * step:
            gap[0] = gap[1]
        noise = gap_rounding(law, float(np.abs(y).max()))
        doubt = gap <= bend * step**2 / 8.0 + error + 2.0 * noise
        if doubt.any():
            return begin + step * max(0, int(np.argmax(doubt)) - 1)
        begin = float(time[-1])
    return begin


class _Window(NamedTuple):
    """From ``begin`` to ``end`` (s since lift-off), u from ``low`` to ``high`` of one piece."""

    begin: float
    end: float
    piece: int
    low: float
    high: float


def _window(
    flight: Flight, law: Law, angle: float, speed: float, begin: float, limit: float
) -> _Window:
    """The window from ``begin`` on, in which the law is one piece and the series is exact."""
    at = angle + speed * begin
    turn = math.floor(at / TURN) * TURN
    index = law.piece(at - turn)
    low, high = law.joints[index] + turn, law.joints[index + 1] + turn
    if (high - angle) / speed <= begin:  # rounding put the joint behind
        index = (index + 1) % law.spans.size
        low, high = high, high + float(law.spans[index])
    span = high - low
    end = min(begin + flight.window, (high - angle) / speed, limit)
    u = [(angle + speed * t - low) / span for t in (begin, end)]
    return _Window(begin, end, index, min(max(u[0], 0.0), 1.0 - 1e-16), min(u[1], 1.0))


def _in_window(flight: Flight, law: Law, reached: float, window: _Window) -> float | None:
    begin, end, degree = window.begin, window.end, max(SERIES_DEGREE, law.degree)
    follower = bernstein.elevate(flight.ordinates(begin, end), degree)
    cam = bernstein.restrict(law.ordinates[:, window.piece], window.low, window.high)
    noise = gap_rounding(law, float(np.abs(follower).max()), reached)
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
    if gap[0] <= 2.0 * noise:
        return below
    value = bernstein.scalar(gap)
    slope = (value(below - NEAR) - value(below)) / NEAR if below > NEAR else 0.0
    if noise < slope * NEAR:
        return below - noise / slope
    zeros = [u for u in bernstein.crossings(gap - noise) if u <= below]
    return zeros[-1] if zeros else below


def gap_rounding(law: Law, displacement: float, angle: float = TURN) -> float:
    """Bound (m) on the error of a gap: of both displacements, the angle, the law's own joints."""
    largest, steepest, _ = law.bounds
    size = max(abs(displacement), largest) + abs(angle) * steepest
    return ROUNDING_ERRORS * bernstein.EPS * size + law.largest_step
