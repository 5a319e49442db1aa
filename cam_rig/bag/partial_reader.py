"""Reader of a truncated or damaged MCAP file, and of the attachments of a bag."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from enum import Flag, auto
from itertools import chain
from pathlib import Path
from typing import BinaryIO, NamedTuple

from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Header, Message, Schema

from cam_rig.bag.files import DAMAGE, UNREADABLE, error_text, read_error, require_a_bag
from cam_rig.bag.listing import list_files
from cam_rig.bag.records import (
    CONTENT_READERS,
    ChunkHead,
    Record,
    chunk_head,
    chunk_records,
    fields,
    read_content,
    records_of,
    require_data_crc,
)
from cam_rig.bag.records import unpack as unpack_chunk
from cam_rig.errors import BagError, RefusedError
from cam_rig.files import MIB, no_space_error
from cam_rig.messages.serialization import read_message, stamp_of
from cam_rig.messages.topics import recorded_topic

# Attachments of a bag. Their names, sizes and bytes are checked because they are not trusted.

#: Name of the attachment of a recovered bag that reports its missing messages.
RECOVERED = "recovered.txt"
#: Largest number of attachments that are read. A scene with a hundred cams and their tables has
#: fewer.
MAX_ATTACHED = 1000
#: Largest size of all attachments together, bytes.
MAX_ATTACHED_BYTES = 64 * MIB
#: Largest length of the path of an attachment, bytes.
MAX_PATH = 1000
#: Largest length of one name in the path of an attachment, bytes.
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
        raise read_error(bag, error) from None
    if scene is None:
        raise BagError(
            f"{bag}: has no scene attached, because it was not recorded by cam_rig; name a scene "
            "with --scene"
        )
    return scene


def recovery_notes(bag: Path) -> list[str]:
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
        raise read_error(bag, error) from None


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
                    f"{file}: must have at most {MAX_ATTACHED} attachments of together "
                    f"{MAX_ATTACHED_BYTES} bytes, got {number} of {size} bytes"
                )
            yield parse_attachment(read_content(stream, record))


def _safe_path(bag: Path, name: str) -> Path:
    parts = name.split("/")
    if name.startswith("/") or ".." in parts or "\0" in name:
        raise BagError(f"{bag}: attachment {name[:80]!r} must be a relative path without '..'")
    longest = max(len(part.encode()) for part in parts)
    if longest > MAX_NAME or len(name.encode()) > MAX_PATH or not Path(name).name:
        raise BagError(
            f"{bag}: attachment {name[:80]!r} must have names of 1 to {MAX_NAME} bytes and a path "
            f"of at most {MAX_PATH} bytes, got {longest} and {len(name.encode())}"
        )
    return Path(name)


def _write(bag: Path, path: Path, data: bytes) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    except (FileExistsError, IsADirectoryError, NotADirectoryError):
        raise BagError(
            f"{bag}: attachment {path.name[:80]!r} is the name of a file and of a folder"
        ) from None
    except OSError as error:
        raise no_space_error(path.parent, error) from None


def parse_attachment(data: bytes) -> Attachment:
    """Return the attachment in the content of an MCAP record.

    Raises ValueError if its checksum is wrong.
    """
    attachment = Attachment.read(fields(data))
    crc = int.from_bytes(data[-4:], "little")
    if crc and zlib.crc32(data[:-4]) != crc:
        raise ValueError(f"attachment {attachment.name[:80]!r} has a wrong checksum")
    return attachment


#: Name by which files of this package identify their writer in the header.
LIBRARY = "cam_rig"
#: Opcodes of MCAP records that a recovery writes again. Their loss in a damaged file does not
#: matter.
INDEXES = {
    Opcode.MESSAGE_INDEX,
    Opcode.CHUNK_INDEX,
    Opcode.ATTACHMENT_INDEX,
    Opcode.METADATA_INDEX,
    Opcode.STATISTICS,
    Opcode.SUMMARY_OFFSET,
}
#: Values of `Topic.per` (occasion of a message) of the topics whose messages have their stamp as
#: log time.
STAMP_LOGGED = ("state", "tick", "instant", "speed")
#: Largest number of MCAP channels (topics) of a file that are read. Rigs have fewer topics.
MAX_CHANNELS = 1000


class Condition(Flag):
    """Properties of an MCAP file that limit what can be read from it."""

    #: The file was not closed, or its end is missing.
    TRUNCATED = auto()
    #: Records are unreadable, or a checksum is wrong.
    DAMAGED = auto()
    #: The file was written by another program, so the sequence numbers of its messages are not
    #: reliable.
    FOREIGN = auto()


class RecordedMessage(NamedTuple):
    """Recorded message of a file, with its topic and type.

    `number` counts the messages of the topic from 1. It is 0 in a file of another program.
    """

    schema: Schema
    channel: Channel
    message: Message
    number: int


@dataclass
class FileReport:
    """Report on a file that was read as far as possible.

    `damaged_records` is the number of records that were unreadable or had a wrong checksum, and
    `first_error` the reason of the first. `doubtful_messages` is the number of messages that were
    read from them, and `doubtful_times` are their first and last log times (ns), None without such
    a message. `truncated_messages` is the number of messages that were read from truncated chunks,
    and `unread_bytes` the number of bytes that could not be read.
    """

    file: Path
    condition: Condition = Condition.TRUNCATED | Condition.FOREIGN
    damaged_records: int = 0
    first_error: str = ""
    doubtful_messages: int = 0
    doubtful_times: tuple[int, int] | None = None
    truncated_messages: int = 0
    unread_bytes: int = 0


def read_partial(
    file: Path, receive: Callable[[RecordedMessage | Attachment], object]
) -> FileReport:
    """Pass the messages and attachments of a file to a function, in the order of the file.

    The file may be truncated or damaged. The records that cannot be read are reported.
    """
    reader = _PartialReader(file)
    for record in reader.records():
        receive(record)
    return reader.report


class _PartialReader:
    """Reader of one damaged file, with a report on what cannot be read."""

    def __init__(self, file: Path) -> None:
        self.report = FileReport(file)
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}

    def records(self) -> Iterator[RecordedMessage | Attachment]:
        try:
            stream = self.report.file.open("rb")
        except OSError as error:
            raise BagError(f"{self.report.file}: cannot be read ({error.strerror})") from None
        with stream:
            for record in records_of(stream):  # the summary repeats channels of a damaged chunk
                if record.whole and record.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                    with suppress(*DAMAGE):
                        list(self._resolve(record.opcode, read_content(stream, record)))
            for record in records_of(stream):
                if record.opcode == Opcode.CHUNK:
                    yield from self._read_chunk(stream, record)
                elif record.whole:
                    yield from self._read_top_level(stream, record)
                elif self._is(Condition.TRUNCATED) and record.opcode not in INDEXES:
                    self.report.unread_bytes += record.available

    def _is(self, condition: Condition) -> bool:
        return condition in self.report.condition

    def _read_top_level(
        self, stream: BinaryIO, record: Record
    ) -> Iterator[RecordedMessage | Attachment]:
        try:
            if record.opcode == Opcode.ATTACHMENT:
                yield parse_attachment(read_content(stream, record))
            elif record.opcode == Opcode.HEADER:
                if Header.read(fields(read_content(stream, record))).library == LIBRARY:
                    self.report.condition &= ~Condition.FOREIGN
            elif record.opcode == Opcode.DATA_END:
                self.report.condition &= ~Condition.TRUNCATED
                if not self._is(Condition.DAMAGED):  # else the checksum is known to be wrong
                    require_data_crc(stream, record)
            elif record.opcode in CONTENT_READERS:
                yield from self._resolve(record.opcode, read_content(stream, record))
        except DAMAGE as error:
            self._add_damage(error)

    def _read_chunk(self, stream: BinaryIO, chunk: Record) -> Iterator[RecordedMessage]:
        count, number, problem = 0, 0, None
        try:
            head = chunk_head(stream, chunk)
            data = unpack_chunk(stream, chunk, head)
            sound = len(data) == head.unpacked and head.crc in (0, zlib.crc32(data))
            for number, (opcode, record) in enumerate(chunk_records(data), 1):  # noqa: B007
                for entry in self._resolve(opcode, record):
                    if sound or not chunk.whole or self._is_plausible(entry, head):
                        count += 1
                        yield entry
            if not sound:
                raise ValueError("the checksum of a chunk is wrong")
        except DAMAGE as error:
            problem = error
        if not chunk.whole:
            self.report.truncated_messages += count
            self.report.unread_bytes += 0 if number else chunk.available
        elif problem is not None:
            self._add_damage(problem)
            self.report.doubtful_messages += count

    def _add_damage(self, error: Exception) -> None:
        self.report.condition |= Condition.DAMAGED
        self.report.damaged_records += 1
        self.report.first_error = self.report.first_error or error_text(error)

    def _resolve(self, opcode: int, data: bytes) -> Iterator[RecordedMessage]:
        """Store a schema or a channel, or yield a message with its schema and channel.

        A message whose schema or channel is missing is skipped. Raises ValueError for another kind
        of record, and for more than `MAX_CHANNELS` channels. `opcode` is the type of the MCAP
        record and `data` its content.
        """
        if opcode not in CONTENT_READERS:
            raise ValueError(f"a chunk contains a record of kind {opcode}")
        record = CONTENT_READERS[opcode](data)
        if isinstance(record, Schema):
            self._schemas[record.id] = record
        elif isinstance(record, Channel):
            if record.id not in self._channels and len(self._channels) >= MAX_CHANNELS:
                raise ValueError(f"more than {MAX_CHANNELS} channels")
            self._channels[record.id] = record
        elif (channel := self._channels.get(record.channel_id)) is not None:
            schema = self._schemas.get(channel.schema_id)
            if schema is not None:
                number = 0 if self._is(Condition.FOREIGN) else record.sequence
                yield RecordedMessage(schema, channel, record, number)

    def _is_plausible(self, entry: RecordedMessage, head: ChunkHead) -> bool:
        """Return True if a message of a chunk with a wrong checksum is plausible.

        It must be readable, and its log time must lie in the time range of the chunk. In a file of
        this package the log time of a topic in `STAMP_LOGGED` must be its stamp. The time is noted
        in the report.
        """
        log_time, data = entry.message.log_time, entry.message.data
        topic = recorded_topic(entry.channel.topic)
        try:
            if topic is not None:
                read_message(topic, data)
                is_stamped = topic.stamped and topic.per in STAMP_LOGGED
                if is_stamped and not self._is(Condition.FOREIGN) and stamp_of(data) != log_time:
                    return False
        except RefusedError:
            return False
        if not head.start <= log_time <= head.end:
            return False
        first, last = self.report.doubtful_times or (log_time, log_time)
        self.report.doubtful_times = min(first, log_time), max(last, log_time)
        return True
