"""The memory that a file takes from its reader: bounded before any reader unpacks it.

A few bytes may claim to unpack to gigabytes, and an index may lead a reader to chunks that a walk
through the file does not meet. Here everything that a reader will follow is compared with the
file. A chunk that is not compressed needs what it has in the file, and is not bounded.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterable
from pathlib import Path
from typing import BinaryIO

import zstandard
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import ChunkIndex

from cam_rig.bag.damage import reason
from cam_rig.bag.files import METADATA
from cam_rig.bag.records import (
    ChunkHead,
    Record,
    chunk_head,
    content,
    fields,
    records_of,
    require_modest,
    unpacked_size,
)
from cam_rig.errors import BagError
from cam_rig.files import MIB

#: What a file's compressed chunks may unpack to: this, and so many times the file's size.
FREE_UNPACKED, MAX_RATIO = 16 * MIB, 100
#: What readers hold at once, for they bring chunks of overlapping times into order, bytes.
MAX_AT_ONCE = 128 * MIB
#: A bag whose messages or files are compressed one by one.
COMPRESSED = re.compile(rb"compression_mode[\"']?\s*:\s*[\"']?(file|message)", re.IGNORECASE)

Span = tuple[int, int, int]


def require_bounded(file: Path) -> None:
    """Refuse an MCAP file that would take more memory than its size warrants.

    Raises
    ------
    BagError : what it claims, and what is allowed
    OSError : it cannot be read
    """
    spans: list[Span] = []
    chunks: dict[int, tuple[Record, ChunkHead]] = {}
    with file.open("rb") as stream:
        try:
            for record in records_of(stream):
                if not record.whole:
                    raise ValueError(
                        f"a record of {record.length} bytes, the file has {record.available}"
                    )
                if record.opcode == Opcode.CHUNK:
                    chunks[record.start], span = _chunk(stream, record)
                    spans += span
                elif record.opcode == Opcode.CHUNK_INDEX:
                    _require_true(ChunkIndex.read(fields(content(stream, record))), chunks)
        except (ValueError, EOFError, struct.error, McapError) as error:
            raise BagError(f"{file}: {reason(error)}") from None
    size, total = file.stat().st_size, sum(unpacked for *_, unpacked in spans)
    most = FREE_UNPACKED + MAX_RATIO * size
    if total > most:
        raise BagError(
            f"{file}: {size} bytes that unpack to {total}; allowed: {most}, {MAX_RATIO} times as "
            f"much and {FREE_UNPACKED // MIB} MiB"
        )
    if (held := _at_once(spans)) > MAX_AT_ONCE:
        raise BagError(
            f"{file}: compressed chunks of {held} bytes are of one time; allowed: {MAX_AT_ONCE}"
        )


def require_plain(bag: Path) -> None:
    """Refuse a bag whose files or messages are compressed one by one, since nothing bounds those.

    Raises
    ------
    BagError : how it is compressed, and what is allowed
    OSError : its metadata.yaml cannot be read
    """
    if (file := bag / METADATA).exists():
        with file.open("rb") as stream:
            mode = COMPRESSED.search(stream.read(MIB))
        if mode:
            raise BagError(
                f"{bag}: is compressed by {mode.group(1).decode().lower()}; allowed: by chunk, or "
                "not; change it with: ros2 bag convert"
            )


def _chunk(stream: BinaryIO, record: Record) -> tuple[tuple[Record, ChunkHead], list[Span]]:
    head = chunk_head(stream, record)
    require_modest(head)
    if not head.compression:
        return (record, head), []
    try:
        size = unpacked_size(stream, head)
    except (zstandard.ZstdError, RuntimeError) as error:
        raise ValueError(f"a chunk that cannot be unpacked ({error})") from None
    if size != head.unpacked:
        more = "more" if size > head.unpacked else f"{size}"
        raise ValueError(f"a chunk claims {head.unpacked} bytes unpacked and has {more}")
    return (record, head), [(head.begin, head.end, head.unpacked)]


def _require_true(index: ChunkIndex, chunks: dict[int, tuple[Record, ChunkHead]]) -> None:
    """Refuse an index that differs from the chunk it is of; each once."""
    start = index.chunk_start_offset + 9
    if start not in chunks:
        raise ValueError(
            f"an index of a chunk at byte {index.chunk_start_offset}, where there is none"
        )
    record, head = chunks.pop(start)
    claimed = index.compression, index.compressed_size, index.uncompressed_size, index.chunk_length
    true = head.compression, head.packed, head.unpacked, record.length + 9
    if claimed != true or (index.message_start_time, index.message_end_time) != (
        head.begin,
        head.end,
    ):
        raise ValueError(f"an index that claims {claimed} of a chunk that is {true}")


def _at_once(spans: Iterable[Span]) -> int:
    """The most bytes of chunks that overlap in time."""
    edges = [(begin, 0, size) for begin, _, size in spans]
    edges += [(max(begin, end), 1, -size) for begin, end, size in spans]
    most = held = 0
    for _, _, size in sorted(edges):
        held += size
        most = max(most, held)
    return most
