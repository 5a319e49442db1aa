"""What the drive does: the scene's speeds, tick by tick, as states of the cam."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from cam_rig.dynamics import NS, Interval
from cam_rig.schema import SceneConfig


@dataclass(frozen=True)
class CamState:
    """The cam from ``time_ns`` (rig time) until the next state: it turns at constant speed.

    ``angle`` unwrapped in rad, ``speed`` in rad/s, ``cam`` the name of the mounted cam.
    """

    time_ns: int
    angle: float
    speed: float
    cam: str

    def until(self, end: CamState) -> Interval:
        """The interval that ends with the next state."""
        return Interval(self.time_ns, end.time_ns, self.angle, self.speed)


def cam_states(scene: SceneConfig) -> Iterator[CamState]:
    """All states of a scene in order; the last one stands still and closes the last tick.

    Each speed is held for whole turns; θ goes on from one to the next without a jump.
    """
    time_ns, angle = 0, 0.0
    for cam in scene.cams:
        for speed in scene.program.speeds.si_list:
            ticks = ticks_a_step(scene)
            tick = 2.0 * math.pi / speed / scene.program.ticks_per_turn
            for i in range(ticks):
                offset = round(i * tick * NS)
                yield CamState(time_ns + offset, angle + speed * offset / NS, speed, cam)
            length = round(ticks * tick * NS)
            time_ns, angle = time_ns + length, angle + speed * length / NS
    yield CamState(time_ns, angle, 0.0, scene.cams[-1])


def ticks_a_step(scene: SceneConfig) -> int:
    """Ticks at each speed of each cam."""
    return int(scene.program.turns.si) * scene.program.ticks_per_turn


def tick_count(scene: SceneConfig) -> int:
    """Ticks of the whole scene."""
    speeds: list[float] = scene.program.speeds.si_list
    return len(scene.cams) * len(speeds) * ticks_a_step(scene)
