"""Reading an MCAP file as far as it goes: truncated, or with damaged parts."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any, BinaryIO

from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Header, Message, Schema

from cam_rig.bag.files import DAMAGE, UNREADABLE, damaged, reason, require_a_bag
from cam_rig.bag.listing import list_files
from cam_rig.bag.records import (
    INSIDE,
    Record,
    chunk_head,
    content,
    fields,
    inside,
    records_of,
    require_data_crc,
)
from cam_rig.bag.records import unpack as unpacked
from cam_rig.errors import BagError, RefusedError
from cam_rig.files import MIB, no_room
from cam_rig.messages.serialization import read_message, stamp_of
from cam_rig.messages.topics import recorded_topic

# The files attached to a bag: read with care, since names, sizes and bytes are not trusted.

#: Attached to a recovered bag that lacks something: it says what.
RECOVERED = "recovered.txt"
#: Files attached to a bag, and their bytes; a scene with a hundred cams and their tables has less.
MAX_ATTACHED, MAX_ATTACHED_BYTES = 1000, 64 * MIB
#: Bytes of a path of an attached file, and of one name in it.
MAX_PATH, MAX_NAME = 1000, 255


def unpack(bag: Path, folder: Path) -> Path:
    """Write the files attached to a bag into ``folder/config``; the scene's path."""
    scene = None
    require_a_bag(bag)
    try:
        files = [file for file in list_files(bag).files if file.suffix == ".mcap"]
        for attachment in chain.from_iterable(attachments(file) for file in files):
            path = folder / "config" / _safe(bag, attachment.name)
            _write(bag, path, attachment.data)
            scene = path if path.parent.name == "scenes" else scene
    except UNREADABLE as error:
        raise damaged(bag, error) from None
    if scene is None:
        raise BagError(
            f"{bag}: has no scene attached, it was not recorded by cam_rig; name the scene with "
            "--scene"
        )
    return scene


def recovered_words(bag: Path) -> list[str]:
    """Return the notes on a bag: ignored files, and the reports of its recoveries."""
    if bag.is_file() and bag.suffix != ".mcap":
        return []
    try:
        listing = list_files(bag)
        return [*listing.notes] + [
            f"recovered: {' '.join(one.data.decode(errors='replace').split())}"
            for file in listing.files
            if file.suffix == ".mcap"
            for one in attachments(file)
            if one.name == RECOVERED
        ]
    except UNREADABLE as error:
        raise damaged(bag, error) from None


def attachments(file: Path) -> Iterator[Attachment]:
    """What is attached to an MCAP file, also to one that was not closed."""
    number = size = 0
    with file.open("rb") as stream:
        for record in records_of(stream):
            if record.opcode != Opcode.ATTACHMENT or not record.whole:
                continue
            number, size = number + 1, size + record.length
            if number > MAX_ATTACHED or size > MAX_ATTACHED_BYTES:
                raise BagError(
                    f"{file}: {number} attachments of {size} bytes; allowed: {MAX_ATTACHED} of "
                    f"{MAX_ATTACHED_BYTES}"
                )
            yield attachment_of(content(stream, record))


def _safe(bag: Path, name: str) -> Path:
    parts = name.split("/")
    if name.startswith("/") or ".." in parts or "\0" in name:
        raise BagError(f"{bag}: attachment {name[:80]!r} points elsewhere")
    longest = max(len(part.encode()) for part in parts)
    if longest > MAX_NAME or len(name.encode()) > MAX_PATH or not Path(name).name:
        raise BagError(
            f"{bag}: attachment {name[:80]!r} has a name of {longest} bytes; allowed: 1 to "
            f"{MAX_NAME}, and {MAX_PATH} with its folders"
        )
    return Path(name)


def _write(bag: Path, path: Path, data: bytes) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    except (FileExistsError, IsADirectoryError, NotADirectoryError):
        raise BagError(
            f"{bag}: attachment {path.name[:80]!r} is a file here and a folder there"
        ) from None
    except OSError as error:
        raise no_room(path.parent, error) from None


def attachment_of(data: bytes) -> Attachment:
    """An attached file of a record's bytes."""
    found = Attachment.read(fields(data))
    crc = int.from_bytes(data[-4:], "little")
    if crc and zlib.crc32(data[:-4]) != crc:
        raise ValueError(f"attachment {found.name[:80]!r} has a wrong checksum")
    return found


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
        """Messages with their channel, and attachments."""
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
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
                    self._check_data(stream, record)
                else:
                    yield from self._at_the_top(stream, record)

    def _check_data(self, stream: BinaryIO, data_end: Record) -> None:
        """Note a wrong checksum of the data section, unless its damage is known already."""
        try:
            require_data_crc(stream, data_end)
        except ValueError as error:
            if not self.damaged:
                self._note(error)

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
        count, sound, read, wrong = 0, False, 0, None
        try:
            head = chunk_head(stream, chunk)
            data = unpacked(stream, chunk, head)
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
                read_message(topic, message.data)
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
