"""Published measurements: noise regressions and jump speeds to compare with."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, FiniteFloat, model_validator

from cam_rig.schema.quantity import Strict

#: Coefficients c0 to c3 of a cubic regression.
Cubic = Annotated[list[FiniteFloat], Field(min_length=4, max_length=4)]


def _require_known(key: str, cams: Iterable[str], allowed: Collection[str]) -> None:
    """Raise ValueError with `key` if a cam is not an allowed cam."""
    for cam in cams:
        if cam not in allowed:
            raise ValueError(f"{key}: has {cam!r}; allowed: {', '.join(allowed)}")


class Crossover(Strict):
    """Speed (rpm) at which two cams have the same sound level."""

    between: tuple[str, str]
    rpm: FiniteFloat = Field(gt=0.0)


class PublishedNoise(Strict):
    """Published regressions of the sound level.

    A file of ``config/published/`` contains the regressions of one source.

    Parameters
    ----------
    name, source : str
    range_rpm : tuple of float
        Smallest and largest speed of the regressions, rpm.
    regression_db : dict
        Coefficients c0 to c3 by cam: level in dB = c0 + c1 x + c2 x² + c3 x³, x in rpm.
    crossover : Crossover
    """

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
        """Return the published level of a cam in dB at speeds in rpm."""
        return np.asarray(np.polynomial.polynomial.polyval(rpm, self.regression_db[cam]))


class PublishedJump(Strict):
    """Row of the paper's Table 2: speed (rpm) and time (s) of the first lift-off."""

    rpm: FiniteFloat = Field(gt=0.0)
    time_s: FiniteFloat = Field(gt=0.0)


class PublishedTables(Strict):
    """Tables of the paper, in ``config/published/tables/paper.yaml``.

    Parameters
    ----------
    name, source : str
    table_1 : dict
        Numbers of Table 1. The unit is part of the key.
    table_2_jump : dict
        Rows of Table 2 by cam.
    table_2_defined : list of str
        Cams of Table 2 whose laws the paper defines.
    """

    name: str
    source: str
    table_1: dict[str, FiniteFloat]
    table_2_jump: dict[str, PublishedJump] = Field(min_length=1)
    table_2_defined: list[str] = Field(min_length=1)

    @model_validator(mode="after")
    def _check_cams(self) -> PublishedTables:
        _require_known("table_2_defined", self.table_2_defined, self.table_2_jump)
        return self
