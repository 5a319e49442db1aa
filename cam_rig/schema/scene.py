"""Scene files: cams, rig, model and program of speeds of an experiment."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from cam_rig.schema.quantity import Quantity, Strict, must_be
from cam_rig.units import RPM, TURN

#: Smallest cam speed of a scene, rad/s.
MIN_SPEED = 0.01 * RPM
#: Largest cam speed of a scene, rad/s.
MAX_SPEED = 1e5 * RPM
#: Largest number of points per turn at which the motion is published for displays.
MAX_POINTS_PER_TURN = 3600
#: Smallest number of samples of a ramp, and of a tick at the highest speed.
MIN_SAMPLES = 2
#: Name of a file, without its suffix.
Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]
#: Old names of models -> present names. Old scenes and bags may contain them.
OLD_MODELS = {"separation": "two_mass", "residual": "elastic_stem"}


def model_named(name: Any) -> Any:
    """Return the present name of a model. Other values are returned unchanged."""
    return OLD_MODELS.get(name, name) if isinstance(name, str) else name


Model = Annotated[
    Literal["kinetostatic", "one_mass", "two_mass", "elastic_stem", "torsional"],
    BeforeValidator(model_named),
]


class Program(Strict):
    """Program of the cam's speed: `turns` turns at each of `speeds`.

    Parameters
    ----------
    speeds : Quantity
        Cam speeds, rad/s.
    turns : Quantity
        Turns at each speed, a whole number.
    settle_turns : Quantity
        First turns at each speed, which are not evaluated. A whole number less than `turns`.
    ticks_per_turn : int
        Ticks of the simulation per turn (default: 1).
    ramp : Quantity or None
        Time (s) in which each cam reaches the next speed, at constant acceleration and first from
        rest (default: the speed steps).
    """

    speeds: Annotated[Quantity, must_be("speed", is_list=True, ge=MIN_SPEED, le=MAX_SPEED)]
    turns: Annotated[Quantity, must_be("turns", ge=1.0, le=1e5)]
    settle_turns: Annotated[Quantity, must_be("turns", ge=0.0)]
    ticks_per_turn: int = Field(default=1, ge=1, le=1000, strict=True)
    ramp: Annotated[Quantity, must_be("time", gt=0.0, le=3600.0)] | None = None

    @model_validator(mode="after")
    def _check_turns(self) -> Program:
        for key in ("turns", "settle_turns"):
            value = getattr(self, key).si
            if value != int(value):
                raise ValueError(f"{key}: is {value:g} turns; allowed: a whole number")
        if self.settle_turns.si >= self.turns.si:
            raise ValueError(
                f"settle_turns: is {self.settle_turns.si:g} turns; "
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
    points_per_turn : int
        Points per turn at which the motion is published for displays (default: 72).
    program : Program
        Speeds and turns.
    published : str or None
        Name of the file of published levels to compare with.
    """

    name: Name
    title: str
    cams: list[Name] = Field(min_length=1)
    rig: Name
    model: Model
    sample_rate: Annotated[Quantity, must_be("frequency", ge=100.0, le=1e6)]
    points_per_turn: int = Field(default=72, ge=1, le=MAX_POINTS_PER_TURN, strict=True)
    program: Program
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
        """Raise ValueError if a tick or a ramp has less than `MIN_SAMPLES` samples.

        A tick of a ramp may be half as long as others, and must contain one sample.
        """
        rate, ticks = self.sample_rate.si, self.program.ticks_per_turn
        turn = TURN / max(self.program.speeds.si_list) * rate
        if turn / ticks < MIN_SAMPLES:
            max_ticks = int(turn / MIN_SAMPLES)
            fewer = f", or ticks_per_turn up to {max_ticks}" if max_ticks else ""
            raise ValueError(
                f"sample_rate: {rate:g} Hz gives {turn / ticks:.3g} samples per tick at the "
                f"highest speed, {ticks} ticks_per_turn; allowed: at least {MIN_SAMPLES}, so "
                f"{math.ceil(MIN_SAMPLES * ticks * rate / turn)} Hz{fewer}"
            )
        ramp = self.program.ramp
        if ramp is not None and ramp.si * rate < MIN_SAMPLES:
            raise ValueError(
                f"program.ramp: {ramp.si:g} s has {ramp.si * rate:.3g} samples at {rate:g} Hz; "
                f"allowed: at least {MIN_SAMPLES}, or no ramp: without one the speed steps"
            )
