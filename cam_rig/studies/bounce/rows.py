"""The rows of a bounce map: turned, one a value of what is swept, and kept in Parquet files.

The files are a campaign's, with the columns of a bounce map.
"""

from __future__ import annotations

import hashlib
import json
import math
import time
import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from cam_rig.acoustics import MicrophoneState, RadiationParameters, level_db, rms_pressure
from cam_rig.datasets.batches import InThisProcess, compute_missing
from cam_rig.datasets.point_files import Batch, PointFiles
from cam_rig.dynamics import MODELS, Interval, TwoMassParameters
from cam_rig.dynamics.parameters import told
from cam_rig.dynamics.turn_map import ON_THE_CAM, State, StroboscopicMap, TurnsRun
from cam_rig.extras import require
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.show.result import Progress
from cam_rig.show.tables import pluralize
from cam_rig.simulation.simulate import TURN_RATE_HZ
from cam_rig.studies.bounce.motion import IN_CONTACT, ONE_MASS, TWO_MASS, motion_of
from cam_rig.studies.bounce.result import BounceMap, BounceRow
from cam_rig.studies.bounce.sweep import OperatingPoint, Sweep
from cam_rig.units import NS

#: Turns of which the level is the mean, at most, after one that begins the sound.
LEVEL_TURNS = 16


@dataclass(frozen=True)
class BounceRuns:
    """What is turned, at which values, how long, and how it is heard."""

    law: Law
    sweep: Sweep
    values: tuple[float, ...]  #: of what is swept, SI
    radiation: RadiationParameters | None  #: None where the rig does not tell it
    settle: int  #: turns before those that are kept
    turns: int  #: kept

    @classmethod
    def of(
        cls, law: Law, rig: RigConfig, sweep: Sweep, values: list[float], settle: int, turns: int
    ) -> BounceRuns:
        """Those on a rig; it is heard where the rig tells how it sounds and what it lands with."""
        heard = rig.radiation is not None and rig.follower.stem_stiffness is not None
        sound = RadiationParameters.from_rig(rig) if heard else None
        return cls(law, sweep, tuple(values), sound, settle, turns)

    @property
    def total(self) -> int:
        """Rows in all."""
        return len(self.values)

    @property
    def text(self) -> str:
        """The law by its digest, and all other numbers."""
        digest = hashlib.sha256()
        for part in (self.law.breaks, self.law.ordinates):
            digest.update(np.ascontiguousarray(part).tobytes())
        law = f"{self.law.name} {digest.hexdigest()[:16]}"
        told: dict[str, Any] = {"law": law, "values": self.values}
        told |= {"settle": self.settle, "turns": self.turns, "sweep": asdict(self.sweep)}
        told["radiation"] = self.radiation and asdict(self.radiation)
        return json.dumps(told, sort_keys=True)

    def row(self, value: float, begin: State = ON_THE_CAM) -> BounceRow:
        """What the follower does at a value (SI), from a state as `TurnsRun` has it."""
        point = self.sweep.at(value)
        turn_map = StroboscopicMap(self.law, point.parameters, point.speed)
        run = turn_map.run(self.settle + self.turns, begin)
        found = motion_of(turn_map, run, self.turns)
        shown = 1 if found.motion == IN_CONTACT else found.period or self.turns
        level, spread = self._level(point, turn_map, run, min(shown, LEVEL_TURNS))
        return BounceRow(
            **vars(found),
            point=point,
            landings_per_turn=float(run.landings[-(found.period or self.turns) :].mean()),
            rests=bool(run.contact_times[-self.turns :].any()),
            level_db=level,
            level_spread_db=spread,
            hardest=run.max_landing_speeds[-shown:],
            states=run.states[-shown:],
        )

    def rows(self, values: Sequence[float]) -> list[BounceRow]:
        """The same at each of some values, from the cam."""
        return [self.row(one) for one in values]

    def _level(
        self, point: OperatingPoint, turn_map: StroboscopicMap, run: TurnsRun, turns: int
    ) -> tuple[float | None, float | None]:
        """Level (dB) of the last turns, and the loudest of them less the quietest."""
        if self.radiation is None:
            return None, None
        after = turn_map.follower(run.states[-turns - 2].tolist())
        # A landing lasts as the mass makes it: half a period on the stem.
        pulse = math.pi * math.sqrt(
            point.mass / told("stem_stiffness", point.parameters.stem_stiffness)
        )
        radiation = replace(self.radiation, contact_time=pulse)
        two = isinstance(point.parameters, TwoMassParameters)
        speed, advance = turn_map.speed, MODELS[TWO_MASS if two else ONE_MASS].advance
        sound: MicrophoneState | None = None
        turn, pressures = round(NS * turn_map.duration), []
        for i in range(turns + 1):
            interval = Interval(i * turn, (i + 1) * turn, speed * i * turn / NS, speed)
            after, block = advance(self.law, turn_map.parameters, after, interval, TURN_RATE_HZ)
            heard = block.force, block.impulse, TURN_RATE_HZ, speed
            sound, pressure = rms_pressure(radiation, sound, *heard)
            pressures.append(pressure)
        by_turn = np.array(pressures[1:])
        levels = level_db(by_turn)
        return float(level_db(math.sqrt(np.mean(by_turn**2)))), float(np.ptp(levels))


# Rows in a folder of Parquet files.

#: Columns that are no floating-point numbers.
KINDS = {"motion": "string", "period": "int64", "settled": "int64", "rests": "bool_"}
#: Columns that are fields of a row as they are.
PLAIN = (
    *("motion", "period", "landings_per_turn", "rests", "settled"),
    *("level_db", "level_spread_db"),
)
#: What the figure and the next row need besides.
LISTS = {"hardest": "m/s", "states": "SI"}


@dataclass(frozen=True)
class BounceBatch(Batch):
    """The rows of some values."""

    rows: list[BounceRow]


def turned(runs: BounceRuns, first: int, last: int) -> BounceBatch:
    """The rows of the values ``first`` to ``last`` (exclusive), each from the cam."""
    begun = time.process_time()
    rows = runs.rows(runs.values[first:last])
    return BounceBatch(first, last, time.process_time() - begun, rows)


@dataclass(frozen=True, eq=False)
class BounceFiles(PointFiles):
    """Columns: ``point``, those of ``speeds`` with −∞ as it is, and `LISTS`."""

    campaign: BounceRuns

    def _table(self, rows: BounceBatch) -> Any:
        import pyarrow as pa

        fields, columns = [pa.field("point", pa.int64())], [pa.array(range(rows.first, rows.last))]
        for one in BounceMap.columns["speeds"]:
            kind = getattr(pa, KINDS.get(one.key, "float64"))()
            about = {"unit": one.si_unit, "meaning": one.doc}
            fields.append(pa.field(one.key, kind, metadata=about))
            columns.append(pa.array([one.value(row) for row in rows.rows], kind))
        for key, unit in LISTS.items():
            kind = pa.list_(pa.float64())
            fields.append(pa.field(key, kind, metadata={"unit": unit}))
            columns.append(pa.array([getattr(row, key).ravel() for row in rows.rows], kind))
        return pa.Table.from_arrays(columns, schema=pa.schema(fields, metadata=self.own))

    def rows(self) -> Iterator[BounceRow]:
        """All of them, in order."""
        runs = self.campaign
        for table in self.tables():
            for row in table.to_pylist():
                numbers = [row["exponent"], *(row[f"exponent_{i}"] for i in (2, 3, 4))]
                exponents = tuple(one for one in numbers if one is not None)
                yield BounceRow(
                    point=runs.sweep.at(runs.values[row["point"]]),
                    exponents=exponents,
                    exponent_error=row["exponent_error"],
                    hardest=np.array(row["hardest"]),
                    states=np.array(row["states"]).reshape(-1, len(exponents)),
                    **{key: row[key] for key in PLAIN},
                )


def kept_rows(
    files: BounceFiles, resume: bool, executor: Executor | None, workers: int, progress: Progress
) -> list[BounceRow]:
    """The rows of all values; those that the folder has not are made, and kept there."""
    require("pyarrow")
    with files.opened(resume) as damaged:
        if damaged:
            warnings.warn(damaged, stacklevel=3)
        missing = sum(last - first for first, last in files.missing())
        progress.start(files.campaign.total, pluralize(missing, "row"))
        progress.advance(files.campaign.total - missing)
        compute_missing(files, turned, executor or InThisProcess(), max(1, workers), progress)
    return list(files.rows())
