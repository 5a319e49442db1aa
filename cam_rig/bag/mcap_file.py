"""Reader of a closed MCAP file.

The reader returns the topics, and the messages in the order of their log times. Messages and
schemas of any encoding are treated as bytes. Topics that are not requested are never decoded.
"""

from __future__ import annotations

import heapq
import os
import zlib
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import ExitStack
from operator import itemgetter
from pathlib import Path
from typing import BinaryIO, NamedTuple

from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, Schema, Statistics
from mcap.writer import MCAP0_MAGIC
from rosbags.interfaces import (
    Connection,
    ConnectionExtRosbag2,
    MessageDefinition,
    MessageDefinitionFormat,
)

from cam_rig.bag.files import FOOTER
from cam_rig.bag.records import (
    CONTENT_READERS,
    HEAD,
    MESSAGE_HEAD,
    ChunkHead,
    Record,
    chunk_head,
    content,
    fields,
    records_of,
    unpack,
)

#: Encodings of schemas whose text rosbags can parse.
SCHEMA_FORMATS = {
    "ros2msg": MessageDefinitionFormat.MSG,
    "ros2idl": MessageDefinitionFormat.IDL,
    "omgidl": MessageDefinitionFormat.IDL,
}
#: Log time (ns), position of the chunk in the file, connection (None at the start of a chunk),
#: data.
Entry = tuple[int, int, Connection | None, bytes]


class Summary(NamedTuple):
    """Records of the summary at the end of an MCAP file."""

    schemas: dict[int, Schema]
    channels: dict[int, Channel]
    #: Channels of each chunk. The key is the position of the chunk's content in the file.
    indexed: dict[int, set[int]]
    statistics: Statistics | None


def read_summary(stream: BinaryIO) -> Summary:
    """Read the summary of a closed file, or return an empty summary without one."""
    summary = Summary({}, {}, {}, None)
    descriptor, size = stream.fileno(), os.fstat(stream.fileno()).st_size
    footer = os.pread(descriptor, len(FOOTER) + 8, size - len(MCAP0_MAGIC) - 20 - len(FOOTER))
    start = int.from_bytes(footer[len(FOOTER) :], "little")
    if not start:
        return summary
    if not len(MCAP0_MAGIC) <= start < size:
        raise ValueError(f"the summary starts at byte {start}, the file has {size} bytes")
    for record in records_of(stream, start):
        if record.opcode == Opcode.STATISTICS:
            statistics = Statistics.read(fields(content(stream, record)))
            summary = summary._replace(statistics=statistics)
        elif record.opcode == Opcode.CHUNK_INDEX:
            index = ChunkIndex.read(fields(content(stream, record)))
            channels = set(index.message_index_offsets)
            summary.indexed[index.chunk_start_offset + HEAD.size] = channels
        elif record.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            _store(
                CONTENT_READERS[record.opcode](content(stream, record)),
                summary.schemas,
                summary.channels,
            )
    return summary


def _store(
    record: Schema | Channel, schemas: dict[int, Schema], channels: dict[int, Channel]
) -> None:
    if isinstance(record, Schema):
        schemas[record.id] = record
    else:
        channels[record.id] = record


class McapFile:
    """Closed MCAP file, as a context manager."""

    def __init__(self, file: Path) -> None:
        self.connections: list[Connection] = []
        self._stream = file.open("rb")
        with ExitStack() as on_error:
            on_error.callback(self._stream.close)
            self._chunks = [
                (record, chunk_head(self._stream, record))
                for record in records_of(self._stream)
                if record.opcode == Opcode.CHUNK
            ]
            summary = read_summary(self._stream)
            self._indexed = summary.indexed
            schemas, channels = summary.schemas, summary.channels
            if summary.statistics is None or (summary.statistics.message_count and not channels):
                counts: dict[int, int] = self._scan(schemas, channels)
            else:
                counts = summary.statistics.channel_message_counts
            self.connections = [
                self._connection(channel, schemas.get(channel.schema_id), counts)
                for channel in channels.values()
            ]
            on_error.pop_all()

    def __enter__(self) -> McapFile:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.close()

    def messages(
        self, connections: Collection[Connection]
    ) -> Iterator[tuple[Connection, int, bytes]]:
        """Yield connection, log time (ns) and data of the messages of some connections."""
        wanted = {connection.id: connection for connection in connections}
        if not self._chunks:
            yield from self._unchunked_messages(wanted)
            return
        chunks = [
            self._chunk_entries(record, head, wanted)
            for record, head in self._chunks
            if not self._indexed.get(record.start) or self._indexed[record.start] & wanted.keys()
        ]
        for time_ns, _, connection, data in heapq.merge(*chunks, key=itemgetter(0, 1)):
            if connection is not None:
                yield connection, time_ns, data

    def _unchunked_messages(
        self, wanted: dict[int, Connection]
    ) -> Iterator[tuple[Connection, int, bytes]]:
        newest = 0
        for record in records_of(self._stream):
            if record.opcode != Opcode.MESSAGE:
                continue
            data = content(self._stream, record)
            channel, _, time_ns, _ = MESSAGE_HEAD.unpack_from(data)
            if channel not in wanted:
                continue
            if time_ns < newest:
                raise ValueError(
                    f"messages without chunks must be in the order of their log times, got "
                    f"{time_ns} ns after {newest} ns; sort them with: ros2 bag convert"
                )
            newest = time_ns
            yield wanted[channel], time_ns, data[MESSAGE_HEAD.size :]

    def _chunk_entries(
        self, record: Record, head: ChunkHead, wanted: dict[int, Connection]
    ) -> Iterator[Entry]:
        """Yield an entry for the start of a chunk, then its messages.

        The chunk is unpacked only after the first entry was taken.
        """
        yield head.start, 0, None, b""
        entries = list[Entry]()
        for opcode, data in _records(self._unpack_checked(record, head)):
            if opcode == Opcode.MESSAGE:
                channel, _, time_ns, _ = MESSAGE_HEAD.unpack_from(data)
                if channel in wanted:
                    cdr = data[MESSAGE_HEAD.size :]
                    entries.append((time_ns, record.start, wanted[channel], cdr))
        yield from sorted(entries, key=itemgetter(0))

    def _unpack_checked(self, record: Record, head: ChunkHead) -> bytes:
        data = unpack(self._stream, record, head)
        if len(data) != head.unpacked:
            raise ValueError(f"a chunk of {head.unpacked} bytes has {len(data)}")
        if head.crc and zlib.crc32(data) != head.crc:
            raise ValueError("a chunk's checksum is wrong")
        return data

    def _scan(self, schemas: dict[int, Schema], channels: dict[int, Channel]) -> Counter[int]:
        """Count the messages per channel of a file without statistics.

        The schemas and channels of the file are added to `schemas` and `channels`.
        """
        counts = Counter[int]()
        for record in records_of(self._stream):
            if record.opcode in CONTENT_READERS:
                entries = iter([(record.opcode, content(self._stream, record))])
            elif record.opcode == Opcode.CHUNK:
                entries = _records(self._unpack_checked(record, chunk_head(self._stream, record)))
            else:
                continue
            for opcode, data in entries:
                if opcode == Opcode.MESSAGE:
                    counts[MESSAGE_HEAD.unpack_from(data)[0]] += 1
                elif opcode in CONTENT_READERS:
                    _store(CONTENT_READERS[opcode](data), schemas, channels)
        return counts

    def _connection(
        self, channel: Channel, schema: Schema | None, counts: dict[int, int]
    ) -> Connection:
        kind, definition = "", MessageDefinition(MessageDefinitionFormat.NONE, "")
        if schema is not None:
            package, _, name = schema.name.rpartition("/")
            kind = f"{package}/msg/{name}" if package and "/" not in package else schema.name
            if schema.encoding in SCHEMA_FORMATS:
                text = schema.data.decode(errors="replace")
                definition = MessageDefinition(SCHEMA_FORMATS[schema.encoding], text)
        return Connection(
            id=channel.id,
            topic=channel.topic,
            msgtype=kind,
            msgdef=definition,
            digest="",
            msgcount=counts.get(channel.id, 0),
            ext=ConnectionExtRosbag2(channel.message_encoding, []),
            owner=self,
        )


def _records(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of the records in a chunk."""
    position = 0
    while position < len(data):
        opcode, length = HEAD.unpack_from(data, position)
        start = position + HEAD.size
        position = start + length
        if position > len(data):
            raise ValueError(f"a record of {length} bytes where {len(data) - start} are left")
        yield opcode, data[start:position]
