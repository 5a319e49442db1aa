"""Simulated machines whose numbers are known."""

import pytest

import cam_rig


@pytest.fixture(scope="session")
def law():
    return cam_rig.build_law(cam_rig.load_cam("poly345"))


@pytest.fixture(scope="session")
def rig():
    return cam_rig.load_rig("tm21")
