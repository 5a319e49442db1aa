"""How far the readings of a sheet are from the truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from cam_rig.acoustics import RadiationParameters, SoundSource
from cam_rig.dynamics import MODELS, Block, FollowerState, Interval, TwoMassParameters
from cam_rig.dynamics.jump.any_follower import AnyFollower, follower_of
from cam_rig.dynamics.two_mass.masses import contact_response, force_output
from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.panel.bench.live_state import FULL_SCALE_PA, LEAST_RATE
from cam_rig.panel.lab.sheet import LabReading, LabSheet, RecordedSheet, read_sheet
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.show.result import Column, Records, Result
from cam_rig.units import NS, RPM, TURN, FloatArray

#: By how much (%) a reading may be off, if nothing else is said: 4 rpm of 400.
TOLERANCE_PERCENT = 1.0


@dataclass(frozen=True)
class ReadingMark:
    """A reading of a file, the true jump speed (rpm) of its set-up, whether it is near enough."""

    file: str
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
    """A sheet with a mark a reading, which is right within a tolerance (%)."""

    path: Path
    recorded: RecordedSheet
    marks: tuple[ReadingMark, ...]
    tolerance: float

    @property
    def right(self) -> int:
        """How many readings are near enough."""
        return sum(mark.within for mark in self.marks)

    @property
    def summary(self) -> str:
        """What the sheet comes to, in a line."""
        off = np.array([mark.difference_percent for mark in self.marks])
        who = f" by {self.recorded.student}" if self.recorded.student else ""
        return (
            f"{self.path}{who}: {self.right} of {off.size} within {self.tolerance:g} %; mean "
            f"{off.mean():+.2f} %, farthest {off[np.abs(off).argmax()]:+.2f} %"
        )


def mark_sheet(
    path: Path,
    tolerance: float,
    cam_of: Callable[[str], CamConfig],
    rig_of: Callable[[str], RigConfig],
) -> MarkedSheet:
    """Mark a sheet with a tolerance (%); ``cam_of``, ``rig_of`` read files by names on it."""
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
        there = {"springs": sheet.springs, "masses": sheet.added_masses, "preloads": sheet.preloads}
        allowed = " | ".join(
            f"{name} {', '.join(f'{number:g}' for number in numbers)}"
            for name, numbers in there.items()
        )
        raise ConfigError(
            f"{path}, reading {reading.number}: {s.spring_stiffness:g} N/m, {s.added_mass:g} kg, "
            f"{s.preload:g} N is no set-up of this sheet; allowed: {allowed}"
        )
    true = sheet.jump_rpm(reading.setup)
    return ReadingMark(str(path), reading, true, abs(reading.rpm - true) <= 0.01 * tolerance * true)


@dataclass(frozen=True, repr=False)
class MarksResult(Result):
    """The marks of sheets, of one tolerance (%)."""

    schema = "cam_rig.panel_marks.1"
    drawn_by = "cam_rig.panel.lab.figures:marks_figure"
    columns: ClassVar = {
        "readings": (
            Column("file"),
            Column("reading", "", "d", of="reading.number"),
            Column("spring_stiffness", "N/m", "g", "spring", "reading.setup.spring_stiffness"),
            Column("added_mass", "kg", "g", of="reading.setup.added_mass"),
            Column("preload", "N", "g", of="reading.setup.preload"),
            Column("rpm", "rpm", ".2f", "read", "reading.rpm"),
            Column("true_rpm", "rpm", ".2f", "true"),
            Column("difference_rpm", "rpm", "+.2f", "difference"),
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
            Column("within", "", "d", of="right", about="readings that are"),
        ),
    }

    sheets: tuple[MarkedSheet, ...]

    def tables(self) -> list[Records]:
        """``readings``, sheet by sheet, and ``sheets``."""
        rows = [mark for sheet in self.sheets for mark in sheet.marks]
        note = "True: the lowest speed at which the steady state loses contact."
        return [
            self.table("readings", "{file}", rows, note, by="file"),
            self.table("sheets", "Sheets", self.sheets),
        ]

    def summary(self) -> list[str]:
        """A line a sheet."""
        return [sheet.summary for sheet in self.sheets]


# What one sees and hears of the rig at a speed: a turn of its steady state, and its contact.

#: Samples of the force a second, Hz; the sound has as many.
RATE_HZ = LEAST_RATE
#: Points of a turn that are shown.
POINTS = 720
#: What the force sensor resolves, N.
RESOLUTION_N = 0.1
#: Turns after which what is seen of a follower that lifts off is settled.
SETTLED = 6


@dataclass(frozen=True, eq=False)
class LabTurn:
    """A turn of the steady state as it is observed.

    The force (N) is as the sensor resolves it, `POINTS` at equal steps of the cam angle from 0 on;
    the sound is of full scale at `RATE_HZ`, to be repeated.
    """

    contact_lost: bool
    force: FloatArray
    sound: FloatArray


def observe(law: Law, rig: RigConfig, rpm: float) -> LabTurn:
    """A turn on a rig at a speed (rpm)."""
    follower, speed = follower_of(rig), rpm * RPM
    blocks = _turns(law, follower, speed)
    block = blocks[-1]
    grid = block.interval.grid(RATE_HZ)
    angles = block.interval.angle + speed * grid.since_start()
    at = np.arange(POINTS) * (TURN / POINTS)
    force = np.interp(at, angles, block.force, period=TURN)
    source = SoundSource(RadiationParameters.from_rig(rig), RATE_HZ, LEAST_RATE)
    # Heard twice: the second time the structure is already in motion, and the ends meet.
    for _ in range(2):
        pressure = source.pressure(block.force, block.impulse, speed)
    seen = np.round(force / RESOLUTION_N) * RESOLUTION_N
    return LabTurn(len(blocks) > 1, seen, np.asarray(pressure / FULL_SCALE_PA))


def _turns(law: Law, follower: AnyFollower, speed: float) -> list[Block]:
    """One turn that keeps contact, or some in which it is lost."""
    two = isinstance(follower, TwoMassParameters)
    model = MODELS["two_mass" if two else "one_mass"]
    state = _steady_start(law, follower, speed) if isinstance(follower, TwoMassParameters) else None
    turn, blocks = round(TURN / speed * NS), list[Block]()
    for i in range(SETTLED):
        # Each turn begins at angle 0: what a turn in whole nanoseconds leaves is not added up.
        interval = Interval(i * turn, (i + 1) * turn, 0.0, speed, turns=i)
        state, block = model.advance(law, follower, state, interval, RATE_HZ)
        blocks.append(block)
        if i == 0 and not any(event.kind == "lift-off" for event in block.events):
            break
    return blocks


def _steady_start(law: Law, follower: TwoMassParameters, speed: float) -> FollowerState:
    """Two masses at cam angle 0, in the steady state in which they are held on the cam."""
    vibration = contact_response(law, follower, speed).periodic()
    lift, slope, curvature = law.at(0.0)
    motion = np.array([lift, slope * speed, curvature * speed**2])
    output = force_output(follower)
    force = float((output.state @ vibration + output.law @ motion + output.constant)[0])
    return FollowerState(lift, slope * speed, force, True, inner=tuple(vibration.tolist()))
