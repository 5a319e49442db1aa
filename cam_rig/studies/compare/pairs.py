"""A recording of the rig beside the model: the cam's exact states, sample by sample."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain

import numpy as np

from cam_rig.acoustics import level_db
from cam_rig.dynamics import ANGLE_TOLERANCE
from cam_rig.errors import BagError, ConfigError, did_you_mean
from cam_rig.simulation.instruments import MeasuredRun, Signal, encoder_count
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.schedule import CamState
from cam_rig.simulation.simulate import (
    FollowerSimulator,
    MicrophoneSimulator,
    Settling,
    TickSamples,
)
from cam_rig.studies.compare.alignment import Alignment, find_alignment
from cam_rig.studies.compare.deviation import PairedSignal, PairedStep
from cam_rig.studies.compare.model_run import (
    ModelRun,
    SteadyStretch,
    drive,
    standstills,
    steady_stretches,
)
from cam_rig.units import TURN, FloatArray, to_rpm

#: A tick of the model, its sound pressure (Pa), and where it was put down after a loss.
ModelTick = tuple[TickSamples, float | None, CamState | None]


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
    """The steps of a recording, only of ``cam`` if given; ``lost`` ticks are known at the end."""

    loaded: LoadedScene
    cam: str | None = None
    lost: int = 0

    def steps(
        self, ticks: Iterable[TickSamples], states: Iterable[CamState], pressures: dict[int, float]
    ) -> Iterator[PairedStep]:
        """Pair the settled turns of each cam and speed.

        ``ticks``, ``states``: of the bag, in order; ``pressures``: measured r.m.s. pressure (Pa) by
        the stamp (ns) of the tick's end.
        """
        settle = self.loaded.scene.program.settle_turns.si
        settling, parts = Settling(settle), None
        for tick, model in self._both(ticks, states):
            key = tick.cam, tick.start.speed
            if parts is not None and (key != (parts.cam, parts.speed) or not tick.steady):
                yield from [parts.step()] if parts.rows else []
                parts = None
            if not settling.is_over(tick.start, tick.steady):
                continue
            down = model[2]
            if down is not None and tick.start.since(down) / TURN <= settle - 1e-6:
                continue
            parts = parts or _StepParts(*key)
            _take(parts, tick, model, pressures)
        if parts is not None and parts.rows:
            yield parts.step()

    def _both(
        self, ticks: Iterable[TickSamples], states: Iterable[CamState]
    ) -> Iterator[tuple[TickSamples, ModelTick]]:
        ticks = iter(ticks)
        first = next(ticks, None)
        if first is None:
            return
        rate = round(1.0 / float(np.diff(first.time).mean())) if first.time.size > 1 else 0
        models = self._model(states, rate or int(self.loaded.scene.sample_rate.si))
        here, used = next(models, None), False
        for tick in chain([first], ticks):
            while here is not None and here[0].start.time_ns < tick.start.time_ns:
                self.lost += not used
                here, used = next(models, None), False
            if here is not None and here[0].start == tick.start:
                used = True
                yield tick, here

    def _model(self, states: Iterable[CamState], rate: int) -> Iterator[ModelTick]:
        """The scene's model, driven with the states; put down anew where some are missing."""
        follower = FollowerSimulator.of(self.loaded)
        microphone = None
        if not self.loaded.missing_for_sound:
            microphone = MicrophoneSimulator.of(self.loaded)
            microphone.sample_rate = rate
        follower.sample_rate = rate
        start: CamState | None = None
        put_down: CamState | None = None
        for state in states:
            if start is None and not self._takes(state.cam):
                continue
            if start is not None and start.turns_until(state) and not _joined(start, state):
                follower.put_down()
                put_down = state
            turned = follower.turn_to(state)
            if turned is not None and start is not None:
                block = turned[1]
                pressure = None
                if microphone is not None:
                    pressure = microphone.listen(block.rows, block.interval.mean_speed)
                yield TickSamples(start, block.interval, block.rows), pressure, put_down
            start = state
            if not self._takes(state.cam):  # it ended the last tick of the cam before
                start = None
                follower.put_down()

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
    parts: _StepParts, tick: TickSamples, model: ModelTick, pressures: dict[int, float]
) -> None:
    """Note the samples that both have; of a tick whose end is lost, the bag has several."""
    samples, pressure, _ = model
    step = 1.0 if tick.time.size < 2 else float(np.diff(tick.time).mean())
    first = round((tick.time[0] - samples.rows[0, 0]) / step)
    rows = samples.rows[:, first : first + tick.time.size]
    if first < 0 or rows.shape[1] != tick.time.size:
        return
    parts.rows.append(np.stack([tick.time, tick.angle, tick.lift, rows[1], tick.force, rows[4]]))
    parts.turned += tick.turned(round(1.0 / step)) if tick.time.size > 1 else 0.0
    measured = pressures.get(samples.interval.stop_ns)
    if measured is not None and pressure is not None:
        parts.energy += np.array([measured**2, pressure**2, 1.0]) * samples.time.size


# A run of any bench beside the model: the cam's motion through the readings of its angle.

#: Settled turns of a speed, at least.
LEAST_TURNS = 2.0
#: Readings of a quantity at a speed, at least.
LEAST_READINGS = 32
#: A force that changes by this part of its range within so much cam angle (rad) jumps.
JUMP, JUMP_ANGLE = 0.1, np.radians(0.5)
#: The r.m.s. of rounding is 0.29 counts.
LEAST_ROUNDING = 0.1


@dataclass(frozen=True, eq=False)
class MeasuredPairs:
    """A measured run on a scene's model; ``given``: True if the encoder's zero was given."""

    run: MeasuredRun
    loaded: LoadedScene
    cam: str
    stretches: tuple[SteadyStretch, ...]
    alignment: Alignment
    given: bool = False

    @property
    def count(self) -> float:
        """The encoder's resolution, rad; 0 where the motion goes through all its values."""
        count = encoder_count(self.run.angle.value)
        rounded = any(stretch.scatter > LEAST_ROUNDING * count for stretch in self.stretches)
        return count if rounded else 0.0

    @property
    def left_out(self) -> float:
        """Fraction of the time without steady turns, which are not compared; pauses do not count.

        A pause is a gap in the readings, or a time in which the cam stands still.
        """
        angle = self.run.angle
        pauses = sum(float(stop - start) for start, stop in (*angle.gaps(), *standstills(angle)))
        whole = float(angle.time[-1] - angle.time[0]) - pauses
        compared = sum(float(one.knots[-1] - one.knots[0]) for one in self.stretches)
        return max(0.0, 1.0 - compared / whole)

    def steps(self) -> Iterator[PairedStep]:
        """The settled turns of each stretch, slowest first."""
        settle = self.loaded.scene.program.settle_turns.si
        for stretch in sorted(self.stretches, key=lambda one: one.mean_speed):
            model = drive(self.loaded, self.cam, stretch, self.alignment.offset)
            force = self._pair(self.run.force, model, 4)
            yield PairedStep(
                self.cam,
                stretch.rpm,
                stretch.turns - settle,
                self._pair(self.run.lift, model, 1, self.alignment.zero),
                force and _with_jumps(force, model),
                (self._measured_level(model), model.level()),
            )

    def _pair(
        self, signal: Signal | None, model: ModelRun, row: int, zero: float = 0.0
    ) -> PairedSignal | None:
        if signal is None:
            return None
        time = self.alignment.on_cam_clock(signal.time)
        end = min(float(model.stretch.knots[-1]), model.rows[0, -1])
        inside = (time >= model.begin) & (time <= end)
        if np.count_nonzero(inside) < LEAST_READINGS:
            return None
        time = time[inside]
        angle = model.stretch.at(time) + self.alignment.offset
        modelled = np.interp(time, model.rows[0], model.rows[row])
        return PairedSignal(time, angle, signal.value[inside] - zero, modelled)

    def _measured_level(self, model: ModelRun) -> float | None:
        if self.run.level is None:
            return None
        time = self.alignment.on_cam_clock(self.run.level.time)
        inside = (time >= model.begin) & (time <= model.stretch.knots[-1])
        if not inside.any():
            return None
        levels = self.run.level.value[inside]
        top = float(levels.max())
        return top + float(10.0 * np.log10(np.mean(10.0 ** (0.1 * (levels - top)))))


def _with_jumps(pair: PairedSignal, model: ModelRun) -> PairedSignal:
    """The force with a mark where the model's jumps: there the events' times count."""
    near = max(JUMP_ANGLE / model.stretch.mean_speed, 2.0 * float(np.diff(model.rows[0, :2])[0]))
    around = [
        np.interp(pair.time + part * near, model.rows[0], model.rows[4])
        for part in (-1.0, -0.5, 0.0, 0.5, 1.0)
    ]
    beside = np.ptp(around, axis=0) > JUMP * float(np.ptp(pair.model))
    if np.count_nonzero(~beside) < LEAST_READINGS:
        return pair
    return replace(pair, beside_jump=beside)


def pair_measured(
    run: MeasuredRun, loaded: LoadedScene, cam: str, offset: float | None = None
) -> MeasuredPairs:
    """Find a run's steady turns, and how its readings lie on them; ``offset`` None: by the lift."""
    loaded.law_of(cam)
    settle = loaded.scene.program.settle_turns.si
    stretches = tuple(steady_stretches(run.angle, settle + LEAST_TURNS))
    if not stretches:
        raise BagError(
            f"{run.source}: {run.angle.source}: nowhere {settle + LEAST_TURNS:g} turns at a speed "
            f"that is held within 2 %; allowed: {settle:g} turns to settle, as scene "
            f"{loaded.scene.name} says, and {LEAST_TURNS:g} to compare"
        )
    pairs = MeasuredPairs(run, loaded, cam, stretches, Alignment(offset or 0.0), offset is not None)
    if run.lift is None:
        return pairs
    driven = partial(drive, loaded, cam)
    return replace(
        pairs, alignment=find_alignment(stretches, run.lift, driven, offset, pairs.count)
    )
