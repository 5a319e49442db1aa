"""Rows of a block by their names."""

import numpy as np

from cam_rig.dynamics import COLUMNS, Block, Interval, Samples
from cam_rig.units import NS


def test_names_are_the_columns_in_order():
    """Each name gives the row whose heading begins with it, or ends with it before the unit."""
    samples = Samples(np.arange(12.0).reshape(6, 2))
    for row, (name, column) in enumerate(zip(NAMES, COLUMNS, strict=True)):
        assert column.partition(" [")[0] in (name, f"contact_{name}", name[0])
        np.testing.assert_array_equal(getattr(samples, name), samples.rows[row])
    np.testing.assert_array_equal(samples.motion, samples.rows[1:4])


def test_names_are_views():
    """What is written by name is in the array, of a block too."""
    block = Block(Interval(0, NS, 0.0, 1.0), np.zeros((6, 3)))
    block.force[1] = 7.0
    assert block.rows[4].tolist() == [0.0, 7.0, 0.0]


NAMES = ("time", "lift", "velocity", "acceleration", "force", "impulse")
