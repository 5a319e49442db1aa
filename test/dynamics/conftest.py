"""Runs of a follower model, cut into intervals anywhere."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pytest

from cam_rig.dynamics import MODELS, NS, Event, FollowerParameters, FollowerState, Interval
from cam_rig.laws import Law


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
        speed = rpm * np.pi / 30.0
        rows, events = [], []
        for start, stop in itertools.pairwise(cuts_ns):
            interval = Interval(start, stop, speed * start / NS, speed)
            state, block = MODELS[model].advance(law, parameters, state, interval, sample_rate)
            rows.append(block.rows)
            events += block.events
        assert state is not None
        return Result(np.concatenate(rows, axis=1), events, state)

    return go
