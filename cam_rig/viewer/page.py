"""What a page does beside the viewer: it says what it shows, and begins where it is worth looking.

Rerun's page gives its state, and takes requests, as protobuf messages (its Viewer Control API).
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

#: The timeline of the cursor, as `cam_rig.viewer.timeline` has it, which imports Rerun.
TIMELINE = "rig_time"
#: What a page asks for to say which rig time (ns) it shows, -1 while it shows none; the answer is
#: the name of what it is to show.
SHOWN_PATH = "/shown"
#: Wall time (s) between two reports of a page, and two looks at whether it has data yet.
REPORT_EVERY_S, LOOK_EVERY_S = 1.0, 0.1
#: Field 3 of the state are the recordings, in each 3 the time cursor, with its timeline's name in
#: 1.1 and the time (ns) in 3.1, which is left out where it is 0.
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
    dispatchEvent(new Event("hashchange")); // a page at rest draws when something happens
  } catch { /* the server has gone */ }
}, PERIOD);""".replace("PATH", SHOWN_PATH).replace("PERIOD", f"{1e3 * REPORT_EVERY_S:.0f}")
#: Asked again until it is there: a file that is still loading puts the cursor back to its start.
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
    """The element that does it all; the time cursor is put to a rig time (s), when it is before."""
    script, begin_ns = _READ + _REPORT, round(begin * NS)
    if begin_ns > 0:
        request = str([*cursor_request(begin_ns)])
        script += _BEGIN.replace("BEGIN", f"{begin_ns}").replace("REQUEST", request)
    return f"<script>{script}\n</script>"


def cursor_request(time_ns: int) -> bytes:
    """The request to put the cursor there: 6 of a request, with timeline in 2.1 and time in 3.1."""
    timeline = _field(2, _field(1, TIMELINE.encode()))
    return _field(6, timeline + _field(3, bytes([1 << 3]) + _varint(time_ns)))


def _field(number: int, content: bytes) -> bytes:
    return bytes([number << 3 | 2]) + _varint(len(content)) + content


def _varint(value: int) -> bytes:
    """Seven bits a byte, the lowest first."""
    more = value >> 7
    return bytes([value & 127 | 128]) + _varint(more) if more else bytes([value])


# How far behind a run a browser's page is: it says once in a while which rig time it shows.


class PageTime:
    """What pages have said so far; one thread says it, another asks."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._open = clock, Event()
        self._driven, self._when = list[float](), list[float]()
        self._reported: tuple[float, float] | None = None
        #: The longest delay (s) that a page has reported; None before the first.
        self.longest: float | None = None

    def take(self, query: str) -> None:
        """What a page asked: ``ns=…``, its rig time; anything else is passed over."""
        (words, *_) = parse_qs(query).get("ns", [""])
        try:
            shown = int(words) / NS
        except ValueError:
            return
        self._open.set()
        if shown < 0.0 or not self._driven:
            return
        at, now = bisect_left(self._driven, shown), self._clock()
        late = 0.0 if at == len(self._driven) else now - self._when[at]
        self._reported, self.longest = (now, late), max(late, self.longest or 0.0)

    @interruptible
    def until_open(self) -> None:
        """Wait until a page shows the viewer."""
        self._open.wait()

    def driven(self, rig_time: float) -> None:
        """The drive has come to a rig time (s) now."""
        self._when.append(self._clock())  # first, for another thread looks it up by the other
        self._driven.append(rig_time)

    def behind(self) -> float | None:
        """Wall time (s) since the drive was where the page is; None while it is unknown."""
        if self._reported is None:
            return None
        when, late = self._reported
        return late + max(0.0, self._clock() - when - REPORT_EVERY_S)


# A live picture's folder, which is this user's alone: recordings, and how far a page is behind.
# The viewer's node writes it, and the process that serves the page reads it; no port is needed.

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
    """The part in which a recording goes on when one is full; the first and the newest stay."""
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
    """How far (s) the page is behind by its last report; one that is overdue adds to it."""
    file = folder / BEHIND
    with suppress(OSError, ValueError):  # not written yet, or just now
        late = float(file.read_text(encoding="ascii"))
        return late + max(0.0, time.time() - file.stat().st_mtime - REPORT_EVERY_S)
    return None
