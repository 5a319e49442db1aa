"""Background noise as samples: seeded, and the same however it is cut into blocks."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cam_rig.arrays import FloatArray


@dataclass
class Background:
    """Gaussian noise of unit variance that falls by 6 dB an octave above its corner.

    A first-order recursion, x ← a x + √(1 − a²) n with a = e^(−2π corner/rate): its variance is 1
    from the first sample on, at any rate.

    Parameters
    ----------
    corner, rate : Hz
    seed : of the generator; the same seed, the same noise
    """

    corner: float
    rate: float
    seed: int
    _last: float = field(init=False)

    def __post_init__(self) -> None:
        self._generator = np.random.default_rng(self.seed)
        self._last = float(self._generator.standard_normal())

    @property
    def memory(self) -> tuple[float, dict[str, Any]]:
        """The last sample and the generator's state."""
        return self._last, dict(self._generator.bit_generator.state)

    @memory.setter
    def memory(self, memory: tuple[float, dict[str, Any]]) -> None:
        self._last, self._generator.bit_generator.state = memory

    def samples(self, count: int) -> FloatArray:
        """The next samples, ``(count,)``."""
        from scipy.signal import lfilter  # a second of imports, which only who listens should pay

        keep = math.exp(-2.0 * math.pi * self.corner / self.rate)
        fresh = self._generator.standard_normal(count)
        gain = math.sqrt(-math.expm1(2.0 * math.log(keep)))
        noise, _ = lfilter([gain], [1.0, -keep], fresh, zi=[keep * self._last])
        self._last = float(noise[-1]) if count else self._last
        return np.asarray(noise)
