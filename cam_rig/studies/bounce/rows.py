"""Computation of the rows of a bounce map, and their storage in Parquet files.

A row is the motion at one value of the swept quantity. The files have the format of a campaign's
files, with the columns of a bounce map.
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
from functools import partial
from typing import Any

import numpy as np

from cam_rig.acoustics import MicrophoneState, RadiationParameters, level_db, rms_pressure
from cam_rig.datasets.batches import SerialExecutor, compute_missing
from cam_rig.datasets.point_files import Batch, PointFiles
from cam_rig.dynamics import MODELS, Interval, TwoMassParameters
from cam_rig.dynamics.parameters import require_parameter
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

#: Largest number of turns over which the sound level is averaged. The sound is computed from one
#: turn earlier, so that its filters settle.
LEVEL_TURNS = 16


@dataclass(frozen=True)
class BounceRuns:
    """Input of a bounce map: law, swept values, numbers of turns and sound radiation."""

    law: Law
    sweep: Sweep
    values: tuple[float, ...]  #: values of the swept quantity, SI
    radiation: RadiationParameters | None  #: sound radiation of the rig, None if undefined
    transient_turns: int  #: turns before the kept turns
    turns: int  #: number of kept turns

    @classmethod
    def of(
        cls,
        law: Law,
        rig: RigConfig,
        sweep: Sweep,
        values: list[float],
        transient_turns: int,
        turns: int,
    ) -> BounceRuns:
        """Create the runs of a bounce map on a rig.

        A sound level is computed if the rig has radiation data and a contact stiffness. ``values``
        are swept values, SI.
        """
        has_sound = rig.radiation is not None and rig.follower.stem_stiffness is not None
        sound = RadiationParameters.from_rig(rig) if has_sound else None
        return cls(law, sweep, tuple(values), sound, transient_turns, turns)

    @property
    def total(self) -> int:
        """Number of rows of the bounce map: one per value of the swept quantity."""
        return len(self.values)

    @property
    def text(self) -> str:
        """JSON text of all inputs on which the results depend, to detect changed inputs.

        The motion law is represented by a hash.
        """
        digest = hashlib.sha256()
        for part in (self.law.breaks, self.law.ordinates):
            digest.update(np.ascontiguousarray(part).tobytes())
        law = f"{self.law.name} {digest.hexdigest()[:16]}"
        numbers: dict[str, Any] = {"law": law, "values": self.values}
        numbers |= {
            "transient_turns": self.transient_turns,
            "turns": self.turns,
            "sweep": asdict(self.sweep),
        }
        numbers["radiation"] = self.radiation and asdict(self.radiation)
        return json.dumps(numbers, sort_keys=True)

    def row(self, value: float, start: State = ON_THE_CAM) -> BounceRow:
        """Compute the motion at one value (SI) of the swept quantity.

        The run starts in the state ``start``, as in `TurnsRun.states` (default: on the cam).
        """
        point = self.sweep.at(value)
        turn_map = StroboscopicMap(self.law, point.parameters, point.speed)
        run = turn_map.run(self.transient_turns + self.turns, start)
        motion = motion_of(turn_map, run, self.turns)
        stored = 1 if motion.motion == IN_CONTACT else motion.period or self.turns
        level, spread = self._level(point, turn_map, run, min(stored, LEVEL_TURNS))
        return BounceRow(
            **vars(motion),
            point=point,
            landings_per_turn=float(run.landings[-(motion.period or self.turns) :].mean()),
            comes_to_rest=bool(run.contact_times[-self.turns :].any()),
            level_db=level,
            level_spread_db=spread,
            max_landing_speed=run.max_landing_speeds[-stored:],
            states=run.states[-stored:],
        )

    def rows(self, values: Sequence[float]) -> list[BounceRow]:
        """Compute the motions at several values (SI) of the swept quantity.

        Each run starts on the cam.
        """
        return [self.row(value) for value in values]

    def _level(
        self, point: OperatingPoint, turn_map: StroboscopicMap, run: TurnsRun, turns: int
    ) -> tuple[float | None, float | None]:
        """Return the sound level (dB) of the last turns, and its range from turn to turn.

        The range is the level of the loudest turn minus that of the quietest, dB. ``turns`` is the
        number of turns. Both results are None if the rig has no radiation data.
        """
        if self.radiation is None:
            return None, None
        state = turn_map.follower(run.states[-turns - 2].tolist())
        # The duration of a landing is half a period of the mass on the stem.
        pulse = math.pi * math.sqrt(
            point.mass / require_parameter("stem_stiffness", point.parameters.stem_stiffness)
        )
        radiation = replace(self.radiation, contact_time=pulse)
        two = isinstance(point.parameters, TwoMassParameters)
        speed, advance = turn_map.speed, MODELS[TWO_MASS if two else ONE_MASS].advance
        sound: MicrophoneState | None = None
        turn, pressures = round(NS * turn_map.duration), []
        for i in range(turns + 1):
            interval = Interval(i * turn, (i + 1) * turn, speed * i * turn / NS, speed)
            state, block = advance(self.law, turn_map.parameters, state, interval, TURN_RATE_HZ)
            signal = block.force, block.impulse, TURN_RATE_HZ, speed
            sound, pressure = rms_pressure(radiation, sound, *signal)
            pressures.append(pressure)
        by_turn = np.array(pressures[1:])
        levels = level_db(by_turn)
        return float(level_db(math.sqrt(np.mean(by_turn**2)))), float(np.ptp(levels))


# Storage of the rows in a folder of Parquet files.

#: Arrow types of the columns that do not contain floating-point numbers.
ARROW_TYPES = {"motion": "string", "period": "int64", "settled": "int64", "comes_to_rest": "bool_"}
#: Columns of the Parquet file that have the name of a field of `BounceRow`.
ROW_FIELDS = (
    "motion",
    "period",
    "landings_per_turn",
    "comes_to_rest",
    "settled",
    "level_db",
    "level_spread_db",
)
#: Fields of `BounceRow` that contain an array, stored as lists, with their units.
LIST_UNITS = {"max_landing_speed": "m/s", "states": "SI"}


@dataclass(frozen=True)
class BounceBatch(Batch):
    """Rows of a bounce map for consecutive swept values, computed by one process."""

    rows: list[BounceRow]


def compute_batch(runs: BounceRuns, first: int, last: int) -> BounceBatch:
    """Compute the rows of the swept values ``first`` to ``last`` (exclusive).

    Each run starts on the cam. The arguments are indices into ``runs.values``.
    """
    start = time.process_time()
    rows = runs.rows(runs.values[first:last])
    return BounceBatch(first, last, time.process_time() - start, rows)


@dataclass(frozen=True, eq=False)
class BounceFiles(PointFiles):
    """Parquet files of the rows of a bounce map.

    The columns are the index ``point`` of the swept value, the columns of the table ``speeds``, and
    those of `LIST_UNITS`. An exponent of −∞ is stored as −∞.
    """

    campaign: BounceRuns

    def _to_table(self, rows: BounceBatch) -> Any:
        import pyarrow as pa

        fields, columns = [pa.field("point", pa.int64())], [pa.array(range(rows.first, rows.last))]
        for column in BounceMap.columns["speeds"]:
            kind = getattr(pa, ARROW_TYPES.get(column.key, "float64"))()
            about = {"unit": column.si_unit, "meaning": column.doc}
            fields.append(pa.field(column.key, kind, metadata=about))
            columns.append(pa.array([column.value(row) for row in rows.rows], kind))
        for key, unit in LIST_UNITS.items():
            kind = pa.list_(pa.float64())
            fields.append(pa.field(key, kind, metadata={"unit": unit}))
            columns.append(pa.array([getattr(row, key).ravel() for row in rows.rows], kind))
        return pa.Table.from_arrays(columns, schema=pa.schema(fields, metadata=self.origin))

    def rows(self) -> Iterator[BounceRow]:
        """Yield all stored rows of the bounce map in order of the swept values."""
        runs = self.campaign
        for table in self.tables():
            for row in table.to_pylist():
                numbers = [row["lyapunov_exponent"], *(row[f"exponent_{i}"] for i in (2, 3, 4))]
                exponents = tuple(number for number in numbers if number is not None)
                yield BounceRow(
                    point=runs.sweep.at(runs.values[row["point"]]),
                    exponents=exponents,
                    exponent_error=row["exponent_error"],
                    max_landing_speed=np.array(row["max_landing_speed"]),
                    states=np.array(row["states"]).reshape(-1, len(exponents)),
                    **{key: row[key] for key in ROW_FIELDS},
                )


def stored_rows(
    files: BounceFiles, resume: bool, executor: Executor | None, workers: int, progress: Progress
) -> list[BounceRow]:
    """Return all rows of a bounce map, after computing and storing the missing rows.

    ``resume`` is True to keep rows that are stored already. If it is False, a folder with rows
    raises a `ConfigError`. ``workers`` is the number of batches that the executor processes at a
    time.
    """
    require("pyarrow")
    with files.open(resume) as damaged:
        if damaged:
            warnings.warn(damaged, stacklevel=3)
        missing = sum(last - first for first, last in files.missing())
        progress.start(files.campaign.total, pluralize(missing, "row"))
        progress.advance(files.campaign.total - missing)
        executor = executor or SerialExecutor()
        task = partial(partial, compute_batch)  # of the runs, the first row and the end of a batch
        compute_missing(files, task, executor, max(1, workers), progress)
    return list(files.rows())
