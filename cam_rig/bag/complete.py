"""Checking by count that a bag holds every tick of its scene."""

from __future__ import annotations

from pathlib import Path

from cam_rig.bag.reader import read_counts
from cam_rig.bag.topics import RECORDING
from cam_rig.errors import BagError
from cam_rig.experiment.program import tick_count
from cam_rig.schema import SceneConfig


def require_complete(bag: Path, scene: SceneConfig) -> dict[str, int]:
    """Messages a topic, when none is missing.

    Raises
    ------
    BagError : a topic has fewer or more messages than the scene has ticks, states, cams or speeds
    """
    counts, ticks = read_counts(bag), tick_count(scene)
    cams = len(scene.cams)
    expected = {
        "tick": ticks,
        "state": ticks + 1,
        "cam": cams,
        "speed": cams * len(scene.program.speeds.si_list),
    }
    for topic in RECORDING:
        if topic.per in expected and counts.get(topic.name, 0) != expected[topic.per]:
            raise BagError(
                f"{bag}: {topic.name} has {counts.get(topic.name, 0)} messages; expected: "
                f"{expected[topic.per]}, one for each {topic.per}"
            )
    return counts
