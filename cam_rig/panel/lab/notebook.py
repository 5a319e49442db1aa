"""The readings of one sheet as they are taken: in a file after every one of them."""

from __future__ import annotations

from dataclasses import asdict, replace
from datetime import datetime
from pathlib import Path
from typing import Any

from cam_rig.errors import OutputError, RefusedError
from cam_rig.files import writing
from cam_rig.panel.lab.sheet import LabSheet
from cam_rig.panel.lab.sheet_file import (
    MAX_NAME,
    MAX_READINGS,
    LabReading,
    RecordedSheet,
    to_text,
)
from cam_rig.panel.lab.truth import LabSetup

#: Decimals of a speed (rpm) that are kept.
DECIMALS = 2


class Notebook:
    """What has been recorded on a sheet.

    Parameters
    ----------
    sheet : that is worked on
    out : folder of the file, which is made with the first reading
    """

    def __init__(self, sheet: LabSheet, out: Path) -> None:
        self.sheet, self._out = sheet, out
        self.path: Path | None = None
        cam, rig = sheet.cam.name, sheet.rig
        date = datetime.now().astimezone().isoformat(timespec="minutes")
        self.recorded = RecordedSheet(
            sheet.name, cam, rig.name, rig.title, date, "", sheet.seed, ()
        )

    def setup(self, given: dict[str, Any]) -> LabSetup:
        """The set-up that a page names by the numbers on the sheet.

        Raises
        ------
        RefusedError : the sheet has no such set-up
        """
        names = {
            "spring_stiffness": self.sheet.springs,
            "added_mass": self.sheet.added_masses,
            "preload": self.sheet.preloads,
        }
        for name, allowed in names.items():
            value = given.get(name)
            if isinstance(value, bool) or value not in allowed:
                words = ", ".join(f"{number:g}" for number in allowed)
                raise RefusedError(f"{name}: is {str(value)[:40]!r}; allowed: {words}")
        return LabSetup(*(float(given[name]) for name in names))

    def speed(self, given: dict[str, Any]) -> float:
        """The speed (rpm) that a page names.

        Raises
        ------
        RefusedError : it is no number, or beyond the knob's
        """
        rpm, (low, high) = given.get("rpm"), self.sheet.knob
        is_number = isinstance(rpm, int | float) and not isinstance(rpm, bool)
        if not is_number or not low <= rpm <= high:  # type: ignore[operator]
            raise RefusedError(f"rpm: is {str(rpm)[:40]!r}; allowed: {low:g} to {high:g}")
        return round(float(rpm), DECIMALS)  # type: ignore[arg-type]

    def record(self, given: dict[str, Any]) -> LabReading:
        """Take a reading, and write the file.

        Raises
        ------
        RefusedError : no such set-up or speed, or too many readings
        OutputError : it cannot be written; the reading is then not taken
        """
        readings = self.recorded.readings
        if len(readings) >= MAX_READINGS:
            raise RefusedError(
                f"reading: {MAX_READINGS} are recorded; allowed: no more, begin another sheet"
            )
        reading = LabReading(len(readings) + 1, self.setup(given), self.speed(given))
        self._keep(replace(self.recorded, readings=(*readings, reading)))
        return reading

    def name(self, student: Any) -> None:
        """Put the student's name on the sheet.

        Raises
        ------
        RefusedError : it is no line of text
        OutputError : it cannot be written
        """
        if not isinstance(student, str) or len(student) > MAX_NAME or not student.isprintable():
            raise RefusedError(f"student: allowed: a line of {MAX_NAME} characters")
        self._keep(replace(self.recorded, student=student.strip()))

    def _keep(self, recorded: RecordedSheet) -> None:
        if recorded.readings:
            self.path = self.path or self._claim()
            with writing(self.path) as part:
                part.write_text(to_text(recorded), encoding="utf-8")
        self.recorded = recorded

    def _claim(self) -> Path:
        """A file of one's own: another's is not overwritten.

        Raises
        ------
        OutputError : none can be made
        """
        stem, number = f"lab_{self.sheet.name}_{self.sheet.seed or self.sheet.rig.name}", 1
        while True:
            path = self._out / f"{stem}{f'_{number}' if number > 1 else ''}.csv"
            try:
                self._out.mkdir(parents=True, exist_ok=True)
                path.open("x").close()
                return path
            except FileExistsError:
                if not path.exists():  # the folder is a file
                    raise OutputError(f"{self._out}: is a file; allowed: a folder") from None
                number += 1
            except OSError as error:
                raise OutputError(f"{path}: cannot be written ({error.strerror})") from None

    def page(self) -> dict[str, Any]:
        """What a page is shown of it."""
        return {
            "student": self.recorded.student,
            "file": None if self.path is None else str(self.path),
            "readings": [
                {"number": r.number, "rpm": r.rpm, "load": self.sheet.load(r.setup)}
                | asdict(r.setup)
                for r in self.recorded.readings
            ],
        }
