"""The acoustic constants of the shipped rig, and a microphone over whole turns."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

from cam_rig.acoustics import RadiationParameters, rms_pressure
from cam_rig.dynamics import FollowerParameters, Interval, kinetostatic
from cam_rig.laws import Law
from cam_rig.units import NS


@pytest.fixture
def silent(radiation: RadiationParameters) -> RadiationParameters:
    """The same without background (−400 dB)."""
    return dataclasses.replace(radiation, background=-400.0)


@pytest.fixture(scope="session")
def last_turn_power() -> Callable[..., float]:
    """Mean square pressure over the last of some turns of a follower that keeps contact."""

    def measure(
        law: Law,
        follower: FollowerParameters,
        radiation: RadiationParameters,
        rpm: int,
        turns: int,
        sample_rate: int,
    ) -> float:
        speed, turn_ns, state, power = rpm * np.pi / 30.0, 60 * NS // rpm, None, 0.0
        for n in range(turns):
            interval = Interval(n * turn_ns, (n + 1) * turn_ns, speed * n * turn_ns / NS, speed)
            _, block = kinetostatic.advance(law, follower, None, interval, sample_rate)
            state, pressure = rms_pressure(
                radiation, state, block.rows[4], block.rows[5], sample_rate, speed
            )
            power = pressure**2
        return power

    return measure
