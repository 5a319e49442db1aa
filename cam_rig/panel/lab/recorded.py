"""Recorded lab sheet: its file, and the notebook that records the rows."""

from __future__ import annotations

import csv
import fcntl
import io
import math
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from itertools import count
from pathlib import Path
from typing import IO, Any

from cam_rig.errors import ConfigError, OutputError, RefusedError
from cam_rig.files import MIB, atomic_write, read_bytes, shorten
from cam_rig.panel import is_number
from cam_rig.panel.lab.labs import LABS, lab_of
from cam_rig.panel.lab.sheet import COLUMNS, LabReading, LabSetup, LabSheet

# The file of a sheet: CSV with a header of comment lines, which a spreadsheet preserves.

#: Key of the first line of a sheet's file. The value of this key is the lab's name.
TITLE = "cam_rig lab sheet"
#: Keys of the other header lines of a sheet's file.
HEADER_KEYS = ("cam", "rig", "title", "seed", "student", "date")
#: Keys of header lines that may be missing.
OPTIONAL_KEYS = ("seed", "student")
#: Names of the columns of a sheet's file whose numbers must be above 0.
POSITIVE_COLUMNS = ("reading", "speed_rpm", *(lab.answer for lab in LABS.values() if lab.answer))
#: Largest size of a sheet's file, bytes.
MAX_BYTES = MIB
#: Largest number of rows of a sheet.
MAX_READINGS = 1000
#: Largest number of characters of a line of the file. Python's CSV reader fails from 131 072 on.
MAX_LINE_LENGTH = 10_000
#: Largest number of characters of a student's name.
MAX_NAME = 80


@dataclass(frozen=True)
class RecordedSheet:
    """Lab sheet with its recorded rows.

    It contains the names of lab, cams, rig and student, the rig's title, the date at which the
    sheet was started, and the seed, None for the numbers of the rig.
    """

    lab: str
    cam: str  #: names of the cams, separated by a space
    rig: str
    title: str
    date: str
    student: str
    seed: str | None
    readings: tuple[LabReading, ...]


def to_text(sheet: RecordedSheet) -> str:
    """Return the text of the file of a lab sheet."""
    out = io.StringIO()
    out.write(f"# {TITLE}: {sheet.lab}\n")
    writer = csv.writer(out, lineterminator="\n")
    for key in HEADER_KEYS:
        if value := getattr(sheet, key):
            # one cell, because a spreadsheet could take text after a comma for a formula
            writer.writerow([f"# {key}: {' '.join(value.split())}"])
    lab = LABS[sheet.lab]
    writer.writerow(lab.columns())
    for r in sheet.readings:
        setup = [getattr(r.setup, name) for name in lab.choices()]
        values = [*([r.measured] if lab.measured else []), *([r.answer] if lab.answer else [])]
        writer.writerow([r.number, *setup, r.rpm, *values])
    return out.getvalue()


def read_sheet(path: Path) -> RecordedSheet:
    """Read the file of a lab sheet, as the panel or a spreadsheet wrote it.

    Raises ConfigError if the file is not a lab sheet, or if a row is not valid.
    """
    try:
        return _parse(read_bytes(path, MAX_BYTES).decode("utf-8-sig"))
    except UnicodeDecodeError:
        reason = "is not UTF-8 text; allowed: a file that cam-rig lab wrote"
    except OSError as error:
        reason = f"cannot be read ({error.strerror})"
    except ConfigError as error:
        reason = str(error)
    raise ConfigError(f"{path}: {reason}")


def _parse(text: str) -> RecordedSheet:
    # Lines are parsed one by one, so that a quotation mark in a name affects only its line.
    lines = [line for line in text.splitlines() if line.strip(" ,")]
    if (longest := max(map(len, lines), default=0)) > MAX_LINE_LENGTH:
        raise ConfigError(f"a line has {longest} characters; allowed: {MAX_LINE_LENGTH}")
    header = {}
    for line in filter(_is_header, lines):
        # A spreadsheet puts a header line into quotation marks and appends commas.
        key, _, value = ",".join(next(csv.reader([line]))).strip("#, ").partition(":")
        header[key.strip()] = value.strip()
    body = [next(csv.reader([line])) for line in lines if not _is_header(line)]
    if not {TITLE, *HEADER_KEYS} - set(OPTIONAL_KEYS) <= header.keys():
        raise ConfigError("not a lab sheet; allowed: a file that cam-rig lab wrote")
    lab = lab_of(header[TITLE])
    if not body or tuple(cell.strip() for cell in body[0]) != lab.columns():
        raise ConfigError(f"the columns differ; allowed: {', '.join(lab.columns())}")
    if not 0 < len(body) - 1 <= MAX_READINGS:
        raise ConfigError(f"has {len(body) - 1} readings; allowed: 1 to {MAX_READINGS}")
    readings = tuple(_reading(lab, row) for row in body[1:])
    values: dict[str, Any] = {key: header.get(key, "") for key in HEADER_KEYS}
    values["seed"] = values["seed"] or None
    return RecordedSheet(header[TITLE], readings=readings, **values)


def _is_header(line: str) -> bool:
    return line.lstrip(' "').startswith("#")


def _reading(lab: type[LabSheet], row: list[str]) -> LabReading:
    columns = lab.columns()
    cells = [cell.strip() for cell in row[: len(columns)]]
    context = f"reading {shorten(row[0], quoted=False)}"
    if len(cells) < len(columns) or any(cell.strip() for cell in row[len(columns) :]):
        raise ConfigError(f"{context}: has {len(row)} cells; allowed: {len(columns)}")
    texts = dict(zip(columns, cells, strict=True))
    # If the lab has a column for answers, a row contains either a reading or an answer.
    is_answer = bool(lab.answer and texts[lab.answer])
    blank = {"speed_rpm", lab.measured} if is_answer else {lab.answer}
    numbers: dict[str, float] = {}
    for name, cell in texts.items():
        if name == "cam" or (name in blank and not cell):
            continue
        number = parse_number(cell)
        if number is None or (name in POSITIVE_COLUMNS and number <= 0.0):
            raise ConfigError(f"{context}: {name} is {shorten(cell)}; allowed: a number above 0")
        numbers[name] = number
    chosen: dict[str, Any] = {
        name: numbers.get(column) for name, column in COLUMNS.items() if column in texts
    }
    if "cam" in texts:
        chosen["cam"] = None if is_answer else texts["cam"]
    read = (numbers.get(name or "") for name in ("speed_rpm", lab.measured, lab.answer))
    return LabReading(int(numbers["reading"]), LabSetup(**chosen), *read)


def parse_number(text: str) -> float | None:
    """Return the finite number in a text with a decimal point or comma, else None."""
    try:
        number = float(text.strip().replace(",", "."))
    except ValueError:
        return None
    return number if math.isfinite(number) else None


# The readings of one sheet, written to its file after each reading.

#: Number of decimals of a recorded speed (rpm).
SPEED_DECIMALS = 2


class Notebook:
    """Notebook that records the rows of a lab sheet.

    It has a file from the first reading on. If `resumes` is true, it continues the sheet's file and
    locks it against other panels.
    """

    def __init__(self, sheet: LabSheet, out: Path, resumes: bool = False) -> None:
        self.sheet, self._out = sheet, out
        self.path: Path | None = None
        cams, rig = " ".join(sheet.cams), sheet.rig
        date = datetime.now().astimezone().isoformat(timespec="minutes")
        self.recorded = RecordedSheet(
            sheet.name, cams, rig.name, rig.title, date, "", sheet.seed, ()
        )
        self._lock = self._acquire_lock() if resumes else None
        if resumes and self._path().exists():
            self._resume(self._path())

    def _path(self, number: int = 1) -> Path:
        """Return the path of the sheet's file.

        A number above 1 is added to the name.
        """
        stem = f"lab_{self.sheet.name}_{self.sheet.seed or self.sheet.rig.name}"
        return self._out / f"{stem}{f'_{number}' if number > 1 else ''}.csv"

    def _acquire_lock(self) -> IO[str]:
        """Lock the sheet for the lifetime of the notebook.

        The operating system releases the lock even if the process is killed. Raises OutputError if
        another panel has the lock.
        """
        path = self._path()
        try:
            self._out.mkdir(parents=True, exist_ok=True)
            lock = path.with_name(f".{path.stem}.lock").open("w")
        except OSError as error:
            raise OutputError(f"{path}: cannot be written ({error.strerror})") from None
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.close()
            raise OutputError(
                f"{path}: another panel writes it; end that panel, or use another --out"
            ) from None
        return lock

    def _resume(self, path: Path) -> None:
        """Read the recorded sheet from its file, and write further readings to this file.

        An empty file, which a process created just before it ended, contains no readings. Raises
        ConfigError if the file is the sheet of another lab, cam, rig or seed.
        """
        self.path = path
        if not path.stat().st_size:
            return
        stored = read_sheet(path)
        for key in ("lab", "cam", "rig", "seed"):
            if getattr(stored, key) != getattr(self.recorded, key):
                raise ConfigError(
                    f"{path}: {key} is {getattr(stored, key)}; allowed: "
                    f"{getattr(self.recorded, key)}; use another --out, or move the file"
                )
        self.recorded = stored

    def setup(self, data: dict[str, Any], ignored: tuple[str, ...] = ()) -> LabSetup:
        """Return the set-up that the data of a page select.

        The fields in `ignored` are None. Raises RefusedError if a value is not an option of the
        sheet.
        """
        chosen: dict[str, Any] = {}
        for name, allowed in self.sheet.options.items():
            value = data.get(name)
            if name in ignored:
                continue
            if isinstance(value, bool) or value not in allowed:
                text = ", ".join(f"{v:g}" if is_number(v) else v for v in allowed)
                raise RefusedError(f"{name}: is {str(value)[:40]!r}; allowed: {text}")
            chosen[name] = value
        return LabSetup(**chosen)

    def speed(self, data: dict[str, Any]) -> float:
        """Return the speed (rpm) in a page's data.

        Raises RefusedError if it is outside the range of the knob.
        """
        rpm, (low, high) = data.get("rpm"), self.sheet.knob
        if not (is_number(rpm) and low <= rpm <= high):
            raise RefusedError(f"rpm: is {str(rpm)[:40]!r}; allowed: {low:g} to {high:g}")
        return round(float(rpm), SPEED_DECIMALS)

    @property
    def next_number(self) -> int:
        """Number of the next row of the sheet."""
        return len(self.recorded.readings) + 1

    def record(self, data: dict[str, Any]) -> LabReading:
        """Record a reading, write the file, and return the reading.

        Raises RefusedError if the data are not valid, or if contact is lost and a value must be
        measured.
        """
        setup, rpm = self.setup(data), self.speed(data)
        measured = None
        if self.sheet.measured:
            measured = self.sheet.turn(setup, rpm, self.next_number).measured
            if measured is None:
                raise RefusedError(f"reading: contact is lost at {rpm:g} rpm; allowed: below")
        return self._add(LabReading(self.next_number, setup, rpm, measured))

    def answer(self, data: dict[str, Any]) -> LabReading:
        """Record an answer, write the file, and return the row.

        The answer is a number or its text. Raises RefusedError if it is not a number above 0.
        """
        text = str(data.get("answer"))
        value = parse_number(text)
        if not self.sheet.answer or value is None or value <= 0.0:
            rule = f"a number above 0, in {self.sheet.unit}" if self.sheet.answer else "readings"
            raise RefusedError(f"answer: is {text[:40]!r}; allowed: {rule}")
        setup = self.setup(data, ignored=("cam",))
        return self._add(LabReading(self.next_number, setup, answer=value))

    def _add(self, reading: LabReading) -> LabReading:
        readings = self.recorded.readings
        if len(readings) >= MAX_READINGS:
            raise RefusedError(f"reading: limit of {MAX_READINGS} reached; start another sheet")
        self._save(replace(self.recorded, readings=(*readings, reading)))
        return reading

    def set_student(self, data: dict[str, Any]) -> None:
        """Write the name of the student in a page's data on the sheet.

        Raises RefusedError if the name is not allowed.
        """
        student = data.get("student")
        if not isinstance(student, str) or len(student) > MAX_NAME or not student.isprintable():
            raise RefusedError(f"student: allowed: a line of {MAX_NAME} characters")
        self._save(replace(self.recorded, student=student.strip()))

    def _save(self, recorded: RecordedSheet) -> None:
        if recorded.readings:
            self.path = self.path or self._create_file()
            with atomic_write(self.path) as temporary:
                temporary.write_text(to_text(recorded), encoding="utf-8")
        self.recorded = recorded

    def _create_file(self) -> Path:
        """Create a new file for the sheet, and return its path.

        Existing files are not overwritten.
        """
        path = next(path for path in map(self._path, count(1)) if not path.exists())
        try:
            self._out.mkdir(parents=True, exist_ok=True)
            path.open("x").close()
        except FileExistsError:
            if path.exists():  # created by another panel meanwhile
                return self._create_file()
            raise OutputError(f"{self._out}: is a file; allowed: a folder") from None
        except OSError as error:
            raise OutputError(f"{path}: cannot be written ({error.strerror})") from None
        return path

    def page_data(self) -> dict[str, Any]:
        """Return the data that a page displays of the notebook."""
        return {
            "student": self.recorded.student,
            "file": None if self.path is None else str(self.path),
            "readings": [self._row(reading) for reading in self.recorded.readings],
        }

    def _row(self, reading: LabReading) -> dict[str, Any]:
        """Return a reading with its position and marker in the plot."""
        sheet, setup = self.sheet, asdict(reading.setup)
        row = {key: value for key, value in asdict(reading).items() if key != "setup"} | setup
        if reading.rpm is not None:
            x, y = sheet.point(reading)
            marker = sheet.options[sheet.marker].index(setup[sheet.marker])
            name = sheet.filled
            is_filled = name is not None and setup[name] != sheet.options[name][0]
            row["point"] = {"x": x, "y": y, "marker": marker, "is_filled": is_filled}
        return row
