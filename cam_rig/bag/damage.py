"""What a damaged bag may raise in its readers, and the error that reports it."""

from __future__ import annotations

import re
import sqlite3
import struct
import zlib
from pathlib import Path

import zstandard
from mcap.exceptions import McapError
from rosbags.rosbag2 import ReaderError
from rosbags.serde import SerdeError

from cam_rig.bag.files import ALLOWED, why_not_a_bag
from cam_rig.errors import BagError

#: What a file with wrong bytes in it may raise in the readers.
DAMAGE = (
    McapError,
    OSError,
    struct.error,
    zlib.error,
    zstandard.ZstdError,
    sqlite3.Error,
    KeyError,
    IndexError,
    ValueError,
    EOFError,
    MemoryError,
    OverflowError,
    RuntimeError,
)
#: What rosbags raises on a file or folder that is not a bag.
UNREADABLE = (
    ReaderError,
    SerdeError,
    AssertionError,
    TypeError,
    AttributeError,
    *DAMAGE,
)


def reason(error: Exception) -> str:
    """An error's words in one line, or its kind where it has none."""
    words = re.sub(r"\[?PosixPath\('([^']*)'\)\]?", r"\1", " ".join(str(error).split()))
    return words or type(error).__name__


def damaged(bag: Path, error: Exception) -> BagError:
    """The error of a bag that cannot be read: why it is not a bag, or how to recover it."""
    if what := why_not_a_bag(bag):
        return BagError(f"{bag}: {what}; {ALLOWED}")
    return BagError(
        f"{bag}: cannot be read as a rosbag2 bag ({reason(error)}); if it was not closed, recover "
        f"it with: cam-rig recover {bag}"
    )
