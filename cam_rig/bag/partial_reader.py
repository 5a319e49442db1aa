"""Reading an MCAP file as far as it goes: truncated, or with damaged parts."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Header, Message, Schema

from cam_rig.bag.attached import attachment_of
from cam_rig.bag.damage import DAMAGE, reason
from cam_rig.bag.records import (
    INSIDE,
    Record,
    chunk_head,
    content,
    fields,
    inside,
    records_of,
    unpack,
)
from cam_rig.errors import BagError, RefusedError
from cam_rig.messages.serialization import RawMessages, stamp_of
from cam_rig.messages.topics import recorded_topic

#: The writer's name in the header of this package's files.
LIBRARY = "cam_rig"
INDEXES = {
    Opcode.MESSAGE_INDEX,
    Opcode.CHUNK_INDEX,
    Opcode.ATTACHMENT_INDEX,
    Opcode.METADATA_INDEX,
    Opcode.STATISTICS,
    Opcode.SUMMARY_OFFSET,
}
#: When topics are published whose log time is their stamp.
OF_ITS_STAMP = ("state", "tick", "instant", "speed")
#: More topics than any rig has.
MAX_CHANNELS = 1000
Found = tuple[Schema, Channel, Message] | Attachment


@dataclass
class PartialReader:
    """The attachments and messages of a file, in its order; the losses are known afterwards.

    ``whole`` says that the file was closed and ``ours`` that this package wrote it; ``damaged`` is
    how many of its records were unreadable or not what was written, and ``why`` the first of them
    was; ``doubtful`` is how many messages were read out of them all the same, between the times
    ``doubt`` (ns). ``cut`` is how many messages were read out of truncated chunks, and
    ``unread`` the number of bytes that could not be read.
    """

    file: Path
    whole: bool = False
    ours: bool = False
    damaged: int = 0
    why: str = ""
    doubtful: int = 0
    doubt: tuple[int, int] | None = None
    cut: int = 0
    unread: int = 0

    def records(self) -> Iterator[Found]:
        """Messages with their channel, and attachments.

        Raises
        ------
        BagError : the file cannot be opened, or is not one of MCAP
        """
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._raw = RawMessages()
        try:
            stream = self.file.open("rb")
        except OSError as error:
            raise BagError(f"{self.file}: cannot be read ({error.strerror})") from None
        with stream:
            for record in records_of(stream):  # the summary repeats channels of a damaged chunk
                if record.whole and record.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                    with suppress(*DAMAGE):
                        list(self._known(INSIDE[record.opcode](content(stream, record))))
            for record in records_of(stream):
                if record.opcode == Opcode.CHUNK:
                    yield from self._of_chunk(stream, record)
                elif not record.whole:
                    if not self.whole and record.opcode not in INDEXES:  # which are made again
                        self.unread += record.available
                elif record.opcode == Opcode.DATA_END:
                    self.whole = True
                else:
                    yield from self._at_the_top(stream, record)

    def _at_the_top(self, stream: BinaryIO, record: Record) -> Iterator[Found]:
        try:
            if record.opcode == Opcode.ATTACHMENT:
                yield attachment_of(content(stream, record))
            elif record.opcode == Opcode.HEADER:
                self.ours = Header.read(fields(content(stream, record))).library == LIBRARY
            elif record.opcode in INSIDE:
                yield from self._known(INSIDE[record.opcode](content(stream, record)))
        except DAMAGE as error:
            self._note(error)

    def _of_chunk(self, stream: BinaryIO, chunk: Record) -> Iterator[Found]:
        """What a chunk holds, as far as it goes."""
        count, sound, read, wrong = 0, False, 0, None
        try:
            head = chunk_head(stream, chunk)
            data = unpack(stream, chunk, head)
            sound = len(data) == head.unpacked and head.crc in (0, zlib.crc32(data))
            for record in inside(data):
                read += 1
                for found in self._known(record):
                    if sound or not chunk.whole or self._is_plausible(found, head.begin, head.end):
                        count += 1
                        yield found
            if not sound:
                raise ValueError("a chunk's checksum is wrong")
        except DAMAGE as error:
            sound, wrong = False, error
        if not chunk.whole:
            self.cut += count
            self.unread += 0 if read else chunk.available
        elif not sound:
            self._note(wrong)
            self.doubtful += count

    def _note(self, error: Exception | None) -> None:
        self.damaged += 1
        self.why = self.why or ("" if error is None else reason(error))

    def _known(self, record: Any) -> Iterator[tuple[Schema, Channel, Message]]:
        """A message with its schema and channel; schemas and channels are kept."""
        if isinstance(record, Schema):
            self._schemas[record.id] = record
        elif isinstance(record, Channel):
            if record.id not in self._channels and len(self._channels) >= MAX_CHANNELS:
                raise ValueError(f"more than {MAX_CHANNELS} channels")
            self._channels[record.id] = record
        elif (channel := self._channels.get(record.channel_id)) is not None:
            schema = self._schemas.get(channel.schema_id)
            if schema is not None:
                yield schema, channel, record

    def _is_plausible(self, found: tuple[Schema, Channel, Message], begin: int, end: int) -> bool:
        """Whether a message of a chunk with a wrong checksum is a plausible one of its topic."""
        _, channel, message = found
        topic = recorded_topic(channel.topic)
        try:
            if topic is not None:
                self._raw.read(topic, message.data)
                if self.ours and topic.stamped and topic.per in OF_ITS_STAMP:
                    begin = max(begin, stamp_of(message.data))
                    end = min(end, stamp_of(message.data))
        except RefusedError:
            return False
        if begin <= message.log_time <= end:
            first, last = self.doubt or (message.log_time, message.log_time)
            self.doubt = min(first, message.log_time), max(last, message.log_time)
            return True
        return False
