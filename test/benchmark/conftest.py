"""Fixture of the cases of the comparison with other solvers."""

import pytest

from benchmark.speed.cases import CASES


@pytest.fixture(scope="session")
def cases():
    """All cases of the comparison with other solvers, by name."""
    return {name: make() for name, make in CASES.items()}
