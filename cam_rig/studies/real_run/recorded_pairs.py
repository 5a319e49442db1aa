"""A recording of the rig beside the model: the cam's exact states, sample by sample."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import chain

import numpy as np

from cam_rig.acoustics import level_db
from cam_rig.arrays import FloatArray
from cam_rig.dynamics import ANGLE_TOLERANCE
from cam_rig.errors import ConfigError, did_you_mean
from cam_rig.simulation.levels import Settling
from cam_rig.simulation.loaded_scene import LoadedScene
from cam_rig.simulation.schedule import CamState
from cam_rig.simulation.simulate import (
    FollowerCheckpoint,
    FollowerSimulator,
    MicrophoneSimulator,
)
from cam_rig.simulation.tick_samples import TickSamples
from cam_rig.studies.real_run.pairs import PairedSignal, PairedStep
from cam_rig.units import TURN, to_rpm


@dataclass(frozen=True, eq=False)
class _ModelTick:
    """A tick of the model, its sound pressure (Pa), and where it was put down after a loss."""

    samples: TickSamples
    pressure: float
    put_down: CamState | None


@dataclass
class _StepParts:
    """One cam at one speed, as its ticks come: rows time, angle, then lifts and forces."""

    cam: str
    speed: float
    rows: list[FloatArray] = field(default_factory=list)
    turned: float = 0.0
    #: Squares of both pressures times samples, and the samples.
    energy: FloatArray = field(default_factory=lambda: np.zeros(3))

    def step(self) -> PairedStep:
        time, angle, lift, model_lift, force, model_force = np.hstack(self.rows)
        levels: tuple[float | None, float | None] = (None, None)
        if self.energy[2]:
            both = level_db(np.sqrt(self.energy[:2] / self.energy[2]))
            levels = float(both[0]), float(both[1])
        return PairedStep(
            self.cam,
            round(to_rpm(self.speed), 9),
            self.turned / TURN,
            PairedSignal(time, angle, lift, model_lift),
            PairedSignal(time, angle, force, model_force),
            levels,
            exact=True,
        )


@dataclass
class RecordedPairs:
    """The steps of a recording, one after another; no more than one is held.

    Parameters
    ----------
    loaded : the scene whose rig, model and laws are compared
    cam : only this cam
    lost : how many ticks have no samples in the bag; known at the end
    """

    loaded: LoadedScene
    cam: str | None = None
    lost: int = 0

    def steps(
        self,
        ticks: Iterable[TickSamples],
        states: Iterable[CamState],
        pressures: dict[int, float],
    ) -> Iterator[PairedStep]:
        """Pair the settled turns of each cam and speed.

        Parameters
        ----------
        ticks, states : of the bag, in order
        pressures : measured r.m.s. pressure (Pa) by the stamp (ns) of the tick's end

        Raises
        ------
        ConfigError : the bag holds a cam that the scene has not
        """
        settle = self.loaded.scene.program.settle_turns.si
        settling, parts = Settling(settle), None
        for tick, model in self._both(ticks, states):
            key = tick.cam, tick.start.speed
            if parts is not None and (key != (parts.cam, parts.speed) or not tick.steady):
                yield from [parts.step()] if parts.rows else []
                parts = None
            settled = settling.is_over(tick.start, tick.steady)
            if not settled:
                continue
            down = model.put_down
            if down is not None and tick.start.since(down) / TURN <= settle - 1e-6:
                continue
            parts = parts or _StepParts(*key)
            _take(parts, tick, model, pressures)
        if parts is not None and parts.rows:
            yield parts.step()

    def _both(
        self, ticks: Iterable[TickSamples], states: Iterable[CamState]
    ) -> Iterator[tuple[TickSamples, _ModelTick]]:
        """Each tick of the bag with the model's that begins with the same state."""
        ticks = iter(ticks)
        first = next(ticks, None)
        if first is None:
            return
        rate = round(1.0 / float(np.diff(first.time).mean())) if first.time.size > 1 else 0
        models = self._model(states, rate or int(self.loaded.scene.sample_rate.si))
        here, used = next(models, None), False
        for tick in chain([first], ticks):
            while here is not None and here.samples.start.time_ns < tick.start.time_ns:
                self.lost += not used
                here, used = next(models, None), False
            if here is not None and here.samples.start == tick.start:
                used = True
                yield tick, here

    def _model(self, states: Iterable[CamState], rate: int) -> Iterator[_ModelTick]:
        """The scene's model, driven with the states; put down anew where some are missing."""
        follower, microphone = (
            FollowerSimulator.of(self.loaded),
            MicrophoneSimulator.of(self.loaded),
        )
        follower.sample_rate = microphone.sample_rate = rate
        start: CamState | None = None
        put_down: CamState | None = None
        for state in states:
            if start is None and not self._takes(state.cam):
                continue
            if start is not None and start.turns_until(state) and not _joined(start, state):
                follower.checkpoint, put_down = FollowerCheckpoint(), state
            turned = follower.turn_to(state)
            if turned is not None and start is not None:
                block = turned[1]
                pressure = microphone.listen(block.rows, block.interval.mean_speed)
                samples = TickSamples(start, block.interval, block.rows)
                yield _ModelTick(samples, pressure, put_down)
            start = state
            if not self._takes(state.cam):  # it ended the last tick of the cam before
                start, follower.checkpoint = None, FollowerCheckpoint()

    def _takes(self, cam: str) -> bool:
        """Whether a cam is compared; one that is must be in the scene."""
        if self.cam is not None and cam != self.cam:
            return False
        if cam not in self.loaded.laws:
            there = list(self.loaded.laws)
            raise ConfigError(
                f"{self.loaded.scene_file}: has no cam {cam!r}, which the bag holds; allowed: a "
                f"scene that has it; this one has {', '.join(there)}{did_you_mean(cam, there)}"
            )
        return True


def _joined(start: CamState, end: CamState) -> bool:
    """Whether one held speed or one ramp leads from state to state; else some are missing."""
    interval = start.until(end)
    off = interval.angle_at(interval.duration) - interval.angle - end.since(start)
    return abs(off) <= ANGLE_TOLERANCE


def _take(
    parts: _StepParts, tick: TickSamples, model: _ModelTick, pressures: dict[int, float]
) -> None:
    """Note the samples that both have; of a tick whose end is lost, the bag has several."""
    rows = model.samples.rows
    step = 1.0 if tick.time.size < 2 else float(np.diff(tick.time).mean())
    first = round((tick.time[0] - rows[0, 0]) / step)
    rows = rows[:, first : first + tick.time.size]
    if first < 0 or rows.shape[1] != tick.time.size:
        return
    lifts, forces = (tick.lift, rows[1]), (tick.force, rows[4])
    parts.rows.append(np.stack([tick.time, tick.angle, *lifts, *forces]))
    parts.turned += tick.turned(round(1.0 / step)) if tick.time.size > 1 else 0.0
    measured = pressures.get(model.samples.interval.stop_ns)
    if measured is not None:
        count = model.samples.time.size
        parts.energy += np.array([measured**2, model.pressure**2, 1.0]) * count
