"""Delays and memory of the drawing board while two pages drag ordinates at once.

    .venv/bin/python -m tools.panel_latency [MINUTES]

The drawing board is a page of `cam-rig panel`. Each page drags a different ordinate up and down
with the pointer, in a browser without a window. A delay is from an event of the pointer to the end
of the first frame with the changed curve. Memory is the JavaScript heap of the pages after a
garbage collection, and the resident memory of server and worker.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tools.docs.browser import new_page, open_browser

if TYPE_CHECKING:
    from playwright.sync_api import CDPSession, Page

HANDLES = (7, 22)

#: Amplitude of the motion (px).
AMPLITUDE_PX = 12.0
#: Period of the motion (s).
PERIOD_S = 2.0
#: Time (s) between two readings of the memory.
READING_PERIOD_S = 30.0
#: Bytes per MiB.
MIB = 2**20

LISTEN = """() => {
  window.delays = [];
  let first = null;
  const channel = new MessageChannel();
  channel.port1.onmessage = ({ data }) => window.delays.push(performance.now() - data);
  addEventListener("pointermove", (event) => { first ??= event.timeStamp; }, true);
  new MutationObserver(() => {
    if (first === null) return;
    channel.port2.postMessage(first);
    first = null;
  }).observe(document.querySelector("#chart0 svg"), { subtree: true, attributeFilter: ["d"] });
}"""

#: Period (ms) of the moves of the pointer, as that of a mouse. They are made within the page,
#: because a driver outside of it would wait for each frame.
EVERY_MS = 8

MOVE = f"""([handle, y, way, period]) => {{
  const circle = document.querySelectorAll(".handle")[handle];
  setInterval(() => {{
    const clientY = y + way * Math.sin(2 * Math.PI * performance.now() / 1e3 / period);
    circle.dispatchEvent(new PointerEvent("pointermove", {{ clientY, bubbles: true }}));
  }}, {EVERY_MS});
}}"""


@contextmanager
def panel() -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Start `cam-rig panel` and provide its address."""
    program = Path(sys.executable).with_name("cam-rig")
    with subprocess.Popen([program, "panel"], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield process, process.stdout.readline().strip()
        finally:
            process.terminate()


def resident(pid: int) -> float:
    """Return the memory (MiB) of a process and its children."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="utf-8")
    own = int(status.split("VmRSS:")[1].split()[0]) * 1024 / MIB
    children = Path(f"/proc/{pid}/task").glob("*/children")
    return own + sum(resident(int(n)) for task in children for n in task.read_text().split())


def heap(session: CDPSession) -> float:
    """Return the JavaScript memory (MiB) of a page after a garbage collection."""
    session.send("HeapProfiler.collectGarbage")
    return float(session.send("Runtime.getHeapUsage")["usedSize"]) / MIB


def drag(page: Page, address: str, handle: int) -> None:
    """Open the drawing board, press an ordinate, and start to move its pointer."""
    page.goto(address)
    page.wait_for_function("() => document.getElementById('jump_rigid').textContent !== '–'")
    page.evaluate(LISTEN)
    box = page.locator(".handle").nth(handle).bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.evaluate(MOVE, [handle, y, AMPLITUDE_PX, PERIOD_S])


def print_delays(pages: list[Page], seconds: float) -> None:
    """Print drawn frames and delays since the previous call."""
    for number, page in enumerate(pages, start=1):
        delays = np.array(page.evaluate("() => window.delays.splice(0)"))
        middle, most = np.percentile(delays, (50, 95))
        rate = f"{delays.size / seconds:.1f} paints/s"
        print(f"  page {number}: {rate}, change to paint {middle:.1f} ms, 95 %: {most:.1f} ms")


def main() -> None:
    """Drag for a number of minutes, by default 8."""
    minutes = float(sys.argv[1]) if len(sys.argv) > 1 else 8.0
    with panel() as (process, address), open_browser(webgl=False) as browser:
        pages = [new_page(browser) for _ in HANDLES]
        for page, handle in zip(pages, HANDLES, strict=True):
            drag(page, address, handle)
        sessions = [page.context.new_cdp_session(page) for page in pages]
        pages[0].wait_for_timeout(5e3)  # code is then compiled, and axes have their range
        for page in pages:
            page.evaluate("() => window.delays.splice(0)")
        start, elapsed = time.monotonic(), 0.0
        while elapsed < 60.0 * minutes:
            heaps = " and ".join(f"{heap(session):.1f}" for session in sessions)
            print(f"{elapsed:.0f} s: pages {heaps} MiB, server {resident(process.pid):.1f} MiB")
            pages[0].wait_for_timeout(1e3 * READING_PERIOD_S)
            before, elapsed = elapsed, time.monotonic() - start
            print_delays(pages, elapsed - before)
            sys.stdout.flush()


if __name__ == "__main__":
    main()
