"""A run of any bench beside the model: the cam's motion through the readings of its angle."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from cam_rig.errors import BagError
from cam_rig.simulation.encoder import encoder_count
from cam_rig.simulation.loaded_scene import LoadedScene
from cam_rig.simulation.measured_run import MeasuredRun, Signal
from cam_rig.studies.real_run.alignment import Alignment, find_alignment
from cam_rig.studies.real_run.cam_motion import SteadyStretch, steady_stretches
from cam_rig.studies.real_run.model_run import ModelRun, drive
from cam_rig.studies.real_run.pairs import PairedSignal, PairedStep

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
    """A measured run on the model of a scene.

    Parameters
    ----------
    run : as it was read
    loaded : the scene
    cam : its name in the scene
    stretches : where the cam turned steadily
    alignment : encoder's zero, sensors' clock, gauge's zero
    given : whether the encoder's zero was given, and not found
    """

    run: MeasuredRun
    loaded: LoadedScene
    cam: str
    stretches: tuple[SteadyStretch, ...]
    alignment: Alignment
    given: bool = False

    @property
    def count(self) -> float:
        """The encoder's resolution, rad; 0 where its values show none.

        Values that repeat from turn to turn are no counts where the motion goes through them all.
        """
        count = encoder_count(self.run.angle.value)
        rounded = any(stretch.scatter > LEAST_ROUNDING * count for stretch in self.stretches)
        return count if rounded else 0.0

    @property
    def left_out(self) -> float:
        """The part of the time with no steady turns, which are not compared."""
        whole = float(self.run.angle.time[-1] - self.run.angle.time[0])
        return 1.0 - sum(float(one.knots[-1] - one.knots[0]) for one in self.stretches) / whole

    def steps(self) -> Iterator[PairedStep]:
        """The settled turns of each stretch, slowest first."""
        settle = self.loaded.scene.program.settle_turns.si
        for stretch in sorted(self.stretches, key=lambda one: one.mean_speed):
            model = drive(self.loaded, self.cam, stretch, self.alignment.offset)
            span = model.begin, float(stretch.knots[-1])
            lift = self._pair(self.run.lift, model, 1, stretch, span)
            if lift is not None:
                zero = self.alignment.zero
                lift = PairedSignal(lift.time, lift.angle, lift.measured - zero, lift.model)
            force = self._pair(self.run.force, model, 4, stretch, span)
            yield PairedStep(
                self.cam,
                stretch.rpm,
                stretch.turns - settle,
                lift,
                None if force is None else _with_jumps(force, model),
                (self._measured_level(span), model.level()),
            )

    def _pair(
        self,
        signal: Signal | None,
        model: ModelRun,
        row: int,
        stretch: SteadyStretch,
        span: tuple[float, float],
    ) -> PairedSignal | None:
        if signal is None:
            return None
        time = self.alignment.on_cam_clock(signal.time)
        inside = (time >= span[0]) & (time <= min(span[1], model.rows[0, -1]))
        if np.count_nonzero(inside) < LEAST_READINGS:
            return None
        time = time[inside]
        angle = stretch.at(time) + self.alignment.offset
        modelled = np.interp(time, model.rows[0], model.rows[row])
        return PairedSignal(time, angle, signal.value[inside], modelled)

    def _measured_level(self, span: tuple[float, float]) -> float | None:
        if self.run.level is None:
            return None
        time = self.alignment.on_cam_clock(self.run.level.time)
        inside = (time >= span[0]) & (time <= span[1])
        if not inside.any():
            return None
        levels = self.run.level.value[inside]
        top = float(levels.max())
        return top + float(10.0 * np.log10(np.mean(10.0 ** (0.1 * (levels - top)))))


def _with_jumps(pair: PairedSignal, model: ModelRun) -> PairedSignal:
    """The force with a mark where the model's jumps, as at a landing.

    There a reading says when it was taken, and not how large the force is: the events' times do.
    """
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
    """Find the steady turns of a run, and how its readings lie on them.

    Parameters
    ----------
    cam : of the scene
    offset : rad, the cam's angle less the encoder's; None: found from the lift

    Raises
    ------
    BagError : the cam turns nowhere steadily
    ConfigError : the scene has no such cam
    """
    loaded.law_of(cam)
    settle = loaded.scene.program.settle_turns.si
    stretches = tuple(steady_stretches(run.angle, settle + LEAST_TURNS))
    if not stretches:
        raise BagError(
            f"{run.source}: {run.angle.source}: nowhere {settle + LEAST_TURNS:g} turns at a speed "
            f"that is held within 2 %; allowed: {settle:g} turns to settle, as scene "
            f"{loaded.scene.name} says, and {LEAST_TURNS:g} to compare"
        )
    alignment = Alignment(offset or 0.0)
    if run.lift is not None:
        alignment = find_alignment(stretches, run.lift, partial(drive, loaded, cam), offset)
    return MeasuredPairs(run, loaded, cam, stretches, alignment, offset is not None)
