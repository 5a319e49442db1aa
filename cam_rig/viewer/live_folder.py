"""A live picture's folder, which is this user's alone: recordings, and how far a page is behind.

The viewer's node writes it, and the process that serves the page reads it; no port is needed.
"""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path

from cam_rig.errors import CamRigError
from cam_rig.files import MIB
from cam_rig.viewer.page import REPORT_EVERY_S

#: The file in which the server writes the page's delay, s.
BEHIND = "behind"
#: Bytes of a part of a recording, and parts that are kept beside the first: 0.4 GB in all.
MAX_PART, KEPT_PARTS = 64 * MIB, 5


def new_recording(folder: Path) -> Path:
    """The first part of a run's recording, in the place of those before."""
    if not folder.is_dir():
        raise CamRigError(f"{folder}: no page reads it; allowed: a folder that one is served from")
    for old in folder.glob("*.rrd"):  # who reads it still has it open
        old.unlink(missing_ok=True)
    return folder / f"{time.time_ns()}_{0:06}.rrd"


def next_part(part: Path) -> Path | None:
    """The part in which a recording goes on when one is full; None while it is not.

    The first, which has what does not change, stays; of the others the newest.
    """
    if not part.exists() or part.stat().st_size < MAX_PART:
        return None
    run, number = part.stem.split("_")
    following = int(number) + 1
    if following > KEPT_PARTS:
        part.with_name(f"{run}_{following - KEPT_PARTS:06}.rrd").unlink(missing_ok=True)
    return part.with_name(f"{run}_{following:06}.rrd")


def newest_recording(folder: Path) -> Path | None:
    """The first part of the present run's recording, or of the last's; None before the first."""
    return max(folder.glob("*_000000.rrd"), default=None)


def part_after(part: Path) -> Path | None:
    """The part that is there after one, None where that is the newest; between may be a gap."""
    run = part.stem.split("_")[0]
    return min((p for p in part.parent.glob(f"{run}_*.rrd") if p > part), default=None)


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
