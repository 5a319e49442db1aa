"""What tests of the models share: runs cut into ticks, one flight over a cam, Gauss's rule."""

from __future__ import annotations

import itertools
from collections.abc import Iterable

import numpy as np

from cam_rig.dynamics import MODELS, Event, FollowerState, Interval, TwoMassParameters
from cam_rig.dynamics.events.approach import Gap, Hop, landing
from cam_rig.dynamics.events.course import free_table, law_table
from cam_rig.dynamics.events.free_flight import launched
from cam_rig.dynamics.events.law_table import Cam
from cam_rig.dynamics.linear.exponential import Flight
from cam_rig.laws import Law
from cam_rig.units import NS, TURN

#: ns in a millisecond.
MS = NS // 1000


def ticked(
    law: Law,
    model: str,
    p,
    whole: Interval,
    cuts: Iterable[int],
    rate: int = 8000,
    state: FollowerState | None = None,
    nudge: float = 0.0,
) -> tuple[np.ndarray, list[Event], FollowerState]:
    """Rows, events and last state of an interval cut at instants (ns since its start).

    ``nudge`` (rad) is added to every second tick's angle.
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
    return np.hstack(rows), events, state


def every(tick: int, total: int) -> list[int]:
    """The instants (ns) between which a time lies in ticks."""
    return [*range(0, total, tick), total]


def land(
    flight: Flight, law: Law, angle: float, speed: float, limit: float, noise: float = 0.0
) -> Gap:
    """Where a flight from a cam angle (rad) on ends; ``noise`` as in `Hop`."""
    launch = launched(free_table(flight.system, arrays=False), flight.start.tolist())
    gap, opening = flight.known or (0.0, 0.0)
    cam = Cam(law_table(law, arrays=False), float(speed), float(angle))
    return landing(Hop(launch, cam, bool(flight.known), float(gap), float(opening), noise), limit)


def edge_law() -> Law:
    """Dwell, constant velocity up by 50 mm over 90°, dwell, as much down, dwell."""
    breaks = np.radians([0.0, 60.0, 150.0, 210.0, 300.0, 360.0])
    breaks[-1] = TURN
    return Law("edge", breaks, 0.05 * np.array([[0.0, 0, 1, 1, 0], [0, 1, 1, 0, 0]]))


def flight_matrix(p: TwoMassParameters) -> np.ndarray:
    """A of (z, ż, y, ẏ) of two masses in flight."""
    rows = [
        [-p.stem_stiffness, -p.stem_damping, p.stem_stiffness, p.stem_damping],
        [p.stem_stiffness, p.stem_damping, -p.stiffness, -(p.stem_damping + p.damping)],
    ]
    first, last = np.array(rows) / [[p.roller_mass], [p.end_mass]]
    return np.stack([[0.0, 1.0, 0.0, 0.0], first, [0.0, 0.0, 0.0, 1.0], last])


def flight_load(p: TwoMassParameters) -> np.ndarray:
    """The constant part of its rate."""
    return np.array([0.0, 0.0, 0.0, -p.preload / p.end_mass])


def gauss(edges: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights of Gauss and Legendre, ``count`` of them between each two edges."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    half = 0.5 * np.diff(edges)[:, None]
    return (np.asarray(edges)[:-1, None] + half * (nodes + 1.0)).ravel(), (half * weights).ravel()


def cut_at_joints(law: Law, speed: float, begin: float, end: float) -> np.ndarray:
    """[begin, end] (s) cut at the joints of the law, which is at 0 at time 0."""
    turns = np.arange(1 + int(speed * end / TURN))[:, None]
    joints = ((law.breaks[:-1] + TURN * turns) / speed).ravel()
    inner = joints[(joints > begin + 1e-13) & (joints < end - 1e-13)]
    return np.array([begin, *inner, end])
