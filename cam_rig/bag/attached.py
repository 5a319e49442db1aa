"""The files attached to a bag: read with care, since names, sizes and bytes are not trusted."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import Attachment

from cam_rig.bag.damage import UNREADABLE, damaged
from cam_rig.bag.files import mcap_files
from cam_rig.bag.records import content, fields, records_of
from cam_rig.errors import BagError
from cam_rig.files import MIB, no_room

#: Attached to a recovered bag that lacks something: it says what.
RECOVERED = "recovered.txt"
#: Files attached to a bag, and their bytes; a scene with a hundred cams and their tables has less.
MAX_ATTACHED, MAX_ATTACHED_BYTES = 1000, 64 * MIB
#: Bytes of a path of an attached file, and of one name in it.
MAX_PATH, MAX_NAME = 1000, 255


def unpack(bag: Path, folder: Path) -> Path:
    """Write the files attached to a bag into ``folder/config``; the scene's path.

    Raises
    ------
    BagError : no scene is attached, or a name points out of the folder
    OutputError : the folder has no room
    """
    scene = None
    try:
        for attachment in chain.from_iterable(attachments(file) for file in mcap_files(bag)):
            path = folder / "config" / _safe(bag, attachment.name)
            _write(bag, path, attachment.data)
            scene = path if path.parent.name == "scenes" else scene
    except UNREADABLE as error:
        raise damaged(bag, error) from None
    if scene is None:
        raise BagError(
            f"{bag}: has no scene attached, it was not recorded by cam_rig; name the scene with "
            "--scene"
        )
    return scene


def recovered_words(bag: Path) -> list[str]:
    """The reports of a bag's recoveries: what it lacks, what may be wrong in it.

    Raises
    ------
    BagError : no such bag, or it is damaged
    """
    found = bag.glob("*.mcap") if bag.is_dir() else [bag] if bag.suffix == ".mcap" else []
    try:
        return [
            " ".join(one.data.decode(errors="replace").split())
            for file in sorted(found)
            for one in attachments(file)
            if one.name == RECOVERED
        ]
    except UNREADABLE as error:
        raise damaged(bag, error) from None


def attachments(file: Path) -> Iterator[Attachment]:
    """What is attached to an MCAP file, also to one that was not closed.

    Raises
    ------
    BagError : too much is attached
    ValueError, McapError, struct.error : one is not what was written
    """
    number = size = 0
    with file.open("rb") as stream:
        for record in records_of(stream):
            if record.opcode != Opcode.ATTACHMENT or not record.whole:
                continue
            number, size = number + 1, size + record.length
            if number > MAX_ATTACHED or size > MAX_ATTACHED_BYTES:
                raise BagError(
                    f"{file}: {number} attachments of {size} bytes; allowed: {MAX_ATTACHED} of "
                    f"{MAX_ATTACHED_BYTES}"
                )
            yield attachment_of(content(stream, record))


def _safe(bag: Path, name: str) -> Path:
    """The path of an attached file in its folder.

    Raises
    ------
    BagError : it points out of the folder, or a file cannot have this name
    """
    parts = name.split("/")
    if name.startswith("/") or ".." in parts or "\0" in name:
        raise BagError(f"{bag}: attachment {name[:80]!r} points elsewhere")
    longest = max(len(part.encode()) for part in parts)
    if longest > MAX_NAME or len(name.encode()) > MAX_PATH or not Path(name).name:
        raise BagError(
            f"{bag}: attachment {name[:80]!r} has a name of {longest} bytes; allowed: 1 to "
            f"{MAX_NAME}, and {MAX_PATH} with its folders"
        )
    return Path(name)


def _write(bag: Path, path: Path, data: bytes) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    except (FileExistsError, IsADirectoryError, NotADirectoryError):
        raise BagError(
            f"{bag}: attachment {path.name[:80]!r} is a file here and a folder there"
        ) from None
    except OSError as error:
        raise no_room(path.parent, error) from None


def attachment_of(data: bytes) -> Attachment:
    """An attached file of a record's bytes.

    Raises
    ------
    EndOfFile, ValueError, struct.error : they are not one, or not those that were written
    """
    found = Attachment.read(fields(data))
    crc = int.from_bytes(data[-4:], "little")
    if crc and zlib.crc32(data[:-4]) != crc:
        raise ValueError(f"attachment {found.name[:80]!r} has a wrong checksum")
    return found
