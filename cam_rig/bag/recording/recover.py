"""Making a valid bag of what a recorder left that was not closed."""

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
    is_torn,
    mcap_file,
    part_of,
    remove,
)
from cam_rig.bag.loss import Holdings, Loss, loss_of
from cam_rig.bag.partial_reader import OURS, Salvage
from cam_rig.bag.reader import read_counts, read_scene
from cam_rig.bag.recording.writer import BagWriter, require_new_bag
from cam_rig.errors import BagError, CamRigError
from cam_rig.messages.topics import Topic
from cam_rig.schema import SceneConfig

#: What is said of a recording with no message in it.
NOTHING = "nothing was recorded"


@dataclass(frozen=True)
class Recovered:
    """What was saved, and what is missing.

    ``counts`` by topic, ``last_ns`` the newest log time; ``salvage`` tells how the file was.
    """

    counts: dict[str, int]
    last_ns: int
    salvage: Salvage
    loss: Loss

    @property
    def whole(self) -> bool:
        """Whether the recording was closed."""
        return self.salvage.whole

    @property
    def sound(self) -> bool:
        """Whether all is there that was ever recorded."""
        return self.whole and not (self.salvage.damaged or self.loss.gaps)

    @property
    def words(self) -> str:
        """Saved and missing, in words."""
        messages = f"{sum(self.counts.values())} messages to {self.last_ns / 1e9:.6g} s saved"
        parts = [messages, self._missing(), self.loss.ends, *self._damage()]
        if self.salvage.file.suffix == TORN:
            parts.append(f"read from {self.salvage.file.name}, left by an interrupted recovery")
        return "; ".join(part for part in parts if part)

    def _missing(self) -> str:
        last = f"whatever came after {self.last_ns / 1e9:.6g} s"
        gaps = [self.loss.words] if self.loss.gaps else []
        if self.loss.open_end:
            gaps.append(last)
        if gaps:
            return f"missing: {', and '.join(gaps)}"
        if self.sound:
            return "nothing lost"
        return "no tick is missing"

    def _damage(self) -> list[str]:
        found, words = self.salvage, []
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

    It may be killed and done again: what it left of the new bag is begun anew.

    Raises
    ------
    BagError : nothing in it is readable, or the target exists
    """
    file = mcap_file(bag)
    if not _is_half_made(target):
        require_new_bag(target)
    return _copy(file, bag, target)


def recover_in_place(bag: Path) -> Recovered:
    """Make a bag whole that its recorder could not close.

    It may be killed and done again: the old file stays until the new one is whole.

    Raises
    ------
    BagError : nothing in it is readable, or there is no room
    """
    torn = mcap_file(bag)
    try:
        saved = _copy(torn, bag, bag)
    except BagError as error:
        why, there = str(error).removeprefix(f"{bag}: "), examine(bag)
        raise BagError(
            f"{bag}: cannot be recovered where it is, {why}; left as it is, and readable: "
            f"{there.words}; mend it with: cam-rig recover {shlex.quote(str(bag))} --output "
            "A_FOLDER_WITH_ROOM"
        ) from None
    if torn.suffix == TORN:
        remove(torn)
    return saved


def examine(bag: Path) -> Recovered:
    """What there is of a bag, and what is missing; nothing is written.

    Raises
    ------
    BagError : nothing in it is readable
    """
    return _copy(mcap_file(bag), bag, None)


def state_words(bag: Path) -> str:
    """What there is of a recording whose run failed, in words; it is recovered if need be."""
    file = bag_file(bag)
    try:
        if not any(f.exists() and f.stat().st_size for f in (file, file.with_suffix(TORN))):
            return NOTHING
        words = recover_in_place(bag).words if is_torn(bag) else ""
        count = sum(read_counts(bag).values())
    except (BagError, OSError) as error:
        return str(error).removeprefix(f"{bag}: ")
    return (words or f"closed, {count} messages") if count else NOTHING


def _is_half_made(target: Path) -> bool:
    """Whether a folder holds nothing but what a killed recovery left."""
    try:
        if not target.is_dir():
            return False
    except OSError:  # nobody can have made what has such a name
        return False
    part, names = part_of(bag_file(target)).name, {entry.name for entry in target.iterdir()}
    metadata = {METADATA, part_of(target / METADATA).name}
    return names <= {part, *metadata} and (part in names or not names)


def _copy(file: Path, bag: Path, target: Path | None) -> Recovered:
    """Copy what a file holds into a bag's own file; None only counts it."""
    salvage, holdings = Salvage(file), Holdings()
    records = salvage.records()
    first = next(records, None)
    if first is None:
        why = f" ({salvage.why})" if salvage.why else ""
        raise BagError(f"{bag}: no readable record in {file.name}{why}; nothing to recover")
    counts: dict[str, int] = {}
    last = 0
    writer = None if target is None else BagWriter(target, anew=True)
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
                topic = OURS.get(channel.topic) or Topic(channel.topic, schema.name, "any")
                number = message.sequence if salvage.ours else 0
                writer.write(topic, message.log_time, message.data, schema.data, number)
        loss = loss_of(holdings, _scene(bag), salvage.whole, salvage.ours)
        saved = Recovered(counts, last, salvage, loss)
        if writer is not None and not saved.sound:
            writer.attach(RECOVERED, saved.words.encode())
    return saved


def _scene(bag: Path) -> SceneConfig | None:
    with suppress(CamRigError):
        return read_scene(bag).scene
    return None
