"""Writer of a rosbag2 directory with MCAP files and metadata.yaml."""

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
    """Writer of a rosbag2 bag, as a context manager.

    The directory of the bag must not exist yet. From the start it contains a metadata.yaml that
    other readers accept, with message counts of 0.

    A file that reaches a limit of `split` is followed by another file. That file repeats the
    schemas, the channels and the attachments, so that it can be read alone. The newest file is
    always unclosed.

    If `rewrite` is True, the directory may exist, and the messages replace its file number
    `number`, as in `FileWriter`. That file is never split. `others` is the content of the other
    files of the bag.
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
        #: Stamp (ns) of the first cam state in the file that is being written.
        self._file_start: int | None = None
        self._failed: BagError | None = None
        with self._creation_errors(directory):
            directory.mkdir(parents=True, exist_ok=rewrite)
            files.sync_folder(directory.parent)
        file = bag_file(directory, number)
        with self._creation_errors(file):
            self._file = FileWriter(file, rewrite, namespace)
        try:
            with self._creation_errors(directory / METADATA):
                self._file.start(self._others)
                if not rewrite:
                    self._write_metadata(RECORDING)
        except BagError:
            self.abandon()
            raise

    @property
    def file(self) -> Path:
        """MCAP file that is being written."""
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
        """Attach a file to the bag, so that the bag can be analysed alone.

        Later files of the bag repeat it.
        """
        with self._write_errors():
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
        """Write one serialized message at a rig time `log_time` (ns).

        `definition` is the definition of its type (default: the definition that rosbags has).
        `number` is its number within its topic (default: the next).
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
            raise self._write_error(error) from None

    def begin_state(self, stamp: int) -> None:
        """Continue in a new file of the bag if the current file has reached a limit.

        The method is called before the messages of the state at `stamp` (ns) are written. A tick is
        therefore never divided between two files. A tick is the time between two cam states.
        """
        start = stamp if self._file_start is None else self._file_start
        if self._file.part is None and self.split.is_due(self._file.size, start, stamp):
            self._start_next_file()
            start = stamp
        self._file_start = start

    def flush_if_due(self) -> None:
        """Flush the current file if `FLUSH_PERIOD_S` has passed since the last flush.

        The method must be called a few times per second.
        """
        with self._write_errors():
            self._file.flush_if_due()

    def flush(self) -> None:
        """Write buffered messages to the file, to survive the end of the process."""
        with self._write_errors():
            self._file.flush()

    def close(self) -> None:
        """Write metadata.yaml, then the end of the file.

        After the end is written the bag counts as closed.
        """
        if self._file.closed:
            return
        with self._write_errors():
            self._file.flush()
            self._write_metadata()
            self._file.finish(self._contents())

    def abandon(self) -> None:
        """Leave the bag in its present state, so that it does not count as closed.

        A file that should have replaced a file of the bag is removed.
        """
        rewriting = self._file.part is not None
        self._file.abandon()
        if rewriting and not files.bag_files(self.directory):
            with suppress(OSError):
                (self.directory / METADATA).unlink(missing_ok=True)
                self.directory.rmdir()

    @contextmanager
    def _write_errors(self) -> Iterator[None]:
        """Convert an OSError within the block into a BagError.

        `write` does the same without the cost of a context manager.
        """
        if self._failed is not None:
            raise self._failed
        try:
            yield
        except OSError as error:
            raise self._write_error(error) from None

    def _write_error(self, error: OSError) -> BagError:
        """Close the stream, and return the error for a bag that cannot be written."""
        self._file.close_stream()
        written = sum(self.counts.values())
        self._failed = BagError(
            f"{self.directory}: cannot be written ({error.strerror}) after {written} messages, of "
            "which the last may be lost"
        )
        return self._failed

    def _start_next_file(self) -> None:
        """Start the next file, then close the current file.

        If the process is killed in between, one file is unclosed.
        """
        with self._write_errors():
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
        contents = {content.name: content for content in (*self._others, self._file.content)}
        return sorted(contents.values(), key=lambda content: (len(content.name), content.name))

    @contextmanager
    def _creation_errors(self, path: Path) -> Iterator[None]:
        """Convert an OSError within the block into a BagError.

        `path` is the file or folder that is being created, which the error names.
        """
        try:
            yield
        except BlockingIOError:
            raise BagError(f"{part_of(path)}: is being written by another process") from None
        except FileExistsError:
            raise BagError(f"{path}: exists already, not overwriting; name another bag") from None
        except OSError as error:
            raise BagError(f"{self.directory}: cannot be created ({error.strerror})") from None

    def _write_metadata(self, topics: tuple[Topic, ...] = ()) -> None:
        data = metadata(self._contents(), topics, self._namespace)
        files.write_whole(self.directory / METADATA, data)
