"""The records of an MCAP file: none is read beyond the file, nor unpacked without bound.

The length that a record claims is compared with the bytes of the file before anything is read.
"""

from __future__ import annotations

import os
import re
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from io import BytesIO
from itertools import accumulate
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, Message, Schema
from mcap.writer import MCAP0_MAGIC

from cam_rig.bag.files import METADATA, reason
from cam_rig.errors import BagError
from cam_rig.files import MIB

#: Bytes that one compressed chunk may unpack to; those of ROS 2 have 1 to 4 MiB.
MAX_UNPACKED = 64 * MIB
#: Bytes unpacked at once, and bytes read at once of a series of small records.
UNPACK_BYTES, READ_BYTES = 256 * 1024, 4096
#: Opcode and length of every record.
HEAD = struct.Struct("<BQ")
#: First and last log time, unpacked bytes, their CRC, letters of the compression's name.
CHUNK_HEAD = struct.Struct("<QQQII")
#: Bytes searched at once for a chunk, and the pattern of its beginning.
SEARCH_BYTES = 16 * MIB
CHUNK_PATTERN = re.compile(
    rb"\x06.{5}\0{3}.{16}.{5}\0{3}.{4}(?:\0{4}|\x04\0{3}zstd|\x03\0{3}lz4).{5}\0{3}", re.DOTALL
)
#: A message's channel, number, log time and publish time; its data follow.
MESSAGE_HEAD = struct.Struct("<HIQQ")


class Record(NamedTuple):
    """A record at a file's top: opcode, begin, the bytes that it claims and that the file has."""

    opcode: int
    start: int
    length: int
    available: int

    @property
    def whole(self) -> bool:
        """Whether the file holds all of it."""
        return self.length <= self.available


def records_of(stream: BinaryIO, start: int = len(MCAP0_MAGIC)) -> Iterator[Record]:
    """Yield the records of a file in order, from byte ``start`` on.

    After a record that is not whole, it continues with the next whole chunk.
    """
    number, size = stream.fileno(), os.fstat(stream.fileno()).st_size
    if not MCAP0_MAGIC.startswith(os.pread(number, len(MCAP0_MAGIC), 0)):
        raise BagError(f"{stream.name}: does not begin as an MCAP file does")
    place, block, begin = start, b"", 0
    while place + HEAD.size <= size:
        if not begin <= place <= begin + len(block) - HEAD.size:
            block, begin = os.pread(number, READ_BYTES, place), place
        opcode, length = HEAD.unpack_from(block, place - begin)
        start = place + HEAD.size
        if not opcode:  # not a record: a power cut may leave zeros
            length = size
        yield Record(opcode, start, length, min(length, size - start))
        if opcode == Opcode.FOOTER and start + length + len(MCAP0_MAGIC) == size:
            return
        place = start + length
        if place > size:
            place = _next_chunk(number, start, size)


def _next_chunk(number: int, place: int, size: int) -> int:
    """Where the next chunk begins that the file holds whole; its size where there is none."""
    while place < size:
        data = os.pread(number, SEARCH_BYTES, place)
        for match in CHUNK_PATTERN.finditer(data):
            _, length = HEAD.unpack_from(match.group())
            begin, end, unpacked, _, letters = CHUNK_HEAD.unpack_from(match.group(), HEAD.size)
            packed = int.from_bytes(match.group()[-8:], "little")
            fits = place + match.start() + HEAD.size + length <= size and begin <= end
            agrees = length == CHUNK_HEAD.size + letters + 8 + packed
            if fits and agrees and (letters or unpacked == packed):
                return place + match.start()
        place += SEARCH_BYTES - 64  # one may lie across the border
    return size


def content(stream: BinaryIO, record: Record) -> bytes:
    """What the file holds of a record."""
    return os.pread(stream.fileno(), record.available, record.start)


def fields(data: bytes) -> ReadDataStream:
    """A record's content for the readers of the mcap package, which then cannot read beyond it."""
    return ReadDataStream(BytesIO(data))


def message(data: bytes) -> Message:
    """A message of a record's bytes."""
    channel, number, logged, published = MESSAGE_HEAD.unpack_from(data)
    return Message(channel, logged, data[MESSAGE_HEAD.size :], published, number)


#: What may be in a chunk, and at the top of a file as well: how to read it.
INSIDE: dict[int, Callable[[bytes], Any]] = {
    Opcode.SCHEMA: lambda data: Schema.read(fields(data)),
    Opcode.CHANNEL: lambda data: Channel.read(fields(data)),
    Opcode.MESSAGE: message,
}


@dataclass(frozen=True)
class ChunkHead:
    """What a chunk claims, times in ns, sizes in bytes; ``packed_at`` is the place in the file."""

    begin: int
    end: int
    unpacked: int
    crc: int
    compression: str
    packed: int
    packed_at: int


def chunk_head(stream: BinaryIO, record: Record) -> ChunkHead:
    """The head of a chunk, which may be truncated behind it."""
    data = os.pread(stream.fileno(), min(record.available, CHUNK_HEAD.size + 32 + 8), record.start)
    begin, end, unpacked, crc, letters = CHUNK_HEAD.unpack_from(data)
    name = data[CHUNK_HEAD.size :][:letters]
    (packed,) = struct.unpack_from("<Q", data, CHUNK_HEAD.size + letters)
    inside = CHUNK_HEAD.size + letters + 8
    if packed > record.length - inside:
        raise ValueError(f"a chunk of {record.length} bytes claims {packed} of data")
    return ChunkHead(begin, end, unpacked, crc, name.decode(), packed, record.start + inside)


def unpack(stream: BinaryIO, record: Record, head: ChunkHead) -> bytes:
    """The bytes of a chunk as far as they can be had, never more than it claims."""
    require_modest(head)
    available = min(head.packed, record.start + record.available - head.packed_at)
    packed = os.pread(stream.fileno(), max(available, 0), head.packed_at)
    if not head.compression:
        return packed
    out = bytearray()
    try:
        for part in _unpacked(head.compression, packed):
            out += part
            if len(out) > head.unpacked:
                break
    except (zstandard.ZstdError, RuntimeError, EOFError):
        pass  # truncated or damaged; what came before counts
    return bytes(out[: head.unpacked])


def require_modest(head: ChunkHead) -> None:
    """Refuse a compressed chunk by what it claims, before anything is unpacked."""
    if head.compression not in ("", "zstd", "lz4"):
        raise ValueError(f"a chunk compressed by {head.compression!r}; allowed: zstd, lz4")
    if head.compression and head.unpacked > MAX_UNPACKED:
        raise ValueError(
            f"a chunk of {head.packed} bytes claims {head.unpacked} unpacked; allowed: "
            f"{MAX_UNPACKED}"
        )


def inside(data: bytes) -> Iterator[Schema | Channel | Message]:
    """What a chunk holds, up to the first record that is truncated or is not one."""
    place = 0
    while place + HEAD.size <= len(data):
        opcode, length = HEAD.unpack_from(data, place)
        place += HEAD.size + length
        if opcode not in INSIDE:
            raise ValueError(f"a record of kind {opcode} in a chunk")
        if place > len(data):
            left = len(data) - place + length
            raise ValueError(f"a record of {length} bytes where {left} are left")
        yield INSIDE[opcode](data[place - length : place])
    if place != len(data):
        raise ValueError(f"{len(data) - place} bytes that are not a record")


def _unpacked(compression: str, packed: bytes) -> Iterator[bytes]:
    if compression == "zstd":
        with zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True) as reader:
            while part := reader.read(UNPACK_BYTES):
                yield part
        return
    unpacker = lz4.frame.LZ4FrameDecompressor()
    while not unpacker.eof and (part := unpacker.decompress(packed, max_length=UNPACK_BYTES)):
        packed = b""
        yield part


# The memory that a file takes from its reader: bounded before any reader unpacks it.

#: What a file's compressed chunks may unpack to: this, and so many times the file's size.
FREE_UNPACKED, MAX_RATIO = 16 * MIB, 100
#: What readers hold at once, for they bring chunks of overlapping times into order, bytes.
MAX_AT_ONCE = 128 * MIB
#: Bytes of which a checksum is computed at once.
CRC_BYTES = 4 * MIB
#: A bag whose messages or files are compressed one by one.
COMPRESSED = re.compile(rb"compression_mode[\"']?\s*:\s*[\"']?(file|message)", re.IGNORECASE)


def require_bounded(file: Path) -> None:
    """Refuse an MCAP file that would take more memory than its size warrants."""
    packed: list[ChunkHead] = []
    chunks: dict[int, tuple[Record, ChunkHead]] = {}
    with file.open("rb") as stream:
        try:
            for record in records_of(stream):
                if not record.whole:
                    raise ValueError(
                        f"a record of {record.length} bytes, the file has {record.available}"
                    )
                if record.opcode == Opcode.CHUNK:
                    head = chunk_head(stream, record)
                    chunks[record.start] = record, head
                    if head.compression:
                        _require_honest(stream, head)
                        packed.append(head)
                elif record.opcode == Opcode.DATA_END:
                    require_data_crc(stream, record)
                elif record.opcode == Opcode.CHUNK_INDEX:
                    _require_true(ChunkIndex.read(fields(content(stream, record))), chunks)
        except (ValueError, EOFError, struct.error, McapError) as error:
            raise BagError(f"{file}: {reason(error)}") from None
    size, total = file.stat().st_size, sum(head.unpacked for head in packed)
    most = FREE_UNPACKED + MAX_RATIO * size
    if total > most:
        raise BagError(
            f"{file}: {size} bytes that unpack to {total}; allowed: {most}, {MAX_RATIO} times as "
            f"much and {FREE_UNPACKED // MIB} MiB"
        )
    if (held := _at_once(packed)) > MAX_AT_ONCE:
        raise BagError(
            f"{file}: compressed chunks of {held} bytes are of one time; allowed: {MAX_AT_ONCE}"
        )


def require_plain(bag: Path) -> None:
    """Refuse a bag whose files or messages are compressed one by one: nothing bounds those."""
    if (file := bag / METADATA).exists():
        with file.open("rb") as stream:
            mode = COMPRESSED.search(stream.read(MIB))
        if mode:
            raise BagError(
                f"{bag}: is compressed by {mode.group(1).decode().lower()}; allowed: by chunk, or "
                "not; change it with: ros2 bag convert"
            )


def _require_honest(stream: BinaryIO, head: ChunkHead) -> None:
    """Refuse a compressed chunk that unpacks to another size than it claims."""
    require_modest(head)
    packed, size = os.pread(stream.fileno(), head.packed, head.packed_at), 0
    try:
        for part in _unpacked(head.compression, packed):
            size += len(part)
            if size > head.unpacked:
                break
    except (zstandard.ZstdError, RuntimeError) as error:
        raise ValueError(f"a chunk that cannot be unpacked ({error})") from None
    if size != head.unpacked:
        more = "more" if size > head.unpacked else f"{size}"
        raise ValueError(f"a chunk claims {head.unpacked} bytes unpacked and has {more}")


def require_data_crc(stream: BinaryIO, data_end: Record) -> None:
    """Refuse a file whose bytes before its DataEnd record differ from the checksum there."""
    expected = int.from_bytes(content(stream, data_end)[:4], "little")
    if not expected:  # the writer computed none
        return
    crc, position, end = 0, 0, data_end.start - HEAD.size
    while position < end:
        block = os.pread(stream.fileno(), min(CRC_BYTES, end - position), position)
        crc, position = zlib.crc32(block, crc), position + len(block)
    if crc != expected:
        raise ValueError("the checksum of the data section is wrong")


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
    times = index.message_start_time, index.message_end_time
    if claimed != true or times != (head.begin, head.end):
        raise ValueError(f"an index that claims {claimed} of a chunk that is {true}")


def _at_once(heads: list[ChunkHead]) -> int:
    """The most bytes of chunks that overlap in time."""
    edges = [(head.begin, 0, head.unpacked) for head in heads]
    edges += [(max(head.begin, head.end), 1, -head.unpacked) for head in heads]
    return max(accumulate(size for *_, size in sorted(edges)), default=0)
