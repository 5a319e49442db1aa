"""Rigs, laws and runs of a follower model, for all tests of the models."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest

from cam_rig.laws import Law, build_law

from ..conftest import dwell, rise
from .helpers import edge_law


@pytest.fixture
def at_once() -> Iterator[None]:
    """A refusal is immediate: this process computes for no more than 3 s, however long that is."""
    begun = time.process_time()
    yield
    assert time.process_time() - begun < 3.0


@pytest.fixture(scope="session")
def edge() -> Law:
    """A cam of constant velocity: its velocity jumps at four joints."""
    return edge_law()


@pytest.fixture(scope="session")
def harmonic(make_cam) -> Law:
    """Dwell 60°, simple-harmonic rise of 50 mm over 120°, dwell 60°, fall over 120°.

    s'' jumps by ± h π²/(2β²) at both ends of each.
    """
    up, down = (rise(120, to, "simple_harmonic") for to in (1, 0))
    return build_law(make_cam(dwell(60), up, dwell(60), down))
