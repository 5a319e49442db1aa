"""/dev/shm, where Fast DDS keeps its segments: room in it, and what killed nodes leave there.

A node without room for its segment uses the loopback alone, and the run is as good; where not even
a page is left for a lock, the kernel ends it with SIGBUS.
"""

from __future__ import annotations

import fcntl
import os
import re
import signal
import time
from contextlib import suppress
from pathlib import Path

from cam_rig.errors import OutputError
from cam_rig.files import MIB

#: Bytes that must be free: a page for each lock of seven nodes, several times over.
MIN_FREE = MIB
REMEDY = "remove what fills it, or give a container more (docker run --shm-size=256m)"
FOLDER = Path("/dev/shm")
#: A segment or a port has a lock file beside it, which its owner holds until it ends.
SEGMENT = re.compile(r"fastdds_(?:[0-9a-f]{16}|port\d{1,5})")
LOCKS = ("_el", "_sl")
#: Age (s) up to which a file may yet get its lock.
LOCK_GRACE_S = 1.0


def require_room(folder: Path = FOLDER) -> None:
    """To be called before nodes are started; other systems keep shared memory elsewhere.

    Raises
    ------
    OutputError : there is less than `MIN_FREE`
    """
    free = _free(folder)
    if free is not None and free < MIN_FREE:
        raise OutputError(
            f"{folder}: has {free / 1024:.0f} KiB free; allowed: at least "
            f"{MIN_FREE // 1024} KiB, so {REMEDY}"
        )


def why_killed(code: int, folder: Path = FOLDER) -> str:
    """The meaning of the signal that ended a node, for the exit summary; empty where unknown."""
    free = _free(folder)
    if code != -signal.SIGBUS or free is None:
        return ""
    return f" (SIGBUS: {folder} was full, {free / 1024:.0f} KiB are free now; {REMEDY})"


def _free(folder: Path) -> int | None:
    """Bytes that this user may still write there; None where there is no such folder."""
    try:
        about = os.statvfs(folder)
    except OSError:
        return None
    return about.f_bavail * about.f_frsize


def clean(since: float, folder: Path = FOLDER) -> list[str]:
    """Remove what ended processes of this user left since a time (s of the epoch); its names.

    What a running process holds is locked, and stays: the same test as `fastdds shm clean` makes.
    """
    removed: list[str] = []
    names = {path.name for path in folder.glob("fastdds_*")}
    for name in sorted({name.removesuffix(LOCKS[0]).removesuffix(LOCKS[1]) for name in names}):
        files = [folder / (name + end) for end in ("", *LOCKS)]
        if SEGMENT.fullmatch(name) and _are_left([path for path in files if path.exists()], since):
            for path in (*files, folder / f"sem.{name}_mutex"):
                with suppress(OSError):
                    path.unlink()
                    removed.append(path.name)
    return removed


def _are_left(files: list[Path], since: float) -> bool:
    """Whether files of this user, the newest made since a time, are not locked."""
    try:
        about = [path.stat() for path in files]
        newest = max(one.st_mtime for one in about)
        mine = all(one.st_uid == os.getuid() for one in about)
        if not mine or not since - 1.0 < newest < time.time() - LOCK_GRACE_S:
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
