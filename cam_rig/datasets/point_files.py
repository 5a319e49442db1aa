"""Dataset of computed points: a folder of Parquet files, one per batch of points.

A file gets its name only when all of it is on the disk, so readers can take ``folder/*.parquet``
while a study runs, and after it was interrupted. The only writer locks the folder.

The name ends with a digest of the range of points and the bytes of the file, which detects a
changed bit, a truncated file and the name of another file.
"""

from __future__ import annotations

import fcntl
import hashlib
import io
import json
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Protocol

from cam_rig.errors import ConfigError, OutputError
from cam_rig.show.tables import pluralize

#: Name of the file in the folder that the only writer locks.
LOCK_FILE = ".lock"
#: Glob pattern of the Parquet files of a dataset, one per batch of points.
FILE_PATTERN = "points-*.parquet"
#: Pattern of the name of a file, which contains first point, end (exclusive) and digest.
_NAME = re.compile(r"points-(\d+)-(\d+)-([0-9a-f]{16})\.parquet")
#: Suffix that is added to the name of a damaged file. Its points are computed again.
DAMAGED_SUFFIX = ".damaged"
#: Largest number of damaged files that a message names.
MAX_NAMED_FILES = 3
#: Packages on whose versions the computed rows may depend. Their versions are stored in every file.
PACKAGES = ("cam_rig", "numpy", "scipy")
#: Largest number of differences between two studies that a message names.
MAX_NAMED_DIFFERENCES = 3


@dataclass(frozen=True, eq=False)
class Batch:
    """Rows of consecutive points of a dataset. A subclass adds their content."""

    first: int  #: index of the first point
    last: int  #: end of the points, exclusive
    seconds: float  #: processor time of the computation, s


class Study(Protocol):
    """Computation whose points are the rows of a dataset."""

    @property
    def text(self) -> str:
        """JSON text of all data on which a row depends, apart from its index."""

    @property
    def total(self) -> int:
        """Number of points of a dataset."""


@dataclass(frozen=True, eq=False)
class PointFiles:
    """Rows of a computed study in a folder of Parquet files, one row per point.

    A subclass defines the columns in `_to_table`.
    """

    folder: Path
    campaign: Study

    def _to_table(self, rows: Any) -> Any:
        """Return a batch as a `pyarrow.Table` with `origin` as metadata of its schema."""
        raise NotImplementedError

    def write(self, rows: Batch) -> None:
        """Write the file of a batch atomically, and wait until it is on the disk.

        Raise OutputError if it cannot be written.
        """
        import pyarrow.parquet as pq

        sink = io.BytesIO()
        pq.write_table(self._to_table(rows), sink, write_page_checksum=True)
        data = sink.getvalue()
        digest = _digest(rows.first, rows.last, data)
        target = self.folder / f"points-{rows.first:010d}-{rows.last:010d}-{digest}.parquet"
        part = target.with_name(f".{target.name}.part")
        try:
            part.write_bytes(data)
            _sync(part)
            part.replace(target)
            _sync(self.folder)
        except OSError as error:
            raise OutputError(
                f"{target}: cannot be written ({error.strerror or error}); "
                "finished batches are kept"
            ) from None
        finally:
            with suppress(OSError):
                part.unlink(missing_ok=True)

    def batches(self) -> list[tuple[int, int, Path]]:
        """Return the first point, the end (exclusive) and the file of each stored batch.

        They are in the order of the points.
        """
        paths = self.folder.glob(FILE_PATTERN)
        matches = ((_NAME.fullmatch(path.name), path) for path in paths)
        return sorted((int(match[1]), int(match[2]), path) for match, path in matches if match)

    def missing(self) -> list[tuple[int, int]]:
        """Return the ranges of missing points, in order.

        A range is its first point and its end (exclusive).
        """
        gaps, start, end = [], 0, self.campaign.total
        for first, last in [*(batch[:2] for batch in self.batches()), (end, end)]:
            if first > start:
                gaps.append((start, first))
            start = max(start, last)
        return gaps

    def size(self) -> tuple[float, float]:
        """Return the present size of the dataset and an estimate of its final size, bytes.

        The estimate assumes that a file has as many fixed bytes as the smallest file, and the same
        number of bytes for each row. The missing files have as many rows as the largest one.
        """
        batches = self.batches()
        if not batches:
            return 0.0, 0.0
        sizes = [path.stat().st_size for _, _, path in batches]
        counts = [last - first for first, last, _ in batches]
        fixed, count = min(sizes), sum(counts)
        missing = max(0, self.campaign.total - count)
        row = (sum(sizes) - fixed * len(sizes)) / count
        return float(sum(sizes)), sum(sizes) + row * missing + fixed * -(-missing // max(counts))

    def tables(self, columns: list[str] | None = None) -> Iterator[Any]:
        """Yield a `pyarrow.Table` per batch, in the order of the points.

        Raise OutputError for a file that is damaged or cannot be read.
        """
        import pyarrow as pa
        import pyarrow.parquet as pq

        for _, _, path in self.batches():
            # Without threads of Arrow: a thread that releases Python's bytes while the interpreter
            # shuts down aborts the process.
            with pq.ParquetFile(
                pa.BufferReader(_read_intact(path)), page_checksum_verification=True
            ) as file:
                yield file.read(columns, use_threads=False)

    @contextmanager
    def open(self, resume: bool) -> Iterator[str]:
        """Lock the folder for this writer.

        Incomplete files of a killed writer are removed. Damaged files get the suffix ".damaged",
        and their points become missing points. The context yields a message that names them, or an
        empty text.

        Parameters
        ----------
        resume : bool
            True if the folder may contain files of the same study.

        Raises
        ------
        ConfigError
            If the folder contains files and `resume` is False, or files of another study, of
            another version or without a digest.
        OutputError
            If the folder cannot be written, or has another writer.
        """
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(
                self.folder / LOCK_FILE, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644
            )
        except OSError as error:
            raise OutputError(f"{self.folder}: cannot be written ({error.strerror})") from None
        with os.fdopen(descriptor, "r+b") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise OutputError(
                    f"{self.folder}: another run writes into it; allowed: to wait for its "
                    "end, or another folder"
                ) from None
            damaged = self._find_damaged(resume)
            for path in self.folder.glob(".points-*.part"):
                path.unlink()
            for path in damaged:
                path.rename(path.with_name(path.name + DAMAGED_SUFFIX))
            yield _damage_message(damaged)

    def _find_damaged(self, resume: bool) -> list[Path]:
        """Return the files that are damaged, or have points of another file.

        Raise ConfigError for a folder with rows of another study.
        """
        paths = sorted(self.folder.glob(FILE_PATTERN))
        if paths and not resume:
            raise ConfigError(
                f"{self.folder}: contains {pluralize(len(paths), 'file')} of points already; "
                "allowed: --resume to continue with them, or another folder"
            )
        for path in paths:
            if not _NAME.fullmatch(path.name):
                raise ConfigError(
                    f"{path}: has no digest in its name, so that its rows cannot be checked (it is "
                    "of an earlier version, or was renamed); allowed: a folder without it"
                )
        damaged, end = [], 0
        for first, last, path in self.batches():
            try:
                origin = _read_origin(_read_intact(path))
            except OutputError:
                damaged.append(path)
                continue
            if origin != self.origin:
                raise ConfigError(
                    f"{path}: is of another study, or of another version: "
                    f"{describe_differences(origin, self.origin)}; allowed with --resume: the "
                    "same, else another folder"
                )
            if first < end:
                damaged.append(path)
            end = max(end, last)
        return damaged

    @property
    def origin(self) -> dict[str, str]:
        """Origin of the rows, stored in every file: study and versions of packages."""
        return {"study": self.campaign.text, **versions()}


def describe_differences(old: Mapping[str, str], new: Mapping[str, str]) -> str:
    """Return the differences between two origins as text, with both values of each.

    An origin contains the study and the versions of packages with which rows were computed (see
    `PointFiles.origin`).
    """
    before, after = (
        _leaves(json.loads(origin.get("study") or "{}"))
        | {name: origin.get(name) for name in PACKAGES}
        for origin in (old, new)
    )
    texts = [
        f"{key} is {_value_text(after.get(key))}, was {_value_text(before.get(key))}"
        for key in dict.fromkeys([*before, *after])
        if before.get(key) != after.get(key)
    ]
    more = len(texts) - MAX_NAMED_DIFFERENCES
    return ", ".join(texts[:MAX_NAMED_DIFFERENCES]) + (f" and {more} more" if more > 0 else "")


def _leaves(node: Any, path: str = "") -> dict[str, Any]:
    """Return the numbers and texts of nested JSON data by their paths.

    A path has the form "key.key" or "key[0]". A prefix "config." is removed from it.
    """
    if isinstance(node, dict):
        children = [(f"{path}.{key}" if path else key, child) for key, child in node.items()]
    elif isinstance(node, list):
        children = [(f"{path}[{i}]", child) for i, child in enumerate(node)]
    else:
        return {path.removeprefix("config."): node}
    return {key: value for name, child in children for key, value in _leaves(child, name).items()}


def _value_text(value: object) -> str:
    return "not there" if value is None else str(value)


def _damage_message(damaged: list[Path]) -> str:
    """Return the message on damaged files, or an empty text if the list is empty."""
    if not damaged:
        return ""
    names = ", ".join(path.name for path in damaged[:MAX_NAMED_FILES])
    count = len(damaged) - MAX_NAMED_FILES
    more = f" and {count} more" if count > 0 else ""
    return (
        f"{damaged[0].parent}: {pluralize(len(damaged), 'file')} not as written, or with another "
        f"file's points: {names}{more}; their points are made again, the files kept as "
        f"*{DAMAGED_SUFFIX}"
    )


def _digest(first: int, last: int, data: bytes) -> str:
    """Return the digest in the name of a batch's file.

    It is that of the range of points, ``first`` to ``last`` (exclusive), and the content ``data``.
    """
    return hashlib.sha256(b"%d-%d\n" % (first, last) + data).hexdigest()[:16]


def _read_intact(path: Path) -> bytes:
    """Return the content of a file.

    Raise OutputError if it does not match the digest in its name.
    """
    match = _NAME.fullmatch(path.name)
    assert match is not None  # `batches` returns no other files
    if not path.is_file():  # reading a pipe might never end
        raise OutputError(f"{path}: is not a file; remedy: --resume makes its points again")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise OutputError(f"{path}: cannot be read ({error.strerror or error})") from None
    if _digest(int(match[1]), int(match[2]), data) != match[3]:
        raise OutputError(
            f"{path}: is not as it was written: damaged, cut off or renamed; remedy: --resume "
            "makes its points again"
        )
    return data


def _read_origin(data: bytes) -> dict[str, str]:
    """Return the origin of the rows from the content of an intact file."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    metadata = pq.read_metadata(pa.BufferReader(data)).metadata or {}
    return {key: metadata.get(key.encode(), b"").decode() for key in ("study", *PACKAGES)}


def versions() -> dict[str, str]:
    """Return the installed versions of the packages in `PACKAGES`, by name.

    The version of a missing package is "not installed".
    """
    installed = dict.fromkeys(PACKAGES, "not installed")
    for name in PACKAGES:
        with suppress(PackageNotFoundError):
            installed[name] = version(name)
    return installed


def _sync(path: Path) -> None:
    """Wait until a file, or the names in a folder, are on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
