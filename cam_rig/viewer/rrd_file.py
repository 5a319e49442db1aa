"""A Rerun stream into a file that appears only when it is whole."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from cam_rig.errors import CamRigError


def require_free(path: Path, overwrite: bool) -> None:
    """Raise when a recording cannot have this path.

    Raises
    ------
    CamRigError : it exists and may not be overwritten, or the viewer would not know its suffix
    """
    if path.is_dir():
        raise CamRigError(f"{path}: is a folder; name a file in it, such as {path / 'run.rrd'}")
    if path.suffix != ".rrd":
        raise CamRigError(f"{path}: ends in {path.suffix!r}; allowed: .rrd, or no viewer opens it")
    if path.exists() and not overwrite:
        raise CamRigError(f"{path}: exists already, not overwriting; name another, or use --force")


@contextmanager
def rrd_stream(
    path: Path, application: str, blueprint: rrb.Blueprint
) -> Iterator[rr.RecordingStream]:
    """A stream into a file beside ``path``, which takes its place at the end, in reading order.

    Raises
    ------
    CamRigError : the file cannot be written
    """
    drawn, part = (path.with_name(f"{path.name}{end}") for end in (".drawn.part", ".part"))
    stream, ordered = (rr.RecordingStream(application) for _ in range(2))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _save(stream, drawn, blueprint)
        yield stream
        stream.disconnect()
        _require_whole(drawn)
        _save(ordered, part, blueprint)
        _copy_ordered(drawn, ordered)
        ordered.disconnect()
        _require_whole(part)
        os.replace(part, path)
    except OSError as error:
        raise CamRigError(f"{path}: cannot be written ({error})") from None
    finally:
        for open_stream, file in ((stream, drawn), (ordered, part)):
            open_stream.disconnect()
            with suppress(OSError):
                file.unlink()


def _copy_ordered(drawn: Path, stream: rr.RecordingStream) -> None:
    """What holds at every time first: a viewer shows a file while it loads, from its beginning."""
    for static in (True, False):
        stream.send_chunks(RrdReader(drawn).stream().filter(is_static=static))


def _save(stream: rr.RecordingStream, part: Path, blueprint: rrb.Blueprint) -> None:
    try:
        stream.save(part, default_blueprint=blueprint)
    except RuntimeError as error:
        raise OSError(error) from None


def _require_whole(part: Path) -> None:
    """Read the file's footer: Rerun only logs what goes wrong while it writes."""
    try:
        with warnings.catch_warnings(action="ignore"):
            RrdReader(part).recordings()
    except RuntimeError as error:
        raise OSError(f"it is not whole; is the disk full? {error}") from None
