"""Where readings are missing is told by the steps between those that are there."""

import doctest

import numpy as np

from cam_rig.simulation import instruments as measured_run
from cam_rig.simulation.instruments import Signal


def test_the_example_is_true():
    """Ten of two hundred."""
    assert doctest.testmod(measured_run, extraglobs={"np": np}).failed == 0


def test_an_encoder_that_reports_each_count_has_no_gap_where_it_turns_slower():
    """Eight times slower, the steps are eight times as long; a lost stretch there is a gap."""
    steps = np.repeat([1e-4, 8e-4], [3000, 1000])
    time = np.cumsum(steps * (1.0 + 0.02 * np.sin(np.arange(4000))))
    assert Signal(time, time).gaps().size == 0
    kept = np.delete(time, slice(3500, 3504))
    np.testing.assert_array_equal(Signal(kept, kept).gaps(), [[time[3499], time[3504]]])


def test_stamps_that_scatter_are_no_gaps():
    """A network that delivers in bursts: steps from nothing to three times the usual."""
    rng = np.random.default_rng(2)
    time = np.cumsum(rng.uniform(0.0, 2e-3, 5000))
    assert Signal(time, time).gaps().size == 0
    assert Signal(time[:3], time[:3]).gaps().size == 0
