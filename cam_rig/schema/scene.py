"""A scene file: which cams on which rig, how they turn, and what is compared."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from cam_rig.schema.quantity import Quantity, Strict, must_be
from cam_rig.units import RPM, TURN

#: Cam speeds of a scene, rad/s.
MIN_SPEED, MAX_SPEED = 0.01 * RPM, 1e5 * RPM
#: Instants a turn at which the motion is published for people, at most.
MAX_POINTS_PER_TURN = 3600
#: Samples of a tick at the highest speed, at least, and of a ramp.
MIN_SAMPLES = 2
#: A name refers to a file of that name, without the suffix.
Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]
#: What two models were called in scenes and bags before: still read, nowhere written.
OLD_MODELS = {"separation": "two_mass", "residual": "elastic_stem"}


def model_named(name: Any) -> Any:
    """The name that a model has now."""
    return OLD_MODELS.get(name, name) if isinstance(name, str) else name


Model = Annotated[
    Literal["kinetostatic", "one_mass", "two_mass", "elastic_stem", "torsional"],
    BeforeValidator(model_named),
]


class Program(Strict):
    """The cam's speed: hold each of ``speeds`` for ``turns``, tick by tick.

    With ``ramp`` each cam starts at rest and reaches every speed evenly in that time, else at once.
    """

    speeds: Annotated[Quantity, must_be("speed", many=True, least=MIN_SPEED, most=MAX_SPEED)]
    turns: Annotated[Quantity, must_be("turns", least=1.0, most=1e5)]
    settle_turns: Annotated[Quantity, must_be("turns", least=0.0)]
    ticks_per_turn: int = Field(default=1, ge=1, le=1000, strict=True)
    ramp: Annotated[Quantity, must_be("time", above=0.0, most=3600.0)] | None = None

    @model_validator(mode="after")
    def _something_to_measure(self) -> Program:
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
    """One file of ``config/scenes/``."""

    name: Name
    title: str
    cams: list[Name] = Field(min_length=1)
    rig: Name
    model: Model
    sample_rate: Annotated[Quantity, must_be("frequency", least=100.0, most=1e6)]
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
        """Two at least in every tick: one of a ramp may be half as long, and must hold one."""
        rate, ticks = self.sample_rate.si, self.program.ticks_per_turn
        turn = TURN / max(self.program.speeds.si_list) * rate
        if turn / ticks < MIN_SAMPLES:
            most = int(turn / MIN_SAMPLES)
            fewer = f", or ticks_per_turn up to {most}" if most else ""
            raise ValueError(
                f"sample_rate: {rate:g} Hz gives {turn / ticks:.3g} samples a tick at the highest "
                f"speed, {ticks} ticks_per_turn; allowed: at least {MIN_SAMPLES}, so "
                f"{math.ceil(MIN_SAMPLES * ticks * rate / turn)} Hz{fewer}"
            )
        ramp = self.program.ramp
        if ramp is not None and ramp.si * rate < MIN_SAMPLES:
            raise ValueError(
                f"program.ramp: {ramp.si:g} s has {ramp.si * rate:.3g} samples at {rate:g} Hz; "
                f"allowed: at least {MIN_SAMPLES}, or no ramp: without one the speed steps"
            )
