"""The files of a bag: their names, which one counts, and how a new file replaces an old one.

A recording is complete when its MCAP file ends with a footer and the magic, which are written last.
What a recovery or the successor of a killed recorder writes has ``.part`` at the end of its name
until it holds everything; then it replaces the old file in one step. So a kill, at whatever moment,
leaves the old file or the new one, and a ``.part`` may always be deleted.
Versions before this one set the truncated file aside as ``.torn`` and wrote the new one in its
place: where there is such a file, it is the one that holds everything.
"""

from __future__ import annotations

import errno
import fcntl
import os
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

from mcap.writer import MCAP0_MAGIC

from cam_rig.errors import BagError

METADATA = "metadata.yaml"
#: The end of the name of a file that is not yet complete.
PART = ".part"
#: The end of the name that older versions gave a truncated file while they copied it.
TORN = ".torn"
#: A footer's opcode and length; 20 bytes and the magic follow.
FOOTER = b"\x02" + (20).to_bytes(8, "little")
#: What a bag is, for the error that refuses something else.
ALLOWED = "allowed: a folder with metadata.yaml and an .mcap file, or an .mcap file"


def bag_file(directory: Path) -> Path:
    """Where a bag's MCAP file is written."""
    return directory / f"{directory.name}_0.mcap"


def part_of(file: Path) -> Path:
    """The name of a file until it is complete."""
    return file.with_name(file.name + PART)


def is_closed(file: Path) -> bool:
    """Whether an MCAP file was written to its end.

    Raises
    ------
    OSError : it cannot be read
    """
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
    file = bag_file(bag)
    if file.with_suffix(TORN).exists():
        return True
    return file.exists() and not (is_closed(file) and (bag / METADATA).exists())


def mcap_file(bag: Path) -> Path:
    """The one file of a bag that holds all that there is of its recording.

    Parameters
    ----------
    bag : a bag's folder, or its MCAP file

    Raises
    ------
    BagError : there is none, or there are several
    """
    if what := why_not_a_bag(bag):
        raise BagError(f"{bag}: {what}; {ALLOWED}")
    files = [bag]
    if bag.is_dir():
        files = sorted({file.with_suffix(".mcap") for file in _mcap_files(bag)})
    if len(files) != 1:
        raise BagError(f"{bag}: holds {len(files)} .mcap files; allowed: one")
    torn = files[0].with_suffix(TORN)
    return torn if torn.exists() else files[0]


def why_not_a_bag(path: Path) -> str | None:
    """Why a path is not a bag and never was one, in words; None where it is or was."""
    try:
        if not path.exists():
            return "no such bag"
    except OSError as error:
        return f"is not a bag: {error.strerror}"
    if path.is_dir():
        return _why_not_a_bag_folder(path)
    return (
        _why_not_mcap(path) if path.suffix in (".mcap", TORN) else "is not a bag: not an .mcap file"
    )


def _why_not_a_bag_folder(path: Path) -> str | None:
    if files := _mcap_files(path):
        wrong = [_why_not_mcap(file) for file in files]
        return wrong[0] if all(wrong) else None
    if any(path.glob(f"*.mcap{PART}")):
        return "is not a bag: a recovery was interrupted here; repeat it"
    if not (path / METADATA).exists():  # else of another storage, as SQLite
        return "is not a bag: no .mcap file in it"
    return None


def _why_not_mcap(file: Path) -> str | None:
    """Why a file is not one of MCAP, in words."""
    with suppress(OSError), file.open("rb") as stream:
        if stream.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
            return f"is not a bag: {file.name} does not begin as an MCAP file does"
    return None


def _mcap_files(folder: Path) -> list[Path]:
    return sorted([*folder.glob("*.mcap"), *folder.glob(f"*{TORN}")])


def create(file: Path) -> BinaryIO:
    """Open a file to be written; a ``.part`` that a killed process left is truncated.

    Raises
    ------
    BlockingIOError : another process is writing it
    OSError : it exists already, or cannot be made
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
    """Write a file to the disk (fsync), where a power cut cannot take it.

    Raises
    ------
    OSError : the disk is full, or gone
    """
    stream.flush()
    os.fsync(stream.fileno())


def sync_folder(folder: Path) -> None:
    """Write a folder's entries to the disk (fsync), where the folder and its disk allow it.

    Raises
    ------
    OSError : the disk is gone
    """
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
    """Let a complete file, which is on the disk, take another's place in one step.

    Raises
    ------
    OSError : it cannot
    """
    os.replace(part, file)
    sync_folder(file.parent)


def remove(file: Path) -> None:
    """Remove a file that another one has replaced.

    Raises
    ------
    BagError : it cannot be removed
    """
    try:
        file.unlink(missing_ok=True)
        sync_folder(file.parent)
    except OSError as error:
        raise BagError(f"{file}: cannot be removed ({error.strerror})") from None


def write_whole(file: Path, data: bytes) -> None:
    """Write a small file, of which no reader sees a part.

    Raises
    ------
    OSError : it cannot be written
    """
    with create(part_of(file)) as stream:
        stream.write(data)
        sync(stream)
    replace(part_of(file), file)
