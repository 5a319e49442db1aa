"""A run as instruments saw it: each quantity with times of its own, on the clock of the bag."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cam_rig.arrays import FloatArray

#: Readings of which the usual step is taken, at once; a slower speed has another.
WINDOW = 64
#: A step that is so many times the usual one is a gap; of readings at a steady rate, and others.
GAP_STEADY, GAP = 1.8, 4.0
#: Steps of which nine of ten differ by less than this part of themselves are of a steady rate.
STEADY = 0.05


@dataclass(frozen=True, eq=False)
class Signal:
    """One measured quantity: ``time`` (s, rising) and ``value`` (SI), both ``(n,)``.

    ``source`` is the topic and field it was read from.
    """

    time: FloatArray
    value: FloatArray
    source: str = ""

    def gaps(self) -> FloatArray:
        """``(k, 2)`` times (s) between which readings are missing: the step is far too long.

        Usual is the median step of the readings nearby, since an encoder may give one for each
        count, and so more at high speed.

        Examples
        --------
        >>> time = np.delete(np.arange(200) / 100.0, slice(50, 60))
        >>> Signal(time, time).gaps().tolist()
        [[0.49, 0.6]]
        """
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


@dataclass(frozen=True, eq=False)
class MeasuredRun:
    """What was recorded of one cam on a machine; what is None was not.

    Parameters
    ----------
    source : the bag
    cam : name of the cam, as in the scene; empty where the bag does not say
    angle : cam angle with all its turns, rad; of an encoder, so perhaps in steps
    lift : follower displacement, m
    force : contact force, N
    level : sound level, dB re 20 µPa
    notes : what was found odd in the bag, each a sentence for people
    begin_ns : the stamp (ns) from which all times count
    """

    source: Path
    cam: str
    angle: Signal
    lift: Signal | None = None
    force: Signal | None = None
    level: Signal | None = None
    notes: tuple[str, ...] = ()
    begin_ns: int = 0
