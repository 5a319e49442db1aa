"""Table 2 read in other ways: what a rig would show to someone who looks every 5 rpm.

The table prints speeds in steps of 5 rpm. So for each cam a run from rest is looked at at every
such speed; the first at which contact is lost is what the table would print, and when it is first
lost there is its time. How much that time says shows in how many of the speeds about the printed
one give it: where the force of every turn is alike, hardly any.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cam_rig.arrays import rms
from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.two_mass.events import lift_off
from cam_rig.laws import Law, build_law
from cam_rig.schema import CamConfig, TableReading
from cam_rig.schema.published import PublishedJump
from cam_rig.studies.jump.refit import ROUNDED_TO, with_event
from cam_rig.studies.jump.search import force_run, sought_speed
from cam_rig.studies.jump.turn_minima import Rigs, ShapeTable, turn_minima
from cam_rig.units import RPM, TURN, to_rpm

#: The first speed looked at, rpm, and the last, as a multiple of the printed one.
FIRST_RPM, LAST = 200.0, 1.3
#: Contact is lost far too early below this part of the printed speed.
EARLY = 0.9
#: Speeds about the printed one at which the time of the first loss is looked at, and at a time.
SPEEDS, TOGETHER = 501, 16
#: Points a turn there: 16 a period up to 3 kHz at 600 rpm.
POINTS = 4800
#: A solver of ordinary differential equations knows a speed, or a force, to the first part of it.
SOLVER, BEYOND = 1e-6, 1e-3


@dataclass(frozen=True)
class ReadRow:
    """What a reading makes of one cam.

    Parameters
    ----------
    jump : rpm, the jump speed: at any speed, between those of the grid too
    rpm : the first speed of the table's grid at which contact is lost; NaN where it is at none
    time : s, when it is first lost there
    at_limit, beyond : s, the same at speeds `SOLVER` and `BEYOND` of it above the jump speed
    window : rpm, the range of speeds that give the printed time, see `window`
    force : N, the least of a run at the printed speed; what vibration would have to take from it
    """

    cam: str
    printed: PublishedJump
    jump: float
    rpm: float
    time: float
    at_limit: float
    beyond: float
    window: float
    force: float

    @property
    def speed_holds(self) -> bool:
        """Whether the printed speed is the one that comes out."""
        return self.rpm == self.printed.rpm

    @property
    def time_holds(self) -> bool:
        """Whether the printed time comes out at the printed speed, within half a turn."""
        half_turn = 30.0 / self.printed.rpm
        return self.speed_holds and abs(self.time - self.printed.time_s) <= half_turn


@dataclass(frozen=True)
class Read:
    """A reading and what it makes of every cam."""

    name: str
    reading: TableReading
    rows: tuple[ReadRow, ...]

    @property
    def rms(self) -> float:
        """Of the jump speeds' relative differences to the printed ones, the r.m.s."""
        return rms([row.jump / row.printed.rpm - 1.0 for row in self.rows])

    @property
    def hidden(self) -> list[ReadRow]:
        """Rows with a jump between slower speeds of the grid, which shows a faster one."""
        return [row for row in self.rows if row.jump < row.rpm - ROUNDED_TO]

    @property
    def moved(self) -> int:
        """How many times change by half a turn or more from `SOLVER` to `BEYOND`."""
        return sum(not abs(row.at_limit - row.beyond) < 30.0 / row.jump for row in self.rows)

    @property
    def limit_times(self) -> int:
        """How many printed times come out just above the jump speed, within half a turn."""
        return sum(abs(row.at_limit - row.printed.time_s) <= 30.0 / row.jump for row in self.rows)

    @property
    def early(self) -> list[ReadRow]:
        """Rows with loss of contact far below the printed speed, on the grid."""
        return [row for row in self.rows if row.rpm < EARLY * row.printed.rpm]

    @property
    def speeds(self) -> int:
        """How many printed speeds come out."""
        return sum(row.speed_holds for row in self.rows)

    @property
    def times(self) -> int:
        """How many printed times do."""
        return sum(row.time_holds for row in self.rows)


def follower_of(reading: TableReading) -> TwoMassParameters:
    """The two-mass follower of a reading, with plastic landings."""
    roller = reading.mass.si * reading.roller_share.si
    return TwoMassParameters(
        roller_mass=roller,
        end_mass=reading.mass.si - roller,
        stem_stiffness=reading.stem_stiffness.si,
        spring_stiffness=reading.spring_stiffness.si,
        stem_damping=reading.stem_damping.si,
        damping=reading.damping.si,
        preload=reading.preload.si,
    )


def read(
    name: str,
    reading: TableReading,
    cams: dict[str, CamConfig],
    printed: dict[str, PublishedJump],
    run: float,
) -> Read:
    """Every cam on a reading's rig, with its event angle and high dwell.

    Parameters
    ----------
    run : s from rest, longer than any printed time
    """
    follower = follower_of(reading)
    rows = []
    for cam, row in printed.items():
        law = build_law(with_event(cams[cam], reading.event.si, reading.high_dwell.si))
        rows.append(_row(cam, law, follower, row, run))
    return Read(name, reading, tuple(rows))


def first_on_grid(law: Law, follower: TwoMassParameters, last_rpm: float, run: float) -> float:
    """The first speed (rpm) of the grid at which a run from rest loses contact; NaN for none."""
    grid = np.arange(FIRST_RPM, last_rpm + 0.5 * ROUNDED_TO, ROUNDED_TO)
    force = force_run(law, follower, run)
    for few in np.array_split(grid, max(1, grid.size // 8)):
        least, missed = force.least(few * RPM), force.missed(few * RPM)
        for rpm, low, between in zip(few, least, missed, strict=True):
            if low <= 0.0 or (low <= between and force.lowest(rpm * RPM) <= 0.0):
                return float(rpm)
    return float("nan")


def window(law: Law, follower: TwoMassParameters, printed: PublishedJump, run: float) -> float:
    """Over how many rpm the printed time is that of the first loss, give or take half a turn.

    Of the speeds no farther than `ROUNDED_TO` from the printed one.
    """
    shape, near = ShapeTable.of(law, POINTS), []
    speeds = RPM * np.linspace(printed.rpm - ROUNDED_TO, printed.rpm + ROUNDED_TO, SPEEDS)
    for few in np.array_split(speeds, SPEEDS // TOGETHER):
        spans = np.broadcast_to(law.spans, (few.size, law.spans.size))
        turns = math.ceil(run * to_rpm(float(few[-1])) / 60.0)
        force, angle = turn_minima(shape, spans, Rigs.of(follower, few.size), few, turns)
        lost = force <= 0.0
        first = lost.argmax(axis=1)
        times = (TURN * first + angle[np.arange(few.size), first]) / few
        near.append(lost.any(axis=1) & (np.abs(times - printed.time_s) <= 30.0 / printed.rpm))
    return 2.0 * ROUNDED_TO * float(np.concatenate(near).mean())


def _row(
    cam: str, law: Law, follower: TwoMassParameters, printed: PublishedJump, run: float
) -> ReadRow:
    rpm = first_on_grid(law, follower, LAST * printed.rpm, run)
    jump = sought_speed(law, follower, run, FIRST_RPM)
    speeds = rpm * RPM, jump * (1.0 + SOLVER), jump * (1.0 + BEYOND)
    there, at_limit, beyond = (_first_loss(law, follower, speed, run) for speed in speeds)
    return ReadRow(
        cam,
        printed,
        to_rpm(jump),
        rpm,
        there,
        at_limit=at_limit,
        beyond=beyond,
        window=window(law, follower, printed, run),
        force=force_run(law, follower, run).lowest(printed.rpm * RPM),
    )


def _first_loss(law: Law, follower: TwoMassParameters, speed: float, run: float) -> float:
    """When (s) contact is first lost; NaN where it is not."""
    if np.isnan(speed):
        return float("nan")
    found = lift_off(law, follower, speed, 0.0, np.zeros(2), run)
    return float("nan") if found is None else found[0]
