"""A bag being recorded: opened or taken over from a killed recorder, flushed, closed."""

from __future__ import annotations

import json
import platform
from collections import Counter
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Attachment

from cam_rig.bag.files import TORN, bag_file, remove
from cam_rig.bag.partial_reader import RECORDED_TOPICS, PartialReader
from cam_rig.bag.publishers import Publishers
from cam_rig.bag.recording.metadata import ros_distribution
from cam_rig.bag.recording.session import RecordingSession
from cam_rig.bag.recording.writer import BagWriter, require_new_bag
from cam_rig.errors import CamRigError, RefusedError
from cam_rig.live.cam_check import require_own_contour, require_own_law
from cam_rig.live.checkpoint import Checkpoint
from cam_rig.live.flow_control import MAX_STATES_UNFLUSHED
from cam_rig.live.state_validation import StateValidator
from cam_rig.messages.codec import array_of, decode_law
from cam_rig.messages.serialization import cam_of, stamp_of
from cam_rig.messages.topics import DIAGNOSTICS, LAW_COEFFICIENTS, PROFILE, Topic
from cam_rig.simulation.loaded_scene import LoadedScene

PACKAGES = ("cam_rig", "numpy", "scipy", "pydantic", "mcap", "rosbags")


class BagRecorder:
    """Records messages into a bag that holds everything to analyse it alone.

    A successor writes a new file, which replaces the old one when it holds all that the old one
    held. Until then nothing is written that the old one lacks; so it may be killed as well.

    Parameters
    ----------
    bag : folder to record into
    loaded : the scene, attached with its files
    publishers : the one publisher of each topic
    resume : go on with a bag that a killed recorder left, instead of refusing it

    Raises
    ------
    BagError : the bag exists and is not to be resumed, or cannot be made
    """

    def __init__(
        self,
        bag: Path,
        loaded: LoadedScene,
        publishers: Publishers | None = None,
        resume: bool = False,
    ) -> None:
        self._old = _old_file(bag) if resume else None
        self._writer = BagWriter(bag, rewrite=resume)
        self._loaded, self._attached = loaded, set[Path]()
        self._attach()
        self._writer.attach("versions.json", versions())
        validator = StateValidator.of(loaded.scene)
        self._session = RecordingSession(self._writer, validator, publishers, self._check)
        self._unflushed = 0
        #: Stamps (ns) of the states that a predecessor had written.
        self.resumed: list[int] = []
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
            self._flush()
        return stamps

    def idle(self) -> None:
        """Flush what is due; to be called a few times a second."""
        self._writer.flush_if_due()

    def close(self) -> None:
        """Write what is left, and close the bag."""
        self._session.close()
        self._replace_old()
        self._writer.close()

    def _check(self, topic: Topic, message: Any) -> None:
        """Refuse a law or a contour that is not the one of the cam's file."""
        if topic is LAW_COEFFICIENTS:
            require_own_law(self._loaded, decode_law(*array_of(message)))
        else:
            points = [(point.x, point.y) for point in message.polygon.points]
            require_own_contour(self._loaded, cam_of(message), np.array(points).T)

    def _attach_cams(self, cams: list[str]) -> None:
        """Attach the file of a cam that an operator mounted."""
        for cam in cams:
            if cam not in self._loaded.cams:
                with suppress(CamRigError):  # not a cam of the library, or its file is gone
                    self._loaded.mount(cam)
        self._attach()

    def _attach(self) -> None:
        for path in self._loaded.files:
            if path not in self._attached:
                self._attached.add(path)
                self._writer.attach(f"{path.parent.name}/{path.name}", path.read_bytes())

    def _flush(self) -> None:
        self._writer.flush()
        self._unflushed = 0

    def _take(self, topic: Topic, cdr: bytes, source: bytes, number: int) -> list[int]:
        stamps = self._session.take(topic, cdr, source, number)
        if topic is PROFILE:
            self._attach_cams(self._session.cams)
        return stamps

    def _replay(self) -> None:
        """Take again what the predecessor wrote; what it lost is resent by the publishers."""
        replayed: Counter[str] = Counter()
        for record in PartialReader(self._old).records() if self._old else ():
            if isinstance(record, Attachment) or record[1].topic not in RECORDED_TOPICS:
                continue
            topic, message = RECORDED_TOPICS[record[1].topic], record[2]
            with suppress(RefusedError):  # of a damaged part
                if topic is DIAGNOSTICS:  # the predecessor had its state
                    self._session.note_known(stamp_of(message.data))
                self.resumed += self._take(topic, message.data, b"", message.sequence)
                replayed[topic.name] += 1
        if replayed == self._writer.counts:
            self._replace_old()

    def _replace_old(self) -> None:
        """Let the new file replace the old one, since it holds all that the old one held."""
        self._writer.replace_old()
        if self._old is not None and self._old != self._writer.file:
            remove(self._old)
        self._old = None


def _old_file(bag: Path) -> Path | None:
    """The file of a predecessor; None where it was killed before it had made one."""
    file = bag_file(bag)
    return next((path for path in (file.with_suffix(TORN), file) if path.exists()), None)


def open_bag(
    checkpoint: Checkpoint, wanted: Path, loaded: LoadedScene, publishers: Publishers
) -> BagRecorder:
    """Begin a bag, or go on with the one that a killed predecessor was recording.

    The checkpoint names the bag before it is made, so that a kill at any moment leaves none that
    the successor does not know; and only where there is none, so that an older bag is never taken
    for this run's.

    Raises
    ------
    BagError : another bag is there, or it cannot be made
    """
    if own := checkpoint.newest():
        return BagRecorder(Path(own), loaded, publishers, resume=True)
    require_new_bag(wanted)
    checkpoint.save(str(wanted))
    return BagRecorder(wanted, loaded, publishers)


def versions() -> bytes:
    """What the recording was made with, as JSON."""
    found = {"python": platform.python_version(), "system": platform.platform()}
    for package in (*PACKAGES, f"ros-{ros_distribution()}-rclpy"):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "part of the ROS installation"
    return json.dumps(found, indent=2).encode()
