"""Files: bounded reading of what anybody may have written, temporary folders, whole writes."""

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

MIB = 2**20
#: Characters of a wrong value that an error shows.
MAX_SHOWN = 60
#: First characters of a formula in a spreadsheet.
FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")


def shown(text: str, quoted: bool = True) -> str:
    """A text from a file as an error shows it: one line, the end of a long one left out."""
    whole = repr(text) if quoted else repr(text)[1:-1]
    return whole if len(whole) <= MAX_SHOWN else f"{whole[: MAX_SHOWN - 3]}..."


def spreadsheet_text(value: Any) -> Any:
    """Return a value for a cell of a CSV file; a text does not become a formula.

    Spreadsheets evaluate a text that starts with one of `FORMULA_STARTS`. The apostrophe before it
    makes it a text. Numbers stay as they are.
    """
    is_formula = isinstance(value, str) and value.startswith(FORMULA_STARTS)
    return f"'{value}" if is_formula else value


def read_bytes(path: Path, most: int, follow: bool = True) -> bytes:
    """The bytes of a plain file of at most ``most`` bytes; no pipe or device is waited for."""
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


@contextmanager
def writing(path: Path) -> Iterator[Path]:
    """A file beside ``path`` to write into, which then takes its place whole."""
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
def temporary_folder(prefix: str = "cam_rig_", place: Path | None = None) -> Iterator[Path]:
    """A folder for as long as the context lasts, in a place or where temporary files are."""
    place = place or temporary_place()
    try:
        folder = tempfile.TemporaryDirectory(prefix=prefix, dir=place, ignore_cleanup_errors=True)
    except OSError as error:
        raise no_room(place, error) from None
    with folder as name:
        yield Path(name)


def temporary_place() -> Path:
    """Where temporary files are made."""
    try:
        return Path(tempfile.gettempdir())
    except OSError as error:
        raise OutputError(f"{error.strerror or error}; name a folder with room in TMPDIR") from None


def no_room(place: Path, error: OSError) -> OutputError:
    """What to say of a place where no temporary file can be written."""
    return OutputError(
        f"{place}: no temporary file can be written ({error.strerror}); name a folder with room "
        "in TMPDIR"
    )


def check_place(target: Path) -> None:
    """Refuse a place where no file can be written."""
    if target.is_dir():
        raise OutputError(f"{target}: is a folder; allowed: a file")
    if target.exists() and not target.is_file():
        raise OutputError(f"{target}: is a device; allowed: a file, or - for stdout")
    nearest = next(parent for parent in target.absolute().parents if parent.exists())
    try:  # who may write is not told by the folder's bits alone: try it
        with tempfile.TemporaryFile(dir=nearest):
            pass
    except OSError as error:
        raise OutputError(
            f"{target}: cannot be written, {nearest} is no writable folder ({error.strerror})"
        ) from None


def write_new(folder: Path, texts: dict[str, str]) -> None:
    """Write files into a folder, none over another."""
    for name in texts:
        require_new(folder / name)
    for name, text in texts.items():
        with writing(folder / name) as part:
            part.write_text(text, encoding="utf-8")


def new_yaml(out: str | Path | None) -> Path | None:
    """An ``--out``; refused, before anything is computed, if it is no new YAML file."""
    if out is None:
        return None
    if Path(out).suffix != ".yaml":
        raise ConfigError(f"--out: is {out}; allowed: a name that ends in .yaml")
    require_new(Path(out))
    return Path(out)


def require_new(target: Path) -> None:
    """Refuse a file that is there already, or a place that cannot be written."""
    if target.exists():
        raise OutputError(f"{target}: exists already, not overwriting; name another or move it")
    check_place(target)
