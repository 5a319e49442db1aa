"""The folder of a run's checkpoints: in memory, of this user alone, removed with the run."""

from __future__ import annotations

import fcntl
import os
import shutil
import tempfile
import time
from contextlib import suppress
from pathlib import Path

from cam_rig.files import no_room
from cam_rig.runner.shared_memory import FOLDER, LOCK_GRACE_S
from cam_rig.runner.user_folder import runtime_folder, user_folder

PREFIX = "cam_rig-checkpoint-"


class CheckpointFolder:
    """A folder that nodes write to every tick.

    The runner holds its lock until it ends, whatever ends it; so the next run recognises a folder
    that a killed runner left, and removes it.

    Raises
    ------
    OutputError : no place for it can be written
    """

    def __init__(self, place: Path | None = None) -> None:
        place = place or _place()
        _clear(place)
        try:
            self.path = Path(tempfile.mkdtemp(prefix=PREFIX, dir=place))
        except OSError as error:
            raise no_room(place, error) from None
        self._lock = os.open(self.path, os.O_RDONLY | os.O_DIRECTORY)
        fcntl.flock(self._lock, fcntl.LOCK_EX)

    def remove(self) -> None:
        """Remove it."""
        shutil.rmtree(self.path, ignore_errors=True)
        os.close(self._lock)


def _place() -> Path:
    """In memory where there is such a place; a folder made there is this user's alone."""
    shared = FOLDER if os.access(FOLDER, os.W_OK) else None
    return runtime_folder() or shared or user_folder()


def _clear(place: Path) -> None:
    """Remove the folders of this user whose runner has ended."""
    for folder in place.glob(f"{PREFIX}*"):
        with suppress(OSError):  # another user's, or another run removes it now
            if _is_left(folder):
                shutil.rmtree(folder, ignore_errors=True)


def _is_left(folder: Path) -> bool:
    about = folder.lstat()
    if about.st_uid != os.getuid() or about.st_mtime > time.time() - LOCK_GRACE_S:
        return False  # one that was just made may yet get its lock
    lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    finally:
        os.close(lock)
    return True
