"""A live picture's folder, which is this user's alone: recordings, and how far a page is behind.

The viewer's node writes it, and the process that serves the page reads it; no port is needed.
"""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path

from cam_rig.errors import CamRigError
from cam_rig.viewer.server.scripts import REPORT_EVERY_S

#: The file in which the server writes the page's delay, s.
BEHIND = "behind"


def new_recording(folder: Path) -> Path:
    """The path of a run's recording, in the place of those before.

    Raises
    ------
    CamRigError : there is no such folder
    """
    if not folder.is_dir():
        raise CamRigError(
            f"{folder}: no page reads it; allowed: a folder that a page is served from"
        )
    for old in folder.glob("*.rrd"):  # who reads it still has it open
        old.unlink(missing_ok=True)
    return folder / f"{time.time_ns()}.rrd"


def newest_recording(folder: Path) -> Path | None:
    """The recording of the present run, or of the last; None before the first."""
    return max(folder.glob("*.rrd"), default=None)


def write_delay(folder: Path, behind: float | None) -> None:
    """Keep how far (s) the page is behind; nothing while it is not known."""
    if behind is not None:
        (folder / BEHIND).write_text(f"{behind:.3f}", encoding="ascii")


def page_delay(folder: Path) -> float | None:
    """How far (s) the page is behind by its last report; one that is overdue adds to it.

    None while nothing is known.
    """
    file = folder / BEHIND
    with suppress(OSError, ValueError):  # not written yet, or just now
        late = float(file.read_text(encoding="ascii"))
        return late + max(0.0, time.time() - file.stat().st_mtime - REPORT_EVERY_S)
    return None
