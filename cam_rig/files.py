"""Bounded reading of untrusted files, temporary folders and atomic writing."""

from __future__ import annotations

import errno
import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from cam_rig.errors import ConfigError, OutputError

#: Bytes in one MiB.
MIB = 2**20
#: Largest number of characters of a wrong value that an error message contains.
MAX_SHOWN = 60
#: First characters of a formula in a spreadsheet.
FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")


def shorten(text: str, quoted: bool = True) -> str:
    """Return a text as one line of at most `MAX_SHOWN` characters, for an error.

    If `quoted` is False, the quotation marks are left out.
    """
    whole = repr(text) if quoted else repr(text)[1:-1]
    return whole if len(whole) <= MAX_SHOWN else f"{whole[: MAX_SHOWN - 3]}..."


def spreadsheet_text(value: Any) -> Any:
    """Return a value for a cell of a CSV file, protected from evaluation as a formula.

    Spreadsheets evaluate a text that starts with one of `FORMULA_STARTS`. An apostrophe is placed
    before such a text. Other values are returned unchanged.
    """
    is_formula = isinstance(value, str) and value.startswith(FORMULA_STARTS)
    return f"'{value}" if is_formula else value


def read_bytes(path: Path, max_bytes: int, follow: bool = True) -> bytes:
    """Return the content of a regular file.

    Parameters
    ----------
    path : Path
        Path of the file.
    max_bytes : int
        Largest size of the file.
    follow : bool, optional
        True if a symbolic link is followed (default: True).

    Raises
    ------
    ConfigError
        If the file is larger, or is a pipe or a device. Neither is waited for.
    OSError
        If the file cannot be read.
    """
    flags = os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK | (0 if follow else os.O_NOFOLLOW)
    with open(os.open(path, flags), "rb") as stream:
        status = os.fstat(stream.fileno())
        if stat.S_ISDIR(status.st_mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        if not stat.S_ISREG(status.st_mode):
            raise ConfigError("is a pipe or a device; allowed: a file")
        data = stream.read(max_bytes + 1)  # the file may grow meanwhile
    if len(data) > max_bytes:
        size = max(status.st_size, len(data)) / MIB
        raise ConfigError(f"has {size:.3g} MiB; allowed: {max_bytes / MIB:g} MiB")
    return data


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """Write a file atomically: yield a temporary path, then rename it to `path`.

    Raise OutputError if the file cannot be written.
    """
    part = path.with_name(f".{path.stem}.part{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield part
        part.replace(path)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from None
    finally:
        with suppress(OSError):
            part.unlink()


@contextmanager
def temporary_folder(prefix: str = "cam_rig_", parent: Path | None = None) -> Iterator[Path]:
    """Yield a new folder in `parent`, and remove it when the context is left.

    The default of `parent` is the system's folder of temporary files. Raise OutputError if the
    folder cannot be made.
    """
    parent = parent or temporary_root()
    try:
        folder = tempfile.TemporaryDirectory(prefix=prefix, dir=parent, ignore_cleanup_errors=True)
    except OSError as error:
        raise no_space_error(parent, error) from None
    with folder as name:
        yield Path(name)


def temporary_root() -> Path:
    """Return the system's folder of temporary files."""
    try:
        return Path(tempfile.gettempdir())
    except OSError as error:
        raise OutputError(f"{error.strerror or error}; name a folder with room in TMPDIR") from None


def no_space_error(folder: Path, error: OSError) -> OutputError:
    """Return the error of a folder in which no temporary file can be written."""
    return OutputError(
        f"{folder}: no temporary file can be written ({error.strerror}); name a folder with room "
        "in TMPDIR"
    )


def check_writable(target: Path) -> None:
    """Raise OutputError if a file cannot be written to this path."""
    if target.is_dir():
        raise OutputError(f"{target}: is a folder; allowed: a file")
    if target.exists() and not target.is_file():
        raise OutputError(f"{target}: is a device; allowed: a file, or - for stdout")
    nearest = next(parent for parent in target.absolute().parents if parent.exists())
    try:  # permission bits alone do not determine who may write
        with tempfile.TemporaryFile(dir=nearest):
            pass
    except OSError as error:
        raise OutputError(
            f"{target}: cannot be written, {nearest} is not a writable folder ({error.strerror})"
        ) from None


def write_new(folder: Path, texts: dict[str, str]) -> None:
    """Write files into a folder. Raise OutputError if one of them exists."""
    for name in texts:
        require_new(folder / name)
    for name, text in texts.items():
        with atomic_write(folder / name) as part:
            part.write_text(text, encoding="utf-8")


def new_yaml(out: str | Path | None) -> Path | None:
    """Check that the option ``--out`` names a new YAML file, and return its path.

    Returns None without the option. Raise ConfigError or OutputError if the path does not end in
    .yaml, exists or cannot be written. Commands call this before they compute.
    """
    if out is None:
        return None
    if Path(out).suffix != ".yaml":
        raise ConfigError(f"--out: is {out}; allowed: a name that ends in .yaml")
    require_new(Path(out))
    return Path(out)


def require_new(target: Path) -> None:
    """Raise OutputError if a file exists, or cannot be written to this path."""
    if target.exists():
        raise OutputError(f"{target}: exists already, not overwriting; name another or move it")
    check_writable(target)
