"""Fixtures of robots, each with a cam for another type of follower."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from cam_rig.messages.frames import Robot
from cam_rig.messages.urdf import urdf
from cam_rig.simulation.scene import open_scene

CONFIG = Path(__file__).parents[2] / "config"
#: Names of cams, each with a different type of follower.
KINDS = (
    "poly345",
    "eccentric_roller",
    "flat",
    "inclined_flat",
    "oscillating_point",
    "oscillating_roller",
    "oscillating_flat",
)


@pytest.fixture(scope="session")
def scene_of_kinds():
    """Scene with a cam for each type of follower, as if an operator had mounted them."""
    loaded = open_scene(CONFIG / "scenes" / "quick.yaml")
    for name in KINDS:
        loaded.mount(name)
    return loaded


@pytest.fixture(scope="session", params=KINDS)
def kind(request, scene_of_kinds):
    """Robot description for each type of follower: `robot` and its URDF text `urdf`.

    The fixture runs a test once per type.
    """
    robot = Robot.of(scene_of_kinds, request.param)
    return SimpleNamespace(robot=robot, urdf=urdf(robot))
