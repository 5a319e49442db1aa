"""A sheet as a file: CSV with a head of comment lines, which a spreadsheet opens and keeps."""

from __future__ import annotations

import csv
import io
import math
from dataclasses import asdict, astuple, dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any

from cam_rig.errors import ConfigError, OutputError, RefusedError
from cam_rig.files import MIB, read_bytes, shown, writing
from cam_rig.panel.lab.sheet import LabSetup, LabSheet

#: First line of a sheet, before the lab's name.
TITLE = "cam_rig lab sheet"
#: What else stands in the head, and what may be left out there.
HEAD = ("cam", "rig", "title", "seed", "student", "date")
OPTIONAL = ("seed", "student")
COLUMNS = ("reading", "spring_N_m", "added_mass_kg", "preload_N", "speed_rpm")
#: Bytes of a sheet, and readings on it, at most.
MAX_BYTES, MAX_READINGS = MIB, 1000
#: Characters of a student's name.
MAX_NAME = 80


@dataclass(frozen=True)
class LabReading:
    """A reading: its number from 1 on, the set-up by the sheet's numbers, and the speed (rpm)."""

    number: int
    setup: LabSetup
    rpm: float


@dataclass(frozen=True)
class RecordedSheet:
    """A sheet with its readings: names of lab, cam and rig, the rig's title, when it was begun."""

    lab: str
    cam: str
    rig: str
    title: str
    date: str
    student: str
    seed: str | None
    readings: tuple[LabReading, ...]


def to_text(sheet: RecordedSheet) -> str:
    """The file's text."""
    out = io.StringIO()
    out.write(f"# {TITLE}: {sheet.lab}\n")
    for key in HEAD:
        if value := getattr(sheet, key):
            out.write(f"# {key}: {' '.join(value.split())}\n")
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(COLUMNS)
    for reading in sheet.readings:
        writer.writerow([reading.number, *astuple(reading.setup), reading.rpm])
    return out.getvalue()


def read_sheet(path: Path) -> RecordedSheet:
    """Read a sheet, as it was written or as a spreadsheet saved it."""
    try:
        text = read_bytes(path, MAX_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError:
        why = "is no text in UTF-8; allowed: a file that cam-rig panel --lab wrote"
        raise ConfigError(f"{path}: {why}") from None
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from None
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None
    # Line by line: no quotation mark in a name reaches beyond its own.
    lines = [line for line in text.splitlines() if line.strip(" ,")]
    found = dict(_entry(line) for line in lines if _is_head(line))
    body = [next(csv.reader([line])) for line in lines if not _is_head(line)]
    known = {TITLE, *HEAD}
    if not {TITLE, *HEAD} - set(OPTIONAL) <= found.keys() & known:
        raise ConfigError(f"{path}: no lab sheet; allowed: a file that cam-rig panel --lab wrote")
    if not body or tuple(cell.strip() for cell in body[0]) != COLUMNS:
        raise ConfigError(f"{path}: the columns are others; allowed: {', '.join(COLUMNS)}")
    if not 0 < len(body) - 1 <= MAX_READINGS:
        raise ConfigError(
            f"{path}: has {len(body) - 1} readings; allowed: 1 to {MAX_READINGS}, so record one"
        )
    readings = tuple(_reading(path, row) for row in body[1:])
    return RecordedSheet(
        found[TITLE],
        found["cam"],
        found["rig"],
        found["title"],
        found["date"],
        found.get("student", ""),
        found.get("seed") or None,
        readings,
    )


def _is_head(line: str) -> bool:
    return line.lstrip(' "').startswith("#")


def _entry(line: str) -> tuple[str, str]:
    """Key and value; a spreadsheet puts the line into quotation marks, and commas after it."""
    words = ",".join(next(csv.reader([line]))).strip("#, ")
    key, _, value = words.partition(":")
    return key.strip(), value.strip()


def _reading(path: Path, row: list[str]) -> LabReading:
    """A reading of a row."""
    cells = [cell.strip() for cell in row[: len(COLUMNS)]]
    where = f"{path}, reading {shown(row[0], quoted=False)}"
    if len(cells) < len(COLUMNS) or any(cell.strip() for cell in row[len(COLUMNS) :]):
        raise ConfigError(f"{where}: has {len(row)} cells; allowed: {len(COLUMNS)}")
    numbers = []
    for name, cell in zip(COLUMNS, cells, strict=True):
        try:
            number = float(cell)
        except ValueError:
            number = math.nan
        if not math.isfinite(number) or (name in COLUMNS[::4] and number <= 0.0):
            raise ConfigError(f"{where}: {name} is {shown(cell)}; allowed: a number above 0")
        numbers.append(number)
    return LabReading(int(numbers[0]), LabSetup(*numbers[1:4]), numbers[4])


# The readings of one sheet as they are taken: in a file after every one of them.

#: Decimals of a speed (rpm) that are kept.
DECIMALS = 2


class Notebook:
    """What has been recorded on a sheet; the file in ``out`` is made with the first reading."""

    def __init__(self, sheet: LabSheet, out: Path) -> None:
        self.sheet, self._out = sheet, out
        self.path: Path | None = None
        cam, rig = sheet.cam.name, sheet.rig
        date = datetime.now().astimezone().isoformat(timespec="minutes")
        self.recorded = RecordedSheet(
            sheet.name, cam, rig.name, rig.title, date, "", sheet.seed, ()
        )

    def setup(self, given: dict[str, Any]) -> LabSetup:
        """The set-up that a page names by the numbers on the sheet."""
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
        """The speed (rpm) that a page names."""
        rpm, (low, high) = given.get("rpm"), self.sheet.knob
        is_number = isinstance(rpm, int | float) and not isinstance(rpm, bool)
        if not is_number or not low <= rpm <= high:  # type: ignore[operator]
            raise RefusedError(f"rpm: is {str(rpm)[:40]!r}; allowed: {low:g} to {high:g}")
        return round(float(rpm), DECIMALS)  # type: ignore[arg-type]

    def record(self, given: dict[str, Any]) -> LabReading:
        """Take a reading, and write the file."""
        readings = self.recorded.readings
        if len(readings) >= MAX_READINGS:
            raise RefusedError(
                f"reading: {MAX_READINGS} are recorded; allowed: no more, begin another sheet"
            )
        reading = LabReading(len(readings) + 1, self.setup(given), self.speed(given))
        self._keep(replace(self.recorded, readings=(*readings, reading)))
        return reading

    def name(self, student: Any) -> None:
        """Put the student's name on the sheet."""
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
        """A file of one's own: another's is not overwritten."""
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
