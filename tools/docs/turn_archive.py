"""Archive of the last turn at each speed of each cam of a bag."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from cam_rig.bag.reader import read_scene
from cam_rig.dynamics import Samples
from cam_rig.errors import BagError
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.schedule import CamState
from cam_rig.units import FloatArray
from cam_rig.viewer.recording import RunFeed, feed_bag
from cam_rig.viewer.timeline import Turn, TurnCollector, sample_angles


@dataclass
class TurnArchive:
    """Receiver of the data of a run that stores a turn for each cam and speed (rpm).

    ``profiles`` are the contours of the cams.
    """

    loaded: LoadedScene
    profiles: dict[str, FloatArray] = field(default_factory=dict)
    turns: dict[tuple[str, float], Turn] = field(default_factory=dict)
    _newest: TurnCollector = field(init=False)

    def __post_init__(self) -> None:
        self._newest = TurnCollector(self.loaded.scene.schedule.ticks_per_turn)

    def tick(self, start: CamState, end: CamState, rows: FloatArray) -> None:
        """Store the samples of a tick."""
        if not start.is_steady_until(end):
            return
        self._newest.add(start, sample_angles(start, end, Samples(rows).time), rows)
        turn = self._newest.turn()
        if turn is not None:
            self.turns[turn.cam, round(turn.rpm, 9)] = turn

    def sound(self, end_ns: int, level: float, pressure: float) -> None:
        """Ignore the sound."""

    def close(self) -> None:
        """Do nothing, because there is no remaining data."""

    def turn(self, cam: str, rpm: float) -> Turn:
        """Return the last turn of a cam at a speed (rpm)."""
        if (cam, rpm) not in self.turns:
            raise BagError(f"no whole turn of {cam!r} at {rpm:g} rpm; was the run interrupted?")
        return self.turns[cam, rpm]


def read_turns(bag: Path, on_tick: Callable[[], None] = lambda: None) -> TurnArchive:
    """Return the turns of a bag. ``on_tick`` is called after each tick."""
    archive = TurnArchive(read_scene(bag))
    feed_bag(bag, archive.loaded, RunFeed(archive), on_tick)
    return archive


def gap(loaded: LoadedScene, turn: Turn) -> FloatArray:
    """Return the gap between follower and cam (m), 0 in contact, ``(n,)``."""
    off = turn.force == 0.0
    return np.where(off, turn.lift - loaded.laws[turn.cam](turn.angle), 0.0)
