"""Fixture with the cases in which cam_rig is compared with other ODE solvers."""

import pytest

from benchmark.speed.cases import CASES


@pytest.fixture(scope="session")
def cases():
    """All cases in which cam_rig is compared with other ODE solvers, by name."""
    return {name: make() for name, make in CASES.items()}
