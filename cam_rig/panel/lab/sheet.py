"""Lab sheets: what a student is asked for, and the set-ups that there are for it."""

from __future__ import annotations

import csv
import hashlib
import io
import math
import re
from dataclasses import asdict, astuple, dataclass, replace
from datetime import datetime
from functools import cached_property, lru_cache
from itertools import product
from pathlib import Path
from typing import Any

from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.jump.any_follower import AnyFollower, find_jump, follower_of
from cam_rig.dynamics.jump.jump_speed import rigid_jump
from cam_rig.errors import ConfigError, OutputError, RefusedError, did_you_mean
from cam_rig.files import MIB, read_bytes, shown, writing
from cam_rig.laws import Law, build_law
from cam_rig.laws.cam import require_sprung
from cam_rig.panel import is_number
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.units import RPM

# The rig that readings are taken on: the file's own, or another that a name hides.

#: By which part the hidden rig's numbers may differ from those on the sheet, either way.
TOLERANCES = {"spring_stiffness": 0.08, "mass": 0.04, "preload": 0.15, "damping": 0.25}
#: A seed is part of a file's name.
SEED_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,39}")


@dataclass(frozen=True)
class LabSetup:
    """One set-up by the sheet: spring (N/m), weight on the follower (kg), preload (N)."""

    spring_stiffness: float
    added_mass: float
    preload: float


def drawn(lab: str, seed: str, number: str, tolerance: float) -> float:
    """The factor on a number: in 1 ± ``tolerance``, evenly, the same for the same words."""
    data = hashlib.sha256(f"cam_rig\n{lab}\n{seed}\n{number}".encode()).digest()
    return 1.0 + tolerance * (2.0 * int.from_bytes(data[:8], "big") / (2**64 - 1) - 1.0)


def true_rig(rig: RigConfig, setup: LabSetup, lab: str, seed: str | None) -> RigConfig:
    """The sheet's rig as it is set up, with its true numbers; no seed: the sheet's own."""

    def factor(kind: str, which: float) -> float:
        if seed is None:
            return 1.0
        return drawn(lab, seed, f"{kind} {which:.6g}", TOLERANCES[kind])

    own = rig.follower
    numbers = {
        "spring_stiffness": setup.spring_stiffness
        * factor("spring_stiffness", setup.spring_stiffness),
        # the follower, and each weight, is a body of its own
        "mass": own.mass.si * factor("mass", 0.0)
        + setup.added_mass * factor("mass", setup.added_mass),
        "preload": setup.preload * factor("preload", setup.preload),
        "damping": own.damping.si * factor("damping", 0.0),
    }
    if own.stem_damping is not None:
        numbers["stem_damping"] = own.stem_damping.si * factor("damping", 1.0)
    return rig.with_follower(**numbers)


@dataclass(frozen=True)
class Lab:
    """The set-ups of a lab: springs and preloads as parts of the rig's own, masses in kg."""

    springs: tuple[float, ...]
    added_masses: tuple[float, ...]
    preloads: tuple[float, ...]


#: The labs that there are. The texts of a page have the task of each.
LABS = {"jump": Lab(springs=(0.75, 1.0, 1.5), added_masses=(0.0, 0.5, 1.0), preloads=(1.0, 2.0))}
#: The knob begins and ends at these parts of the least and the greatest speed that one expects.
KNOB_FROM, KNOB_TO = 0.5, 1.25


@dataclass(frozen=True)
class LabSheet:
    """A lab on one cam and one rig; ``seed`` names another one that is measured in truth."""

    name: str
    cam: CamConfig
    rig: RigConfig
    seed: str | None = None

    def __post_init__(self) -> None:
        if self.name not in LABS:
            like = did_you_mean(self.name, LABS)
            raise ConfigError(f"--lab: is {shown(self.name)}; allowed: {', '.join(LABS)}{like}")
        if self.seed is not None and not SEED_NAME.fullmatch(self.seed):
            raise ConfigError(
                f"--seed: is {shown(self.seed)}; allowed: a name of 1 to 40 letters, digits, - and "
                "_"
            )
        require_sprung(Path(self.cam.name), self.cam)

    @cached_property
    def law(self) -> Law:
        """The cam's."""
        return build_law(self.cam)

    @property
    def springs(self) -> list[float]:
        """Stiffness (N/m) of each spring, to three digits as a catalogue has it."""
        own = self.rig.follower.spring_stiffness.si
        return [float(f"{own * part:.3g}") for part in LABS[self.name].springs]

    @property
    def added_masses(self) -> list[float]:
        """Weights (kg) that can be put on the follower."""
        return list(LABS[self.name].added_masses)

    @property
    def preloads(self) -> list[float]:
        """Preloads (N), to three digits."""
        own = self.rig.follower.preload.si
        return [float(f"{own * part:.3g}") for part in LABS[self.name].preloads]

    @cached_property
    def setups(self) -> list[LabSetup]:
        """Every set-up that there is."""
        return [LabSetup(*n) for n in product(self.springs, self.added_masses, self.preloads)]

    def true_rig(self, setup: LabSetup) -> RigConfig:
        """The rig as it is set up, with the numbers that it has in truth."""
        return true_rig(self.rig, setup, self.name, self.seed)

    def jump_rpm(self, setup: LabSetup) -> float:
        """The true jump speed (rpm) of a set-up: the lowest at which the steady state is off."""
        return _jump_rpm(self.law, follower_of(self.true_rig(setup)))

    @cached_property
    def knob(self) -> tuple[float, float]:
        """Speeds (rpm) of the knob, by what one rigid mass with the sheet's numbers does."""
        found = [
            rigid_jump(
                self.law, FollowerParameters.from_rig(true_rig(self.rig, s, self.name, None))
            )
            for s in self.setups
        ]
        speeds = [speed / RPM for speed, _ in found]
        if not (min(speeds) > 1.0 and math.isfinite(max(speeds))):
            raise ConfigError(
                f"lab {self.name!r}: cam {self.cam.name!r} on rig {self.rig.name!r} has no jump "
                "speed; allowed: a cam on which contact is lost, and a rig with a preload"
            )
        return (
            10.0 * math.floor(0.1 * KNOB_FROM * min(speeds)),
            10.0 * math.ceil(0.1 * KNOB_TO * max(speeds)),
        )

    @cached_property
    def critical(self) -> tuple[float, float]:
        """Lift s (m) and s'' (m/rad²) where a rigid follower without damping leaves the cam first.

        There n² = (k s + preload) / (m |s''|), the textbook's line over (k s + preload) / m.
        """
        own = FollowerParameters.from_rig(self.rig)
        _, angle = rigid_jump(self.law, replace(own, damping=0.0))
        lift, _, curvature = self.law.at(angle)
        return float(lift), float(curvature)

    def load(self, setup: LabSetup) -> float:
        """What presses the follower on, over its mass: (k s + preload) / m by the sheet, m/s²."""
        lift, _ = self.critical
        mass = self.rig.follower.mass.si + setup.added_mass
        return (setup.spring_stiffness * lift + setup.preload) / mass


#: One for each set-up of some sheets.
@lru_cache(maxsize=256)
def _jump_rpm(law: Law, follower: AnyFollower) -> float:
    return find_jump(law, follower, None).rpm


# A sheet as a file: CSV with a head of comment lines, which a spreadsheet opens and keeps.

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
        if not (is_number(rpm) and low <= rpm <= high):
            raise RefusedError(f"rpm: is {str(rpm)[:40]!r}; allowed: {low:g} to {high:g}")
        return round(float(rpm), DECIMALS)

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
