"""The page in a real browser: its numbers are the core's, by pointer and by keyboard."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

import cam_rig
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.jump.any_follower import find_jump
from cam_rig.panel.board.board import Board
from cam_rig.panel.board.drawn_law import ORDERS, POINTS, table_angles
from cam_rig.panel.board.pages import BoardPages
from cam_rig.panel.command import REDIRECT
from cam_rig.panel.server import serve
from cam_rig.units import RPM
from tools.docs.browser import new_page

from ..conftest import Panel, Shared

if TYPE_CHECKING:
    from playwright.sync_api import Browser

pytestmark = pytest.mark.slow


@pytest.fixture
def board(shared: Shared) -> Board:
    """The one that the page shows."""
    return shared.board


#: What the page computes differs from the core by no more than this part of the largest value.
SAME = 1e-12
#: The page's own modules, asked as the page asks them.
LAW_IN_PAGE = """async ([ordinates, rpm]) => {
  const { readTable, motion, contactForce } = await import("/static/board/law.js");
  const board = await (await fetch("/board")).json();
  const law = motion(readTable(board), ordinates);
  const all = Float64Array.from([...law, contactForce(law, board.rig, rpm)].flatMap((x) => [...x]));
  return btoa(String.fromCharCode(...new Uint8Array(all.buffer)));
}"""
SPECTRUM_IN_PAGE = """async (values) => {
  const { spectrum } = await import("/static/board/law.js");
  return [...spectrum(Float64Array.from(values), 40)];
}"""


def in_page(panel: Panel, ordinates: list[float], rpm: float) -> np.ndarray:
    """``(5, n)`` s to s''' and force of some ordinates, by the page's modules."""
    found = panel.page.evaluate(LAW_IN_PAGE, [ordinates, rpm])
    return np.frombuffer(base64.b64decode(found), dtype="<f8").reshape(ORDERS + 1, POINTS)


def core(board: Board, ordinates: list[float], rpm: float) -> np.ndarray:
    """The same of the law that `build_law` makes of the saved file."""
    path = board.save(f"core_{len(list(board.out.glob('*')))}", ordinates)
    law, rig = cam_rig.build_law(cam_rig.load_cam(path)), FollowerParameters.from_rig(board.rig)
    rows = [law(table_angles(), order) for order in range(ORDERS)]
    force = rig.mass * rows[2] * (rpm * RPM) ** 2 + rig.damping * rows[1] * (rpm * RPM)
    force += rig.spring_stiffness * rows[0] + rig.preload
    return np.stack([*rows, force])


def test_the_pages_law_and_force_are_the_cores(panel: Panel, board: Board) -> None:
    """To 1e-12 of the largest value; an ordinate off by 1e-6 is seen."""
    ordinates = board.ordinates.tolist()
    for i, handle in enumerate(board.drawn.handles):
        ordinates[handle.index] += 0.01 * np.sin(3.0 * i)
    wanted = core(board, ordinates, 431.0)
    largest = np.abs(wanted).max(axis=1, keepdims=True)
    off = np.abs(in_page(panel, ordinates, 431.0) - wanted) / largest
    assert off.max() <= SAME
    ordinates[board.drawn.handles[7].index] += 1e-6
    control = np.abs(in_page(panel, ordinates, 431.0) - wanted) / largest
    assert (control.max(axis=1) > 1e3 * SAME).all()


def test_the_pages_spectrum_is_the_fourier_transform(panel: Panel) -> None:
    """Amplitudes by order, as numpy's."""
    values = np.random.default_rng(1).standard_normal(POINTS)
    found = panel.page.evaluate(SPECTRUM_IN_PAGE, values.tolist())
    wanted = 2.0 / POINTS * np.abs(np.fft.rfft(values))[1:41]
    assert np.abs(np.array(found) - wanted).max() <= 1e-12


def test_a_dragged_handle_moves_the_law_and_all_that_follows(panel: Panel, board: Board) -> None:
    """Its numbers are those of `jump_speed` for the law that the server holds."""
    charts = ("chart0", "chart1", "chart2", "chart3", "force", "spectrum")
    before = [panel.path(chart) for chart in charts]
    panel.drag(7, -4.0)
    panel.until(lambda: not np.array_equal(board.ordinates, board.drawn.ordinates))
    panel.settled()
    moved = np.flatnonzero(board.ordinates != board.drawn.ordinates)
    assert moved.tolist() == [board.drawn.handles[7].index]
    assert board.ordinates[moved[0]] > board.drawn.ordinates[moved[0]]
    law = board.law()
    rigid = find_jump(law, FollowerParameters.from_rig(board.rig), None).rpm
    assert panel.number("jump_rigid") == pytest.approx(rigid, rel=1e-4)
    assert panel.number("jump") == pytest.approx(cam_rig.jump_speed(law, board.rig).rpm, rel=1e-4)
    after = [panel.path(chart) for chart in charts]
    assert all(one != other for one, other in zip(before, after, strict=True))


def test_the_curve_goes_where_the_pointer_does(panel: Panel, board: Board) -> None:
    """A handle that is dragged stays under the pointer."""
    handle = panel.page.locator(".handle").nth(10)
    y = float(handle.get_attribute("cy") or "nan")
    panel.drag(10, 5.0)
    panel.until(lambda: not np.array_equal(board.ordinates, board.drawn.ordinates))
    panel.page.evaluate("() => new Promise(requestAnimationFrame)")
    lift = float((handle.get_attribute("aria-valuetext") or "").split()[1])
    angle = board.drawn.handles[10].angle
    assert lift == pytest.approx(1e3 * float(board.law()(angle)), abs=0.3)
    assert float(handle.get_attribute("cy") or "nan") == pytest.approx(y + 5.0, abs=1.5)


def test_the_last_value_of_a_drag_arrives(panel: Panel, board: Board) -> None:
    """However many moves, the server ends with the law that is shown."""
    for down in (3.0, -5.0, 2.0):
        panel.drag(9, down)
    index = board.drawn.handles[9].index
    handle = panel.page.locator(".handle").nth(9)
    unit = 1e3 * board.cam.lift.si

    def same() -> bool:
        shown = float(handle.get_attribute("aria-valuenow") or "nan")
        return abs(board.ordinates[index] * unit - shown) <= 1e-3

    panel.until(same)
    panel.settled()
    assert board.ordinates[index] != board.drawn.ordinates[index]


def test_the_keyboard_alone_moves_undoes_and_resets(panel: Panel, board: Board) -> None:
    """Tab to a handle, arrows; Ctrl-Z, Ctrl-Y; Home; focus stays where it is."""
    keys, index = panel.page.keyboard, board.drawn.handles[5].index
    panel.page.locator("#on_bench").focus()
    for _ in range(6):
        keys.press("Tab")
    focused = "() => Number(document.activeElement.dataset.index)"
    assert panel.page.evaluate(focused) == index
    start = board.drawn.ordinates[index]
    for press, wanted in (
        ("ArrowUp", 0.005),
        ("Shift+ArrowDown", 0.0045),
        ("PageUp", 0.0545),
        ("Control+z", 0.0045),
        ("Control+z", 0.005),
        ("Control+y", 0.0045),
        ("Home", 0.0),
        ("Control+z", 0.0045),
    ):
        keys.press(press)
        panel.until(lambda w=wanted: abs(board.ordinates[index] - start - w) < 1e-12)
        assert panel.page.evaluate(focused) == index
    panel.page.locator("#reset").press("Enter")
    panel.until(lambda: np.array_equal(board.ordinates, board.drawn.ordinates))


def test_the_knob_turns_the_force(panel: Panel, board: Board) -> None:
    """By its keys and by the number beside it, up to 1e5 rpm; the law stays."""
    before = panel.path("force")
    panel.page.locator("#knob").press("PageUp")
    panel.until(lambda: board.rpm == 310.0)
    panel.until(lambda: panel.path("force") != before)
    panel.page.locator("#rpm").fill("100000")
    panel.page.locator("#rpm").press("Enter")
    panel.until(lambda: board.rpm == 1e5)
    panel.settled()
    assert "Below zero" in panel.text("contact")
    assert np.array_equal(board.ordinates, board.drawn.ordinates)


def test_a_law_that_cannot_be_made_is_named_and_the_last_good_force_stays(
    panel: Panel, board: Board
) -> None:
    """Undercut: red, with its angle; undone, all is well again."""
    force = panel.path("force")
    panel.page.locator(".handle").nth(7).focus()
    for _ in range(10):
        panel.page.keyboard.press("PageUp")
    panel.until(lambda: "that of the last one that can" in panel.text("contact"))
    panel.settled()
    assert "curvature" in panel.text("faults")
    assert panel.page.locator("#contour .bad").count() > 0
    assert panel.page.locator("#not_made").is_visible()
    assert "not_made" in (panel.page.locator("#readouts").get_attribute("class") or "")
    for _ in range(10):
        panel.page.keyboard.press("Control+z")
    panel.until(lambda: np.array_equal(board.ordinates, board.drawn.ordinates))
    panel.until(lambda: panel.text("faults") == "")
    panel.until(lambda: panel.path("force") == force)
    assert panel.page.locator("#not_made").is_hidden()


def test_a_start_that_cannot_be_made_has_the_force_of_its_motion(
    chromium: Browser, tmp_path: Path
) -> None:
    """There is no last good one, and the page does not speak of one."""
    good = Board(cam_rig.load_cam("poly345"), cam_rig.load_rig("paper_table2"), tmp_path)
    ordinates = good.ordinates.tolist()
    ordinates[good.drawn.handles[7].index] += 0.5
    cam = cam_rig.load_cam(good.save("undercut", ordinates))
    with serve(BoardPages(Board(cam, good.rig, tmp_path))) as served:
        shown = Panel(new_page(chromium))
        shown.open(served.address)
        shown.until(lambda: "force shown is that of its motion" in shown.text("contact"))
        assert shown.path("force") == shown.path("force", "ghost")
        shown.page.context.close()


def test_a_saved_file_is_the_law_that_is_shown(panel: Panel, board: Board) -> None:
    """The button writes it; a second of that name is refused in words."""
    panel.drag(16, 3.0)
    panel.settled()
    panel.page.locator("#name").fill("mine")
    panel.page.locator("#save").click()
    panel.until(lambda: "Saved" in panel.text("status"))
    law = cam_rig.build_law(cam_rig.load_cam(board.out / "mine.yaml"))
    assert np.abs(law.ordinates - board.law().ordinates).max() <= SAME * law.lift
    panel.page.locator("#save").click()
    panel.until(lambda: "exists already" in panel.text("status"))
    assert panel.errors.pop().startswith("Failed to load resource")  # the refusal, 409


def test_a_reload_in_the_middle_keeps_what_is_drawn(panel: Panel, board: Board) -> None:
    """The server keeps the board, not the page."""
    panel.drag(7, -4.0)
    panel.settled()
    shown, ordinates = panel.path("chart0"), board.ordinates
    panel.page.reload()
    panel.until(lambda: panel.number("jump_rigid") is not None)
    assert panel.path("chart0") == shown
    assert np.array_equal(board.ordinates, ordinates)


def test_a_second_page_follows_the_first(chromium: Browser, panel: Panel, shared: Shared) -> None:
    """Both show the board; the last change wins."""
    other = Panel(new_page(chromium))
    other.open(shared.address)
    panel.drag(7, -4.0)
    panel.settled()
    other.until(lambda: other.number("jump_rigid") == panel.number("jump_rigid"))
    assert other.path("chart0") == panel.path("chart0")
    other.drag(22, 4.0)
    other.settled()
    panel.until(lambda: panel.path("chart0") == other.path("chart0"))
    other.page.context.close()


def test_a_second_law_and_the_start_are_shown_beside(panel: Panel) -> None:
    """Each curve apart; none is taken away again."""
    assert panel.path("chart2", "ghost") != ""
    panel.page.locator("#second").select_option("cycloidal")
    panel.until(lambda: panel.page.locator("#chart2 .second").count() == 1)
    panel.until(lambda: panel.path("force", "second") != "")
    panel.page.locator("#second").select_option("")
    panel.until(lambda: panel.path("force", "second") == "")


@pytest.mark.parametrize("width", [400, 1000, 1600])
def test_nothing_sticks_out_of_the_page(panel: Panel, width: int) -> None:
    """No scrolling sideways at any width, and each handle is within its chart."""
    panel.page.set_viewport_size({"width": width, "height": 800})
    panel.page.evaluate(
        "() => new Promise((done) => setTimeout(() => requestAnimationFrame(done)))"
    )
    assert panel.page.evaluate("() => document.documentElement.scrollWidth") <= width
    chart = panel.page.locator("#chart0").bounding_box()
    assert chart is not None
    for i in (0, 29):
        box = panel.page.locator(".handle").nth(i).bounding_box()
        assert box is not None
        assert chart["x"] <= box["x"] <= chart["x"] + chart["width"]


@pytest.mark.parametrize("name", ["bezier15", "conjugate"])
def test_any_cam_and_rig_can_be_drawn(chromium: Browser, tmp_path: Path, name: str) -> None:
    """Own ordinates, and a frame with two discs, on a rig of one mass."""
    board = Board(cam_rig.load_cam(name), cam_rig.load_rig("tm21"), tmp_path)
    with serve(BoardPages(board)) as served:
        shown = Panel(new_page(chromium))
        shown.page.goto(served.address)
        shown.until(lambda: shown.text("level") not in ("–", "None"))
        assert shown.page.locator("#contour .curve").count() >= 1
        assert shown.page.locator(".handle").count() == len(board.drawn.handles)
        shown.page.context.close()
    assert shown.errors == []


def test_the_file_of_a_browser_leads_to_the_page(
    chromium: Browser, address: str, tmp_path: Path
) -> None:
    """From a file, which is of no site: the cookie is sent all the same, and the token goes."""
    opened = tmp_path / "panel.html"
    opened.write_text(REDIRECT.format(address=address), encoding="utf-8")
    page = new_page(chromium)
    page.goto(opened.as_uri())
    page.wait_for_url(address.partition("?")[0])
    page.locator(".handle").first.wait_for()
    page.context.close()
