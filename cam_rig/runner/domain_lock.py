"""One run, and one recorder, in each namespace of a ROS domain: two would hear each other."""

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
#: A namespace of ROS; a topic's name ends it, and may have 255 characters with it.
NAMESPACE = re.compile(r"(/(?:_?[A-Za-z]|_[0-9])(?:_?[A-Za-z0-9])*_?)+", re.ASCII)
MAX_NAMESPACE = 200
#: What opening a file raises that is not this user's own: a link, a folder, another user's.
FOREIGN = (errno.ELOOP, errno.EISDIR, errno.EACCES, errno.EPERM)


@contextmanager
def own_domain(namespace: str = "") -> Iterator[None]:
    """Hold a namespace of this environment's ROS domain; the kernel releases it with the process.

    Raises
    ------
    ConfigError : it is not a domain
    RunError : another run on this machine holds it
    OutputError : the lock cannot be written
    """
    with _only("domain", domain_number(os.environ.get("ROS_DOMAIN_ID", "")), namespace) as where:
        if where:
            raise RunError(
                f"another run is active in {where}; allowed: one, so give this one a namespace "
                "(--namespace /rig2), or set ROS_DOMAIN_ID to another number"
            )
        yield


@contextmanager
def own_recorder(domain: int, namespace: str) -> Iterator[None]:
    """Be the one recorder of a rig: the drive waits for what it has written.

    Raises
    ------
    ConfigError : the namespace is too long
    RunError : another recorder on this machine is at work; it is not disturbed
    OutputError : the lock cannot be written
    """
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
    """The namespace that a text names, with its slash: rig1 and /rig1 alike; empty for the root.

    Raises
    ------
    ConfigError : ROS allows no such namespace
    """
    namespace = f"/{text.strip('/')}".rstrip("/")
    if len(namespace) > MAX_NAMESPACE or (namespace and not NAMESPACE.fullmatch(namespace)):
        raise ConfigError(
            f"namespace: is {text[:80]!r}, {len(text)} characters; allowed: letters, digits, "
            f"single _ and /, each part begins with a letter, {MAX_NAMESPACE} characters at most"
        )
    return namespace


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
