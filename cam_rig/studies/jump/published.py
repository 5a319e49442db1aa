"""What is published of the cams at hand, and what it was used for: told by content, not by name.

A cam is the paper's where its segments have the same laws as the shipped cam of that name, over
whatever angles. It is fitted, or a test, only as the shipped cam on the shipped rig: nothing of
another rig, or of a cam with other angles, was identified from the table.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel

from cam_rig.schema import CamConfig, PublishedTables, RigConfig, load_cam, load_rig
from cam_rig.schema.load import config_root
from cam_rig.studies.cam_set import CamSet

#: The rig that was identified from the jump speeds.
IDENTIFIED = "paper_table2"
#: Keys of a config file that say where a number comes from.
WORDS = frozenset({"source", "residual"})


@dataclass(frozen=True)
class Reference:
    """A published jump speed (rpm) and time (s); ``role`` is fitted, test, or empty."""

    rpm: float
    time: float
    role: str = ""


def references(cam_set: CamSet, published: PublishedTables) -> dict[str, Reference]:
    """What is published of a set of cams, by cam."""
    rig = is_identified(cam_set.rig)
    found = {}
    for name, cam in cam_set.cams.items():
        known = published.table_2_jump.get(name)
        if known is None or not _same(cam, WORDS | {"span"}):
            continue
        role = ""
        if rig and _same(cam, WORDS):
            role = "fitted" if name in published.table_2_defined else "test"
        found[name] = Reference(known.rpm, known.time_s, role)
    return found


def is_identified(rig: RigConfig) -> bool:
    """Whether a rig's follower is the one that was identified from the jump speeds."""
    shipped = load_rig(config_root() / "rigs" / f"{IDENTIFIED}.yaml")
    return bool(_bare(rig.follower, WORDS) == _bare(shipped.follower, WORDS))


def _same(cam: CamConfig, without: frozenset[str]) -> bool:
    """Whether a cam moves as the shipped one of its name does."""
    path = config_root() / "cams" / f"{cam.name}.yaml"
    if not path.is_file():
        return False
    shipped = load_cam(path)
    return all(
        _bare(getattr(cam, key), without) == _bare(getattr(shipped, key), without)
        for key in ("lift", "segments")
    )


def _bare(value: Any, without: frozenset[str]) -> Any:
    """Plain data without some of its keys."""
    if isinstance(value, BaseModel):
        value = value.model_dump()
    if isinstance(value, dict):
        return {k: _bare(v, without) for k, v in value.items() if k not in without}
    return [_bare(v, without) for v in value] if isinstance(value, list | tuple) else value
