"""Libraries of others: the extra that each comes with, and what they read of the environment."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec

from cam_rig.errors import ConfigError, MissingLibraryError

#: Extra of setup.py by what is imported; the rest is the core, which is always there.
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
        "fast": "numba",
        "panel": "starlette uvicorn websockets",
        "parquet": "pyarrow",
        "plots": "matplotlib",
        "ros-wheels": "rclpy",
        "view": "rerun",
    }.items()
    for library in libraries.split()
}
#: Ends of the names of packages of ROS messages, which come with rclpy.
ROS_INTERFACES = ("_msgs", "_srvs", "_interfaces")
#: Libraries that no part of the rig needs, and no extra brings.
OPTIONAL = ("pandas",)
#: The end of the year 9999, s since 1970: no calendar goes farther.
LAST_SECOND = 253_402_300_799


def require(library: str) -> None:
    """Refuse to begin what needs a library that is not installed; it is not imported."""
    if find_spec(library) is None:
        raise MissingLibraryError(_missing(library))


def source_date() -> int | None:
    """What SOURCE_DATE_EPOCH says (s since 1970, or None): numpy reads it, and matplotlib."""
    text = os.environ.get("SOURCE_DATE_EPOCH")
    if text is None:
        return None
    try:
        seconds = int(text)
    except ValueError:
        seconds = -1
    if not 0 <= seconds <= LAST_SECOND:
        raise ConfigError(
            f"SOURCE_DATE_EPOCH: {text[:40]!r} is no date; allowed: whole seconds since 1970, as "
            "`date +%s` prints; or unset it"
        )
    return seconds


@contextmanager
def libraries_named() -> Iterator[None]:
    """Turn the import error of a missing library into one line that says how to install it."""
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
    wanted = f"'cam_rig[{EXTRAS[library]}]'" if library in EXTRAS else library
    ros = ", or source a ROS 2 installation" if library == "rclpy" else ""
    return f"{library} is not installed: pip install {wanted}{ros}"
