"""Conversion of encoder readings to a cam angle that increases over all turns.

Wrong angles are removed, whole turns are counted, and a decreasing angle is negated. A step is the
difference of two successive readings. The usual step is the median of the steps around it. The
period is the angle after which the readings wrap.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cam_rig.errors import BagError
from cam_rig.simulation.instruments import EQUAL_ANGLE_ATOL_RAD, Signal
from cam_rig.units import TURN, FloatArray

#: Largest range, in turns, of the readings of an encoder that wraps every turn. The excess over 1
#: allows for rounding.
TURN_RANGE_FACTOR = 1.0 + 1e-6
#: Largest fraction of readings that may be wrong and outside the encoder's range, at each end of
#: the range. This fraction of extreme readings is ignored when the range is determined.
MAX_OUTSIDE = 0.02
#: Quantile of the differences between successive readings (absolute values) that is taken as the
#: step at the full speed of a run.
USUAL_STEP_QUANTILE = 0.9
#: A counter wraps at the end of its integer type only if its readings fill the range of the type,
#: apart from this number of usual steps between readings.
MAX_USUAL_STEPS = 3.0
#: Smallest range of the readings, as a fraction of the period, for which wrapping is detected
#: without a step of more than half a period.
MIN_RANGE = 0.75
#: Largest usual step between two readings at which whole turns can be counted, as a fraction of the
#: period. With three readings per turn or fewer, the cam may have turned in either direction.
MAX_STEP = 0.33
#: Quantile of the steps between readings (absolute values) that is compared with `MAX_STEP`. It
#: represents the faster speeds of a run.
FAST_STEP_QUANTILE = 0.75
#: Number of successive steps whose median is the usual step. A step is compared with the usual
#: steps before and after it. The number must be odd.
WINDOW_STEPS = 15
#: Deviation (rad) from the usual step up to which an angle is never reported as wrong: 7.2°.
MIN_WRONG = TURN / 50.0
#: Deviation from the usual step due to scatter that is tolerated before an angle is reported as
#: wrong, in standard deviations of the steps.
MAX_SCATTER = 8.0
#: Quantile of the nonzero steps of the angle (absolute values) that estimates the encoder's
#: resolution. With a coarse encoder it is one count, otherwise one of the smallest steps.
COUNT_QUANTILE = 0.05
#: Deviation from the usual step due to rounding that is tolerated before an angle is reported as
#: wrong, in counts of the encoder (see `COUNT_QUANTILE`). It is 2, because both readings of a step
#: are rounded.
MAX_COUNTS = 2.0
#: Standard deviation of a normal distribution divided by its median absolute deviation.
MAD_SIGMA = 1.4826
#: Smallest duration of a gap in the readings, as a multiple of the median time between two
#: readings. In a gap the cam may have turned by any angle.
GAP_FACTOR = 4.0
#: Largest number of successive readings that are treated as wrong angles. If more readings deviate,
#: the angle of the encoder has jumped instead.
MAX_RUN = 100
#: Largest fraction of wrong angles in a recording. A larger fraction is an error.
MAX_WRONG = 0.1
#: Relative tolerance of the angle that is predicted across removed readings.
PREDICTION_RTOL = 0.05
#: Largest deviation of a jump of the angle from whole turns at which it is treated as whole turns,
#: as a fraction of the usual step between readings. `WHOLE_TURNS_SCATTER` is added.
WHOLE_TURNS_RTOL = 0.25
#: Deviation of a jump of the angle from whole turns that scatter of the steps may cause, in
#: standard deviations. It is added to `WHOLE_TURNS_RTOL`.
WHOLE_TURNS_SCATTER = 4.0
#: Largest tolerance of a step between two readings, as a fraction of the period after which the
#: angle wraps.
MAX_TOLERANCE = 0.3
#: Jump of the readings per turn (in their unit) if an angle in degrees is read as radians.
DEGREES_PER_TURN = 360.0
#: Tolerance of a jump of `DEGREES_PER_TURN`, in the unit of the readings. The scatter of the steps
#: is added.
DEGREES_ATOL = 0.5
#: Number of steps that are processed together. The limit bounds the memory for a long recording.
BLOCK_STEPS = 100_000
#: Largest number of times (s) of wrong angles that a note lists.
MAX_TIMES = 6


@dataclass(frozen=True)
class Counter:
    """Integer counter of an angle.

    `count` is the angle per count in rad, and `values` the number of values of the integer type.
    """

    count: float
    values: int

    @property
    def span(self) -> float:
        """Angle (rad) after which the counter restarts at its first value."""
        return self.count * self.values


@dataclass(frozen=True, eq=False)
class CountedAngle:
    """Cam angle that rises over all its turns, without wrong readings.

    `wrong` contains the indices of the wrong angles in the original signal. `notes` contains one
    sentence per change.
    """

    signal: Signal
    wrong: NDArray[np.intp]
    notes: tuple[str, ...]


def count_turns(angle: Signal, where: str, counter: Counter | None = None) -> CountedAngle:
    """Return the cam angle from the readings of an encoder, increasing over all turns.

    `where` names the angle in an error message. `counter` is the integer type of the readings, None
    for other numbers. Raises BagError if the turns cannot be counted, or if the cam does not turn
    in one direction.
    """
    steps = _Steps(angle, _period(angle.value, counter))
    fast_step = float(np.quantile(np.abs(steps.step), FAST_STEP_QUANTILE))
    if fast_step > MAX_STEP * steps.period:
        raise BagError(
            f"{where}: {steps.period / fast_step:.2g} readings per turn of the encoder; more than "
            "3 are needed to count turns, so record more, or an angle that continues after a turn"
        )
    wrong, jumps = steps.find_wrong()
    notes = _wrong_notes(angle, wrong, where)
    steps.require_radians(jumps, where)
    value = angle.value + steps.corrections(jumps, counter, notes)
    is_kept = np.ones(value.size, dtype=np.bool_)
    is_kept[wrong] = False
    time, value = angle.time[is_kept], value[is_kept]
    if np.isfinite(steps.period):
        wraps = np.abs(np.diff(value)) > 0.5 * steps.period
        value = np.unwrap(value, period=steps.period)
        if wraps.any():
            first = float(time[int(np.argmax(wraps)) + 1])
            notes.append(_period_note(steps.period, first, counter))
        if len(angle.gaps()):
            notes.append("Whole turns within a gap of the angle are not known.")
    if value[-1] < value[0]:
        value = -value
        notes.append("The angle decreases: its sign was reversed.")
    turned = value[-1] - value[0]
    if turned < 0.5 * float(np.abs(np.diff(value)).sum()) or turned <= 0.0:
        back = time[int(np.argmin(np.diff(value) >= 0.0))]
        raise BagError(
            f"{where}: the angle must change in one direction, got {np.degrees(value[0]):.6g}° to "
            f"{np.degrees(value[-1]):.6g}° with the first reversal at {back:.6g} s"
        )
    return CountedAngle(Signal(time, value, angle.source), wrong, tuple(notes))


def _period(value: FloatArray, counter: Counter | None) -> float:
    """Return the angle (rad) after which the readings wrap, infinity if they do not.

    The period is one turn or the range of the counter's integer type. The readings wrap if a step
    is longer than half the period, or if the usual steps add up to more than twice the range of the
    readings. The second case occurs with a driver that averages readings: a wrap is then two steps,
    each of nearly half a period. A counter wraps at the end of its type only if its readings fill
    the range of the type.
    """
    outside = int(MAX_OUTSIDE * value.size)
    ordered = np.sort(value)
    width = float((ordered[value.size - 1 - outside :] - ordered[: outside + 1]).min())
    steps = np.diff(value)
    largest, turned = float(np.abs(steps).max()), abs(float(np.median(steps))) * steps.size

    def wraps(period: float) -> bool:
        return 2.0 * largest > period or (width > MIN_RANGE * period and turned > 2.0 * width)

    if counter is not None:
        usual = np.quantile(np.abs(_remainder(steps, counter.span)), USUAL_STEP_QUANTILE)
        filled = (1.0 - 2.0 * MAX_OUTSIDE) * counter.span - MAX_USUAL_STEPS * usual
        if 2.0 * width > counter.span and width > filled and wraps(counter.span):
            return counter.span
    return TURN if width <= TURN * TURN_RANGE_FACTOR and wraps(TURN) else np.inf


def _remainder(change: FloatArray, period: float) -> FloatArray:
    """Return changes of an angle minus whole periods, within half a period of 0."""
    return np.asarray(np.remainder(change + 0.5 * period, period) - 0.5 * period)


def _period_note(period: float, first: float, counter: Counter | None) -> str:
    if period == TURN:
        return "The angle is given within one turn: its turns were counted."
    values = 0 if counter is None else counter.values
    return (
        f"The angle wraps after {values} counts, {period / TURN:.6g} turns, first at {first:.6g} "
        "s: its turns were counted."
    )


def _wrong_notes(angle: Signal, wrong: NDArray[np.intp], where: str) -> list[str]:
    if not wrong.size:
        return []
    times = [f"{time:.6g}" for time in angle.time[wrong[:MAX_TIMES]]]
    more = f" s and {wrong.size - MAX_TIMES} more" if wrong.size > MAX_TIMES else " s"
    text = f"{wrong.size} wrong angles, at {', '.join(times)}{more}"
    if wrong.size > max(1.0, MAX_WRONG * angle.time.size):
        raise BagError(
            f"{where}: at most {100 * MAX_WRONG:g} % of the readings may differ from those next to "
            f"them, got {text}, of {angle.time.size}; record the angle of a single encoder"
        )
    return [f"angle: {text}, were dropped: they differ from the readings next to them."]


class _Steps:
    """Steps between successive angle readings, compared with the steps around them.

    A step is reduced by whole periods. Readings whose steps deviate from the usual step are wrong,
    or follow a jump of the encoder's angle.
    """

    def __init__(self, angle: Signal, period: float) -> None:
        from scipy.ndimage import median_filter

        self.time, self.value, self.period = angle.time, angle.value, period
        self.step = self._wrapped(np.diff(self.value))
        interval = np.diff(self.time)
        size = min(WINDOW_STEPS, self.step.size - 1 + self.step.size % 2)
        step, rate = (
            median_filter(values, size, mode="nearest")
            for values in (self.step, self.step / interval)
        )
        spread = median_filter(np.abs(self.step - step), size, mode="nearest")
        # Each window of steps is moved inside the recording. Beyond its ends the median filter
        # would repeat the first or the last step.
        half, index = size // 2, np.arange(step.size)
        self._before, middle, self._after = (
            np.clip(index + shift, half, step.size - 1 - half) for shift in (-half - 1, 0, half + 1)
        )
        spread = spread[middle]
        self._usual, self._rate = step, rate
        moves = np.abs(self.step)[np.abs(self.step) > EQUAL_ANGLE_ATOL_RAD]
        count = float(np.quantile(moves, COUNT_QUANTILE)) if moves.size else 0.0
        min_tolerance = MIN_WRONG + MAX_COUNTS * count
        self._scatter = MAD_SIGMA * spread
        self._tolerance = min_tolerance + np.abs(step[middle]) + MAX_SCATTER * self._scatter
        self.gap = interval > GAP_FACTOR * np.median(interval)

    def _wrapped(self, change: FloatArray) -> FloatArray:
        if not np.isfinite(self.period):
            return change
        return _remainder(change, self.period)

    def _expected(self, first: NDArray[np.intp], last: NDArray[np.intp]) -> FloatArray:
        """Return the smallest and the largest expected change of the angle (rad), (2, n).

        The change is that from the readings `first` to the later readings `last`. It is
        extrapolated from the usual steps before and after these readings, in proportion to time and
        to the number of readings.
        """
        before, after = self._before[first], self._after[np.minimum(last, self.step.size) - 1]
        count, seconds = last - first, self.time[last] - self.time[first]
        by_count = [self._usual[window] * count for window in (before, after)]
        by_time = [self._rate[window] * seconds for window in (before, after)]
        changes = np.stack([*by_count, *by_time])
        return np.stack([changes.min(axis=0), changes.max(axis=0)])

    def fits(self, first: NDArray[np.intp], last: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Return True for each pair of readings that is consistent with the usual steps.

        `first` and `last` are indices of readings, (n,). The change of the angle between them must
        equal the expected change within a tolerance.
        """
        low, high = self._expected(first, last)
        middle = 0.5 * (low + high)
        deviation = np.abs(self._wrapped(self.value[last] - self.value[first] - middle))
        tolerance = np.maximum(
            self._tolerance[np.minimum(first, self.step.size - 1)],
            self._tolerance[last - 1],
        )
        tolerance = tolerance + PREDICTION_RTOL * np.abs(middle) * (last - first > 1)
        return np.asarray(
            deviation - 0.5 * (high - low) <= np.minimum(tolerance, MAX_TOLERANCE * self.period)
        )

    def find_wrong(self) -> tuple[NDArray[np.intp], list[int]]:
        """Return the indices of the wrong angles, and of the readings before a jump.

        After a jump the readings stay at the new angle.
        """
        blocks = np.array_split(np.arange(self.step.size), 1 + self.step.size // BLOCK_STEPS)
        fits = np.concatenate([self.fits(first, first + 1) for first in blocks])
        forward = np.sign(np.median(self.step)) * self.step
        fits |= self.gap & (np.isfinite(self.period) | (forward >= 0.0))
        breaks = np.flatnonzero(~fits)
        if not breaks.size:
            return np.array([], dtype=np.intp), []
        starts = np.concatenate([[0], breaks + 1])
        stops = np.concatenate([breaks, [self.value.size - 1]])
        sizes = stops - starts + 1
        anchor = int(np.argmax(sizes >= min(WINDOW_STEPS, int(sizes.max()))))
        wrong, jumps = self._walk(starts[anchor:], stops[anchor:])
        # The search starts at the first run that is long enough to be reliable. The readings before
        # it are checked in reverse order.
        earlier_wrong, earlier_jumps = self._walk(stops[anchor::-1], starts[anchor::-1])
        return np.array(sorted({*wrong, *earlier_wrong}), dtype=np.intp), sorted(
            {*jumps, *earlier_jumps}
        )

    def _walk(
        self, starts: NDArray[np.intp], stops: NDArray[np.intp]
    ) -> tuple[list[int], list[int]]:
        """Return the wrong readings, and the readings before jumps, from runs of readings.

        A run is a series of consistent angle readings, with indices from `starts` to `stops`. The
        first run is correct. If one of the next runs is consistent with the last correct run, it is
        correct and the readings between them are wrong. Otherwise the next run follows a jump of
        the encoder and is correct, except a short run at the end, which is wrong. The results are
        indices of readings.
        """
        wrong, jumps, k = list[int](), list[int](), 0
        while k < starts.size - 1:
            end = stops[k]
            later = starts[k + 2 : k + 3 + MAX_RUN]  # each run has at least one reading
            later = later[np.abs(later - end) <= MAX_RUN + 1]
            pairs = np.sort(np.stack([np.full_like(later, end), later]), axis=0)
            fitting = np.flatnonzero(self.fits(*pairs)) if later.size else np.array([])
            if fitting.size:
                k += 2 + int(fitting[0])
                between = sorted((int(end), int(starts[k])))
                wrong += range(between[0] + 1, between[1])
                continue
            first = int(min(end, starts[k + 1]))
            is_last = k + 2 == starts.size and abs(int(stops[-1] - starts[-1])) < WINDOW_STEPS // 2
            if is_last and not self.gap[first] and not self._is_whole(first):
                low, high = sorted((int(starts[-1]), int(stops[-1])))
                wrong += range(low, high + 1)
                break
            jumps.append(first)
            k += 1
        return wrong, jumps

    def _excess(self, index: int) -> float:
        """Return the difference (rad) between a step of the angle and the expected step.

        `index` is that of the reading before the step.
        """
        first = np.array([index])
        return float(self.step[index] - self._expected(first, first + 1).mean())

    def _is_whole(self, index: int) -> bool:
        """Return True if a step differs from the expected step by whole turns.

        The step is that between two angle readings.
        """
        excess = self._excess(index)
        tolerance = WHOLE_TURNS_RTOL * abs(self._usual[index])
        tolerance += WHOLE_TURNS_SCATTER * self._scatter[index]
        return bool(abs(excess - TURN * round(excess / TURN)) <= tolerance)

    def require_radians(self, jumps: list[int], where: str) -> None:
        """Raise BagError if the angle jumps by 360 rad.

        Such an angle is in degrees and wraps each turn. `jumps` are the readings before each jump,
        and `where` names the angle in the message.
        """
        for index in jumps:
            tolerance = DEGREES_ATOL + self._scatter[index]
            if abs(abs(self._excess(index)) - DEGREES_PER_TURN) <= tolerance:
                raise BagError(
                    f"{where}: the angle jumps by 360 rad at {self.time[index + 1]:.6g} s; "
                    "add :deg for an angle in degrees"
                )

    def corrections(
        self, jumps: list[int], counter: Counter | None, notes: list[str]
    ) -> FloatArray:
        """Return the angles (rad) to add to the readings to remove jumps back, ``(n,)``.

        A jump back by nearly whole turns is corrected by whole turns. Another jump back is
        corrected by its size: it is a counter that wraps at another number, or that was set to
        zero. A jump forwards is kept, because the cam may have turned while the readings stayed the
        same. A jump of an angle that wraps is kept too, because its size is unknown. A sentence on
        the jumps is added to `notes`.
        """
        added = np.zeros(self.value.size)
        excess = np.array([self._excess(index) for index in jumps])
        is_back = (np.sign(np.median(self.step)) * excess < 0.0) & ~np.isfinite(self.period)
        for index in np.array(jumps, dtype=np.intp)[~is_back][:MAX_TIMES]:
            notes.append(
                f"angle: a jump by {np.degrees(self.step[index]):.3g}° at "
                f"{self.time[index + 1]:.6g} s is kept: the readings next to it do not explain it."
            )
        if not is_back.any():
            return added
        back, excess = np.array(jumps, dtype=np.intp)[is_back], excess[is_back]
        gap, is_whole = self.gap[back], np.array([self._is_whole(index) for index in back])
        change = np.where(is_whole, TURN * np.rint(excess / TURN), excess)
        forward = np.sign(np.median(self.step))
        # A jump back in a gap is corrected by the smallest number of turns that makes the step
        # positive.
        turns = np.floor(forward * self.step[back] / TURN)
        change[gap], is_whole = forward * TURN * turns[gap], is_whole | gap
        if counter is not None:
            change[~is_whole] = counter.count * np.rint(excess[~is_whole] / counter.count)
        # Jumps of nearly equal size are wraps of the same counter. Their median is more accurate
        # than each.
        if not is_whole.any() and np.ptp(change) < MIN_WRONG:
            change[:] = np.median(change)
        added[back + 1] = -change
        added = np.cumsum(added)
        sizes = sorted({f"{abs(size) / TURN:.6g}" for size in change})
        notes.append(
            f"angle: {back.size} jumps back by {', '.join(sizes[:MAX_TIMES])} turns, first at "
            f"{self.time[back[0] + 1]:.6g} s: corrected, so that the angle continues."
        )
        return added
