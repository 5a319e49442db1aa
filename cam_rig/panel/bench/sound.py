"""The sound of the rig for a page: from the samples of each tick, while somebody listens."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np

from cam_rig.acoustics import RadiationParameters, SoundSource
from cam_rig.dynamics import Samples
from cam_rig.units import TURN

#: Least rate (Hz) of the sound, which a browser plays.
LEAST_RATE = 16_000
#: Sound pressure (Pa) that a page's full volume stands for.
FULL_SCALE_PA = 20.0


class PageSound:
    """Renders the contact force of a run, tick by tick, as 32-bit floats of full scale."""

    def __init__(self, radiation: RadiationParameters, sample_rate: int) -> None:
        self._source = SoundSource(radiation, sample_rate, LEAST_RATE)

    @property
    def rate(self) -> int:
        """Samples a second of the sound, Hz."""
        return self._source.rate

    def render(self, message: dict[str, Any], rpm: float) -> bytes:
        """The sound of a tick's samples, at a cam speed (rpm)."""
        data = np.frombuffer(base64.b64decode(message["samples"]), dtype="<f8")
        block = Samples(data.reshape(message["shape"]))
        pressure = self._source.pressure(block.force, block.impulse, rpm * TURN / 60.0)
        return bytes(np.asarray(pressure / FULL_SCALE_PA, dtype="<f4").tobytes())
