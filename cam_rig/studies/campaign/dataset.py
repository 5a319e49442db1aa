"""The dataset of a campaign: a folder of Parquet files, one a batch, whole at every moment.

A file has its name only when all of it is on the disk, so readers take ``folder/*.parquet`` while
a campaign runs, and after whatever ended it. The one writer holds a lock on the folder.

The name ends in a digest of the points' range and the file's bytes: both come onto the disk in one
step, and a flipped bit, a cut or another file's name is seen wherever rows are read.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from cam_rig.datasets.point_files import PointFiles, versions
from cam_rig.extras import libraries_named
from cam_rig.studies.campaign.campaign import FAILED, OK, UNSETTLED, BatchRows, Campaign
from cam_rig.units import FloatArray

_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


@dataclass(frozen=True, eq=False)
class CampaignDataset(PointFiles):
    """The rows of a study in a folder.

    Columns: ``point``, ``seed``, ``version`` of cam_rig, the inputs (SI), the measures (their
    unit is in the schema; null where a point has none), ``status`` and ``reason``. The schema also
    holds the study as JSON, its fingerprint, and the versions rows may depend on.
    """

    campaign: Campaign

    @cached_property
    def schema(self) -> Any:
        """Of every file, a `pyarrow.Schema`."""
        with libraries_named():
            import pyarrow as pa

        def field(name: str, kind: Any, unit: str, meaning: str, nullable: bool = False) -> Any:
            about = {"unit": unit, "meaning": meaning}
            return pa.field(name, kind, nullable=nullable, metadata=about)

        word = pa.dictionary(pa.int32(), pa.string())
        fields = [
            field("point", pa.int64(), "1", "index in the plan"),
            field("seed", pa.int64(), "1", "of the plan"),
            field("version", word, "", "of cam_rig"),
        ]
        for one in self.campaign.inputs:
            fields.append(field(one.column, pa.float64(), one.si_unit, one.path))
        for measure in self.campaign.measures:
            words = measure.term.words
            fields.append(field(measure.column, pa.float64(), measure.unit, words, True))
        why = "what failed and why, or did not settle"
        fields.append(field("status", word, "", f"{OK}, {UNSETTLED} or {FAILED}"))
        fields.append(field("reason", pa.string(), "", why, True))
        about = {**self.own, "fingerprint": self.campaign.fingerprint}
        return pa.schema(fields, metadata=about)

    def _table(self, rows: BatchRows) -> Any:
        import pyarrow as pa

        count = len(rows.reasons)
        columns = [
            pa.array(np.arange(rows.first, rows.last)),
            pa.array(np.full(count, self.campaign.seed)),
            pa.array([versions()["cam_rig"]] * count).dictionary_encode(),
            *(pa.array(column) for column in rows.inputs.T),
            *(pa.array(column, mask=np.isnan(column)) for column in rows.measures.T),
            pa.array(rows.status).dictionary_encode(),
            pa.array([text or None for text in rows.reasons], pa.string()),
        ]
        return pa.Table.from_arrays(columns, schema=self.schema)

    def column(self, name: str) -> FloatArray:
        """One column in the order of the points, NaN for null; no other column is kept."""
        parts = [table.column(name).to_numpy() for table in self.tables([name])]
        return np.concatenate(parts) if parts else np.zeros(0)

    def reasons(self, status: str = FAILED) -> list[tuple[str, int]]:
        """Why points have a status and how many, most frequent first; numbers alone part none."""
        import pyarrow.compute as pc

        counts: Counter[str] = Counter()
        words: dict[str, str] = {}
        for table in self.tables(["status", "reason"]):
            given = table.filter(pc.equal(table.column("status"), status)).column("reason")
            for one in pc.value_counts(given).to_pylist():
                kind = _NUMBER.sub("#", one["values"])
                words.setdefault(kind, one["values"])
                counts[kind] += one["counts"]
        return [(words[kind], count) for kind, count in counts.most_common()]
