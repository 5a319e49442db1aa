"""How far the readings of a sheet are from the truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cam_rig.errors import ConfigError
from cam_rig.panel.lab.sheet import LabSheet
from cam_rig.panel.lab.sheet_file import LabReading, RecordedSheet, read_sheet
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.tables import Column, DataTable, tabulate

#: By how much (%) a reading may be off, if nothing else is said: 4 rpm of 400.
TOLERANCE_PERCENT = 1.0


@dataclass(frozen=True)
class ReadingMark:
    """A reading, the true jump speed (rpm) of its set-up, and whether they are near enough."""

    reading: LabReading
    true_rpm: float
    within: bool

    @property
    def difference_rpm(self) -> float:
        """Reading less truth, rpm."""
        return self.reading.rpm - self.true_rpm

    @property
    def difference_percent(self) -> float:
        """The same in % of the truth."""
        return 100.0 * self.difference_rpm / self.true_rpm


@dataclass(frozen=True)
class MarkedSheet:
    """A sheet with a mark a reading.

    Parameters
    ----------
    tolerance : %, within which a reading is right
    """

    path: Path
    recorded: RecordedSheet
    marks: tuple[ReadingMark, ...]
    tolerance: float

    @property
    def summary(self) -> str:
        """What the sheet comes to, in a line."""
        off = np.array([mark.difference_percent for mark in self.marks])
        right = sum(mark.within for mark in self.marks)
        who = f" by {self.recorded.student}" if self.recorded.student else ""
        return (
            f"{self.path}{who}: {right} of {off.size} within {self.tolerance:g} %; mean "
            f"{off.mean():+.2f} %, farthest {off[np.abs(off).argmax()]:+.2f} %"
        )


def mark_sheet(
    path: Path,
    tolerance: float,
    cam_of: Callable[[str], CamConfig],
    rig_of: Callable[[str], RigConfig],
) -> MarkedSheet:
    """Mark a sheet.

    Parameters
    ----------
    tolerance : %, within which a reading is right
    cam_of, rig_of : files by the names on the sheet

    Raises
    ------
    ConfigError : it is no sheet, is of another cam or rig, or a row is damaged
    DynamicsError : the cam has no jump speed on the rig
    """
    recorded = read_sheet(path)
    try:
        cam, rig = cam_of(recorded.cam), rig_of(recorded.rig)
        sheet = LabSheet(recorded.lab, cam, rig, recorded.seed)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None
    marks = tuple(_mark(path, sheet, reading, tolerance) for reading in recorded.readings)
    return MarkedSheet(path, recorded, marks, tolerance)


def _mark(path: Path, sheet: LabSheet, reading: LabReading, tolerance: float) -> ReadingMark:
    if reading.setup not in sheet.setups:
        s = reading.setup
        allowed = " | ".join(
            f"{name} {', '.join(f'{number:g}' for number in numbers)}"
            for name, numbers in (
                ("springs", sheet.springs),
                ("masses", sheet.added_masses),
                ("preloads", sheet.preloads),
            )
        )
        raise ConfigError(
            f"{path}, reading {reading.number}: {s.spring_stiffness:g} N/m, {s.added_mass:g} kg, "
            f"{s.preload:g} N is no set-up of this sheet; allowed: {allowed}"
        )
    true = sheet.jump_rpm(reading.setup)
    return ReadingMark(reading, true, abs(reading.rpm - true) <= 0.01 * tolerance * true)


def marks_table(marked: MarkedSheet) -> DataTable:
    """A row a reading."""
    recorded = marked.recorded
    truth = f"seed {recorded.seed}" if recorded.seed else "the rig's own numbers"
    return tabulate(
        f"{marked.path.name}: {recorded.cam} on {recorded.rig}, {truth}",
        marked.marks,
        (
            (Column("reading", "", "d"), lambda mark: mark.reading.number),
            (Column("spring", "N/m", "g"), lambda mark: mark.reading.setup.spring_stiffness),
            (Column("added mass", "kg", "g"), lambda mark: mark.reading.setup.added_mass),
            (Column("preload", "N", "g"), lambda mark: mark.reading.setup.preload),
            (Column("read", "rpm", ".2f"), lambda mark: mark.reading.rpm),
            (Column("true", "rpm", ".2f"), lambda mark: mark.true_rpm),
            (Column("difference", "rpm", "+.2f"), lambda mark: mark.difference_rpm),
            (Column("difference", "%", "+.2f"), lambda mark: mark.difference_percent),
            (
                Column(f"within {marked.tolerance:g} %"),
                lambda mark: "yes" if mark.within else "no",
            ),
        ),
        "True: the lowest speed at which the steady state loses contact.",
    )


def to_json(marked: list[MarkedSheet]) -> dict[str, Any]:
    """The marks as plain data, by file."""
    return {
        str(sheet.path): {
            "lab": sheet.recorded.lab,
            "cam": sheet.recorded.cam,
            "rig": sheet.recorded.rig,
            "seed": sheet.recorded.seed,
            "student": sheet.recorded.student,
            "date": sheet.recorded.date,
            "tolerance_percent": sheet.tolerance,
            "within": sum(mark.within for mark in sheet.marks),
            "readings": [
                asdict(mark.reading.setup)
                | {
                    "number": mark.reading.number,
                    "rpm": mark.reading.rpm,
                    "true_rpm": mark.true_rpm,
                    "difference_rpm": mark.difference_rpm,
                    "difference_percent": mark.difference_percent,
                    "within": mark.within,
                }
                for mark in sheet.marks
            ],
        }
        for sheet in marked
    }
