"""What the drive does: the scene's speeds, tick by tick, as states of the cam."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

from cam_rig.dynamics import ANGLE_TOLERANCE, Interval, wrap
from cam_rig.schema import SceneConfig
from cam_rig.units import NS, TURN


@dataclass(frozen=True)
class CamState:
    """The cam from a time until the next state, at one speed or along a ramp.

    The angle's whole turns are counted apart, so that it has the same digits however long the cam
    turns; one given without turns has its own taken off.
    """

    time_ns: int  #: rig time
    angle: float  #: rad
    speed: float  #: rad/s
    cam: str  #: name of the mounted cam
    turns: int = 0

    def __post_init__(self) -> None:
        if math.isfinite(self.angle):  # else a validator says so
            turns, angle = wrap(self.angle, self.turns)
            object.__setattr__(self, "turns", turns)
            object.__setattr__(self, "angle", angle)

    @property
    def unwrapped(self) -> float:
        """The cam angle with all its turns (rad), as people read it."""
        return self.turns * TURN + self.angle

    def since(self, other: CamState) -> float:
        """Angle turned (rad) since another state."""
        return (self.turns - other.turns) * TURN + (self.angle - other.angle)

    def until(self, end: CamState) -> Interval:
        """The interval up to the next state: a ramp if the angle turned is the mean speed's."""
        length = (end.time_ns - self.time_ns) / NS
        turned = end.since(self)
        ramp = abs(turned - 0.5 * (self.speed + end.speed) * length)
        held = abs(turned - self.speed * length)
        acceleration = (end.speed - self.speed) / length if ramp < held else 0.0
        times = self.time_ns, end.time_ns
        return Interval(*times, self.angle, self.speed, acceleration, self.turns)

    def turns_until(self, end: CamState) -> bool:
        """Whether the cam turns up to another state; else it stood, or another course began."""
        length = (end.time_ns - self.time_ns) / NS
        if self.speed > 0.0 or length <= 0.0:
            return length > 0.0
        turned = end.since(self)
        return turned > 0.0 and abs(turned - 0.5 * end.speed * length) < ANGLE_TOLERANCE

    def holds_until(self, end: CamState) -> bool:
        """Whether the speed is held up to the next state, and not ramped."""
        return self.until(end).acceleration == 0.0


def cam_states(scene: SceneConfig) -> Iterator[CamState]:
    """All states in order, θ without a jump; the last stands still and closes the last tick."""
    time_ns, turns, angle, program = 0, 0, 0.0, scene.program
    for cam in scene.cams:
        before = 0.0
        for speed in program.speeds.si_list:
            for ticks in (_ramp(scene, before, speed), _hold(scene, speed)):
                last = None
                for last in ticks:
                    at = time_ns + last.start_ns, angle + last.angle
                    yield CamState(*at, last.speed, cam, turns + last.turns)
                if last is not None:
                    time_ns += last.stop_ns
                    turned = angle + last.angle_at(last.duration)
                    turns, angle = wrap(turned, turns + last.turns)
            before = speed
    yield CamState(time_ns, angle, 0.0, scene.cams[-1], turns)


def run_length(scene: SceneConfig) -> tuple[int, int]:
    """Rig time (ns) of the whole scene, and of its longest tick."""
    program, lengths, longest = scene.program, 0, 0
    for before, speed in pairwise([0.0, *program.speeds.si_list]):
        ramp = _ramp(scene, before, speed)
        lengths += (ramp[-1].stop_ns if ramp else 0) + _edge(scene, speed, ticks_a_step(scene))
        ticks = [part.stop_ns - part.start_ns for part in ramp]
        longest = max(longest, *ticks, _edge(scene, speed, 1) + 1)  # by rounding, of some
    return len(scene.cams) * lengths, longest


def _hold(scene: SceneConfig, speed: float) -> Iterator[Interval]:
    """The ticks of one speed, from time and angle 0; there may be a hundred million."""
    edges = (_edge(scene, speed, i) for i in range(ticks_a_step(scene) + 1))
    return (_held(a, b, speed) for a, b in pairwise(edges))


def _edge(scene: SceneConfig, speed: float, ticks: int) -> int:
    """When (ns) so many ticks of a speed end: a turn at the same one however it is divided."""
    tick = Fraction(TURN) * NS / Fraction(speed) / scene.program.ticks_per_turn
    whole, parts = (2 * tick).as_integer_ratio()
    return (ticks * whole + parts) // (2 * parts)


def _held(start_ns: int, stop_ns: int, speed: float) -> Interval:
    """A tick of a speed that was held since time and angle 0: its angle to the last digit."""
    turned = Fraction(speed) * start_ns / NS
    whole = turned // Fraction(TURN)
    return Interval(start_ns, stop_ns, float(turned - whole * Fraction(TURN)), speed, 0.0, whole)


def _ramp(scene: SceneConfig, before: float, speed: float) -> list[Interval]:
    """The ticks of the ramp to a speed, none longer than a tick at the faster end."""
    if scene.program.ramp is None or before == speed:
        return []
    length = round(scene.program.ramp.si * NS)
    whole = Interval(0, length, 0.0, before, (speed - before) * NS / length)
    return whole.split(TURN / scene.program.ticks_per_turn)


def ticks_a_step(scene: SceneConfig) -> int:
    """Ticks at each speed of each cam, its ramp not among them."""
    return int(scene.program.turns.si) * scene.program.ticks_per_turn


def tick_count(scene: SceneConfig) -> int:
    """Ticks of the whole scene."""
    speeds = scene.program.speeds.si_list
    ramps = sum(len(_ramp(scene, *step)) for step in pairwise([0.0, *speeds]))
    return len(scene.cams) * (len(speeds) * ticks_a_step(scene) + ramps)
