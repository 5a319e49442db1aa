"""Robots with each kind of follower, and their messages read back."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from rosbags.typesys import Stores, get_typestore

from cam_rig.messages.frames import Robot
from cam_rig.simulation.scene import LoadedScene, open_scene

CONFIG = Path(__file__).parents[3] / "config"
#: One cam of each kind of follower that a rig turns.
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
def scene_of_kinds() -> LoadedScene:
    """A scene that an operator has mounted a cam of each kind in."""
    loaded = open_scene(CONFIG / "scenes" / "quick.yaml")
    for name in KINDS:
        loaded.mount(name)
    return loaded


@pytest.fixture(scope="session", params=KINDS)
def robot(request: pytest.FixtureRequest, scene_of_kinds: LoadedScene) -> Robot:
    """The rig with each kind of follower in turn."""
    return Robot.of(scene_of_kinds, request.param)


@pytest.fixture(scope="session")
def read() -> Callable[[bytes, str], Any]:
    """Read serialized messages by a type."""
    types = get_typestore(Stores.ROS2_KILTED)
    return types.deserialize_cdr
