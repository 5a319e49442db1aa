"""Rows as CSV: one heading, every number with all its digits."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from cam_rig.export.columns import CAM, COLUMNS, Chunk


def write(path: Path, chunks: Iterable[Chunk], _about: dict[str, str], _rate: int) -> None:
    """Write all rows, the cam's name in the second column."""
    time, *others = (column.name for column in COLUMNS)
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(",".join([time, CAM, *others]) + "\n")
        for chunk in chunks:
            times, *numbers = (map(repr, row.tolist()) for row in chunk.numbers)
            rows = zip(times, chunk.names.tolist(), *numbers, strict=True)
            file.writelines(",".join(row) + "\n" for row in rows)
