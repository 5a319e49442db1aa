"""Published measurements: noise regressions to compare a run with."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, FiniteFloat

from cam_rig.schema.quantity import Strict


class Crossover(Strict):
    """Where the noise of two cams is equal."""

    between: tuple[str, str]
    rpm: FiniteFloat


class PublishedNoise(Strict):
    """One file of ``config/published/``: level in dB = c0 + c1 x + c2 x² + c3 x³, x in rpm."""

    name: str
    source: str
    range_rpm: tuple[FiniteFloat, FiniteFloat]
    regression_db: dict[str, list[FiniteFloat]] = Field(min_length=1)
    crossover: Crossover

    def level(self, cam: str, rpm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Published level of ``cam`` in dB at speeds in rpm."""
        return np.asarray(np.polynomial.polynomial.polyval(rpm, self.regression_db[cam]))
