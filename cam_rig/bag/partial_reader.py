"""Reader of an MCAP file that is truncated or damaged, and of its attachments."""

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
    CONTENT_READERS,
    Record,
    chunk_head,
    content,
    fields,
    read_chunk,
    records_of,
    require_data_crc,
)
from cam_rig.bag.records import unpack as unpack_chunk
from cam_rig.errors import BagError, RefusedError
from cam_rig.files import MIB, no_space_error
from cam_rig.messages.serialization import read_message, stamp_of
from cam_rig.messages.topics import recorded_topic

# Attachments of a bag. Their names, sizes and bytes are checked because they are not trusted.

#: Name of the attachment of a recovered bag with the report on its missing messages.
RECOVERED = "recovered.txt"
#: Largest number of attachments. A scene with a hundred cams and their tables has fewer.
MAX_ATTACHED = 1000
#: Largest number of bytes of all attachments.
MAX_ATTACHED_BYTES = 64 * MIB
#: Largest number of bytes of the path of an attachment.
MAX_PATH = 1000
#: Largest number of bytes of one name in such a path.
MAX_NAME = 255


def unpack(bag: Path, folder: Path) -> Path:
    """Write the files attached to a bag into ``folder/config``.

    Returns the path of the scene. Raises BagError if the bag has no scene, or if a name is unsafe.
    """
    scene = None
    require_a_bag(bag)
    try:
        files = [file for file in list_files(bag).files if file.suffix == ".mcap"]
        for attachment in chain.from_iterable(attachments(file) for file in files):
            path = folder / "config" / _safe_path(bag, attachment.name)
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
            f"recovered: {' '.join(attachment.data.decode(errors='replace').split())}"
            for file in listing.files
            if file.suffix == ".mcap"
            for attachment in attachments(file)
            if attachment.name == RECOVERED
        ]
    except UNREADABLE as error:
        raise damaged(bag, error) from None


def attachments(file: Path) -> Iterator[Attachment]:
    """Yield the attachments of an MCAP file, which need not be closed.

    Raises BagError for more than `MAX_ATTACHED` attachments or `MAX_ATTACHED_BYTES` bytes.
    """
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


def _safe_path(bag: Path, name: str) -> Path:
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
        raise no_space_error(path.parent, error) from None


def attachment_of(data: bytes) -> Attachment:
    """Return the attachment of a record's bytes.

    Raises ValueError if its checksum is wrong.
    """
    attachment = Attachment.read(fields(data))
    crc = int.from_bytes(data[-4:], "little")
    if crc and zlib.crc32(data[:-4]) != crc:
        raise ValueError(f"attachment {attachment.name[:80]!r} has a wrong checksum")
    return attachment


#: Name of the writer in the header of files of this package.
LIBRARY = "cam_rig"
#: Records that a recovery writes again, so that their loss does not matter.
INDEXES = {
    Opcode.MESSAGE_INDEX,
    Opcode.CHUNK_INDEX,
    Opcode.ATTACHMENT_INDEX,
    Opcode.METADATA_INDEX,
    Opcode.STATISTICS,
    Opcode.SUMMARY_OFFSET,
}
#: Occasions (`Topic.per`) at which the log time of a topic is its stamp.
OF_ITS_STAMP = ("state", "tick", "instant", "speed")
#: Largest number of channels of a file. Rigs have fewer topics.
MAX_CHANNELS = 1000
#: Message with its schema and channel, or attachment.
Found = tuple[Schema, Channel, Message] | Attachment


@dataclass
class PartialReader:
    """Reader of the attachments and messages of a file, in the order of the file.

    The other fields are valid after all records were read. `whole` is True if the file was closed,
    and `ours` if this package wrote it. `damaged` is the number of records that were unreadable or
    had a wrong checksum, and `why` the reason of the first. `doubtful` is the number of messages
    that were read from them all the same, and `doubt` their first and last log time (ns). `cut` is
    the number of messages that were read from truncated chunks. `unread` is the number of bytes
    that could not be read.
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
        """Yield messages with their schema and channel, and attachments."""
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
                        list(self._resolve(CONTENT_READERS[record.opcode](content(stream, record))))
            for record in records_of(stream):
                if record.opcode == Opcode.CHUNK:
                    yield from self._read_chunk(stream, record)
                elif not record.whole:
                    if not self.whole and record.opcode not in INDEXES:
                        self.unread += record.available
                elif record.opcode == Opcode.DATA_END:
                    self.whole = True
                    self._check_data(stream, record)
                else:
                    yield from self._read_top_level(stream, record)

    def _check_data(self, stream: BinaryIO, data_end: Record) -> None:
        """Note a wrong checksum of the data section if no damage was found before."""
        try:
            require_data_crc(stream, data_end)
        except ValueError as error:
            if not self.damaged:
                self._add_damage(error)

    def _read_top_level(self, stream: BinaryIO, record: Record) -> Iterator[Found]:
        try:
            if record.opcode == Opcode.ATTACHMENT:
                yield attachment_of(content(stream, record))
            elif record.opcode == Opcode.HEADER:
                self.ours = Header.read(fields(content(stream, record))).library == LIBRARY
            elif record.opcode in CONTENT_READERS:
                yield from self._resolve(CONTENT_READERS[record.opcode](content(stream, record)))
        except DAMAGE as error:
            self._add_damage(error)

    def _read_chunk(self, stream: BinaryIO, chunk: Record) -> Iterator[Found]:
        count, sound, read, problem = 0, False, 0, None
        try:
            head = chunk_head(stream, chunk)
            data = unpack_chunk(stream, chunk, head)
            sound = len(data) == head.unpacked and head.crc in (0, zlib.crc32(data))
            for record in read_chunk(data):
                read += 1
                for entry in self._resolve(record):
                    if sound or not chunk.whole or self._is_plausible(entry, head.start, head.end):
                        count += 1
                        yield entry
            if not sound:
                raise ValueError("a chunk's checksum is wrong")
        except DAMAGE as error:
            sound, problem = False, error
        if not chunk.whole:
            self.cut += count
            self.unread += 0 if read else chunk.available
        elif not sound:
            self._add_damage(problem)
            self.doubtful += count

    def _add_damage(self, error: Exception | None) -> None:
        self.damaged += 1
        self.why = self.why or ("" if error is None else reason(error))

    def _resolve(self, record: Any) -> Iterator[tuple[Schema, Channel, Message]]:
        """Yield a message with its schema and channel, if both are known.

        Schemas and channels are stored. Raises ValueError for more than `MAX_CHANNELS` channels.
        """
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

    def _is_plausible(self, entry: tuple[Schema, Channel, Message], start: int, end: int) -> bool:
        """Return True if a message of a chunk with a wrong checksum is plausible.

        It must be readable and its log time must lie in the chunk. In a file of this package the
        log time of a topic in `OF_ITS_STAMP` must be its stamp.
        """
        _, channel, message = entry
        topic = recorded_topic(channel.topic)
        try:
            if topic is not None:
                read_message(topic, message.data)
                if self.ours and topic.stamped and topic.per in OF_ITS_STAMP:
                    start = max(start, stamp_of(message.data))
                    end = min(end, stamp_of(message.data))
        except RefusedError:
            return False
        if start <= message.log_time <= end:
            first, last = self.doubt or (message.log_time, message.log_time)
            self.doubt = min(first, message.log_time), max(last, message.log_time)
            return True
        return False
