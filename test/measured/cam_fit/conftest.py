"""Readings of shipped laws, scaled to a lift, with the errors that gauges have."""

import numpy as np
import pytest

from cam_rig.measured.cam_fit.gauge import GaugeColumn, GaugeTable, put_in_order
from cam_rig.units import TURN


def table_of(angles, *lifts, resolution=1e-9, lines=None):
    """A table as it comes from a file."""
    columns = [
        GaugeColumn(f"lift_{i}", tuple(map(float, one)), resolution) for i, one in enumerate(lifts)
    ]
    lines = tuple(lines if lines is not None else range(2, 2 + len(angles)))
    return GaugeTable("lifts.csv", tuple(map(float, angles)), tuple(columns), lines, ())


@pytest.fixture(scope="session")
def scaled(laws):
    """A shipped law with a lift of 10 mm: a function of angle and order."""

    def of(name):
        factor = 0.01 / laws[name].lift
        return lambda angle, order=0: factor * laws[name](angle, order)

    return of


@pytest.fixture(scope="session")
def measured(scaled):
    """Readings in order of a shipped law, 10 mm of lift, with noise and a zero (m)."""

    def read(name, count=360, noise=2e-6, zero=0.0, seed=0, outliers=None, **kwargs):
        angles = np.linspace(0.0, TURN, count, endpoint=False)
        scatter = np.random.default_rng(seed).normal(scale=noise, size=count)
        lifts = scaled(name)(angles) + scatter + zero
        for place, outlier in (outliers or {}).items():
            lifts[place] += outlier
        table = table_of(angles, lifts)
        return put_in_order(table, table.columns[0], **kwargs)

    return read
