"""Records of an MCAP file, read and unpacked within bounds.

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

#: Largest number of bytes that one compressed chunk may unpack to. Chunks of ROS 2 have 1 to 4 MiB.
MAX_UNPACKED = 64 * MIB
#: Number of bytes that are unpacked at once.
UNPACK_BYTES = 256 * 1024
#: Number of bytes that are read at once for a series of small records.
READ_BYTES = 4096
#: Opcode and length at the start of every record.
HEAD = struct.Struct("<BQ")
#: First and last log time, unpacked bytes, their CRC, length of the name of the compression.
CHUNK_HEAD = struct.Struct("<QQQII")
#: Number of bytes that are searched at once for a chunk.
SEARCH_BYTES = 16 * MIB
#: Pattern of the start of a chunk.
CHUNK_PATTERN = re.compile(
    rb"\x06.{5}\0{3}.{16}.{5}\0{3}.{4}(?:\0{4}|\x04\0{3}zstd|\x03\0{3}lz4).{5}\0{3}", re.DOTALL
)
#: Channel, number, log time and publish time of a message. Its data follow.
MESSAGE_HEAD = struct.Struct("<HIQQ")


class Record(NamedTuple):
    """Record at the top level of a file."""

    opcode: int
    start: int  #: position of the content in the file
    length: int  #: bytes that the record claims
    available: int  #: bytes of them that the file has

    @property
    def whole(self) -> bool:
        """True if the file contains the complete record."""
        return self.length <= self.available


def records_of(stream: BinaryIO, start: int = len(MCAP0_MAGIC)) -> Iterator[Record]:
    """Yield the records of a file in order, from byte `start` on.

    After an incomplete record the function continues with the next complete chunk.
    """
    descriptor, size = stream.fileno(), os.fstat(stream.fileno()).st_size
    if not MCAP0_MAGIC.startswith(os.pread(descriptor, len(MCAP0_MAGIC), 0)):
        raise BagError(f"{stream.name}: does not begin as an MCAP file does")
    position, block, block_start = start, b"", 0
    while position + HEAD.size <= size:
        if not block_start <= position <= block_start + len(block) - HEAD.size:
            block, block_start = os.pread(descriptor, READ_BYTES, position), position
        opcode, length = HEAD.unpack_from(block, position - block_start)
        start = position + HEAD.size
        if not opcode:  # not a record: a power cut may leave zeros
            length = size
        yield Record(opcode, start, length, min(length, size - start))
        if opcode == Opcode.FOOTER and start + length + len(MCAP0_MAGIC) == size:
            return
        position = start + length
        if position > size:
            position = _next_chunk(descriptor, start, size)


def _next_chunk(descriptor: int, position: int, size: int) -> int:
    """Return the position of the next chunk that the file contains completely.

    Returns the size of the file if no such chunk follows.
    """
    while position < size:
        data = os.pread(descriptor, SEARCH_BYTES, position)
        for match in CHUNK_PATTERN.finditer(data):
            _, length = HEAD.unpack_from(match.group())
            first, last, unpacked, _, letters = CHUNK_HEAD.unpack_from(match.group(), HEAD.size)
            packed = int.from_bytes(match.group()[-8:], "little")
            fits = position + match.start() + HEAD.size + length <= size and first <= last
            is_consistent = length == CHUNK_HEAD.size + letters + 8 + packed
            if fits and is_consistent and (letters or unpacked == packed):
                return position + match.start()
        position += SEARCH_BYTES - 64  # a chunk head may extend across the boundary
    return size


def content(stream: BinaryIO, record: Record) -> bytes:
    """Return the bytes of a record that the file contains."""
    return os.pread(stream.fileno(), record.available, record.start)


def fields(data: bytes) -> ReadDataStream:
    """Return a stream of a record's content for the readers of the mcap package.

    The readers cannot read beyond the record.
    """
    return ReadDataStream(BytesIO(data))


def message(data: bytes) -> Message:
    """Return the message of a record's bytes."""
    channel, number, logged, published = MESSAGE_HEAD.unpack_from(data)
    return Message(channel, logged, data[MESSAGE_HEAD.size :], published, number)


#: Readers of the records that a chunk may contain, by opcode. The top level of a file may contain
#: them too.
CONTENT_READERS: dict[int, Callable[[bytes], Any]] = {
    Opcode.SCHEMA: lambda data: Schema.read(fields(data)),
    Opcode.CHANNEL: lambda data: Channel.read(fields(data)),
    Opcode.MESSAGE: message,
}


@dataclass(frozen=True)
class ChunkHead:
    """Data that a chunk claims: times in ns, sizes in bytes.

    `packed_at` is the position of the packed data in the file.
    """

    start: int
    end: int
    unpacked: int
    crc: int
    compression: str
    packed: int
    packed_at: int


def chunk_head(stream: BinaryIO, record: Record) -> ChunkHead:
    """Return the head of a chunk.

    The chunk may be truncated after its head. Raises ValueError if it claims more data than its
    length.
    """
    data = os.pread(stream.fileno(), min(record.available, CHUNK_HEAD.size + 32 + 8), record.start)
    first, last, unpacked, crc, letters = CHUNK_HEAD.unpack_from(data)
    name = data[CHUNK_HEAD.size :][:letters]
    (packed,) = struct.unpack_from("<Q", data, CHUNK_HEAD.size + letters)
    head_size = CHUNK_HEAD.size + letters + 8
    if packed > record.length - head_size:
        raise ValueError(f"a chunk of {record.length} bytes claims {packed} of data")
    return ChunkHead(first, last, unpacked, crc, name.decode(), packed, record.start + head_size)


def unpack(stream: BinaryIO, record: Record, head: ChunkHead) -> bytes:
    """Return the bytes of a chunk that can be unpacked.

    The result is shorter than claimed if the chunk is truncated or damaged, and never longer.
    """
    check_claims(head)
    available = min(head.packed, record.start + record.available - head.packed_at)
    packed = os.pread(stream.fileno(), max(available, 0), head.packed_at)
    if not head.compression:
        return packed
    data = bytearray()
    try:
        for part in _unpack_steps(head.compression, packed):
            data += part
            if len(data) > head.unpacked:
                break
    except (zstandard.ZstdError, RuntimeError, EOFError):
        pass  # truncated or damaged: the bytes before are used
    return bytes(data[: head.unpacked])


def check_claims(head: ChunkHead) -> None:
    """Raise ValueError if a chunk claims an unknown compression or too large a size.

    The check uses the head only, before anything is unpacked.
    """
    if head.compression not in ("", "zstd", "lz4"):
        raise ValueError(f"a chunk compressed by {head.compression!r}; allowed: zstd, lz4")
    if head.compression and head.unpacked > MAX_UNPACKED:
        raise ValueError(
            f"a chunk of {head.packed} bytes claims {head.unpacked} unpacked; allowed: "
            f"{MAX_UNPACKED}"
        )


def read_chunk(data: bytes) -> Iterator[Schema | Channel | Message]:
    """Yield the records of a chunk.

    Raises ValueError at the first record that is truncated or of another kind.
    """
    position = 0
    while position + HEAD.size <= len(data):
        opcode, length = HEAD.unpack_from(data, position)
        position += HEAD.size + length
        if opcode not in CONTENT_READERS:
            raise ValueError(f"a record of kind {opcode} in a chunk")
        if position > len(data):
            available = len(data) - position + length
            raise ValueError(f"a record of {length} bytes where {available} are left")
        yield CONTENT_READERS[opcode](data[position - length : position])
    if position != len(data):
        raise ValueError(f"{len(data) - position} bytes that are not a record")


def _unpack_steps(compression: str, packed: bytes) -> Iterator[bytes]:
    if compression == "zstd":
        with zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True) as reader:
            while part := reader.read(UNPACK_BYTES):
                yield part
        return
    unpacker = lz4.frame.LZ4FrameDecompressor()
    while not unpacker.eof and (part := unpacker.decompress(packed, max_length=UNPACK_BYTES)):
        packed = b""
        yield part


# Limits of the memory that a reader needs for a file, checked before anything is unpacked.

#: Bytes that the compressed chunks of a file may unpack to, whatever its size.
FREE_UNPACKED = 16 * MIB
#: Further unpacked bytes that are allowed per byte of the file.
MAX_RATIO = 100
#: Largest number of unpacked bytes in memory at once. Readers sort chunks of overlapping times.
MAX_AT_ONCE = 128 * MIB
#: Number of bytes per step of a checksum.
CRC_BYTES = 4 * MIB
#: Entry of metadata.yaml of a bag whose messages or files are compressed one by one.
COMPRESSED = re.compile(rb"compression_mode[\"']?\s*:\s*[\"']?(file|message)", re.IGNORECASE)


def require_bounded(file: Path) -> None:
    """Check that an MCAP file needs no more memory than its size allows.

    The limits are `MAX_UNPACKED` bytes per compressed chunk, `FREE_UNPACKED` bytes plus `MAX_RATIO`
    times the size of the file for all of them, and `MAX_AT_ONCE` bytes for chunks that overlap in
    time. Raises BagError beyond a limit, and for truncated records, wrong indexes and wrong
    checksums.
    """
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
                        _check_unpacked_size(stream, head)
                        packed.append(head)
                elif record.opcode == Opcode.DATA_END:
                    require_data_crc(stream, record)
                elif record.opcode == Opcode.CHUNK_INDEX:
                    _check_index(ChunkIndex.read(fields(content(stream, record))), chunks)
        except (ValueError, EOFError, struct.error, McapError) as error:
            raise BagError(f"{file}: {reason(error)}") from None
    size, total = file.stat().st_size, sum(head.unpacked for head in packed)
    limit = FREE_UNPACKED + MAX_RATIO * size
    if total > limit:
        raise BagError(
            f"{file}: {size} bytes that unpack to {total}; allowed: {limit}, {MAX_RATIO} times as "
            f"much and {FREE_UNPACKED // MIB} MiB"
        )
    if (overlap := _max_overlap(packed)) > MAX_AT_ONCE:
        raise BagError(
            f"{file}: compressed chunks of {overlap} bytes are of one time; allowed: {MAX_AT_ONCE}"
        )


def require_plain(bag: Path) -> None:
    """Raise BagError for a bag whose files or messages are compressed one by one.

    The size that such data unpack to has no bound.
    """
    if (file := bag / METADATA).exists():
        with file.open("rb") as stream:
            mode = COMPRESSED.search(stream.read(MIB))
        if mode:
            raise BagError(
                f"{bag}: is compressed by {mode.group(1).decode().lower()}; allowed: by chunk, or "
                "not; change it with: ros2 bag convert"
            )


def _check_unpacked_size(stream: BinaryIO, head: ChunkHead) -> None:
    """Raise ValueError if a compressed chunk unpacks to another size than it claims."""
    check_claims(head)
    packed, size = os.pread(stream.fileno(), head.packed, head.packed_at), 0
    try:
        for part in _unpack_steps(head.compression, packed):
            size += len(part)
            if size > head.unpacked:
                break
    except (zstandard.ZstdError, RuntimeError) as error:
        raise ValueError(f"a chunk that cannot be unpacked ({error})") from None
    if size != head.unpacked:
        more = "more" if size > head.unpacked else f"{size}"
        raise ValueError(f"a chunk claims {head.unpacked} bytes unpacked and has {more}")


def require_data_crc(stream: BinaryIO, data_end: Record) -> None:
    """Raise ValueError if the checksum of the data section is wrong.

    The checksum is in the DataEnd record. It covers all bytes before that record.
    """
    expected = int.from_bytes(content(stream, data_end)[:4], "little")
    if not expected:  # the writer computed no checksum
        return
    crc, position, end = 0, 0, data_end.start - HEAD.size
    while position < end:
        block = os.pread(stream.fileno(), min(CRC_BYTES, end - position), position)
        crc, position = zlib.crc32(block, crc), position + len(block)
    if crc != expected:
        raise ValueError("the checksum of the data section is wrong")


def _check_index(index: ChunkIndex, chunks: dict[int, tuple[Record, ChunkHead]]) -> None:
    """Raise ValueError if an index differs from its chunk.

    Each chunk is removed from `chunks`, so that it can have one index only.
    """
    start = index.chunk_start_offset + 9
    if start not in chunks:
        raise ValueError(
            f"an index of a chunk at byte {index.chunk_start_offset}, where there is none"
        )
    record, head = chunks.pop(start)
    claimed = index.compression, index.compressed_size, index.uncompressed_size, index.chunk_length
    actual = head.compression, head.packed, head.unpacked, record.length + 9
    times = index.message_start_time, index.message_end_time
    if claimed != actual or times != (head.start, head.end):
        raise ValueError(f"an index that claims {claimed} of a chunk that is {actual}")


def _max_overlap(heads: list[ChunkHead]) -> int:
    """Return the largest number of unpacked bytes of chunks that overlap in time."""
    edges = [(head.start, 0, head.unpacked) for head in heads]
    edges += [(max(head.start, head.end), 1, -head.unpacked) for head in heads]
    return max(accumulate(size for *_, size in sorted(edges)), default=0)
