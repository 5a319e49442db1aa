"""Result of a bounce map: one row per value of the swept quantity.

A row describes the motion of the follower at this value. The column definitions for tables and
files are here too.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar

import numpy as np

from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.turn_map import State
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.show.result import (
    Column,
    Footnote,
    Records,
    Result,
    subject_line,
)
from cam_rig.studies.bounce.branches import DESCRIPTIONS, LIFT_OFF, Bifurcation, Branch
from cam_rig.studies.bounce.motion import IN_CONTACT, IRREGULAR, PERIODIC, UNDETERMINED, TurnMotion
from cam_rig.studies.bounce.sweep import (
    RESTITUTION,
    SPEED,
    SWEPT,
    OperatingPoint,
    Sweep,
    point_columns,
)
from cam_rig.units import RPM, FloatArray

#: Choice of the initial state: each run starts at rest on the cam.
START_ON_CAM = "rest"
#: Choice of the initial state: each run starts in the end state of the run at the next lower swept
#: value.
START_BELOW = "below"
#: Choice of the initial state: each run starts in the end state of the run at the next higher swept
#: value.
START_ABOVE = "above"


@dataclass(frozen=True, eq=False)
class BounceRow(TurnMotion):
    """Motion of the follower at one value of the swept quantity.

    Kept turns are the last turns of the run, after the transient. The sound levels are None if the
    rig has no data for them.
    """

    point: OperatingPoint
    landings_per_turn: float
    comes_to_rest: bool  #: True if the follower comes to rest on the cam in the kept turns
    level_db: float | None
    level_spread_db: float | None  #: level of the loudest turn minus that of the quietest turn, dB
    max_landing_speed: (
        #: fastest landing of each turn, m/s, ``(n,)``: of one period, or of all kept turns
        FloatArray
    )
    states: FloatArray  #: states at the ends of the same turns, as in `TurnsRun.states`

    @property
    def rpm(self) -> float:
        """Cam speed, rpm."""
        return self.point.rpm

    @property
    def end(self) -> State:
        """State of the follower at the end of the run, in the form of `TurnsRun.states`."""
        return tuple(self.states[-1].tolist())


#: Note below the table, for motions in which the follower comes to rest on the cam.
RESTS = Footnote(
    "It comes to rest on the cam, where the mass in contact has no freedom. Every change of one "
    "mass decays there, and the exponent is −∞. Of two masses the end mass continues to vibrate. "
    "Landings lower than rounding are not counted; in the limit their number is infinite.",
    lambda row: row.comes_to_rest and row.motion == PERIODIC,
    "*",
)


def _nth_exponent(number: int, row: BounceRow) -> float | None:
    """Return the Lyapunov exponent (1/turn) with the given number, counted from 1.

    It is None if the model has fewer exponents.
    """
    return row.exponents[number - 1] if number <= len(row.exponents) else None


#: Columns of the largest Lyapunov exponent and its error, shared by the tables of bounce maps and
#: of basins of attraction.
EXPONENT = (
    Column(
        "lyapunov_exponent",
        "1/turn",
        ".3f",
        cell=lambda row: "−∞" if row.lyapunov_exponent == -math.inf else row.lyapunov_exponent,
        doc="largest Lyapunov exponent, −∞ (null) if it rests",
    ),
    Column("exponent_error", "1/turn", ".1g", "error", doc="95 %"),
)

#: Note below the table on motions that are neither periodic nor certainly irregular.
UNDETERMINED_NOTE = Footnote(
    "Undetermined: the turns do not repeat yet, and no exponent above its error shows that they "
    "never will; or the follower never lands. More transient turns may decide.",
    lambda row: row.motion == UNDETERMINED,
    "?",
)


@dataclass(frozen=True, repr=False)
class BounceMap(Result):
    """Bounce map: motion of a follower over the values of one swept quantity.

    The quantity is the cam speed, the restitution, the preload or the mass. Each of the ``rows`` is
    the motion at one value.
    """

    schema = "cam_rig.bounce.1"
    plot_function = "cam_rig.studies.bounce.figures:figure"
    columns: ClassVar = {
        "speeds": (
            Column(
                "motion",
                doc="in contact, periodic, irregular or undetermined, in the kept turns",
            ),
            *point_columns(),
            Column("period", "", "d", doc="in turns"),
            Column("landings_per_turn", "1/turn", ".3g", "landings"),
            Column("comes_to_rest", hidden=True, doc="true if it comes to rest on the cam"),
            *EXPONENT,
            *(
                Column(
                    f"exponent_{i}",
                    "1/turn",
                    hidden=True,
                    of=partial(_nth_exponent, i),
                    doc=f"exponent number {i}, of {'either model' if i == 2 else 'two masses'}",
                )
                for i in (2, 3, 4)
            ),
            Column("settled", "", "d", "settled after", doc="turns from the start"),
            Column("level_db", "dB", ".1f", "level", doc="re 20 µPa, unweighted"),
            Column("level_spread_db", "dB", ".1f", "spread", doc="loudest less quietest turn"),
        ),
        "bifurcations": (
            Column("kind", heading="what happens"),
            *point_columns(".8g"),
            Column("period", "", "d", doc="in turns"),
            Column("landings", "", "d", doc="in the period, before it"),
        ),
        "orbits": (
            *point_columns(),
            Column("period"),
            Column("landings", doc="in the period"),
            Column("stable"),
            Column("max_landing_speed", "m/s", doc="fastest landing against the cam"),
            Column("min_landing_speed", "m/s", doc="slowest"),
            Column("gap", "mm", of="state.0", doc="at cam angle 0"),
            Column("gap_rate", "m/s", of="state.1", doc="its rate there"),
            Column("multiplier", of="leading.real", doc="of the largest the real part"),
            Column("multiplier_imaginary", of="leading.imag"),
        ),
        "turns": (
            Column("rpm", "rpm", of=lambda m: m.per_turn([r.rpm for r in m.rows])),
            Column("row", doc="of speeds", of=lambda m: m.per_turn(range(len(m.rows)))),
            Column(
                "max_landing_speed",
                "m/s",
                of=lambda m: _joined(r.max_landing_speed for r in m.rows),
            ),
            Column("gap", "mm", of=lambda m: _joined(r.states[:, 0] for r in m.rows)),
            Column("gap_rate", "m/s", of=lambda m: _joined(r.states[:, 1] for r in m.rows)),
            Column("stretch", "µm", of=lambda m: m.stem(2), doc="of the stem of two masses"),
            Column("stretch_rate", "m/s", of=lambda m: m.stem(3)),
        ),
    }

    law: Law
    rig: RigConfig
    sweep: Sweep
    start: str  #: initial state of each run: ``rest``, ``below`` or ``above``
    lift_off: float  #: swept value at which contact is first lost, SI (a speed in rad/s)
    rows: tuple[BounceRow, ...]
    branches: tuple[Branch, ...] = ()  #: curves of periodic motions, empty unless requested

    @property
    def subject(self) -> str:
        """Cam, rig and model."""
        has_two = isinstance(self.sweep.base.parameters, TwoMassParameters)
        model = "two_mass" if has_two else "one_mass"
        return subject_line([self.law.name], self.rig.name, model)

    @property
    def jump_rpm(self) -> float:
        """Speed of the first lift-off, rpm, or NaN if the speed is not swept."""
        return self.lift_off / RPM if self.sweep.parameter == SPEED else math.nan

    def swept(self, points: Iterable[Any]) -> FloatArray:
        """Return the swept quantity of several results in its displayed unit, ``(n,)``.

        ``points`` are results with an operating point: rows, periodic motions or bifurcations.
        """
        return np.array([getattr(item.point, self.sweep.parameter) for item in points], dtype=float)

    def stem(self, number: int) -> FloatArray:
        """Return the stretch of the stem or its rate at the end of each turn.

        ``number`` is 2 for the stretch (m) and 3 for its rate (m/s), the position in the follower's
        state. The values are NaN for one mass, which has no stem.
        """
        states = np.concatenate([row.states for row in self.rows])
        return states[:, number] if number < states.shape[1] else np.full(len(states), math.nan)

    def per_turn(self, numbers: Iterable[float]) -> FloatArray:
        """Repeat the number of each row of the bounce map for each turn that it stores.

        ``numbers`` has one number per row. The result has one number per stored turn.
        """
        return np.repeat(list(numbers), [row.max_landing_speed.size for row in self.rows])

    def tables(self) -> list[Records]:
        """Return the tables ``speeds``, ``bifurcations``, ``orbits`` and ``turns``.

        ``speeds`` has one row per swept value, and ``orbits`` one row per periodic motion of the
        branches. ``orbits`` and ``turns`` are not displayed, only exported to files. ``turns``
        contains each turn of a period once, and all kept turns of a motion without a period.
        """
        motions = [item for branch in self.branches for item in branch.motions]
        bifurcations = self.bifurcations if self.branches else []
        notes_of_kinds = (
            f"{kind}: {DESCRIPTIONS[kind]}."
            for kind in dict.fromkeys(item.kind for item in bifurcations)
        )
        displayed = _rows_of_change(self.rows) if len(self.rows) > MAX_SHOWN_ROWS else self.rows
        notes: list[Footnote | str] = [RESTS, UNDETERMINED_NOTE]
        if len(displayed) < len(self.rows):
            count = f"{len(self.rows)} {'speeds' if self.sweep.parameter == SPEED else 'rows'}"
            notes.append(f"{count}; the table contains those at which the motion changes.")
        tables = [
            self.table(
                "speeds", self.title, self.rows, *notes, row_filter=lambda row: row in displayed
            ),
            self.table("bifurcations", "Where a motion changes", bifurcations, *notes_of_kinds),
            self.table("orbits", "", motions, hidden=True),
        ]
        turns = self.array_table("turns")
        parameter = self.sweep.parameter

        def hide(column: Column) -> Column:
            is_swept = column.key in SWEPT
            return replace(column, hidden=column.key != parameter) if is_swept else column

        return [*(replace(t, columns=tuple(map(hide, t.columns))) for t in tables), turns]

    @property
    def title(self) -> str:
        """Cam, rig, model and fixed quantities as text for a title."""
        return f"{self.law.name} on rig {self.rig.name}, {self.fixed_text}"

    @property
    def fixed_text(self) -> str:
        """Quantities that are not swept, and the choice of the initial state, as text."""
        base, parameter = self.sweep.base, self.sweep.parameter
        speed = [] if parameter == SPEED else [f"{base.rpm:g} rpm"]
        restitution = [] if parameter == RESTITUTION else [f"restitution {base.restitution:g}"]
        masses = ["two masses"] if isinstance(base.parameters, TwoMassParameters) else []
        return ", ".join([*masses, *speed, *restitution, START_TEXT[self.start]])

    @property
    def bifurcations(self) -> list[Bifurcation]:
        """First lift-off and bifurcations of the branches, in order of the swept value.

        Only those within the swept range are included, each once.
        """
        sweep, changes = self.sweep, list[Bifurcation]()
        if math.isfinite(self.lift_off):
            changes.append(Bifurcation(LIFT_OFF, sweep.at(self.lift_off), None, 0))
        for item in (item for branch in self.branches for item in branch.bifurcations):
            if not any(item.same_as(other, sweep) for other in changes):
                changes.append(item)
        low, high = (sweep.value(self.rows[i].point) for i in (0, -1))
        within = [item for item in changes if low <= sweep.value(item.point) <= high]
        return sorted(within, key=lambda item: sweep.value(item.point))

    def summary(self) -> list[str]:
        """Return one line: the first loss of contact, and the number of motions per kind.

        The kinds are in contact, periodic, irregular and undetermined.
        """
        kinds, parameter = [row.motion for row in self.rows], self.sweep.parameter
        counts = ", ".join(f"{kinds.count(kind)} {kind}" for kind in KINDS if kind in kinds)
        if parameter == SPEED:
            return [f"contact is first lost at {self.jump_rpm:.2f} rpm; speeds: {counts}"]
        lost = ""
        if math.isfinite(self.lift_off):
            lost = f"contact is first lost at {self.sweep.words(self.lift_off)}; "
        return [f"{lost}{len(kinds)} values of {parameter}: {counts}"]

    def __repr__(self) -> str:
        return f"BounceMap({self.law.name} on {self.rig.name}: {self.summary()[0]})"


def _rows_of_change(rows: Sequence[BounceRow]) -> list[BounceRow]:
    """Return the rows of a bounce map at which the motion changes, to shorten a table.

    Of consecutive rows with the same kind of motion, the same period and the same rest on the cam,
    only the first and the last are returned.
    """
    kinds = [(row.motion, row.period, row.comes_to_rest) for row in rows]
    last = len(rows) - 1
    return [
        row
        for i, row in enumerate(rows)
        if i in (0, last) or kinds[i] != kinds[i - 1] or kinds[i] != kinds[i + 1]
    ]


#: Largest number of rows that a terminal shows completely. A longer table is shortened to the rows
#: at which the motion changes.
MAX_SHOWN_ROWS = 40
#: Kinds of motion, in the order in which the summary of a bounce map lists them.
KINDS = (IN_CONTACT, PERIODIC, IRREGULAR, UNDETERMINED)
#: Description of each choice of the initial state, for titles.
START_TEXT = {START_ON_CAM: "each from the cam"} | {
    x: f"each from the one {x}" for x in (START_BELOW, START_ABOVE)
}


def _joined(parts: Iterable[FloatArray]) -> FloatArray:
    return np.concatenate(list(parts))
