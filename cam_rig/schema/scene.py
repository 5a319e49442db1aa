"""Scene files: cams, rig, model and speed schedule of an experiment."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, Field, model_validator

from cam_rig.schema.named import Name
from cam_rig.schema.quantity import MANY, Quantity, Strict, must_be
from cam_rig.units import RPM, TURN

#: Smallest cam speed of a scene, rad/s.
MIN_SPEED = 0.01 * RPM
#: Largest cam speed of a scene, rad/s.
MAX_SPEED = 1e5 * RPM
#: Largest number of points per turn at which the motion is published for displays.
MAX_SAMPLES_PER_TURN = 3600
#: Smallest number of samples of a ramp, and of a tick at the highest speed.
MIN_SAMPLES = 2
#: Old names of models -> present names. Old scenes and bags may contain them.
OLD_MODELS = {"separation": "two_mass", "residual": "elastic_stem"}


def present_model_name(name: Any) -> Any:
    """Return the present name of a model. Other values are returned unchanged."""
    return OLD_MODELS.get(name, name) if isinstance(name, str) else name


Model = Annotated[
    Literal["kinetostatic", "one_mass", "two_mass", "elastic_stem", "torsional"],
    BeforeValidator(present_model_name),
]


class SpeedSchedule(Strict):
    """Schedule of the cam speed: `turns` turns at each of `speeds`.

    Parameters
    ----------
    speeds : Quantity
        Cam speeds, rad/s.
    turns : Quantity
        Turns at each speed, a whole number.
    transient_turns : Quantity
        First turns at each speed, which are not evaluated. A whole number less than `turns`.
    ticks_per_turn : int
        Ticks of the simulation per turn (default: 1).
    ramp : Quantity or None
        Time (s) in which each cam reaches the next speed, at constant acceleration and first from
        rest (default: the speed steps).
    """

    earlier_keys: ClassVar = {"settle_turns": "transient_turns"}

    speeds: Annotated[Quantity, must_be("speed", counts=(1, MANY), ge=MIN_SPEED, le=MAX_SPEED)]
    turns: Annotated[Quantity, must_be("turns", ge=1.0, le=1e5)]
    transient_turns: Annotated[Quantity, must_be("turns", ge=0.0)]
    ticks_per_turn: int = Field(default=1, ge=1, le=1000, strict=True)
    ramp: Annotated[Quantity, must_be("time", gt=0.0, le=3600.0)] | None = None

    @model_validator(mode="after")
    def _check_turns(self) -> SpeedSchedule:
        for key in ("turns", "transient_turns"):
            value = getattr(self, key).si
            if value != int(value):
                raise ValueError(f"{key}: is {value:g} turns; allowed: a whole number")
        if self.transient_turns.si >= self.turns.si:
            raise ValueError(
                f"transient_turns: is {self.transient_turns.si:g} turns; "
                f"allowed: less than turns ({self.turns.si:g} turns)"
            )
        return self


class SceneConfig(Strict):
    """Scene: an experiment with some cams on a rig.

    A file of ``config/scenes/`` contains one scene.

    Parameters
    ----------
    name, title : str
    cams : list of str
        Names of cam files.
    rig : str
        Name of a rig file.
    model : str
        Dynamic model of the follower.
    sample_rate : Quantity
        Sample rate of the motion and the sound, a whole number of Hz.
    samples_per_turn : int
        Points per turn at which the motion is published for displays (default: 72).
    schedule : SpeedSchedule
        Speeds and turns.
    published : str or None
        Name of the file of published levels to compare with.
    """

    earlier_keys: ClassVar = {"points_per_turn": "samples_per_turn", "program": "schedule"}

    name: Name
    title: str
    cams: list[Name] = Field(min_length=1)
    rig: Name
    model: Model
    sample_rate: Annotated[Quantity, must_be("frequency", ge=100.0, le=1e6)]
    samples_per_turn: int = Field(default=72, ge=1, le=MAX_SAMPLES_PER_TURN, strict=True)
    schedule: SpeedSchedule
    published: Name | None = None

    @model_validator(mode="after")
    def _consistent(self) -> SceneConfig:
        if len(set(self.cams)) != len(self.cams):
            raise ValueError(f"cams: {self.cams} names a cam twice; allowed: each once")
        if self.sample_rate.si != int(self.sample_rate.si):
            raise ValueError(
                f"sample_rate: is {self.sample_rate.si:g} Hz; allowed: a whole number of Hz"
            )
        self._require_samples()
        return self

    def _require_samples(self) -> None:
        """Raise ValueError if a tick or a ramp has less than `MIN_SAMPLES` samples of the motion.

        A tick is the time between two published cam states. `MIN_SAMPLES` is 2, because a tick of a
        ramp may be half as long as others and must contain one sample.
        """
        rate, ticks = self.sample_rate.si, self.schedule.ticks_per_turn
        turn = TURN / max(self.schedule.speeds.si_list) * rate
        if turn / ticks < MIN_SAMPLES:
            max_ticks = int(turn / MIN_SAMPLES)
            fewer = f", or ticks_per_turn up to {max_ticks}" if max_ticks else ""
            raise ValueError(
                f"sample_rate: {rate:g} Hz gives {turn / ticks:.3g} samples per tick at the "
                f"highest speed, {ticks} ticks_per_turn; allowed: at least {MIN_SAMPLES}, so "
                f"{math.ceil(MIN_SAMPLES * ticks * rate / turn)} Hz{fewer}"
            )
        ramp = self.schedule.ramp
        if ramp is not None and ramp.si * rate < MIN_SAMPLES:
            raise ValueError(
                f"schedule.ramp: {ramp.si:g} s has {ramp.si * rate:.3g} samples at {rate:g} Hz; "
                f"allowed: at least {MIN_SAMPLES}, or no ramp: without one the speed steps"
            )
