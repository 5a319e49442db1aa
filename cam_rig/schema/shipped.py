"""Whether a file is a shipped one, told by its numbers and laws and not by its name."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel

from cam_rig.schema.cam import CamConfig
from cam_rig.schema.load import config_root, load_cam

#: Keys of a config file that say where a number comes from.
WORDS = frozenset({"source", "residual"})


def same_as_shipped(cam: CamConfig, without: frozenset[str] = WORDS) -> bool:
    """Whether a cam moves as the shipped one of its name does."""
    path = config_root() / "cams" / f"{cam.name}.yaml"
    if not path.is_file():
        return False
    shipped = load_cam(path)
    return all(
        bare(getattr(cam, key), without) == bare(getattr(shipped, key), without)
        for key in ("lift", "segments")
    )


def bare(value: Any, without: frozenset[str]) -> Any:
    """Plain data without some of its keys."""
    if isinstance(value, BaseModel):
        value = value.model_dump()
    if isinstance(value, dict):
        return {k: bare(v, without) for k, v in value.items() if k not in without}
    return [bare(v, without) for v in value] if isinstance(value, list | tuple) else value
