"""Records of an MCAP file, read and unpacked within limits of memory.

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
from mcap.records import Channel, Message, Schema
from mcap.writer import MCAP0_MAGIC

from cam_rig.bag.files import METADATA, error_text
from cam_rig.errors import BagError
from cam_rig.files import MIB

#: Largest unpacked size of one compressed chunk, bytes. Chunks of ROS 2 have 1 to 4 MiB.
MAX_UNPACKED = 64 * MIB
#: Number of bytes of a compressed chunk that are uncompressed in one step.
UNPACK_BYTES = 256 * 1024
#: Number of bytes that are read in one step for a series of small records.
READ_BYTES = 4096
#: Layout of the start of every MCAP record: opcode and length.
HEAD = struct.Struct("<BQ")
#: Layout of the start of a chunk: first and last log time, unpacked size, its CRC, length of the
#: compression's name.
CHUNK_HEAD = struct.Struct("<QQQII")
#: Number of bytes that are read in one step while the next chunk is searched for.
SEARCH_BYTES = 16 * MIB
#: Pattern of the first bytes of a chunk. It finds the next chunk after damaged bytes.
CHUNK_PATTERN = re.compile(
    rb"\x06.{5}\0{3}.{16}.{5}\0{3}.{4}(?:\0{4}|\x04\0{3}zstd|\x03\0{3}lz4).{5}\0{3}", re.DOTALL
)
#: Layout of the start of a message: channel, number, log time and publish time. Its data follow.
MESSAGE_HEAD = struct.Struct("<HIQQ")


class Record(NamedTuple):
    """Record at the top level of an MCAP file."""

    opcode: int
    start: int  #: position of the content in the file
    length: int  #: bytes of the content by the head of the record
    available: int  #: bytes of the content that the file has

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
        raise BagError(f"{stream.name}: is not an MCAP file, its first bytes are wrong")
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


def read_content(stream: BinaryIO, record: Record) -> bytes:
    """Return the content of an MCAP record, as far as the file contains it."""
    return os.pread(stream.fileno(), record.available, record.start)


def fields(data: bytes) -> ReadDataStream:
    """Return a stream of a record's content for the readers of the mcap package.

    The readers cannot read beyond the end of the record.
    """
    return ReadDataStream(BytesIO(data))


def parse_message(data: bytes) -> Message:
    """Return the message in the bytes of a record."""
    channel, number, logged, published = MESSAGE_HEAD.unpack_from(data)
    return Message(channel, logged, data[MESSAGE_HEAD.size :], published, number)


#: Readers of the records that a chunk may contain, by opcode. These records may also occur at the
#: top level of a file.
CONTENT_READERS: dict[int, Callable[[bytes], Any]] = {
    Opcode.SCHEMA: lambda data: Schema.read(fields(data)),
    Opcode.CHANNEL: lambda data: Channel.read(fields(data)),
    Opcode.MESSAGE: parse_message,
}


@dataclass(frozen=True)
class ChunkHead:
    """Head of a chunk of an MCAP file: times in ns and sizes in bytes that it states.

    `packed_at` is the position of the compressed data in the file.
    """

    start: int
    end: int
    unpacked: int
    crc: int
    compression: str
    packed: int
    packed_at: int


def chunk_head(stream: BinaryIO, record: Record) -> ChunkHead:
    """Return the head of a chunk of an MCAP file.

    The chunk may be truncated after its head. Raises ValueError if the head states more data than
    the length of the record.
    """
    data = os.pread(stream.fileno(), min(record.available, CHUNK_HEAD.size + 32 + 8), record.start)
    first, last, unpacked, crc, letters = CHUNK_HEAD.unpack_from(data)
    name = data[CHUNK_HEAD.size :][:letters]
    (packed,) = struct.unpack_from("<Q", data, CHUNK_HEAD.size + letters)
    head_size = CHUNK_HEAD.size + letters + 8
    if packed > record.length - head_size:
        raise ValueError(f"a chunk of {record.length} bytes claims {packed} bytes of data")
    return ChunkHead(first, last, unpacked, crc, name.decode(), packed, record.start + head_size)


def unpack(stream: BinaryIO, record: Record, head: ChunkHead) -> bytes:
    """Return the uncompressed bytes of a chunk of an MCAP file, as far as possible.

    The result is shorter than the head states if the chunk is truncated or damaged. It is one byte
    longer than stated if the chunk contains more.
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
    return bytes(data[: head.unpacked + 1])


def unpack_whole(stream: BinaryIO, record: Record, head: ChunkHead) -> bytes:
    """Return all bytes of a chunk, unpacked.

    Raises ValueError if their number or their checksum differs from the head of the chunk.
    """
    data = unpack(stream, record, head)
    if (size := len(data)) != head.unpacked:
        actual = "more" if size > head.unpacked else f"{size}"
        raise ValueError(f"a chunk claims to unpack to {head.unpacked} bytes, got {actual}")
    if head.crc and zlib.crc32(data) != head.crc:
        raise ValueError("the checksum of a chunk is wrong")
    return data


def check_claims(head: ChunkHead) -> None:
    """Raise ValueError if the head of a chunk states an invalid compression or size.

    The compression must be known, and the size within the limits. The check is done before anything
    is uncompressed.
    """
    if head.compression not in ("", "zstd", "lz4"):
        raise ValueError(f"compression of a chunk must be zstd or lz4, got {head.compression!r}")
    if head.compression and head.unpacked > MAX_UNPACKED:
        raise ValueError(
            f"a chunk must unpack to at most {MAX_UNPACKED} bytes, got {head.unpacked} from "
            f"{head.packed} bytes"
        )


def chunk_records(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of the records in a chunk.

    Raises ValueError at the first record that is truncated.
    """
    position = 0
    while position + HEAD.size <= len(data):
        opcode, length = HEAD.unpack_from(data, position)
        start = position + HEAD.size
        position = start + length
        if position > len(data):
            raise ValueError(f"a record claims {length} bytes, its chunk has {len(data) - start}")
        yield opcode, data[start:position]
    if position != len(data):
        raise ValueError(f"a chunk ends with {len(data) - position} bytes that are not a record")


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

#: Uncompressed size of all chunks together that is allowed for a file of any size, bytes.
FREE_UNPACKED = 16 * MIB
#: Uncompressed size of all chunks together that is allowed in addition to `FREE_UNPACKED`, as a
#: multiple of the size of the file.
MAX_RATIO = 100
#: Largest unpacked size of all chunks that are in memory together, bytes. Readers sort chunks with
#: overlapping times.
MAX_AT_ONCE = 128 * MIB
#: Number of bytes for which a checksum is computed in one step.
CRC_BYTES = 4 * MIB
#: Pattern of the entry of metadata.yaml of a bag whose messages or files are compressed one by one.
COMPRESSED = re.compile(rb"compression_mode[\"']?\s*:\s*[\"']?(file|message)", re.IGNORECASE)


def require_bounded(file: Path) -> None:
    """Check that an MCAP file needs no more memory than its size allows.

    The limits are `MAX_UNPACKED` bytes per compressed chunk, `FREE_UNPACKED` bytes plus `MAX_RATIO`
    times the size of the file for all of them, and `MAX_AT_ONCE` bytes for chunks that overlap in
    time. The check reads the heads of the chunks only: `unpack` never returns more than a head
    claims. Raises BagError beyond a limit, and for truncated records and a wrong checksum of the
    data section.
    """
    packed: list[ChunkHead] = []
    with file.open("rb") as stream:
        try:
            for record in records_of(stream):
                if not record.whole:
                    raise ValueError(
                        f"a record claims {record.length} bytes, the file has {record.available}"
                    )
                if record.opcode == Opcode.CHUNK:
                    head = chunk_head(stream, record)
                    check_claims(head)
                    packed += [head] if head.compression else []
                elif record.opcode == Opcode.DATA_END:
                    require_data_crc(stream, record)
        except (ValueError, EOFError, struct.error, McapError) as error:
            raise BagError(f"{file}: {error_text(error)}") from None
    size, total = file.stat().st_size, sum(head.unpacked for head in packed)
    limit = FREE_UNPACKED + MAX_RATIO * size
    if total > limit:
        raise BagError(
            f"{file}: {size} bytes must unpack to at most {limit}, got {total} (limit: {MAX_RATIO} "
            f"times the size of the file plus {FREE_UNPACKED // MIB} MiB)"
        )
    edges = [(head.start, 0, head.unpacked) for head in packed]
    edges += [(max(head.start, head.end), 1, -head.unpacked) for head in packed]
    overlap = max(accumulate(size for *_, size in sorted(edges)), default=0)
    if overlap > MAX_AT_ONCE:
        raise BagError(
            f"{file}: compressed chunks that overlap in time must unpack to at most {MAX_AT_ONCE} "
            f"bytes, got {overlap}"
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
                f"{bag}: compression must be none or by chunk, got by {mode[1].decode().lower()}; "
                "convert the bag with: ros2 bag convert"
            )


def require_data_crc(stream: BinaryIO, data_end: Record) -> None:
    """Raise ValueError if the checksum of the data section is wrong.

    The checksum is in the DataEnd record. It covers all bytes before that record.
    """
    expected = int.from_bytes(read_content(stream, data_end)[:4], "little")
    if not expected:  # the writer computed no checksum
        return
    crc, position, end = 0, 0, data_end.start - HEAD.size
    while position < end:
        block = os.pread(stream.fileno(), min(CRC_BYTES, end - position), position)
        crc, position = zlib.crc32(block, crc), position + len(block)
    if crc != expected:
        raise ValueError("the checksum of the data section is wrong")
