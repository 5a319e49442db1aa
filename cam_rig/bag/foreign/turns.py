"""The cam angle of an encoder: wrong angles found, whole turns counted, turning forwards."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cam_rig.errors import BagError
from cam_rig.simulation.instruments import EQUAL_ANGLE_ATOL_RAD, Signal
from cam_rig.units import TURN, FloatArray

#: An angle within one turn may exceed it by this factor: rounding.
WITHIN = 1.0 + 1e-6
#: Fraction of the angles that may be outside of the range in which an encoder wraps: wrong ones.
OUTSIDE = 0.02
#: Range of the readings (fraction of the period) from which on they can wrap without a long step.
MIN_RANGE = 0.75
#: Mean step (fraction of the period) from which on whole turns cannot be counted.
MAX_STEP = 0.4
#: Steps of which the usual step is the median, before and after each step; an odd number.
WINDOW = 15
#: Largest deviation (rad) from the usual step that is never reported as wrong: 7.2°.
MIN_WRONG = TURN / 50.0
#: Scatter of the steps (standard deviations) that is not reported as wrong.
MAX_SCATTER = 8.0
#: Quantile of the steps that are not 0: the count of a coarse encoder, else a slow step.
SMALL_STEPS = 0.05
#: Such counts that are not reported as wrong: two readings are rounded.
MAX_COUNTS = 2.0
#: Standard deviation of a normal distribution in its median absolute deviations.
MAD_SIGMA = 1.4826
#: A step this many times as long as usual is a gap, in which the cam may have turned any angle.
GAP = 4.0
#: Adjacent wrong angles, at most; longer runs are a jump of the encoder.
MAX_RUN = 100
#: Fraction of the angles that may be wrong.
MAX_WRONG = 0.1
#: Relative error of an angle that is predicted across a run of wrong angles.
PREDICTION_RTOL = 0.05
#: A jump counts as whole turns if it is nearer to them than this fraction of the usual step.
WHOLE_TURNS_RTOL = 0.25
#: It may be farther away by this multiple of the steps' scatter (standard deviations).
WHOLE_TURNS_SCATTER = 4.0
#: Largest tolerance, as a fraction of the period of a wrapped angle.
MAX_TOLERANCE = 0.3
#: Steps that are compared at once: bounds the memory for a long recording.
BLOCK = 100_000
#: Times that a note names.
MAX_TIMES = 6


@dataclass(frozen=True)
class Counter:
    """The integers in which an angle comes: rad per count, and values of the type."""

    count: float
    values: int

    @property
    def span(self) -> float:
        """Angle (rad) after which the counter wraps."""
        return self.count * self.values


@dataclass(frozen=True, eq=False)
class CountedAngle:
    """The angle with all its turns, rising, without wrong angles.

    ``wrong``: indices of the wrong angles in the signal that was given; ``notes``: a sentence for
    each change.
    """

    signal: Signal
    wrong: NDArray[np.intp]
    notes: tuple[str, ...]


def count_turns(angle: Signal, where: str, counter: Counter | None = None) -> CountedAngle:
    """Return the angle with all its turns, rising; ``where`` names it in an error."""
    steps = _Steps(angle, _period(angle.value, counter))
    if np.median(np.abs(steps.step)) > MAX_STEP * steps.period:
        degrees = np.degrees(np.median(np.abs(steps.step)))
        raise BagError(
            f"{where}: the angle steps by {degrees:.0f}° from reading to reading; allowed: less "
            "than half a turn, else its turns cannot be counted, so record more readings"
        )
    wrong, jumps = steps.find_wrong()
    notes = _wrong_notes(angle, wrong, where)
    value = angle.value + steps.corrections(jumps, counter, notes)
    kept = np.ones(value.size, dtype=np.bool_)
    kept[wrong] = False
    time, value = angle.time[kept], value[kept]
    if np.isfinite(steps.period):
        wraps = np.abs(np.diff(value)) > 0.5 * steps.period
        value = np.unwrap(value, period=steps.period)
        if wraps.any():
            first = float(time[int(np.argmax(wraps)) + 1])
            notes.append(_period_words(steps.period, first, counter))
        if len(angle.gaps()):
            notes.append("Whole turns within a gap of the angle are not known.")
    if value[-1] < value[0]:
        value = -value
        notes.append("The angle falls: it was turned over, so the cam turns the other way.")
    turned = value[-1] - value[0]
    if turned < 0.5 * float(np.abs(np.diff(value)).sum()) or turned <= 0.0:
        back = time[int(np.argmin(np.diff(value) >= 0.0))]
        raise BagError(
            f"{where}: the angle goes from {np.degrees(value[0]):.6g}° to "
            f"{np.degrees(value[-1]):.6g}° and not one way, first back at {back:.6g} s; allowed: "
            "a cam that turns"
        )
    return CountedAngle(Signal(time, value, angle.source), wrong, tuple(notes))


def _period(value: FloatArray, counter: Counter | None) -> float:
    """Return the angle (rad) after which readings wrap; infinity if they show no such angle.

    They wrap if a step is longer than half of it, or if the usual step leads out of their range: a
    driver that averages readings makes two steps of nearly half a turn from one.
    """
    others = int(OUTSIDE * value.size)
    ordered = np.sort(value)
    width = float((ordered[value.size - 1 - others :] - ordered[: others + 1]).min())
    steps = np.diff(value)
    largest, turned = float(np.abs(steps).max()), abs(float(np.median(steps))) * steps.size

    def wraps(period: float) -> bool:
        return 2.0 * largest > period or (width > MIN_RANGE * period and turned > 2.0 * width)

    if counter is not None and 2.0 * width > counter.span and wraps(counter.span):
        return counter.span
    return TURN if width <= TURN * WITHIN and wraps(TURN) else np.inf


def _period_words(period: float, first: float, counter: Counter | None) -> str:
    if period == TURN:
        return "The angle is given within one turn: its turns were counted."
    counts = 0 if counter is None else counter.values
    return (
        f"The angle wraps after {counts} counts, {period / TURN:.6g} turns, first at {first:.6g} "
        "s: its turns were counted."
    )


def _wrong_notes(angle: Signal, wrong: NDArray[np.intp], where: str) -> list[str]:
    if not wrong.size:
        return []
    times = [f"{time:.6g}" for time in angle.time[wrong[:MAX_TIMES]]]
    more = f" s and {wrong.size - MAX_TIMES} more" if wrong.size > MAX_TIMES else " s"
    words = f"{wrong.size} wrong angles, at {', '.join(times)}{more}"
    if wrong.size > max(1.0, MAX_WRONG * angle.time.size):
        raise BagError(
            f"{where}: {words}, of {angle.time.size}: they differ from the readings next to them; "
            f"allowed: {100 * MAX_WRONG:g} %, so record the angle of one encoder alone"
        )
    return [f"angle: {words}: dropped, as they differ from the readings next to them."]


class _Steps:
    """The steps from angle to angle, modulo the period, and those that are to be expected."""

    def __init__(self, angle: Signal, period: float) -> None:
        from scipy.ndimage import median_filter

        self.time, self.value, self.period = angle.time, angle.value, period
        self.step = self._wrapped(np.diff(self.value))
        interval = np.diff(self.time)
        size = min(WINDOW, self.step.size - 1 + self.step.size % 2)
        step, rate = (
            median_filter(values, size, mode="nearest")
            for values in (self.step, self.step / interval)
        )
        spread = median_filter(np.abs(self.step - step), size, mode="nearest")
        # Windows within the readings: beyond, the first or the last step would count often.
        half, near = size // 2, np.arange(step.size)
        inside = [np.clip(near + shift, half, step.size - 1 - half) for shift in (-half - 1, 0)]
        self._before, middle = inside
        self._after = np.clip(near + half + 1, half, step.size - 1 - half)
        spread = spread[middle]
        self._usual, self._rate = step, rate
        moves = np.abs(self.step)[np.abs(self.step) > EQUAL_ANGLE_ATOL_RAD]
        count = float(np.quantile(moves, SMALL_STEPS)) if moves.size else 0.0
        least = MIN_WRONG + MAX_COUNTS * count
        self._scatter = MAD_SIGMA * spread
        self._tolerance = least + np.abs(step[middle]) + MAX_SCATTER * self._scatter
        self.gap = interval > GAP * np.median(interval)

    def _wrapped(self, change: FloatArray) -> FloatArray:
        if not np.isfinite(self.period):
            return change
        return np.asarray(np.remainder(change + 0.5 * self.period, self.period) - 0.5 * self.period)

    def _expected(self, first: NDArray[np.intp], last: NDArray[np.intp]) -> FloatArray:
        """Return the least and the largest change, ``(2, n)``, from readings to later ones.

        The cam may turn as before or as after, and by the time or by the number of readings.
        """
        before, after = self._before[first], self._after[np.minimum(last, self.step.size) - 1]
        count, seconds = last - first, self.time[last] - self.time[first]
        changes = np.stack(
            [part for at in (before, after) for part in self._changes(at, count, seconds)]
        )
        return np.stack([changes.min(axis=0), changes.max(axis=0)])

    def _changes(
        self, at: NDArray[np.intp], count: NDArray[np.intp], seconds: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        return self._usual[at] * count, self._rate[at] * seconds

    def fits(self, first: NDArray[np.intp], last: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Return True for each pair of readings if the cam can turn from the first to the last."""
        low, high = self._expected(first, last)
        middle = 0.5 * (low + high)
        off = np.abs(self._wrapped(self.value[last] - self.value[first] - middle))
        tolerance = np.maximum(
            self._tolerance[np.minimum(first, self.step.size - 1)],
            self._tolerance[last - 1],
        )
        tolerance = tolerance + PREDICTION_RTOL * np.abs(middle) * (last - first > 1)
        return np.asarray(
            off - 0.5 * (high - low) <= np.minimum(tolerance, MAX_TOLERANCE * self.period)
        )

    def find_wrong(self) -> tuple[NDArray[np.intp], list[int]]:
        """Return the indices of the wrong angles, and of the readings before a jump that stays."""
        blocks = np.array_split(np.arange(self.step.size), 1 + self.step.size // BLOCK)
        fits = np.concatenate([self.fits(first, first + 1) for first in blocks])
        forward = np.sign(np.median(self.step)) * self.step
        fits |= self.gap & (np.isfinite(self.period) | (forward >= 0.0))
        edges = np.flatnonzero(~fits)
        if not edges.size:
            return np.array([], dtype=np.intp), []
        starts = np.concatenate([[0], edges + 1])
        stops = np.concatenate([edges, [self.value.size - 1]])
        sizes = stops - starts + 1
        anchor = int(np.argmax(sizes >= min(WINDOW, int(sizes.max()))))
        wrong, jumps = self._walk(starts[anchor:], stops[anchor:])
        # Before the first sure readings, the same from the end to the start.
        back, earlier = self._walk(stops[anchor::-1], starts[anchor::-1])
        return np.array(sorted({*wrong, *back}), dtype=np.intp), sorted({*jumps, *earlier})

    def _walk(
        self, starts: NDArray[np.intp], stops: NDArray[np.intp]
    ) -> tuple[list[int], list[int]]:
        """Follow runs of readings, each fitting in itself, away from the first run.

        A run that no later one confirms is a jump; a run between two that fit is wrong.
        """
        wrong, jumps, k = list[int](), list[int](), 0
        while k < starts.size - 1:
            end = stops[k]
            later = starts[k + 2 : k + 3 + MAX_RUN]  # no run is shorter than a reading
            later = later[np.abs(later - end) <= MAX_RUN + 1]
            pairs = np.sort(np.stack([np.full_like(later, end), later]), axis=0)
            fitting = np.flatnonzero(self.fits(*pairs)) if later.size else np.array([])
            if fitting.size:
                k += 2 + int(fitting[0])
                between = sorted((int(end), int(starts[k])))
                wrong += range(between[0] + 1, between[1])
                continue
            first = int(min(end, starts[k + 1]))
            is_last = k + 2 == starts.size and abs(int(stops[-1] - starts[-1])) < WINDOW // 2
            if is_last and not self.gap[first] and not self._is_whole(first):
                low, high = sorted((int(starts[-1]), int(stops[-1])))
                wrong += range(low, high + 1)
                break
            jumps.append(first)
            k += 1
        return wrong, jumps

    def _excess(self, index: int) -> float:
        """Return the angle (rad) by which a step differs from the expected one."""
        first = np.array([index])
        return float(self.step[index] - self._expected(first, first + 1).mean())

    def _is_whole(self, index: int) -> bool:
        """Return True if a step differs from the expected one by whole turns."""
        excess = self._excess(index)
        tolerance = WHOLE_TURNS_RTOL * abs(self._usual[index])
        tolerance += WHOLE_TURNS_SCATTER * self._scatter[index]
        return bool(abs(excess - TURN * round(excess / TURN)) <= tolerance)

    def corrections(
        self, jumps: list[int], counter: Counter | None, notes: list[str]
    ) -> FloatArray:
        """Return what is to be added to each reading so that the angle does not jump back.

        A jump back by nearly whole turns is by whole turns. Any other is the jump itself: a counter
        that wraps at another number, or was set to zero. A jump forwards is kept, as after readings
        that stood still; so is one of an angle that wraps, whose size is not known.
        """
        added = np.zeros(self.value.size)
        excess = np.array([self._excess(index) for index in jumps])
        is_back = (np.sign(np.median(self.step)) * excess < 0.0) & ~np.isfinite(self.period)
        for index in np.array(jumps, dtype=np.intp)[~is_back][:MAX_TIMES]:
            notes.append(
                f"angle: a jump by {np.degrees(self.step[index]):.3g}° at "
                f"{self.time[index + 1]:.6g} s, which the readings next to it do not explain: kept."
            )
        if not is_back.any():
            return added
        back, excess = np.array(jumps, dtype=np.intp)[is_back], excess[is_back]
        gap, whole = self.gap[back], np.array([self._is_whole(index) for index in back])
        change = np.where(whole, TURN * np.rint(excess / TURN), excess)
        forward = np.sign(np.median(self.step))
        turns = np.floor(forward * self.step[back] / TURN)  # in a gap, the fewest that are forwards
        change[gap], whole = forward * TURN * turns[gap], whole | gap
        if counter is not None:
            change[~whole] = counter.count * np.rint(excess[~whole] / counter.count)
        if not whole.any() and np.ptp(change) < MIN_WRONG:  # always the same: its median is better
            change[:] = np.median(change)
        added[back + 1] = -change
        added = np.cumsum(added)
        sizes = sorted({f"{abs(size) / TURN:.6g}" for size in change})
        notes.append(
            f"angle: {back.size} jumps back by {', '.join(sizes[:MAX_TIMES])} turns, first at "
            f"{self.time[back[0] + 1]:.6g} s: the turns were counted on."
        )
        return added
