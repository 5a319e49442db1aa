"""Recorder of a run's messages into a bag, without ROS."""

from __future__ import annotations

import json
import platform
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from cam_rig.bag.file_writer import ros_distribution
from cam_rig.bag.files import METADATA
from cam_rig.bag.session import RecordingSession
from cam_rig.bag.split import Split
from cam_rig.bag.writer import BagWriter
from cam_rig.live.flow_control import MAX_STATES_UNFLUSHED
from cam_rig.live.law_server import require_own_contour, require_own_law
from cam_rig.live.state_validation import StateValidator
from cam_rig.messages.codec import array_of, decode_law
from cam_rig.messages.motion import MotionMessages
from cam_rig.messages.serialization import cam_of
from cam_rig.messages.topics import (
    LAW_COEFFICIENTS,
    PROFILE,
    Publishers,
    Topic,
)
from cam_rig.simulation.scene import LoadedScene

#: Names of the packages whose versions are attached to a bag.
PACKAGES = ("cam_rig", "numpy", "scipy", "pydantic", "mcap", "rosbags")


class BagRecorder:
    """Recorder of messages into a bag, with all files that its analysis needs.

    The scene, its cams and its rig are attached to the bag. `samples_per_turn` is the number of
    samples per turn of the motion messages that the recorder computes for viewers (0: the number in
    the scene). `split` contains the limits at which a new file is started.
    """

    def __init__(
        self,
        bag: Path,
        loaded: LoadedScene,
        publishers: Publishers | None = None,
        namespace: str = "",
        samples_per_turn: int = 0,
        split: Split | None = None,
    ) -> None:
        self._writer = BagWriter(bag, split=split, namespace=namespace)
        self._loaded, self._attached = loaded, set[Path]()
        self._attach()
        self._writer.attach("versions.json", versions())
        validator = StateValidator.of(loaded.scene)
        motion = MotionMessages(loaded, samples_per_turn)
        self._session = RecordingSession(self._writer, validator, publishers, self._check, motion)
        self._unflushed = 0

    @property
    def count(self) -> int:
        """Number of messages that were written."""
        return sum(self._writer.counts.values())

    def take(self, topic: Topic, cdr: bytes, source: bytes = b"", number: int = 0) -> list[int]:
        """Receive one message, and write the cam states that the message completes.

        The parameters and the result are those of `RecordingSession.take`.
        """
        stamps = self._session.take(topic, cdr, source, number)
        if topic is PROFILE:  # possibly of a cam that an operator has mounted
            self._attach()
        self._unflushed += len(stamps)
        if self._unflushed >= MAX_STATES_UNFLUSHED:
            self._writer.flush()
            self._unflushed = 0
        return stamps

    def idle(self) -> None:
        """Write buffered messages to the file if the last flush is too long ago.

        The method must be called a few times per second.
        """
        self._writer.flush_if_due()

    def discard(self) -> None:
        """Remove the bag, which must not contain messages."""
        self._writer.abandon()
        with suppress(OSError):
            self._writer.file.unlink()
            (self._writer.directory / METADATA).unlink()
            self._writer.directory.rmdir()

    def close(self) -> None:
        """Write the remaining messages of the run, and close the bag."""
        self._writer.split = Split()  # the remaining states start no new file
        self._session.close()
        self._writer.close()

    def _check(self, topic: Topic, message: Any) -> None:
        if topic is LAW_COEFFICIENTS:
            require_own_law(self._loaded, decode_law(*array_of(message)))
        else:
            points = [(point.x, point.y) for point in message.polygon.points]
            require_own_contour(self._loaded, cam_of(message), np.array(points).T)

    def _attach(self) -> None:
        for path, folder in self._loaded.files.items():
            if path not in self._attached:
                self._attached.add(path)
                self._writer.attach(f"{folder}/{path.name}", path.read_bytes())


def versions() -> bytes:
    """Return the versions of Python and of the recording packages as JSON."""
    entries = {"python": platform.python_version(), "system": platform.platform()}
    for package in (*PACKAGES, f"ros-{ros_distribution()}-rclpy"):
        try:
            entries[package] = version(package)
        except PackageNotFoundError:
            entries[package] = "part of the ROS installation"
    return json.dumps(entries, indent=2).encode()
