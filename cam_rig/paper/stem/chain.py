"""A stem of n elements between roller and return spring, and the uniform bar it tends to.

The two-mass follower (eq. 14-19 of the paper) has half of the stem's mass at either end. Here the
stem is cut into n elements, each with half of its mass at either end, a spring n k₁ and a damper
n c₁: n = 1 is the two-mass follower itself, and n → ∞ a bar, in closed form. Mass, static
stiffness and preload are the same for all n. In contact the foot of the stem is on the cam.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import eigh_tridiagonal
from scipy.optimize import brentq

from cam_rig.dynamics import TwoMassParameters
from cam_rig.laws import Law
from cam_rig.units import TURN, ComplexArray, FloatArray

#: Elements of a bar.
BAR = math.inf


@dataclass(frozen=True)
class Stem:
    """A stem with the most mass that the split allows, in ``elements`` parts; `BAR` for a bar."""

    follower: TwoMassParameters
    elements: float

    @property
    def mass(self) -> float:
        """Of the stem, kg."""
        return 2.0 * min(self.follower.roller_mass, self.follower.end_mass)

    @property
    def foot_mass(self) -> float:
        """What is at the roller besides the stem, kg."""
        return self.follower.roller_mass - 0.5 * self.mass

    @property
    def head_mass(self) -> float:
        """What is at the return spring besides the stem, kg."""
        return self.follower.end_mass - 0.5 * self.mass

    @property
    def on_cam(self) -> float:
        """What the lift's acceleration meets without any elasticity between, kg."""
        return self.foot_mass + 0.5 * self.mass / self.elements

    def transfer(self, rates: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """What a lift e^{pt}, p in 1/s and not 0, makes of contact force (N/m) and head (1)."""
        f, p = self.follower, np.asarray(rates)
        head = self.head_mass * p**2 + f.damping * p + f.spring_stiffness
        elastic = f.stem_stiffness + f.stem_damping * p
        if math.isinf(self.elements):
            phase = p * np.sqrt(self.mass / elastic)
            wave, slope = elastic * phase, np.tanh(phase)
            sides = wave + head * slope
            force = wave * (head + wave * slope) / sides
            shown = wave / sides * 2.0 * np.exp(-phase) / (1.0 + np.exp(-2.0 * phase))
            return self.foot_mass * p**2 + force, shown
        elastic, inertia = self.elements * elastic, self.mass / self.elements * p**2
        load, shown = head + 0.5 * inertia, np.ones_like(p)
        for _ in range(int(self.elements)):
            passed = elastic / (elastic + load)
            load, shown = inertia + passed * load, shown * passed
        return load - 0.5 * inertia + self.foot_mass * p**2, shown

    def natural_frequencies(self, count: int) -> FloatArray:
        """The lowest, rad/s, undamped and in contact: foot held, ``(count,)`` or all there are."""
        f = self.follower
        if math.isinf(self.elements):
            return self._of_bar(count)
        n = int(self.elements)
        masses = np.full(n, self.mass / n)
        masses[-1] = 0.5 * self.mass / n + self.head_mass
        stiffness = np.full(n, 2.0 * n * f.stem_stiffness)
        stiffness[-1] = n * f.stem_stiffness + f.spring_stiffness
        beside = -n * f.stem_stiffness / np.sqrt(masses[1:] * masses[:-1])
        squares = eigh_tridiagonal(stiffness / masses, beside, eigvals_only=True)
        return np.asarray(np.sqrt(squares[:count]))

    def _of_bar(self, count: int) -> FloatArray:
        """Roots γ of k₁ γ cos γ + (k₂ − m ω²) sin γ = 0, with ω = γ √(k₁/stem mass)."""
        f = self.follower
        square = f.stem_stiffness / self.mass

        def closes(phase: float) -> float:
            pull = f.spring_stiffness - self.head_mass * square * phase**2
            return f.stem_stiffness * phase * math.cos(phase) + pull * math.sin(phase)

        roots = [brentq(closes, (i + 1e-9) * math.pi, (i + 1.0) * math.pi) for i in range(count)]
        return np.array(roots) * math.sqrt(square)


# The steady turn of a stem of any number of elements as a Fourier series, exact in each harmonic.

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
    whole, moved = (np.fft.irfft(series, size) * size for series in (rest, heads))
    return StemTurn(speed, angle, inertia + whole, moved, forces[1:])


@lru_cache(maxsize=64)
def _harmonics(law: Law, count: int) -> ComplexArray:
    """Of the lift, from the mean to the last, ``(count + 1,)`` in m."""
    size = 2 * count * FINER
    angle = np.arange(size, dtype=np.float64) * (TURN / size)
    series = np.fft.rfft(law(angle)) / size
    return np.asarray(series[: count + 1], dtype=np.complex128)
