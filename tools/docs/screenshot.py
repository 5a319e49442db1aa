"""Screenshot of a run in the Rerun viewer, for the documents."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

from cam_rig.show import looks as colours
from cam_rig.viewer import quantities as series
from cam_rig.viewer.recording import save_recording
from cam_rig.viewer.rerun_page import serve_file
from tools.docs.browser import photograph

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


def photograph_viewer(bag: Path, path: Path) -> None:
    """Write a screenshot of the Rerun viewer in a browser, after it has loaded a bag."""
    with TemporaryDirectory(prefix="cam_rig_") as folder:
        recording = Path(folder) / f"{bag.resolve().name}.rrd"
        begin = save_recording(bag, recording)
        with serve_file(recording, begin) as address:
            pixels = photograph(address, SHOWN, settled=series.VELOCITY_LINE.colour)
    Image.fromarray(pixels).save(path, optimize=True)
