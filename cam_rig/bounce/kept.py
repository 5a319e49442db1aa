"""The rows of a bounce map in a folder of Parquet files: a campaign's files, with these columns."""

from __future__ import annotations

import hashlib
import json
import time
import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cam_rig.bounce.result import BounceMap, BounceRow
from cam_rig.bounce.runs import BounceRuns
from cam_rig.campaigns.dataset import PointFiles
from cam_rig.campaigns.run import InThisProcess, run_campaign
from cam_rig.extras import require
from cam_rig.show.result import Progress
from cam_rig.show.tables import counted

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
class BounceStudy:
    """What is turned, at which values (SI)."""

    runs: BounceRuns
    values: tuple[float, ...]

    @property
    def total(self) -> int:
        """Rows in all."""
        return len(self.values)

    @property
    def text(self) -> str:
        """The law by its digest, and all other numbers."""
        runs, digest = self.runs, hashlib.sha256()
        for part in (runs.law.breaks, runs.law.ordinates):
            digest.update(np.ascontiguousarray(part).tobytes())
        told: dict[str, Any] = {"law": f"{runs.law.name} {digest.hexdigest()[:16]}"}
        told |= {"values": self.values} | {
            "settle": runs.settle,
            "turns": runs.turns,
            "sweep": asdict(runs.sweep),
        }
        told["radiation"] = runs.radiation and asdict(runs.radiation)
        return json.dumps(told, sort_keys=True)


@dataclass(frozen=True)
class BounceBatch:
    """The rows of some values, made in so many ``seconds``."""

    first: int
    rows: list[BounceRow]
    seconds: float

    @property
    def last(self) -> int:
        """The first value after the batch."""
        return self.first + len(self.rows)


def turned(study: BounceStudy, first: int, last: int) -> BounceBatch:
    """The rows of the values ``first`` to ``last`` (exclusive), each from the cam."""
    begun = time.process_time()
    rows = study.runs.rows(study.values[first:last])
    return BounceBatch(first, rows, time.process_time() - begun)


@dataclass(frozen=True, eq=False)
class BounceFiles(PointFiles):
    """Columns: ``point``, those of ``speeds`` with −∞ as it is, and `LISTS`."""

    campaign: BounceStudy

    def _table(self, rows: BounceBatch) -> Any:
        import pyarrow as pa

        fields, columns = [pa.field("point", pa.int64())], [pa.array(range(rows.first, rows.last))]
        for one in BounceMap.columns["speeds"]:
            kind = getattr(pa, KINDS.get(one.key, "float64"))()
            about = {"unit": one.si, "meaning": one.about}
            fields.append(pa.field(one.key, kind, metadata=about))
            columns.append(pa.array([one.value(row) for row in rows.rows], kind))
        for key, unit in LISTS.items():
            kind = pa.list_(pa.float64())
            fields.append(pa.field(key, kind, metadata={"unit": unit}))
            columns.append(pa.array([getattr(row, key).ravel() for row in rows.rows], kind))
        return pa.Table.from_arrays(columns, schema=pa.schema(fields, metadata=self.own))

    def rows(self) -> Iterator[BounceRow]:
        """All of them, in order."""
        study = self.campaign
        for table in self.tables():
            for row in table.to_pylist():
                numbers = [row["exponent"], *(row[f"exponent_{i}"] for i in (2, 3, 4))]
                exponents = tuple(one for one in numbers if one is not None)
                yield BounceRow(
                    point=study.runs.sweep.at(study.values[row["point"]]),
                    exponents=exponents,
                    exponent_error=row["exponent_error"],
                    hardest=np.array(row["hardest"]),
                    states=np.array(row["states"]).reshape(-1, len(exponents)),
                    **{key: row[key] for key in PLAIN},
                )


def kept_rows(
    folder: Path,
    runs: BounceRuns,
    values: Sequence[float],
    resume: bool,
    executor: Executor | None,
    workers: int,
    progress: Progress,
) -> list[BounceRow]:
    """The rows of some values (SI); those that the folder has not are made, and kept there.

    Raises
    ------
    ConfigError : a folder of other rows, or of some already where none is to be resumed
    OutputError : the folder cannot be written
    MissingLibraryError : pyarrow is not installed
    """
    require("pyarrow")
    study = BounceStudy(runs, tuple(values))
    files = BounceFiles(folder, study)
    with files.opened(resume) as damaged:
        if damaged:
            warnings.warn(damaged, stacklevel=3)
        missing = sum(last - first for first, last in files.missing())
        progress.begin(study.total, counted(missing, "row"))
        progress.advance(study.total - missing)
        run_campaign(files, executor or InThisProcess(), max(1, workers), progress, turned)
    return list(files.rows())
