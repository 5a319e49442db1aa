"""Landing impulses on the sample grid."""

from __future__ import annotations

from collections.abc import Sequence

from cam_rig.arrays import FloatArray
from cam_rig.dynamics.interval import Event, SampleGrid
from cam_rig.dynamics.samples import Samples
from cam_rig.laws import Law


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


#: A change of the cam's velocity below this fraction of (cam speed x lift) is rounding: no step.
NO_IMPACT = 1e-12
#: A bounce is contact when it is lower than this fraction of the lift, or than so many metres,
#: a hundred thousandth of an atom.
MIN_OF_LIFT, MIN_HEIGHT = 1e-12, 1e-15


def least_bounce(law: Law) -> float:
    """Height (m) below which a bounce is contact."""
    return max(MIN_OF_LIFT * law.lift, MIN_HEIGHT)
