"""Fit of gain and cut-off of a rig's sound radiation to measured levels of one cam."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, NamedTuple

import numpy as np

from cam_rig.acoustics import level_db
from cam_rig.arguments import check_arguments
from cam_rig.dynamics.kinetostatic import loss_intervals
from cam_rig.errors import ConfigError, DynamicsError
from cam_rig.schema.instrument_table import NOTHING, CellTable, read_lines
from cam_rig.show.result import Column, Records, Result
from cam_rig.simulation.inputs import Scene, resolve_scene
from cam_rig.simulation.scene import FITTED_WITH, SHIPPED_MODEL, LoadedScene, describe_fit_model
from cam_rig.simulation.simulate import Acoustics
from cam_rig.simulation.sound_constants import PublishedCam, SteadyTurns, fit_two_constants
from cam_rig.studies.fit_sound.identified import set_identified
from cam_rig.units import RPM, FloatArray, to_rpm

#: Smallest number of different speeds. With it, a fit of two parameters has a residual.
MIN_SPEEDS = 3
#: Smallest and largest cam speed (rpm) of a measured level.
SPEEDS = (1.0, 1e5)
#: Smallest and largest measured sound level, dB. The largest is that of a sine with an amplitude of
#: one atmosphere.
LEVELS = (-20.0, 191.0)
#: Smallest and largest corner frequency that can be fitted, Hz. The force of a cam has most of its
#: spectrum between some Hz and some hundred Hz, so sound levels do not distinguish a corner near
#: these limits from one beyond them.
CORNERS = 0.5, 2000.0
#: Relative distance from a limit of `CORNERS` within which a fitted corner frequency is rejected,
#: because the levels do not determine it.
AT_LIMIT = 0.01


class LevelRow(NamedTuple):
    """Measured sound level (dB) at a cam speed (rpm), and that of the fitted rig (dB)."""

    rpm: float
    measured: float
    fitted: float

    @property
    def difference(self) -> float:
        """Sound level of the fitted rig minus the measured sound level, dB."""
        return self.fitted - self.measured


@dataclass(frozen=True, eq=False, repr=False)
class SoundFit(Result):
    """Gain (Pa·s/N) and cut-off (Hz) of a rig's radiation, fitted to levels of a cam.

    The two values are valid for the follower and the model of the fit. With others, computed levels
    are relative only.

    Parameters
    ----------
    scene : LoadedScene
        Scene with the cam and the rig.
    cam : str
        Measured cam.
    gain : float
        Gain in Pa·s/N.
    corner_frequency : float
        Cut-off in Hz.
    rms : float
        Root mean square of the differences in dB.
    levels : tuple of LevelRow
        Measured and fitted levels.
    """

    schema = "cam_rig.fit_sound.1"
    columns: ClassVar = {
        "sound": (
            Column("cam", of="cam"),
            Column("gain", "Pa·s/N", ".4g"),
            Column("corner_frequency", "Hz", ".4g"),
            Column("rms", "dB", ".3f", "difference, r.m.s."),
            Column("speeds", "", "d", of=lambda fit: len(fit.levels)),
        ),
        "levels": (
            Column("rpm", "rpm", ".6g"),
            Column("measured", "dB", ".2f"),
            Column("fitted", "dB", ".2f"),
            Column("difference", "dB", "+.2f"),
        ),
    }

    scene: LoadedScene
    cam: str
    gain: float
    corner_frequency: float
    rms: float
    levels: tuple[LevelRow, ...]

    def tables(self) -> list[Records]:
        """Return the tables ``sound``, with gain and cut-off, and ``levels``."""
        caption = f"Sound of rig {self.scene.rig.name}, fitted to levels of {self.cam}"
        return [
            self.table("sound", caption, [self], single=True),
            self.table("levels", "Measured levels, and levels of the fitted rig", self.levels),
        ]

    def summary(self) -> list[str]:
        """Return a sentence with the fitted gain, corner frequency and residual."""
        return [
            f"{self.cam}: gain {self.gain:.4g} Pa·s/N, corner {self.corner_frequency:.4g} Hz; "
            f"{self.rms:.3f} dB RMS over {len(self.levels)} speeds (2 numbers fitted)"
        ]

    def write(self) -> Path:
        """Write gain and corner into the scene's rig file, with source and residual.

        Returns
        -------
        Path
            The rig file. Its comments and layout are kept.

        Raises
        ------
        ConfigError
            If `calibrated_on` in the file is another cam, or the file cannot be written.
        """
        rig, file = self.scene.rig, self.scene.rig_file
        if rig.calibrated_on != self.cam:
            raise ConfigError(
                f"{file}: radiation.calibrated_on must be {self.cam!r}, the cam of the levels, got "
                f"{rig.calibrated_on!r}; write that name into the file first"
            )
        # Five digits: far finer than the residual supports, and the file stays readable.
        numbers: dict[tuple[str | int, ...], float] = {
            ("radiation", "gain"): float(f"{self.gain:.5g}"),
            ("radiation", "corner_frequency"): float(f"{self.corner_frequency:.5g}"),
        }
        model = describe_fit_model(rig, SHIPPED_MODEL)
        source = f"cam-rig fit sound, levels of {self.cam}{FITTED_WITH}{model}"
        residual = f"{self.rms:.3f} dB RMS over {len(self.levels)} speeds, 2 numbers fitted"
        set_identified(file, numbers, source, residual)
        return file


@check_arguments
def fit_sound(levels: str | Path | FloatArray, scene: Scene, *, cam: str | None = None) -> SoundFit:
    """Fit gain and cut-off of a rig's radiation to measured levels of one cam.

    The squares of the differences in dB are minimised, with the exact steady response of a follower
    in contact. The levels of all other cams are then predictions. The command is
    ``cam-rig fit sound``.

    Parameters
    ----------
    levels : str, Path or ndarray
        File with one row per speed and columns of rpm and dB, or an array of these, shape (n, 2).
    scene : str, Path or Scene
        Scene with the cam, the rig and its background noise: a name, a path, or the result of
        `load_scene`.
    cam : str, optional
        Cam of the scene (default: ``calibrated_on`` of the rig, else the only cam).

    Returns
    -------
    SoundFit
        Gain, cut-off and residual. Its method ``write`` writes the numbers into the rig file.

    Raises
    ------
    ConfigError
        There are fewer than 3 different speeds, a speed is outside 1 to 1e5 rpm, a level is not
        above the rig's background or is above 191 dB, or the cam is not in the scene.
    DynamicsError
        The cam loses contact at a speed, or the levels do not determine the corner.

    Examples
    --------
    >>> import cam_rig, numpy as np
    >>> levels = np.array([[200, 78.3], [250, 81.7], [300, 83.4], [350, 85.8], [400, 90.9]])
    >>> fit = cam_rig.fit_sound(levels, "tm21_sweep", cam="poly345")  # rpm, dB
    >>> f"{fit.corner_frequency:.1f} Hz"
    '27.4 Hz'
    """
    loaded = resolve_scene(scene)
    table = read_levels(Path(levels)) if isinstance(levels, str | Path) else levels
    _require_levels(table, loaded)
    name = _measured_cam(loaded, cam)
    measured = _published_cam(loaded, name, table)
    fitted = fit_two_constants([measured], Acoustics(loaded.radiation), CORNERS)
    corner = fitted.radiation.corner_frequency
    if not CORNERS[0] * (1.0 + AT_LIMIT) < corner < CORNERS[1] * (1.0 - AT_LIMIT):
        raise DynamicsError(
            f"levels of {name} do not determine the corner frequency: it is outside "
            f"{CORNERS[0]:g} to {CORNERS[1]:g} Hz; measure levels over a wider range of speeds, or "
            "enter their background in the rig file"
        )
    rows = zip(*table.T.tolist(), fitted.levels(measured.turns).tolist(), strict=True)
    return SoundFit(
        scene=loaded,
        cam=name,
        gain=fitted.radiation.gain,
        corner_frequency=corner,
        rms=measured.rms(fitted),
        levels=tuple(LevelRow(*row) for row in rows),
    )


def _require_levels(table: FloatArray, loaded: LoadedScene) -> None:
    """Raise ConfigError for too few speeds, or for a speed or level out of range.

    The rows of ``table`` are speed (rpm) and level (dB). A level must exceed the rig's background.
    """
    if table.ndim != 2 or table.shape[1] != 2 or len(np.unique(table[:, 0])) < MIN_SPEEDS:
        raise ConfigError(
            f"levels must have the shape (n, 2), each row a speed in rpm and a level in dB, with "
            f"{MIN_SPEEDS} or more different speeds, got {table.shape}"
        )
    for rpm, level in table.tolist():
        if not SPEEDS[0] <= rpm <= SPEEDS[1]:
            raise ConfigError(
                f"levels: the speeds must be between {SPEEDS[0]:g} and {SPEEDS[1]:.6g} rpm, got "
                f"{rpm:g}"
            )
        if not LEVELS[0] <= level <= LEVELS[1]:
            raise ConfigError(
                f"levels must be between {LEVELS[0]:g} and {LEVELS[1]:g} dB, got {level:g} at "
                f"{rpm:g} rpm"
            )
        background = level_db(math.sqrt(loaded.radiation.background_power(rpm * RPM)))
        if level <= background:
            raise ConfigError(
                f"levels must be above the background {background:.2f} dB of rig "
                f"{loaded.rig.name}, got {level:g} dB at {rpm:g} rpm; enter the background of this "
                "measurement in the rig file"
            )


def _measured_cam(loaded: LoadedScene, cam: str | None) -> str:
    """Return the name of the measured cam.

    The default is the cam on which the rig was calibrated, or the only cam of the scene. Raises
    ConfigError if neither exists.
    """
    name = cam or loaded.rig.calibrated_on
    if cam or name in loaded.cams:
        return name
    if len(loaded.cams) > 1:
        raise ConfigError(f"--cam is required: one of the scene's cams {', '.join(loaded.cams)}")
    return next(iter(loaded.cams))


def _published_cam(loaded: LoadedScene, name: str, table: FloatArray) -> PublishedCam:
    """Return the computed steady sound of the cam, together with its measured levels.

    The rows of ``table`` are speed (rpm) and level (dB). Raises DynamicsError if contact is lost at
    a speed.
    """
    law, follower, speeds = loaded.law_of(name), loaded.follower, table[:, 0] * RPM
    for speed in speeds.tolist():
        if loss_intervals(law, follower, speed):
            raise DynamicsError(
                f"cam {law.name!r} must keep contact at every measured speed, but it loses contact "
                f"at {to_rpm(speed):.0f} rpm"
            )
    return PublishedCam(name, SteadyTurns(law, follower, speeds), table[:, 1])


def read_levels(path: Path) -> FloatArray:
    """Read a file of cam speeds (rpm) and unweighted sound levels (dB), shape (n, 2).

    Rows without a level are skipped. Raises ConfigError if a column is missing.
    """
    lines, _ = read_lines(path, "speed and level")
    table = CellTable(path.name, lines)
    if table.first is None or table.first == 0:
        raise table.error("the columns must have a heading, such as rpm, dB")
    headings = table.headings(len(table.rows[table.first][1]))
    columns, factors = [], []
    for name, default in (("speed", RPM), ("level", 1.0)):
        matches = [i for i, heading in enumerate(headings) if heading.quantity == name]
        if len(matches) != 1:
            texts = ", ".join(heading.text for heading in headings)
            raise table.error(
                f"the table must have one column of the {name}, such as rpm and dB, got {texts}"
            )
        columns += matches
        factors.append(headings[matches[0]].factor or default)
    table.require_clear(headings, columns)
    body = table.rows[table.first :]
    table.describe_format(body, columns)  # raises for mixed decimal marks
    cells = (table.numbers(line, row, headings, columns) for line, row in body)
    rows = [[row[i] for i in columns] for row in cells]
    numbers = np.array([row for row in rows if row[1] != NOTHING], dtype=float).reshape(-1, 2)
    return numbers * [factors[0] / RPM, factors[1]]
