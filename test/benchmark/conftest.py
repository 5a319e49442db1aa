import pytest

from benchmark.speed.cases import CASES


@pytest.fixture(scope="session")
def cases():
    """Every case of the study by name."""
    return {name: make() for name, make in CASES.items()}
