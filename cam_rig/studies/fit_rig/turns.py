"""What is compared of a measured run: its samples in each hold, on the encoder's angle."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cam_rig.errors import ConfigError
from cam_rig.simulation.instruments import MeasuredRun, Signal, encoder_count, pulls
from cam_rig.simulation.scatter import scatter
from cam_rig.units import TURN, FloatArray, correlation_length, to_rpm

# Where a measured cam turns at a steady speed: straight lines through an encoder's counts.

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

    ``speed_error`` (rad/s) and ``angle_error`` (rad) are the standard errors of the speed and of
    the angle in the middle; ``ripple`` (rad) is the largest distance of the angle from the line,
    less what an encoder's steps make.
    """

    begin: float
    end: float
    angle: float
    speed: float
    speed_error: float
    angle_error: float
    ripple: float

    @property
    def rpm(self) -> float:
        """Speed in rpm."""
        return to_rpm(self.speed)

    @property
    def turns(self) -> float:
        """How far the cam turns."""
        return self.speed * (self.end - self.begin) / TURN

    @property
    def middle(self) -> float:
        """Time (s) in its middle."""
        return 0.5 * (self.begin + self.end)

    def settled(self) -> Hold:
        """The same without its first turns, if it has twice as many."""
        if self.turns <= 2.0 * SETTLE_TURNS:
            return self
        later, angle = SETTLE_TURNS * TURN / self.speed, self.angle + SETTLE_TURNS * TURN
        error = math.hypot(self.angle_error, 0.5 * later * self.speed_error)
        return replace(self, begin=self.begin + later, angle=angle, angle_error=error)


def steady_holds(run: MeasuredRun) -> tuple[Hold, ...]:
    """The stretches of a run at a steady speed, of a turn each at least."""
    count = encoder_count(run.angle.value)
    time, angle = run.angle.time, run.angle.value
    seeds = np.searchsorted(angle, np.arange(angle[0], angle[-1], 0.5 * TURN)).tolist()
    stretches = {_grown(time, angle, *seed, count) for seed in pairwise([*seeds, time.size])}
    parts = _apart(time, angle, [one for one in stretches if one[1] > one[0]])
    lines = [_line(time[i:k], angle[i:k], count) for i, k in parts if k - i >= LEAST_READINGS]
    found = [hold for hold in lines if hold.turns >= LEAST_TURNS]
    if not found:
        raise ConfigError(
            f"{run.source}: the cam nowhere turns steadily: over no turn of {run.angle.source} "
            f"does the angle stay within {math.degrees(STEADY + count):.2g} deg of a line; needed: "
            "some speeds that are held"
        )
    return tuple(found)


def _apart(
    time: FloatArray, angle: FloatArray, stretches: list[tuple[int, int]]
) -> list[tuple[int, int]]:
    """The stretches of different holds, in their order, cut where two overlap.

    Around a corner of the angle the readings lie on both lines, to an encoder's count. Of a stretch
    that longer ones leave less than a turn, the hold is theirs.
    """
    kept = list[tuple[int, int]]()
    for first, last in sorted(stretches, key=lambda x: x[0] - x[1]):
        begin = max([first, *(k for i, k in kept if i <= first)])
        end = min([last, *(i for i, _ in kept if i > first)])
        if end > begin and angle[end - 1] - angle[begin] >= LEAST_TURNS * TURN:
            kept.append((first, last))
    kept.sort()
    for i, (one, other) in enumerate(pairwise(kept)):
        if other[0] < one[1]:
            corner = (other[0] + one[1]) // 2
            kept[i], kept[i + 1] = (kept[i][0], corner), (corner, other[1])
    return kept


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
    rounding, alike = count / math.sqrt(12.0), correlation_length(away) / time.size
    scatter = max(float(away.std()), rounding)
    of_mean, of_slope = _of_steps(since, slope, count)
    error = max(scatter * math.sqrt(alike) / float(since.std()), of_slope)
    errors = error, math.hypot(math.sqrt((scatter**2 - rounding**2) * alike), of_mean)
    ripple = max(0.0, float(np.abs(away).max()) - 0.6 * count)
    return Hold(float(time[0]), float(time[-1]), float(begin), float(slope), *errors, ripple)


def _of_steps(since: FloatArray, speed: float, count: float) -> tuple[float, float]:
    """By how much (rad and rad/s, r.m.s.) an encoder's steps put a line's mean and slope wrong.

    A cam that turns nearly k/n counts from reading to reading has steps that drift in n strands,
    and then their error is no noise: so of phases, and of speeds a quarter count beside. Steps are
    half a count low in the mean, which is no error.
    """
    if count == 0.0:
        return 0.0, 0.0
    from_mean = since - since.mean()
    lever = np.stack([np.full(since.size, 1.0 / since.size), from_mean / (from_mean @ from_mean)])
    speeds = speed + QUARTERS * count / since[-1]
    turned = speeds[:, None, None] * since + STEP_PHASES[:, None] * count
    low = (np.floor(turned / count) + 0.5) * count - turned
    of_mean, of_slope = np.sqrt(np.mean((low @ lever.T) ** 2, axis=(0, 1))).tolist()
    return of_mean, of_slope


#: Turns of a hold that are left out, for the follower to settle, where it has twice as many.
SETTLE_TURNS = 1.0
#: HoldSamples of a quantity that are fitted, at most; of more every k-th is taken.
MOST_SAMPLES = 40_000
#: HoldSamples of a hold, at least.
LEAST_SAMPLES = 20
#: A follower that presses with more than this part of its largest force is on the cam; of a hold it
#: may press with less in this part of the samples, as noise has it.
PRESSED, SELDOM = 0.05, 0.01
#: No cam pulls: a force that is below minus this part of its largest in this part of the samples is
#: its sensor's.
PULLED, RARELY = 0.1, 0.001
#: A lift that differs by more than this part of itself from turn to turn is of no steady motion.
RESTLESS = 0.02


@dataclass(frozen=True, eq=False)
class HoldSamples:
    """One quantity in one hold: times since the hold's middle (s) and values (SI), ``(n,)``."""

    since: FloatArray
    value: FloatArray

    def where(self, kept: NDArray[np.bool_ | np.intp]) -> HoldSamples:
        """Some of them."""
        return HoldSamples(self.since[kept], self.value[kept])


@dataclass(frozen=True, eq=False)
class MeasuredHold:
    """A hold with what was measured in it."""

    hold: Hold
    lift: HoldSamples
    force: HoldSamples

    @property
    def speed(self) -> float:
        """rad/s, by the encoder."""
        return self.hold.speed

    @property
    def angle(self) -> float:
        """The encoder's (rad) in the hold's middle."""
        return self.hold.angle + self.speed * (self.hold.middle - self.hold.begin)

    @property
    def presses(self) -> bool:
        """Whether no sample of the force shows a loss of contact; so too where there is none."""
        force = self.force.value
        return not force.size or bool(np.quantile(force, SELDOM) > PRESSED * force.max())

    @property
    def rings(self) -> bool:
        """Whether the force pulls now and then, as that of a sensor that vibrates."""
        force = self.force.value
        return force.size > 0 and bool(np.quantile(force, RARELY) < -PULLED * force.max())

    @property
    def is_restless(self) -> bool:
        """Whether the follower moves differently in each turn, by more than a gauge's noise."""
        since, lift = self.lift.since, self.lift.value
        return lift.size > 0 and scatter(self.speed * since, lift) > RESTLESS * float(np.ptp(lift))


def measured_holds(run: MeasuredRun) -> tuple[MeasuredRun, tuple[MeasuredHold, ...]]:
    """The run, with a note of each speed that is left out, and its holds that tell something."""
    if run.lift is None and run.force is None:
        raise ConfigError(
            f"{run.source}: has neither lift nor contact force; needed: one of them, so map its "
            "topic"
        )
    for name, signal in (("lift", run.lift), ("force", run.force)):
        if signal is not None:
            _require_alive(run, name, signal)
    holds = [hold.settled() for hold in steady_holds(run)]
    parts = [_within(signal, holds) for signal in (run.lift, run.force)]
    found = [MeasuredHold(*one) for one in zip(holds, *parts, strict=True)]
    most = max(one.lift.since.size + one.force.since.size for one in found)
    if most < LEAST_SAMPLES:
        raise ConfigError(
            f"{run.source}: {most or 'no'} samples of lift and force while the cam turns steadily "
            f"at one speed; needed: {LEAST_SAMPLES}, so sample faster, or hold a speed longer"
            f"{'' if most else ' (are their stamps of one clock?)'}"
        )
    enough = [one for one in found if one.lift.since.size + one.force.since.size >= LEAST_SAMPLES]
    steady = tuple(hold for hold in enough if not hold.is_restless)
    if not steady:
        raise ConfigError(
            f"{run.source}: at no speed does the lift come back from turn to turn within "
            f"{100.0 * RESTLESS:g} % of itself, as the follower bounces; needed: a speed at which "
            "it does, so one below the jump speed"
        )
    few = _left_out(f"fewer than {LEAST_SAMPLES} samples", [h for h in found if h not in enough])
    restless = [hold for hold in enough if hold not in steady]
    notes = *few, *_left_out("the lift differs from turn to turn", restless)
    return replace(run, notes=(*run.notes, *notes)), steady


def _left_out(why: str, holds: list[MeasuredHold]) -> list[str]:
    speeds = ", ".join(f"{one.hold.rpm:.4g}" for one in holds)
    return [f"left out: {speeds} rpm ({why})"] if holds else []


def _require_alive(run: MeasuredRun, name: str, signal: Signal) -> None:
    where = f"{run.source}: {name} ({signal.source or name})"
    if signal.value.size < LEAST_SAMPLES:
        raise ConfigError(
            f"{where} has {signal.value.size} samples; needed: {LEAST_SAMPLES} or more"
        )
    low, high = float(signal.value.min()), float(signal.value.max())
    if high - low <= 1e-12 * max(abs(low), abs(high)):
        raise ConfigError(
            f"{where} is {low:g} all the time; needed: one that changes, so look at its cable, or "
            "leave it out"
        )
    if name == "force" and pulls(signal.value):
        raise ConfigError(
            f"{where} is from {low:.4g} to {high:.4g} N; allowed: a contact force that presses, so "
            "turn its sign: force=-/TOPIC"
        )


def _within(signal: Signal | None, holds: list[Hold]) -> list[HoldSamples]:
    """The samples of one quantity in each hold, thinned alike where there are too many."""
    if signal is None:
        return [HoldSamples(np.empty(0), np.empty(0))] * len(holds)
    ends = [np.searchsorted(signal.time, [hold.begin, hold.end]).tolist() for hold in holds]
    every = -(-sum(last - first for first, last in ends) // MOST_SAMPLES) or 1
    parts = [slice(first, last, every) for first, last in ends]
    return [
        HoldSamples(signal.time[part] - hold.middle, signal.value[part])
        for part, hold in zip(parts, holds, strict=True)
    ]
