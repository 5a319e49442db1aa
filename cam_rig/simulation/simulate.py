"""The scene without ROS: the same core as the nodes, in one process."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from cam_rig.acoustics import MicrophoneState, RadiationParameters, rms_pressure
from cam_rig.arrays import FloatArray
from cam_rig.dynamics import MODELS, Block, FollowerState, Model, Samples
from cam_rig.laws import Law
from cam_rig.simulation.levels import MeasuredTick
from cam_rig.simulation.loaded_scene import LoadedScene
from cam_rig.simulation.schedule import CamState, cam_states
from cam_rig.simulation.tick_samples import TickSamples


@dataclass(frozen=True)
class FollowerCheckpoint:
    """What a follower carries from tick to tick: the last cam state, its own, an impulse owed."""

    last: CamState | None = None
    state: FollowerState | None = None
    owed: float = 0.0


@dataclass
class FollowerSimulator:
    """The follower under the mounted cam: takes cam states, gives blocks. Used by the node too."""

    model: Model
    parameters: Any
    sample_rate: int
    laws: dict[str, Law] = field(default_factory=dict)
    checkpoint: FollowerCheckpoint = field(default_factory=FollowerCheckpoint)

    @classmethod
    def of(cls, loaded: LoadedScene) -> FollowerSimulator:
        """The follower of a scene."""
        model, rate = MODELS[loaded.scene.model], int(loaded.scene.sample_rate.si)
        return cls(model, model.parameters(loaded.rig), rate, dict(loaded.laws))

    def turn_to(self, state: CamState) -> tuple[FollowerState, Block] | None:
        """The tick that ends at ``state``; None at the first state, which only begins one.

        A change of cam puts the follower down on the new one; so does a cam that stood.
        """
        start, before = self.checkpoint.last, self.checkpoint
        if start is None or not start.turns_until(state):
            self.checkpoint = FollowerCheckpoint(state)
            return None
        law = self.laws[start.cam]
        end, block = self.model.advance(
            law, self.parameters, before.state, start.until(state), self.sample_rate
        )
        block = block.with_impulse(before.owed)
        if state.cam == start.cam:
            self.checkpoint = FollowerCheckpoint(state, end)
        else:  # what the cam before gave and no sample has shown
            self.checkpoint = FollowerCheckpoint(state, None, end.pending_impulse)
        return end, block


@dataclass
class MicrophoneSimulator:
    """The microphone with its state: takes blocks, gives r.m.s. pressure. Used by the node too."""

    parameters: RadiationParameters
    sample_rate: int
    state: MicrophoneState | None = None

    @classmethod
    def of(cls, loaded: LoadedScene) -> MicrophoneSimulator:
        """The microphone of a scene."""
        return cls(loaded.radiation, int(loaded.scene.sample_rate.si))

    def listen(self, block_rows: FloatArray, speed: float) -> float:
        """r.m.s. pressure (Pa) over a block, ``(6, n)`` rows, at cam speed ``speed`` (rad/s)."""
        block = Samples(block_rows)
        self.state, pressure = rms_pressure(
            self.parameters, self.state, block.force, block.impulse, self.sample_rate, speed
        )
        return pressure


def turned_ticks(loaded: LoadedScene, begin: FollowerState | None = None) -> Iterator[TickSamples]:
    """The follower's samples of a scene tick by tick, with the cam that turned under it.

    ``begin`` is the follower where the scene begins, None for one put down on the cam.
    """
    follower = FollowerSimulator.of(loaded)
    start: CamState | None = None
    for state in cam_states(loaded.scene):
        turned = follower.turn_to(state)
        if start is None:
            follower.checkpoint = FollowerCheckpoint(state, begin)
        if turned is not None and start is not None:
            yield TickSamples(start, turned[1].interval, turned[1].rows)
        start = state


def simulate(
    loaded: LoadedScene,
    take: Callable[[TickSamples], None] = lambda _: None,
    begin: FollowerState | None = None,
) -> Iterator[MeasuredTick]:
    """Run the scene tick by tick; ``take`` gets each tick's samples, which are not kept.

    ``begin`` as of `turned_ticks`.
    """
    microphone = MicrophoneSimulator.of(loaded)
    for tick in turned_ticks(loaded, begin):
        take(tick)
        pressure = microphone.listen(tick.rows, tick.interval.mean_speed)
        count = tick.rows.shape[1]
        yield MeasuredTick(tick.start, tick.interval.stop_ns, pressure, count, tick.steady)
