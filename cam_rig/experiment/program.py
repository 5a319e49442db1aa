"""What the drive does: the scene's speeds, tick by tick, as states of the cam."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

from cam_rig.dynamics import NS, Interval
from cam_rig.schema import SceneConfig

#: θ may differ from where the state before leads by this, rad: rounding, no more.
ANGLE_TOLERANCE = 1e-6


@dataclass(frozen=True)
class CamState:
    """The cam from ``time_ns`` (rig time) until the next state, at one speed or along a ramp.

    ``angle`` unwrapped in rad, ``speed`` in rad/s, ``cam`` the name of the mounted cam.
    """

    time_ns: int
    angle: float
    speed: float
    cam: str

    def until(self, end: CamState) -> Interval:
        """The interval that ends with the next state.

        The angle turned tells a ramp, at the mean of both speeds, from a speed that is held.
        """
        length = (end.time_ns - self.time_ns) / NS
        turned = end.angle - self.angle
        ramp = abs(turned - 0.5 * (self.speed + end.speed) * length)
        held = abs(turned - self.speed * length)
        acceleration = (end.speed - self.speed) / length if ramp < held else 0.0
        return Interval(self.time_ns, end.time_ns, self.angle, self.speed, acceleration)

    def turns_until(self, end: CamState) -> bool:
        """Whether the cam turns up to another state; else it stood, or another course began."""
        length = (end.time_ns - self.time_ns) / NS
        if self.speed > 0.0 or length <= 0.0:
            return length > 0.0
        turned = end.angle - self.angle
        return turned > 0.0 and abs(turned - 0.5 * end.speed * length) < ANGLE_TOLERANCE

    def holds_until(self, end: CamState) -> bool:
        """Whether the speed is held up to the next state, and not ramped."""
        return self.until(end).acceleration == 0.0


def cam_states(scene: SceneConfig) -> Iterator[CamState]:
    """All states of a scene in order; the last one stands still and closes the last tick.

    Each speed is held for whole turns; θ goes on from one to the next without a jump.
    """
    time_ns, angle, program = 0, 0.0, scene.program
    for cam in scene.cams:
        before = 0.0
        for speed in program.speeds.si_list:
            for ticks in (_ramp(scene, before, speed), _hold(scene, speed)):
                for part in ticks:
                    yield CamState(time_ns + part.start_ns, angle + part.angle, part.speed, cam)
                if ticks:
                    last = ticks[-1]
                    time_ns, angle = time_ns + last.stop_ns, angle + last.angle_at(last.duration)
            before = speed
    yield CamState(time_ns, angle, 0.0, scene.cams[-1])


def _hold(scene: SceneConfig, speed: float) -> list[Interval]:
    """The ticks of one speed, from time and angle 0."""
    tick = 2.0 * math.pi / speed / scene.program.ticks_per_turn
    edges = [round(i * tick * NS) for i in range(ticks_a_step(scene) + 1)]
    return [Interval(a, b, speed * a / NS, speed) for a, b in pairwise(edges)]


def _ramp(scene: SceneConfig, before: float, speed: float) -> list[Interval]:
    """The ticks of the ramp to a speed, none longer than a tick at the faster end."""
    if scene.program.ramp is None or before == speed:
        return []
    length = round(scene.program.ramp.si * NS)
    whole = Interval(0, length, 0.0, before, (speed - before) * NS / length)
    return whole.split(2.0 * math.pi / scene.program.ticks_per_turn)


def ticks_a_step(scene: SceneConfig) -> int:
    """Ticks at each speed of each cam, its ramp not among them."""
    return int(scene.program.turns.si) * scene.program.ticks_per_turn


def tick_count(scene: SceneConfig) -> int:
    """Ticks of the whole scene."""
    speeds = scene.program.speeds.si_list
    ramps = sum(len(_ramp(scene, *step)) for step in pairwise([0.0, *speeds]))
    return len(scene.cams) * (len(speeds) * ticks_a_step(scene) + ramps)
