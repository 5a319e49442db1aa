"""What is published of the cams at hand, and what it was used for: told by content, not by name.

A cam is the paper's where its segments have the same laws as the shipped cam of that name, over
whatever angles. It is fitted, or a test, only as the shipped cam on the shipped rig: nothing of
another rig, or of a cam with other angles, was identified from the table.
"""

from __future__ import annotations

from dataclasses import dataclass

from cam_rig.schema import PublishedTables, RigConfig, load_rig
from cam_rig.schema.load import config_root
from cam_rig.schema.shipped import WORDS, bare, same_as_shipped
from cam_rig.studies.cam_set import CamSet

#: The rig that was identified from the jump speeds.
IDENTIFIED = "paper_table2"


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
        if known is None or not same_as_shipped(cam, WORDS | {"span"}):
            continue
        role = ""
        if rig and same_as_shipped(cam, WORDS):
            role = "fitted" if name in published.table_2_defined else "test"
        found[name] = Reference(known.rpm, known.time_s, role)
    return found


def is_identified(rig: RigConfig) -> bool:
    """Whether a rig's follower is the one that was identified from the jump speeds."""
    shipped = load_rig(config_root() / "rigs" / f"{IDENTIFIED}.yaml")
    return bool(bare(rig.follower, WORDS) == bare(shipped.follower, WORDS))
