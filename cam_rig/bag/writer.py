"""Writing a rosbag2 directory: MCAP files and metadata.yaml."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from cam_rig.bag import files
from cam_rig.bag.file_writer import FileContent, FileWriter, metadata
from cam_rig.bag.files import METADATA, bag_file, part_of
from cam_rig.bag.split import Split
from cam_rig.errors import BagError
from cam_rig.messages.topics import RECORDING, Topic


class BagWriter:
    """A rosbag2 bag being written; a context manager. Its directory must not exist yet.

    From the start it has a metadata.yaml that other readers take, though it counts nothing yet.
    A file that comes to a limit of ``split`` is followed by another: it repeats the schemas, the
    channels and the attachments, so that it can be read alone. At every moment the newest file is
    not closed. ``rewrite``: instead, what is written replaces the bag's file of a ``number``, as
    `FileWriter` says; it is never split. ``others`` is what the bag's other files hold.
    """

    def __init__(
        self,
        directory: Path,
        rewrite: bool = False,
        split: Split | None = None,
        number: int = 0,
        namespace: str = "",
        others: Iterable[FileContent] = (),
    ) -> None:
        self.directory, self.split = directory, split or Split()
        self._namespace = namespace
        self.counts: dict[str, int] = {}
        self._number, self._others = number, list(others)
        self._topics: dict[str, tuple[Topic, bytes | None]] = {}
        self._attached: dict[str, bytes] = {}
        #: Stamp (ns) of the first state of the file that is written now.
        self._begin: int | None = None
        self._failed: BagError | None = None
        with self._making(directory):
            directory.mkdir(parents=True, exist_ok=rewrite)
            files.sync_folder(directory.parent)
        file = bag_file(directory, number)
        with self._making(file):
            self._file = FileWriter(file, rewrite, namespace)
        try:
            with self._making(directory / METADATA):
                self._file.start(self._others)
                if not rewrite:
                    self._write_metadata(RECORDING)
        except BagError:
            self.abandon()
            raise

    @property
    def file(self) -> Path:
        """The MCAP file that is written now."""
        return self._file.path

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(self, kind: object, *_error: object) -> None:
        if kind is not None:
            self.abandon()
            return
        try:
            self.close()
        except BagError:
            self.abandon()
            raise

    def attach(self, name: str, data: bytes) -> None:
        """Put a file into the bag, so that it can be analysed alone; later files repeat it."""
        with self._writing():
            self._file.attach(name, data)
            self._attached[name] = data

    def write(
        self,
        topic: Topic,
        log_time: int,
        cdr: bytes,
        definition: bytes | None = None,
        number: int = 0,
    ) -> None:
        """Write one serialized message at a rig time in ns.

        ``definition`` is of its type, by default what rosbags knows of it; ``number`` its place
        among all of its topic, by default the next.
        """
        if self._failed is not None:
            raise self._failed
        name = topic.name
        count = self.counts.get(name, 0) + 1
        try:
            if name not in self._topics:
                self._file.register(topic, definition)
                self._topics[name] = topic, definition
            self._file.write(topic, log_time, cdr, number or count)
            self.counts[name] = count
        except OSError as error:
            raise self._lost(error) from None

    def begin_state(self, stamp: int) -> None:
        """Go on in a new file before a state (ns), where this one has come to a limit."""
        begin = stamp if self._begin is None else self._begin
        if self._file.part is None and self.split.is_due(self._file.size, begin, stamp):
            self._begin_file()
            begin = stamp
        self._begin = begin

    def flush_if_due(self) -> None:
        """Flush what was written a while ago; to be called a few times a second."""
        with self._writing():
            self._file.flush_if_due()

    def flush(self) -> None:
        """Write everything to the file, where a killed process cannot lose it."""
        with self._writing():
            self._file.flush()

    def close(self) -> None:
        """Finish the bag: metadata.yaml, then the file's end, by which it counts as closed."""
        if self._file.closed:
            return
        with self._writing():
            self._file.flush()
            self._write_metadata()
            self._file.finish(self._contents())

    def abandon(self) -> None:
        """Leave the bag as it is, not closed; a file that was to replace its file is removed."""
        rewriting = self._file.part is not None
        self._file.abandon()
        if rewriting and not files.bag_files(self.directory):
            with suppress(OSError):
                (self.directory / METADATA).unlink(missing_ok=True)
                self.directory.rmdir()

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """What is done inside may find the disk full; `write` does the same without this cost."""
        if self._failed is not None:
            raise self._failed
        try:
            yield
        except OSError as error:
            raise self._lost(error) from None

    def _lost(self, error: OSError) -> BagError:
        """The error of a full disk; nothing is written there any longer."""
        self._file.close_stream()
        written = sum(self.counts.values())
        self._failed = BagError(
            f"{self.directory}: cannot be written ({error.strerror}) after {written} messages, of "
            "which the last may be lost"
        )
        return self._failed

    def _begin_file(self) -> None:
        """Begin the next file, then close this one: a kill between leaves one not closed."""
        with self._writing():
            old = self._file
            old.flush(to_disk=True)
            self._number += 1
            self._others.append(old.content)
            try:
                self._file = FileWriter(
                    bag_file(self.directory, self._number), False, self._namespace
                )
                self._file.start(self._others)
                for name, data in self._attached.items():
                    self._file.attach(name, data)
                for topic, definition in self._topics.values():
                    self._file.register(topic, definition)
                self._file.flush(to_disk=True)
                files.sync_folder(self.directory)
                old.finish(self._others)
            finally:
                old.close_stream()
            self._write_metadata(RECORDING)

    def _contents(self) -> list[FileContent]:
        found = {content.name: content for content in (*self._others, self._file.content)}
        return sorted(found.values(), key=lambda content: (len(content.name), content.name))

    @contextmanager
    def _making(self, path: Path) -> Iterator[None]:
        """What is done inside may find that a path cannot be made."""
        try:
            yield
        except BlockingIOError:
            raise BagError(f"{part_of(path)}: is being written by another process") from None
        except FileExistsError:
            raise BagError(f"{path}: exists already, not overwriting; name another bag") from None
        except OSError as error:
            raise BagError(f"{self.directory}: cannot be made ({error.strerror})") from None

    def _write_metadata(self, topics: tuple[Topic, ...] = ()) -> None:
        data = metadata(self._contents(), topics, self._namespace)
        files.write_whole(self.directory / METADATA, data)
