"""Dataset of a campaign: columns and schema of its Parquet files.

`cam_rig.datasets.point_files` defines the folder, the names and the integrity checks of the files.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from cam_rig.datasets.point_files import PointFiles, versions
from cam_rig.extras import friendly_import_errors
from cam_rig.studies.campaign.campaign import FAILED, OK, UNSETTLED, BatchRows, Campaign
from cam_rig.units import FloatArray

#: Pattern of a number in an error text. Error texts that differ only in numbers are counted as the
#: same reason of failure.
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


@dataclass(frozen=True, eq=False)
class CampaignDataset(PointFiles):
    """Rows of a campaign, stored as Parquet files in a folder.

    The columns are ``point``, ``seed``, ``version`` of cam_rig, the inputs (SI), the measures (unit
    in the schema, null if a measure failed), ``status`` and ``reason``. The schema also contains
    the campaign as JSON, its fingerprint, and the versions of the packages used.
    """

    campaign: Campaign

    @cached_property
    def schema(self) -> Any:
        """Schema of every Parquet file of the dataset, a `pyarrow.Schema`."""
        with friendly_import_errors():
            import pyarrow as pa

        def field(name: str, kind: Any, unit: str, meaning: str, nullable: bool = False) -> Any:
            metadata = {"unit": unit, "meaning": meaning}
            return pa.field(name, kind, nullable=nullable, metadata=metadata)

        text_type = pa.dictionary(pa.int32(), pa.string())
        fields = [
            field("point", pa.int64(), "1", "index in the plan"),
            field("seed", pa.int64(), "1", "of the plan"),
            field("version", text_type, "", "of cam_rig"),
        ]
        for item in self.campaign.inputs:
            fields.append(field(item.column, pa.float64(), item.si_unit, item.path))
        for measure in self.campaign.measures:
            meaning = measure.term.words
            fields.append(field(measure.column, pa.float64(), measure.unit, meaning, True))
        reason_meaning = "what failed and why, or did not settle"
        fields.append(field("status", text_type, "", f"{OK}, {UNSETTLED} or {FAILED}"))
        fields.append(field("reason", pa.string(), "", reason_meaning, True))
        metadata = {**self.origin, "fingerprint": self.campaign.fingerprint}
        return pa.schema(fields, metadata=metadata)

    def _to_table(self, rows: BatchRows) -> Any:
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
        """Return one column in the order of the points (rigs), NaN for null.

        Only this column is read, so memory suffices for large datasets.
        """
        parts = [table.column(name).to_numpy() for table in self.tables([name])]
        return np.concatenate(parts) if parts else np.zeros(0)

    def reasons(self, status: str = FAILED) -> list[tuple[str, int]]:
        """Return the reasons of the points with a status, and the number of points each.

        A point is one rig of the campaign. The most frequent reason is first. Reasons that differ
        only in numbers are counted together, and the first of them is returned.
        """
        import pyarrow.compute as pc

        counts: Counter[str] = Counter()
        examples: dict[str, str] = {}
        for table in self.tables(["status", "reason"]):
            reasons = table.filter(pc.equal(table.column("status"), status)).column("reason")
            for entry in pc.value_counts(reasons).to_pylist():
                kind = _NUMBER.sub("#", entry["values"])
                examples.setdefault(kind, entry["values"])
                counts[kind] += entry["counts"]
        return [(examples[kind], count) for kind, count in counts.most_common()]
