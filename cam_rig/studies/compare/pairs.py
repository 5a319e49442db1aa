"""Pairs of measured and modelled signals, from bags of the rig or of a test bench."""

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
    TickSamples,
    TransientFilter,
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

#: Result of the model in one tick, the time between two cam states: its samples, their r.m.s. sound
#: pressure (Pa) or None, and the cam state at which the model's follower was last placed on the cam
#: again because recorded states were missing (None if never).
ModelTick = tuple[TickSamples, float | None, CamState | None]


@dataclass
class _StepParts:
    """Samples of one cam at one speed, collected tick by tick.

    A tick is the time between two cam states. Each array in `rows` has the rows time (s), angle
    (rad), lift (m), modelled lift, force (N), modelled force. `speed` is the cam speed (rad/s).
    `turned` is the cam angle (rad) by which the cam turned in the collected ticks.
    """

    cam: str
    speed: float
    rows: list[FloatArray] = field(default_factory=list)
    turned: float = 0.0
    #: Sums of the measured and of the modelled squared pressure (Pa²), and number of samples.
    energy: FloatArray = field(default_factory=lambda: np.zeros(3))

    def step(self) -> PairedStep:
        """Return the collected samples as pairs of measured and modelled values."""
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
    """Pairs of recorded and modelled values, from a recording of the rig.

    The pairs are those of all cams, or only of `cam`. `lost` is the number of ticks of the model
    without samples in the bag. It is valid after `steps` is exhausted. A tick is the time between
    two cam states.
    """

    loaded: LoadedScene
    cam: str | None = None
    lost: int = 0

    def steps(
        self, ticks: Iterable[TickSamples], states: Iterable[CamState], pressures: dict[int, float]
    ) -> Iterator[PairedStep]:
        """Yield the settled turns of each cam and speed as pairs.

        The values are measured and modelled. `ticks` and `states` are those of the bag in their
        order. `pressures` is the measured r.m.s. pressure (Pa) by the stamp (ns) of the tick's end.
        A tick is the time between two cam states.
        """
        settle = self.loaded.scene.schedule.transient_turns.si
        settling, parts = TransientFilter(settle), None
        for tick, model in self._match_ticks(ticks, states):
            key = tick.cam, tick.start.speed
            if parts is not None and (key != (parts.cam, parts.speed) or not tick.steady):
                yield from [parts.step()] if parts.rows else []
                parts = None
            if not settling.is_over(tick.start, tick.steady):
                continue
            placed = model[2]
            if placed is not None and tick.start.since(placed) / TURN <= settle - 1e-6:
                continue
            parts = parts or _StepParts(*key)
            _add_tick(parts, tick, model, pressures)
        if parts is not None and parts.rows:
            yield parts.step()

    def _match_ticks(
        self, ticks: Iterable[TickSamples], states: Iterable[CamState]
    ) -> Iterator[tuple[TickSamples, ModelTick]]:
        """Yield each recorded tick with the tick of the model that has the same start.

        A tick is the time between two successive cam states. Ticks without a counterpart are
        skipped, and `lost` counts those of the model.
        """
        ticks = iter(ticks)
        first = next(ticks, None)
        if first is None:
            return
        rate = round(1.0 / float(np.diff(first.time).mean())) if first.time.size > 1 else 0
        models = self._drive_model(states, rate or int(self.loaded.scene.sample_rate.si))
        current, is_used = next(models, None), False
        for tick in chain([first], ticks):
            while current is not None and current[0].start.time_ns < tick.start.time_ns:
                self.lost += not is_used
                current, is_used = next(models, None), False
            if current is not None and current[0].start == tick.start:
                is_used = True
                yield tick, current

    def _drive_model(self, states: Iterable[CamState], rate: int) -> Iterator[ModelTick]:
        """Yield the ticks of the scene's model, driven with the recorded cam states.

        A tick is the time between two successive cam states. If states are missing, the follower is
        placed on the cam again. ``rate`` is the sample rate in Hz.
        """
        follower = FollowerSimulator.of(self.loaded)
        microphone = None
        if not self.loaded.missing_for_sound:
            microphone = MicrophoneSimulator.of(self.loaded)
            microphone.sample_rate = rate
        follower.sample_rate = rate
        start: CamState | None = None
        placed: CamState | None = None
        for state in states:
            if start is None and not self._is_compared(state.cam):
                continue
            if start is not None and start.turns_until(state) and not _is_continuous(start, state):
                follower.continue_from()
                placed = state
            turned = follower.turn_to(state)
            if turned is not None and start is not None:
                block = turned[1]
                pressure = None
                if microphone is not None:
                    pressure = microphone.listen(block.rows, block.interval.mean_speed)
                yield TickSamples(start, block.interval, block.rows), pressure, placed
            start = state
            if not self._is_compared(state.cam):  # this state only ends the previous cam's tick
                start = None
                follower.continue_from()

    def _is_compared(self, cam: str) -> bool:
        """Return True if a cam of the bag is part of the comparison.

        Raises
        ------
        ConfigError
            If the cam is part of the comparison, but not of the scene.
        """
        if self.cam is not None and cam != self.cam:
            return False
        if cam not in self.loaded.laws:
            cams = list(self.loaded.laws)
            raise ConfigError(
                f"{self.loaded.scene_file}: the scene must have the cam {cam!r} of the bag, got "
                f"{', '.join(cams)}{did_you_mean(cam, cams)}"
            )
        return True


def _is_continuous(start: CamState, end: CamState) -> bool:
    """Return True if a constant speed or one ramp leads from one cam state to another.

    Otherwise states between them are missing in the bag.
    """
    interval = start.until(end)
    deviation = interval.angle_at(interval.duration) - interval.angle - end.since(start)
    return abs(deviation) <= ANGLE_TOLERANCE


def _add_tick(
    parts: _StepParts, tick: TickSamples, model: ModelTick, pressures: dict[int, float]
) -> None:
    """Add the samples that a recorded tick and a tick of the model have in common.

    A tick is the time between two successive cam states. `pressures` are the recorded r.m.s.
    pressures (Pa) by stamp (ns). A recorded tick may contain only some of the samples of the
    model's tick, if the message of a tick's end is lost.
    """
    samples, pressure, _ = model
    step = 1.0 if tick.time.size < 2 else float(np.diff(tick.time).mean())
    first = round((tick.time[0] - samples.rows[0, 0]) / step)
    rows = samples.rows[:, first : first + tick.time.size]
    if first < 0 or rows.shape[1] != tick.time.size:
        return
    parts.rows.append(np.stack([tick.time, tick.angle, tick.lift, rows[1], tick.force, rows[4]]))
    parts.turned += tick.angle_span(round(1.0 / step)) if tick.time.size > 1 else 0.0
    measured = pressures.get(samples.interval.stop_ns)
    if measured is not None and pressure is not None:
        parts.energy += np.array([measured**2, pressure**2, 1.0]) * samples.time.size


# Pairs from a test bench: the motion of the cam is fitted to the readings of its angle.
#: Smallest number of settled turns at a speed that is compared.
MIN_TURNS = 2.0
#: Smallest number of readings of a quantity at a speed that is compared.
MIN_READINGS = 32
#: Change of the model's force within `JUMP_ANGLE` of a reading that counts as a jump, as a fraction
#: of the force's range.
JUMP_FRACTION = 0.1
#: Cam angle (rad) before and after a reading within which a jump of the model's force excludes the
#: reading from the comparison.
JUMP_ANGLE = np.radians(0.5)
#: If the r.m.s. distance of the angle readings from the fitted motion exceeds this number of
#: encoder counts, the readings are taken as rounded to whole counts. Rounding alone gives 0.29.
MIN_ROUNDING_COUNTS = 0.1


@dataclass(frozen=True, eq=False)
class MeasuredPairs:
    """Pairs of measured and modelled values, from a run on a test bench.

    `stretches` are the times of steady cam speed. `is_offset_given` is True if the encoder's zero
    was given by the user.
    """

    run: MeasuredRun
    loaded: LoadedScene
    cam: str
    stretches: tuple[SteadyStretch, ...]
    alignment: Alignment
    is_offset_given: bool = False

    @property
    def count(self) -> float:
        """Resolution of the encoder (rad).

        It is 0 if the fitted motion passes through all readings, so that rounding is not visible.
        """
        count = encoder_count(self.run.angle.value)
        is_rounded = any(part.scatter > MIN_ROUNDING_COUNTS * count for part in self.stretches)
        return count if is_rounded else 0.0

    @property
    def excluded(self) -> float:
        """Fraction of the time that is not compared because the speed is not steady.

        Pauses do not count as time. A pause is a gap in the readings, or a time in which the cam is
        stopped.
        """
        angle = self.run.angle
        pauses = sum(float(stop - start) for start, stop in (*angle.gaps(), *standstills(angle)))
        duration = float(angle.time[-1] - angle.time[0]) - pauses
        compared = sum(float(stretch.knots[-1] - stretch.knots[0]) for stretch in self.stretches)
        return max(0.0, 1.0 - compared / duration)

    def steps(self) -> Iterator[PairedStep]:
        """Yield the settled turns at each steady speed as pairs, the slowest speed first."""
        settle = self.loaded.scene.schedule.transient_turns.si
        for stretch in sorted(self.stretches, key=lambda stretch: stretch.mean_speed):
            model = drive(self.loaded, self.cam, stretch, self.alignment.offset)
            force = self._pair(self.run.force, model, 4)
            yield PairedStep(
                self.cam,
                stretch.rpm,
                stretch.turns - settle,
                self._pair(self.run.lift, model, 1, self.alignment.zero),
                force and _mark_jumps(force, model),
                (self._measured_level(model), model.level()),
            )

    def _pair(
        self, signal: Signal | None, model: ModelRun, row: int, zero: float = 0.0
    ) -> PairedSignal | None:
        """Return a measured signal with the model's values at the same times.

        Only settled turns are included. ``row`` is the row of the quantity in the model's samples,
        ``zero`` is subtracted from the readings. The result is None if there are fewer than
        `MIN_READINGS`.
        """
        if signal is None:
            return None
        time = self.alignment.on_cam_clock(signal.time)
        end = min(float(model.stretch.knots[-1]), model.rows[0, -1])
        inside = (time >= model.start) & (time <= end)
        if np.count_nonzero(inside) < MIN_READINGS:
            return None
        time = time[inside]
        angle = model.stretch.angle_at(time) + self.alignment.offset
        modelled = np.interp(time, model.rows[0], model.rows[row])
        return PairedSignal(time, angle, signal.value[inside] - zero, modelled)

    def _measured_level(self, model: ModelRun) -> float | None:
        """Return the measured sound level (dB) of the settled turns as an energy mean.

        It is None if the level was not measured.
        """
        if self.run.level is None:
            return None
        time = self.alignment.on_cam_clock(self.run.level.time)
        inside = (time >= model.start) & (time <= model.stretch.knots[-1])
        if not inside.any():
            return None
        levels = self.run.level.value[inside]
        highest = float(levels.max())
        return highest + float(10.0 * np.log10(np.mean(10.0 ** (0.1 * (levels - highest)))))


def _mark_jumps(pair: PairedSignal, model: ModelRun) -> PairedSignal:
    """Return a force signal in which readings near a jump of the model are marked.

    Near a jump, a small error in the time of a landing changes the force completely. The marked
    readings are left out of the comparison. The signal is returned unmarked if too few readings
    would remain.
    """
    width = max(JUMP_ANGLE / model.stretch.mean_speed, 2.0 * float(np.diff(model.rows[0, :2])[0]))
    around = [
        np.interp(pair.time + fraction * width, model.rows[0], model.rows[4])
        for fraction in (-1.0, -0.5, 0.0, 0.5, 1.0)
    ]
    near_jump = np.ptp(around, axis=0) > JUMP_FRACTION * float(np.ptp(pair.model))
    if np.count_nonzero(~near_jump) < MIN_READINGS:
        return pair
    return replace(pair, near_jump=near_jump)


def pair_measured(
    run: MeasuredRun, loaded: LoadedScene, cam: str, offset: float | None = None
) -> MeasuredPairs:
    """Find the steady turns of a run, and align its readings with the cam.

    Parameters
    ----------
    run : MeasuredRun
        The measured run.
    loaded : LoadedScene
        The scene of the model.
    cam : str
        Name of the cam.
    offset : float, optional
        Cam angle minus encoder angle in rad (default: identified from the lift).

    Raises
    ------
    BagError
        If the run has no steady turns after the turns that are needed to settle.
    """
    loaded.law_of(cam)
    settle = loaded.scene.schedule.transient_turns.si
    stretches = tuple(steady_stretches(run.angle, settle + MIN_TURNS))
    if not stretches:
        raise BagError(
            f"{run.source}: {run.angle.source}: no {settle + MIN_TURNS:g} successive turns at "
            f"one speed (within 2 %); required: {settle:g} turns to settle, as in scene "
            f"{loaded.scene.name}, and {MIN_TURNS:g} to compare"
        )
    pairs = MeasuredPairs(run, loaded, cam, stretches, Alignment(offset or 0.0), offset is not None)
    if run.lift is None:
        return pairs
    drive_cam = partial(drive, loaded, cam)
    return replace(
        pairs, alignment=find_alignment(stretches, run.lift, drive_cam, offset, pairs.count)
    )
