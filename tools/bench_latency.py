"""Delays of the virtual bench in a browser without a graphics card.

    .venv/bin/python -m tools.bench_latency

The bench is a page of `cam-rig panel` on which a user turns the cam. The program prints delays,
drawn frames per second and processor time. The delay of the first picture is from the request of
the page to the contour of the cam. Another delay is from the event on the page to the readout that
displays it, and to the time at which the loudspeaker plays the first block of the new speed. That
block is recognised by its length and marked. Processor time is that of Chromium and of the panel's
server, relative to one core, while the cam turns at 450 rpm. If other programs use the machine,
there are fewer frames, and each needs longer.
"""

from __future__ import annotations

import os
import statistics
import time
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from cam_rig.panel.bench.runner import TICKS_PER_TURN
from tools.docs.bench_picture import RIG_DRAWN, panel_address
from tools.docs.browser import TIMEOUT_S, new_page, open_browser, until

if TYPE_CHECKING:
    from playwright.sync_api import Page

#: Speed of the cam (rpm).
RPM = 450
#: Time (s) over which frames and processor time are counted.
WATCHED_S = 10.0
#: Speeds (rpm) that are set to measure the delay.
TURNED = (300, 350, 280, 420, 310, 390, 260)

FRAMES = """(seconds) => new Promise((done) => {
  // Asking for frames to count them would make the page draw them.
  let frames = 0;
  const brush = document.querySelector("#rig canvas").getContext("2d");
  brush.drawImage = function (...given) {
    frames += 1; // each begins with what stands still
    CanvasRenderingContext2D.prototype.drawImage.apply(brush, given);
  };
  setTimeout(() => { delete brush.drawImage; done(frames / seconds); }, 1000 * seconds);
})"""
DELAY = """(rpm) => new Promise((done) => {
  const begin = performance.now(), speed = document.getElementById("speed");
  new MutationObserver(() => {
    if (speed.textContent === String(rpm)) done(performance.now() - begin);
  }).observe(speed, { childList: true });
  const typed = document.getElementById("rpm");
  typed.value = rpm;
  typed.dispatchEvent(new Event("change"));
})"""
#: Script that marks and detects the first block of sound whose length is a whole number of ticks
#: of the new speed.
TAP = """
  const connect = AudioNode.prototype.connect;
  AudioNode.prototype.connect = function (to) {
    if (!(this instanceof AudioWorkletNode)) return connect.call(this, to);
    const { port, context } = this, post = port.postMessage;
    const ear = context.createScriptProcessor(256, 1, 1);
    ear.onaudioprocess = ({ inputBuffer }) => {
      if (inputBuffer.getChannelData(0).some((value) => value > 1e6)) window.heard();
    };
    connect.call(ear, context.destination);
    connect.call(this, ear);
    port.postMessage = (samples) => {
      window.sounds = true;
      const tick = context.sampleRate / window.ticks, count = Math.round(samples.length / tick);
      if (Math.abs(samples.length - count * tick) < count) {
        samples[0] = 1e9;
        window.ticks = NaN;
      }
      post.call(port, samples);
    };
    return connect.call(this, to);
  };
"""
HEARD = """([rpm, ticks]) => new Promise((done) => {
  const begin = performance.now(), typed = document.getElementById("rpm");
  window.heard = () => done(performance.now() - begin);
  setTimeout(() => done(NaN), 20000); // it was not heard
  window.ticks = ticks;
  typed.value = rpm;
  typed.dispatchEvent(new Event("change"));
})"""


def cpu_seconds(pids: set[int]) -> float:
    """Return the processor time (s) of processes."""
    ticks = 0
    for pid in pids:
        fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
        ticks += int(fields[11]) + int(fields[12])
    return ticks / os.sysconf("SC_CLK_TCK")


def processes(text: str) -> set[int]:
    """Return the ids of descendant processes whose command line contains a text."""
    parents, matching = {}, set()
    for path in Path("/proc").glob("[0-9]*"):
        try:
            line = (path / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
            fields = (path / "stat").read_text(encoding="ascii", errors="replace")
        except OSError:
            continue
        parents[int(path.name)] = int(fields.rpartition(")")[2].split()[1])
        if text in line:
            matching.add(int(path.name))
    own = {os.getpid()}
    while more := {pid for pid, parent in parents.items() if parent in own} - own:
        own |= more
    return matching & own


def first_picture(page: Page, address: str) -> float:
    """Return the time (s) from the request of the bench to the contour of the cam."""
    begin = time.monotonic()
    page.goto(address, wait_until="commit")
    until(page, RIG_DRAWN)
    return time.monotonic() - begin


def tell(what: str, delays: list[float]) -> None:
    """Print the median and the largest of delays (ms)."""
    print(f"{what}: {statistics.median(delays):.0f} ms, {max(delays):.0f} at most")


def main() -> None:
    """Measure, and print a line per result."""
    with panel_address() as address, open_browser(webgl=False) as browser:
        page = new_page(browser)
        page.add_init_script(TAP)
        page.goto(address)
        bench = f"http://{urlsplit(address).netloc}/bench"
        cold = first_picture(page, bench)
        print(f"first picture: {cold:.2f} s, again {first_picture(page, bench):.2f} s")
        page.locator("#start:enabled").click(timeout=TIMEOUT_S * 1e3)
        delays = [page.evaluate(DELAY, rpm) for rpm in TURNED]
        tell("typed speed to readout", delays)
        page.evaluate(DELAY, RPM)
        both = processes("chrom"), processes("cam-rig panel")
        begin = [cpu_seconds(pids) for pids in both]
        frames = page.evaluate(FRAMES, WATCHED_S)
        used = [100 * (cpu_seconds(p) - b) / WATCHED_S for p, b in zip(both, begin, strict=True)]
        print(f"{RPM} rpm: {frames:.0f} frames/s; of a core: page {used[0]:.0f} %, server", end=" ")
        print(f"{used[1]:.0f} %")
        page.locator("#volume").focus()
        page.keyboard.press("ArrowUp")
        until(page, "window.sounds")
        given = [[rpm, rpm / 60 * TICKS_PER_TURN] for rpm in 2 * TURNED]
        tell("typed speed to sound", [page.evaluate(HEARD, rpm) for rpm in given])


if __name__ == "__main__":
    main()
