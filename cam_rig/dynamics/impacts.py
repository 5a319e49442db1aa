"""Landing impulses on the sample grid."""

from __future__ import annotations

from collections.abc import Sequence

from cam_rig.arrays import FloatArray
from cam_rig.dynamics.interval import Event, SampleGrid
from cam_rig.dynamics.samples import Samples


def show_impulses(
    rows: FloatArray, grid: SampleGrid, events: Sequence[Event], pending: float
) -> float:
    """Add each impulse to the sample at or after it; return what comes after the last one.

    ``events`` have times in s since the interval's start; ``pending`` (N·s) is what the interval
    before could not show.
    """
    late = 0.0
    due = [(0, pending)] + [(grid.index_after(event.time), event.impulse) for event in events]
    for index, impulse in due:
        if index < grid.count:
            Samples(rows).impulse[index] += impulse
        else:
            late += impulse
    return late
