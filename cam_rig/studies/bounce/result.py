"""What a bounce map has found: a row a value of what is swept, and how people read it."""

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
from cam_rig.show.result import Column, Footnote, Records, Result
from cam_rig.studies.bounce.branches import LIFT_OFF, WORDS, Bifurcation, Branch
from cam_rig.studies.bounce.motion import IN_CONTACT, IRREGULAR, NOT_TOLD, PERIODIC, TurnMotion
from cam_rig.studies.bounce.sweep import (
    RESTITUTION,
    SPEED,
    SWEPT,
    OperatingPoint,
    Sweep,
    point_columns,
)
from cam_rig.units import RPM, FloatArray

#: Where each row begins: on the cam, or where the row below, or above, has ended.
REST, BELOW, ABOVE = "rest", "below", "above"


@dataclass(frozen=True, eq=False)
class BounceRow(TurnMotion):
    """What the follower does at one operating point."""

    point: OperatingPoint
    landings_per_turn: float
    rests: bool  #: whether it comes to rest on the cam in the turns that are kept
    level_db: float | None
    level_spread_db: float | None  #: loudest less quietest turn
    hardest: FloatArray  #: ``(n,)`` m/s of each turn's fastest landing: of a period, or all kept
    states: FloatArray  #: at those turns' ends, as `TurnsRun.states` has them

    @property
    def rpm(self) -> float:
        """The cam's speed, rpm."""
        return self.point.rpm

    @property
    def end(self) -> State:
        """The last state."""
        return tuple(self.states[-1].tolist())


RESTS = Footnote(
    "It comes to rest on the cam, where what meets the cam has no freedom. Of one mass every "
    "change dies out there, and the exponent is −∞; of two the end mass vibrates on. Landings "
    "are those higher than rounding; in the limit they are without number.",
    lambda row: row.rests and row.motion == PERIODIC,
    "*",
)


def _exponent(number: int, row: BounceRow) -> float | None:
    """One of its exponents, of which one mass has two and two masses four."""
    return row.exponents[number - 1] if number <= len(row.exponents) else None


#: Of a row, and of a motion that starts end in.
EXPONENT = (
    Column(
        "exponent",
        "1/turn",
        ".3f",
        cell=lambda row: "−∞" if row.exponent == -math.inf else row.exponent,
        doc="Lyapunov's, the largest; where it rests −∞, which is null",
    ),
    Column("exponent_error", "1/turn", ".1g", "error", doc="95 %"),
)

UNTOLD = Footnote(
    "Not told: the turns have not come to repeat, and no exponent above its error says that they "
    "never will; or none lands. More turns to settle may tell.",
    lambda row: row.motion == NOT_TOLD,
    "?",
)


@dataclass(frozen=True, repr=False)
class BounceMap(Result):
    """What a follower does turn after turn, over speed, restitution, preload or mass: ``rows``."""

    schema = "cam_rig.bounce.1"
    plot_function = "cam_rig.studies.bounce.figures:figure"
    columns: ClassVar = {
        "speeds": (
            Column(
                "motion",
                doc="in contact, periodic, irregular in the turns that are kept, or not told",
            ),
            *point_columns(),
            Column("period", "", "d", doc="in turns"),
            Column("landings_per_turn", "1/turn", ".3g", "landings"),
            Column("rests", hidden=True, doc="whether it comes to rest on the cam"),
            *EXPONENT,
            *(
                Column(
                    f"exponent_{i}",
                    "1/turn",
                    hidden=True,
                    of=partial(_exponent, i),
                    doc=f"the {i}th, of {'either model' if i == 2 else 'two masses'}",
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
            Column("hardest", "m/s", doc="fastest landing against the cam"),
            Column("softest", "m/s", doc="slowest"),
            Column("gap", "mm", of="state.0", doc="at cam angle 0"),
            Column("opening", "m/s", of="state.1", doc="its rate there"),
            Column("multiplier", of="leading.real", doc="of the largest the real part"),
            Column("multiplier_imaginary", of="leading.imag"),
        ),
        "turns": (
            Column("rpm", "rpm", of=lambda found: found.per_turn([r.rpm for r in found.rows])),
            Column("row", doc="of speeds", of=lambda f: f.per_turn(range(len(f.rows)))),
            Column("hardest", "m/s", of=lambda found: _joined(r.hardest for r in found.rows)),
            Column("gap", "mm", of=lambda found: _joined(r.states[:, 0] for r in found.rows)),
            Column("opening", "m/s", of=lambda found: _joined(r.states[:, 1] for r in found.rows)),
            Column(
                "stretch", "µm", of=lambda found: found.stem(2), doc="of the stem of two masses"
            ),
            Column("stretch_rate", "m/s", of=lambda found: found.stem(3)),
        ),
    }

    law: Law
    rig: RigConfig
    sweep: Sweep
    start: str  #: ``rest``, ``below`` or ``above``
    lift_off: float  #: where contact is first lost, in SI: rad/s where the speed is swept
    rows: tuple[BounceRow, ...]
    branches: tuple[Branch, ...] = ()  #: where they were asked for

    @property
    def jump_rpm(self) -> float:
        """The speed of the first lift-off, rpm; NaN where it is not what is swept."""
        return self.lift_off / RPM if self.sweep.over == SPEED else math.nan

    def swept(self, points: Iterable[Any]) -> FloatArray:
        """What is swept, as it is shown, of rows, motions or bifurcations."""
        return np.array([getattr(one.point, self.sweep.over) for one in points], dtype=float)

    def stem(self, number: int) -> FloatArray:
        """One of the stem's numbers at each turn's end; NaN of one mass, which has none."""
        states = np.concatenate([row.states for row in self.rows])
        return states[:, number] if number < states.shape[1] else np.full(len(states), math.nan)

    def per_turn(self, numbers: Iterable[float]) -> FloatArray:
        """A number of each row, as often as the row has turns."""
        return np.repeat(list(numbers), [row.hardest.size for row in self.rows])

    def tables(self) -> list[Records]:
        """``speeds``; in data ``turns`` too: of a period each once, else all that are kept."""
        motions = [one for branch in self.branches for one in branch.motions]
        found = self.bifurcations if self.branches else []
        words = (f"{kind}: {WORDS[kind]}." for kind in dict.fromkeys(one.kind for one in found))
        shown = _changes(self.rows) if len(self.rows) > MOST_SHOWN else self.rows
        notes: list[Footnote | str] = [RESTS, UNTOLD]
        if len(shown) < len(self.rows):
            many = f"{len(self.rows)} {'speeds' if self.sweep.over == SPEED else 'rows'}"
            notes.append(f"{many}; here those at which the motion changes.")
        tables = [
            self.table(
                "speeds", self.title, self.rows, *notes, row_filter=lambda row: row in shown
            ),
            self.table("bifurcations", "Where a motion changes", found, *words),
            self.table("orbits", "", motions, hidden=True),
        ]
        turns = self.array_table("turns")
        return [*(replace(one, columns=self._seen(one.columns)) for one in tables), turns]

    @property
    def title(self) -> str:
        """The cam on the rig, how many masses, and what is held."""
        return f"{self.law.name} on rig {self.rig.name}, {self.held}"

    @property
    def held(self) -> str:
        """What is not swept, and where each row begins."""
        base, over = self.sweep.base, self.sweep.over
        speed = [] if over == SPEED else [f"{base.rpm:g} rpm"]
        restitution = [] if over == RESTITUTION else [f"restitution {base.restitution:g}"]
        two = ["two masses"] if isinstance(base.parameters, TwoMassParameters) else []
        return ", ".join([*two, *speed, *restitution, BEGUN[self.start]])

    def _seen(self, columns: tuple[Column, ...]) -> tuple[Column, ...]:
        """Columns of which people see what is swept."""
        over = self.sweep.over
        return tuple(replace(c, hidden=c.key != over) if c.key in SWEPT else c for c in columns)

    @property
    def bifurcations(self) -> list[Bifurcation]:
        """The first lift-off, and what happens on the branches, in order."""
        sweep, found = self.sweep, list[Bifurcation]()
        if math.isfinite(self.lift_off):
            found.append(Bifurcation(LIFT_OFF, sweep.at(self.lift_off), None, 0))
        for one in (one for branch in self.branches for one in branch.bifurcations):
            if not any(one.same_as(other, sweep) for other in found):
                found.append(one)
        low, high = (sweep.value(self.rows[i].point) for i in (0, -1))
        within = [one for one in found if low <= sweep.value(one.point) <= high]
        return sorted(within, key=lambda one: sweep.value(one.point))

    def summary(self) -> list[str]:
        """Where contact is first lost, and how many rows of each kind."""
        kinds, over = [row.motion for row in self.rows], self.sweep.over
        counts = ", ".join(f"{kinds.count(kind)} {kind}" for kind in KINDS if kind in kinds)
        if over == SPEED:
            return [f"contact is first lost at {self.jump_rpm:.2f} rpm; speeds: {counts}"]
        lost = ""
        if math.isfinite(self.lift_off):
            lost = f"contact is first lost at {self.sweep.words(self.lift_off)}; "
        return [f"{lost}{len(kinds)} values of {over}: {counts}"]

    def __repr__(self) -> str:
        return f"BounceMap({self.law.name} on {self.rig.name}: {self.summary()[0]})"


def _changes(rows: Sequence[BounceRow]) -> list[BounceRow]:
    """The first and the last of those in a row that are of one kind, period and rest."""
    kinds = [(row.motion, row.period, row.rests) for row in rows]
    last = len(rows) - 1
    return [
        row
        for i, row in enumerate(rows)
        if i in (0, last) or kinds[i] != kinds[i - 1] or kinds[i] != kinds[i + 1]
    ]


#: Speeds that a terminal shows all of.
MOST_SHOWN = 40
KINDS = (IN_CONTACT, PERIODIC, IRREGULAR, NOT_TOLD)
BEGUN = {REST: "each from the cam"} | {way: f"each from the one {way}" for way in (BELOW, ABOVE)}


def _joined(parts: Iterable[FloatArray]) -> FloatArray:
    return np.concatenate(list(parts))
