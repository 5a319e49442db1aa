"""Optional libraries, the extras that install them, and the errors without them."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec

from cam_rig.errors import ConfigError, MissingLibraryError

#: Extra of setup.py that installs an optional library, by the name of the library. Other required
#: libraries are always installed.
EXTRAS = {
    library: extra
    for extra, libraries in {
        "bags": "lz4 mcap rosbags zstandard",
        "bench": "joblib pymoo sksundae",
        "cad": "ezdxf shapely",
        "campaign": "SALib",
        "cli": "jinja2 markupsafe rich typer",
        "dask": "distributed",
        "design": "clarabel highspy",
        "fast": "numba setuptools",
        "panel": "starlette uvicorn websockets",
        "parquet": "pyarrow",
        "plots": "matplotlib",
        "ros-wheels": "rclpy",
        "view": "rerun",
    }.items()
    for library in libraries.split()
}
#: Suffixes of the packages of ROS messages. They are installed together with rclpy.
ROS_INTERFACES = ("_msgs", "_srvs", "_interfaces")
#: Libraries that are used if they are installed. No extra installs them.
OPTIONAL = ("pandas",)
#: Largest time in s since 1970: the end of the year 9999, where Python's calendar ends.
LAST_SECOND = 253_402_300_799


def require(library: str) -> None:
    """Raise MissingLibraryError if a library is not installed, without importing it."""
    if find_spec(library) is None:
        raise MissingLibraryError(_missing(library))


def source_date() -> int | None:
    """Return SOURCE_DATE_EPOCH in s since 1970, or None if it is not set.

    Raise ConfigError if it is not a time, because numpy and matplotlib read it too.
    """
    text = os.environ.get("SOURCE_DATE_EPOCH")
    if text is None:
        return None
    try:
        seconds = int(text)
    except ValueError:
        seconds = -1
    if not 0 <= seconds <= LAST_SECOND:
        raise ConfigError(
            f"SOURCE_DATE_EPOCH: {text[:40]!r} is not a date; allowed: whole seconds since 1970, "
            "as `date +%s` prints; or unset it"
        )
    return seconds


@contextmanager
def friendly_import_errors() -> Iterator[None]:
    """Convert the import error of an optional library to a MissingLibraryError."""
    try:
        yield
    except ModuleNotFoundError as error:
        library = (error.name or "").partition(".")[0]
        if library.endswith(ROS_INTERFACES):
            library = "rclpy"
        if library not in EXTRAS and library not in OPTIONAL:
            raise
        raise MissingLibraryError(_missing(library)) from None


def _missing(library: str) -> str:
    """Return the message for a missing library, with the command that installs it."""
    package = f"'cam_rig[{EXTRAS[library]}]'" if library in EXTRAS else library
    ros = ", or source a ROS 2 installation" if library == "rclpy" else ""
    return f"{library} is not installed: pip install {package}{ros}"
