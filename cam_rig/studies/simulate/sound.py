"""Sound level of a simulated motion, and sound of a scene for a sound file."""

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
from cam_rig.arguments import check_arguments
from cam_rig.dynamics import MODELS
from cam_rig.errors import ConfigError
from cam_rig.schema import SceneConfig
from cam_rig.show.result import (
    NULL_PROGRESS,
    Column,
    Progress,
    Records,
    Result,
    subject_line,
)
from cam_rig.simulation.scene import RELATIVE_NOTE, LoadedScene, calibration_cam
from cam_rig.simulation.schedule import CamState, tick_count
from cam_rig.simulation.simulate import (
    MeasuredTick,
    MicrophoneSimulator,
    TickSamples,
    simulate_ticks,
    step_levels,
)
from cam_rig.studies.simulate.motion import CAM, FollowerMotion
from cam_rig.units import FloatArray


@dataclass(frozen=True, eq=False, repr=False)
class SoundLevel(Result):
    """Sound pressure level of a simulated motion, in dB re 20 µPa, unweighted.

    Parameters
    ----------
    rpm : float
        Cam speed, rpm.
    level_db : float
        Level of the settled turns, dB.
    by_turn : (n,) array
        Level of every turn at that speed, dB, including the turns that are left out.
    transient_turns : int
        Number of turns left out at the start.
    calibrated_on : str
        Cam to whose measured levels the rig's acoustic constants were fitted. It is empty if the
        constants are assumed, or were fitted with another follower or model. The level is then
        relative, and only valid for comparisons.
    """

    schema = "cam_rig.sound_level.1"
    plot_function = "cam_rig.studies.simulate.figures:turn_by_turn"
    columns: ClassVar = {
        "turns": (
            Column("turn", "", "d", of=itemgetter(0)),
            Column("level", "dB", ".1f", of=itemgetter(1), doc="re 20 µPa, unweighted"),
            Column("settled", of=itemgetter(2), doc="true if it is part of the level"),
        ),
        "level": (
            Column("rpm", "rpm", doc="cam speed"),
            Column("level", "dB", of="level_db", doc="of the settled turns"),
            Column("calibrated_on", doc="the cam that the rig's sound was fitted to, or empty"),
        ),
    }

    rpm: float
    level_db: float
    by_turn: FloatArray
    transient_turns: int
    calibrated_on: str

    @property
    def calibrated(self) -> bool:
        """True if the level is absolute, False if only differences of levels are valid."""
        return bool(self.calibrated_on)

    def __str__(self) -> str:
        origin = (
            f"calibrated on {self.calibrated_on}" if self.calibrated else "relative: uncalibrated"
        )
        return f"{self.level_db:.1f} dB at {self.rpm:g} rpm ({origin})"

    def tables(self) -> list[Records]:
        """Return the tables ``turns`` (level of each turn) and ``level``.

        The latter is exported only.
        """
        turns = enumerate(self.by_turn.tolist(), start=1)
        rows = [(turn, level, turn > self.transient_turns) for turn, level in turns]
        return [
            self.table("turns", str(self), rows),
            self.table("level", "", [self], single=True, hidden=True),
        ]

    def __repr__(self) -> str:
        return f"SoundLevel({self})"


@check_arguments
def sound_level(motion: FollowerMotion, *, transient_turns: int = 1) -> SoundLevel:
    """Compute the sound level of a motion at the rig's microphone.

    It is equal to the level of a scene at the same speed.

    Parameters
    ----------
    motion : FollowerMotion
        Result of `simulate`.
    transient_turns : int
        Number of turns left out at the start, less than the number of turns (default: 1).

    Returns
    -------
    SoundLevel
        Level of each turn and of the settled turns, dB.

    Raises
    ------
    ConfigError
        If no turn remains, or the rig lacks an acoustic constant.

    Examples
    --------
    >>> import cam_rig
    >>> law = cam_rig.build_law(cam_rig.load_cam("poly345"))
    >>> motion = cam_rig.simulate(law, cam_rig.load_rig("tm21"), rpm=300, turns=4)
    >>> print(cam_rig.sound_level(motion))
    83.7 dB at 300 rpm (calibrated on poly345)
    """
    ticks = [tick for tick in _measured_ticks(motion) if tick.steady]
    if not 0 <= transient_turns < len(ticks):
        raise ConfigError(
            f"transient_turns must be between 0 and {len(ticks) - 1}, fewer than the {len(ticks)} "
            f"turns of the motion, got {transient_turns!r}"
        )
    levels = step_levels(ticks, transient_turns)[CAM]
    by_turn = level_db(np.array([tick.pressure for tick in ticks]))
    by_turn.setflags(write=False)
    level = levels[ticks[0].start.speed]
    return SoundLevel(motion.rpm, level, by_turn, transient_turns, _calibration_cam(motion))


def _measured_ticks(motion: FollowerMotion) -> list[MeasuredTick]:
    """Return the sound pressure at the microphone for each block of a motion.

    A block contains the samples of one interval of the run.
    """
    radiation = RadiationParameters.from_rig(motion.rig, lands=MODELS[motion.scene.model].lifts_off)
    microphone = MicrophoneSimulator(radiation, int(motion.scene.sample_rate.si))
    measured = []
    for block in motion.blocks:
        i = block.interval
        start = CamState(i.start_ns, i.angle, i.speed, CAM, i.turns)
        measured.append(microphone.measure(TickSamples(start, i, block.rows)))
    return measured


def _calibration_cam(motion: FollowerMotion) -> str:
    """Return the name of the cam to which the rig's sound constants were fitted.

    It is empty if the constants are not valid for the motion: for another model, or if the model
    keeps contact although a real follower would lift off.
    """
    if not MODELS[motion.scene.model].lifts_off and bool((motion.force < 0.0).any()):
        return ""  # a real follower would lose contact here
    return calibration_cam(motion.rig, motion.scene.model)


def audition(
    loaded: LoadedScene, cam: str | None, rpm: float | None, seconds: float, rate: int
) -> LoadedScene:
    """Return a scene with another sample rate, and optionally only one cam or speed.

    Parameters
    ----------
    loaded : LoadedScene
        Scene to change.
    cam : str or None
        Name of a cam (None: all cams).
    rpm : float or None
        Cam speed, rpm (None: the scene's schedule).
    seconds : float
        Duration of `rpm`, rounded up to whole turns, s.
    rate : int
        Sample rate, Hz.
    """
    if cam is not None:
        loaded = loaded.with_one_cam(cam, loaded.law_of(cam))
    data = loaded.scene.model_dump(exclude_none=True)
    data["sample_rate"] = {"assumed": rate, "unit": "Hz"}
    if rpm is not None:
        turns = max(1, math.ceil(seconds * rpm / 60.0))
        data["schedule"]["speeds"] = {"assumed": [rpm], "unit": "rpm"}
        data["schedule"]["turns"] = {"assumed": turns, "unit": "turns"}
        data["schedule"]["transient_turns"] = {"assumed": 0, "unit": "turns"}
    return replace(loaded, scene=SceneConfig.model_validate(data))


#: Descriptions of the frequency weightings of sound levels.
WEIGHTED = {"A": "A-weighted", "C": "C-weighted", "Z": "unweighted (Z), as in tables"}


@dataclass(frozen=True, eq=False, repr=False)
class ListenResult(Result):
    """Sound of a scene for a sound file, with the levels that a meter shows for it."""

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
            Column("full_scale", "Pa", doc="pressure of the largest number in the sound file"),
            Column("peak", "Pa", of="measured.peak_pa"),
            Column("calibrated", of="loaded.calibrated", doc="false if levels are relative"),
            Column("class_1_up_to", "Hz", of="measured.class_1_up_to_hz"),
            Column("overload", of="measured.overload", doc="beyond the meter's 130 dB"),
            Column("under_range", of="measured.under_range", doc="below the meter's 30 dB"),
        ),
    }

    loaded: LoadedScene
    pressure: FloatArray  #: sound pressure, Pa, ``(n,)``
    rate: int  #: sample rate, Hz
    out: Path  #: path of the sound file

    @property
    def subject(self) -> str:
        """Cams, rig and model of the scene."""
        return subject_line(self.loaded.laws, self.loaded.rig.name, self.loaded.scene.model)

    @cached_property
    def measured(self) -> Measurement:
        """Levels, third-octave bands and peak of the sound."""
        return measure(self.pressure, self.rate)

    @property
    def full_scale(self) -> float:
        """Sound pressure (Pa) of the largest number in the sound file, at least the peak."""
        return full_scale(self.measured.peak_pa)

    @property
    def duration(self) -> float:
        """Duration of the sound file, s."""
        return self.pressure.size / self.rate

    def tables(self) -> list[Records]:
        """Return the tables ``levels``, ``third_octaves`` and ``sound``, for export only."""
        bands = self.measured.bands
        thirds = list(zip(bands.names, bands.level_db.tolist(), strict=True))
        return [
            self.table("levels", "", self.measured.levels.items(), hidden=True),
            self.table("third_octaves", "", thirds, hidden=True),
            self.table("sound", "", [self], single=True, hidden=True),
        ]

    def summary(self) -> list[str]:
        """Return lines of text on the sound file and its levels.

        They contain file, duration and peak, the levels of each weighting, and limits of the
        measurement.
        """
        measured = self.measured
        lines = [
            f"{self.out}: {self.duration:.1f} s; full scale is {self.full_scale:g} Pa, "
            f"peak {measured.peak_pa:.3g} Pa"
        ]
        for weighting, description in WEIGHTED.items():
            weighted = {n: x for n, x in measured.levels.items() if n.startswith(f"L{weighting}")}
            levels = ", ".join(f"{name} {level:.1f}" for name, level in weighted.items())
            lines.append(f"{description}: {levels} dB")
        lines.append(f"class 1 up to {measured.class_1_up_to_hz / 1000.0:g} kHz")
        if measured.overload:
            lines.append("overload: beyond the meter's 130 dB")
        if measured.under_range:
            lines.append("under range: a level is below the meter's 30 dB")
        return lines if self.loaded.calibrated else [*lines, RELATIVE_NOTE]


def listen(
    loaded: LoadedScene, rate: int, out: Path, progress: Progress = NULL_PROGRESS
) -> ListenResult:
    """Simulate the sound of a scene at its microphone, for a sound file.

    The file is written by the caller.

    Parameters
    ----------
    loaded : LoadedScene
        Scene to simulate.
    rate : int
        Sample rate, Hz.
    out : Path
        Sound file that the summary names.
    progress : Progress, optional
        Receiver of the progress.
    """
    source, pressure = SoundSource(loaded.radiation, rate, least_rate=rate), []
    progress.start(tick_count(loaded.scene), loaded.scene.name)
    for tick in simulate_ticks(loaded):
        pressure.append(source.pressure(tick.force, tick.impulse, tick.interval.mean_speed))
        progress.advance()
    return ListenResult(loaded, np.concatenate(pressure), rate, out)
