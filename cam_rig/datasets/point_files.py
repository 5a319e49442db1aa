"""A folder of Parquet files, one per batch of points, complete at every moment.

A file gets its name only when all of it is on the disk, so readers can take ``folder/*.parquet``
while a study runs, and after it was ended by anything. The only writer holds a lock on the folder.

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

LOCK = ".lock"


FILES = "points-*.parquet"


_NAME = re.compile(r"points-(\d+)-(\d+)-([0-9a-f]{16})\.parquet")


#: What is added to the name of a file whose rows are made again.
DAMAGED = ".damaged"


#: Of such files so many are named.
NAMED = 3


@dataclass(frozen=True, eq=False)
class Batch:
    """Rows of the points ``first`` to ``last`` (exclusive), made in so many s of a processor."""

    first: int
    last: int
    seconds: float


class Study(Protocol):
    """What rows are of, and how many there are to be."""

    @property
    def text(self) -> str:
        """All that a row depends on beside its index, as JSON."""

    @property
    def total(self) -> int:
        """Points in all."""


@dataclass(frozen=True, eq=False)
class PointFiles:
    """The rows of any study in a folder; a subclass says what a row has."""

    folder: Path
    campaign: Study

    def _table(self, rows: Any) -> Any:
        """A batch as a `pyarrow.Table`; its schema has `own` as metadata."""
        raise NotImplementedError

    def write(self, rows: Batch) -> None:
        """Put a batch onto the disk, whole or not at all."""
        import pyarrow.parquet as pq

        sink = io.BytesIO()
        pq.write_table(self._table(rows), sink, write_page_checksum=True)
        data = sink.getvalue()
        digest = _digest(rows.first, rows.last, data)
        target = self.folder / f"points-{rows.first:010d}-{rows.last:010d}-{digest}.parquet"
        part = target.with_name(f".{target.name}.part")
        try:
            part.write_bytes(data)
            _to_disk(part)
            part.replace(target)
            _to_disk(self.folder)
        except OSError as error:
            raise OutputError(
                f"{target}: cannot be written ({error.strerror or error}); what is finished stays"
            ) from None
        finally:
            with suppress(OSError):
                part.unlink(missing_ok=True)

    def batches(self) -> list[tuple[int, int, Path]]:
        """First point, the point after the last, and the file of each batch, in order."""
        named = ((_NAME.fullmatch(path.name), path) for path in self.folder.glob(FILES))
        return sorted((int(match[1]), int(match[2]), path) for match, path in named if match)

    def missing(self) -> list[tuple[int, int]]:
        """The ranges of points that are in no file, in order."""
        gaps, at, end = [], 0, self.campaign.total
        for first, last in [*(batch[:2] for batch in self.batches()), (end, end)]:
            if first > at:
                gaps.append((at, first))
            at = max(at, last)
        return gaps

    def size(self) -> tuple[float, float]:
        """Bytes of the files there are, and about those of all when every point is made.

        A file has bytes of its own, as many as the smallest, and others for each row; the files
        to come are as long as the longest.
        """
        batches = self.batches()
        if not batches:
            return 0.0, 0.0
        sizes = [path.stat().st_size for _, _, path in batches]
        counts = [last - first for first, last, _ in batches]
        own, made = min(sizes), sum(counts)
        left = max(0, self.campaign.total - made)
        row = (sum(sizes) - own * len(sizes)) / made
        return float(sum(sizes)), sum(sizes) + row * left + own * -(-left // max(counts))

    def tables(self, columns: list[str] | None = None) -> Iterator[Any]:
        """The rows of each batch in the order of the points, a `pyarrow.Table`."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        for _, _, path in self.batches():
            # In this thread: one of Arrow's that lets go of Python's bytes while the interpreter
            # ends aborts the process.
            with pq.ParquetFile(
                pa.BufferReader(_intact(path)), page_checksum_verification=True
            ) as file:
                yield file.read(columns, use_threads=False)

    @contextmanager
    def opened(self, resume: bool) -> Iterator[str]:
        """Hold the folder for one writer; what a killed one left half written is removed.

        It gives a line that names the files whose points are to be made again, which are kept
        under another name; empty where all are whole.
        """
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(self.folder / LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
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
            damaged = self._require_own(resume)
            for path in self.folder.glob(".points-*.part"):
                path.unlink()
            for path in damaged:
                path.rename(path.with_name(path.name + DAMAGED))
            yield _made_again(damaged)

    def _require_own(self, resume: bool) -> list[Path]:
        """Refuse a folder of other rows; files that are damaged, or have another file's points."""
        found = sorted(self.folder.glob(FILES))
        if found and not resume:
            raise ConfigError(
                f"{self.folder}: holds {pluralize(len(found), 'file')} of points already; "
                "allowed: --resume to go on with them, or another folder"
            )
        for path in found:
            if not _NAME.fullmatch(path.name):
                raise ConfigError(
                    f"{path}: has no digest in its name, so that its rows cannot be checked (it is "
                    "of an earlier version, or was renamed); allowed: a folder without it"
                )
        damaged, at = [], 0
        for first, last, path in self.batches():
            try:
                about = _about(_intact(path))
            except OutputError:
                damaged.append(path)
                continue
            if about != self.own:
                raise ConfigError(
                    f"{path}: is of another study, or of another version: "
                    f"{differences(about, self.own)}; allowed with --resume: the same, else "
                    "another folder"
                )
            if first < at:
                damaged.append(path)
            at = max(at, last)
        return damaged

    @property
    def own(self) -> dict[str, str]:
        """What every file says of its origin."""
        return {"study": self.campaign.text, **versions()}


#: Packages whose versions rows may depend on.
VERSIONS = ("cam_rig", "numpy", "scipy")


#: Differences between two studies that are named.
DIFFERENCES = 3


def differences(old: Mapping[str, str], new: Mapping[str, str]) -> str:
    """What differs between two origins of rows, with the old and the new value of each."""
    before, after = (
        _leaves(json.loads(one.get("study") or "{}")) | {name: one.get(name) for name in VERSIONS}
        for one in (old, new)
    )
    found = [
        f"{key} is {_shown(after.get(key))}, was {_shown(before.get(key))}"
        for key in dict.fromkeys([*before, *after])
        if before.get(key) != after.get(key)
    ]
    rest = len(found) - DIFFERENCES
    return ", ".join(found[:DIFFERENCES]) + (f" and {rest} more" if rest > 0 else "")


def _leaves(node: Any, path: str = "") -> dict[str, Any]:
    """The numbers and words of plain data by their paths; those of the study without a prefix."""
    if isinstance(node, dict):
        parts = [(f"{path}.{key}" if path else key, one) for key, one in node.items()]
    elif isinstance(node, list):
        parts = [(f"{path}[{i}]", one) for i, one in enumerate(node)]
    else:
        return {path.removeprefix("config."): node}
    return {key: value for name, one in parts for key, value in _leaves(one, name).items()}


def _shown(value: object) -> str:
    return "not there" if value is None else str(value)


def _made_again(damaged: list[Path]) -> str:
    """What is said of files that were set aside; empty for none."""
    if not damaged:
        return ""
    named = ", ".join(path.name for path in damaged[:NAMED])
    more = f" and {len(damaged) - NAMED} more" if len(damaged) > NAMED else ""
    return (
        f"{damaged[0].parent}: {pluralize(len(damaged), 'file')} not as written, or with another "
        f"file's points: {named}{more}; their points are made again, the files kept as *{DAMAGED}"
    )


def _digest(first: int, last: int, data: bytes) -> str:
    """Of a batch's range and its file, as the file's name has it."""
    return hashlib.sha256(b"%d-%d\n" % (first, last) + data).hexdigest()[:16]


def _intact(path: Path) -> bytes:
    match = _NAME.fullmatch(path.name)
    assert match is not None  # only such are batches
    if not path.is_file():  # a pipe would never end
        raise OutputError(f"{path}: is no file; remedy: --resume makes its points again")
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


def _about(data: bytes) -> dict[str, str]:
    """What an intact file's schema says of its origin."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    found = pq.read_metadata(pa.BufferReader(data)).metadata or {}
    return {key: found.get(key.encode(), b"").decode() for key in ("study", *VERSIONS)}


def versions() -> dict[str, str]:
    """Versions of what rows may depend on."""
    found = dict.fromkeys(VERSIONS, "not installed")
    for name in VERSIONS:
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def _to_disk(path: Path) -> None:
    """Wait until a file or a folder's names are on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
