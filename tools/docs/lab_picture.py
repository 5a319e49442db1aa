"""The picture of the lab sheet in the documents, as a browser shows it.

    .venv/bin/python -m tools.docs.lab_picture

``make pictures`` makes it too. Readings are taken at the knob's whole speeds, a little beside the
jump speed as a person's are.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

from cam_rig.errors import CamRigError
from cam_rig.files import temporary_folder, writing
from cam_rig.panel.lab.pages import LabPages
from cam_rig.panel.lab.sheet import LabSheet
from cam_rig.panel.server import serve
from cam_rig.schema import load_cam, load_rig
from cam_rig.schema.load import cam_path, rig_path
from cam_rig.show.command import user_errors
from cam_rig.show.terminal import console
from tools.docs.browser import TIMEOUT_S, new_page, open_browser

if TYPE_CHECKING:
    from playwright.sync_api import Page

PICTURE = Path("docs/lab.png")
LAB, CAM, RIG = "jump", "poly345", "tm21"
#: Down to the table of readings; where they are kept is this machine's.
SIZE = {"width": 1600, "height": 792}
#: By how much (rpm) readings are beside the jump speed, one after the other.
BESIDE = (1.0, 0.0, 2.0)
#: Whether the force is that of the speed which is set.
SHOWN = """() => JSON.parse(document.body.dataset.shown || "{}").rpm
  === document.getElementById("rpm").valueAsNumber"""
LINE = "() => document.querySelector('#plot .theory').getAttribute('d')"


def photograph_lab(path: Path) -> None:
    """Write a lab sheet with its readings and the theory's line.

    Raises
    ------
    CamRigError : there is no browser, or the page does not show the force
    """
    sheet = LabSheet(LAB, load_cam(cam_path(CAM)), load_rig(rig_path(RIG)))
    with temporary_folder() as folder, open_browser(webgl=False) as browser:
        pages = LabPages(sheet, folder)
        for i, setup in enumerate(sheet.setups[1:]):
            rpm = round(sheet.jump_rpm(setup)) + BESIDE[i % len(BESIDE)]
            pages.notebook.record(vars(setup) | {"rpm": rpm})
        with serve(pages, home="/lab") as served:
            page = new_page(browser)
            page.set_viewport_size(SIZE)  # type: ignore[arg-type]
            page.goto(served.address)
            _until(page, SHOWN)
            page.locator("#rpm").fill(f"{round(sheet.jump_rpm(sheet.setups[0])) + 5}")
            page.locator("#rpm").press("Enter")
            page.locator("#theory").click()
            _until(page, LINE)
            _until(page, SHOWN)
            page.screenshot(path=path)


def _until(page: Page, condition: str) -> None:
    deadline = time.monotonic() + TIMEOUT_S
    while not page.evaluate(condition):
        if time.monotonic() > deadline:
            raise CamRigError(f"{PICTURE}: the page does not come to show the sheet")
        page.wait_for_timeout(50)


def main() -> None:
    """Write the picture into docs/."""
    with user_errors():
        with writing(PICTURE) as part:
            photograph_lab(part)
        console.print(f"{PICTURE}: {PICTURE.stat().st_size / 1e3:.0f} kB", soft_wrap=True)


if __name__ == "__main__":
    main()
