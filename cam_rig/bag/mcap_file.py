"""Reader of a closed MCAP file.

The reader returns the topics, and the messages in the order of their log times. Messages and
schemas of any encoding are treated as bytes. Topics that are not requested are never decoded.
"""

from __future__ import annotations

import heapq
import os
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from operator import itemgetter
from pathlib import Path
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, Schema, Statistics
from mcap.writer import MCAP0_MAGIC

from cam_rig.bag.connection import NO_DEFINITION, Connection, message_definition
from cam_rig.bag.files import FOOTER
from cam_rig.bag.records import (
    HEAD,
    MESSAGE_HEAD,
    ChunkHead,
    Record,
    chunk_head,
    chunk_records,
    fields,
    read_content,
    records_of,
    unpack_whole,
)

#: Message, or start of a chunk, of an MCAP file. The elements, by which entries are sorted, are log
#: time (ns), position of the chunk in the file, connection (None at the start of a chunk), and
#: serialized message.
Entry = tuple[int, int, Connection | None, bytes]


@dataclass
class Summary:
    """Summary at the end of an MCAP file: schemas, channels, indexes, statistics.

    The keys of `schemas` and `channels` are their ids.
    """

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    #: Channels of each chunk. The key is the position of the chunk's content in the file.
    indexed: dict[int, set[int]] = field(default_factory=dict)
    statistics: Statistics | None = None

    def add(self, opcode: int, data: bytes) -> None:
        """Store a record of the summary: a schema, channel, chunk index or statistics.

        Other records are ignored. `opcode` is the type of the record and `data` its content.
        """
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(fields(data))
            self.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(fields(data))
            self.channels[channel.id] = channel
        elif opcode == Opcode.CHUNK_INDEX:
            index = ChunkIndex.read(fields(data))
            self.indexed[index.chunk_start_offset + HEAD.size] = set(index.message_index_offsets)
        elif opcode == Opcode.STATISTICS:
            self.statistics = Statistics.read(fields(data))


def read_summary(stream: BinaryIO) -> Summary:
    """Read the summary at the end of a closed MCAP file.

    Returns an empty summary if the file has none. Raises ValueError if its position is not in the
    file.
    """
    summary = Summary()
    descriptor, size = stream.fileno(), os.fstat(stream.fileno()).st_size
    footer = os.pread(descriptor, len(FOOTER) + 8, size - len(MCAP0_MAGIC) - 20 - len(FOOTER))
    start = int.from_bytes(footer[len(FOOTER) :], "little")
    if not start:
        return summary
    if not len(MCAP0_MAGIC) <= start < size:
        raise ValueError(f"the summary starts at byte {start}, the file has {size} bytes")
    for record in records_of(stream, start):
        summary.add(record.opcode, read_content(stream, record))
    return summary


class McapFile:
    """Reader of a closed MCAP file, as a context manager.

    `connections` contains the topics of the file.
    """

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
            self._indexed, statistics = summary.indexed, summary.statistics
            if statistics is None or (statistics.message_count and not summary.channels):
                counts: dict[int, int] = self._scan(summary)
            else:
                counts = statistics.channel_message_counts
            self.connections = [
                _connection(
                    channel, summary.schemas.get(channel.schema_id), counts.get(channel.id, 0)
                )
                for channel in summary.channels.values()
            ]
            on_error.pop_all()

    def __enter__(self) -> McapFile:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.close()

    def messages(
        self, connections: Collection[Connection]
    ) -> Iterator[tuple[Connection, int, bytes]]:
        """Yield the messages of some topics: connection, log time (ns) and data.

        A connection is a topic in a file.
        """
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
            data = read_content(self._stream, record)
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
        """Yield an entry for the start of a chunk of a file, then its messages by time.

        An entry is log time (ns), position, connection and data. The chunk is unpacked only after
        the first entry was taken, so that a merge of all chunks by time keeps few of them in
        memory. `record` and `head` are the chunk and its head, and `wanted` contains the
        connections of the requested topics by channel id.
        """
        yield head.start, 0, None, b""
        entries = list[Entry]()
        for opcode, data in chunk_records(unpack_whole(self._stream, record, head)):
            if opcode == Opcode.MESSAGE:
                channel, _, time_ns, _ = MESSAGE_HEAD.unpack_from(data)
                if channel in wanted:
                    cdr = data[MESSAGE_HEAD.size :]
                    entries.append((time_ns, record.start, wanted[channel], cdr))
        yield from sorted(entries, key=itemgetter(0))

    def _scan(self, summary: Summary) -> Counter[int]:
        """Count the messages per channel, and add the schemas and channels to a summary.

        It is used for a file whose summary does not contain them.
        """
        counts = Counter[int]()
        for record in records_of(self._stream):
            entries = iter([(record.opcode, read_content(self._stream, record))])
            if record.opcode == Opcode.CHUNK:
                head = chunk_head(self._stream, record)
                entries = chunk_records(unpack_whole(self._stream, record, head))
            for opcode, data in entries:
                if opcode == Opcode.MESSAGE:
                    counts[MESSAGE_HEAD.unpack_from(data)[0]] += 1
                elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                    summary.add(opcode, data)
        return counts


def _connection(channel: Channel, schema: Schema | None, count: int) -> Connection:
    """Return a channel of an MCAP file as a connection, with its topic and type.

    A type name without ``msg``, such as std_msgs/String, is completed. `count` is the number of
    messages of the channel.
    """
    kind, definition = "", NO_DEFINITION
    if schema is not None:
        package, _, name = schema.name.rpartition("/")
        kind = f"{package}/msg/{name}" if package and "/" not in package else schema.name
        definition = message_definition(schema.encoding, schema.data.decode(errors="replace"))
    return Connection(channel.id, channel.topic, kind, channel.message_encoding, definition, count)
