"""Recovering a bag that was not closed, or is damaged, into a valid one."""

from __future__ import annotations

import shlex
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

from mcap.records import Attachment

from cam_rig.bag.attached import RECOVERED
from cam_rig.bag.files import (
    METADATA,
    TORN,
    bag_file,
    is_unclosed,
    mcap_file,
    part_of,
    remove,
)
from cam_rig.bag.loss import Holdings, Loss, loss_of
from cam_rig.bag.partial_reader import RECORDED_TOPICS, PartialReader
from cam_rig.bag.reader import read_counts, read_scene
from cam_rig.bag.recording.writer import BagWriter, require_new_bag
from cam_rig.errors import BagError, CamRigError
from cam_rig.messages.topics import Topic
from cam_rig.schema import SceneConfig

#: The report on a recording without any message.
NOTHING_RECORDED = "nothing was recorded"


@dataclass(frozen=True)
class Recovered:
    """What was recovered, and what is missing.

    ``counts`` by topic, ``last_ns`` the newest log time; ``reader`` knows the state of the file.
    """

    counts: dict[str, int]
    last_ns: int
    reader: PartialReader
    loss: Loss

    @property
    def whole(self) -> bool:
        """Whether the recording was closed."""
        return self.reader.whole

    @property
    def sound(self) -> bool:
        """Whether everything is there that was recorded."""
        return self.whole and not (self.reader.damaged or self.loss.gaps)

    @property
    def words(self) -> str:
        """Recovered and missing, in words."""
        messages = f"{sum(self.counts.values())} messages to {self.last_ns / 1e9:.6g} s saved"
        parts = [messages, self._missing(), self.loss.ends, *self._damage()]
        if self.reader.file.suffix == TORN:
            parts.append(f"read from {self.reader.file.name}, left by an interrupted recovery")
        return "; ".join(part for part in parts if part)

    def _missing(self) -> str:
        last = f"everything after {self.last_ns / 1e9:.6g} s"
        gaps = [self.loss.words] if self.loss.gaps else []
        if self.loss.open_end:
            gaps.append(last)
        if gaps:
            return f"missing: {', and '.join(gaps)}"
        if self.sound:
            return "nothing lost"
        return "no tick is missing"

    def _damage(self) -> list[str]:
        found, words = self.reader, list[str]()
        if found.cut:
            words.append(f"{found.cut} of the saved are from a truncated chunk")
        if found.damaged:
            words.append(f"damaged records: {found.damaged}, first: {found.why}")
        if found.doubt is not None:
            begin, end = found.doubt
            words.append(
                f"messages of them, whose numbers may be wrong: {found.doubtful}, from "
                f"{begin / 1e9:.6g} s to {end / 1e9:.6g} s"
            )
        if found.unread:
            words.append(f"{found.unread} bytes could not be read")
        return words


def recover(bag: Path, target: Path) -> Recovered:
    """Copy everything readable of a bag into a new one.

    It may be killed and repeated: what it left of the new bag is overwritten.

    Raises
    ------
    BagError : nothing in it is readable, or the target exists
    """
    file = mcap_file(bag)
    if not _is_unfinished(target):
        require_new_bag(target)
    return _copy(file, bag, target)


def recover_in_place(bag: Path) -> Recovered:
    """Recover a bag that its recorder could not close.

    It may be killed and repeated: the old file stays until the new one is complete.

    Raises
    ------
    BagError : nothing in it is readable, or there is no room
    """
    old = mcap_file(bag)
    try:
        saved = _copy(old, bag, bag)
    except BagError as error:
        why, there = str(error).removeprefix(f"{bag}: "), examine(bag)
        raise BagError(
            f"{bag}: cannot be recovered where it is, {why}; left as it is, and readable: "
            f"{there.words}; recover it with: cam-rig recover {shlex.quote(str(bag))} --output "
            "A_FOLDER_WITH_ROOM"
        ) from None
    if old.suffix == TORN:
        remove(old)
    return saved


def examine(bag: Path) -> Recovered:
    """What a bag holds, and what it lacks; nothing is written.

    Raises
    ------
    BagError : nothing in it is readable
    """
    return _copy(mcap_file(bag), bag, None)


def state_words(bag: Path) -> str:
    """What a failed run has recorded, in words; the bag is recovered where that is needed."""
    file = bag_file(bag)
    try:
        if not any(f.exists() and f.stat().st_size for f in (file, file.with_suffix(TORN))):
            return NOTHING_RECORDED
        words = recover_in_place(bag).words if is_unclosed(bag) else ""
        count = sum(read_counts(bag).values())
    except (BagError, OSError) as error:
        return str(error).removeprefix(f"{bag}: ")
    return (words or f"closed, {count} messages") if count else NOTHING_RECORDED


def _is_unfinished(target: Path) -> bool:
    """Whether a folder holds nothing but what a killed recovery left."""
    try:
        if not target.is_dir():
            return False
    except OSError:  # no file can have such a name
        return False
    part, names = part_of(bag_file(target)).name, {entry.name for entry in target.iterdir()}
    metadata = {METADATA, part_of(target / METADATA).name}
    return names <= {part, *metadata} and (part in names or not names)


def _copy(file: Path, bag: Path, target: Path | None) -> Recovered:
    """Copy what a file holds into a bag's own file; None only counts it."""
    reader, holdings = PartialReader(file), Holdings()
    records = reader.records()
    first = next(records, None)
    if first is None:
        why = f" ({reader.why})" if reader.why else ""
        raise BagError(f"{bag}: no readable record in {file.name}{why}; nothing to recover")
    counts: dict[str, int] = {}
    last = 0
    writer = None if target is None else BagWriter(target, rewrite=True)
    with writer or nullcontext():
        for record in chain([first], records):
            if isinstance(record, Attachment):
                if writer is not None:
                    writer.attach(record.name, record.data)
                continue
            schema, channel, message = record
            holdings.add(channel.topic, message.log_time, message.sequence, message.data)
            counts[channel.topic] = counts.get(channel.topic, 0) + 1
            last = max(last, message.log_time)
            if writer is not None:
                topic = RECORDED_TOPICS.get(channel.topic) or Topic(
                    channel.topic, schema.name, "any"
                )
                number = message.sequence if reader.ours else 0
                writer.write(topic, message.log_time, message.data, schema.data, number)
        loss = loss_of(holdings, _scene(bag), reader.whole, reader.ours)
        saved = Recovered(counts, last, reader, loss)
        if writer is not None and not saved.sound:
            writer.attach(RECOVERED, saved.words.encode())
    return saved


def _scene(bag: Path) -> SceneConfig | None:
    with suppress(CamRigError):
        return read_scene(bag).scene
    return None
