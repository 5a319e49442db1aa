"""How far the answers on a sheet are from the truth."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from cam_rig.errors import ConfigError
from cam_rig.panel.lab.labs import LABS, lab_sheet
from cam_rig.panel.lab.recorded import RecordedSheet, read_sheet
from cam_rig.panel.lab.sheet import LabReading, LabSheet
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.show.result import Column, Records, Result


@dataclass(frozen=True)
class AnswerMark:
    """An answer of a file, the true value of its set-up, whether it is near enough."""

    file: str
    lab: type[LabSheet]
    reading: LabReading
    answer: float  #: in the lab's unit, as the true value
    true: float
    within: bool

    @property
    def difference(self) -> float:
        """Answer less truth."""
        return self.answer - self.true

    @property
    def difference_percent(self) -> float:
        """The same in % of the truth."""
        return 100.0 * self.difference / self.true


@dataclass(frozen=True)
class MarkedSheet:
    """A sheet with a mark an answer, which is right within a tolerance (%)."""

    path: Path
    recorded: RecordedSheet
    marks: tuple[AnswerMark, ...]
    tolerance: float

    @property
    def right(self) -> int:
        """How many answers are near enough."""
        return sum(mark.within for mark in self.marks)

    @property
    def farthest(self) -> float:
        """How far (%) the farthest answer is off; infinite without one."""
        return max((abs(mark.difference_percent) for mark in self.marks), default=math.inf)

    @property
    def summary(self) -> str:
        """What the sheet comes to, in a line."""
        off = np.array([mark.difference_percent for mark in self.marks])
        who = f" by {self.recorded.student}" if self.recorded.student else ""
        if not off.size:
            return f"{self.path}{who}: no answer"
        return (
            f"{self.path}{who}: {self.right} of {off.size} within {self.tolerance:g} %; mean "
            f"{off.mean():+.2f} %, farthest {off[np.abs(off).argmax()]:+.2f} %"
        )


def mark_sheet(
    path: Path,
    tolerance: float | None,
    cam_of: Callable[[str], CamConfig],
    rig_of: Callable[[str], RigConfig],
) -> MarkedSheet:
    """Mark a sheet with a tolerance (%, None: the lab's); others read files by names on it."""
    recorded = read_sheet(path)
    try:
        cams, rig = [cam_of(name) for name in recorded.cam.split()], rig_of(recorded.rig)
        sheet = lab_sheet(recorded.lab, cams, rig, recorded.seed)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None
    within = sheet.within if tolerance is None else tolerance
    marks = (_mark(path, sheet, reading, within) for reading in recorded.readings)
    return MarkedSheet(path, recorded, tuple(mark for mark in marks if mark), within)


def _mark(path: Path, sheet: LabSheet, reading: LabReading, tolerance: float) -> AnswerMark | None:
    """None where a reading answers nothing."""
    answer = reading.answer if sheet.answer else reading.rpm
    setup = reading.setup
    if setup not in (sheet.setups if answer is None else sheet.asked_setups):
        units = {"spring_stiffness": "N/m", "added_mass": "kg", "preload": "N", "cam": ""}
        given = [f"{_shown(getattr(setup, name))} {units[name]}".strip() for name in sheet.options]
        allowed = " | ".join(
            f"{name} {', '.join(map(_shown, values))}" for name, values in sheet.options.items()
        )
        raise ConfigError(
            f"{path}, reading {reading.number}: {', '.join(given)} is no set-up of this sheet; "
            f"allowed: {allowed}"
        )
    if answer is None:
        return None
    true = sheet.true(setup)
    within = abs(answer - true) <= 0.01 * tolerance * true
    return AnswerMark(str(path), type(sheet), reading, answer, true, within)


def _shown(value: float | str | None) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


@dataclass(frozen=True, repr=False)
class MarksResult(Result):
    """The marks of sheets: each answer beside the true value."""

    schema = "cam_rig.panel_marks.2"
    plot_function = "cam_rig.panel.lab.figures:marks_figure"
    columns: ClassVar = {
        "answers": (
            Column("file"),
            Column("reading", "", "d", of="reading.number"),
            Column("asked", of="lab.asked"),
            Column("spring_stiffness", "N/m", "g", "spring", "reading.setup.spring_stiffness"),
            Column("added_mass", "kg", "g", of="reading.setup.added_mass"),
            Column("preload", "N", "g", of="reading.setup.preload"),
            Column("answer", "", ".2f", doc="in the unit beside it"),
            Column("true", "", ".2f"),
            Column("unit", of="lab.unit"),
            Column("difference", "%", "+.2f", of=lambda mark: 0.01 * mark.difference_percent),
            Column("within", cell=lambda mark: "yes" if mark.within else "no"),
        ),
        "sheets": (
            Column("file", of=lambda sheet: str(sheet.path)),
            Column("lab", of="recorded.lab", hidden=True),
            Column("cam", of="recorded.cam"),
            Column("rig", of="recorded.rig"),
            Column("seed", of="recorded.seed", missing="the rig's own numbers"),
            Column("student", of="recorded.student"),
            Column("date", of="recorded.date", hidden=True),
            Column("tolerance", "%", "g", of=lambda sheet: 0.01 * sheet.tolerance),
            Column("answers", "", "d", of=lambda sheet: len(sheet.marks)),
            Column("within", "", "d", of="right", doc="answers that are"),
        ),
    }

    sheets: tuple[MarkedSheet, ...]

    def tables(self) -> list[Records]:
        """``answers``, sheet by sheet, and ``sheets``."""
        rows = [mark for sheet in self.sheets for mark in sheet.marks]
        labs = [LABS[name] for name in dict.fromkeys(s.recorded.lab for s in self.sheets)]
        note = "; ".join(f"{lab.asked}: {lab.truth}" for lab in labs)
        return [
            self.table("answers", "{file}", rows, f"True {note}.", group_by="file"),
            self.table("sheets", "Sheets", self.sheets),
        ]

    def summary(self) -> list[str]:
        """A line a sheet."""
        return [sheet.summary for sheet in self.sheets]
