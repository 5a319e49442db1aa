"""Making a valid bag of what a recorder left that was not closed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

from mcap.records import Attachment

from cam_rig.bag import topics
from cam_rig.bag.complete import require_complete
from cam_rig.bag.reader import mcap_file, read_stage
from cam_rig.bag.salvage import Salvage
from cam_rig.bag.topics import Topic
from cam_rig.bag.writer import BagWriter, bag_file
from cam_rig.errors import BagError

OURS = {topic.name: topic for topic in topics.RECORDING}
#: What a torn file is called while its good part is copied.
TORN = ".torn"


@dataclass(frozen=True)
class Recovered:
    """What was saved, and what was lost."""

    counts: dict[str, int]
    last_ns: int
    whole: bool
    damaged_chunks: int
    unread_bytes: int

    @property
    def words(self) -> str:
        """Saved and lost, in words."""
        saved = f"{sum(self.counts.values())} messages to {self.last_ns / 1e9:.6g} s saved"
        if self.whole and not self.damaged_chunks:
            return f"{saved}, nothing lost: the bag was whole"
        lost = [] if self.whole else ["what was not flushed when the recording ended"]
        if self.damaged_chunks:
            lost.append(f"{self.damaged_chunks} damaged chunks")
        if self.unread_bytes:
            lost.append(f"{self.unread_bytes} bytes of a record cut off")
        return f"{saved}; lost: {', '.join(lost)}"


def recover(bag: Path, target: Path) -> Recovered:
    """Copy everything readable of a bag into a new one.

    Raises
    ------
    BagError : nothing in it is readable, or the target exists
    """
    return _copy(mcap_file(bag), bag, lambda: BagWriter(target))


def recover_in_place(bag: Path) -> Recovered:
    """Make a bag whole that its recorder could not close.

    Raises
    ------
    BagError : nothing in it is readable
    """
    torn = set_aside(bag)
    try:
        saved = _copy(torn, bag, lambda: BagWriter(bag, bag_file(bag)))
    except BagError:  # a full disk, for one: leave what there was
        torn.replace(bag_file(bag))
        raise
    torn.unlink()
    return saved


def missing_words(bag: Path) -> str:
    """What a bag lacks of its scene, in words; empty when nothing is missing or none is known."""
    try:
        scene = read_stage(bag).scene
    except BagError:
        return ""
    try:
        require_complete(bag, scene)
    except BagError as error:
        return f"not complete: {error}"
    return ""


def set_aside(bag: Path) -> Path:
    """Make room for a bag's file to be written anew: where the torn one is now."""
    file = bag_file(bag)
    torn = file.with_suffix(TORN)
    try:
        if torn.exists():  # an earlier attempt was itself cut off: what it wrote is in here too
            file.unlink(missing_ok=True)
        else:
            file.replace(torn)
    except OSError as error:
        raise BagError(f"{file}: cannot be recovered ({error.strerror})") from None
    return torn


def is_torn(bag: Path) -> bool:
    """Whether a recording was begun here and not closed."""
    file = bag_file(bag)
    begun = file.exists() or file.with_suffix(TORN).exists()
    return begun and not (bag / "metadata.yaml").exists()


def _copy(file: Path, bag: Path, make: Callable[[], BagWriter]) -> Recovered:
    salvage, last = Salvage(file), 0
    records = salvage.records()
    first = next(records, None)
    if first is None:
        raise BagError(f"{bag}: no readable record in {file.name}; nothing to recover")
    with make() as writer:
        for record in chain([first], records):
            if isinstance(record, Attachment):
                writer.attach(record.name, record.data)
                continue
            schema, channel, message = record
            topic = OURS.get(channel.topic) or Topic(channel.topic, schema.name, "any")
            writer.write(topic, message.log_time, message.data, schema.data)
            last = max(last, message.log_time)
    return Recovered(dict(writer.counts), last, salvage.whole, salvage.damaged, salvage.unread)
