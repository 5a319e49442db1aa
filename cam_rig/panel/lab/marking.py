"""Marks of lab sheets: differences between the answers and the true values."""

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
    """Mark of one answer on a lab sheet: its difference from the true value.

    `answer` and `true` are in the lab's unit. `within` is true if the answer is within the
    tolerance.
    """

    file: str
    lab: type[LabSheet]
    reading: LabReading
    answer: float  #: answer in the lab's unit, which is also that of the true value
    true: float
    within: bool

    @property
    def difference(self) -> float:
        """Answer minus true value, in the lab's unit."""
        return self.answer - self.true

    @property
    def difference_percent(self) -> float:
        """Answer minus true value, in % of the true value."""
        return 100.0 * self.difference / self.true


@dataclass(frozen=True)
class MarkedSheet:
    """Lab sheet with one mark per answer.

    `tolerance` is in %.
    """

    path: Path
    recorded: RecordedSheet
    marks: tuple[AnswerMark, ...]
    tolerance: float

    @property
    def correct_count(self) -> int:
        """Number of answers within the tolerance."""
        return sum(mark.within for mark in self.marks)

    @property
    def max_error_percent(self) -> float:
        """Largest absolute difference of an answer (%), infinite without an answer."""
        return max((abs(mark.difference_percent) for mark in self.marks), default=math.inf)

    @property
    def summary(self) -> str:
        """Summary of the marks of the sheet in one line."""
        errors = np.array([mark.difference_percent for mark in self.marks])
        student = f" by {self.recorded.student}" if self.recorded.student else ""
        if not errors.size:
            return f"{self.path}{student}: no answer"
        return (
            f"{self.path}{student}: {self.correct_count} of {errors.size} within "
            f"{self.tolerance:g} %; mean {errors.mean():+.2f} %, "
            f"largest {errors[np.abs(errors).argmax()]:+.2f} %"
        )


def mark_sheet(
    path: Path,
    tolerance: float | None,
    cam_of: Callable[[str], CamConfig],
    rig_of: Callable[[str], RigConfig],
) -> MarkedSheet:
    """Return a lab sheet with the marks of its answers.

    Parameters
    ----------
    path : Path
        File of the sheet.
    tolerance : float or None
        Tolerance of the answers in %, or None for that of the lab.
    cam_of, rig_of : callable
        Functions that load a cam and a rig by their names on the sheet.

    Returns
    -------
    MarkedSheet
        The sheet with one mark per answer.

    Raises
    ------
    ConfigError
        If the file is not a lab sheet, or if cam or rig cannot be loaded.
    """
    recorded = read_sheet(path)
    try:
        cams, rig = [cam_of(name) for name in recorded.cam.split()], rig_of(recorded.rig)
        sheet = lab_sheet(recorded.lab, cams, rig, recorded.seed)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None
    percent = sheet.default_tolerance if tolerance is None else tolerance
    marks = (_mark(path, sheet, reading, percent) for reading in recorded.readings)
    return MarkedSheet(path, recorded, tuple(mark for mark in marks if mark), percent)


def _mark(path: Path, sheet: LabSheet, reading: LabReading, tolerance: float) -> AnswerMark | None:
    """Return the mark of a row of a sheet, or None if it has no answer.

    `tolerance` is in %.
    """
    answer = reading.answer if sheet.answer else reading.rpm
    setup = reading.setup
    if setup not in (sheet.setups if answer is None else sheet.answerable_setups):
        units = {"spring_stiffness": "N/m", "added_mass": "kg", "preload": "N", "cam": ""}
        values = [
            f"{_option_text(getattr(setup, name))} {units[name]}".strip() for name in sheet.options
        ]
        allowed = " | ".join(
            f"{name} {', '.join(map(_option_text, values))}"
            for name, values in sheet.options.items()
        )
        raise ConfigError(
            f"{path}, reading {reading.number}: {', '.join(values)} is not a set-up of this sheet; "
            f"allowed: {allowed}"
        )
    if answer is None:
        return None
    true = sheet.true(setup)
    within = abs(answer - true) <= 0.01 * tolerance * true
    return AnswerMark(str(path), type(sheet), reading, answer, true, within)


def _option_text(value: float | str | None) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


@dataclass(frozen=True, repr=False)
class MarksResult(Result):
    """Marks of lab sheets: each answer compared with the true value."""

    schema = "cam_rig.panel_marks.3"
    plot_function = "cam_rig.panel.lab.figures:marks_figure"
    columns: ClassVar = {
        "answers": (
            Column("file"),
            Column("reading", "", "d", of="reading.number"),
            Column("question", of="lab.question"),
            Column("spring_stiffness", "N/m", "g", "spring", "reading.setup.spring_stiffness"),
            Column("added_mass", "kg", "g", of="reading.setup.added_mass"),
            Column("preload", "N", "g", of="reading.setup.preload"),
            Column("answer", "", ".2f", doc="in the given unit"),
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
            Column("seed", of="recorded.seed", missing="the numbers of the rig"),
            Column("student", of="recorded.student"),
            Column("date", of="recorded.date", hidden=True),
            Column("tolerance", "%", "g", of=lambda sheet: 0.01 * sheet.tolerance),
            Column("answers", "", "d", of=lambda sheet: len(sheet.marks)),
            Column("within", "", "d", of="correct_count", doc="answers within the tolerance"),
        ),
    }

    sheets: tuple[MarkedSheet, ...]

    def tables(self) -> list[Records]:
        """Return the tables `answers`, grouped by sheet, and `sheets`."""
        rows = [mark for sheet in self.sheets for mark in sheet.marks]
        labs = [LABS[name] for name in dict.fromkeys(s.recorded.lab for s in self.sheets)]
        note = "; ".join(f"{lab.question}: {lab.truth}" for lab in labs)
        return [
            self.table("answers", "{file}", rows, f"True {note}.", group_by="file"),
            self.table("sheets", "Sheets", self.sheets),
        ]

    def summary(self) -> list[str]:
        """Return one line on the marks of each sheet."""
        return [sheet.summary for sheet in self.sheets]
