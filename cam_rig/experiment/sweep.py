"""The scene without ROS: the same core as the nodes, in one process."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from cam_rig.acoustics import MicrophoneState, RadiationParameters, hear
from cam_rig.dynamics import MODELS, Block, FloatArray, FollowerState, Model
from cam_rig.experiment.noise import HeardTick
from cam_rig.experiment.program import CamState, cam_states
from cam_rig.experiment.stage import Stage
from cam_rig.laws import Law


@dataclass
class FollowerBench:
    """The follower under the mounted cam: takes cam states, gives blocks. Used by the node too."""

    model: Model
    parameters: Any
    sample_rate: int
    laws: dict[str, Law] = field(default_factory=dict)
    _last: CamState | None = None
    _state: FollowerState | None = None
    _owed: float = 0.0

    @classmethod
    def of(cls, stage: Stage) -> FollowerBench:
        """The follower of a scene."""
        model, rate = MODELS[stage.scene.model], int(stage.scene.sample_rate.si)
        return cls(model, model.parameters(stage.rig), rate, dict(stage.laws))

    def turn_to(self, state: CamState) -> tuple[FollowerState, Block] | None:
        """The tick that ends at ``state``; None at the first state, which only begins one.

        A change of cam puts the follower down on the new one.
        """
        start, self._last = self._last, state
        if start is None or start.speed == 0.0:
            return None
        law = self.laws[start.cam]
        end, block = self.model.advance(
            law, self.parameters, self._state, start.until(state), self.sample_rate
        )
        block.rows[5, 0] += self._owed
        same = state.cam == start.cam
        self._state = end if same else None
        self._owed = 0.0 if same else end.pending_impulse  # struck by the cam before
        return end, block


@dataclass
class MicrophoneBench:
    """The microphone with its memory: takes blocks, gives r.m.s. pressure. Used by the node too."""

    parameters: RadiationParameters
    sample_rate: int
    _state: MicrophoneState | None = None

    @classmethod
    def of(cls, stage: Stage) -> MicrophoneBench:
        """The microphone of a scene."""
        return cls(stage.radiation, int(stage.scene.sample_rate.si))

    def listen(self, block_rows: FloatArray, speed: float) -> float:
        """r.m.s. pressure (Pa) over a block, ``(6, n)`` rows, at cam speed ``speed`` (rad/s)."""
        self._state, pressure = hear(
            self.parameters, self._state, block_rows[4], block_rows[5], self.sample_rate, speed
        )
        return pressure


def simulate(stage: Stage) -> Iterator[HeardTick]:
    """Run the scene tick by tick."""
    follower, microphone = FollowerBench.of(stage), MicrophoneBench.of(stage)
    start: CamState | None = None
    for state in cam_states(stage.scene):
        turned = follower.turn_to(state)
        if turned is not None and start is not None:
            pressure = microphone.listen(turned[1].rows, start.speed)
            yield HeardTick(start, state.time_ns, pressure)
        start = state
