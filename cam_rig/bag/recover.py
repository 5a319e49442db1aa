"""Recovery of a bag that is damaged or was not closed."""

from __future__ import annotations

import os
import shlex
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from mcap.records import Attachment

from cam_rig.bag.completeness import Holdings, Loss, loss_of
from cam_rig.bag.file_writer import NEVER, FileContent, together
from cam_rig.bag.files import (
    METADATA,
    bag_file,
    bag_files,
    is_closed,
    is_unclosed,
    part_of,
    require_new_bag,
)
from cam_rig.bag.listing import list_files, mcap_files, number_of, require_order
from cam_rig.bag.partial_reader import RECOVERED, PartialReader
from cam_rig.bag.reader import read_counts, read_scene
from cam_rig.bag.writer import BagWriter
from cam_rig.errors import BagError, CamRigError
from cam_rig.messages.topics import Topic, recorded_topic
from cam_rig.units import DATE_FROM_S, NS, format_time

#: Report on a recording without any message.
NOTHING_RECORDED = "nothing was recorded"


@dataclass(frozen=True)
class Recovered:
    """Result of a recovery: the messages by topic and what is missing.

    `last_ns` is the newest log time in ns.
    """

    counts: dict[str, int]
    last_ns: int
    readers: tuple[PartialReader, ...]
    loss: Loss
    #: Origin (ns) of printed times: 0 for rig time, the start of the bag for wall-clock time.
    origin_ns: int = 0
    #: Number of messages that metadata.yaml lists but the file does not have, by file name.
    fewer: dict[str, int] = field(default_factory=dict)
    #: One sentence per file that is ignored.
    notes: tuple[str, ...] = ()

    @property
    def whole(self) -> bool:
        """True if the recording was closed."""
        return all(reader.whole for reader in self.readers)

    @property
    def sound(self) -> bool:
        """True if everything that was recorded is in the bag."""
        damaged = any(reader.damaged for reader in self.readers)
        return self.whole and not (damaged or self.loss.gaps or self.fewer)

    @property
    def words(self) -> str:
        """Recovered and missing messages as text."""
        messages = f"{sum(self.counts.values())} messages to {self._time_words(self.last_ns)} saved"
        parts = [messages, self._missing(), self.loss.ends]
        parts += [
            f"{name} has {count} messages fewer than {METADATA} lists"
            for name, count in self.fewer.items()
        ]
        for reader in self.readers:
            damage = self._damage(reader)
            if damage and len(self.readers) > 1:
                damage[0] = f"in {reader.file.name}: {damage[0]}"
            parts += damage
        parts += [note.rstrip(".") for note in self.notes]
        return "; ".join(part for part in parts if part)

    def _time_words(self, time_ns: int) -> str:
        return format_time((time_ns - self.origin_ns) / NS)

    def _damage(self, reader: PartialReader) -> list[str]:
        parts = list[str]()
        if reader.cut:
            parts.append(f"{reader.cut} of the saved are from a truncated chunk")
        if reader.damaged:
            parts.append(f"damaged records: {reader.damaged}, first: {reader.why}")
        if reader.doubt is not None:
            start, end = reader.doubt
            parts.append(
                f"messages of them, whose numbers may be wrong: {reader.doubtful}, from "
                f"{self._time_words(start)} to {self._time_words(end)}"
            )
        if reader.unread:
            parts.append(f"{reader.unread} bytes could not be read")
        return parts

    def _missing(self) -> str:
        gaps = [self.loss.words] if self.loss.gaps else []
        if self.loss.open_end:
            gaps.append(f"everything after {self._time_words(self.last_ns)}")
        if gaps:
            return f"missing: {', and '.join(gaps)}"
        return "nothing lost" if self.sound else "no tick is missing"


def recover(bag: Path, target: Path) -> Recovered:
    """Copy everything readable of a bag into a new bag with one file.

    The function may be killed and repeated.
    """
    recovery = Recovery(bag)
    if not _is_unfinished(target):
        require_new_bag(target)
    with BagWriter(target, rewrite=True) as writer:
        for file in recovery.files:
            recovery.read(file, writer)
        return recovery.result(writer)


def recover_in_place(bag: Path) -> Recovered:
    """Recover those files of a bag that were not closed.

    The function may be killed and repeated.
    """
    recovery = Recovery(bag)
    unclosed = [file for file in recovery.files if not is_closed(file)]
    unclosed = unclosed or recovery.files[-1:]  # only metadata.yaml is missing
    try:
        # Files that are not recovered yet are listed without messages. They stay listed after a
        # kill.
        contents = {file: recovery.empty(file) for file in unclosed}
        contents |= {file: recovery.read(file) for file in recovery.files if file not in unclosed}
        for file in unclosed:
            others = [content for other, content in contents.items() if other != file]
            with BagWriter(bag, rewrite=True, number=number_of(file), others=others) as writer:
                contents[file] = recovery.read(file, writer)
                if file is unclosed[-1]:
                    saved = recovery.result(writer)
    except BagError as error:
        reason, readable = str(error).removeprefix(f"{bag}: "), examine(bag)
        raise BagError(
            f"{bag}: cannot be recovered where it is, {reason}; left as it is, and readable: "
            f"{readable.words}; recover it with: cam-rig recover {shlex.quote(str(bag))} --output "
            "A_FOLDER_WITH_ROOM"
        ) from None
    return saved


def examine(bag: Path) -> Recovered:
    """Return the readable and the missing messages of a bag without writing anything."""
    recovery = Recovery(bag)
    for file in recovery.files:
        recovery.read(file)
    return recovery.result()


def state_words(bag: Path) -> str:
    """Return the recorded messages of a failed run as text.

    The bag is recovered if it was not closed.
    """
    try:
        if not any(file.stat().st_size for file in bag_files(bag)):
            return NOTHING_RECORDED
        text = recover_in_place(bag).words if is_unclosed(bag) else ""
        count = sum(read_counts(bag).values())
    except (BagError, OSError) as error:
        return str(error).removeprefix(f"{bag}: ")
    return (text or f"closed, {count} messages") if count else NOTHING_RECORDED


def _is_unfinished(target: Path) -> bool:
    """Return True if a folder contains only files that a killed recovery left."""
    if not os.path.isdir(target):  # also for a name that is too long
        return False
    part, names = part_of(bag_file(target)).name, {entry.name for entry in target.iterdir()}
    metadata = {METADATA, part_of(target / METADATA).name}
    return names <= {part, *metadata} and (part in names or not names)


class Recovery:
    """Files of a bag during a recovery, each read as far as possible."""

    def __init__(self, bag: Path) -> None:
        self.files = mcap_files(bag)
        self._listing = list_files(bag)
        require_order(bag, self._listing)
        self._bag, self._holdings = bag, Holdings()
        self._readers: dict[Path, PartialReader] = {}
        self._contents: dict[Path, FileContent] = {}

    def empty(self, file: Path) -> FileContent:
        """Return the content of a file of which no message was read yet."""
        return FileContent(bag_file(self._bag, number_of(file)).name)

    def read(self, file: Path, writer: BagWriter | None = None) -> FileContent:
        """Copy the messages of a file into a bag, or count them without a writer.

        Raises BagError if the only file of the bag has no readable record.
        """
        reader = self._readers[file] = PartialReader(file)
        content = self._contents[file] = self.empty(file)
        empty = len(self.files) == 1
        for record in reader.records():
            empty = False
            if isinstance(record, Attachment):
                if writer is not None:
                    writer.attach(record.name, record.data)
                continue
            schema, channel, message = record
            topic = recorded_topic(channel.topic) or Topic(channel.topic, schema.name, "any")
            topic = replace(topic, name=channel.topic)
            content.note(topic, message.log_time)
            self._holdings.add(topic.name, message.log_time, message.sequence, message.data)
            if writer is not None:
                number = message.sequence if reader.ours else 0
                writer.write(topic, message.log_time, message.data, schema.data, number)
        if empty:
            reason = f" ({reader.why})" if reader.why else ""
            raise BagError(
                f"{self._bag}: no readable record in {file.name}{reason}; nothing to recover"
            )
        return content

    def result(self, writer: BagWriter | None = None) -> Recovered:
        """Return the result of the recovery.

        A report is attached to the new bag if messages are missing.
        """
        readers = tuple(self._readers[file] for file in self.files)
        whole = all(reader.whole for reader in readers)
        ours = all(self._readers[file].ours for file in self.files if self._contents[file].total)
        scene = None
        with suppress(CamRigError):
            scene = read_scene(self._bag).scene
        loss = loss_of(self._holdings, scene, whole, ours)
        whole_bag = together(self._contents.values())
        extents, contents = self._listing.extents, self._contents
        fewer = {
            file.name: extents[file.name].messages - contents[file].total
            for file in self.files
            if file.name in extents and extents[file.name].messages > contents[file].total
        }
        origin = whole_bag.first if DATE_FROM_S * NS < whole_bag.first < NEVER else 0
        saved = Recovered(
            whole_bag.counts, whole_bag.last, readers, loss, origin, fewer, self._listing.notes
        )
        if writer is not None and not saved.sound:
            writer.attach(RECOVERED, saved.words.encode())
        return saved
