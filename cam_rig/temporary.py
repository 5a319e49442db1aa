"""Folders that are gone afterwards; where none can be made, an error says what to do."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from cam_rig.errors import OutputError


@contextmanager
def temporary_folder(prefix: str = "cam_rig_") -> Iterator[Path]:
    """A folder for as long as the context lasts.

    Raises
    ------
    OutputError : there is nowhere to make one
    """
    place = temporary_place()
    try:
        folder = tempfile.TemporaryDirectory(prefix=prefix, dir=place, ignore_cleanup_errors=True)
    except OSError as error:
        raise no_room(place, error) from None
    with folder as name:
        yield Path(name)


def temporary_place() -> Path:
    """Where temporary files are made.

    Raises
    ------
    OutputError : nowhere, for disks are full or may not be written
    """
    try:
        return Path(tempfile.gettempdir())
    except OSError as error:
        raise OutputError(f"{error.strerror or error}; name a folder with room in TMPDIR") from None


def no_room(place: Path, error: OSError) -> OutputError:
    """What to say of a place where no temporary file can be written."""
    return OutputError(
        f"{place}: no temporary file can be written ({error.strerror}); name a folder with room "
        "in TMPDIR"
    )
