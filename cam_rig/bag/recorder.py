"""A bag under recording: opened or taken over from a killed recorder, flushed, closed."""

from __future__ import annotations

import json
import platform
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Attachment

from cam_rig.bag.codec import array_of, decode_law
from cam_rig.bag.publishers import Publishers
from cam_rig.bag.raw import cam_of
from cam_rig.bag.recover import OURS, is_torn, set_aside
from cam_rig.bag.salvage import Salvage
from cam_rig.bag.session import RecordingSession
from cam_rig.bag.topics import LAW_COEFFICIENTS, PROFILE, Topic
from cam_rig.bag.writer import FLUSH_EVERY, BagWriter, bag_file, require_new_bag
from cam_rig.errors import CamRigError
from cam_rig.experiment.cam_check import require_own_contour, require_own_law
from cam_rig.experiment.gate import StateGate
from cam_rig.experiment.handover import STATES_UNFLUSHED, Handover
from cam_rig.experiment.stage import Stage

PACKAGES = ("cam_rig", "numpy", "scipy", "pydantic", "mcap", "rosbags", "ros-kilted-rclpy")


class BagRecorder:
    """Records messages into a bag that holds everything to analyse it alone.

    Parameters
    ----------
    bag : folder to record into
    stage : the scene, attached with its files
    publishers : who may publish what
    resume : go on with a bag that a killed recorder left, instead of refusing it

    Raises
    ------
    BagError : the bag exists and is not to be resumed, or cannot be made
    """

    def __init__(
        self, bag: Path, stage: Stage, publishers: Publishers | None = None, resume: bool = False
    ) -> None:
        torn = set_aside(bag) if resume and is_torn(bag) else None
        mine = resume and bag.is_dir()  # killed as soon as it was made, there is no file in it
        self._writer = BagWriter(bag, bag_file(bag) if mine else None)
        self._stage, self._attached = stage, set[Path]()
        self._attach()
        self._writer.attach("versions.json", versions())
        gate = StateGate.of(stage.scene)
        self._session = RecordingSession(self._writer, gate, publishers, self._check)
        self._unflushed = 0
        #: Stamps (ns) of the states that a predecessor had written.
        self.resumed: list[int] = []
        if torn:
            self._replay(torn)
            torn.unlink()

    @property
    def count(self) -> int:
        """Messages written."""
        return sum(self._writer.counts.values())

    def take(self, topic: Topic, cdr: bytes, source: bytes = b"", number: int = 0) -> list[int]:
        """Take one message; see `RecordingSession.take`."""
        stamps = self._session.take(topic, cdr, source, number)
        if topic is PROFILE:
            self._know(self._session.cams)
        self._unflushed += len(stamps)
        if self._unflushed >= STATES_UNFLUSHED:
            self._flush()
        return stamps

    def idle(self) -> None:
        """Flush what has lain for a while; to be called now and then."""
        if self._unflushed and self._writer.unflushed > FLUSH_EVERY:
            self._flush()

    def close(self) -> None:
        """Write what is left, and close the bag."""
        self._session.close()
        self._writer.close()

    def _check(self, topic: Topic, message: Any) -> None:
        """Refuse a law or a contour that is not the one of the cam's file."""
        if topic is LAW_COEFFICIENTS:
            require_own_law(self._stage, decode_law(*array_of(message)))
        else:
            points = [(point.x, point.y) for point in message.polygon.points]
            require_own_contour(self._stage, cam_of(message), np.array(points).T)

    def _know(self, cams: list[str]) -> None:
        """A cam that was mounted by hand belongs into the bag as well."""
        for cam in cams:
            if cam not in self._stage.cams:
                with suppress(CamRigError):  # somebody else's word, or a file that is gone
                    self._stage.mount(cam)
        self._attach()

    def _attach(self) -> None:
        for path in self._stage.files:
            if path not in self._attached:
                self._attached.add(path)
                self._writer.attach(f"{path.parent.name}/{path.name}", path.read_bytes())

    def _flush(self) -> None:
        self._writer.flush()
        self._unflushed = 0

    def _replay(self, torn: Path) -> None:
        """Take again what the predecessor wrote; what it lost comes again from the publishers."""
        for record in Salvage(torn).records():
            if not isinstance(record, Attachment):
                _, channel, message = record
                if channel.topic in OURS:
                    topic = OURS[channel.topic]
                    self.resumed += self.take(topic, message.data, b"", message.sequence)
        self._writer.flush()


def open_bag(handover: Handover, wanted: Path, stage: Stage, publishers: Publishers) -> BagRecorder:
    """Begin a bag, or go on with the one that a killed predecessor was recording.

    That a bag is ours is written down before it is made, so that no moment is left in which a kill
    would leave one that nobody knows; and only where there is none, so that one of before is never
    taken for ours.

    Raises
    ------
    BagError : another's bag is there, or it cannot be made
    """
    if mine := handover.newest():
        return BagRecorder(Path(mine), stage, publishers, resume=True)
    require_new_bag(wanted)
    handover.keep(str(wanted))
    return BagRecorder(wanted, stage, publishers)


def versions() -> bytes:
    """What the recording was made with, as JSON."""
    found = {"python": platform.python_version(), "system": platform.platform()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "part of the ROS installation"
    return json.dumps(found, indent=2).encode()
