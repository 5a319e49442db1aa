"""Whether a new bag can be made where it is wanted."""

from __future__ import annotations

import os
from pathlib import Path

from cam_rig.bag.files import bag_file, part_of
from cam_rig.errors import BagError


def require_new_bag(directory: Path, number: int = 0) -> None:
    """Refuse, before anything is started, a bag that cannot be made.

    ``number`` is that of the last file that it may have.

    Raises
    ------
    BagError : it exists already, or its place cannot be written
    """
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
