"""Published measurements: noise regressions and jump speeds to compare with."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, FiniteFloat, model_validator

from cam_rig.schema.quantity import Strict

#: Coefficients c0 to c3.
Cubic = Annotated[list[FiniteFloat], Field(min_length=4, max_length=4)]


def _require_known(key: str, cams: Iterable[str], known: Collection[str]) -> None:
    for cam in cams:
        if cam not in known:
            raise ValueError(f"{key}: has {cam!r}; allowed: {', '.join(known)}")


class Crossover(Strict):
    """Where the noise of two cams is equal."""

    between: tuple[str, str]
    rpm: FiniteFloat = Field(gt=0.0)


class PublishedNoise(Strict):
    """One file of ``config/published/``: level in dB = c0 + c1 x + c2 x² + c3 x³, x in rpm."""

    name: str
    source: str
    range_rpm: tuple[FiniteFloat, FiniteFloat]
    regression_db: dict[str, Cubic] = Field(min_length=1)
    crossover: Crossover

    @model_validator(mode="after")
    def _consistent(self) -> PublishedNoise:
        low, high = self.range_rpm
        if not 0.0 < low < high:
            raise ValueError(f"range_rpm: is {low:g} to {high:g}; allowed: rising, above 0")
        if len(set(self.crossover.between)) < 2:
            raise ValueError(f"crossover.between: is {self.crossover.between}; allowed: two cams")
        _require_known("crossover.between", self.crossover.between, self.regression_db)
        return self

    def level(self, cam: str, rpm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Published level of ``cam`` in dB at speeds in rpm."""
        return np.asarray(np.polynomial.polynomial.polyval(rpm, self.regression_db[cam]))


class PublishedJump(Strict):
    """A row of the paper's Table 2: speed and time of the first lift-off."""

    rpm: FiniteFloat = Field(gt=0.0)
    time_s: FiniteFloat = Field(gt=0.0)


class PublishedTables(Strict):
    """``config/published/tables/paper.yaml``: what the paper prints in its tables."""

    name: str
    source: str
    table_1: dict[str, FiniteFloat]
    table_2_jump: dict[str, PublishedJump] = Field(min_length=1)
    table_2_defined: list[str] = Field(min_length=1)

    @model_validator(mode="after")
    def _known(self) -> PublishedTables:
        _require_known("table_2_defined", self.table_2_defined, self.table_2_jump)
        return self
