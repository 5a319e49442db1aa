"""Names of the files of a bag, their integrity, and how a new file replaces an old one.

A bag ``B`` has the file ``B_0.mcap``; one that was split, ``B_1.mcap`` and so on as well.

A recording is complete when its MCAP file ends with a footer and the magic, which are written last.
The name of a file that a recovery writes ends with ``.part`` until it contains everything; then it
replaces the old file in one step. A kill at any moment therefore leaves the old or the new file,
and a ``.part`` file can always be deleted.
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

METADATA = "metadata.yaml"
#: Ending of the files of rosbag2's SQLite storage.
SQLITE = ".db3"
#: The first bytes of such a file.
SQLITE_MAGIC = b"SQLite format 3\0"
#: The end of the name of a file that is not yet complete.
PART = ".part"
#: A footer's opcode and length; 20 bytes and the magic follow.
FOOTER = b"\x02" + (20).to_bytes(8, "little")
#: What a bag is, for the error that refuses something else.
ALLOWED = "allowed: a folder with metadata.yaml and .mcap files, or an .mcap file"


def bag_file(directory: Path, number: int = 0) -> Path:
    """Where an MCAP file of a bag is written, the first one unless another number is given."""
    return directory / f"{directory.name}_{number}.mcap"


def bag_files(directory: Path) -> list[Path]:
    """The MCAP files that were written of a bag, in their order; a gap in it ends them."""
    found = list[Path]()
    while (file := bag_file(directory, len(found))).exists():
        found.append(file)
    return found


def part_of(file: Path) -> Path:
    """The name of a file until it is complete."""
    return file.with_name(file.name + PART)


def is_closed(file: Path) -> bool:
    """Whether an MCAP file was written to its end."""
    with file.open("rb") as stream:
        size = stream.seek(0, os.SEEK_END)
        tail = len(FOOTER) + 20 + len(MCAP0_MAGIC)
        if size < tail + len(MCAP0_MAGIC):
            return False
        stream.seek(-tail, os.SEEK_END)
        end = stream.read()
    return end.startswith(FOOTER) and end.endswith(MCAP0_MAGIC)


def is_unclosed(bag: Path) -> bool:
    """Whether a recording was begun here and not closed, or its recovery was not finished."""
    files = bag_files(bag)
    return bool(files) and not (all(map(is_closed, files)) and (bag / METADATA).exists())


def require_a_bag(path: Path) -> None:
    """Refuse a path that is not a bag and never was one."""
    if what := why_not_a_bag(path):
        raise BagError(f"{path}: {what}; {ALLOWED}")


def why_not_a_bag(path: Path) -> str | None:
    """Return why a path is not a bag and never was one; None if it is or was one."""
    try:
        if not path.exists():
            return "no such bag"
    except OSError as error:
        return f"is not a bag: {error.strerror}"
    if not path.is_dir():
        return _why_not_a_file(path)
    if wrong := [_why_not_mcap(file) for file in sorted(path.glob("*.mcap"))]:
        return wrong[0] if all(wrong) else None
    if any(path.glob(f"*.mcap{PART}")):
        return "is not a bag: a recovery was interrupted here; repeat it"
    there = (path / METADATA).exists()  # then of another storage, as SQLite
    return None if there else "is not a bag: no .mcap file in it"


def _why_not_a_file(path: Path) -> str | None:
    if path.suffix == SQLITE:
        with path.open("rb") as stream:
            known = stream.read(len(SQLITE_MAGIC)) == SQLITE_MAGIC
        return None if known else "is not a bag: it does not begin as an SQLite file does"
    return _why_not_mcap(path) if path.suffix == ".mcap" else "is not a bag: not an .mcap file"


def _why_not_mcap(file: Path) -> str | None:
    with suppress(OSError), file.open("rb") as stream:
        if stream.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
            return f"is not a bag: {file.name} does not begin as an MCAP file does"
    return None


def create(file: Path) -> BinaryIO:
    """Open a file to be written; a ``.part`` that a killed process left is truncated."""
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
    """Write a file to the disk (fsync), where a power cut cannot take it."""
    stream.flush()
    os.fsync(stream.fileno())


def sync_folder(folder: Path) -> None:
    """Write a folder's entries to the disk (fsync), where the folder and its disk allow it."""
    try:
        number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    except PermissionError:  # it may be written, not read
        return
    try:
        os.fsync(number)
    except OSError as error:
        if error.errno != errno.EINVAL:  # some network disks do not support it
            raise
    finally:
        os.close(number)


def replace(part: Path, file: Path) -> None:
    """Let a complete file, which is on the disk, take another's place in one step."""
    os.replace(part, file)
    sync_folder(file.parent)


def write_whole(file: Path, data: bytes) -> None:
    """Write a small file, of which no reader sees a part."""
    with create(part_of(file)) as stream:
        stream.write(data)
        sync(stream)
    replace(part_of(file), file)


# What a damaged bag may raise in its readers, and the error that reports it.

_FORMATS = (McapError, struct.error, zlib.error, zstandard.ZstdError, sqlite3.Error)
_CONTENTS = (LookupError, ValueError, EOFError, OverflowError, MemoryError, RuntimeError)
#: What a file with wrong bytes in it may raise in the readers.
DAMAGE = (*_FORMATS, *_CONTENTS, OSError)
#: What rosbags raises on a file or folder that is not a bag.
UNREADABLE = (*DAMAGE, ReaderError, SerdeError, AssertionError, TypeError, AttributeError)


def reason(error: Exception) -> str:
    """An error's words in one line, or its kind where it has none."""
    words = re.sub(r"\[?PosixPath\('([^']*)'\)\]?", r"\1", " ".join(str(error).split()))
    return words or type(error).__name__


def damaged(bag: Path, error: Exception) -> BagError:
    """The error of a bag that cannot be read: why it is not a bag, or how to recover it."""
    if isinstance(error, BagError):  # of a reader that knows
        return error
    if what := why_not_a_bag(bag):
        return BagError(f"{bag}: {what}; {ALLOWED}")
    if isinstance(error, sqlite3.Error) and (files := sqlite_files(bag)):
        return BagError(
            f"{bag}: an SQLite file is damaged or was cut off ({reason(error)}); "
            f"{sqlite_remedy(bag, files[0])}"
        )
    return BagError(
        f"{bag}: cannot be read as a rosbag2 bag ({reason(error)}); if it was not closed, recover "
        f"it with: cam-rig recover {bag}"
    )


def sqlite_files(bag: Path) -> list[Path]:
    """Return the SQLite files of a bag."""
    return sorted(bag.glob(f"*{SQLITE}")) if bag.is_dir() else [bag] * (bag.suffix == SQLITE)


def sqlite_remedy(bag: Path, file: Path) -> str:
    """Return how to copy what is left of a damaged SQLite file, which cam-rig recover cannot."""
    new = bag.with_name(f"{bag.stem if bag.is_file() else bag.name}_recovered{SQLITE}")
    old, copy = shlex.quote(str(file)), shlex.quote(str(new))
    # A dump of a damaged file ends with ROLLBACK, which would undo the copy.
    return (
        f"copy what is left into a file by: sqlite3 {old} .dump | sed s/^ROLLBACK/COMMIT/ | "
        f"sqlite3 {copy}"
    )


# Whether a new bag can be made where it is wanted.


def require_new_bag(directory: Path, number: int = 0) -> None:
    """Refuse, before anything is started, a bag that cannot have files up to a number."""
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
    file = part_of(bag_file(directory, number))
    for what, letters, most in zip(("name", "path"), (file.name, str(file)), longest, strict=True):
        if (over := len(os.fsencode(letters)) - most) > 0:
            raise BagError(
                f"{str(directory)[:80]}...: its {what} is {over} bytes too long; allowed: {most} "
                f"bytes with {file.name.removeprefix(directory.name)} at its end"
            )
    if not file.name.isprintable():
        raise BagError(f"{str(directory)!r}: allowed: a name of letters that can be written")
