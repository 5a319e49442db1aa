"""Reading a file that anybody may have written: a plain file, up to a size, and nothing else."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

from cam_rig.errors import ConfigError

MIB = 2**20
#: Characters of a wrong value that an error shows.
MAX_SHOWN = 60


def shown(text: str, quoted: bool = True) -> str:
    """A text from a file as an error shows it: one line, the end of a long one left out."""
    whole = repr(text) if quoted else repr(text)[1:-1]
    return whole if len(whole) <= MAX_SHOWN else f"{whole[: MAX_SHOWN - 3]}..."


def read_bytes(path: Path, most: int, follow: bool = True) -> bytes:
    """The bytes of a plain file of at most ``most`` bytes.

    A pipe or a device is not waited for and not read. ``follow`` follows symbolic links.

    Raises
    ------
    ConfigError : it is no plain file, or longer; the words begin with "is" or "has"
    OSError : it cannot be read
    """
    flags = os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK | (0 if follow else os.O_NOFOLLOW)
    with open(os.open(path, flags), "rb") as stream:
        about = os.fstat(stream.fileno())
        if stat.S_ISDIR(about.st_mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        if not stat.S_ISREG(about.st_mode):
            raise ConfigError("is a pipe or a device; allowed: a file")
        data = stream.read(most + 1)  # it may grow meanwhile
    if len(data) > most:
        size = max(about.st_size, len(data)) / MIB
        raise ConfigError(f"has {size:.3g} MiB; allowed: {most / MIB:g} MiB")
    return data
