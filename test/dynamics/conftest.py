"""Rigs, laws and runs of a follower model, for all tests of the models."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np
import pytest

from cam_rig.laws import Law, build_law
from cam_rig.units import TURN

from ..conftest import dwell, rise


@pytest.fixture
def at_once() -> Iterator[None]:
    """A refusal is immediate: this process computes for no more than 3 s, however long that is."""
    begun = time.process_time()
    yield
    assert time.process_time() - begun < 3.0


@pytest.fixture(scope="session")
def edge() -> Law:
    """A cam of constant velocity: its velocity jumps at four joints.

    Dwell of 60°, rise of 50 mm over 90°, dwell of 60°, fall over 90°, dwell of 60°.
    """
    breaks = np.radians([0.0, 60.0, 150.0, 210.0, 300.0, 360.0])
    breaks[-1] = TURN
    return Law("edge", breaks, 0.05 * np.array([[0.0, 0, 1, 1, 0], [0, 1, 1, 0, 0]]))


@pytest.fixture(scope="session")
def harmonic(make_cam) -> Law:
    """Dwell 60°, simple-harmonic rise of 50 mm over 120°, dwell 60°, fall over 120°.

    s'' jumps by ± h π²/(2β²) at both ends of each.
    """
    up, down = (rise(120, to, "simple_harmonic") for to in (1, 0))
    return build_law(make_cam(dwell(60), up, dwell(60), down))
