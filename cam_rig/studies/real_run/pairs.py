"""What was measured and what the model has, at the same instants."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cam_rig.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class PairedSignal:
    """One quantity, measured and of the model.

    Parameters
    ----------
    time : s, ``(n,)``, on the clock of the cam angle
    angle : cam angle with all its turns, rad, ``(n,)``
    measured, model : the quantity at these instants, SI, ``(n,)``
    beside_jump : ``(n,)``, whether the model jumps close by; None: nowhere
    """

    time: FloatArray
    angle: FloatArray
    measured: FloatArray
    model: FloatArray
    beside_jump: NDArray[np.bool_] | None = None

    def calm(self) -> PairedSignal:
        """The readings that are not beside a jump."""
        if self.beside_jump is None:
            return self
        kept = ~self.beside_jump
        return PairedSignal(
            self.time[kept], self.angle[kept], self.measured[kept], self.model[kept]
        )

    @property
    def difference(self) -> FloatArray:
        """Measured less model."""
        return self.measured - self.model


@dataclass(frozen=True, eq=False)
class PairedStep:
    """The settled turns of one cam at one speed.

    Parameters
    ----------
    rpm : mean speed
    turns : how many settled turns
    lift, force : None where it was not measured
    levels : measured and of the model, dB re 20 µPa; None where there is none
    exact : whether the model was driven with the very states of the cam, sample by sample
    """

    cam: str
    rpm: float
    turns: float
    lift: PairedSignal | None
    force: PairedSignal | None
    levels: tuple[float | None, float | None] = (None, None)
    exact: bool = False
