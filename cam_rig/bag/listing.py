"""The files of a bag: which count, in which order, and whether they agree with metadata.yaml."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from cam_rig.bag.files import (
    DAMAGE,
    METADATA,
    SQLITE,
    is_closed,
    require_a_bag,
    sqlite_files,
    sqlite_remedy,
)
from cam_rig.bag.mcap_file import read_summary
from cam_rig.bag.sqlite_file import SqliteFile
from cam_rig.errors import BagError, ConfigError
from cam_rig.files import MIB, read_bytes

#: A file of a bag that may be split: the bag's name, the file's number.
NUMBERED = re.compile(r"(.+)_(\d{1,9})(\.\w+)")
#: Endings of the storage files of rosbag2.
STORAGE = (".mcap", SQLITE)
#: Largest metadata.yaml that is read, bytes: more than 100 000 files of a bag need.
MAX_METADATA = 64 * MIB


class Extent(NamedTuple):
    """Number of messages of a file, and log time (ns) of the first."""

    messages: int
    start_ns: int


@dataclass(frozen=True)
class Listing:
    """The files of a bag in their order, and what metadata.yaml lists of them.

    ``extents``: by file name, without files that were not counted yet; ``total``: messages of the
    bag, None if it is not listed; ``notes``: one sentence per file that is ignored.
    """

    files: tuple[Path, ...]
    extents: dict[str, Extent]
    total: int | None = None
    notes: tuple[str, ...] = ()


def list_files(bag: Path) -> Listing:
    """Return the files of a bag that metadata.yaml lists, in its order.

    Without metadata.yaml they are all files, in the order of the numbers in their names. A file
    that is named stands alone.
    """
    if not bag.is_dir():
        return Listing((bag,), {})
    there = [file for ending in STORAGE for file in bag.glob(f"*{ending}")]
    listed = _read_metadata(bag / METADATA)
    names = [Path(name).name for name in listed.get("relative_file_paths", [])]
    missing = [name for name in names if not (bag / name).exists()]
    if missing == names:  # there is none, or all files were renamed
        note = f"{METADATA} lists none of the files: they are read by their numbers."
        notes = (note,) if (bag / METADATA).exists() else ()
        return Listing(tuple(in_order(there)), {}, _total(listed), notes)
    if missing:
        raise BagError(
            f"{bag}: {METADATA} lists {', '.join(missing)}, missing here; put {_them(missing)} "
            "back, or name one file instead of the folder"
        )
    extents = dict(_extents(listed.get("files")))
    others = sorted(file for file in there if file.name not in names)
    if any(extent.messages == 0 for extent in extents.values()):  # written while it was recorded
        names += [file.name for file in _later(others, names)]
        others = [file for file in others if file.name not in names]
    counted = {name: extent for name, extent in extents.items() if extent.messages}
    return Listing(
        files=tuple(bag / name for name in names),
        extents=counted,
        total=_total(listed),
        notes=tuple(f"{file.name} is ignored: {METADATA} does not list it." for file in others),
    )


def _total(listed: dict[str, Any]) -> int | None:
    """Return the number of messages of the bag; None if they were not counted yet."""
    total = listed.get("message_count")
    counts = [extent.messages for _, extent in _extents(listed.get("files"))]
    return total if isinstance(total, int) and total > 0 and 0 not in counts else None


def _them(names: list[str]) -> str:
    return "it" if len(names) == 1 else "them"


def _read_metadata(file: Path) -> dict[str, Any]:
    """Return what metadata.yaml says of a bag; empty if there is none, or it cannot be read."""
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    try:
        read = yaml.load(read_bytes(file, MAX_METADATA), loader)
    except (FileNotFoundError, ConfigError, yaml.YAMLError, ValueError, RecursionError):
        return {}
    found = read.get("rosbag2_bagfile_information") if isinstance(read, dict) else None
    if not isinstance(found, dict):
        return {}
    names = found.get("relative_file_paths")
    if not (isinstance(names, list) and all(isinstance(name, str) for name in names)):
        return {}
    return found


def _extents(files: Any) -> Iterator[tuple[str, Extent]]:
    for entry in files if isinstance(files, list) else []:
        with suppress(KeyError, TypeError, ValueError):  # an incomplete entry is not compared
            start = int(entry["starting_time"]["nanoseconds_since_epoch"])
            yield Path(entry["path"]).name, Extent(int(entry["message_count"]), start)


def _later(others: Iterable[Path], names: list[str]) -> list[Path]:
    """Return the files that a recorder had made since it wrote metadata.yaml."""
    last = NUMBERED.fullmatch(names[-1])
    matches = [(file, NUMBERED.fullmatch(file.name)) for file in others]
    return [
        file
        for file, match in sorted(matches, key=lambda entry: (len(entry[0].name), entry[0].name))
        if match and last and match[1] == last[1] and int(match[2]) > int(last[2])
    ]


def in_order(files: Iterable[Path]) -> list[Path]:
    """Return the files of a bag by the numbers at the end of their names."""
    found = sorted(files, key=lambda file: (len(file.name), file.name))
    numbered = [match for file in found if (match := NUMBERED.fullmatch(file.name))]
    names = {match[1] for match in numbered}
    if len(numbered) == len(found) and len(names) == 1:
        numbers = {int(match[2]) for match in numbered}
        missing = [number for number in range(min(numbers), max(numbers)) if number not in numbers]
        if missing:
            raise BagError(
                f"{found[0].parent}: {names.pop()}_{missing[0]}{found[0].suffix} is missing, with "
                f"later files there; put it back, or name one file instead of the folder"
            )
    return found


def number_of(file: Path) -> int:
    """Return the number of a file in its bag; 0 for a file that is named otherwise."""
    match = NUMBERED.fullmatch(file.name)
    return int(match[2]) if match else 0


def mcap_files(bag: Path) -> list[Path]:
    """Return the MCAP files of a bag in their order."""
    require_a_bag(bag)
    files = [file for file in list_files(bag).files if file.suffix == ".mcap"]
    if not files and (other := sqlite_files(bag)):
        raise BagError(
            f"{bag}: has SQLite files only, allowed here: MCAP; of a damaged file, "
            f"{sqlite_remedy(bag, other[0])}"
        )
    if not files:
        raise BagError(f"{bag}: holds 0 .mcap files; allowed: one or more")
    return files


# Whether the files are those that metadata.yaml lists.


def require_agreement(bag: Path, listing: Listing) -> None:
    """Refuse a bag whose files differ from metadata.yaml in order or number of messages."""
    actual = {file.name: _extent(file) for file in listing.files}
    _require_order(bag, listing, actual)
    _require_different(bag, actual)
    known = {name: extent.messages for name, extent in actual.items() if extent is not None}
    wrong = [
        f"{name} has {known[name]} messages, listed are {extent.messages}"
        for name, extent in listing.extents.items()
        if name in known and known[name] != extent.messages
    ]
    total = sum(known.values())
    if not wrong and listing.total is not None and len(known) == len(listing.files):
        names = ", ".join(known)
        wrong = [f"{names} have {total} messages, listed are {listing.total}"]
        wrong = wrong if total != listing.total else []
    if wrong:
        raise BagError(
            f"{bag}: the files are not those of {METADATA}: {'; '.join(wrong)}; put the right "
            "files there, or name one file instead of the folder"
        )


def require_order(bag: Path, listing: Listing) -> None:
    """Refuse a bag two files of which have each other's name; damaged files are not compared."""
    actual = dict[str, Extent | None]()
    for file in listing.files:
        with suppress(*DAMAGE):
            actual[file.name] = _extent(file)
    _require_order(bag, listing, actual)


def _require_order(bag: Path, listing: Listing, actual: dict[str, Extent | None]) -> None:
    owners = {extent: name for name, extent in listing.extents.items()}
    moved = [
        f"{name} is {owners[extent]}"
        for name, extent in actual.items()
        if extent in owners and name in listing.extents and listing.extents[name] != extent
    ]
    if moved:
        raise BagError(
            f"{bag}: files have other names than in {METADATA}: {', '.join(moved)}; give "
            "each file the name that is listed, or name one file instead of the folder"
        )


def _require_different(bag: Path, actual: dict[str, Extent | None]) -> None:
    names = dict[Extent, str]()
    for name, extent in actual.items():
        if extent is not None and extent.messages and names.setdefault(extent, name) != name:
            raise BagError(
                f"{bag}: {names[extent]} and {name} have the same messages; remove the copy"
            )


def _extent(file: Path) -> Extent | None:
    """Return number and first log time (ns) of a file's messages; None if it does not say."""
    if file.suffix == SQLITE:
        with SqliteFile(file) as database:
            return Extent(database.message_count, database.start_ns)
    if not is_closed(file):
        return None
    with file.open("rb") as stream:
        statistics = read_summary(stream).statistics
    if statistics is None:
        return None
    return Extent(statistics.message_count, statistics.message_start_time)
