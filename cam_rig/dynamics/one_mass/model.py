"""One mass on a rigid stem: contact, lift-off, flight, landing.

In contact the follower is the law. It lifts off where the contact force crosses zero from above,
flies freely, and lands where the gap closes: plastically, or with Newton's restitution. Each
phase is a closed form and each change of phase a root, so neither a step nor the length of an
interval enters the result.

Where the law's velocity jumps up by Δs' there is an impact, a landing with the impulse
m (1 + e) ω Δs'; where it jumps down the follower lifts off with the velocity it had.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.dynamics import kinetostatic
from cam_rig.dynamics.impacts import show_impulses
from cam_rig.dynamics.input_limits import require_turning
from cam_rig.dynamics.interval import Block, FollowerState, Interval, SampleGrid
from cam_rig.dynamics.one_mass.trajectory import OneMassPhase, OneMassTrajectory
from cam_rig.dynamics.parameters import FollowerParameters
from cam_rig.dynamics.ramp import with_ramps
from cam_rig.dynamics.samples import Samples
from cam_rig.laws import Law
from cam_rig.units import NS


@with_ramps
def advance(
    law: Law,
    parameters: FollowerParameters,
    state: FollowerState | None,
    interval: Interval,
    sample_rate: int,
    step: float,
) -> tuple[FollowerState, Block]:
    """Take the follower through the interval, exactly.

    Parameters
    ----------
    state : where the interval before it ended; None puts the follower down on the cam
    sample_rate : Hz
    step : by how much ṡ is more than where ``state`` ended, m/s
    """
    require_turning(interval.speed)
    course = OneMassTrajectory(law, parameters, interval)
    course.run(state, step)
    rows = kinetostatic.contact_samples(law, parameters, interval, sample_rate)
    grid = interval.grid(sample_rate)
    for phase in course.phases:
        if phase.flight is not None:
            _show_flight(rows, grid, phase)
    pending = state.pending_impulse if state is not None else 0.0
    pending = show_impulses(rows, grid, course.events, pending)
    end = replace(course.end, pending_impulse=pending)
    begun = interval.start_ns / NS
    events = tuple(replace(event, time=begun + event.time) for event in course.events)
    return end, Block(interval, rows, events)


def _show_flight(rows: FloatArray, grid: SampleGrid, phase: OneMassPhase) -> None:
    """Put the free motion in place of the law where the follower flies."""
    assert phase.flight is not None
    first, end = grid.index_after(phase.begin), min(grid.index_after(phase.end), grid.count)
    if first < end:
        times = grid.offset + np.arange(first, end) / grid.sample_rate - phase.begin
        shown = Samples(rows)
        shown.motion[:, first:end] = phase.flight.motion(times)
        shown.force[first:end] = 0.0
