"""A run as instruments saw it: each quantity with times of its own, on the clock of the bag."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cam_rig.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Signal:
    """One measured quantity: ``time`` (s, rising) and ``value`` (SI), both ``(n,)``.

    ``source`` is the topic and field it was read from.
    """

    time: FloatArray
    value: FloatArray
    source: str = ""


@dataclass(frozen=True, eq=False)
class MeasuredRun:
    """What was recorded of one cam on a machine; what is None was not.

    Parameters
    ----------
    source : the bag
    cam : name of the cam, as in the scene
    angle : cam angle with all its turns, rad; of an encoder, so perhaps in steps
    lift : follower displacement, m
    force : contact force, N
    level : sound level, dB re 20 µPa
    notes : what was found odd in the bag, each a sentence for people
    """

    source: Path
    cam: str
    angle: Signal
    lift: Signal | None = None
    force: Signal | None = None
    level: Signal | None = None
    notes: tuple[str, ...] = ()
