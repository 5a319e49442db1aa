"""Screenshot of a run in the Rerun viewer, for the documents."""

from __future__ import annotations

import time
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

from cam_rig.show import looks as colours
from cam_rig.viewer import Tab, ViewOptions
from cam_rig.viewer import quantities as series
from cam_rig.viewer.recording import save_recording
from cam_rig.viewer.rerun_page import serve_file
from tools.docs.browser import (
    MIN_PIXELS,
    TIMEOUT_S,
    count,
    new_page,
    open_browser,
    photograph,
    photographs,
)

#: Colours that must all be visible: follower, curves and landings.
SHOWN = (
    series.LIFT_LINE.colour,
    series.VELOCITY_LINE.colour,
    series.ACCELERATION_LINE.colour,
    series.FORCE_LINE.colour,
    series.GAP_LINE.colour,
    series.LANDING.colour,
    colours.FOLLOWER,
)

#: Bag of the screenshots of single tabs. It is short, so a page loads it within seconds.
SHORT_BAG = Path("bags/golden")
#: Tab and rig time (s) of these screenshots by file name. Playback starts at this time. At 1.3 s
#: TM21's cam turns at 400 rpm, and soon loses contact. At 1.7 s the larger cam turns.
TABS = {
    "viewer_sound.png": (Tab.SOUND, 1.3),
    "viewer_contact.png": (Tab.CONTACT, 1.3),
    "viewer_robot.png": (Tab.ROBOT, 1.7),
}
#: Wall time (ms) from the first data of a page to its screenshot.
LOADED_MS = 12_000
#: Number of colours of a screenshot of a tab. It keeps the file below 200 kB.
PALETTE = 128


def photograph_viewer(bag: Path, path: Path) -> None:
    """Write a screenshot of the Rerun viewer in a browser, after it has loaded a bag."""
    with TemporaryDirectory(prefix="cam_rig_") as folder:
        recording = Path(folder) / f"{bag.resolve().name}.rrd"
        begin = save_recording(bag, recording)
        with serve_file(recording, begin) as address:
            pixels = photograph(address, SHOWN, settled=series.VELOCITY_LINE.colour)
    Image.fromarray(pixels).save(path, optimize=True)


def photograph_tab(bag: Path, tab: Tab, begin: float, path: Path) -> None:
    """Write a screenshot of a tab of the viewer, with the time cursor near `begin` (s)."""
    with TemporaryDirectory(prefix="cam_rig_") as folder:
        recording = Path(folder) / f"{bag.resolve().name}.rrd"
        save_recording(bag, recording, ViewOptions(tab=tab))
        with serve_file(recording, begin) as address, open_browser() as browser:
            page, deadline = new_page(browser), time.monotonic() + TIMEOUT_S
            page.goto(address)
            for pixels in photographs(page, deadline):
                if count(pixels, colours.FOLLOWER) >= MIN_PIXELS:
                    break
            page.wait_for_timeout(LOADED_MS)
            pixels = next(photographs(page, time.monotonic() + TIMEOUT_S))
    Image.fromarray(pixels).quantize(PALETTE).save(path, optimize=True)
