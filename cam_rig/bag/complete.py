"""Whether a bag holds every message of every tick of its scene."""

from __future__ import annotations

from pathlib import Path

from cam_rig.bag.reader import messages, read_counts
from cam_rig.errors import BagError, RefusedError
from cam_rig.messages import topics
from cam_rig.messages.codec import cam_state_of
from cam_rig.messages.topics import RECEIVED, Topic
from cam_rig.schema import SceneConfig
from cam_rig.simulation.schedule import CamState, tick_count


def require_complete(bag: Path, scene: SceneConfig) -> dict[str, int]:
    """Messages a topic, when none is missing.

    The states in the bag determine what it must hold; there are as many as the scene has, or more
    where the drive was reset to the beginning.

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
    for topic in RECEIVED:
        if topic.per in expected and counts.get(topic.name, 0) != expected[topic.per]:
            raise BagError(
                f"{bag}: {topic.name} has {counts.get(topic.name, 0)} messages; expected: "
                f"{expected[topic.per]}, one for each {topic.per}"
            )
        # None at all in bags of earlier versions; how many a tick is a parameter.
        if topic.per == "instant" and 0 < counts.get(topic.name, 0) < expected["tick"]:
            raise BagError(
                f"{bag}: {topic.name} has {counts[topic.name]} messages; expected: at least "
                f"{expected['tick']}, one for each tick"
            )
    return counts


def belonging(before: CamState | None, state: CamState) -> tuple[Topic, ...]:
    """Topics that have a message at a state's time, by the state before it (None at the first)."""
    new_cam = before is None or before.cam != state.cam
    new_speed = state.speed > 0.0 and (
        before is None or (before.cam, before.speed) != (state.cam, state.speed)
    )
    turned = before is not None and before.turns_until(state)
    there = {"state": True, "cam": new_cam, "speed": new_speed, "tick": turned}
    return tuple(topic for topic in RECEIVED if there.get(topic.per, False))


def expected_counts(states: list[CamState]) -> dict[str, int]:
    """How many ticks, states, cams and speeds there are in a series of states."""
    counts = dict.fromkeys(("tick", "state", "cam", "speed"), 0)
    for before, state in zip([None, *states], states, strict=False):
        for per in {topic.per for topic in belonging(before, state)}:
            counts[per] += 1
    return counts
