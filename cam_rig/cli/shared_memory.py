"""Fast DDS leaves files in /dev/shm when a node is killed outright: taken away here."""

from __future__ import annotations

import fcntl
import os
import re
import time
from contextlib import suppress
from pathlib import Path

FOLDER = Path("/dev/shm")
#: A segment or a port has a lock file beside it, which its owner holds while it lives.
KEPT = re.compile(r"fastdds_(?:[0-9a-f]{16}|port\d{1,5})")
LOCKS = ("_el", "_sl")
#: Younger than this (s), a file may yet get its lock.
YOUNG = 1.0


def clean(since: float, folder: Path = FOLDER) -> list[str]:
    """Remove what dead processes of this user left since a time (s of the epoch); its names.

    What a living process holds is locked, and stays: the same test as `fastdds shm clean` makes.
    """
    removed: list[str] = []
    names = {path.name for path in folder.glob("fastdds_*")}
    for name in sorted({name.removesuffix(LOCKS[0]).removesuffix(LOCKS[1]) for name in names}):
        files = [folder / (name + end) for end in ("", *LOCKS)]
        if KEPT.fullmatch(name) and _are_left([path for path in files if path.exists()], since):
            for path in (*files, folder / f"sem.{name}_mutex"):
                with suppress(OSError):
                    path.unlink()
                    removed.append(path.name)
    return removed


def _are_left(files: list[Path], since: float) -> bool:
    """Whether files of this user, the newest made since a time, are held by nobody."""
    try:
        about = [path.stat() for path in files]
        newest = max(one.st_mtime for one in about)
        mine = all(one.st_uid == os.getuid() for one in about)
        if not mine or not since - 1.0 < newest < time.time() - YOUNG:
            return False
        return not any(_is_held(path) for path in files if path.name.endswith(LOCKS))
    except (OSError, ValueError):
        return False


def _is_held(lock: Path) -> bool:
    with lock.open("rb") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False
