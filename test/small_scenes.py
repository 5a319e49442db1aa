"""Small scenes made on the spot, and their files read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from cam_rig.schema import SceneConfig
from cam_rig.simulation.scene import LoadedScene, open_scene


def scene_data(**changes: Any) -> dict[str, Any]:
    """A scene as its file says it: two cams, three speeds, three turns each."""

    def assumed(value: Any, unit: str) -> dict[str, Any]:
        return {"assumed": value, "unit": unit}

    program = {
        "speeds": assumed(changes.pop("speeds", [200, 300, 400]), "rpm"),
        "turns": assumed(changes.pop("turns", 3), "turns"),
        "settle_turns": assumed(changes.pop("settle_turns", 1), "turns"),
        "ticks_per_turn": changes.pop("ticks_per_turn", 1),
    }
    return {
        "name": "small",
        "title": "a small scene",
        "cams": ["poly345", "bezier15"],
        "rig": "tm21",
        "model": "one_mass",
        "sample_rate": assumed(changes.pop("sample_rate", 8000), "Hz"),
        "program": program,
        **changes,
    }


@pytest.fixture(scope="session")
def make_scene() -> Callable[..., SceneConfig]:
    """Make a scene, with changes."""
    return lambda **changes: SceneConfig.model_validate(scene_data(**changes))


@pytest.fixture
def make_loaded_scene(tmp_path: Path) -> Callable[..., LoadedScene]:
    """Write a scene file, with changes, and open it with all it names."""

    def make(**changes: Any) -> LoadedScene:
        path = tmp_path / "scenes" / "small.yaml"
        path.parent.mkdir(exist_ok=True)
        with path.open("w", encoding="utf-8") as file:
            YAML(typ="safe").dump(scene_data(**changes), file)
        return open_scene(path)

    return make
