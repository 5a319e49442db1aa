"""Recovery of a bag that is damaged or was not closed."""

from __future__ import annotations

import os
import shlex
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from mcap.records import Attachment

from cam_rig.bag.completeness import Holdings, Loss, loss_of
from cam_rig.bag.file_writer import NEVER, FileContent, sum_contents
from cam_rig.bag.files import (
    METADATA,
    bag_file,
    bag_files,
    is_closed,
    is_unclosed,
    part_of,
    require_new_bag,
)
from cam_rig.bag.listing import COUNTED, list_files, mcap_files, number_of, require_order
from cam_rig.bag.partial_reader import (
    RECOVERED,
    Condition,
    FileReport,
    RecordedMessage,
    read_partial,
)
from cam_rig.bag.reader import read_counts, read_scene
from cam_rig.bag.writer import BagWriter
from cam_rig.errors import BagError, CamRigError
from cam_rig.messages.topics import Topic, recorded_topic
from cam_rig.units import DATE_FROM_S, NS, format_time

#: Text that reports a recording without messages.
NOTHING_RECORDED = "nothing was recorded"


@dataclass(frozen=True)
class Recovery:
    """Result of a recovery: the recovered messages by topic, and the missing messages.

    `last_ns` is the newest log time in ns. `reports` contains a report per file of the damaged bag.
    """

    counts: dict[str, int]
    last_ns: int
    reports: tuple[FileReport, ...]
    loss: Loss
    #: Time (ns) that texts print as 0: 0 for rig time, the start of the bag for wall-clock time.
    origin_ns: int = 0
    #: Number of messages that metadata.yaml lists but the file does not have, by file name.
    fewer: dict[str, int] = field(default_factory=dict)
    #: Sentences on ignored files, one per file.
    notes: tuple[str, ...] = ()

    def any_file_is(self, condition: Condition) -> bool:
        """Return True if at least one file of the damaged bag has a `Condition`."""
        return any(condition in report.condition for report in self.reports)

    @property
    def is_lossless(self) -> bool:
        """True if the new bag contains everything that was recorded."""
        is_partial = any(
            self.any_file_is(each) for each in (Condition.TRUNCATED, Condition.DAMAGED)
        )
        return not (is_partial or self.loss.gaps or self.fewer)

    @property
    def text(self) -> str:
        """Text that lists the recovered and the missing messages of a bag."""
        missing = [self.loss.text] if self.loss.gaps else []
        if self.loss.open_end:
            missing.append(f"everything after {self._time_words(self.last_ns)}")
        parts = [
            f"{sum(self.counts.values())} messages up to {self._time_words(self.last_ns)} saved",
            f"missing: {', and '.join(missing)}" if missing else "",
            self.loss.ends,
        ]
        if not missing:
            parts[1] = "nothing lost" if self.is_lossless else "no tick is missing"
        parts += [
            f"{name} has {count} messages fewer than {METADATA} lists"
            for name, count in self.fewer.items()
        ]
        for report in self.reports:
            damage = self._damage(report)
            if damage and len(self.reports) > 1:
                damage[0] = f"in {report.file.name}: {damage[0]}"
            parts += damage
        parts += [note.rstrip(".") for note in self.notes]
        return "; ".join(part for part in parts if part)

    def _time_words(self, time_ns: int) -> str:
        return format_time((time_ns - self.origin_ns) / NS)

    def _damage(self, report: FileReport) -> list[str]:
        parts = list[str]()
        if report.truncated_messages:
            parts.append(f"{report.truncated_messages} saved messages are from a truncated chunk")
        if report.damaged_records:
            parts.append(
                f"damaged records: {report.damaged_records}, first error: {report.first_error}"
            )
        if report.doubtful_times is not None:
            start, end = map(self._time_words, report.doubtful_times)
            parts.append(
                f"{report.doubtful_messages} saved messages from {start} to {end} are from damaged "
                "records, so their values may be wrong"
            )
        if report.unread_bytes:
            parts.append(f"{report.unread_bytes} bytes could not be read")
        return parts


def recover(bag: Path, target: Path) -> Recovery:
    """Copy everything readable of a bag into a new bag with one file.

    The function may be killed and repeated.
    """
    files = _BagFiles(bag)
    if not _is_unfinished(target):
        require_new_bag(target)
    with BagWriter(target, rewrite=True) as writer:
        for file in files.paths:
            files.read(file, writer)
        return files.result(writer)


def recover_in_place(bag: Path) -> Recovery:
    """Recover those files of a bag that were not closed.

    The function may be killed and repeated.
    """
    files = _BagFiles(bag)
    counted = [file.name for file in files.paths if COUNTED.fullmatch(file.name)]
    if counted and not number_of(files.paths[-1]):
        raise BagError(
            f"{bag}: files named like {counted[0]} cannot be recovered in place; recover the bag "
            f"with: cam-rig recover {shlex.quote(str(bag))} --output NEW_FOLDER"
        )
    unclosed = [file for file in files.paths if not is_closed(file)]
    unclosed = unclosed or files.paths[-1:]  # only metadata.yaml is missing
    try:
        # metadata.yaml lists the files that are not recovered yet with 0 messages. If the process
        # is killed, a repeated recovery therefore still finds them.
        contents = {file: files.empty(file) for file in unclosed}
        contents |= {file: files.read(file) for file in files.paths if file not in unclosed}
        for file in unclosed:
            others = [content for other, content in contents.items() if other != file]
            with BagWriter(bag, rewrite=True, number=number_of(file), others=others) as writer:
                contents[file] = files.read(file, writer)
                if file is unclosed[-1]:
                    saved = files.result(writer)
    except BagError as error:
        reason = str(error).removeprefix(f"{bag}: ")
        raise BagError(
            f"{bag}: cannot be recovered in place, {reason}; the bag is unchanged and readable: "
            f"{examine(bag).text}; recover it with: cam-rig recover {shlex.quote(str(bag))} "
            "--output FOLDER_ON_ANOTHER_DISK"
        ) from None
    return saved


def examine(bag: Path) -> Recovery:
    """Return the recovery that is possible for a bag, without writing anything."""
    files = _BagFiles(bag)
    for file in files.paths:
        files.read(file)
    return files.result()


def recording_state(bag: Path) -> str:
    """Return a text on the messages that a failed run has recorded.

    The bag is recovered first if it was not closed.
    """
    try:
        if not any(file.stat().st_size for file in bag_files(bag)):
            return NOTHING_RECORDED
        text = recover_in_place(bag).text if is_unclosed(bag) else ""
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


class _BagFiles:
    """Files of a bag during a recovery, each read as far as possible."""

    def __init__(self, bag: Path) -> None:
        self.paths = mcap_files(bag)
        self._listing = list_files(bag)
        require_order(bag, self._listing)
        self._bag, self._holdings = bag, Holdings()
        self._reports: dict[Path, FileReport] = {}
        self._contents: dict[Path, FileContent] = {}

    def empty(self, file: Path) -> FileContent:
        """Return the description of a bag's file before it is read: without messages."""
        return FileContent(bag_file(self._bag, number_of(file)).name)

    def read(self, file: Path, writer: BagWriter | None = None) -> FileContent:
        """Copy the messages of a file into a bag, or count them without a writer.

        Raises BagError if the only file of the bag has no readable record.
        """
        content = self._contents[file] = self.empty(file)
        attachments = list[str]()

        def receive(record: RecordedMessage | Attachment) -> None:
            if isinstance(record, Attachment):
                attachments.append(record.name)
                if writer is not None:
                    writer.attach(record.name, record.data)
                return
            schema, channel, message, number = record
            topic = recorded_topic(channel.topic) or Topic(channel.topic, schema.name, "any")
            topic = replace(topic, name=channel.topic)
            content.note(topic, message.log_time)
            self._holdings.add(topic.name, message.log_time, number, message.data)
            if writer is not None:
                writer.write(topic, message.log_time, message.data, schema.data, number)

        report = self._reports[file] = read_partial(file, receive)
        if len(self.paths) == 1 and not (content.total or attachments):
            reason = f" ({report.first_error})" if report.first_error else ""
            raise BagError(
                f"{self._bag}: no readable record in {file.name}{reason}; nothing to recover"
            )
        return content

    def result(self, writer: BagWriter | None = None) -> Recovery:
        """Return the result of the recovery.

        A report is attached to the new bag if messages are missing.
        """
        reports, contents = tuple(self._reports[file] for file in self.paths), self._contents
        closed = not any(Condition.TRUNCATED in report.condition for report in reports)
        ours = not any(
            Condition.FOREIGN in report.condition and contents[report.file].total
            for report in reports
        )
        scene = None
        with suppress(CamRigError):
            scene = read_scene(self._bag).scene
        total = sum_contents(contents.values())
        listed = {name: extent.messages for name, extent in self._listing.extents.items()}
        fewer = {
            file.name: listed[file.name] - contents[file].total
            for file in self.paths
            if contents[file].total < listed.get(file.name, 0)
        }
        recovery = Recovery(
            counts=total.counts,
            last_ns=total.last,
            reports=reports,
            loss=loss_of(self._holdings, scene, closed, ours),
            origin_ns=total.first if DATE_FROM_S * NS < total.first < NEVER else 0,
            fewer=fewer,
            notes=self._listing.notes,
        )
        if writer is not None and not recovery.is_lossless:
            writer.attach(RECOVERED, recovery.text.encode())
        return recovery
