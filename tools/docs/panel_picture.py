"""The picture of the panel in the documents, as a browser shows it.

    .venv/bin/python -m tools.docs.panel_picture

``make pictures`` makes it too. An ordinate of the start is moved first, by the keyboard.
"""

from __future__ import annotations

import time
from pathlib import Path

from cam_rig.errors import CamRigError
from cam_rig.files import writing
from cam_rig.panel.board.board import Board
from cam_rig.panel.board.pages import BoardPages
from cam_rig.panel.server import serve
from cam_rig.schema import load_cam, load_rig
from cam_rig.schema.load import cam_path, rig_path
from cam_rig.show.command import user_errors
from cam_rig.show.terminal import console
from tools.docs.browser import TIMEOUT_S, new_page, open_browser

PICTURE = Path("docs/panel.png")
CAM, RIG, SECOND = "bezier15", "paper_table2", "poly345"
#: The handle that is moved, how, and how often.
HANDLE, KEY, TIMES = 2, "PageDown", 4
HEIGHT = 910
#: Whether all numbers are there, and of the law that is shown.
READY = """() => ["jump_rigid", "jump", "residual", "level"].every((id) => {
  const place = document.getElementById(id);
  return place && place.textContent !== "–" && !place.classList.contains("stale");
})"""


def photograph_panel(path: Path) -> None:
    """Write the drawing board with a moved ordinate and a second law.

    Raises
    ------
    CamRigError : there is no browser, or the page does not show all numbers
    """
    board = Board(load_cam(cam_path(CAM)), load_rig(rig_path(RIG)), Path("out"))
    with serve(BoardPages(board)) as served, open_browser(webgl=False) as browser:
        page = new_page(browser)
        page.set_viewport_size({"width": 1600, "height": HEIGHT})
        page.goto(served.address)
        handle = page.locator(".handle").nth(HANDLE)
        for _ in range(TIMES):
            handle.press(KEY)
        page.locator("#second").select_option(SECOND)
        page.locator("#chart0 .second[d^=M]").wait_for(state="attached")
        deadline = time.monotonic() + TIMEOUT_S
        while board.version < TIMES or not page.evaluate(READY):
            if time.monotonic() > deadline:
                raise CamRigError(f"{path}: the page does not show all numbers")
            page.wait_for_timeout(50)
        page.screenshot(path=path)


def main() -> None:
    """Write the picture into docs/."""
    with user_errors():
        with writing(PICTURE) as part:
            photograph_panel(part)
        console.print(f"{PICTURE}: {PICTURE.stat().st_size / 1e3:.0f} kB", soft_wrap=True)


if __name__ == "__main__":
    main()
