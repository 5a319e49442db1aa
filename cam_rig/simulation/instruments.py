"""Signals of a measured run: readings, their gaps, and the counts of an encoder."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cam_rig.units import FloatArray

#: Readings of which the usual step is taken, at once; a slower speed has another.
WINDOW = 64
#: A step that is so many times the usual one is a gap; of readings at a steady rate, and others.
GAP_STEADY, GAP = 1.8, 4.0
#: Steps of which nine of ten differ by less than this part of themselves are of a steady rate.
STEADY = 0.05


@dataclass(frozen=True, eq=False)
class Signal:
    """One measured quantity."""

    time: FloatArray  #: s, rising, ``(n,)``
    value: FloatArray  #: SI, ``(n,)``
    source: str = ""  #: the topic and field it was read from

    def gaps(self) -> FloatArray:
        """``(k, 2)`` times (s) around steps far longer than the median nearby: readings missing."""
        steps = np.diff(self.time)
        if steps.size < 3:
            return np.empty((0, 2))
        count = -(-steps.size // WINDOW)
        padded = np.append(steps, np.full(count * WINDOW - steps.size, np.nan))
        blocks = padded.reshape(count, WINDOW)
        usual = np.nanmedian(blocks, axis=1)
        spread = np.nanpercentile(np.abs(blocks - usual[:, None]), 90.0, axis=1)
        factor = np.where(spread <= STEADY * usual, GAP_STEADY, GAP)
        limit = np.pad(factor * usual, 1, mode="edge")
        nearby = np.maximum(np.maximum(limit[:-2], limit[1:-1]), limit[2:])
        places = np.flatnonzero(steps > np.repeat(nearby, WINDOW)[: steps.size])
        return np.column_stack([self.time[places], self.time[places + 1]])


def pulls(force: FloatArray) -> bool:
    """Whether a measured contact force (N), ``(n,)``, has the sign of a pull."""
    return bool(np.median(force) < 0.0 and -force.min() > 2.0 * force.max())


@dataclass(frozen=True)
class ReadingCount:
    """The number of readings of a quantity, of the messages of its topic."""

    quantity: str
    source: str  #: topic and field
    readings: int
    messages: int

    @property
    def skipped(self) -> int:
        """Messages that gave no reading: without the field or a time, or with a wrong number."""
        return self.messages - self.readings


@dataclass(frozen=True, eq=False)
class MeasuredRun:
    """Signals that were recorded of one cam on a machine; a signal is None if it was not."""

    source: Path  #: the bag
    cam: str  #: name of the cam, as in the scene; empty where the bag does not say
    angle: Signal  #: cam angle with all its turns, rad; of an encoder, so perhaps in steps
    lift: Signal | None = None  #: follower displacement, m
    force: Signal | None = None  #: contact force, N
    level: Signal | None = None  #: sound level, dB re 20 µPa
    notes: tuple[str, ...] = ()  #: what was odd in the bag and what was done, a sentence each
    begin_ns: int = 0  #: the stamp (ns) from which all times count
    counts: tuple[ReadingCount, ...] = ()  #: of a bag of another program, for each quantity


#: Angles that rise by whole steps so nearly, in parts of one, were read through an encoder; over a
#: step of n of them √n times that, as the count is not known better, and at most.
WHOLE, MOST = 1e-3, 0.05
#: Angles (rad) that differ by less are equal; a count is no finer than this.
EQUAL, FINEST = 1e-12, 1e-8


def encoder_count(angle: FloatArray) -> float:
    """The step (rad) in which angles ``(n,)`` with all their turns come; 0 where they show none.

    Not each count need have been read, but steps of two sizes, standing still among them: equal
    steps are those of a cam that turns steadily.
    """
    every = np.abs(np.diff(angle))
    steps = every[every > EQUAL]
    if not steps.size:
        return 0.0
    apart = np.diff(np.unique(np.round(steps, 9)))
    least = [float(steps.min()), *apart[:1].tolist(), float(apart.min(initial=np.inf))]
    for count in sorted(set(least), reverse=True):  # the least step seen may be several counts
        if not FINEST < count < np.inf:
            continue
        off = steps / count
        whole = np.rint(off)
        if not whole.all():
            continue
        if np.abs(off - whole).max() < min(MOST, WHOLE * max(1.0, float(np.sqrt(off.max())))):
            sizes = np.unique(whole).size + (steps.size < every.size)
            return float(np.median(steps / whole)) if sizes > 1 else 0.0
    return 0.0
