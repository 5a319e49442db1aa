"""The count of an encoder, from the angles that were read through it."""

from __future__ import annotations

import numpy as np

from cam_rig.arrays import FloatArray

#: Angles that rise by whole steps so nearly, in parts of one, were read through an encoder; over a
#: step of n of them √n times that, as the count is not known better, and at most.
WHOLE, MOST = 1e-3, 0.05
#: Angles (rad) that differ by less are equal; a count is no finer than this.
EQUAL, FINEST = 1e-12, 1e-8


def encoder_count(angle: FloatArray) -> float:
    """The step (rad) in which angles ``(n,)`` with all their turns come; 0 where they show none.

    Not each count need have been read, but steps of two sizes, standing still among them: equal
    steps are those of a cam that turns steadily.

    Examples
    --------
    >>> counts = np.floor(30.0 * np.linspace(0.0, 1.0, 500) / (2.0 * np.pi / 1024))
    >>> round(2.0 * np.pi / encoder_count(counts * (2.0 * np.pi / 1024)))
    1024
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
