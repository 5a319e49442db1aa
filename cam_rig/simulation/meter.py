"""Sound-level meter at the microphone of a scene."""

from __future__ import annotations

from dataclasses import dataclass, field

from cam_rig.acoustics.pressure import SoundSource
from cam_rig.acoustics.sound_level_meter import Reading, SoundLevelMeter
from cam_rig.dynamics import Samples
from cam_rig.simulation.scene import LoadedScene
from cam_rig.units import FloatArray


@dataclass
class MeterSimulator:
    """Simulator of the sound-level meter at the microphone of a scene.

    The microphone node uses it too. If a weighting is changed, a new measurement starts with the
    next block of samples, while the sound continues. No new measurement starts if the weighting is
    changed back before the next block, because a replay of the recording could not repeat it.
    """

    source: SoundSource
    meter: SoundLevelMeter = field(init=False)
    _next: SoundLevelMeter = field(init=False)  #: meter of the next block

    def __post_init__(self) -> None:
        self.meter = self._next = SoundLevelMeter(self.source.rate)

    @classmethod
    def of(cls, loaded: LoadedScene) -> MeterSimulator:
        """Return the simulator of the sound-level meter in a scene."""
        return cls(SoundSource(loaded.radiation, int(loaded.scene.sample_rate.si)))

    @property
    def quantity(self) -> str:
        """Symbol of the next reading in the notation of IEC 61672-1, such as LZF or LAS."""
        return self._next.quantity

    def weigh(self, frequency: str, time: str) -> None:
        """Set the frequency and time weightings for the next block of samples.

        The measurement continues if they are equal to the present weightings.
        """
        requested = SoundLevelMeter(self.source.rate, frequency, time)
        self._next = self.meter if requested.quantity == self.meter.quantity else requested

    def read(self, block_rows: FloatArray, speed: float) -> Reading:
        """Return the meter's reading over a block of samples.

        `block_rows` contains time, lift, velocity, acceleration, contact force and landing impulse
        in SI units, shape (6, n). `speed` is the cam speed in rad/s.
        """
        self.meter, block = self._next, Samples(block_rows)
        return self.meter.read(self.source.pressure(block.force, block.impulse, speed))
