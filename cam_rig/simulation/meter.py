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
    """The sound of a scene at a sound-level meter. Used by the node too.

    Another weighting begins a new measurement with the next block; the sound goes on. One that was
    changed and changed back between two blocks changes nothing, as it could not be repeated.
    """

    source: SoundSource
    meter: SoundLevelMeter = field(init=False)
    _next: SoundLevelMeter = field(init=False)

    def __post_init__(self) -> None:
        self.meter = self._next = SoundLevelMeter(self.source.rate)

    @classmethod
    def of(cls, loaded: LoadedScene) -> MeterSimulator:
        """The meter of a scene."""
        return cls(SoundSource(loaded.radiation, int(loaded.scene.sample_rate.si)))

    @property
    def quantity(self) -> str:
        """What is read next, as IEC 61672-1 writes it: LZF, LAS."""
        return self._next.quantity

    def weigh(self, frequency: str, time: str) -> None:
        """Set the weightings; those that are set already change nothing."""
        wanted = SoundLevelMeter(self.source.rate, frequency, time)
        self._next = self.meter if wanted.quantity == self.meter.quantity else wanted

    def read(self, block_rows: FloatArray, speed: float) -> Reading:
        """The reading over a block, ``(6, n)`` rows, at cam speed ``speed`` (rad/s)."""
        self.meter, block = self._next, Samples(block_rows)
        return self.meter.read(self.source.pressure(block.force, block.impulse, speed))
