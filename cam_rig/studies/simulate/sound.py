"""The sound level of a simulated motion, by the same microphone as in a scene."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from operator import itemgetter
from pathlib import Path
from typing import ClassVar

import numpy as np

from cam_rig.acoustics import RadiationParameters, SoundSource, level_db
from cam_rig.acoustics.sound_level_meter import Measurement, full_scale, measure
from cam_rig.arguments import checked
from cam_rig.dynamics import MODELS
from cam_rig.errors import ConfigError
from cam_rig.schema import SceneConfig
from cam_rig.show.result import NULL_PROGRESS, Column, Progress, Records, Result
from cam_rig.simulation.scene import RELATIVE_NOTE, LoadedScene, calibrated_on
from cam_rig.simulation.schedule import CamState, tick_count
from cam_rig.simulation.simulate import (
    MeasuredTick,
    MicrophoneSimulator,
    TickSamples,
    step_levels,
    turned_ticks,
)
from cam_rig.studies.simulate.motion import CAM, FollowerMotion
from cam_rig.units import FloatArray


@dataclass(frozen=True, eq=False, repr=False)
class SoundLevel(Result):
    """Sound pressure level in dB re 20 µPa, unweighted.

    Parameters
    ----------
    rpm : cam speed, rpm
    level_db : over the settled turns
    by_turn : ``(n,)`` dB of every turn at that speed, those left out too
    settle_turns : turns left out at the beginning
    calibrated_on : the cam to whose measured levels the rig's acoustic constants were fitted;
        empty when they are assumed, or were fitted with another follower or model: the level is
        then relative, good for comparisons alone
    """

    schema = "cam_rig.sound_level.1"
    plot_function = "cam_rig.studies.simulate.figures:turn_by_turn"
    columns: ClassVar = {
        "turns": (
            Column("turn", "", "d", of=itemgetter(0)),
            Column("level", "dB", ".1f", of=itemgetter(1), doc="re 20 µPa, unweighted"),
            Column("settled", of=itemgetter(2), doc="whether it is in the level"),
        ),
        "level": (
            Column("rpm", "rpm", doc="cam speed"),
            Column("level", "dB", of="level_db", doc="of the settled turns"),
            Column("calibrated_on", doc="the cam that the rig's sound was fitted to; or empty"),
        ),
    }

    rpm: float
    level_db: float
    by_turn: FloatArray
    settle_turns: int
    calibrated_on: str

    @property
    def calibrated(self) -> bool:
        """Whether the level itself means something, and not only its difference to another."""
        return bool(self.calibrated_on)

    def __str__(self) -> str:
        worth = (
            f"calibrated on {self.calibrated_on}" if self.calibrated else "relative: uncalibrated"
        )
        return f"{self.level_db:.1f} dB at {self.rpm:g} rpm ({worth})"

    def tables(self) -> list[Records]:
        """``turns``, and in data the level of the settled ones."""
        turns = enumerate(self.by_turn.tolist(), start=1)
        rows = [(turn, level, turn > self.settle_turns) for turn, level in turns]
        return [
            self.table("turns", str(self), rows),
            self.table("level", "", [self], single=True, hidden=True),
        ]

    def __repr__(self) -> str:
        return f"SoundLevel({self})"


@checked
def sound_level(motion: FollowerMotion, *, settle_turns: int = 1) -> SoundLevel:
    """The level that the rig's microphone measures of a motion, as in a scene of the same speed.

    Parameters
    ----------
    motion : of `simulate`
    settle_turns : turns left out at the beginning, fewer than the motion has

    Raises
    ------
    ConfigError : no turn is left

    Examples
    --------
    >>> import cam_rig
    >>> law = cam_rig.build_law(cam_rig.load_cam("poly345"))
    >>> motion = cam_rig.simulate(law, cam_rig.load_rig("tm21"), rpm=300, turns=4)
    >>> print(cam_rig.sound_level(motion))
    83.7 dB at 300 rpm (calibrated on poly345)
    """
    ticks = [tick for tick in _measured_ticks(motion) if tick.steady]
    if not 0 <= settle_turns < len(ticks):
        raise ConfigError(
            f"settle_turns: {settle_turns!r}; allowed: 0 to {len(ticks) - 1}, fewer than the "
            f"{len(ticks)} turns of the motion"
        )
    found = step_levels(ticks, settle_turns)[CAM]
    by_turn = level_db(np.array([tick.pressure for tick in ticks]))
    by_turn.setflags(write=False)
    level = found[ticks[0].start.speed]
    return SoundLevel(motion.rpm, level, by_turn, settle_turns, _calibrated_on(motion))


def _measured_ticks(motion: FollowerMotion) -> list[MeasuredTick]:
    """Each turn as the microphone measures it."""
    radiation = RadiationParameters.from_rig(motion.rig, lands=MODELS[motion.scene.model].lifts_off)
    microphone = MicrophoneSimulator(radiation, int(motion.scene.sample_rate.si))
    measured = []
    for block in motion.blocks:
        i = block.interval
        start = CamState(i.start_ns, i.angle, i.speed, CAM, i.turns)
        measured.append(microphone.measure(TickSamples(start, i, block.rows)))
    return measured


def _calibrated_on(motion: FollowerMotion) -> str:
    """The cam that the rig's sound was fitted to; empty where that fit says nothing."""
    if not MODELS[motion.scene.model].lifts_off and bool((motion.force < 0.0).any()):
        return ""  # contact would be lost
    return calibrated_on(motion.rig, motion.scene.model)


def audition(
    loaded: LoadedScene, cam: str | None, rpm: float | None, seconds: float, rate: int
) -> LoadedScene:
    """The scene at ``rate`` Hz, of one cam or all, or at one speed for ``seconds`` or more."""
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


#: The frequency weightings of the levels, in words.
WEIGHTED = {"A": "A-weighted", "C": "C-weighted", "Z": "unweighted (Z), as in tables"}


@dataclass(frozen=True, eq=False, repr=False)
class ListenResult(Result):
    """The sound of a scene: pressure (Pa) at ``rate`` Hz, and what a meter shows for it."""

    schema = "cam_rig.listen.1"
    columns: ClassVar = {
        "levels": (
            Column("quantity", of=itemgetter(0), doc="as IEC 61672-1 writes it: LAeq, LAFmax"),
            Column("level", "dB", ".1f", of=itemgetter(1), doc="re 20 µPa"),
        ),
        "third_octaves": (
            Column("band", of=itemgetter(0), doc="by its nominal frequency"),
            Column("level", "dB", of=itemgetter(1), doc="unweighted"),
        ),
        "sound": (
            Column("duration", "s"),
            Column("full_scale", "Pa", doc="what the sound file's largest number stands for"),
            Column("peak", "Pa", of="measured.peak_pa"),
            Column("calibrated", of="loaded.calibrated", doc="else levels are relative"),
            Column("class_1_up_to", "Hz", of="measured.class_1_up_to_hz"),
            Column("overload", of="measured.overload", doc="beyond the meter's 130 dB"),
            Column("under_range", of="measured.under_range", doc="below the meter's 30 dB"),
        ),
    }

    loaded: LoadedScene
    pressure: FloatArray
    rate: int
    out: Path

    @cached_property
    def measured(self) -> Measurement:
        """Levels, bands, peak."""
        return measure(self.pressure, self.rate)

    @property
    def full_scale(self) -> float:
        """The pressure (Pa) that the largest number of a sound file stands for."""
        return full_scale(self.measured.peak_pa)

    @property
    def duration(self) -> float:
        """How long it is, s."""
        return self.pressure.size / self.rate

    def tables(self) -> list[Records]:
        """``levels``, ``third_octaves``, and ``sound`` as a whole: data, of which `summary`."""
        bands = self.measured.bands
        thirds = list(zip(bands.names, bands.level_db.tolist(), strict=True))
        return [
            self.table("levels", "", self.measured.levels.items(), hidden=True),
            self.table("third_octaves", "", thirds, hidden=True),
            self.table("sound", "", [self], single=True, hidden=True),
        ]

    def summary(self) -> list[str]:
        """Where it is, a line a weighting, and what is wrong with it."""
        told = self.measured
        lines = [
            f"{self.out}: {self.duration:.1f} s; full scale is {self.full_scale:g} Pa, "
            f"peak {told.peak_pa:.3g} Pa"
        ]
        for weighting, words in WEIGHTED.items():
            own = {name: x for name, x in told.levels.items() if name.startswith(f"L{weighting}")}
            levels = ", ".join(f"{name} {level:.1f}" for name, level in own.items())
            lines.append(f"{words}: {levels} dB")
        lines.append(f"class 1 up to {told.class_1_up_to_hz / 1000.0:g} kHz")
        if told.overload:
            lines.append("overload: beyond the meter's 130 dB")
        if told.under_range:
            lines.append("under range: a level is below the meter's 30 dB")
        return lines if self.loaded.calibrated else [*lines, RELATIVE_NOTE]


def listen(
    loaded: LoadedScene, rate: int, out: Path, progress: Progress = NULL_PROGRESS
) -> ListenResult:
    """The sound of a scene at its microphone, at ``rate`` Hz, for a file ``out``."""
    source, pressure = SoundSource(loaded.radiation, rate, least_rate=rate), []
    progress.start(tick_count(loaded.scene), loaded.scene.name)
    for tick in turned_ticks(loaded):
        pressure.append(source.pressure(tick.force, tick.impulse, tick.interval.mean_speed))
        progress.advance()
    return ListenResult(loaded, np.concatenate(pressure), rate, out)
