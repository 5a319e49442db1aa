"""The cam of most simulated machines whose numbers are known; the rig is the shipped one."""

import pytest


@pytest.fixture(scope="session")
def law(laws):
    return laws["poly345"]
