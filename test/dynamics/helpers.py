"""Shared functions of the tests: runs, flights, changed laws and quadrature.

A tick is one of the time intervals into which a run is divided. An event is a lift-off or a
landing. A joint is an angle at which two polynomial pieces of a motion law meet.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from contextlib import suppress
from typing import NamedTuple

import mpmath as mp
import numpy as np
import pytest

from benchmark.speed.exact import polynomial, powers
from cam_rig.dynamics import (
    MODELS,
    Event,
    FollowerParameters,
    FollowerState,
    Interval,
    TwoMassParameters,
)
from cam_rig.dynamics.events.approach import FlightOverCam, Gap, find_landing
from cam_rig.dynamics.events.free_flight import start_free_motion
from cam_rig.dynamics.events.law_table import Cam
from cam_rig.dynamics.events.trajectory import EndlessEventsError, free_table, law_table
from cam_rig.dynamics.linear.exponential import Flight
from cam_rig.dynamics.two_mass import Separation
from cam_rig.laws import Law, bernstein
from cam_rig.units import NS, TURN

#: ns in a millisecond.
MS = NS // 1000
#: Parameters of a rigid follower in SI: mass, spring stiffness, damping, preload, stem stiffness.
#: Mass, spring and damping are those of the paper (see docs/glossary.md).
ONE = FollowerParameters(1.3, 4030.0, 8.642, 12.753, 3.3e8)
#: Parameters of two masses with an elastic stem between them, in SI: roller mass, end mass, stem
#: and spring stiffness, both dampings, preload. They are identified from Table 2 of the paper.
TWO = TwoMassParameters(0.52, 0.78, 1.26e6, 4030.0, 8.642, 8.642, 30.6)
#: Two masses with a strongly damped stem, in SI as `TWO`. They do not bounce after a landing, so no
#: rounding error is amplified from landing to landing.
CALM = TwoMassParameters(0.4, 0.9, 1.26e6, 4030.0, 300.0, 8.642, 30.6)


class Run(NamedTuple):
    """Result of a run: samples (rows of `Samples`), events and last state.

    An event is a lift-off or a landing.
    """

    rows: np.ndarray
    events: list[Event]
    state: FollowerState


def run_in_ticks(
    law: Law,
    model: str,
    p,
    whole: Interval,
    cuts: Iterable[int],
    rate: int = 8000,
    state: FollowerState | None = None,
    nudge: float = 0.0,
) -> Run:
    """Run a follower model over the interval `whole`, divided into ticks.

    A tick is a time interval that is simulated in one call. `cuts` are the borders of the ticks, in
    ns since the start of `whole`. `rate` is the sample rate in Hz. `nudge` (rad) is added to the
    start angle of every second tick, to imitate rounding.
    """
    rows, events = [], []
    for i, (a, b) in enumerate(itertools.pairwise(cuts)):
        part = Interval(
            whole.start_ns + a,
            whole.start_ns + b,
            whole.angle_at(a / NS) + nudge * (i % 2),
            whole.speed_at(a / NS),
            whole.acceleration,
            whole.turns,
        )
        state, block = MODELS[model].advance(law, p, state, part, rate)
        assert block.interval is part
        rows.append(block.rows)
        events += block.events
    assert state is not None
    return Run(np.hstack(rows), events, state)


def tick_borders(tick: int, total: int) -> list[int]:
    """Return the borders (ns) of ticks of length `tick` over `total`, both in ns.

    A tick is a time interval that is simulated in one call.
    """
    return [*range(0, total, tick), total]


def land(
    flight: Flight, law: Law, angle: float, speed: float, limit: float, noise: float = 0.0
) -> Gap:
    """Return the gap at the landing of a flight that starts at a cam angle (rad).

    The search ends `limit` s after the start, and the result has a flag for a landing. `noise` is
    the rounding error of the acceleration (m/s²), as in `FlightOverCam`.
    """
    lift_off = start_free_motion(free_table(flight.system), flight.start)
    gap, gap_rate = flight.gap_state or (0.0, 0.0)
    cam = Cam(law_table(law), float(speed), float(angle))
    over_cam = FlightOverCam(
        lift_off=lift_off,
        cam=cam,
        gap_known=bool(flight.gap_state),
        gap=float(gap),
        gap_rate=float(gap_rate),
        acceleration_rounding=noise,
    )
    return find_landing(over_cam, limit)


def assert_same(run: Run, expected: Run, tolerance: float, columns=slice(None)) -> None:
    """Assert that two runs have the same samples, events and last state.

    `tolerance` is relative to the largest value of each sampled quantity. `columns` selects the
    samples that are compared.
    """
    (rows, events, state), (other_rows, other_events, end) = run, expected
    size, limit = np.abs(other_rows[1:5]).max(axis=1), max(tolerance, 1e-10)
    assert (np.abs(rows - other_rows)[1:5, columns].max(axis=1) < limit * size).all()
    assert [event.kind for event in events] == [event.kind for event in other_events]
    for event, other in zip(events, other_events, strict=True):
        assert event.time == pytest.approx(other.time, abs=0.1 * tolerance)
        assert event.impulse == pytest.approx(other.impulse, abs=10.0 * tolerance)
    assert state.velocity == pytest.approx(end.velocity, abs=tolerance * size[1])
    assert state.displacement == pytest.approx(end.displacement, abs=tolerance * size[0])


def off_joints(law: Law, angle: np.ndarray) -> np.ndarray:
    """Return for each cam angle (rad) True if it is not at a joint of the law.

    The tolerance is 1e-9 rad. At a joint, where two polynomial pieces meet, a sample may have the
    value of either side.
    """
    return np.abs(angle[:, None] % TURN - law.breaks).min(axis=1) > 1e-9


def turned(law: Law, angle: float, factor: float = 1.0) -> Law:
    """Return the law with angle 0 moved to `angle` (rad) and the lift times `factor`."""
    law = with_joints(law, angle)
    i = int(np.searchsorted(law.breaks, angle))
    breaks = np.append(law.breaks[i:], law.breaks[1 : i + 1] + TURN) - law.breaks[i]
    breaks[-1] = TURN
    return Law("turned", breaks, factor * np.roll(law.ordinates, -i, axis=1))


def with_joints(law: Law, *angles: float) -> Law:
    """Return the same lift function with additional joints at the given angles (rad).

    At a joint two polynomial pieces meet. The pieces are split there, and the lift is unchanged.
    """
    breaks, columns = np.array(sorted({*law.breaks.tolist(), *angles})), []
    for a, b in itertools.pairwise(breaks):
        i = int(np.searchsorted(law.breaks, 0.5 * (a + b), side="right")) - 1
        ends = np.clip((np.array([a, b]) - law.breaks[i]) / law.spans[i], 0.0, 1.0)
        columns.append(bernstein.restrict(law.ordinates[:, i], *ends))
    return Law(law.name, breaks, np.stack(columns, axis=1))


def bumped(law, middle, width, height):
    """Return the law with an added smooth bump h (1 − x²)³, x from −1 to 1.

    `middle` and `width` are in rad, and `height` is in m. The bump has two polynomial pieces.
    """
    low, high, degree = middle - 0.5 * width, middle + 0.5 * width, max(6, law.degree)
    law, u = with_joints(law, low, middle, high), np.linspace(0.0, 1.0, degree + 1)
    ordinates = np.array(bernstein.elevate(law.ordinates, degree))
    for i, (a, b) in enumerate(itertools.pairwise(law.breaks)):
        if low <= a < b <= high:
            x = (a + (b - a) * u - middle) / (0.5 * width)
            bump = height * (1.0 - x**2) ** 3
            ordinates[:, i] += np.linalg.solve(bernstein.basis(degree, u), bump)
    ordinates[-1] = np.roll(ordinates[0], -1)
    return Law("bumped", law.breaks, ordinates)


def noisy(law, pieces, amplitude, rng):
    """Return a C¹ motion law of cubics through noisy points of a law.

    `pieces` is the number of points per turn. The noise has the standard deviation `amplitude` (m).
    """
    breaks = np.linspace(0.0, TURN, pieces + 1)
    breaks[-1] = TURN
    points = law(breaks[:-1]) + amplitude * rng.standard_normal(pieces)
    following = np.roll(points, -1)
    third = (following - np.roll(points, 1)) / 6.0
    rows = [points, points + third, following - np.roll(third, -1), following]
    return Law("noisy", breaks, np.stack(rows))


class _Walk(Separation):
    max_events = 0


def lift_off(
    law: Law, p: TwoMassParameters, speed: float, start: np.ndarray, limit: float
) -> float | None:
    """Return the time (s) of the first loss of contact, or None within `limit` s.

    The run starts at cam angle 0 with the free vibration `start` (displacement η in m and its
    rate). It is cam_rig's simulation of two masses, stopped at the first event.
    """
    walk = _Walk(law, p, speed)
    with suppress(EndlessEventsError):
        walk.run(limit, start)
    return walk.events[0].time if walk.events else None


def exact_law(law: Law, angle: mp.mpf) -> list[mp.mpf]:
    """Return s, s' and s'' at a cam angle (rad) in mpmath precision.

    The floats of the law are taken as exact numbers.
    """
    inside = angle - mp.floor(angle / mp.mpf(TURN)) * mp.mpf(TURN)
    i = max(k for k in range(law.spans.size) if mp.mpf(law.breaks[k]) <= inside)
    low, values = mp.mpf(law.breaks[i]), []
    span, row = mp.mpf(law.breaks[i + 1]) - low, powers(law.ordinates[:, i].tolist())
    for order in range(3):
        values.append(polynomial(row, (inside - low) / span) / span**order)
        row = [k * a for k, a in enumerate(row)][1:] or [mp.mpf(0)]
    return values


def gauss(edges: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return Gauss-Legendre nodes and weights, `count` between adjacent edges."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    half = 0.5 * np.diff(edges)[:, None]
    return (np.asarray(edges)[:-1, None] + half * (nodes + 1.0)).ravel(), (half * weights).ravel()


def cut_at_joints(law: Law, speed: float, start: float, end: float) -> np.ndarray:
    """Return `start`, `end` and the times (s) of the law's joints between them.

    At a joint two polynomial pieces of the law meet. The cam is at angle 0 at time 0.
    """
    turns = np.arange(1 + int(speed * end / TURN))[:, None]
    joints = ((law.breaks[:-1] + TURN * turns) / speed).ravel()
    inner = joints[(joints > start + 1e-13) & (joints < end - 1e-13)]
    return np.array([start, *inner, end])
