"""One run, and one recorder, in each namespace of a ROS domain: two would hear each other."""

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
from cam_rig.files import MIB, no_room, temporary_place

# Folders that are this user's alone, for locks of runs on one machine.


def user_folder() -> Path:
    """The user's runtime folder; without one, a folder of the user's own in the temporary place."""
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


# Where ROS writes its log files: a node ends where it cannot.


def log_folder() -> tuple[Path, str]:
    """Where ROS writes log files, and what to say where that is not where it would."""
    own = user_folder() / "cam_rig-ros-log"
    given, home = os.environ.get("ROS_LOG_DIR"), os.environ.get("ROS_HOME")
    if not os.environ.get("HOME") and not given:  # a service, or a cron job
        return own, ""
    wanted = Path(given or Path(home or "~/.ros") / "log").expanduser()
    try:
        wanted.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=wanted):
            return wanted, ""
    except OSError as error:
        return own, f"{wanted}: cannot be written ({error.strerror}); ROS's log files are in {own}"


#: The greatest ROS domain, by the ports of DDS.
MAX_DOMAIN = 232
#: A number as ROS reads it: as in C, where a leading 0 makes it octal.
NUMBER = re.compile(r"\s*\+?(0[xX][0-9a-fA-F]+|0[0-7]*|[1-9][0-9]*)", re.ASCII)
#: Characters of such a number, at most.
MAX_CHARACTERS = 64
#: A namespace of ROS; a topic's name ends it, and may have 255 characters with it.
NAMESPACE = re.compile(r"(/(?:_?[A-Za-z]|_[0-9])(?:_?[A-Za-z0-9])*_?)+", re.ASCII)
MAX_NAMESPACE = 200
#: What opening a file raises that is not this user's own: a link, a folder, another user's.
FOREIGN = (errno.ELOOP, errno.EISDIR, errno.EACCES, errno.EPERM)


@contextmanager
def own_domain(namespace: str = "") -> Iterator[None]:
    """Hold a namespace of this ROS domain; the kernel releases it with the process."""
    require("rclpy")
    with _only("domain", domain_number(), namespace) as where:
        if where:
            raise RunError(
                f"another run is active in {where}; allowed: one, so give this one a namespace "
                "(--namespace /rig2), or set ROS_DOMAIN_ID to another number"
            )
        yield


@contextmanager
def own_recorder(domain: int, namespace: str) -> Iterator[None]:
    """Be the one recorder of a rig: the drive waits for what it has written."""
    with _only("recorder", domain, namespace_named(namespace)) as where:
        if where:
            raise RunError(
                f"this rig has a recorder already, in {where}; allowed: one, as the drive waits "
                "for what it has written; end it first, record the topics with ros2 bag record, or "
                "set ROS_DOMAIN_ID to another number"
            )
        yield


@contextmanager
def _only(what: str, domain: int, namespace: str) -> Iterator[str]:
    """Hold a lock of a rig; where another process has it, yields the rig's place in words."""
    name = f"cam_rig-{what}-{domain}{namespace.replace('/', '-')}.lock"
    with open(_lock(user_folder() / name), "rb") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            where = ""
        except BlockingIOError:
            where = f"ROS domain {domain}" + (f", namespace {namespace}" if namespace else "")
        yield where


def namespace_named(text: str) -> str:
    """The namespace that a text names, with its slash: rig1 and /rig1 alike; empty for the root."""
    namespace = f"/{text.strip('/')}".rstrip("/")
    if len(namespace) > MAX_NAMESPACE or (namespace and not NAMESPACE.fullmatch(namespace)):
        raise ConfigError(
            f"namespace: is {text[:80]!r}, {len(text)} characters; allowed: letters, digits, "
            f"single _ and /, each part begins with a letter, {MAX_NAMESPACE} characters at most"
        )
    return namespace


def domain_number(text: str | None = None) -> int:
    """The ROS domain that a value of ROS_DOMAIN_ID stands for: 030 is 24, 0x10 is 16, none is 0."""
    text = os.environ.get("ROS_DOMAIN_ID", "") if text is None else text
    found = NUMBER.fullmatch(text or "0") if len(text) <= MAX_CHARACTERS else None
    if found is not None:
        digits = found[1].lower()
        number = int(digits, 16 if "x" in digits else 8 if digits[0] == "0" else 10)
        if number <= MAX_DOMAIN:
            return number
    raise ConfigError(f"ROS_DOMAIN_ID: is {text[:40]!r}; allowed: 0 to {MAX_DOMAIN}")


def domain_ports(domain: int) -> range:
    """The ports that are a ROS domain's own."""
    return range(7400 + 250 * domain, 7650 + 250 * domain)


def _lock(path: Path) -> int:
    """The file, open: neither through a link nor waiting for the other end of a pipe."""
    foreign = OutputError(f"{path}: is not a file of yours; remove it")
    flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
    try:
        lock = os.open(path, flags, 0o600)
        about = os.fstat(lock)
    except OSError as error:
        raise (foreign if error.errno in FOREIGN else no_room(path.parent, error)) from None
    if stat.S_ISREG(about.st_mode) and about.st_uid == os.getuid():
        return lock
    os.close(lock)
    raise foreign


# /dev/shm, where Fast DDS keeps its segments: room in it, and what killed nodes leave there.

#: Bytes that must be free: a page for each lock of seven nodes, several times over.
MIN_FREE = MIB
REMEDY = "remove what fills it, or give a container more (docker run --shm-size=256m)"
FOLDER = Path("/dev/shm")
#: A segment or a port has a lock file beside it, which its owner holds until it ends.
SEGMENT = re.compile(r"fastdds_(?:[0-9a-f]{16}|port(\d{1,5}))")
LOCKS = ("_el", "_sl")
#: Age (s) up to which a segment may yet get its lock; who makes a port has it open.
LOCK_GRACE_S = 1.0


def require_room(folder: Path = FOLDER) -> None:
    """To be called before nodes are started; other systems keep shared memory elsewhere."""
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


def clean(since: float, folder: Path = FOLDER, domain: int | None = None) -> list[str]:
    """Remove what ended processes of this user left since a time (s), if unlocked; its names.

    Of ports only a domain's own: all domains share the others, so a node of another run may be
    about to take one, and would hear nothing; who takes it next sets it up anew. One that a process
    has open is never removed: the last that closes it removes what then is there by its name, a new
    one too.
    """
    removed: list[str] = []
    lockable = time.time() - LOCK_GRACE_S
    names = {path.name for path in folder.glob("fastdds_*")}
    names = {name.removesuffix(LOCKS[0]).removesuffix(LOCKS[1]) for name in names}
    ports = () if domain is None else domain_ports(domain)
    found = [match for name in names if (match := SEGMENT.fullmatch(name))]
    left = {match[0] for match in found if match[1] is None or int(match[1]) in ports}
    for name in sorted(left - (_open_ports(folder) if ports else set())):
        files = [folder / (name + end) for end in ("", *LOCKS)]
        until = math.inf if "port" in name else lockable
        if _are_left([path for path in files if path.exists()], since, until):
            for path in (*files, folder / f"sem.{name}_mutex"):
                with suppress(OSError):
                    path.unlink()
                    removed.append(path.name)
    return removed


def _open_ports(folder: Path) -> set[str]:
    """Names of the ports that processes have mapped, of those that this user may look into."""
    port, found = re.compile(rf"{re.escape(str(folder))}/(fastdds_port\d+)$", re.MULTILINE), set()
    for maps in Path("/proc").glob("[0-9]*/maps"):
        with suppress(OSError):
            found.update(port.findall(maps.read_text(errors="replace")))
    return found


def _are_left(files: list[Path], since: float, until: float) -> bool:
    """Whether files of this user, the newest made between two times, are not locked."""
    try:
        about = [path.stat() for path in files]
        newest = max(one.st_mtime for one in about)
        mine = all(one.st_uid == os.getuid() for one in about)
        if not mine or not since - 1.0 < newest < until:
            return False
        return not any(_is_locked(path) for path in files if path.name.endswith(LOCKS))
    except (OSError, ValueError):
        return False


def _is_locked(path: Path) -> bool:
    """Whether another process holds the lock of a file or folder, which is no link."""
    lock = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(lock)
    return False
