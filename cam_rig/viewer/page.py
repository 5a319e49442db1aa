"""Script of the viewer's page, delay of the page, and files of a live recording.

The script reports the displayed rig time to the server and sets the initial time cursor. Rerun's
page returns its state and accepts requests as protobuf messages (its Viewer Control API).
"""

from __future__ import annotations

import time
from bisect import bisect_left
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from threading import Event
from urllib.parse import parse_qs

from cam_rig.errors import CamRigError
from cam_rig.files import MIB
from cam_rig.interrupts import interruptible
from cam_rig.units import NS

#: Name of the Rerun timeline on which the time cursor of the page moves. It equals
#: `cam_rig.viewer.timeline.RIG_TIME`, whose module imports Rerun.
TIMELINE = "rig_time"
#: Path of the request by which a page reports its rig time (ns), or -1 before it displays a
#: recording. The response is the name of the recording to display.
SHOWN_PATH = "/shown"
#: Period (s, wall clock) at which a page reports its rig time.
REPORT_EVERY_S = 1.0
#: Period (s, wall clock) at which a page checks if its first data have arrived.
LOOK_EVERY_S = 0.1
#: Script that reads the displayed rig time from the state of Rerun's web viewer, a protobuf
#: message. Field 3 of the state contains the recordings. Field 3 of a recording is its time cursor,
#: with the name of the timeline in 1.1 and the time (ns) in 3.1. A time of 0 is omitted.
_READ = """
function* fields(b) {
  let i = 0;
  const varint = () => {
    let r = 0n, s = 0n, c;
    do { c = b[i++]; r |= BigInt(c & 127) << s; s += 7n; } while (c > 127);
    return r;
  };
  while (i < b.length) {
    const key = Number(varint()), kind = key & 7;
    if (kind === 0) yield [key >> 3, varint()];
    else if (kind === 2) { const n = Number(varint()); yield [key >> 3, b.subarray(i, i += n)]; }
    else if (kind === 1) i += 8; else if (kind === 5) i += 4; else return;
  }
}
const only = (b, ...path) => path.reduce((at, want) =>
  at === undefined ? at : ([...fields(at)].find(([field]) => field === want) ?? [])[1], b);
const text = (b) => b === undefined ? "" : new TextDecoder().decode(b);
function shownTime() {
  const handle = window._handle;
  if (!handle || !handle.viewer_state) return undefined;
  let shown = -1n;
  try {
    for (const [field, recording] of fields(handle.viewer_state())) {
      const cursor = field === 3 ? only(recording, 3) : undefined;
      if (cursor && text(only(cursor, 1, 1)) === "TIMELINE") shown = only(cursor, 3, 1) ?? 0n;
    }
  } catch { return undefined; }
  return shown;
}""".replace("TIMELINE", TIMELINE)
_REPORT = """
let followed = "";
setInterval(async () => {
  const shown = shownTime();
  if (shown === undefined) return;
  if (shown >= 0n) parent.postMessage("shown", "*");
  try {
    const name = await (await fetch(`PATH?ns=${shown}`)).text();
    if (!name || name === followed) return;
    followed = name;
    window._handle.add_receiver(`${location.origin}/${name}`);
    dispatchEvent(new Event("hashchange")); // an idle page is redrawn only after an event
  } catch { /* the server has stopped */ }
}, PERIOD);""".replace("PATH", SHOWN_PATH).replace("PERIOD", f"{1e3 * REPORT_EVERY_S:.0f}")
#: Script that moves the time cursor to the initial time. It repeats the request until the cursor
#: has reached this time, because a file that is still loading resets the cursor to its start.
_BEGIN = """
let asked = false;
const waiting = setInterval(async () => {
  const shown = shownTime();
  if (asked || shown === undefined || shown < 0n) return;
  if (shown >= BEGINn) return clearInterval(waiting);
  asked = true;
  await window._handle.viewer_control(new Uint8Array(REQUEST)).catch(() => {});
  asked = false;
}, PERIOD);""".replace("PERIOD", f"{1e3 * LOOK_EVERY_S:.0f}")


def page_script(begin: float = 0.0) -> str:
    """Return the script element of the viewer's page.

    The script moves the time cursor forward to `begin`, a rig time in s, if it is earlier.
    """
    script, begin_ns = _READ + _REPORT, round(begin * NS)
    if begin_ns > 0:
        request = str([*cursor_request(begin_ns)])
        script += _BEGIN.replace("BEGIN", f"{begin_ns}").replace("REQUEST", request)
    return f"<script>{script}\n</script>"


def cursor_request(time_ns: int) -> bytes:
    """Return the protobuf message that moves the time cursor to a rig time (ns).

    It is field 6 of a request to the viewer, with the name of the timeline in field 2.1 and the
    time in field 3.1.
    """
    timeline = _field(2, _field(1, TIMELINE.encode()))
    return _field(6, timeline + _field(3, bytes([1 << 3]) + _varint(time_ns)))


def _field(number: int, content: bytes) -> bytes:
    return bytes([number << 3 | 2]) + _varint(len(content)) + content


def _varint(value: int) -> bytes:
    """Return the protobuf varint of a value: seven bits per byte, the lowest first."""
    more = value >> 7
    return bytes([value & 127 | 128]) + _varint(more) if more else bytes([value])


# Delay of a browser's page behind a run, from the rig times that the page reports.


class PageTime:
    """Delay of the rig time on a page behind the drive, in wall-clock time.

    The thread of the server calls `take` and `until_open` waits for it. The thread of the run calls
    `record_drive`. There is no lock: each list has one writer, which appends to `_when` before
    `_driven`, and each other attribute is replaced in one assignment.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._open = clock, Event()
        self._driven, self._when = list[float](), list[float]()
        self._reported: tuple[float, float] | None = None
        #: Longest delay (s) behind the drive that a page has reported, None before the first
        #: report.
        self.longest: float | None = None

    def take(self, query: str) -> None:
        """Process the rig time that a page reports in the query ``ns=…``.

        Any other query is ignored.
        """
        (text, *_) = parse_qs(query).get("ns", [""])
        try:
            rig_time = int(text) / NS
        except ValueError:
            return
        self._open.set()
        if rig_time < 0.0 or not self._driven:
            return
        index, now = bisect_left(self._driven, rig_time), self._clock()
        late = 0.0 if index == len(self._driven) else now - self._when[index]
        self._reported, self.longest = (now, late), max(late, self.longest or 0.0)

    @interruptible
    def until_open(self) -> None:
        """Wait until a browser has opened the page of a live run."""
        self._open.wait()

    def record_drive(self, rig_time: float) -> None:
        """Record that the drive has reached a rig time (s)."""
        self._when.append(self._clock())  # before _driven, which the other thread reads first
        self._driven.append(rig_time)

    def behind(self) -> float | None:
        """Return the delay (s) of the page behind the drive, in wall-clock time.

        It is the time since the drive was at the rig time that the page displays. If the next
        report of the page is overdue, the overdue time is added. Returns None if no page has
        reported a rig time.
        """
        if self._reported is None:
            return None
        when, late = self._reported
        return late + max(0.0, self._clock() - when - REPORT_EVERY_S)


# Folder of a live recording, which only this user can read: recordings, and the delay of the page.
# The viewer's node writes it and the process that serves the page reads it. No port is needed.

#: Name of the file in which the server writes the delay (s) of the page behind the run.
BEHIND = "behind"
#: Size (bytes) of a file of a live recording at which the recording continues in the next file
#: (part).
MAX_PART = 64 * MIB
#: Number of newest files (parts) of a live recording that are kept in addition to the first: 0.4 GB
#: in total.
KEPT_PARTS = 5


def new_recording(folder: Path) -> Path:
    """Delete the older recordings of a folder, and return the path of a new recording.

    The path is that of its first part. A long recording is continued in further files (parts).
    Raises CamRigError if the folder does not exist.
    """
    if not folder.is_dir():
        raise CamRigError(f"{folder}: must be the folder of a page that cam-rig serves")
    for old in folder.glob("*.rrd"):  # a page that reads it keeps the open file
        old.unlink(missing_ok=True)
    return folder / f"{time.time_ns()}_{0:06}.rrd"


def next_part(part: Path) -> Path | None:
    """Return the path of the next part of a recording if `part` is full, else None.

    A part is one file of the recording. The part that is no longer needed is deleted: only the
    first part and the `KEPT_PARTS` newest parts are kept.
    """
    if not part.exists() or part.stat().st_size < MAX_PART:
        return None
    run, number = part.stem.split("_")
    following = int(number) + 1
    if following > KEPT_PARTS:
        part.with_name(f"{run}_{following - KEPT_PARTS:06}.rrd").unlink(missing_ok=True)
    return part.with_name(f"{run}_{following:06}.rrd")


def newest_recording(folder: Path) -> Path | None:
    """Return the path of the newest recording in a folder, that of its first file.

    Returns None if there is no recording.
    """
    return max(folder.glob("*_000000.rrd"), default=None)


def part_after(part: Path) -> Path | None:
    """Return the next existing file of a recording, None after the newest.

    Files in between may have been deleted. `part` is the file before it.
    """
    run = part.stem.split("_")[0]
    return min((p for p in part.parent.glob(f"{run}_*.rrd") if p > part), default=None)


def write_delay(folder: Path, behind: float | None) -> None:
    """Write the delay (s) of the page to a file of the folder, unless it is None."""
    if behind is not None:
        (folder / BEHIND).write_text(f"{behind:.3f}", encoding="ascii")


def page_delay(folder: Path) -> float | None:
    """Return the delay (s) of the page that the server has written to a file.

    If the file is older than the period of the reports, the excess is added. Returns None if no
    delay is written.
    """
    file = folder / BEHIND
    with suppress(OSError, ValueError):  # not written yet, or being written
        late = float(file.read_text(encoding="ascii"))
        return late + max(0.0, time.time() - file.stat().st_mtime - REPORT_EVERY_S)
    return None
