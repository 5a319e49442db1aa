"""Rigs, laws and runs of a follower model, for all tests of the models."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pytest

from cam_rig.dynamics import (
    Event,
    FollowerParameters,
    FollowerState,
    Interval,
    TwoMassParameters,
)
from cam_rig.laws import Law, bernstein
from cam_rig.laws.sampling import fit
from cam_rig.schema import RigConfig, load_rig
from cam_rig.units import RPM, TURN

from .helpers import edge_law, ticked


@dataclass
class Result:
    """All samples, all events, and the last state of a run."""

    rows: np.ndarray
    events: list[Event]
    state: FollowerState


@pytest.fixture(scope="session")
def run() -> Callable[..., Result]:
    """Run a model at one speed through intervals between the instants ``cuts_ns``."""

    def go(
        law: Law,
        parameters: FollowerParameters,
        rpm: float,
        cuts_ns: Sequence[int],
        *,
        model: str = "one_mass",
        sample_rate: int = 8000,
        state: FollowerState | None = None,
    ) -> Result:
        whole = Interval(0, cuts_ns[-1], 0.0, rpm * RPM)
        return Result(*ticked(law, model, parameters, whole, cuts_ns, sample_rate, state))

    return go


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
def harmonic() -> Law:
    """Dwell 60°, simple-harmonic rise of 50 mm over 120°, dwell 60°, fall over 120°.

    s'' jumps by ± h π²/(2β²) at both ends of each.
    """
    lift, span = 0.05, np.radians(120.0)

    def rise(u, order):
        cosine = [np.cos, lambda x: -np.sin(x), lambda x: -np.cos(x), np.sin][order](np.pi * u)
        return 0.5 * lift * ((order == 0) - np.pi**order * cosine)

    breaks, pieces = fit(rise, 0.0, 1.0)
    degree, dwell = pieces[0].size - 1, np.radians(60.0)
    up, steps = pieces, span * np.diff(breaks)
    down = [column[::-1] for column in reversed(pieces)]
    rests = [bernstein.elevate(np.array([level]), degree) for level in (0.0, lift)]
    edges = np.cumsum([0.0, dwell, *steps, dwell, *steps[::-1]])
    edges[-1] = TURN
    return Law("harmonic", edges, np.stack([rests[0], *up, rests[1], *down], axis=1))
