"""Steady-speed segments of a measured run, with their samples of lift and force."""

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

# Search for steady speeds: straight lines through the encoder's angle over time.
#: Largest distance of the measured cam angle from a straight line over time at which the speed
#: counts as steady, rad. One count of the encoder is added to this limit.
MAX_RIPPLE = 0.01
#: Smallest number of turns in a steady-speed segment.
MIN_TURNS = 1.0
#: Smallest number of angle readings in a steady-speed segment.
MIN_READINGS = 8
#: Initial cam angles, as fractions of an encoder count, over which the rounding errors of an
#: encoder are averaged.
STEP_PHASES = np.arange(8.0) / 8.0
#: Changes of the cam angle at the end of a steady-speed segment, as fractions of an encoder count.
#: The rounding errors of an encoder are averaged over these slightly different speeds.
SPEED_OFFSETS = np.array([-0.25, 0.0, 0.25])
#: Largest number of times that a sequence of angle readings is doubled in length in the search for
#: a steady-speed segment.
MAX_GROWTHS = 12


@dataclass(frozen=True)
class SteadySegment:
    """Time from ``begin`` to ``end`` (s) in which the cam turns at a steady speed.

    ``speed`` (rad/s) is that of a straight line through the encoder's angle. ``angle`` (rad) is the
    angle of this line at ``begin``. ``speed_error`` (rad/s) is the standard error of the speed,
    ``angle_error`` (rad) that of the angle in the middle. ``ripple`` (rad) is the largest distance
    of the angle from the line, less the steps of the encoder.
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
        """Cam speed of the steady-speed segment in rpm."""
        return to_rpm(self.speed)

    @property
    def turns(self) -> float:
        """Number of turns of the cam in a steady-speed segment, not always an integer."""
        return self.speed * (self.end - self.begin) / TURN

    @property
    def middle(self) -> float:
        """Time of the middle of a steady-speed segment, s."""
        return 0.5 * (self.begin + self.end)

    def without_transient(self) -> SteadySegment:
        """Return a steady-speed segment without its first `TRANSIENT_TURNS` turns.

        It is returned unchanged if it has at most twice as many turns.
        """
        if self.turns <= 2.0 * TRANSIENT_TURNS:
            return self
        later, angle = TRANSIENT_TURNS * TURN / self.speed, self.angle + TRANSIENT_TURNS * TURN
        error = math.hypot(self.angle_error, 0.5 * later * self.speed_error)
        return replace(self, begin=self.begin + later, angle=angle, angle_error=error)


def find_steady_segments(run: MeasuredRun) -> tuple[SteadySegment, ...]:
    """Return the segments of a run with a steady speed, each of at least one turn.

    They are in time order. Raises a `ConfigError` if the run has no such segment.
    """
    count = encoder_count(run.angle.value)
    time, angle = run.angle.time, run.angle.value
    seeds = np.searchsorted(angle, np.arange(angle[0], angle[-1], 0.5 * TURN)).tolist()
    stretches = {_grow(time, angle, *seed, count) for seed in pairwise([*seeds, time.size])}
    parts = _separate(time, angle, [stretch for stretch in stretches if stretch[1] > stretch[0]])
    lines = [_line(time[i:k], angle[i:k], count) for i, k in parts if k - i >= MIN_READINGS]
    segments = [segment for segment in lines if segment.turns >= MIN_TURNS]
    if not segments:
        raise ConfigError(
            f"{run.source}: the cam must turn at a steady speed for one turn or more, but "
            f"{run.angle.source} is never within {math.degrees(MAX_RIPPLE + count):.2g} deg of a "
            "straight line for a turn; record steady speeds"
        )
    return tuple(segments)


def _separate(
    time: FloatArray, angle: FloatArray, stretches: list[tuple[int, int]]
) -> list[tuple[int, int]]:
    """Return stretches of different speeds in time order, without overlaps.

    A stretch is a pair of a first and a last index of readings on a straight line. At a change of
    speed, the readings next to it are on both lines within one encoder count. Overlapping stretches
    are therefore cut in the middle of the overlap. A stretch is dropped if the longer stretches
    leave less than one turn of it.
    """
    longest = list[tuple[int, int]]()
    for first, last in sorted(stretches, key=lambda x: x[0] - x[1]):
        begin = max([first, *(k for i, k in longest if i <= first)])
        end = min([last, *(i for i, _ in longest if i > first)])
        if end > begin and angle[end - 1] - angle[begin] >= MIN_TURNS * TURN:
            longest.append((first, last))
    longest.sort()
    for i, (first_stretch, second_stretch) in enumerate(pairwise(longest)):
        if second_stretch[0] < first_stretch[1]:
            corner = (second_stretch[0] + first_stretch[1]) // 2
            longest[i], longest[i + 1] = (longest[i][0], corner), (corner, second_stretch[1])
    return longest


def _grow(
    time: FloatArray, angle: FloatArray, first: int, last: int, count: float
) -> tuple[int, int]:
    """Return the first and last index of the readings on one straight line.

    The readings ``first`` to ``last`` are the initial stretch. The line is fitted through its
    middle half. The stretch is doubled as long as its readings are on the line within 1.5 encoder
    counts. This limit is above 1 for a cam that turns by nearly a whole number of counts between
    readings: over a short stretch its speed seems wrong by one count. Finally the ends that bend
    into a ramp are cut off. The result is ``(0, 0)`` if the readings are not on a line. ``count``
    is that of the encoder, rad.
    """
    for growing in (*[True] * MAX_GROWTHS, False):
        size = last - first
        if size < MIN_READINGS:
            return 0, 0
        begin, stop = first + size // 4, last - size // 4
        slope, intercept = np.polyfit(time[begin:stop] - time[begin], angle[begin:stop], 1)
        reach = size if growing else 0
        low, high = max(0, first - reach), min(time.size, last + reach)
        distance = np.abs(angle[low:high] - intercept - slope * (time[low:high] - time[begin]))
        ripple = float(distance[begin - low : stop - low].max())
        if slope <= 0.0 or ripple > MAX_RIPPLE + count:
            return 0, 0
        outside = np.flatnonzero(
            distance > max(1.1 * ripple, (1.5 if growing else 0.6) * count, 1e-9)
        )
        before, after = outside[outside + low < begin], outside[outside + low >= stop]
        first = int(before[-1]) + low + 1 if before.size else low
        last = int(after[0]) + low if after.size else high
    return first, last


def _line(time: FloatArray, angle: FloatArray, count: float) -> SteadySegment:
    """Return the steady-speed segment of the straight line through angle readings.

    ``count`` is that of the encoder, rad. Correlated residuals count as fewer independent readings
    in the standard errors.
    """
    since = time - time[0]
    slope, begin = np.polyfit(since, angle, 1)
    away = angle - begin - slope * since
    rounding, correlation = count / math.sqrt(12.0), correlation_length(away) / time.size
    scatter = max(float(away.std()), rounding)
    of_mean, of_slope = _rounding_errors(since, slope, count)
    error = max(scatter * math.sqrt(correlation) / float(since.std()), of_slope)
    errors = error, math.hypot(math.sqrt((scatter**2 - rounding**2) * correlation), of_mean)
    ripple = max(0.0, float(np.abs(away).max()) - 0.6 * count)
    return SteadySegment(
        float(time[0]), float(time[-1]), float(begin), float(slope), *errors, ripple
    )


def _rounding_errors(since: FloatArray, speed: float, count: float) -> tuple[float, float]:
    """Return the r.m.s. errors of a line's mean (rad) and slope by encoder steps.

    ``since`` are the times of the readings in s, and the error of the slope is in rad/s. If a cam
    turns by nearly k/n counts between readings, the rounding errors form n slowly drifting
    sequences. They are then not random, so they are averaged over initial angles, and over speeds
    that end a quarter count higher and lower. The readings of an encoder are half a count low on
    average. This is not counted as an error.
    """
    if count == 0.0:
        return 0.0, 0.0
    from_mean = since - since.mean()
    projection = np.stack(
        [np.full(since.size, 1.0 / since.size), from_mean / (from_mean @ from_mean)]
    )
    speeds = speed + SPEED_OFFSETS * count / since[-1]
    angles = speeds[:, None, None] * since + STEP_PHASES[:, None] * count
    lag = (np.floor(angles / count) + 0.5) * count - angles
    of_mean, of_slope = np.sqrt(np.mean((lag @ projection.T) ** 2, axis=(0, 1))).tolist()
    return of_mean, of_slope


#: Number of turns at the start of a steady-speed segment that are left out as transient, if the
#: segment has more than twice as many.
TRANSIENT_TURNS = 1.0
#: Largest number of samples of the lift, and of the force, that are used in a fit. If there are
#: more, every k-th sample is used.
MAX_SAMPLES = 40_000
#: Smallest number of samples of lift and force together in a steady-speed segment.
MIN_SAMPLES = 20
#: Force above which the follower is certainly on the cam, relative to the largest force at the same
#: steady speed.
MIN_PRESS_FRACTION = 0.05
#: Fraction of the force samples of a steady-speed segment that may be below `MIN_PRESS_FRACTION`
#: because of noise, although the follower keeps contact.
UNPRESSED_SHARE = 0.01
#: Smallest magnitude of a negative force, relative to the largest force, that indicates a vibration
#: of the sensor. A cam cannot pull the follower.
MIN_PULL_FRACTION = 0.1
#: Smallest fraction of samples with a negative force of at least `MIN_PULL_FRACTION` at which the
#: sensor is taken to vibrate.
PULL_SHARE = 0.001
#: Largest scatter of the lift from turn to turn at which the motion is periodic, relative to the
#: range of the lift.
MAX_LIFT_SCATTER = 0.02


@dataclass(frozen=True, eq=False)
class SegmentSamples:
    """Samples of lift or force in a steady-speed segment.

    ``since`` are their times relative to the middle of the segment in s, ``value`` their values in
    m or N. Both have the shape ``(n,)``.
    """

    since: FloatArray
    value: FloatArray

    def where(self, selection: NDArray[np.bool_ | np.intp]) -> SegmentSamples:
        """Return the samples of a steady-speed segment with selected indices.

        ``selection`` is a boolean mask or an index array.
        """
        return SegmentSamples(self.since[selection], self.value[selection])


@dataclass(frozen=True, eq=False)
class MeasuredSegment:
    """Steady-speed segment of a run with its measured samples of lift and force.

    ``line`` contains its times and the straight line through the encoder's angle. ``lift`` and
    ``force`` are empty if they were not measured.
    """

    line: SteadySegment
    lift: SegmentSamples
    force: SegmentSamples

    @property
    def speed(self) -> float:
        """Cam speed of the steady-speed segment by the encoder, rad/s."""
        return self.line.speed

    @property
    def angle(self) -> float:
        """Encoder's angle in the middle of the steady-speed segment, rad."""
        return self.line.angle + self.speed * (self.line.middle - self.line.begin)

    @property
    def presses(self) -> bool:
        """True if the measured force shows no loss of contact at this steady speed.

        It is also True if no force was measured.
        """
        force = self.force.value
        return not force.size or bool(
            np.quantile(force, UNPRESSED_SHARE) > MIN_PRESS_FRACTION * force.max()
        )

    @property
    def rings(self) -> bool:
        """True if the force is negative at times, which indicates a vibrating sensor.

        A cam cannot pull the follower.
        """
        force = self.force.value
        return force.size > 0 and bool(
            np.quantile(force, PULL_SHARE) < -MIN_PULL_FRACTION * force.max()
        )

    @property
    def is_restless(self) -> bool:
        """True if the lift differs from turn to turn by more than the noise of a gauge.

        The follower then bounces without a periodic motion.
        """
        since, lift = self.lift.since, self.lift.value
        return lift.size > 0 and scatter(self.speed * since, lift) > MAX_LIFT_SCATTER * float(
            np.ptp(lift)
        )


def measured_segments(run: MeasuredRun) -> tuple[MeasuredRun, tuple[MeasuredSegment, ...]]:
    """Return the run with notes on unused speeds, and its usable steady segments.

    A steady-speed segment is unused if it has too few samples, or if its lift differs from turn to
    turn.

    Raises
    ------
    ConfigError
        If the run has neither lift nor force, or has signals that cannot be used, or has no steady
        speed.
    """
    if run.lift is None and run.force is None:
        raise ConfigError(
            f"{run.source}: the run must contain a lift or a contact force; map its topic with "
            "--topics"
        )
    for name, signal in (("lift", run.lift), ("force", run.force)):
        if signal is not None:
            _check_signal(run, name, signal)
    segments = [segment.without_transient() for segment in find_steady_segments(run)]
    parts = [_samples_within(signal, segments) for signal in (run.lift, run.force)]
    measured = [MeasuredSegment(*segment) for segment in zip(segments, *parts, strict=True)]
    count = max(segment.lift.since.size + segment.force.since.size for segment in measured)
    if count < MIN_SAMPLES:
        raise ConfigError(
            f"{run.source}: a steady speed must have at least {MIN_SAMPLES} samples of lift and "
            f"force, got {count}; sample faster, or keep a speed longer"
            f"{'' if count else ', and check that the stamps are from one clock'}"
        )
    enough = [
        segment
        for segment in measured
        if segment.lift.since.size + segment.force.since.size >= MIN_SAMPLES
    ]
    steady = tuple(segment for segment in enough if not segment.is_restless)
    if not steady:
        raise ConfigError(
            f"{run.source}: the lift must repeat from turn to turn within "
            f"{100.0 * MAX_LIFT_SCATTER:g} % at one speed or more, but the follower bounces at all "
            "of them; record a speed below the jump speed"
        )
    notes = list(run.notes)
    for reason, usable, remaining in (
        (f"fewer than {MIN_SAMPLES} samples", measured, enough),
        ("the lift differs from turn to turn", enough, steady),
    ):
        if excluded := [s.line.rpm for s in usable if s not in remaining]:
            speeds = ", ".join(f"{rpm:.4g}" for rpm in excluded)
            notes.append(f"left out: {speeds} rpm ({reason})")
    return replace(run, notes=tuple(notes)), steady


def _check_signal(run: MeasuredRun, name: str, signal: Signal) -> None:
    """Raise a `ConfigError` if a signal is too short, constant, or of the wrong sign.

    ``name`` is lift or force.
    """
    label = f"{run.source}: {name} ({signal.source or name})"
    if signal.value.size < MIN_SAMPLES:
        raise ConfigError(
            f"{label} must have at least {MIN_SAMPLES} samples, got {signal.value.size}"
        )
    low, high = float(signal.value.min()), float(signal.value.max())
    if high - low <= 1e-12 * max(abs(low), abs(high)):
        raise ConfigError(f"{label} is constant at {low:g}; check its cable, or leave it out")
    if name == "force" and pulls(signal.value):
        raise ConfigError(
            f"{label} must be positive where the follower presses, got {low:.4g} to {high:.4g} N; "
            "change its sign with force=-/TOPIC"
        )


def _samples_within(signal: Signal | None, segments: list[SteadySegment]) -> list[SegmentSamples]:
    """Return the samples of a signal in each steady-speed segment.

    If there are too many samples (`MAX_SAMPLES`), only every k-th sample is returned. The entries
    are empty if the signal is None.
    """
    if signal is None:
        return [SegmentSamples(np.empty(0), np.empty(0))] * len(segments)
    ends = [
        np.searchsorted(signal.time, [segment.begin, segment.end]).tolist() for segment in segments
    ]
    every = -(-sum(last - first for first, last in ends) // MAX_SAMPLES) or 1
    parts = [slice(first, last, every) for first, last in ends]
    return [
        SegmentSamples(signal.time[part] - segment.middle, signal.value[part])
        for part, segment in zip(parts, segments, strict=True)
    ]
