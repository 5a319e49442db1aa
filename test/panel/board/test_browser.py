"""The page in a real browser: its numbers are the core's, by pointer and by keyboard."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

import cam_rig
from cam_rig.cad.dxf import read_dxf
from cam_rig.dynamics import FollowerParameters
from cam_rig.laws.continuity import joints
from cam_rig.panel.board.board import Board
from cam_rig.panel.board.drawn_law import ORDERS, POINTS, table_angles
from cam_rig.panel.board.pages import BoardPages
from cam_rig.panel.server import serve
from cam_rig.studies.jump.any_rig import find_jump
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
    panel.page.locator("#save").focus()
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


def test_a_wide_pull_takes_its_neighbours_along(panel: Panel, board: Board) -> None:
    """By a raised cosine of the cam angle: whole at the handle, half at half the width, and back
    home with it; a tenth of the lift is no undercut."""
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
    assert panel.text("faults") == ""
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
    assert [j.continuity for j in joints(board.law())][0] == 4
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
