"""The steady turn of a stem of any number of elements as a Fourier series, exact in each harmonic.

A bar has infinitely many states, so it has no matrix; but each harmonic of the lift passes it in
closed form, and so it does the chain. What is left out are harmonics beyond the last.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from cam_rig.arrays import ComplexArray, FloatArray
from cam_rig.laws import Law
from cam_rig.studies.stem.chain import Stem
from cam_rig.units import TURN

#: Harmonics up to this many times the stem's own frequency are taken, as a power of two, ...
BEYOND = 8.0
#: ... and at least so many; the law is sampled this much finer, so that little of it folds back.
MIN_HARMONICS, FINER = 2048, 4


@dataclass(frozen=True, eq=False)
class StemTurn:
    """One steady turn at ``speed`` (rad/s): ``(n,)`` angle (rad), force (N) and head (m).

    ``head`` is the displacement at the return spring about the static share of the lift;
    ``harmonics`` those of the force but the mean, ``(k,)`` in N.
    """

    speed: float
    angle: FloatArray
    force: FloatArray
    head: FloatArray
    harmonics: ComplexArray

    def power(self, corner_rate: float) -> float:
        """⟨(ω_c (F − q))²⟩ in (N/s)²: what the structure of corner ω_c (rad/s) passes on."""
        rate = 1j * self.speed * np.arange(1, self.harmonics.size + 1)
        passed = corner_rate * rate / (rate + corner_rate) * self.harmonics
        return float(2.0 * np.sum(np.abs(passed) ** 2))


def stem_turn(law: Law, stem: Stem, speed: float) -> StemTurn:
    """The turn at ``speed`` (rad/s)."""
    own = math.sqrt(stem.follower.stem_stiffness / stem.follower.end_mass)
    wanted = max(float(MIN_HARMONICS), BEYOND * own / speed)
    count = 2 ** math.ceil(math.log2(wanted))
    lift = _harmonics(law, count)
    f, rates = stem.follower, 1j * speed * np.arange(1, count + 1)
    force, head = stem.transfer(rates)
    held = f.share * f.spring_stiffness * lift[0].real + f.share * f.preload
    forces = np.concatenate([[held], force * lift[1:]])
    rest = forces - stem.on_cam * np.concatenate([[0.0], rates**2]) * lift
    heads = np.concatenate([[0.0], (head - f.share) * lift[1:]])
    size = 2 * count
    angle = np.arange(size) * (TURN / size)
    # The series of the acceleration itself would end too early at its corners.
    inertia = stem.on_cam * speed**2 * law(angle, 2)
    return StemTurn(
        speed,
        angle,
        inertia + np.fft.irfft(rest, size) * size,
        np.fft.irfft(heads, size) * size,
        forces[1:],
    )


@lru_cache(maxsize=64)
def _harmonics(law: Law, count: int) -> ComplexArray:
    """Of the lift, from the mean to the last, ``(count + 1,)`` in m."""
    size = 2 * count * FINER
    angle = np.arange(size, dtype=np.float64) * (TURN / size)
    series = np.fft.rfft(law(angle)) / size
    return np.asarray(series[: count + 1], dtype=np.complex128)
