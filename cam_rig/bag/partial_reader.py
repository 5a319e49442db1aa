"""Reading an MCAP file as far as it goes: cut off, or with damaged parts."""

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
from cam_rig.bag.records import INSIDE, Record, chunk_head, content, fields, inside, pieces, unpack
from cam_rig.errors import BagError, RefusedError
from cam_rig.messages import topics
from cam_rig.messages.serialization import RawMessages, stamp_of

#: Who wrote a file of ours.
LIBRARY = "cam_rig"
OURS = {topic.name: topic for topic in topics.RECORDING}
INDEXES = {
    Opcode.MESSAGE_INDEX,
    Opcode.CHUNK_INDEX,
    Opcode.ATTACHMENT_INDEX,
    Opcode.METADATA_INDEX,
    Opcode.STATISTICS,
    Opcode.SUMMARY_OFFSET,
}
#: More topics than any rig has.
MAX_CHANNELS = 1000
Found = tuple[Schema, Channel, Message] | Attachment


@dataclass
class Salvage:
    """The attachments and messages of a file, in its order; what was lost is known afterwards.

    ``whole`` says that the file was closed and ``ours`` that this package wrote it; ``damaged`` is
    how many of its records were unreadable or not what was written, and ``why`` the first of them
    was; ``doubtful`` is how many messages were read out of them all the same, between the times
    ``doubt`` (ns). ``cut`` is how many messages were read out of truncated chunks, and
    ``unread`` how many bytes nothing could be made of.
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
        BagError : the file cannot be opened, or never was one
        """
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._raw = RawMessages()
        try:
            stream = self.file.open("rb")
        except OSError as error:
            raise BagError(f"{self.file}: cannot be read ({error.strerror})") from None
        with stream:
            for piece in pieces(stream):  # the summary knows channels that a damaged chunk began
                if piece.whole and piece.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                    with suppress(*DAMAGE):
                        list(self._known(INSIDE[piece.opcode](content(stream, piece))))
            for piece in pieces(stream):
                if piece.opcode == Opcode.CHUNK:
                    yield from self._of_chunk(stream, piece)
                elif not piece.whole:
                    if not self.whole and piece.opcode not in INDEXES:  # which are made anew
                        self.unread += piece.there
                elif piece.opcode == Opcode.DATA_END:
                    self.whole = True
                else:
                    yield from self._at_the_top(stream, piece)

    def _at_the_top(self, stream: BinaryIO, piece: Record) -> Iterator[Found]:
        try:
            if piece.opcode == Opcode.ATTACHMENT:
                yield attachment_of(content(stream, piece))
            elif piece.opcode == Opcode.HEADER:
                self.ours = Header.read(fields(content(stream, piece))).library == LIBRARY
            elif piece.opcode in INSIDE:
                yield from self._known(INSIDE[piece.opcode](content(stream, piece)))
        except DAMAGE as error:
            self._note(error)

    def _of_chunk(self, stream: BinaryIO, piece: Record) -> Iterator[Found]:
        """What a chunk holds, as far as it goes."""
        count, sound, read, wrong = 0, False, 0, None
        try:
            head = chunk_head(stream, piece)
            data = unpack(stream, piece, head)
            sound = len(data) == head.unpacked and head.crc in (0, zlib.crc32(data))
            for record in inside(data):
                read += 1
                for found in self._known(record):
                    if sound or not piece.whole or self._believable(found, head.begin, head.end):
                        count += 1
                        yield found
            if not sound:
                raise ValueError("a chunk's checksum is wrong")
        except DAMAGE as error:
            sound, wrong = False, error
        if not piece.whole:
            self.cut += count
            self.unread += 0 if read else piece.there
        elif not sound:
            self._note(wrong)
            self.doubtful += count

    def _note(self, error: Exception | None) -> None:
        self.damaged += 1
        self.why = self.why or ("" if error is None else reason(error))

    def _known(self, record: Any) -> Iterator[tuple[Schema, Channel, Message]]:
        """A message with what it is; of anything else, what it says is kept."""
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

    def _believable(self, found: tuple[Schema, Channel, Message], begin: int, end: int) -> bool:
        """Whether a message of a chunk with a wrong checksum says at least what a message may."""
        _, channel, message = found
        topic = OURS.get(channel.topic)
        try:
            if topic is not None:
                self._raw.read(topic, message.data)
                if self.ours and topic.stamped and topic.per in ("state", "tick", "speed"):
                    begin = max(begin, stamp_of(message.data))
                    end = min(end, stamp_of(message.data))
        except RefusedError:
            return False
        if begin <= message.log_time <= end:
            first, last = self.doubt or (message.log_time, message.log_time)
            self.doubt = min(first, message.log_time), max(last, message.log_time)
            return True
        return False
