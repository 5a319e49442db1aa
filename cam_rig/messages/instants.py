"""The instants of a tick at which its motion is published for people: few, but every peak."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cam_rig.arrays import FloatArray
from cam_rig.dynamics import Samples
from cam_rig.errors import RefusedError
from cam_rig.laws import Law
from cam_rig.simulation.schedule import CamState
from cam_rig.units import NS

Indices = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Instants:
    """The motion at some samples of one tick: arrays ``(n,)`` in the order of time.

    ``law`` is the mounted cam's and bears its name; ``index`` counts the tick's samples from 0.
    ``time_ns`` is rig time, to the nanosecond that the sample falls in. ``angle`` (rad) of the cam
    has all its turns, ``angle_in_turn`` those since the tick began; ``speed`` in rad/s, ``torque``
    of the shaft in N·m: contact force times ds/dθ. ``lift``, ``velocity`` and contact ``force`` in
    m, m/s and N are the samples' own.
    """

    law: Law
    index: Indices
    time_ns: Indices
    angle: FloatArray
    angle_in_turn: FloatArray
    speed: FloatArray
    torque: FloatArray
    lift: FloatArray
    velocity: FloatArray
    force: FloatArray


def instants_of(
    law: Law,
    start: CamState,
    end: CamState,
    rows: FloatArray,
    sample_rate: int,
    shown: int | Indices,
) -> Instants:
    """The instants of the tick between two states of the cam.

    Parameters
    ----------
    law : of the cam that is mounted at the start
    rows : the tick's samples, ``(6, n)`` as in `COLUMNS`, at ``sample_rate`` (Hz)
    shown : how many instants, see `choose`; or the indices of their samples

    Raises
    ------
    RefusedError : the samples are not as many as the tick has
    """
    samples, interval = Samples(rows), start.until(end)
    grid = interval.grid(sample_rate)
    if grid.count != rows.shape[1]:
        raise RefusedError(
            f"follower samples: {rows.shape[1]}; allowed: the {grid.count} of the tick that begins "
            f"at {start.time_ns / NS:.6f} s"
        )
    index = choose(samples.lift, samples.force, shown) if isinstance(shown, int) else shown
    since, force = grid.offset + index / sample_rate, samples.force[index]
    in_turn = interval.angle + since * (interval.speed + 0.5 * interval.acceleration * since)
    seconds, rest = np.divmod(grid.first + index, sample_rate)
    return Instants(
        law=law,
        index=index,
        time_ns=seconds * NS + rest * NS // sample_rate,
        angle=interval.unwrapped(since),
        angle_in_turn=in_turn,
        speed=interval.speed + interval.acceleration * since,
        torque=force * law(in_turn, 1),
        lift=samples.lift[index],
        velocity=samples.velocity[index],
        force=force,
    )


def choose(lift: FloatArray, force: FloatArray, count: int) -> Indices:
    """Indices of the samples that are shown of a tick's ``(n,)``, rising.

    The tick is divided evenly into ``count`` bins, each with one sample at least, and the first of
    each is taken. In a bin that has the tick's largest lift, its largest or its least force, these
    are taken instead; they are two or three instants where they fall into one bin.

    Examples
    --------
    >>> import numpy as np
    >>> lift = np.array([0.0, 1.0, 2.0, 3.0, 2.0, 1.0, 0.0, 0.0])
    >>> choose(lift, 10.0 - lift, 4)
    array([0, 3, 4, 6])
    """
    bins = np.arange(min(count, lift.size)) * lift.size // min(count, lift.size)
    peaks = np.unique([lift.argmax(), force.argmax(), force.argmin()])
    taken = np.unique(np.searchsorted(bins, peaks, side="right") - 1)
    return np.union1d(np.delete(bins, taken), peaks)
