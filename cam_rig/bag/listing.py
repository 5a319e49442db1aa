"""Files of a bag: their selection, order, and agreement with metadata.yaml."""

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
    require_regular,
    sqlite_files,
    sqlite_remedy,
)
from cam_rig.bag.mcap_file import read_summary
from cam_rig.bag.sqlite_file import SqliteFile
from cam_rig.errors import BagError, ConfigError
from cam_rig.files import MIB, read_bytes

#: Pattern of the file name of a bag that may be split: name of the bag, number, extension.
NUMBERED = re.compile(r"(.+)_(\d{1,9})(\.\w+)")
#: Pattern of the file name of a split bag from ROS 2 Lyrical on: number, name of the bag and time.
COUNTED = re.compile(r"(\d{1,9})_.+\.\w+")
#: File name extensions of the storages of rosbag2.
STORAGE = (".mcap", SQLITE)
#: Largest size of metadata.yaml that is read, bytes. A bag of 100 000 files needs less.
MAX_METADATA = 64 * MIB


class Extent(NamedTuple):
    """Number of messages in a file, and log time (ns) of the first message."""

    messages: int
    start_ns: int


@dataclass(frozen=True)
class Listing:
    """Files of a bag in their order, with the content of metadata.yaml.

    `extents` contains the messages and the start time that metadata.yaml lists per file name,
    without files that it lists with 0 messages. `total` is the number of messages of the bag, or
    None if metadata.yaml does not list it. `notes` contains one sentence per file that is ignored.
    """

    files: tuple[Path, ...]
    extents: dict[str, Extent]
    total: int | None = None
    notes: tuple[str, ...] = ()


def list_files(bag: Path) -> Listing:
    """Return the files that a bag's metadata.yaml lists, in the order of that list.

    Without metadata.yaml the result is all files, in the order of the numbers in their names. If
    `bag` is a file, the result is that file alone.
    """
    require_regular(bag)
    if not bag.is_dir():
        return Listing((bag,), {})
    existing = [file for ending in STORAGE for file in bag.glob(f"*{ending}")]
    information = _read_metadata(bag / METADATA)
    listed = [Path(name).name for name in information.get("relative_file_paths", [])]
    names = list(dict.fromkeys(listed))
    missing = [name for name in names if not (bag / name).exists()]
    if missing == names:  # no metadata.yaml, or all files were renamed
        note = f"{METADATA} lists none of the files; they are read in the order of their numbers."
        notes = (note,) if (bag / METADATA).exists() else ()
        return Listing(tuple(sort_by_number(existing)), {}, _total(information), notes)
    if missing:
        raise BagError(
            f"{bag}: files of {METADATA} are missing: {', '.join(missing)}; restore them, or name "
            "one file instead of the folder"
        )
    extents = dict(_extents(information.get("files")))
    others = sorted(file for file in existing if file.name not in names)
    # A recorder lists the newest file without messages until it closes the bag.
    if any(extent.messages == 0 for extent in extents.values()):
        names += [file.name for file in _later(others, names)]
        others = [file for file in others if file.name not in names]
    repeated = sorted({name for name in names if listed.count(name) > 1})
    counted = {name: extent for name, extent in extents.items() if extent.messages}
    return Listing(
        files=tuple(bag / name for name in names),
        extents=counted,
        total=_total(information),
        notes=(
            *(f"{file.name} is ignored: {METADATA} does not list it." for file in others),
            *(f"{name} is read once: {METADATA} lists it several times." for name in repeated),
        ),
    )


def _total(information: dict[str, Any]) -> int | None:
    """Return the number of messages of a bag that metadata.yaml lists.

    Returns None if it does not list the messages of every file yet, as during a recording.
    """
    total = information.get("message_count")
    counts = [extent.messages for _, extent in _extents(information.get("files"))]
    return total if isinstance(total, int) and total > 0 and 0 not in counts else None


def _read_metadata(file: Path) -> dict[str, Any]:
    """Return the description of a bag in metadata.yaml.

    The result is empty if the file does not exist or cannot be read.
    """
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    try:
        data = yaml.load(read_bytes(file, MAX_METADATA), loader)
    except (FileNotFoundError, ConfigError, yaml.YAMLError, ValueError, RecursionError):
        return {}
    information = data.get("rosbag2_bagfile_information") if isinstance(data, dict) else None
    if not isinstance(information, dict):
        return {}
    names = information.get("relative_file_paths")
    if not (isinstance(names, list) and all(isinstance(name, str) for name in names)):
        return {}
    return information


def _extents(files: Any) -> Iterator[tuple[str, Extent]]:
    for entry in files if isinstance(files, list) else []:
        with suppress(KeyError, TypeError, ValueError):  # an incomplete entry is not compared
            start = int(entry["starting_time"]["nanoseconds_since_epoch"])
            yield Path(entry["path"]).name, Extent(int(entry["message_count"]), start)


def _later(others: Iterable[Path], names: list[str]) -> list[Path]:
    """Return the files of a bag that were created after metadata.yaml was written.

    `names` are the files that it lists.
    """
    last = NUMBERED.fullmatch(names[-1])
    if last is None and (counter := COUNTED.fullmatch(names[-1])):
        counted = [(COUNTED.fullmatch(file.name), file) for file in others]
        later = [(int(match[1]), file) for match, file in counted if match]
        return [file for number, file in sorted(later) if number > int(counter[1])]
    matches = [(file, NUMBERED.fullmatch(file.name)) for file in others]
    return [
        file
        for file, match in sorted(matches, key=lambda entry: (len(entry[0].name), entry[0].name))
        if match and last and match[1] == last[1] and int(match[2]) > int(last[2])
    ]


def sort_by_number(files: Iterable[Path]) -> list[Path]:
    """Return the files of a bag sorted by the numbers in their names.

    Raises BagError if a number is missing.
    """
    ordered = sorted(files, key=lambda file: (len(file.name), file.name))
    matches = [NUMBERED.fullmatch(file.name) for file in ordered]
    names = {match[1] if match else "" for match in matches}
    numbers, template = [int(match[2]) for match in matches if match], "{}_{}{}"
    if len(names) != 1 or not all(matches):
        counters = [COUNTED.fullmatch(file.name) for file in ordered]
        numbers, names = [int(match[1]) for match in counters if match], {"*"}
        template = "{1}_{0}{2}"
    if len(set(numbers)) < len(ordered):  # other names, or copies
        return ordered
    missing = sorted(set(range(min(numbers, default=0), max(numbers, default=0))) - {*numbers})
    if missing:
        name = template.format(names.pop(), missing[0], ordered[0].suffix)
        raise BagError(
            f"{ordered[0].parent}: {name} is missing, but later files exist; restore it, or name "
            "one file instead of the folder"
        )
    return [file for _, file in sorted(zip(numbers, ordered, strict=True))]


def number_of(file: Path) -> int:
    """Return the number at the end of the name of a bag's file.

    Returns 0 for a file with another kind of name.
    """
    match = NUMBERED.fullmatch(file.name)
    return int(match[2]) if match else 0


def mcap_files(bag: Path) -> list[Path]:
    """Return the MCAP files of a bag in the order of `list_files`.

    Raises BagError if the bag has no MCAP file.
    """
    require_a_bag(bag)
    files = [file for file in list_files(bag).files if file.suffix == ".mcap"]
    if not files and (sqlite := sqlite_files(bag)):
        raise BagError(
            f"{bag}: has SQLite files only, which cannot be recovered by cam-rig; if a file is "
            f"damaged, {sqlite_remedy(bag, sqlite[0])}"
        )
    if not files:
        raise BagError(f"{bag}: must have at least one .mcap file, got none")
    return files


# Comparison of the files with metadata.yaml.


def require_agreement(bag: Path, listing: Listing) -> None:
    """Raise BagError if the files of a bag differ from metadata.yaml.

    They differ if files have exchanged names, if two files are copies, or if the number of messages
    of a file or of the bag differs.
    """
    actual = {file.name: _extent(file) for file in listing.files}
    _require_order(bag, listing, actual)
    _require_no_copies(bag, actual)
    counts = {name: extent.messages for name, extent in actual.items() if extent is not None}
    problems = [
        f"{name} must have {extent.messages} messages, got {counts[name]}"
        for name, extent in listing.extents.items()
        if name in counts and counts[name] != extent.messages
    ]
    total = sum(counts.values())
    if not problems and listing.total is not None and len(counts) == len(listing.files):
        names = ", ".join(counts)
        problems = [f"{names} must have {listing.total} messages, got {total}"]
        problems = problems if total != listing.total else []
    if problems:
        raise BagError(
            f"{bag}: the files differ from {METADATA}: {'; '.join(problems)}; restore the original "
            "files, or name one file instead of the folder"
        )


def require_order(bag: Path, listing: Listing) -> None:
    """Raise BagError if some files of a bag have exchanged names.

    A file is recognized by the number of messages and the start time that metadata.yaml lists.
    Damaged files are not compared.
    """
    actual = dict[str, Extent | None]()
    for file in listing.files:
        with suppress(*DAMAGE):
            actual[file.name] = _extent(file)
    _require_order(bag, listing, actual)


def _require_order(bag: Path, listing: Listing, actual: dict[str, Extent | None]) -> None:
    listed_names = {extent: name for name, extent in listing.extents.items()}
    moved = [
        f"{name} is {listed_names[extent]}"
        for name, extent in actual.items()
        if extent in listed_names and name in listing.extents and listing.extents[name] != extent
    ]
    if moved:
        raise BagError(
            f"{bag}: files are not named as in {METADATA}: {', '.join(moved)}; rename them, or "
            "name one file instead of the folder"
        )


def _require_no_copies(bag: Path, actual: dict[str, Extent | None]) -> None:
    names = dict[Extent, str]()
    for name, extent in actual.items():
        if extent is not None and extent.messages and names.setdefault(extent, name) != name:
            raise BagError(
                f"{bag}: {names[extent]} and {name} have the same messages; remove the copy"
            )


def _extent(file: Path) -> Extent | None:
    """Return the number of messages and the first log time (ns) of a bag's file.

    Returns None for an MCAP file that is not closed or has no statistics.
    """
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
