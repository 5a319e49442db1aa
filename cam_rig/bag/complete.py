"""Checking that a bag holds every message of every tick of its scene."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

from cam_rig.bag import topics
from cam_rig.bag.codec import cam_state_of
from cam_rig.bag.reader import messages, read_counts
from cam_rig.bag.topics import RECORDING
from cam_rig.errors import BagError, RefusedError
from cam_rig.experiment.program import CamState, tick_count
from cam_rig.schema import SceneConfig


def require_complete(bag: Path, scene: SceneConfig) -> dict[str, int]:
    """Messages a topic, when none is missing.

    The states in the bag tell what there must be; there are as many as the scene has, or more
    where the drive was set back to the beginning.

    Raises
    ------
    BagError : a topic has fewer or more messages than there are ticks, states, cams or speeds
    """
    counts = read_counts(bag)
    try:
        found = messages(bag, (topics.CAM_STATE,))
        states = [cam_state_of(message) for _, _, message in found]
    except RefusedError as error:
        raise BagError(f"{bag}: {error}") from None
    if len(states) <= tick_count(scene):
        raise BagError(
            f"{bag}: has {len(states)} states of the cam; the scene has {tick_count(scene) + 1}"
        )
    expected = expected_counts(states)
    for topic in RECORDING:
        if topic.per in expected and counts.get(topic.name, 0) != expected[topic.per]:
            raise BagError(
                f"{bag}: {topic.name} has {counts.get(topic.name, 0)} messages; expected: "
                f"{expected[topic.per]}, one for each {topic.per}"
            )
    return counts


def expected_counts(states: list[CamState]) -> dict[str, int]:
    """How many ticks, states, cams and speeds there are in a series of states."""
    moves = list(pairwise(states))
    return {
        "tick": sum(start.turns_until(end) for start, end in moves),
        "state": len(states),
        "cam": 1 + sum(start.cam != end.cam for start, end in moves),
        "speed": (states[0].speed > 0.0)
        + sum(
            end.speed > 0.0 and (start.cam, start.speed) != (end.cam, end.speed)
            for start, end in moves
        ),
    }
