"""What stands before the follower to listen: blocks of a run in, meter readings or sound out."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from cam_rig.acoustics import Reading, SoundLevelMeter, SoundSource
from cam_rig.acoustics.pressure_samples import SourceState
from cam_rig.acoustics.sound_level_meter import MeterState
from cam_rig.arrays import FloatArray
from cam_rig.dynamics import Samples
from cam_rig.schema import SceneConfig
from cam_rig.simulation.loaded_scene import LoadedScene
from cam_rig.simulation.schedule import cam_states
from cam_rig.simulation.simulate import FollowerSimulator


@dataclass(frozen=True, eq=False)
class MeterSimulatorState:
    """The state of sound source and meter, and what is read next, as LZF."""

    source: SourceState
    meter: MeterState
    next: str


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

    @property
    def state(self) -> MeterSimulatorState:
        """Its state, for a node that is started again."""
        return MeterSimulatorState(self.source.state, self.meter.state, self.quantity)

    @state.setter
    def state(self, state: MeterSimulatorState) -> None:
        self.source.state = state.source
        self.meter = self._next = SoundLevelMeter.from_state(self.source.rate, state.meter)
        self.weigh(*state.next.removeprefix("L"))

    def weigh(self, frequency: str, time: str) -> None:
        """Set the weightings; those that are set already change nothing.

        Raises
        ------
        ConfigError : a weighting that the standard does not have
        """
        wanted = SoundLevelMeter(self.source.rate, frequency, time)
        self._next = self.meter if wanted.quantity == self.meter.quantity else wanted

    def read(self, block_rows: FloatArray, speed: float) -> Reading:
        """The reading over a block, ``(6, n)`` rows, at cam speed ``speed`` (rad/s)."""
        self.meter, block = self._next, Samples(block_rows)
        return self.meter.read(self.source.pressure(block.force, block.impulse, speed))


def audition(
    loaded: LoadedScene, cam: str | None, rpm: float | None, seconds: float, rate: int
) -> LoadedScene:
    """The scene as it is listened to: sampled at ``rate`` Hz, one cam or one speed of it.

    Parameters
    ----------
    cam : one cam of the scene, or None for all
    rpm : one speed, held for whole turns that last at least ``seconds``; None for the program

    Raises
    ------
    ConfigError : the scene has no such cam
    """
    if cam is not None:
        loaded = loaded.only(cam, loaded.law_of(cam))
    data = loaded.scene.model_dump(exclude_none=True)
    data["sample_rate"] = {"assumed": rate, "unit": "Hz"}
    if rpm is not None:
        turns = max(1, math.ceil(seconds * rpm / 60.0))
        data["program"]["speeds"] = {"assumed": [rpm], "unit": "rpm"}
        data["program"]["turns"] = {"assumed": turns, "unit": "turns"}
        data["program"]["settle_turns"] = {"assumed": 0, "unit": "turns"}
    return replace(loaded, scene=SceneConfig.model_validate(data))


def sounds(loaded: LoadedScene, source: SoundSource) -> Iterator[FloatArray]:
    """Sound pressure (Pa) of each tick of a scene, at the rate of ``source``."""
    follower = FollowerSimulator.of(loaded)
    for state in cam_states(loaded.scene):
        turned = follower.turn_to(state)
        if turned is not None:
            block = turned[1]
            yield source.pressure(block.force, block.impulse, block.interval.mean_speed)
