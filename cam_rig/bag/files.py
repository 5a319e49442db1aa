"""Names of the files of a bag, their integrity, and their replacement.

A bag ``B`` has the file ``B_0.mcap``. A bag that was split also has ``B_1.mcap`` and so on.

A recording is complete if its MCAP file ends with a footer and the magic bytes, which are written
last. The name of a file that a recovery writes ends with ``.part`` until it contains everything.
Then it replaces the old file in one step. If the process is killed, either the old or the new file
therefore exists, and a ``.part`` file can always be deleted.
"""

from __future__ import annotations

import errno
import fcntl
import os
import re
import shlex
import sqlite3
import struct
import zlib
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

import zstandard
from mcap.exceptions import McapError
from mcap.writer import MCAP0_MAGIC
from rosbags.rosbag2 import ReaderError
from rosbags.serde import SerdeError

from cam_rig.errors import BagError

#: Name of the file in which rosbag2 describes a bag.
METADATA = "metadata.yaml"
#: File name extension of the SQLite storage of rosbag2.
SQLITE = ".db3"
#: First bytes of an SQLite file.
SQLITE_MAGIC = b"SQLite format 3\0"
#: Ending of the name under which a file is written until it is complete.
PART = ".part"
#: First bytes of the footer of an MCAP file: opcode and length. The 20 bytes of its content and the
#: magic bytes of MCAP follow.
FOOTER = b"\x02" + (20).to_bytes(8, "little")
#: Definition of a bag, for the error message about a path that is not a bag.
BAG = "a bag is a folder with metadata.yaml and .mcap files, or an .mcap file"


def bag_file(directory: Path, number: int = 0) -> Path:
    """Return the path of an MCAP file of the bag in a folder, by its number.

    The first file has the number 0.
    """
    return directory / f"{directory.name}_{number}.mcap"


def bag_files(directory: Path) -> list[Path]:
    """Return the MCAP files of a bag in the order of their numbers.

    The list ends at the first number without a file.
    """
    existing = list[Path]()
    while (file := bag_file(directory, len(existing))).exists():
        existing.append(file)
    return existing


def part_of(file: Path) -> Path:
    """Return the path under which a file is written until it is complete.

    It is the path of ``file`` with the ending `PART`.
    """
    return file.with_name(file.name + PART)


def is_closed(file: Path) -> bool:
    """Return True if an MCAP file was written to its end.

    The check reads the footer and the magic bytes at the end. The result is False for a pipe or a
    device.
    """
    if file.exists() and not file.is_file():  # such as a pipe
        return False
    with file.open("rb") as stream:
        size = stream.seek(0, os.SEEK_END)
        tail = len(FOOTER) + 20 + len(MCAP0_MAGIC)
        if size < tail + len(MCAP0_MAGIC):
            return False
        stream.seek(-tail, os.SEEK_END)
        end = stream.read()
    return end.startswith(FOOTER) and end.endswith(MCAP0_MAGIC)


def is_unclosed(bag: Path) -> bool:
    """Return True if a bag was not closed.

    This is the case if its recording was not closed, or if its recovery was not completed.
    """
    files = bag_files(bag)
    return bool(files) and not (all(map(is_closed, files)) and (bag / METADATA).exists())


def require_regular(bag: Path) -> None:
    """Raise BagError if a file of a bag is a pipe or a device, for which a reader would wait."""
    if problem := _why_not_regular(bag):
        raise BagError(f"{bag}: {problem}")


def _why_not_regular(path: Path) -> str | None:
    patterns = (f"*{SQLITE}", "*.mcap", METADATA)
    files = [file for each in patterns for file in path.glob(each)] if path.is_dir() else [path]
    special = [file for file in files if file.exists() and not (file.is_file() or file.is_dir())]
    return f"{special[0].name} is a pipe or a device; allowed: files" if special else None


def require_a_bag(path: Path) -> None:
    """Raise BagError if a path is not a bag.

    A bag that is damaged or was not closed is accepted.
    """
    if problem := why_not_a_bag(path):
        raise BagError(f"{path}: {problem}; {BAG}")


def why_not_a_bag(path: Path) -> str | None:
    """Return the reason why a path is not a bag.

    Returns None for a bag, and for a path that was a bag before it was damaged.
    """
    try:
        if not path.exists():
            return "no such bag"
        if problem := _why_not_regular(path):
            return problem
    except OSError as error:
        return f"is not a bag: {error.strerror}"
    return _why_not_a_bag_folder(path) if path.is_dir() else _why_not_a_bag_file(path)


def _why_not_a_bag_folder(path: Path) -> str | None:
    if problems := [_why_not_mcap(file) for file in sorted(path.glob("*.mcap"))]:
        return problems[0] if all(problems) else None
    if any(path.glob(f"*.mcap{PART}")):
        return "is not a bag: a recovery was interrupted here; repeat it"
    has_metadata = (path / METADATA).exists()  # a bag of another storage, such as SQLite
    return None if has_metadata else "is not a bag: no .mcap file in it"


def _why_not_a_bag_file(path: Path) -> str | None:
    if path.suffix == SQLITE:
        with path.open("rb") as stream:
            is_sqlite = stream.read(len(SQLITE_MAGIC)) == SQLITE_MAGIC
        return None if is_sqlite else "is not a bag: its first bytes are not those of SQLite"
    return _why_not_mcap(path) if path.suffix == ".mcap" else "is not a bag: not an .mcap file"


def _why_not_mcap(file: Path) -> str | None:
    with suppress(OSError), file.open("rb") as stream:
        if stream.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
            return f"is not a bag: the first bytes of {file.name} are not those of MCAP"
    return None


def create(file: Path) -> BinaryIO:
    """Open a new file for writing.

    Raises FileExistsError if the file exists. Only a ``.part`` file may exist, which a killed
    process has left: it is truncated. Raises BlockingIOError if another process is writing the
    file.
    """
    if file.suffix != PART:
        return file.open("xb")
    stream = file.open("ab")
    try:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        stream.truncate(0)
        stream.seek(0)
    except OSError:
        stream.close()
        raise
    return stream


def sync(stream: BinaryIO) -> None:
    """Write a file to the disk (fsync), so that it survives a power cut."""
    stream.flush()
    os.fsync(stream.fileno())


def sync_folder(folder: Path) -> None:
    """Write the entries of a folder to the disk (fsync).

    The function does nothing if the folder cannot be read or the file system does not support it.
    """
    try:
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    except PermissionError:  # the folder can be written but not read
        return
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno != errno.EINVAL:  # some network disks do not support it
            raise
    finally:
        os.close(descriptor)


def replace(part: Path, file: Path) -> None:
    """Replace a file by a complete file in one step.

    `part` is the new file. Its content must be on the disk (fsync) already.
    """
    os.replace(part, file)
    sync_folder(file.parent)


def write_whole(file: Path, data: bytes) -> None:
    """Write a small file in one step, so that readers never find an incomplete file."""
    with create(part_of(file)) as stream:
        stream.write(data)
        sync(stream)
    replace(part_of(file), file)


# Errors of readers of a damaged bag, and the error that reports them.

_FORMATS = (McapError, struct.error, zlib.error, zstandard.ZstdError, sqlite3.Error)
_CONTENTS = (LookupError, ValueError, EOFError, OverflowError, MemoryError, RuntimeError)
#: Exceptions that the readers of MCAP and SQLite files raise if a file is damaged.
DAMAGE = (*_FORMATS, *_CONTENTS, OSError)
#: Exceptions that can occur while a path is read as a bag: those of `DAMAGE`, and those of rosbags
#: for messages and folders that it cannot read.
UNREADABLE = (*DAMAGE, ReaderError, SerdeError, AssertionError, TypeError, AttributeError)


def error_text(error: Exception) -> str:
    """Return an error's message in one line, or the error's type without a message."""
    text = re.sub(r"\[?PosixPath\('([^']*)'\)\]?", r"\1", " ".join(str(error).split()))
    return text or type(error).__name__


def read_error(bag: Path, error: Exception) -> BagError:
    """Return the error for a bag that cannot be read.

    The error contains the reason why the path is not a bag, or the command that recovers it.
    """
    if isinstance(error, BagError):  # the reader has reported the reason
        return error
    if problem := why_not_a_bag(bag):
        return BagError(f"{bag}: {problem}; {BAG}")
    if isinstance(error, sqlite3.Error) and (files := sqlite_files(bag)):
        return BagError(
            f"{bag}: an SQLite file is damaged or truncated ({error_text(error)}); "
            f"{sqlite_remedy(bag, files[0])}"
        )
    return BagError(
        f"{bag}: cannot be read as a rosbag2 bag ({error_text(error)}); if it was not closed, "
        f"recover it with: cam-rig recover {bag}"
    )


def sqlite_files(bag: Path) -> list[Path]:
    """Return the SQLite files of a bag, an empty list for a bag with MCAP files only."""
    return sorted(bag.glob(f"*{SQLITE}")) if bag.is_dir() else [bag] * (bag.suffix == SQLITE)


def sqlite_remedy(bag: Path, file: Path) -> str:
    """Return the instruction to copy the readable content of a damaged SQLite file.

    The command cam-rig recover cannot read such a file.
    """
    new = bag.with_name(f"{bag.stem if bag.is_file() else bag.name}_recovered{SQLITE}")
    old, copy = shlex.quote(str(file)), shlex.quote(str(new))
    # A dump of a damaged file ends with ROLLBACK, which would undo the copy.
    return (
        f"copy its readable rows into a new file with: sqlite3 {old} .dump | "
        f"sed s/^ROLLBACK/COMMIT/ | sqlite3 {copy}"
    )


# Check that a new bag can be created.


def require_new_bag(directory: Path, number: int = 0) -> None:
    """Raise BagError if a new bag cannot be created at a path.

    `number` is the largest file number for which the file names must have room. The check runs
    before any process of the run is started.
    """
    try:
        is_existing = directory.exists()
        parent = next(path for path in directory.absolute().parents if path.exists())
        limits = os.pathconf(parent, "PC_NAME_MAX"), os.pathconf(parent, "PC_PATH_MAX") - 1
    except OSError as error:
        raise BagError(f"{directory}: cannot be created ({error.strerror})") from None
    if is_existing:
        raise BagError(f"{directory}: exists already, not overwriting; name another bag")
    if not (parent.is_dir() and os.access(parent, os.W_OK | os.X_OK)):
        raise BagError(f"{directory}: cannot be created, {parent} is not writable")
    file = part_of(bag_file(directory, number))
    for label, text, size in zip(("name", "path"), (file.name, str(file)), limits, strict=True):
        if (excess := len(os.fsencode(text)) - size) > 0:
            raise BagError(
                f"{str(directory)[:80]}...: its {label} is {excess} bytes too long; with "
                f"{file.name.removeprefix(directory.name)} it may have {size} bytes"
            )
    if not file.name.isprintable():
        raise BagError(f"{str(directory)!r}: the name must consist of printable characters")
