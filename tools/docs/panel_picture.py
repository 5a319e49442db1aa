"""The picture of the panel in the documents, as a browser shows it.

    .venv/bin/python -m tools.docs.panel_picture

``make pictures`` makes it too. An ordinate of the start is moved first, by the keyboard.
"""

from __future__ import annotations

from pathlib import Path

from cam_rig.panel.board.board import Board
from cam_rig.panel.board.pages import BoardPages
from cam_rig.panel.server import serve
from cam_rig.schema import load_cam, load_rig
from cam_rig.schema.load import cam_path, rig_path
from tools.docs.browser import new_page, open_browser, put, until

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
    """Write the drawing board with a moved ordinate and a second law."""
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
        until(page, READY, lambda: board.version >= TIMES)
        page.screenshot(path=path)


if __name__ == "__main__":
    put(PICTURE, photograph_panel)
