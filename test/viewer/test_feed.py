"""Messages come on many topics in any order; the picture is the same."""

from __future__ import annotations

import random
from collections.abc import Callable

import numpy as np
import pytest

from cam_rig.errors import BagError
from cam_rig.simulation.schedule import CamState, cam_states
from cam_rig.units import FloatArray
from cam_rig.viewer.recording import RunFeed

from .conftest import SmallBag


class Notes:
    """Stands for a recording: writes down what it receives."""

    def __init__(self) -> None:
        self.profiles: dict[str, FloatArray] = {}
        self.received: list[tuple[str, int]] = []
        self.levels: list[float] = []

    def tick(self, start: CamState, end: CamState, rows: FloatArray) -> None:
        assert start.cam in self.profiles
        assert start.time_ns <= round(rows[0, 0] * 1e9) <= end.time_ns
        self.received.append(("tick", end.time_ns))

    def sound(self, end_ns: int, level: float, pressure: float) -> None:
        np.testing.assert_allclose(level, 20.0 * np.log10(pressure / 20e-6))
        self.received.append(("sound", end_ns))
        self.levels.append(level)

    def close(self) -> None:
        self.received.append(("close", 0))


def echoed(calls: list[Callable[[], None]]) -> list[Callable[[], None]]:
    """After every third call, the last three once more."""
    return [call for i in range(0, len(calls), 3) for call in 2 * calls[i : i + 3]]


@pytest.mark.variants(8)
@pytest.mark.parametrize("republished", [False, True])
@pytest.mark.parametrize("seed", range(8))
def test_any_order_of_topics_gives_the_ticks_in_order(
    bag: SmallBag, seed: int, republished: bool
) -> None:
    """Each topic keeps its own order; every tick is passed on once, and its sound after it.

    Also when nodes republish what a subscriber may have missed.
    """
    notes = Notes()
    feed = RunFeed(notes)
    queues = [
        [lambda c=c, p=p: feed.profile(c, p) for c, p in bag.profiles.items()],
        [lambda s=s: feed.state(s) for s in cam_states(bag.loaded.scene)],
        [lambda r=r: feed.block(r) for r in bag.rows],
        [lambda v=v: feed.level(v) for _, v in bag.levels],
        [
            lambda t=t, p=p: feed.pressure(t, p)
            for (t, _), p in zip(bag.levels, bag.pressures, strict=True)
        ],
    ]
    queues = [echoed(queue) if republished else queue for queue in queues]
    chance = random.Random(seed)
    while any(queues):
        chance.choice([queue for queue in queues if queue]).pop(0)()
        for _ in feed.draw():
            pass
    feed.close()
    ends = [t for t, _ in bag.levels]
    assert [t for what, t in notes.received if what == "tick"] == ends
    assert [t for what, t in notes.received if what == "sound"] == ends
    assert notes.levels == [v for _, v in bag.levels]
    assert all(notes.received.index(("tick", t)) < notes.received.index(("sound", t)) for t in ends)
    assert notes.received[-1] == ("close", 0)


def test_a_cam_without_a_profile_waits_and_is_named_at_the_end(bag: SmallBag) -> None:
    """Nothing is drawn of it; the end says which cam it was."""
    notes = Notes()
    feed = RunFeed(notes)
    for state in cam_states(bag.loaded.scene):
        feed.state(state)
    for rows in bag.rows:
        feed.block(rows)
    assert list(feed.draw()) == []
    with pytest.raises(BagError, match="cam 'poly345' turns, but its /cam/profile is not"):
        feed.close()
