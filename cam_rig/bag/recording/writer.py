"""Writing a rosbag2 directory: one MCAP file and metadata.yaml."""

from __future__ import annotations

import json
import os
import time
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

from mcap.writer import CompressionType, Writer
from rosbags.typesys import Stores, get_typestore

from cam_rig.bag import files
from cam_rig.bag.files import METADATA, bag_file, part_of
from cam_rig.bag.partial_reader import LIBRARY
from cam_rig.bag.recording.metadata import metadata, offered_qos, type_hash
from cam_rig.errors import BagError
from cam_rig.messages.topics import RECORDING, Topic

#: Wall time (s) between flushes: what a killed recorder can lose.
FLUSH_PERIOD_S = 0.5
#: Wall time (s) between two fsyncs: what a power cut can take.
SYNC_PERIOD_S = 0.5


class BagWriter:
    """A rosbag2 bag being written; a context manager.

    From the start it has a metadata.yaml that other readers take, though it counts nothing yet.

    Parameters
    ----------
    directory : the bag; it must not exist yet, its parent folders are made
    rewrite : instead, what is written replaces a bag's file when `replace_old` is called, or when
        it is closed; until then that file, if there is one, stays as it is

    Raises
    ------
    BagError : the directory exists already, or the file cannot be made
    """

    def __init__(self, directory: Path, rewrite: bool = False) -> None:
        self.directory = directory
        self.file = bag_file(directory)
        self._part: Path | None = part_of(self.file) if rewrite else None
        self.counts: dict[str, int] = {}
        self._channels: dict[str, tuple[Topic, int]] = {}
        self._types = get_typestore(Stores.ROS2_KILTED)
        self._first = self._last = 0
        self._dirty = self._unsynced = True
        self._failed: BagError | None = None
        self._make_folder(rewrite)
        self._file = self._open()
        self._writer = Writer(self._file, compression=CompressionType.NONE)
        try:
            self._writer.start(profile="ros2", library=LIBRARY)
            self._file.flush()
            if not rewrite:
                self._write_metadata(list(RECORDING))
        except OSError as error:
            self.abandon()
            raise BagError(f"{directory}: cannot be made ({error.strerror})") from None
        self._flushed = self._synced = time.monotonic()

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if error is not None:
            self.abandon()
            return
        try:
            self.close()
        except BagError:
            self.abandon()
            raise

    def attach(self, name: str, data: bytes) -> None:
        """Put a file into the bag, so that it can be analysed alone."""
        kinds = {".csv": "text/csv", ".txt": "text/plain", ".json": "application/json"}
        kind = kinds.get(Path(name).suffix, "application/yaml")
        self._require_sound()
        self._dirty = True
        try:
            self._writer.add_attachment(0, 0, name, kind, data)
        except OSError as error:
            raise self._lost(error) from None

    def write(
        self,
        topic: Topic,
        log_time: int,
        cdr: bytes,
        definition: bytes | None = None,
        number: int = 0,
    ) -> None:
        """Write one serialized message at a rig time in ns.

        Parameters
        ----------
        definition : of the message's type; by default what rosbags knows of it
        number : its place among all of its topic; by default the next

        Raises
        ------
        BagError : the disk is full, or gone
        """
        self._require_sound()
        try:
            if topic.name not in self._channels:
                self._channels[topic.name] = (topic, self._register(topic, definition))
            self._first = min(self._first, log_time) if self.counts else log_time
            self._last = max(self._last, log_time)
            count = self.counts.get(topic.name, 0) + 1
            channel = self._channels[topic.name][1]
            self._dirty = True
            self._writer.add_message(channel, log_time, cdr, log_time, number or count)
            self.counts[topic.name] = count
            if time.monotonic() - self._flushed > FLUSH_PERIOD_S:
                self.flush()
        except OSError as error:
            raise self._lost(error) from None

    def flush_if_due(self) -> None:
        """Flush what was written a while ago; to be called a few times a second."""
        now = time.monotonic()
        if self._dirty and now - self._flushed > FLUSH_PERIOD_S:
            self.flush()
        elif self._unsynced and now - self._synced > SYNC_PERIOD_S:
            self.sync()

    def flush(self) -> None:
        """Write everything to the file, where a killed process cannot lose it.

        Every half second, fsync as well, so that a power cut cannot take it either.
        """
        self._require_sound()
        try:
            self._writer.flush()
            self._file.flush()
            self._flushed, self._dirty, self._unsynced = time.monotonic(), False, True
            if self._flushed - self._synced > SYNC_PERIOD_S:
                self._sync()
        except OSError as error:
            raise self._lost(error) from None

    def sync(self) -> None:
        """Write everything to the disk (fsync)."""
        self._require_sound()
        try:
            self._writer.flush()
            self._sync()
        except OSError as error:
            raise self._lost(error) from None

    def replace_old(self) -> None:
        """Let the new file replace the bag's file, whose content it holds."""
        if self._part is None:
            return
        self.sync()
        try:
            files.replace(self._part, self.file)
            self._part = None
            if not (self.directory / METADATA).exists():
                self._write_metadata(list(RECORDING))
        except OSError as error:
            raise self._lost(error) from None

    def close(self) -> None:
        """Finish the bag: metadata.yaml first, then the file's end, by which it counts as closed.

        A new file replaces the old one last of all.
        """
        if self._file.closed:
            return
        try:
            self._writer.flush()
            self._write_metadata([topic for topic, _ in self._channels.values()])
            self._writer.finish()
            self._sync()
            self._file.close()
            if self._part is not None:
                files.replace(self._part, self.file)
                self._part = None
        except OSError as error:
            raise self._lost(error) from None

    def abandon(self) -> None:
        """Leave the bag as it is, not closed; a file that was to replace its file is removed."""
        with suppress(OSError):
            self._file.close()
        if self._part is None:
            return
        with suppress(OSError):
            self._part.unlink()
            if not self.file.exists():
                (self.directory / METADATA).unlink(missing_ok=True)
                self.directory.rmdir()

    def _sync(self) -> None:
        files.sync(self._file)
        self._flushed = self._synced = time.monotonic()
        self._dirty = self._unsynced = False

    def _make_folder(self, exists: bool) -> None:
        try:
            self.directory.mkdir(parents=True, exist_ok=exists)
            files.sync_folder(self.directory.parent)
        except FileExistsError:
            raise BagError(
                f"{self.directory}: exists already, not overwriting; name another bag"
            ) from None
        except OSError as error:
            raise BagError(f"{self.directory}: cannot be made ({error.strerror})") from None

    def _open(self) -> BinaryIO:
        try:
            return files.create(self._part or self.file)
        except BlockingIOError:
            raise BagError(f"{self._part}: is being written by another process") from None
        except FileExistsError:
            raise BagError(
                f"{self.file}: exists already, not overwriting; name another bag"
            ) from None
        except OSError as error:
            raise BagError(f"{self.directory}: cannot be made ({error.strerror})") from None

    def _write_metadata(self, topics: list[Topic]) -> None:
        span = range(self._first, self._last)
        data = metadata(self.file.name, topics, self.counts, span)
        files.write_whole(self.directory / METADATA, data)

    def _lost(self, error: OSError) -> BagError:
        """The error of a full disk; nothing is written there any longer."""
        with suppress(OSError):
            self._file.close()
        written = sum(self.counts.values())
        self._failed = BagError(
            f"{self.directory}: cannot be written ({error.strerror}) after {written} messages, of "
            "which the last may be lost"
        )
        return self._failed

    def _require_sound(self) -> None:
        if self._failed is not None:
            raise self._failed

    def _register(self, topic: Topic, definition: bytes | None) -> int:
        if definition is None:
            text, _ = self._types.generate_msgdef(topic.type, ros_version=2)
            definition = text.encode()
        schema = self._writer.register_schema(topic.type, "ros2msg", definition)
        # JSON is YAML, which rosbag2 reads here.
        about = {"offered_qos_profiles": json.dumps(offered_qos(topic))}
        about["topic_type_hash"] = type_hash(topic)
        return self._writer.register_channel(topic.name, "cdr", schema, about)


def require_new_bag(directory: Path) -> None:
    """Refuse, before anything is started, a bag that cannot be made.

    Raises
    ------
    BagError : it exists already, or its place cannot be written
    """
    try:
        there = directory.exists()
        place = next(path for path in directory.absolute().parents if path.exists())
        longest = os.pathconf(place, "PC_NAME_MAX"), os.pathconf(place, "PC_PATH_MAX") - 1
    except OSError as error:
        raise BagError(f"{directory}: cannot be made ({error.strerror})") from None
    if there:
        raise BagError(f"{directory}: exists already, not overwriting; name another bag")
    if not (place.is_dir() and os.access(place, os.W_OK | os.X_OK)):
        raise BagError(f"{directory}: cannot be made, {place} cannot be written")
    file = part_of(bag_file(directory))
    for what, letters, most in zip(("name", "path"), (file.name, str(file)), longest, strict=True):
        if (over := len(os.fsencode(letters)) - most) > 0:
            raise BagError(
                f"{str(directory)[:80]}...: its {what} is {over} bytes too long; allowed: {most} "
                f"bytes with {file.name.removeprefix(directory.name)} at its end"
            )
    if not file.name.isprintable():
        raise BagError(f"{directory!r}: allowed: a name of letters that can be written")
