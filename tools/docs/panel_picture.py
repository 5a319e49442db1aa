"""Pictures of the drawing board and the lab sheet, as displayed by a browser.

    .venv/bin/python -m tools.docs.panel_picture

``make pictures`` draws them too. Both are pages of `cam-rig panel`.
"""

from __future__ import annotations

from pathlib import Path

from cam_rig.files import temporary_folder
from cam_rig.panel.board.board import Board
from cam_rig.panel.board.pages import BoardPages
from cam_rig.panel.export.page import export_board
from cam_rig.panel.lab.labs import JumpSheet
from cam_rig.panel.lab.pages import LabPages
from cam_rig.panel.server import serve
from cam_rig.schema import load_cam, load_rig
from cam_rig.schema.load import cam_path, rig_path
from tools.docs.browser import new_page, open_browser, save_picture, until

#: File of the picture of the drawing board.
BOARD = Path("docs/panel.png")
#: File of the picture of the static board.
STATIC = Path("docs/static_board.png")
#: Cam speed of the static board (rpm), at which the follower flies.
FLIGHT_RPM = 900
#: Cam angle of the static board (deg), at which the follower is in flight.
FLIGHT_DEG = 150
#: File of the picture of the lab sheet.
LAB = Path("docs/lab.png")
#: Cam of the drawing board.
CAM = "bezier15"
#: Rig of both pictures.
RIG = "paper_table2"
#: Second cam of the drawing board, and cam of the lab sheet.
SECOND_CAM = "poly345"
#: Index of the ordinate (handle) that is moved.
HANDLE = 2
#: Key that moves the handle.
KEY = "PageDown"
#: Number of key presses.
KEY_PRESSES = 4
#: Height of the picture (px).
HEIGHT = 1010
#: JavaScript condition that all numbers are displayed and are those of the displayed law.
READY = """() => ["jump_rigid", "jump", "residual", "level"].every((id) => {
  const place = document.getElementById(id);
  return place && place.textContent !== "–" && !place.classList.contains("stale");
})"""


#: Size (px) down to the table of readings. The path of the readings below it differs by machine.
SIZE = {"width": 1600, "height": 792}
#: Differences (rpm) of the readings from the jump speed.
BESIDE = (1.0, 0.0, 2.0)
#: JavaScript condition that the displayed force is that of the set speed.
SHOWN = """() => JSON.parse(document.body.dataset.shown || "{}").rpm
  === Number(document.getElementById("rpm").value)"""
LINE = "() => document.querySelector('#plot .theory').getAttribute('d')"


def photograph_panel(path: Path) -> None:
    """Write a picture of the drawing board with a moved ordinate and a second law."""
    board = Board(load_cam(cam_path(CAM)), load_rig(rig_path(RIG)), Path("out"))
    with serve(BoardPages(board)) as served, open_browser(webgl=False) as browser:
        page = new_page(browser)
        page.set_viewport_size({"width": 1600, "height": HEIGHT})
        page.goto(served.address)
        handle = page.locator(".handle").nth(HANDLE)
        for _ in range(KEY_PRESSES):
            handle.press(KEY)
        page.locator("#second").select_option(SECOND_CAM)
        page.locator("#chart0 .second[d^=M]").wait_for(state="attached")
        until(page, READY, lambda: board.version >= KEY_PRESSES)
        page.screenshot(path=path)


def photograph_static(path: Path) -> None:
    """Write a picture of the exported board, opened as a file, with a follower in flight."""
    with temporary_folder() as folder, open_browser(webgl=False) as browser:
        board = Board(load_cam(cam_path(CAM)), load_rig(rig_path(RIG)), folder)
        page = new_page(browser)
        page.set_viewport_size({"width": 1280, "height": 800})
        page.goto(export_board(folder, board, "en").as_uri())
        page.locator("#contour .body").wait_for(state="attached")
        page.locator("#rpm").fill(str(FLIGHT_RPM))
        page.locator("#rpm").press("Enter")
        page.locator("#cursor").fill(str(FLIGHT_DEG))
        until(page, "() => document.getElementById('contact').textContent.includes('landing')")
        page.screenshot(path=path)


def photograph_lab(path: Path) -> None:
    """Write a picture of a lab sheet with readings and the theoretical curve.

    The readings are at whole rpm close to the jump speed, as those of a student.
    """
    sheet = JumpSheet(load_cam(cam_path(SECOND_CAM)), load_rig(rig_path("tm21")))
    with temporary_folder() as folder, open_browser(webgl=False) as browser:
        pages = LabPages(sheet, folder)
        for i, setup in enumerate(sheet.setups[1:]):
            rpm = round(sheet.true(setup)) + BESIDE[i % len(BESIDE)]
            pages.notebook.record(vars(setup) | {"rpm": rpm})
        with serve(pages, home="/lab") as served:
            page = new_page(browser)
            page.set_viewport_size(SIZE)  # type: ignore[arg-type]
            page.goto(served.address)
            page.wait_for_url(lambda url: "token" not in url)
            until(page, SHOWN)
            page.locator("#rpm").fill(f"{round(sheet.true(sheet.setups[0])) + 5}")
            page.locator("#rpm").press("Enter")
            page.locator("#plot_it").click()
            page.locator("#theory").click()
            until(page, LINE)
            until(page, SHOWN)
            page.screenshot(path=path)


if __name__ == "__main__":
    save_picture(BOARD, photograph_panel)
    save_picture(STATIC, photograph_static)
    save_picture(LAB, photograph_lab)
