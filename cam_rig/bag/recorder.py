"""A bag being recorded: opened or taken over from a killed recorder, flushed, closed."""

from __future__ import annotations

import json
import platform
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Attachment, Message

from cam_rig.bag.file_writer import FileContent, ros_distribution
from cam_rig.bag.files import METADATA, bag_files, is_closed, require_new_bag, sync_folder
from cam_rig.bag.partial_reader import PartialReader
from cam_rig.bag.session import RecordingSession
from cam_rig.bag.split import Split
from cam_rig.bag.writer import BagWriter
from cam_rig.errors import BagError, RefusedError
from cam_rig.live.checkpoint import Checkpoint
from cam_rig.live.flow_control import MAX_STATES_UNFLUSHED
from cam_rig.live.law_server import require_own_contour, require_own_law
from cam_rig.live.state_validation import StateValidator
from cam_rig.messages.codec import array_of, decode_law
from cam_rig.messages.motion import MotionMessages
from cam_rig.messages.serialization import cam_of, stamp_of
from cam_rig.messages.topics import (
    DIAGNOSTICS,
    LAW_COEFFICIENTS,
    PROFILE,
    Publishers,
    Topic,
    recorded_topic,
)
from cam_rig.simulation.scene import LoadedScene

PACKAGES = ("cam_rig", "numpy", "scipy", "pydantic", "mcap", "rosbags")


class BagRecorder:
    """Records messages into a bag that holds everything to analyse it alone.

    A successor writes a new file, which replaces the old one when it holds all that the old one
    held. Until then nothing is written that the old one lacks; so it may be killed as well. Of a
    bag that was split, it is the last file that is written anew; the closed ones before it are
    kept.

    ``resume`` goes on with a bag that a killed recorder left, instead of refusing it;
    ``points_per_turn`` is of the motion for people, 0: as the scene says.
    """

    def __init__(
        self,
        bag: Path,
        loaded: LoadedScene,
        publishers: Publishers | None = None,
        resume: bool = False,
        namespace: str = "",
        points_per_turn: int = 0,
        split: Split | None = None,
    ) -> None:
        kept, self._old = files_to_resume(bag) if resume else ([], [])
        self._writer = BagWriter(bag, resume, split, len(kept), namespace)
        self._loaded, self._attached = loaded, set[Path]()
        self._attach()
        self._writer.attach("versions.json", versions())
        validator = StateValidator.of(loaded.scene)
        motion = MotionMessages(loaded, points_per_turn)
        self._session = RecordingSession(self._writer, validator, publishers, self._check, motion)
        self._unflushed = 0
        #: Stamps (ns) of the states that a predecessor had written.
        self.resumed: list[int] = []
        for file in kept:
            self._replay_kept(file)
        if resume:
            self._replay()

    @property
    def count(self) -> int:
        """Messages written."""
        return sum(self._writer.counts.values())

    def take(self, topic: Topic, cdr: bytes, source: bytes = b"", number: int = 0) -> list[int]:
        """Take one message; see `RecordingSession.take`."""
        stamps = self._take(topic, cdr, source, number)
        self._unflushed += len(stamps)
        if stamps:  # the first one is what the predecessor had begun to write
            self._replace_old()
        if self._unflushed >= MAX_STATES_UNFLUSHED:
            self._writer.flush()
            self._unflushed = 0
        return stamps

    def idle(self) -> None:
        """Flush what is due; to be called a few times a second."""
        self._writer.flush_if_due()

    def discard(self) -> None:
        """Remove the bag, into which nothing was written."""
        self._writer.abandon()
        with suppress(OSError):
            self._writer.file.unlink()
            (self._writer.directory / METADATA).unlink()
            self._writer.directory.rmdir()

    def close(self) -> None:
        """Write what is left, and close the bag."""
        self._writer.split = Split()  # what is not complete stays in one file
        self._session.close()
        self._replace_old()
        self._writer.close()

    def _check(self, topic: Topic, message: Any) -> None:
        if topic is LAW_COEFFICIENTS:
            require_own_law(self._loaded, decode_law(*array_of(message)))
        else:
            points = [(point.x, point.y) for point in message.polygon.points]
            require_own_contour(self._loaded, cam_of(message), np.array(points).T)

    def _attach(self) -> None:
        for path in self._loaded.files:
            if path not in self._attached:
                self._attached.add(path)
                # the other files lie in folders of these names; a scene may lie anywhere
                folder = "scenes" if path == self._loaded.scene_file else path.parent.name
                self._writer.attach(f"{folder}/{path.name}", path.read_bytes())

    def _take(self, topic: Topic, cdr: bytes, source: bytes, number: int) -> list[int]:
        stamps = self._session.take(topic, cdr, source, number)
        if topic is PROFILE:  # of a cam that an operator has mounted, perhaps
            self._attach()
        return stamps

    def _replay(self) -> None:
        """Take again what the predecessor wrote; what it lost is resent by the publishers."""
        replayed = Counter(self._writer.counts)
        for file in self._old:
            for topic, message in recorded(file):
                with suppress(RefusedError):  # of a damaged part
                    self._take_again(topic, message)
                    replayed[topic.name] += 1
        if replayed == self._writer.counts:
            self._replace_old()

    def _replay_kept(self, file: Path) -> None:
        """Take what a closed file holds, which is kept, so that the session knows it."""
        content = FileContent(file.name)
        with self._writer.keeping(content):
            for topic, message in recorded(file):
                content.note(topic, message.log_time)
                with suppress(RefusedError):
                    self._take_again(topic, message)

    def _take_again(self, topic: Topic, message: Message) -> None:
        if topic.derived:  # made again, and then as many, if all that they follow from is here
            return
        if topic is DIAGNOSTICS:  # the predecessor had its state
            self._session.note_known(stamp_of(message.data))
        self.resumed += self._take(topic, message.data, b"", message.sequence)

    def _replace_old(self) -> None:
        """Let the new file replace the old ones, since it holds all that those held."""
        self._writer.replace_old()
        try:
            for file in self._old:
                if file != self._writer.file:
                    file.unlink(missing_ok=True)
                    sync_folder(file.parent)
        except OSError as error:
            raise BagError(f"{file}: cannot be removed ({error.strerror})") from None
        self._old = []


def open_bag(
    checkpoint: Checkpoint,
    wanted: Path,
    loaded: LoadedScene,
    publishers: Publishers,
    namespace: str = "",
    points_per_turn: int = 0,
    split: Split | None = None,
) -> BagRecorder:
    """Begin a bag, or go on with the one that a killed predecessor was recording.

    The checkpoint names the bag before it is made, so that a kill at any moment leaves none that
    the successor does not know; and only where there is none, so that an older bag is never taken
    for this run's.
    """
    if own := checkpoint.newest():
        return BagRecorder(Path(own), loaded, publishers, True, namespace, points_per_turn, split)
    require_new_bag(wanted, split.last_number if split else 0)
    checkpoint.save(str(wanted))
    return BagRecorder(wanted, loaded, publishers, False, namespace, points_per_turn, split)


def files_to_resume(bag: Path) -> tuple[list[Path], list[Path]]:
    """The files of a predecessor: those that are kept, and those that are written anew as one.

    The last one is, and so is every one from the first that was not closed: a predecessor that was
    killed while it began a file left two of them.
    """
    found = bag_files(bag)
    kept = list(takewhile(is_closed, found[:-1]))
    return kept, found[len(kept) :]


def recorded(file: Path) -> Iterator[tuple[Topic, Message]]:
    """The messages of the rig's topics that a file holds, as far as it can be read."""
    for record in PartialReader(file).records():
        if isinstance(record, Attachment):
            continue
        if (topic := recorded_topic(record[1].topic)) is not None:
            yield topic, record[2]


def versions() -> bytes:
    """What the recording was made with, as JSON."""
    found = {"python": platform.python_version(), "system": platform.platform()}
    for package in (*PACKAGES, f"ros-{ros_distribution()}-rclpy"):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "part of the ROS installation"
    return json.dumps(found, indent=2).encode()
