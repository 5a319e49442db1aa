"""Folders that are this user's alone, for what runs on one machine tell each other."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from cam_rig.errors import OutputError
from cam_rig.files import no_room, temporary_place


def user_folder() -> Path:
    """The user's runtime folder; without one, a folder of the user's own in the temporary place.

    Raises
    ------
    OutputError : there is nowhere to make one, or another user was there first
    """
    found = runtime_folder()
    if found is not None:
        return found
    place = temporary_place()
    own = place / f"cam_rig-{os.getuid()}"
    try:
        own.mkdir(mode=0o700, exist_ok=True)
        if _is_private(own):
            return own
    except FileExistsError:  # no folder
        pass
    except OSError as error:
        raise no_room(place, error) from None
    raise OutputError(
        f"{own}: is no folder of yours alone; remove it, or name another place in TMPDIR"
    )


def runtime_folder() -> Path | None:
    """Where XDG_RUNTIME_DIR points to, if that is this user's alone and can be written to."""
    given = os.environ.get("XDG_RUNTIME_DIR", "")
    path = Path(given)
    try:
        usable = path.is_absolute() and _is_private(path) and os.access(path, os.W_OK | os.X_OK)
    except (OSError, ValueError):  # it is not there; it is no path
        return None
    return path if usable else None


def _is_private(folder: Path) -> bool:
    """Whether it is a folder, and no link, in which nobody else may do anything."""
    about = folder.lstat()
    mine = about.st_uid == os.getuid() and not about.st_mode & 0o077
    return mine and stat.S_ISDIR(about.st_mode)
