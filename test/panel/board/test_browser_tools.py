"""What stands beside the curves: width of pull, stroboscope, languages, files to take along."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

import cam_rig
from cam_rig.laws.law import joints
from cam_rig.panel.board.board import Board
from cam_rig.panel.board.pages import BoardPages
from cam_rig.panel.server import serve
from cam_rig.profile.drawing_files import read_dxf
from tools.docs.browser import new_page

from ..conftest import Panel, Shared

if TYPE_CHECKING:
    from playwright.sync_api import Browser, WebSocketRoute

pytestmark = pytest.mark.slow


@pytest.fixture
def board(shared: Shared) -> Board:
    """The one that the page shows."""
    return shared.board


def test_a_wide_pull_takes_its_neighbours_along(panel: Panel, board: Board) -> None:
    """By a raised cosine of the cam angle: whole at the handle, half at half the width, and back
    home with it; a tenth of the lift can still be made."""
    panel.page.locator("#width").select_option("20")
    panel.page.locator(".handle").nth(7).focus()
    for press in ("PageUp", "PageUp"):
        panel.page.keyboard.press(press)
    panel.until(lambda: board.version >= 2)
    panel.settled()
    moved = board.ordinates - board.drawn.ordinates
    own = board.drawn.handles[7]
    for handle in board.drawn.handles:
        away = abs(handle.angle - own.angle) / np.radians(20.0)
        wanted = 0.05 * (1.0 + np.cos(np.pi * away)) if away < 1.0 else 0.0
        assert moved[handle.index] == pytest.approx(wanted, abs=1e-12)
    assert panel.page.locator("#not_made").is_hidden()
    panel.page.keyboard.press("Home")
    panel.until(lambda: abs(board.ordinates - board.drawn.ordinates)[own.index] < 1e-15)
    panel.page.locator("#width").select_option("0")


def test_a_wide_pull_ends_where_its_segment_does(panel: Panel, board: Board) -> None:
    """Beside a dwell the cosine is shorter on that side, and what joins there is as smooth."""
    panel.page.locator("#width").select_option("40")
    panel.drag(1, -3.0)
    panel.until(lambda: not np.array_equal(board.ordinates, board.drawn.ordinates))
    panel.settled()
    moved = board.ordinates - board.drawn.ordinates
    first, own = (moved[board.drawn.handles[i].index] for i in (0, 1))
    handles = board.drawn.handles[:2]
    part = (handles[1].left - handles[0].left) / handles[1].left
    assert first / own == pytest.approx(0.5 * (1.0 + np.cos(np.pi * part)))
    assert joints(board.law())[0].continuity == 4
    assert {j.continuity for j in joints(board.law())} == {2, 4}
    panel.page.locator("#width").select_option("0")


def test_the_middle_of_the_start_can_be_dragged_by_a_twentieth_of_its_lift(
    panel: Panel, board: Board
) -> None:
    """With the pull as the page begins, up and down: no undercut."""
    for down in (-12.0, 24.0):
        panel.drag(7, down)
        panel.settled()
        assert panel.page.locator("#not_made").is_hidden()
    law, angle = board.drawn.start.law, board.drawn.handles[7].angle
    panel.page.keyboard.press("Home")
    for wanted in (0.05, -0.05):
        ordinates = board.drawn.ordinates.copy()
        index = board.drawn.handles[7].index
        unit = ordinates.copy()
        unit[index] += 1.0
        lever = float(board.law(unit)(angle) - law(angle)) / law.lift
        ordinates[index] += wanted / lever
        board.take(ordinates.tolist(), 300)
        assert board.at_once()["faults"] == []


def test_a_stroboscope_shows_the_phase_of_each_flash(panel: Panel) -> None:
    """As often as the cam turns it stands still; a little slower it goes on by the rest; the
    roller is where the lift puts it."""
    page = panel.page
    degrees = "() => Number(document.querySelector('#strobe svg').dataset.degrees)"
    assert "stand still" in panel.text("seems")
    before = page.evaluate(degrees)
    for _ in range(3):
        page.locator("#flash").click()
    assert page.evaluate(degrees) == before
    page.locator("#flashes").fill("150")  # a whole fraction: two turns from flash to flash
    page.locator("#flash").click()
    assert page.evaluate(degrees) == before
    page.locator("#flashes").fill("288")  # 300/288 turns: 15° more with every flash
    assert "forwards at 12 rpm" in panel.text("seems")
    for step in range(1, 7):
        page.locator("#flash").click()
        assert page.evaluate(degrees) == pytest.approx(before + 15.0 * step, abs=0.01)
    law = cam_rig.build_law(cam_rig.load_cam("poly345"))
    assert f"{1e3 * float(law(np.pi / 2)):.3f} mm" in panel.text("phase")
    roller = page.locator("#strobe circle")
    scale = float(roller.get_attribute("r") or "nan") / 10.0
    height = -float(roller.get_attribute("cy") or "nan") / scale
    assert height == pytest.approx(75.0 + 1e3 * float(law(np.pi / 2)), abs=0.5)
    assert float(roller.get_attribute("cx") or "nan") == pytest.approx(0.0, abs=0.1)
    page.locator("#flashes").fill("312.5")
    assert "backwards at 12.5 rpm" in panel.text("seems")


def test_a_running_stroboscope_flashes_as_often_as_asked(panel: Panel) -> None:
    """Flashes are counted by the clock: frames that come late take none away."""
    page = panel.page
    page.locator("#flashes").fill("240")
    page.locator("#run").click()
    assert page.locator("#run").get_attribute("aria-pressed") == "true"
    angles = set()

    def seen() -> bool:
        angles.add(page.locator("#strobe svg").get_attribute("data-degrees"))
        return len(angles) >= 4  # 300/240 turns: four places

    panel.until(seen)
    page.locator("#run").click()
    found = sorted(float(angle or "nan") for angle in angles)
    assert found == pytest.approx([0.0, 90.0, 180.0, 270.0], abs=0.01)


def test_who_wants_less_motion_steps_by_a_button(chromium: Browser, shared: Shared) -> None:
    """There is no start of a motion that goes on by itself."""
    calm = Panel(new_page(chromium))
    calm.page.emulate_media(reduced_motion="reduce")
    calm.open(shared.address)
    assert calm.page.locator("#run").is_hidden()
    assert calm.page.locator("#flash").is_visible()
    calm.page.context.close()


def test_the_language_is_chosen_on_the_page_and_stays(panel: Panel) -> None:
    """Over a reload; numbers keep their point in both."""
    panel.page.locator("#languages [lang=es]").click()
    panel.until(lambda: "Velocidad de la leva" in panel.page.locator("#controls").inner_text())
    panel.page.reload()
    panel.until(lambda: panel.text("class").startswith("Escrita como B-splines"))
    assert panel.page.evaluate("() => document.documentElement.lang") == "es"
    panel.settled()
    assert panel.number("jump_rigid") == pytest.approx(458.67, abs=0.01)
    panel.page.locator("#languages [lang=en]").click()
    panel.until(lambda: "Cam speed" in panel.page.locator("#controls").inner_text())


def test_a_browser_in_spanish_has_spanish_pages(chromium: Browser, shared: Shared) -> None:
    """Where nothing else was chosen."""
    context = chromium.new_context(locale="es-EC")
    shown = Panel(context.new_page())
    shown.open(shared.address)
    assert "Ley de desplazamiento" in shown.page.locator("#law").inner_text()
    context.close()


def test_the_contour_is_downloaded_as_dxf(panel: Panel, tmp_path: Path) -> None:
    """By the cam's name; what cannot be made is refused in words."""
    panel.page.locator("#name").fill("workshop")
    with panel.page.expect_download() as waiting:
        panel.page.locator("#dxf").click()
    assert waiting.value.suggested_filename == "workshop.dxf"
    waiting.value.save_as(tmp_path / "workshop.dxf")
    (points,) = read_dxf(tmp_path / "workshop.dxf")
    assert np.hypot(*points).min() == pytest.approx(0.065, abs=1e-6)  # the base circle
    panel.page.locator(".handle").nth(7).focus()
    for _ in range(10):
        panel.page.keyboard.press("PageUp")
    panel.page.locator("#dxf").click()
    panel.until(lambda: "No DXF: cannot be made" in panel.text("status"))
    panel.until(lambda: len(panel.errors) > 0)
    assert panel.errors.pop().startswith("Failed to load resource")  # the refusal, 409


def test_the_command_that_designs_on_is_of_the_saved_cam(panel: Panel, board: Board) -> None:
    """It is there once there is a file to begin with, and is copied whole."""
    assert panel.page.locator("#design").is_hidden()
    panel.page.locator("#name").fill("begin")
    panel.page.locator("#save").click()
    panel.until(lambda: "Saved" in panel.text("status"))
    assert panel.text("command").startswith(f"cam-rig design {board.out}/begin.yaml --maximise")
    panel.page.locator("#copy").click()
    panel.until(lambda: panel.text("status") in ("Copied.", "Selected: copy it by Ctrl-C."))
    assert panel.page.evaluate("() => String(getSelection())") == panel.text("command")


def test_a_design_runs_beside_the_board_and_is_shown_dashed(panel: Panel, board: Board) -> None:
    """The board answers meanwhile; the designed law stands beside the start."""
    panel.page.locator("#name").fill("begin")
    panel.page.locator("#save").click()
    panel.until(lambda: "Saved" in panel.text("status"))
    panel.page.locator("#design_run").click()
    panel.until(lambda: "rpm so far" in panel.text("design_progress"))
    panel.drag(7, -4.0)
    panel.settled()
    assert panel.page.locator("#design_stop").is_visible()
    panel.until(lambda: panel.text("status").startswith("Designed: "))
    assert panel.path("chart2", "second") != ""
    assert (board.out / "begin_designed.yaml").exists()
    assert panel.page.locator("#design_run").is_visible()


def test_only_a_stand_in_shows_the_jump_speed_of_the_files_law(
    chromium: Browser, panel: Panel, tmp_path: Path
) -> None:
    """Where what is drawn is not quite the law, both are there."""
    assert panel.page.locator("#file_jump").is_hidden()
    cam, rig = cam_rig.load_cam("trigonometric"), cam_rig.load_rig("paper_table2")
    with serve(BoardPages(Board(cam, rig, tmp_path))) as served:
        shown = Panel(new_page(chromium))
        shown.open(served.address)
        shown.settled()
        own = cam_rig.jump_speed(cam_rig.build_law(cam), rig).rpm
        assert shown.number("file_jump") == pytest.approx(own, rel=1e-4)
        assert "the nearest" in shown.text("class")
        shown.page.context.close()


def test_a_connection_that_breaks_in_the_middle_of_a_drag_loses_nothing(
    chromium: Browser, tmp_path: Path
) -> None:
    """What is drawn without a connection is sent when it is back, not the server's older state."""
    cam, rig = cam_rig.load_cam("poly345"), cam_rig.load_rig("paper_table2")
    board, shown = Board(cam, rig, tmp_path), Panel(new_page(chromium))
    sockets: list[tuple[WebSocketRoute, WebSocketRoute]] = []
    shown.page.route_web_socket(
        "**/changes", lambda socket: sockets.append((socket, socket.connect_to_server()))
    )
    with serve(BoardPages(board)) as served:
        shown.open(served.address)
        handle = shown.page.locator(".handle").nth(7)
        box = handle.bounding_box()
        assert box is not None
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        shown.page.mouse.move(x, y)
        shown.page.mouse.down()
        shown.page.mouse.move(x, y + 5.0, steps=5)
        for side in sockets.pop():
            side.close()
        shown.until(lambda: "No connection" in shown.text("status"))
        before = board.version
        shown.page.mouse.move(x, y - 15.0, steps=5)
        index, unit = board.drawn.handles[7].index, 1e3 * board.cam.lift.si

        def arrived() -> bool:
            value = float(handle.get_attribute("aria-valuenow") or "nan")
            return abs(board.ordinates[index] * unit - value) <= 1e-4

        shown.until(lambda: sockets)
        shown.until(arrived)
        assert board.version > before
        assert board.ordinates[index] > board.drawn.ordinates[index]
        shown.page.mouse.up()
        shown.settled()
        shown.page.context.close()
