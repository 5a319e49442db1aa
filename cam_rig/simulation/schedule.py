"""Schedule of the drive: the speeds of a scene as cam states, one per tick.

A cam state is the angle and the speed of the cam at one time. A tick is the interval between two
successive cam states, for which samples are computed together. A step is the time that one cam
turns at one speed. Ramps to its speed are not part of it.
"""

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
    """Cam angle and cam speed at one time.

    The drive publishes one state per tick. The cam turns to the next state at constant speed or on
    a ramp. The whole turns of the angle are counted separately, so its accuracy does not depend on
    their number. Whole turns in a given angle are moved to `turns`.
    """

    time_ns: int  #: rig time, ns
    angle: float  #: cam angle in [0, 2π), rad
    speed: float  #: cam speed, rad/s
    cam: str  #: name of the mounted cam
    turns: int = 0  #: whole turns before the angle

    def __post_init__(self) -> None:
        if math.isfinite(self.angle):  # otherwise a validator reports it
            turns, angle = wrap(self.angle, self.turns)
            object.__setattr__(self, "turns", turns)
            object.__setattr__(self, "angle", angle)

    @property
    def unwrapped(self) -> float:
        """Cam angle with all its turns, rad."""
        return self.turns * TURN + self.angle

    def since(self, other: CamState) -> float:
        """Return the angle (rad) that the cam turns from another state to this state."""
        return (self.turns - other.turns) * TURN + (self.angle - other.angle)

    def until(self, end: CamState) -> Interval:
        """Return the interval from this state to the next state.

        The interval is a speed ramp if the angle turned between the states fits the mean of both
        speeds better than the first speed.
        """
        length = (end.time_ns - self.time_ns) / NS
        turned = end.since(self)
        ramp_error = abs(turned - 0.5 * (self.speed + end.speed) * length)
        steady_error = abs(turned - self.speed * length)
        acceleration = (end.speed - self.speed) / length if ramp_error < steady_error else 0.0
        times = self.time_ns, end.time_ns
        return Interval(*times, self.angle, self.speed, acceleration, self.turns)

    def turns_until(self, end: CamState) -> bool:
        """Return True if the cam turns from this state to another state.

        Otherwise the cam is stopped, or the other state does not belong to the same run.
        """
        length = (end.time_ns - self.time_ns) / NS
        if self.speed > 0.0 or length <= 0.0:
            return length > 0.0
        turned = end.since(self)
        return turned > 0.0 and abs(turned - 0.5 * end.speed * length) < ANGLE_TOLERANCE

    def is_steady_until(self, end: CamState) -> bool:
        """Return True if the cam speed is constant up to the next state, not on a ramp."""
        return self.until(end).acceleration == 0.0


def cam_states(scene: SceneConfig) -> Iterator[CamState]:
    """Yield all cam states of a scene in order, with a continuous angle.

    In the last state the cam is stopped. It is the end of the last tick. A tick is the time between
    two cam states.
    """
    time_ns, turns, angle, schedule = 0, 0, 0.0, scene.schedule
    for cam in scene.cams:
        previous_speed = 0.0
        for speed in schedule.speeds.si_list:
            for ticks in (_ramp_ticks(scene, previous_speed, speed), _steady_ticks(scene, speed)):
                tick = None
                for tick in ticks:
                    start = time_ns + tick.start_ns, angle + tick.angle
                    yield CamState(*start, tick.speed, cam, turns + tick.turns)
                if tick is not None:
                    time_ns += tick.stop_ns
                    end_angle = angle + tick.angle_at(tick.duration)
                    turns, angle = wrap(end_angle, turns + tick.turns)
            previous_speed = speed
    yield CamState(time_ns, angle, 0.0, scene.cams[-1], turns)


def run_length(scene: SceneConfig) -> tuple[int, int]:
    """Return the rig time (ns) of the whole scene, and that of its longest tick.

    A tick is the time between two cam states.
    """
    schedule, duration, longest = scene.schedule, 0, 0
    for previous_speed, speed in pairwise([0.0, *schedule.speeds.si_list]):
        ramp = _ramp_ticks(scene, previous_speed, speed)
        duration += ramp[-1].stop_ns if ramp else 0
        duration += _ticks_end_ns(scene, speed, ticks_per_step(scene))
        ticks = [tick.stop_ns - tick.start_ns for tick in ramp]
        longest = max(longest, *ticks, _ticks_end_ns(scene, speed, 1) + 1)  # + 1 ns: rounding
    return len(scene.cams) * duration, longest


def _steady_ticks(scene: SceneConfig, speed: float) -> Iterator[Interval]:
    """Yield the ticks of one speed (rad/s), starting from time 0 and angle 0.

    A tick is the time between two cam states. The ticks are not stored, because there may be 1e8 of
    them.
    """
    start = 0
    for i in range(1, ticks_per_step(scene) + 1):
        end, turned = _ticks_end_ns(scene, speed, i), Fraction(speed) * start / NS  # exact angle
        whole = turned // Fraction(TURN)
        yield Interval(start, end, float(turned - whole * Fraction(TURN)), speed, 0.0, whole)
        start = end


def _ticks_end_ns(scene: SceneConfig, speed: float, ticks: int) -> int:
    """Return the time (ns) from the start of a speed to the end of `ticks` ticks.

    It is rounded from an exact fraction, so that the time of a whole turn does not depend on the
    number of ticks per turn. `speed` is in rad/s. A tick is the time between two cam states.
    """
    tick = Fraction(TURN) * NS / Fraction(speed) / scene.schedule.ticks_per_turn
    numerator, denominator = (2 * tick).as_integer_ratio()
    return (ticks * numerator + denominator) // (2 * denominator)


def _ramp_ticks(scene: SceneConfig, previous_speed: float, speed: float) -> list[Interval]:
    """Return the ticks (times between two cam states) of a ramp between two speeds.

    The speeds are in rad/s. No tick is longer than a tick at the higher speed. The list is empty
    without a ramp.
    """
    if scene.schedule.ramp is None or previous_speed == speed:
        return []
    length = round(scene.schedule.ramp.si * NS)
    acceleration = (speed - previous_speed) * NS / length
    ramp = Interval(0, length, 0.0, previous_speed, acceleration)
    return ramp.split(TURN / scene.schedule.ticks_per_turn)


def ticks_per_step(scene: SceneConfig) -> int:
    """Return the number of ticks at each speed of each cam, without those of the ramp.

    A tick is the time between two cam states.
    """
    return int(scene.schedule.turns.si) * scene.schedule.ticks_per_turn


def tick_count(scene: SceneConfig) -> int:
    """Return the number of ticks (times between two cam states) of the whole scene.

    Ticks of speed ramps are included.
    """
    speeds = scene.schedule.speeds.si_list
    ramps = sum(len(_ramp_ticks(scene, *step)) for step in pairwise([0.0, *speeds]))
    return len(scene.cams) * (len(speeds) * ticks_per_step(scene) + ramps)
