"""Readings of table 2 of the paper: rigs that reproduce its speeds and times.

The table has speeds in steps of 5 rpm, so each cam runs from rest at every such speed. The first
speed with a loss of contact is compared with the printed speed, and the time of the loss with the
printed time. The printed time is informative only if few speeds near the printed speed reproduce
it. If the forces of all turns are nearly equal, hardly any speed does. The parameters are in
readings.yaml.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from pydantic import BaseModel

import cam_rig
from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.jump.two_masses import find_jump_speed, force_run
from cam_rig.dynamics.two_mass import first_lift_off
from cam_rig.schema import load_tables
from cam_rig.schema.load import tables_path
from cam_rig.schema.quantity import Quantity
from cam_rig.units import RPM, TURN, rms, to_rpm
from examples.paper.common import Table, parser, publish, titles
from examples.paper.refit import with_event
from examples.paper.turns import Rigs, ShapeTable, turn_minima

FILE = Path(__file__).with_name("readings.yaml")
#: Step (rpm) of the speeds of table 2.
GRID_RPM = 5.0
#: Jump speed (rpm) and time (s) of each cam in table 2.
TABLE_2 = {
    cam: (row.rpm, row.time_s) for cam, row in load_tables(tables_path()).table_2_jump.items()
}
#: First speed of the grid (rpm).
FIRST_RPM = 200.0
#: Last speed of the grid, relative to the printed speed.
LAST_SPEED_RATIO = 1.3
#: Number of speeds within a step of the printed speed at which the time is computed.
SPEEDS = 501
#: Number of points per turn at these speeds: 16 per period up to 3 kHz at 600 rpm.
TURN_SAMPLES = 4800
#: Number of speeds that are computed together.
BATCH = 16
#: Relative distance of the first time's speed above the jump speed, the error of an ODE solver.
SOLVER = 1e-6
#: Relative distance of the second time's speed above the jump speed.
BEYOND = 1e-3
#: Speed relative to the printed speed below which a loss of contact is considered too early.
EARLY_SPEED_RATIO = 0.9
#: Parameters of the follower in addition to its two masses.
FOLLOWER = ("stem_stiffness", "spring_stiffness", "stem_damping", "damping", "preload")


class Reading(BaseModel):
    """Interpretation of table 2: two-mass follower, angles of rise and high dwell.

    Each number has its origin.
    """

    title: str
    mass: Quantity
    spring_stiffness: Quantity
    stem_stiffness: Quantity
    roller_share: Quantity
    stem_damping: Quantity
    damping: Quantity
    preload: Quantity
    event: Quantity
    high_dwell: Quantity

    @property
    def fitted(self) -> list[str]:
        """Names of the numbers that were identified from the table."""
        numbers = ((key, value) for key, value in self if isinstance(value, Quantity))
        return [key for key, value in numbers if value.origin == "identified"]

    @property
    def follower(self) -> TwoMassParameters:
        """Two-mass follower with plastic landings."""
        roller = self.mass.si * self.roller_share.si
        numbers = (getattr(self, key).si for key in FOLLOWER)
        return TwoMassParameters(roller, self.mass.si - roller, *numbers)

    def law(self, cam: str) -> cam_rig.Law:
        """Return the law of a shipped cam with the reading's event angle and high dwell."""
        config = cam_rig.load_cam(cam)
        return cam_rig.build_law(with_event(config, self.event.si, self.high_dwell.si))


def load_readings() -> tuple[dict[str, Reading], float]:
    """Return all readings by name, and the duration (s) of each run from rest."""
    data: dict[str, Any] = yaml.safe_load(FILE.read_text(encoding="utf-8"))
    readings = {name: Reading.model_validate(entry) for name, entry in data["readings"].items()}
    return readings, data["run_s"]


class Row(NamedTuple):
    """Results of a cam on the rig of a reading.

    `rpm` is the first speed of the grid with loss of contact, and `time` (s) that of the loss. Both
    are NaN without a loss. `jump` (rpm) is the jump speed without a grid. `at_jump` and `beyond`
    (s) are the times of the loss at speeds `SOLVER` and `BEYOND` above it, relative. `window` (rpm)
    is the range of speeds that give the printed time, and `force` (N) the minimum in a run at the
    printed speed.
    """

    cam: str
    rpm: float
    jump: float
    time: float
    at_jump: float
    beyond: float
    window: float
    force: float

    @property
    def speed_agrees(self) -> bool:
        """True if the printed speed is reproduced."""
        return self.rpm == TABLE_2[self.cam][0]

    @property
    def time_agrees(self) -> bool:
        """True if the printed time is reproduced at the printed speed, within half a turn."""
        rpm, time = TABLE_2[self.cam]
        return self.speed_agrees and abs(self.time - time) <= 30.0 / rpm


@dataclass(frozen=True)
class Read:
    """Reading with its results for every cam."""

    name: str
    reading: Reading
    rows: tuple[Row, ...]

    @property
    def rms(self) -> float:
        """Root mean square of the relative differences of the jump speeds."""
        return rms([row.jump / TABLE_2[row.cam][0] - 1.0 for row in self.rows])

    @property
    def speeds(self) -> int:
        """Number of reproduced speeds."""
        return sum(row.speed_agrees for row in self.rows)

    @property
    def times(self) -> int:
        """Number of reproduced times."""
        return sum(row.time_agrees for row in self.rows)

    @property
    def hidden(self) -> list[Row]:
        """Rows whose jump speed is between slower speeds of the grid, and thus not found."""
        return [row for row in self.rows if row.jump < row.rpm - GRID_RPM]

    @property
    def early(self) -> list[Row]:
        """Rows with loss of contact on the grid far below the printed speed."""
        return [row for row in self.rows if row.rpm < EARLY_SPEED_RATIO * TABLE_2[row.cam][0]]


def first_on_grid(
    law: cam_rig.Law, follower: TwoMassParameters, last_rpm: float, run: float
) -> float:
    """Return the first speed (rpm) of the grid with loss of contact from rest, or NaN."""
    grid = np.arange(FIRST_RPM, last_rpm + 0.5 * GRID_RPM, GRID_RPM).tolist()
    force = force_run(law, follower, run)
    return float(next((rpm for rpm in grid if force.min_output(rpm * RPM) <= 0.0), math.nan))


def window(
    law: cam_rig.Law, follower: TwoMassParameters, printed: tuple[float, float], run: float
) -> float:
    """Return the range (rpm) of speeds around the printed speed with the printed time."""
    shape, agree, (rpm, time) = ShapeTable.of(law, TURN_SAMPLES), [], printed
    speeds = RPM * np.linspace(rpm - GRID_RPM, rpm + GRID_RPM, SPEEDS)
    for batch in np.array_split(speeds, SPEEDS // BATCH):
        spans = np.broadcast_to(law.spans, (batch.size, law.spans.size))
        turns = math.ceil(run * to_rpm(float(batch[-1])) / 60.0)
        force, angle = turn_minima(shape, spans, Rigs.of(follower, batch.size), batch, turns)
        lost = force <= 0.0
        first = lost.argmax(axis=1)
        times = (TURN * first + angle[np.arange(batch.size), first]) / batch
        agree.append(lost.any(axis=1) & (np.abs(times - time) <= 30.0 / rpm))
    return 2.0 * GRID_RPM * float(np.concatenate(agree).mean())


def read(
    name: str, reading: Reading, run: float, table: dict[str, tuple[float, float]] = TABLE_2
) -> Read:
    """Compute every cam on the rig of a reading, in runs of `run` s from rest."""
    follower, rows = reading.follower, []

    def first_loss(law: cam_rig.Law, speed: float) -> float:
        """Return the time (s) of the first loss of contact, or NaN."""
        if math.isnan(speed):
            return math.nan
        time = first_lift_off(law, follower, speed, np.zeros(2), run)
        return math.nan if time is None else time

    for cam, printed in table.items():
        law = reading.law(cam)
        rpm = first_on_grid(law, follower, LAST_SPEED_RATIO * printed[0], run)
        jump = find_jump_speed(law, follower, run, FIRST_RPM)
        rows.append(
            Row(
                cam=cam,
                rpm=rpm,
                jump=to_rpm(jump),
                time=first_loss(law, rpm * RPM),
                at_jump=first_loss(law, jump * (1.0 + SOLVER)),
                beyond=first_loss(law, jump * (1.0 + BEYOND)),
                window=window(law, follower, printed, run),
                force=force_run(law, follower, run).min_output(printed[0] * RPM),
            )
        )
    return Read(name, reading, tuple(rows))


def study() -> list[Read]:
    """Compute every reading with every cam."""
    readings, run = load_readings()
    return [read(name, reading, run) for name, reading in readings.items()]


#: Listed numbers of a reading: name, heading with unit, format.
LISTED = (
    ("event", "event angle [°]", ".1f"),
    ("high_dwell", "high dwell [°]", ".1f"),
    ("stem_stiffness", "stem [N/m]", ".4g"),
    ("roller_share", "mass split", ".4g"),
    ("stem_damping", "stem damping [N·s/m]", ".4g"),
    ("damping", "damping to ground [N·s/m]", ".4g"),
    ("preload", "preload [N]", ".4g"),
)


def tables(result: Sequence[Read]) -> list[Table]:
    """Return a table of all readings with their agreement, and a table per reading."""
    names = titles(TABLE_2)
    numbers = []
    for solution in result:
        texts = []
        for key, _, number_format in LISTED:
            mark = "*" if key in solution.reading.fitted else ""
            texts.append(f"{getattr(solution.reading, key).raw:{number_format}}{mark}")
        counts = len(solution.reading.fitted), solution.speeds, solution.times
        numbers.append((solution.name.replace("_", " "), *texts, *counts, 100.0 * solution.rms))
    return [
        Table(
            "Readings of the paper's Table 2: their numbers, and what they show of it",
            f"reading | {' | '.join(heading for _, heading, _ in LISTED)} | fitted :d | "
            "speeds that agree :d | times that agree :d | jump speeds, r.m.s. [%] :.2f",
            numbers,
            "* identified from the paper's Table 2. The others are given or assumed, with their "
            "sources in readings.yaml.\n"
            "A speed agrees where it is the first of the grid with loss of contact, a time within "
            "half a turn, where the speed does.\n"
            "Jump speeds, r.m.s.: of those at any speed, also between those of the grid.",
        ),
        Table(
            f"Readings of the paper's Table 2: first loss of contact, every {GRID_RPM:g} rpm",
            "reading | cam | paper [rpm] :g | first of the grid [rpm] :g | jump speed [rpm] :.1f | "
            "paper [s] :.2f | time [s] :.3f | at the jump + 1e-6 [s] :.3f | + 1e-3 [s] :.3f | "
            "window [rpm] :.2f | least force [N] :+.1f",
            [
                (
                    solution.name.replace("_", " "),
                    names[row.cam],
                    TABLE_2[row.cam][0],
                    *(row.rpm, row.jump, TABLE_2[row.cam][1]),
                    *(row.time, row.at_jump, row.beyond, row.window, row.force),
                )
                for solution in result
                for row in solution.rows
            ],
            "Time: at the first speed of the grid, and above the jump speed by so much of it.\n"
            f"Window: the range of speeds, within {GRID_RPM:g} rpm of the printed one, that give "
            "the printed time within half a turn.\n"
            "Least force: of a run at the printed speed. Where it is positive, vibration would "
            "have to take it away.",
        ),
    ]


def summary(result: Sequence[Read]) -> list[str]:
    """Return the agreement of each reading, the closest one, and the widest window."""
    nearest = min(result, key=lambda solution: solution.rms)
    widest = max(row.window for solution in result for row in solution.rows)
    return [
        *(
            f"{solution.name}: {solution.speeds} of {len(solution.rows)} speeds and "
            f"{solution.times} times with {len(solution.reading.fitted)} fitted"
            for solution in result
        ),
        f"jump speeds at any speed are nearest on {nearest.name}, {nearest.rms:.2%} r.m.s.",
        f"a printed time comes out over {widest:.2g} of {2 * GRID_RPM:g} rpm about its speed",
    ]


def main(argv: Sequence[str] | None = None) -> None:
    """Run the experiment, which needs about 20 s."""
    out = parser(__doc__).parse_args(argv).out
    result = study()
    publish(out, tables(result), {}, summary(result))


if __name__ == "__main__":
    main()
