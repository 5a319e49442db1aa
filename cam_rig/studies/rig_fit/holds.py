"""Where a measured cam turns at a steady speed: straight lines through an encoder's counts.

A line through many counts tells angle and speed far below one count; a difference of two does not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from cam_rig.arrays import FloatArray, correlation_length, rms
from cam_rig.errors import ConfigError
from cam_rig.simulation.encoder import encoder_count
from cam_rig.simulation.measured_run import MeasuredRun
from cam_rig.units import TURN, to_rpm

#: A speed is steady while the angle stays within this of a line, rad, and a count more.
STEADY = 0.01
#: Turns and readings of a hold, at least.
LEAST_TURNS, LEAST_READINGS = 1.0, 8
#: Parts of a count at which an encoder may stand, and by which the angle at the end may differ.
STEP_PHASES, QUARTERS = np.arange(8.0) / 8.0, np.array([-0.25, 0.0, 0.25])
#: Times that a hold is looked at anew, at most.
MOST_GROWTHS = 12


@dataclass(frozen=True)
class Hold:
    """The cam from ``begin`` to ``end`` (s) at ``speed`` (rad/s); ``angle`` (rad) at ``begin``.

    ``speed_error`` is the standard error of the speed, rad/s; ``ripple`` (rad) the largest distance
    of the angle from the line, less what an encoder's steps make.
    """

    begin: float
    end: float
    angle: float
    speed: float
    speed_error: float = 0.0
    ripple: float = 0.0

    @property
    def rpm(self) -> float:
        """Speed in rpm."""
        return to_rpm(self.speed)

    @property
    def turns(self) -> float:
        """How far the cam turns."""
        return self.speed * (self.end - self.begin) / TURN

    def angle_at(self, time: FloatArray) -> FloatArray:
        """Cam angle (rad) at times in s."""
        return np.asarray(self.angle + self.speed * (time - self.begin))

    def after(self, turns: float) -> Hold | None:
        """The same without its first turns; None where nothing is left."""
        begin = self.begin + turns * TURN / self.speed
        if begin >= self.end:
            return None
        angle = self.angle + turns * TURN
        return Hold(begin, self.end, angle, self.speed, self.speed_error, self.ripple)


def steady_holds(run: MeasuredRun) -> tuple[Hold, ...]:
    """The stretches of a run at a steady speed, of a turn each at least.

    Raises
    ------
    ConfigError : there is none
    """
    count = encoder_count(run.angle.value)
    time, angle = run.angle.time, run.angle.value
    seeds = np.searchsorted(angle, np.arange(angle[0], angle[-1], 0.5 * TURN)).tolist()
    stretches = {_grown(time, angle, *seed, count) for seed in pairwise([*seeds, time.size])}
    found = list[Hold]()
    for first, last in sorted(stretches, key=lambda x: x[0] - x[1]):
        if last - first < LEAST_READINGS:
            continue
        hold = _line(time[first:last], angle[first:last], count)
        apart = all(hold.begin >= x.end or hold.end <= x.begin for x in found)
        if apart and hold.turns >= LEAST_TURNS:
            found.append(hold)
    if not found:
        raise ConfigError(
            f"{run.source}: the cam nowhere turns steadily: over no turn of {run.angle.source} "
            f"does the angle stay within {math.degrees(STEADY + count):.2g} deg of a line; needed: "
            "some speeds that are held"
        )
    return tuple(sorted(found, key=lambda hold: hold.begin))


def _grown(
    time: FloatArray, angle: FloatArray, first: int, last: int, count: float
) -> tuple[int, int]:
    """First and last of the readings on the line through the middle of those of a seed.

    The stretch is doubled as long as it lies on its line, to 1.5 counts: a cam that turns nearly
    whole counts from reading to reading seems faster or slower by one over a short stretch. Then
    what bends away into a ramp is cut off. Empty where nothing lies on a line.
    """
    for growing in (*[True] * MOST_GROWTHS, False):
        size = last - first
        if size < LEAST_READINGS:
            return 0, 0
        begin, stop = first + size // 4, last - size // 4
        slope, at = np.polyfit(time[begin:stop] - time[begin], angle[begin:stop], 1)
        reach = size if growing else 0
        low, high = max(0, first - reach), min(time.size, last + reach)
        away = np.abs(angle[low:high] - at - slope * (time[low:high] - time[begin]))
        ripple = float(away[begin - low : stop - low].max())
        if slope <= 0.0 or ripple > STEADY + count:
            return 0, 0
        off = np.flatnonzero(away > max(1.1 * ripple, (1.5 if growing else 0.6) * count, 1e-9))
        before, after = off[off + low < begin], off[off + low >= stop]
        first = int(before[-1]) + low + 1 if before.size else low
        last = int(after[0]) + low if after.size else high
    return first, last


def _line(time: FloatArray, angle: FloatArray, count: float) -> Hold:
    """A line through readings; neighbours that err alike count as fewer in its error."""
    since = time - time[0]
    slope, begin = np.polyfit(since, angle, 1)
    away = angle - begin - slope * since
    scatter = max(float(away.std()), count / math.sqrt(12.0))
    alike = correlation_length(away)
    error = scatter * math.sqrt(alike) / (float(since.std()) * math.sqrt(time.size))
    error = max(error, _of_steps(since, slope, count))
    ripple = max(0.0, float(np.abs(away).max()) - 0.6 * count)
    return Hold(float(time[0]), float(time[-1]), float(begin), float(slope), error, ripple)


def _of_steps(since: FloatArray, speed: float, count: float) -> float:
    """By how much (rad/s, r.m.s.) an encoder's steps put a line's slope wrong.

    A cam that turns nearly k/n counts from reading to reading has steps that drift in n strands,
    and then their error is no noise: so of phases, and of speeds a quarter count beside.
    """
    if count == 0.0:
        return 0.0
    lever = (since - since.mean()) / float(((since - since.mean()) ** 2).sum())
    speeds = speed + QUARTERS * count / since[-1]
    turned = speeds[:, None, None] * since + STEP_PHASES[:, None] * count
    return rms((np.floor(turned / count) * count - turned) @ lever)
