"""Folders that are this user's alone, for locks and checkpoints of runs on one machine."""

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
    OutputError : no place for it can be written, or another user was first
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
    except FileExistsError:  # not a folder
        pass
    except OSError as error:
        raise no_room(place, error) from None
    raise OutputError(
        f"{own}: is not a folder of yours alone; remove it, or name another place in TMPDIR"
    )


def runtime_folder() -> Path | None:
    """The folder of XDG_RUNTIME_DIR, if that is this user's alone and can be written."""
    given = os.environ.get("XDG_RUNTIME_DIR", "")
    path = Path(given)
    try:
        usable = path.is_absolute() and _is_private(path) and os.access(path, os.W_OK | os.X_OK)
    except (OSError, ValueError):  # it is not there; it is not a path
        return None
    return path if usable else None


def _is_private(folder: Path) -> bool:
    """Whether it is a folder, not a link, that no other user may access."""
    about = folder.lstat()
    mine = about.st_uid == os.getuid() and not about.st_mode & 0o077
    return mine and stat.S_ISDIR(about.st_mode)
