"""Fixtures with simulated dial-gauge readings of shipped laws.

The readings have the errors of a gauge.
"""

import numpy as np
import pytest

from cam_rig.laws.arc_law import ArcFollower
from cam_rig.studies.fit_cam.gauge import order_readings
from cam_rig.studies.fit_cam.gauge_table import GaugeColumn, GaugeTable
from cam_rig.units import TURN


def all_around(count):
    """Return `count` equally spaced cam angles (rad) over one turn."""
    return np.linspace(0.0, TURN, count, endpoint=False)


def in_order(angles, lifts, resolution=1e-9, **options):
    """Return readings (rad, m) as if read from a file, sorted by angle.

    The first reading is in line 2 of the file, after the heading. `resolution` is that of the gauge
    in m.
    """
    column = GaugeColumn("lift", tuple(map(float, lifts)), resolution)
    lines = tuple(range(2, 2 + len(angles)))
    table = GaugeTable("lifts.csv", tuple(map(float, angles)), (column,), lines, ())
    return order_readings(table, column, **options)


FLAT, ROLLER = ArcFollower(True, 0.0), ArcFollower(False, 0.01)
ANGLES = all_around(72)


def readings_of(arcs, *followers, noise=0.0, reverse=(), seed=0):
    """Return simulated readings of a tangent-arc contour, one column per follower.

    The columns with the indices `reverse` are read with the cam turned backwards. `noise` is in m.
    """
    rng = np.random.default_rng(seed)
    columns = []
    for i, follower in enumerate(followers):
        lifts = arcs.lifts(follower, -ANGLES if i in reverse else ANGLES)
        columns.append(in_order(ANGLES, lifts + rng.normal(scale=noise, size=ANGLES.size)))
    return tuple(columns)


@pytest.fixture(scope="session")
def scaled(laws):
    """Function that returns the lift function of a shipped law, scaled to 10 mm."""

    def of(name):
        factor = 0.01 / laws[name].lift
        return lambda angle, order=0: factor * laws[name](angle, order)

    return of


@pytest.fixture(scope="session")
def measured(scaled):
    """Function that returns readings of a shipped law with a lift of 10 mm.

    They have noise and a zero error (m), and outliers by index.
    """

    def read(name, count=360, noise=2e-6, zero=0.0, seed=0, outliers=None):
        lifts = scaled(name)(all_around(count)) + zero
        lifts += np.random.default_rng(seed).normal(scale=noise, size=count)
        for place, outlier in (outliers or {}).items():
            lifts[place] += outlier
        return in_order(all_around(count), lifts)

    return read
