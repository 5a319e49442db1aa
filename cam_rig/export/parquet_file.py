"""Rows as Parquet, with unit and meaning of each column in the schema."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from cam_rig.export.columns import CAM, COLUMNS, Chunk
from cam_rig.extras import libraries_named


def write(path: Path, chunks: Iterable[Chunk], about: dict[str, str], rate: int) -> None:
    """Write all rows, a row group for each chunk.

    Raises
    ------
    MissingLibraryError : pyarrow is not installed
    """
    with libraries_named():
        import pyarrow as pa
        import pyarrow.parquet as pq

    schema = _schema(pa, {**about, "sample_rate_Hz": str(rate)})
    with pq.ParquetWriter(path, schema) as writer:
        for chunk in chunks:
            time, *numbers = (pa.array(row) for row in chunk.numbers)
            cams = pa.array(chunk.names).dictionary_encode()
            writer.write_table(pa.Table.from_arrays([time, cams, *numbers], schema=schema))


def _schema(pa: Any, about: dict[str, str]) -> Any:
    time, *others = (
        pa.field(
            column.name,
            pa.float64(),
            nullable=False,
            metadata={"unit": column.unit, "meaning": column.meaning},
        )
        for column in COLUMNS
    )
    names = pa.dictionary(pa.int32(), pa.string())
    cam = pa.field(CAM, names, nullable=False, metadata={"meaning": "the mounted cam"})
    return pa.schema([time, cam, *others], metadata=about)
