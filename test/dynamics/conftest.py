"""Rigs, laws and runs of a follower model, for all tests of the models."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest

from cam_rig.dynamics import TwoMassParameters
from cam_rig.laws import Law, build_law
from cam_rig.schema import RigConfig, load_rig

from .helpers import edge_law


@pytest.fixture
def at_once() -> Iterator[None]:
    """A refusal is immediate: this process computes for no more than 3 s, however long that is."""
    begun = time.process_time()
    yield
    assert time.process_time() - begun < 3.0


@pytest.fixture(scope="session")
def paper_rig(config_dir) -> RigConfig:
    """The rig of the paper's Table 2: two masses, and a shaft."""
    return load_rig(config_dir / "rigs" / "paper_table2.yaml")


@pytest.fixture(scope="session")
def two_mass(paper_rig) -> TwoMassParameters:
    """The two-mass follower of the paper's jump speeds."""
    return TwoMassParameters.from_rig(paper_rig)


@pytest.fixture(scope="session")
def edge() -> Law:
    """A cam of constant velocity: its velocity jumps at four joints."""
    return edge_law()


@pytest.fixture(scope="session")
def harmonic(make_cam) -> Law:
    """Dwell 60°, simple-harmonic rise of 50 mm over 120°, dwell 60°, fall over 120°.

    s'' jumps by ± h π²/(2β²) at both ends of each.
    """
    dwell, motion = {"law": "dwell", "span": 60}, {"law": "simple_harmonic", "span": 120}
    return build_law(make_cam(dwell, motion | {"to": 1}, dwell, motion | {"to": 0}))
