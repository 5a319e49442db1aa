"""Rows as a sound file: a channel each quantity, 32-bit floats in SI units.

A sound file knows neither the names of its channels nor time: the names stand in its comment
(INFO, ICMT), and the samples must follow each other without a gap.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from cam_rig.errors import OutputError
from cam_rig.export.columns import COLUMNS, Chunk

#: No channels: the sample's place says the time, and 32 bits do not hold an angle of many turns.
WITHOUT = ("time_s", "angle_rad")
CHANNELS = tuple(i for i, column in enumerate(COLUMNS) if column.name not in WITHOUT)
#: A format of its time: sizes in it are numbers of 32 bits.
MAX_BYTES = 2**32 - 2**16
IEEE_FLOAT = 3
REMEDY = "so name one --cam and --rpm, or write .parquet, .npz or .csv"


def write(path: Path, chunks: Iterable[Chunk], about: dict[str, str], rate: int) -> None:
    """Write all rows.

    Raises
    ------
    OutputError : samples are missing between two, or there are more than such a file holds
    """
    rows, begin, last = 0, 0.0, None
    with path.open("w+b") as file:
        file.write(_head(0, rate, _comment(about, 0.0)))
        for chunk in chunks:
            times = chunk.numbers[0]
            begin = float(times[0]) if last is None else begin
            _require_no_gap(path, times if last is None else np.append(last, times), rate)
            last, rows = times[-1], rows + times.size
            if rows * 4 * len(CHANNELS) > MAX_BYTES:
                raise OutputError(f"{path}: more than 4 GiB; allowed: what WAV can hold, {REMEDY}")
            file.write(chunk.numbers[CHANNELS, :].T.astype("<f4").tobytes())
        file.seek(0)
        file.write(_head(rows, rate, _comment(about, begin)))


def _require_no_gap(path: Path, times: np.ndarray, rate: int) -> None:
    steps = np.rint(np.diff(times) * rate)
    if (steps != 1.0).any():
        i = int(np.argmax(steps != 1.0))
        raise OutputError(
            f"{path}: no samples from {times[i]:.6g} to {times[i + 1]:.6g} s; allowed: a sound "
            f"file has no gaps, {REMEDY}"
        )


def _comment(about: dict[str, str], begin: float) -> bytes:
    """Names and units of the channels, of the same length for any beginning (s)."""
    names = ", ".join(f"{COLUMNS[i].name} [{COLUMNS[i].unit}]" for i in CHANNELS)
    run = ", ".join(f"{name} {text}" for name, text in about.items())
    text = f"channels: {names}; begins at {begin:024.12f} s; {run}".encode()
    return text + b"\0" * (2 - len(text) % 2)


def _head(rows: int, rate: int, comment: bytes) -> bytes:
    """All chunks before the samples, and the head of theirs."""
    frame = 4 * len(CHANNELS)
    layout = struct.pack("<HHIIHHH", IEEE_FLOAT, len(CHANNELS), rate, rate * frame, frame, 32, 0)
    chunks = (
        _chunk(b"fmt ", layout)
        + _chunk(b"fact", struct.pack("<I", rows))
        + _chunk(b"LIST", b"INFO" + _chunk(b"ICMT", comment))
        + struct.pack("<4sI", b"data", rows * frame)
    )
    return struct.pack("<4sI4s", b"RIFF", 4 + len(chunks) + rows * frame, b"WAVE") + chunks


def _chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack("<4sI", name, len(data)) + data
