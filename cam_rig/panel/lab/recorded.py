"""A lab sheet as it is filled in: its file, and the rows as they are taken."""

from __future__ import annotations

import csv
import fcntl
import io
import math
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import IO, Any

from cam_rig.errors import ConfigError, OutputError, RefusedError
from cam_rig.files import MIB, read_bytes, shown, writing
from cam_rig.panel import is_number
from cam_rig.panel.lab.labs import LABS, lab_of
from cam_rig.panel.lab.sheet import COLUMNS, LabReading, LabSetup, LabSheet

# A sheet as a file: CSV with a head of comment lines, which a spreadsheet opens and keeps.

#: First line of a sheet, before the lab's name.
TITLE = "cam_rig lab sheet"
#: What else stands in the head, and what may be left out there.
HEAD = ("cam", "rig", "title", "seed", "student", "date")
OPTIONAL = ("seed", "student")
#: Columns that have no zero.
POSITIVE = ("reading", "speed_rpm", *(lab.answer for lab in LABS.values() if lab.answer))
#: Bytes of a sheet, and rows on it, at most.
MAX_BYTES, MAX_READINGS = MIB, 1000
#: Characters of a line of a sheet, at most. Python's reader raises an error from 131 072 on.
MAX_LINE = 10_000
#: Characters of a student's name.
MAX_NAME = 80


@dataclass(frozen=True)
class RecordedSheet:
    """A sheet with its rows: names of lab, cams and rig, the rig's title, when it was begun."""

    lab: str
    cam: str  #: two are apart by a space
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
    writer = csv.writer(out, lineterminator="\n")
    for key in HEAD:
        if value := getattr(sheet, key):
            # in one cell: what stands after a comma could become a formula
            writer.writerow([f"# {key}: {' '.join(value.split())}"])
    lab = LABS[sheet.lab]
    writer.writerow(lab.columns())
    for r in sheet.readings:
        setup = [getattr(r.setup, name) for name in lab.choices()]
        more = [*([r.measured] if lab.measured else []), *([r.answer] if lab.answer else [])]
        writer.writerow([r.number, *setup, r.rpm, *more])
    return out.getvalue()


def read_sheet(path: Path) -> RecordedSheet:
    """Read a sheet, as it was written or as a spreadsheet saved it."""
    try:
        return _parsed(read_bytes(path, MAX_BYTES).decode("utf-8-sig"))
    except UnicodeDecodeError:
        why = "is no text in UTF-8; allowed: a file that cam-rig panel --lab wrote"
    except OSError as error:
        why = f"cannot be read ({error.strerror})"
    except ConfigError as error:
        why = str(error)
    raise ConfigError(f"{path}: {why}")


def _parsed(text: str) -> RecordedSheet:
    # Line by line: no quotation mark in a name reaches beyond its own.
    lines = [line for line in text.splitlines() if line.strip(" ,")]
    if (longest := max(map(len, lines), default=0)) > MAX_LINE:
        raise ConfigError(f"a line has {longest} characters; allowed: {MAX_LINE}")
    found = dict(_entry(line) for line in lines if _is_head(line))
    body = [next(csv.reader([line])) for line in lines if not _is_head(line)]
    if not {TITLE, *HEAD} - set(OPTIONAL) <= found.keys():
        raise ConfigError("no lab sheet; allowed: a file that cam-rig panel --lab wrote")
    lab = lab_of(found[TITLE])
    if not body or tuple(cell.strip() for cell in body[0]) != lab.columns():
        raise ConfigError(f"the columns are others; allowed: {', '.join(lab.columns())}")
    if not 0 < len(body) - 1 <= MAX_READINGS:
        raise ConfigError(
            f"has {len(body) - 1} readings; allowed: 1 to {MAX_READINGS}, so record one"
        )
    readings = tuple(_reading(lab, row) for row in body[1:])
    words: dict[str, Any] = {key: found.get(key, "") for key in HEAD}
    words["seed"] = words["seed"] or None
    return RecordedSheet(found[TITLE], readings=readings, **words)


def _is_head(line: str) -> bool:
    return line.lstrip(' "').startswith("#")


def _entry(line: str) -> tuple[str, str]:
    """Key and value; a spreadsheet puts the line into quotation marks, and commas after it."""
    words = ",".join(next(csv.reader([line]))).strip("#, ")
    key, _, value = words.partition(":")
    return key.strip(), value.strip()


def _reading(lab: type[LabSheet], row: list[str]) -> LabReading:
    columns = lab.columns()
    cells = [cell.strip() for cell in row[: len(columns)]]
    where = f"reading {shown(row[0], quoted=False)}"
    if len(cells) < len(columns) or any(cell.strip() for cell in row[len(columns) :]):
        raise ConfigError(f"{where}: has {len(row)} cells; allowed: {len(columns)}")
    given = dict(zip(columns, cells, strict=True))
    # A row of such a lab has what was read, or an answer.
    answered = bool(lab.answer and given[lab.answer])
    blank = {"speed_rpm", lab.measured} if answered else {lab.answer}
    numbers = {
        name: _in_file(where, name, cell)
        for name, cell in given.items()
        if name != "cam" and not (name in blank and not cell)
    }
    chosen: dict[str, Any] = {
        name: numbers.get(column) for name, column in COLUMNS.items() if column in given
    }
    if "cam" in given:
        chosen["cam"] = None if answered else given["cam"]
    read = (numbers.get(name or "") for name in ("speed_rpm", lab.measured, lab.answer))
    return LabReading(int(numbers["reading"]), LabSetup(**chosen), *read)


def _in_file(where: str, name: str, cell: str) -> float:
    number = number_in(cell)
    if number is None or (name in POSITIVE and number <= 0.0):
        raise ConfigError(f"{where}: {name} is {shown(cell)}; allowed: a number above 0")
    return number


def number_in(text: str) -> float | None:
    """The finite number in a text, with a decimal point or a decimal comma."""
    try:
        number = float(text.strip().replace(",", "."))
    except ValueError:
        return None
    return number if math.isfinite(number) else None


# The readings of one sheet as they are taken: in a file after every one of them.

#: Decimals of a speed (rpm) that are kept.
DECIMALS = 2


class Notebook:
    """What is recorded, in a file from the first reading on; it may go on with its own."""

    def __init__(self, sheet: LabSheet, out: Path, goes_on: bool = False) -> None:
        self.sheet, self._out = sheet, out
        self.path: Path | None = None
        cams, rig = " ".join(sheet.cams), sheet.rig
        date = datetime.now().astimezone().isoformat(timespec="minutes")
        self.recorded = RecordedSheet(
            sheet.name, cams, rig.name, rig.title, date, "", sheet.seed, ()
        )
        self._lock = self._hold() if goes_on else None
        if goes_on and self._file().exists():
            self._take(self._file())

    def _file(self, number: int = 1) -> Path:
        """Where the sheet is kept; with a number where another sheet is there."""
        stem = f"lab_{self.sheet.name}_{self.sheet.seed or self.sheet.rig.name}"
        return self._out / f"{stem}{f'_{number}' if number > 1 else ''}.csv"

    def _hold(self) -> IO[str]:
        """Keep others off the sheet for as long as this one lives, however it ends."""
        place = self._file()
        try:
            self._out.mkdir(parents=True, exist_ok=True)
            lock = place.with_name(f".{place.stem}.lock").open("w")
        except OSError as error:
            raise OutputError(f"{place}: cannot be written ({error.strerror})") from None
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.close()
            raise OutputError(
                f"{place}: another panel writes it; allowed: to end that one, or another --out"
            ) from None
        return lock

    def _take(self, path: Path) -> None:
        """Go on with a sheet; refused for one of something else. An empty one was just claimed."""
        self.path = path
        if not path.stat().st_size:
            return
        there = read_sheet(path)
        for key in ("lab", "cam", "rig", "seed"):
            if getattr(there, key) != getattr(self.recorded, key):
                raise ConfigError(
                    f"{path}: is of {key} {getattr(there, key)}; allowed: of "
                    f"{getattr(self.recorded, key)}, so name another --out, or move it away"
                )
        self.recorded = there

    def setup(self, given: dict[str, Any], but: tuple[str, ...] = ()) -> LabSetup:
        """The set-up that a page names by the numbers on the sheet; ``but`` is not asked about."""
        chosen: dict[str, Any] = {}
        for name, allowed in self.sheet.options.items():
            value = given.get(name)
            if name in but:
                continue
            if isinstance(value, bool) or value not in allowed:
                words = ", ".join(f"{one:g}" if is_number(one) else one for one in allowed)
                raise RefusedError(f"{name}: is {str(value)[:40]!r}; allowed: {words}")
            chosen[name] = value
        return LabSetup(**chosen)

    def speed(self, given: dict[str, Any]) -> float:
        """The speed (rpm) that a page names."""
        rpm, (low, high) = given.get("rpm"), self.sheet.knob
        if not (is_number(rpm) and low <= rpm <= high):
            raise RefusedError(f"rpm: is {str(rpm)[:40]!r}; allowed: {low:g} to {high:g}")
        return round(float(rpm), DECIMALS)

    @property
    def next(self) -> int:
        """Number of the next row."""
        return len(self.recorded.readings) + 1

    def record(self, given: dict[str, Any]) -> LabReading:
        """Take a reading, and write the file."""
        setup, rpm = self.setup(given), self.speed(given)
        measured = None
        if self.sheet.measured:
            measured = self.sheet.turn(setup, rpm, self.next).measured
            if measured is None:
                raise RefusedError(f"reading: contact is lost at {rpm:g} rpm; allowed: below")
        return self._add(LabReading(self.next, setup, rpm, measured))

    def answer(self, given: dict[str, Any]) -> LabReading:
        """Take an answer, a number or its text, and write the file."""
        found = number_in(str(given.get("answer")))
        if not self.sheet.answer or found is None or found <= 0.0:
            what = f"a number above 0, in {self.sheet.unit}" if self.sheet.answer else "readings"
            raise RefusedError(f"answer: is {str(given.get('answer'))[:40]!r}; allowed: {what}")
        return self._add(LabReading(self.next, self.setup(given, but=("cam",)), answer=found))

    def _add(self, reading: LabReading) -> LabReading:
        readings = self.recorded.readings
        if len(readings) >= MAX_READINGS:
            raise RefusedError(
                f"reading: {MAX_READINGS} are recorded; allowed: no more, begin another sheet"
            )
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
        number = 1
        while True:
            path = self._file(number)
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
            "readings": [self._row(reading) for reading in self.recorded.readings],
        }

    def _row(self, reading: LabReading) -> dict[str, Any]:
        """With where it is in the plot, which marker it has, and whether that is full."""
        sheet, setup = self.sheet, asdict(reading.setup)
        found = {key: value for key, value in asdict(reading).items() if key != "setup"} | setup
        if reading.rpm is not None:
            x, y = sheet.point(reading)
            marker = sheet.options[sheet.marker].index(setup[sheet.marker])
            full = (
                sheet.filled is not None and setup[sheet.filled] != sheet.options[sheet.filled][0]
            )
            found["point"] = {"x": x, "y": y, "marker": marker, "full": full}
        return found
