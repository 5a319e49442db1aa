"""Fixtures for the tests of the follower models."""

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
    """Fail a test that uses more than 3 s of processor time."""
    start = time.process_time()
    yield
    assert time.process_time() - start < 3.0


@pytest.fixture(scope="session")
def edge() -> Law:
    """Constant-velocity cam, whose velocity jumps at the four ends of rise and fall.

    Dwell of 60°, rise of 50 mm over 90°, dwell of 60°, fall over 90°, dwell of 60°.
    """
    breaks = np.radians([0.0, 60.0, 150.0, 210.0, 300.0, 360.0])
    breaks[-1] = TURN
    return Law("edge", breaks, 0.05 * np.array([[0.0, 0, 1, 1, 0], [0, 1, 1, 0, 0]]))


@pytest.fixture(scope="session")
def harmonic(make_cam) -> Law:
    """Simple-harmonic cam, whose acceleration jumps at the four ends of rise and fall.

    Dwell of 60°, rise of 50 mm over 120°, dwell of 60°, fall over 120°. s'' jumps by ± h π²/(2β²)
    at both ends of rise and fall.
    """
    up, down = (rise(120, to, "simple_harmonic") for to in (1, 0))
    return build_law(make_cam(dwell(60), up, dwell(60), down))
