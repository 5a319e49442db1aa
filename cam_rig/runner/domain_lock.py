"""One run per ROS domain: two would receive each other's cam states."""

from __future__ import annotations

import errno
import fcntl
import os
import re
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from cam_rig.errors import ConfigError, OutputError, RunError
from cam_rig.files import no_room
from cam_rig.runner.user_folder import user_folder

#: The greatest ROS domain, by the ports of DDS.
MAX_DOMAIN = 232
#: A number as ROS reads it: as in C, where a leading 0 makes it octal.
NUMBER = re.compile(
    r"\s*\+?(?:0[xX](?P<hex>[0-9a-fA-F]+)|0(?P<oct>[0-7]*)|(?P<dec>[1-9][0-9]*))", re.ASCII
)
#: Characters of such a number, at most.
MAX_CHARACTERS = 64
#: What opening a file raises that is not this user's own: a link, a folder, another user's.
FOREIGN = (errno.ELOOP, errno.EISDIR, errno.EACCES, errno.EPERM)


@contextmanager
def own_domain() -> Iterator[None]:
    """Hold the ROS domain of this environment; the kernel releases it with the process.

    Raises
    ------
    ConfigError : it is not a domain
    RunError : another run on this machine holds it
    OutputError : the lock cannot be written
    """
    domain = domain_number(os.environ.get("ROS_DOMAIN_ID", ""))
    place = user_folder()
    with open(_lock(place / f"cam_rig-domain-{domain}.lock"), "rb") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise RunError(
                f"another run is active in ROS domain {domain}; allowed: one per domain, so set "
                "ROS_DOMAIN_ID to another number"
            ) from None
        yield


def domain_number(text: str) -> int:
    """The ROS domain that a value of ROS_DOMAIN_ID stands for: 030 is 24, 0x10 is 16, none is 0.

    Raises
    ------
    ConfigError : it is not a domain
    """
    found = NUMBER.fullmatch(text or "0") if len(text) <= MAX_CHARACTERS else None
    if found is not None:
        digits = [(found["hex"], 16), (found["oct"], 8), (found["dec"], 10)]
        number = next((int(d or "0", base) for d, base in digits if d is not None), 0)
        if number <= MAX_DOMAIN:
            return number
    raise ConfigError(f"ROS_DOMAIN_ID: is {text[:40]!r}; allowed: 0 to {MAX_DOMAIN}")


def _lock(path: Path) -> int:
    """The file, open: neither through a link nor waiting for the other end of a pipe.

    Raises
    ------
    OutputError : it cannot be made, or is not a file of this user's
    """
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
