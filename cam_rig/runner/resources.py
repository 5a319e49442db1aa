"""Machine resources of a run: ROS domain, private folders, log folder, shared memory.

Each namespace of a ROS domain has at most one run and one recorder, because the nodes of a second
would receive the messages of the first. Locks of the user enforce this.
"""

from __future__ import annotations

import errno
import fcntl
import math
import os
import re
import signal
import stat
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from cam_rig.errors import ConfigError, OutputError, RunError
from cam_rig.extras import require
from cam_rig.files import MIB, no_space_error, temporary_root

# Private folders of the user, for the locks of runs on one machine.


def user_folder() -> Path:
    """Return a folder that only this user can access, for locks.

    It is the runtime folder of the user, or else a folder in the temporary folder.

    Raises
    ------
    OutputError
        If the private folder cannot be made, or if other users have access to it.
    """
    runtime = runtime_folder()
    if runtime is not None:
        return runtime
    parent = temporary_root()
    folder = parent / f"cam_rig-{os.getuid()}"
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        if _is_private(folder):
            return folder
    except FileExistsError:  # not a folder
        pass
    except OSError as error:
        raise no_space_error(parent, error) from None
    raise OutputError(
        f"{folder}: is not private to you; remove it, or name another folder in TMPDIR"
    )


def runtime_folder() -> Path | None:
    """Return the folder of XDG_RUNTIME_DIR, or None if it is not private or not writable."""
    path = Path(os.environ.get("XDG_RUNTIME_DIR", ""))
    try:
        usable = path.is_absolute() and _is_private(path) and os.access(path, os.W_OK | os.X_OK)
    except (OSError, ValueError):  # it does not exist, or is not a path
        return None
    return path if usable else None


def _is_private(folder: Path) -> bool:
    """Return True if a path is a folder (not a link) that no other user can access."""
    status = folder.lstat()
    private = status.st_uid == os.getuid() and not status.st_mode & 0o077
    return private and stat.S_ISDIR(status.st_mode)


# Log folder of ROS. A node ends if it cannot write to it.


def log_folder() -> tuple[Path, str]:
    """Return the log folder of ROS, and a warning for the operator (or an empty text).

    It is the folder that ROS would use. If that is not writable, it is a private folder of the
    user, and the warning names both. Without HOME, as in a service or a cron job, it is the private
    folder, unless ROS_LOG_DIR is set.
    """
    private = user_folder() / "cam_rig-ros-log"
    log_dir, home = os.environ.get("ROS_LOG_DIR"), os.environ.get("ROS_HOME")
    if not os.environ.get("HOME") and not log_dir:
        return private, ""
    default = Path(log_dir or Path(home or "~/.ros") / "log").expanduser()
    try:
        default.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=default):
            return default, ""
    except OSError as error:
        reason = f"{default}: is not writable ({error.strerror})"
        return private, f"{reason}; the log files of ROS are in {private}"


#: Largest ROS domain whose ports DDS can use.
MAX_DOMAIN = 232
#: Pattern of a value of ROS_DOMAIN_ID. ROS reads it as C does: a leading 0 means octal, 0x
#: hexadecimal.
DOMAIN_NUMBER = re.compile(r"\s*\+?(0[xX][0-9a-fA-F]+|0[0-7]*|[1-9][0-9]*)", re.ASCII)
#: Maximum number of characters of ROS_DOMAIN_ID. Longer texts are rejected unread.
MAX_DOMAIN_CHARACTERS = 64
#: Pattern of a namespace that ROS accepts, with its leading slash.
NAMESPACE = re.compile(r"(/(?:_?[A-Za-z]|_[0-9])(?:_?[A-Za-z0-9])*_?)+", re.ASCII)
#: Maximum number of characters of a namespace. Namespace and topic together may have 255.
MAX_NAMESPACE = 200
#: Error codes of opening a lock file that is a link, a folder or a file of another user.
FOREIGN_ERRORS = (errno.ELOOP, errno.EISDIR, errno.EACCES, errno.EPERM)


@contextmanager
def reserve_domain(namespace: str = "") -> Iterator[None]:
    """Reserve a namespace of the present ROS domain for one run.

    The kernel releases it at the end of the process at the latest.

    Raises
    ------
    RunError
        If another run has reserved it.
    """
    require("rclpy")
    with _exclusive_lock("domain", domain_number(), namespace) as location:
        if location:
            raise RunError(
                f"another run is active in {location}; give this run a namespace "
                "(--namespace /rig2), or set ROS_DOMAIN_ID to another number"
            )
        yield


@contextmanager
def reserve_recorder(domain: int, namespace: str) -> Iterator[None]:
    """Reserve the role of the only recorder of a rig.

    Raises
    ------
    RunError
        If the rig has a recorder. The drive waits for a recorder, and cannot wait for two.
    """
    with _exclusive_lock("recorder", domain, parse_namespace(namespace)) as location:
        if location:
            raise RunError(
                f"this rig has a recorder already, in {location}; end it first, record the topics "
                "with ros2 bag record, or set ROS_DOMAIN_ID to another number"
            )
        yield


@contextmanager
def _exclusive_lock(role: str, domain: int, namespace: str) -> Iterator[str]:
    """Lock a role of a rig, such as "recorder", and yield an empty text.

    If another process has the lock, yield a text with ROS domain and namespace of the rig.
    """
    name = f"cam_rig-{role}-{domain}{namespace.replace('/', '-')}.lock"
    with open(_open_lock(user_folder() / name), "rb") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            location = ""
        except BlockingIOError:
            location = f"ROS domain {domain}" + (f", namespace {namespace}" if namespace else "")
        yield location


def parse_namespace(text: str) -> str:
    """Return a namespace with its leading slash, such as /rig1 for rig1.

    The root namespace is returned as an empty text.

    Raises
    ------
    ConfigError
        If ROS does not allow the namespace, or if it has more than `MAX_NAMESPACE` characters.
    """
    namespace = f"/{text.strip('/')}".rstrip("/")
    if len(namespace) > MAX_NAMESPACE or (namespace and not NAMESPACE.fullmatch(namespace)):
        raise ConfigError(
            f"namespace must have at most {MAX_NAMESPACE} letters, digits, single _ and /, with a "
            f"letter at the start of each part, got {text[:80]!r} ({len(text)} characters)"
        )
    return namespace


def domain_number(text: str | None = None) -> int:
    """Return the number of the ROS domain from a text in the form of ROS_DOMAIN_ID.

    Without a text the environment variable ROS_DOMAIN_ID is read.

    The text 030 gives 24, 0x10 gives 16, and an empty text 0.

    Raises
    ------
    ConfigError
        If the text is not a number from 0 to `MAX_DOMAIN`.
    """
    text = os.environ.get("ROS_DOMAIN_ID", "") if text is None else text
    match = DOMAIN_NUMBER.fullmatch(text or "0") if len(text) <= MAX_DOMAIN_CHARACTERS else None
    if match is not None:
        digits = match[1].lower()
        number = int(digits, 16 if "x" in digits else 8 if digits[0] == "0" else 10)
        if number <= MAX_DOMAIN:
            return number
    raise ConfigError(f"ROS_DOMAIN_ID must be between 0 and {MAX_DOMAIN}, got {text[:40]!r}")


def domain_ports(domain: int) -> range:
    """Return the ports that DDS uses for this ROS domain only."""
    return range(7400 + 250 * domain, 7650 + 250 * domain)


def _open_lock(path: Path) -> int:
    """Open a lock file of this user and return its descriptor. Create it if missing.

    Links are not followed, and the call does not wait for the other end of a pipe.
    """
    foreign = OutputError(f"{path}: is not a regular file owned by you; remove it")
    flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
    try:
        lock = os.open(path, flags, 0o600)
        status = os.fstat(lock)
    except OSError as error:
        raise (
            foreign if error.errno in FOREIGN_ERRORS else no_space_error(path.parent, error)
        ) from None
    if stat.S_ISREG(status.st_mode) and status.st_uid == os.getuid():
        return lock
    os.close(lock)
    raise foreign


# Shared memory, in which Fast DDS stores its segments: free space, and segments of killed nodes.

#: Number of bytes of shared memory that must be free before a run. The locks of seven nodes need
#: one page of memory each; the limit is several times their sum.
MIN_FREE_BYTES = MIB
#: Remedy in error messages about a full shared memory.
REMEDY = "remove files from it, or give a container more (docker run --shm-size=256m)"
#: Folder of the shared memory on Linux.
SHARED_MEMORY = Path("/dev/shm")
#: Pattern of the file name of a shared memory segment or port of Fast DDS.
SEGMENT = re.compile(r"fastdds_(?:[0-9a-f]{16}|port(\d{1,5}))")
#: Suffixes of the lock file next to a segment or port. Its owner locks it until the owner ends.
LOCK_SUFFIXES = ("_el", "_sl")
#: Age (s) up to which a segment is kept, because its owner may not have locked it yet. It does not
#: apply to ports, which are recognised as open in a process.
LOCK_GRACE_S = 1.0


def require_shared_memory(folder: Path = SHARED_MEMORY) -> None:
    """Raise OutputError if less than `MIN_FREE_BYTES` of shared memory are free.

    Without that folder, as on systems other than Linux, nothing is checked.
    """
    free = _available_bytes(folder)
    if free is not None and free < MIN_FREE_BYTES:
        raise OutputError(
            f"{folder}: must have at least {MIN_FREE_BYTES // 1024} KiB free, got "
            f"{free / 1024:.0f} KiB; {REMEDY}"
        )


def explain_signal(code: int, folder: Path = SHARED_MEMORY) -> str:
    """Return the cause of the signal that ended a node as text.

    The text is empty if the cause is unknown. `code` is the exit code of the node.

    Only SIGBUS has a known cause: a full shared memory.
    """
    free = _available_bytes(folder)
    if code != -signal.SIGBUS or free is None:
        return ""
    return f" (SIGBUS: {folder} was full, {free / 1024:.0f} KiB are free now; {REMEDY})"


def _available_bytes(folder: Path) -> int | None:
    """Return the bytes that the user can write to a folder, or None if it does not exist."""
    try:
        status = os.statvfs(folder)
    except OSError:
        return None
    return status.f_bavail * status.f_frsize


def remove_segments(
    since: float, folder: Path = SHARED_MEMORY, domain: int | None = None
) -> list[str]:
    """Remove the shared memory of this user's ended processes, and return the files.

    Ports are removed only if they belong to one domain. All domains share the other ports, so a
    node of another run may be about to use one. Without its file it would receive no messages,
    whereas a port that is left is initialised again by its next user.

    A port that a process has open is never removed, because the last process to close it removes
    the file that then has its name, which can be a new port.

    Parameters
    ----------
    since : float
        Start of the run (s, Unix time). Older files are kept.
    folder : Path
        Folder of the shared memory.
    domain : int, optional
        ROS domain of the ports (default: no port is removed).
    """
    removed: list[str] = []
    newest_segment = time.time() - LOCK_GRACE_S
    names = {path.name for path in folder.glob("fastdds_*")}
    names = {name.removesuffix(LOCK_SUFFIXES[0]).removesuffix(LOCK_SUFFIXES[1]) for name in names}
    ports = () if domain is None else domain_ports(domain)
    matches = [match for name in names if (match := SEGMENT.fullmatch(name))]
    candidates = {match[0] for match in matches if match[1] is None or int(match[1]) in ports}
    for name in sorted(candidates - (_open_ports(folder) if ports else set())):
        files = [folder / (name + end) for end in ("", *LOCK_SUFFIXES)]
        until = math.inf if "port" in name else newest_segment
        if _are_stale([path for path in files if path.exists()], since, until):
            for path in (*files, folder / f"sem.{name}_mutex"):
                with suppress(OSError):
                    path.unlink()
                    removed.append(path.name)
    return removed


def _open_ports(folder: Path) -> set[str]:
    """Return the names of the Fast DDS shared-memory ports that processes have mapped.

    Only processes that this user can inspect are included.
    """
    port, names = re.compile(rf"{re.escape(str(folder))}/(fastdds_port\d+)$", re.MULTILINE), set()
    for maps in Path("/proc").glob("[0-9]*/maps"):
        with suppress(OSError):
            names.update(port.findall(maps.read_text(errors="replace")))
    return names


def _are_stale(files: list[Path], since: float, until: float) -> bool:
    """Return True if files belong to this user and this run and are not locked.

    They belong to the run if the newest was written between `since` and `until` (s, Unix time).
    """
    try:
        statuses = [path.stat() for path in files]
        newest = max(status.st_mtime for status in statuses)
        owned = all(status.st_uid == os.getuid() for status in statuses)
        if not owned or not since - 1.0 < newest < until:
            return False
        return not any(_is_locked(path) for path in files if path.name.endswith(LOCK_SUFFIXES))
    except (OSError, ValueError):
        return False


def _is_locked(path: Path) -> bool:
    """Return True if another process has locked a file or folder, which must not be a link."""
    lock = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(lock)
    return False
