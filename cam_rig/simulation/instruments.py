"""Signals of a measured run, the gaps in them, and the counts of an encoder."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cam_rig.units import FloatArray

#: Number of successive time steps between readings over which the median step is computed. It is
#: small, because an encoder that reports each count has longer steps at a lower speed.
WINDOW = 64
#: A time between two readings is a gap if it is longer than this multiple of the usual time step.
#: The value is for readings at a constant rate.
STEADY_GAP_RATIO = 1.8
#: As `STEADY_GAP_RATIO`, for readings without a constant rate. It is larger, because networks
#: deliver readings in bursts.
GAP_RATIO = 4.0
#: Readings have a constant rate if nine of ten time steps between them deviate from the median step
#: by at most this fraction.
STEADY_RTOL = 0.05


@dataclass(frozen=True, eq=False)
class Signal:
    """Readings of one measured quantity over time."""

    time: FloatArray  #: s, rising, ``(n,)``
    value: FloatArray  #: SI, ``(n,)``
    source: str = ""  #: topic and field from which it was read

    def gaps(self) -> FloatArray:
        """Return the start and end times (s) of gaps between readings, shape `(k, 2)`.

        A gap is a time step much longer than the median of the steps near it. `GAP_RATIO` and
        `STEADY_GAP_RATIO` are the limits of the ratio.
        """
        steps = np.diff(self.time)
        if steps.size < 3:
            return np.empty((0, 2))
        count = -(-steps.size // WINDOW)
        padded = np.append(steps, np.full(count * WINDOW - steps.size, np.nan))
        blocks = padded.reshape(count, WINDOW)
        usual = np.nanmedian(blocks, axis=1)
        spread = np.nanpercentile(np.abs(blocks - usual[:, None]), 90.0, axis=1)
        factor = np.where(spread <= STEADY_RTOL * usual, STEADY_GAP_RATIO, GAP_RATIO)
        limit = np.pad(factor * usual, 1, mode="edge")
        nearby = np.maximum(np.maximum(limit[:-2], limit[1:-1]), limit[2:])
        indices = np.flatnonzero(steps > np.repeat(nearby, WINDOW)[: steps.size])
        return np.column_stack([self.time[indices], self.time[indices + 1]])


def pulls(force: FloatArray) -> bool:
    """Return True if a sensor reports a measured contact force with a negative sign.

    Such a sensor counts a pull as positive, while a contact force is a push. `force` contains the
    readings in N, shape (n,).
    """
    return bool(np.median(force) < 0.0 and -force.min() > 2.0 * force.max())


@dataclass(frozen=True)
class ReadingCount:
    """Number of usable readings of a quantity, and of the messages of its topic."""

    quantity: str
    source: str  #: topic and field
    readings: int
    messages: int

    @property
    def skipped(self) -> int:
        """Number of messages without a usable reading.

        The field or a time is missing in such a message, or its number is wrong.
        """
        return self.messages - self.readings


@dataclass(frozen=True, eq=False)
class MeasuredRun:
    """Signals recorded of one cam on a machine.

    A signal is None if it was not recorded.
    """

    source: Path  #: the bag
    cam: str  #: name of the cam in the scene, empty if the bag does not contain it
    angle: Signal  #: cam angle with all its turns, rad; in steps if an encoder measures it
    lift: Signal | None = None  #: follower displacement, m
    force: Signal | None = None  #: contact force, N
    level: Signal | None = None  #: sound level, dB re 20 µPa
    notes: tuple[str, ...] = ()  #: sentences on anomalies in the bag
    begin_ns: int = 0  #: stamp of time 0, ns
    counts: tuple[ReadingCount, ...] = ()  #: per quantity, if another program wrote the bag


#: Largest deviation of an angle step from a whole number of encoder counts, in counts, for a step
#: of one count. For a step of n counts it is √n times as large, because the size of a count is
#: known to this accuracy only.
COUNT_ATOL = 1e-3
#: Upper limit of the deviation of an angle step from a whole number of an encoder's counts (see
#: `COUNT_ATOL`), in counts.
MAX_COUNT_ATOL = 0.05
#: Largest difference of angles (rad) that count as equal (rounding).
EQUAL_ANGLE_ATOL_RAD = 1e-12
#: Smallest angle (rad) that is recognized as one count of an encoder.
MIN_COUNT_RAD = 1e-8


def encoder_count(angle: FloatArray) -> float:
    """Return the angle (rad) of one count of an encoder, or 0 without visible counts.

    Some counts may be missing in the readings. At least two different step sizes are required, and
    a step of zero is one of them: equal steps are those of a cam that turns at constant speed.

    Parameters
    ----------
    angle : (n,) array
        Cam angle with all its turns, rad.
    """
    differences = np.abs(np.diff(angle))
    steps = differences[differences > EQUAL_ANGLE_ATOL_RAD]
    if not steps.size:
        return 0.0
    increments = np.diff(np.unique(np.round(steps, 9)))
    smallest = float(increments.min(initial=np.inf))
    candidates = [float(steps.min()), *increments[:1].tolist(), smallest]
    for count in sorted(set(candidates), reverse=True):  # the smallest step may be several counts
        if not MIN_COUNT_RAD < count < np.inf:
            continue
        ratios = steps / count
        whole = np.rint(ratios)
        if not whole.all():
            continue
        tolerance = min(MAX_COUNT_ATOL, COUNT_ATOL * max(1.0, float(np.sqrt(ratios.max()))))
        if np.abs(ratios - whole).max() < tolerance:
            sizes = np.unique(whole).size + (steps.size < differences.size)
            return float(np.median(steps / whole)) if sizes > 1 else 0.0
    return 0.0
