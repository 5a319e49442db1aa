"""The drawing board page in a real browser, by pointer and keyboard."""

import base64
import re

import numpy as np
import pytest

import cam_rig
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.jump.any_follower import find_jump
from cam_rig.dynamics.kinetostatic import shaft_torque
from cam_rig.laws.law import joints
from cam_rig.panel.board.board import START_RPM, Board
from cam_rig.panel.board.pages import BoardPages
from cam_rig.panel.command import REDIRECT
from cam_rig.panel.server import serve
from cam_rig.profile.read_dxf import read_dxf
from cam_rig.units import RPM, TURN

from .conftest import BrowserPage, in_browser, with_moved_ordinate

pytestmark = pytest.mark.slow
#: Tolerance of the page's results, relative to their largest value.
RTOL = 1e-12
#: Number of points of a turn that the page draws, `MOTION_POINTS` of board/law.js.
MOTION_POINTS = 720
#: Script that computes law, force and torque with the page's own JavaScript modules.
LAW_IN_PAGE = """async ([ordinates, rpm]) => {
  const { DrawnLaw, motionOf, contactForce, camTorque } = await import("/static/board/law.js");
  const board = await (await fetch("/board")).json();
  const law = motionOf(new DrawnLaw(board).of(ordinates));
  const force = contactForce(law, board.rig, rpm);
  const all = Float64Array.from([...law, force, camTorque(law, force)].flatMap((x) => [...x]));
  return btoa(String.fromCharCode(...new Uint8Array(all.buffer)));
}"""
SPECTRUM_IN_PAGE = """async (values) => {
  const { spectrum } = await import("/static/board/law.js");
  return [...spectrum(Float64Array.from(values), 40)];
}"""
FOCUSED = "() => Number(document.activeElement.dataset.index)"
SIZE = {"width": 1280, "height": 900}
REFUSED = "Failed to load resource"  # Chromium's message for status 409


class BoardPage(BrowserPage):
    """Page of the drawing board in a browser."""

    def open(self, address, path=""):
        """Open the page with the controls for experts."""
        super().open(address, path)
        script = "e => { e.open = true; sessionStorage.setItem('expert', 'open'); }"
        self.page.locator("#expert").evaluate(script)

    def stale(self, name):
        script = "id => document.getElementById(id).classList.contains('stale')"
        return bool(self.page.evaluate(script, name))

    def settled(self):
        """Wait until all displayed numbers are those of the displayed law."""
        names = ("jump_rigid", "jump", "residual", "level")
        self.until(lambda: self.number("jump_rigid") is not None)
        self.until(lambda: not any(self.stale(name) for name in names))

    def grab(self, handle):
        """Press the pointer on a handle, and return its position (px)."""
        box = self.page.locator(".handle").nth(handle).bounding_box()
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        self.page.mouse.move(x, y)
        self.page.mouse.down()
        return x, y

    def drag(self, handle, down):
        """Press the pointer on a handle, move it down by `down` (px), and release it."""
        x, y = self.grab(handle)
        self.page.mouse.move(x, y + down, steps=6)
        self.page.mouse.up()

    def press(self, key, times=1):
        for _ in range(times):
            self.page.keyboard.press(key)

    def choose(self, name, value):
        """Choose a cam or a rig, which reloads the page."""
        with self.page.expect_event("load"):
            self.page.locator(f"#{name}").select_option(value)

    def save(self, name):
        self.page.locator("#name").fill(name)
        self.page.locator("#save").click()


@pytest.fixture
def board(served):
    """Board that the page displays."""
    return served.board


@pytest.fixture(scope="module")
def window(chromium):
    """One browser window for all tests of the page. Each test restores the start law."""
    with in_browser(chromium, BoardPage) as page:
        yield page


@pytest.fixture
def page(window, served, tmp_path):
    """Page of the board in its initial state. It is checked for errors afterwards."""
    served.board.out = tmp_path / "out"
    served.board.update(served.board.drawn.ordinates.tolist(), START_RPM)
    window.page.set_viewport_size(SIZE)
    window.open(served.address)
    window.settled()
    yield window
    window.page.evaluate("() => sessionStorage.clear()")  # removes the selected language
    faults, window.errors, window.outside = [*window.errors, *window.outside], [], []
    assert faults == []


def in_page(page, ordinates, rpm):
    """Return s to s''', force and torque, computed by the page's JavaScript, shape (6, n)."""
    data = page.page.evaluate(LAW_IN_PAGE, [ordinates, rpm])
    return np.frombuffer(base64.b64decode(data), dtype="<f8").reshape(6, MOTION_POINTS)


def library_curves(board, ordinates, rpm):
    """Return s to s''', force and torque, computed by the library, shape (6, n)."""
    law, rig = board.law(np.array(ordinates)), FollowerParameters.from_rig(board.rig)
    angles = np.linspace(0.0, TURN, MOTION_POINTS, endpoint=False)
    rows = [law(angles, order) for order in range(4)]
    force = rig.mass * rows[2] * (rpm * RPM) ** 2 + rig.damping * rows[1] * (rpm * RPM)
    force += rig.spring_stiffness * rows[0] + rig.preload
    torque = [shaft_torque(law, rig, angle, rpm * RPM) for angle in angles.tolist()]
    # The library's torque is 0 if the force is negative.
    return np.stack([*rows, force, np.where(force < 0.0, force * rows[1], torque)])


def test_law_force_and_spectrum_of_the_page_are_those_of_the_library(page, board):
    """Law, force and torque that the page computes agree with the library to 1e-12.

    The spectrum agrees with numpy. As a control, a change of 1e-6 of an ordinate must be detected.
    """
    ordinates = board.ordinates.tolist()
    for i, handle in enumerate(board.drawn.handles):
        ordinates[handle.index] += 0.01 * np.sin(3.0 * i)
    expected = library_curves(board, ordinates, 431.0)
    largest = np.abs(expected).max(axis=1, keepdims=True)
    off = np.abs(in_page(page, ordinates, 431.0) - expected) / largest
    assert off.max() <= RTOL
    ordinates[board.drawn.handles[7].index] += 1e-6
    control = np.abs(in_page(page, ordinates, 431.0) - expected) / largest
    assert (control.max(axis=1) > 1e3 * RTOL).all()
    values = np.random.default_rng(1).standard_normal(MOTION_POINTS)
    spectrum = page.page.evaluate(SPECTRUM_IN_PAGE, values.tolist())
    assert (
        np.abs(np.array(spectrum) - 2.0 / MOTION_POINTS * np.abs(np.fft.rfft(values))[1:41]).max()
        <= RTOL
    )


def test_a_dragged_handle_changes_the_law_and_its_results(page, board):
    """Dragging a handle changes its ordinate on page and server, and all results.

    The jump speeds are those of the library. The handle follows the pointer.
    """
    charts = ("chart0", "chart1", "chart2", "chart3", "force", "spectrum")
    before = [page.path(chart) for chart in charts]
    page.drag(7, -12.0)
    page.until(lambda: not np.array_equal(board.ordinates, board.drawn.ordinates))
    page.settled()
    assert page.page.locator("#not_made").is_hidden()
    moved = np.flatnonzero(board.ordinates != board.drawn.ordinates)
    assert moved.tolist() == [board.drawn.handles[7].index]
    assert board.ordinates[moved[0]] > board.drawn.ordinates[moved[0]]
    law = board.law()
    rigid = find_jump(law, FollowerParameters.from_rig(board.rig), None).rpm
    assert page.number("jump_rigid") == pytest.approx(rigid, rel=1e-4)
    assert page.number("jump") == pytest.approx(cam_rig.jump_speed(law, board.rig).rpm, rel=1e-4)
    after = [page.path(chart) for chart in charts]
    assert all(old != new for old, new in zip(before, after, strict=True))

    handle, y = page.page.locator(".handle").nth(10), []
    for down in (0.0, 5.0):
        version = board.version
        page.drag(10, down)
        page.until(lambda v=version, d=down: not d or board.version > v)
        page.page.evaluate("() => new Promise(requestAnimationFrame)")
        y.append(float(handle.get_attribute("cy") or "nan"))
    lift = float((handle.get_attribute("aria-valuetext") or "").split()[1])
    page.settled()
    assert lift == pytest.approx(1e3 * float(board.law()(board.drawn.handles[10].angle)), abs=0.3)
    assert y[1] == pytest.approx(y[0] + 5.0, abs=1.5)

    for down in (3.0, -5.0, 2.0):
        page.drag(9, down)
    page.until(lambda: handle_error_mm(page, board, 9) <= 1e-3)
    page.settled()
    index = board.drawn.handles[9].index
    assert board.ordinates[index] != board.drawn.ordinates[index]


def handle_error_mm(page, board, i):
    """Return the difference (mm) of a handle's ordinate between page and server."""
    displayed = float(page.page.locator(".handle").nth(i).get_attribute("aria-valuenow") or "nan")
    return abs(board.ordinates[board.drawn.handles[i].index] * 1e3 * board.cam.lift.si - displayed)


@pytest.mark.long
def test_all_pages_display_the_same_board_and_a_reload_keeps_it(chromium, page, board, served):
    """A change on one page appears on all open pages and remains after a reload.

    A browser in Spanish gets Spanish pages.
    """
    with in_browser(chromium, BoardPage, locale="es-EC") as other:
        other.open(served.address)
        other.settled()
        assert "Ley de movimiento" in other.page.locator("#law").inner_text()
        page.drag(7, -4.0)
        page.settled()
        page.until(lambda: other.number("jump_rigid") == page.number("jump_rigid"))
        other.drag(22, 4.0)
        other.settled()
        moved = [board.drawn.handles[i].index for i in (7, 22)]
        page.until(lambda: np.all((board.ordinates != board.drawn.ordinates)[moved]))
        page.until(lambda: page.number("jump_rigid") == other.number("jump_rigid"))
    page.settled()
    shown, ordinates = page.path("chart0"), board.ordinates
    page.page.reload()
    page.settled()
    assert page.path("chart0") == shown
    assert np.array_equal(board.ordinates, ordinates)


def test_the_keyboard_moves_undoes_and_resets(page, board):
    """Keys move a handle, undo, redo and reset, and the handle keeps the focus.

    Keys on the speed knob change only speed and force.
    """
    index = board.drawn.handles[5].index
    page.page.locator("#link").focus()
    page.press("Tab", 6)
    assert page.page.evaluate(FOCUSED) == index
    start = board.drawn.ordinates[index]
    for press, offset in (
        ("ArrowUp", 0.005),
        ("Shift+ArrowDown", 0.0045),
        ("PageUp", 0.0545),
        ("Control+z", 0.0045),
        ("Control+z", 0.005),
        ("Control+y", 0.0045),
        ("Home", 0.0),
        ("Control+z", 0.0045),
    ):
        page.press(press)
        page.until(lambda w=offset: abs(board.ordinates[index] - start - w) < 1e-12)
        assert page.page.evaluate(FOCUSED) == index
    page.page.locator("#reset").press("Enter")
    page.until(lambda: np.array_equal(board.ordinates, board.drawn.ordinates))
    page.page.evaluate("() => new Promise(requestAnimationFrame)")

    before = page.path("force")
    page.page.locator("#knob").press("PageUp")
    page.until(lambda: board.rpm == 310.0)
    page.until(lambda: page.path("force") != before)
    page.enter("rpm", 100000)
    page.until(lambda: board.rpm == 1e5)
    page.settled()
    assert not board.out.exists()  # Enter in the field of the speed does not save a file
    page.until(lambda: "below zero" in page.text("contact"))
    assert np.array_equal(board.ordinates, board.drawn.ordinates)


def test_a_law_that_cannot_be_made_is_reported_and_the_last_good_force_stays(page, board):
    """An undercut law is reported, and its DXF is refused.

    The displayed force remains that of the last law that can be made. After undo no fault is
    displayed.
    """
    force = page.path("force")
    page.page.locator(".handle").nth(7).focus()
    page.press("PageUp", 10)
    page.until(lambda: "that of the last cam that can be made" in page.text("contact"))
    page.settled()
    assert "curvature" in page.text("faults")
    assert page.page.locator("#contour .bad").count() > 0
    assert page.page.locator("#not_made").is_visible()
    assert "not_made" in (page.page.locator("#results").get_attribute("class") or "")
    page.page.locator("#dxf").click()
    page.until(lambda: "No DXF: cannot be made" in page.text("status"))
    page.until(lambda: len(page.errors) > 0)
    assert page.errors.pop().startswith(REFUSED)
    page.press("Control+z", 10)
    page.until(lambda: np.array_equal(board.ordinates, board.drawn.ordinates))
    page.until(lambda: page.text("faults") == "")
    page.until(lambda: page.path("force") == force)
    assert page.page.locator("#not_made").is_hidden()


def test_the_drawn_law_can_be_saved_copied_and_downloaded(page, board, tmp_path):
    """The page saves the law, copies its design command and downloads a DXF.

    A second save under the same name is refused.
    """
    assert page.page.locator("#design").is_hidden()
    page.drag(16, 3.0)
    page.settled()
    page.save("mine")
    page.until(lambda: "Saved" in page.text("status"))
    law = cam_rig.build_law(cam_rig.load_cam(board.out / "mine.yaml"))
    assert np.abs(law.ordinates - board.law().ordinates).max() <= RTOL * law.lift
    assert page.text("command").startswith(f"cam-rig design {board.out}/mine.yaml --maximise")
    page.page.locator("#copy").click()
    page.until(lambda: page.text("status") in ("Copied.", "Selected. Copy it by Ctrl-C."))
    assert page.page.evaluate("() => String(getSelection())") == page.text("command")
    page.page.locator("#save").click()
    page.until(lambda: "exists already" in page.text("status"))
    assert page.errors.pop().startswith(REFUSED)
    with page.page.expect_download() as waiting:
        page.page.locator("#dxf").click()
    assert waiting.value.suggested_filename == "mine.dxf"
    waiting.value.save_as(tmp_path / "mine.dxf")
    (points,) = read_dxf(tmp_path / "mine.dxf").curves
    assert np.hypot(*points).min() == pytest.approx(0.065, abs=1e-6)  # the base circle, m


@pytest.mark.long
def test_the_start_another_law_and_a_design_are_displayed_for_comparison(page, board):
    """Start law, another law and a finished design are drawn for comparison.

    The board can be changed while the design is computed.
    """
    assert page.path("chart2", "ghost") != ""
    page.page.locator("#second").select_option("cycloidal")
    page.until(lambda: page.page.locator("#chart2 .second").count() == 1)
    page.until(lambda: page.path("force", "second") != "")
    page.page.locator("#second").select_option("")
    page.until(lambda: page.path("force", "second") == "")

    page.save("begin")
    page.until(lambda: "Saved" in page.text("status"))
    page.page.locator("#design_run").click()
    page.until(lambda: "rpm so far" in page.text("design_progress"))
    assert page.page.locator("#design_stop").is_visible()
    page.drag(7, -4.0)
    page.settled()
    page.until(lambda: page.text("status").startswith("Designed: "))
    assert (board.out / "begin_designed.yaml").exists()
    page.until(lambda: page.path("chart2", "second") != "")
    assert page.page.locator("#design_run").is_visible()


def test_no_element_sticks_out_and_the_chosen_language_stays(page):
    """The page fits windows of 400 to 1600 px, with every handle inside its chart.

    The selected language remains after a reload. Spanish numbers have a decimal comma.
    """
    page.page.locator("#languages [lang=es]").click()
    page.until(lambda: "Velocidad de la leva" in page.page.locator("#controls").inner_text())
    page.page.reload()
    page.until(lambda: page.text("class").startswith("B-splines de grado"))
    assert page.page.evaluate("() => document.documentElement.lang") == "es"
    page.settled()
    assert page.text("jump_rigid") == "458,67 rpm"
    page.save("X")
    page.until(lambda: page.text("status").startswith("No se ha guardado: nombre: se admite una"))
    clear_refusals(page)
    page.page.locator("#languages [lang=en]").click()
    page.until(lambda: "Cam speed" in page.page.locator("#controls").inner_text())
    page.settled()
    for width in (400, 1000, 1600):
        assert page.width(width) <= width
        chart = page.page.locator("#chart0").bounding_box()
        for i in (0, 29):
            box = page.page.locator(".handle").nth(i).bounding_box()
            assert chart["x"] <= box["x"] <= chart["x"] + chart["width"]


@pytest.mark.long
@pytest.mark.parametrize(
    "cams", [["trigonometric"], pytest.param(["bezier15", "conjugate"], marks=pytest.mark.long)]
)
def test_any_cam_and_rig_can_be_drawn(chromium, tmp_path, cams):
    """The page draws contour and handles of each kind of law.

    The token disappears from the address after the redirection from a local file.
    """
    opened = tmp_path / "panel.html"
    for name in cams:
        stands_in = name == "trigonometric"
        rig = "paper_table2" if stands_in else "tm21"
        board = Board(cam_rig.load_cam(name), cam_rig.load_rig(rig), tmp_path)
        with serve(BoardPages(board)) as panel, in_browser(chromium, BoardPage) as shown:
            opened.write_text(REDIRECT.format(address=panel.address), encoding="utf-8")
            shown.page.goto(opened.as_uri())
            shown.page.wait_for_url(panel.address.partition("?")[0])
            shown.page.locator("#contour .curve").first.wait_for()
            assert shown.page.locator(".handle").count() == len(board.drawn.handles)
            if stands_in:
                shown.until(lambda shown=shown: shown.text("level") not in ("–", "None"))
                assert "Nearest" in shown.text("class")


@pytest.mark.long
def test_a_start_that_cannot_be_made_displays_the_force_of_its_motion(chromium, tmp_path):
    """If the start law cannot be made, the force of its motion is displayed.

    The page states this, because there is no earlier law that can be made.
    """
    good = Board(cam_rig.load_cam("poly345"), cam_rig.load_rig("paper_table2"), tmp_path)
    cam = cam_rig.load_cam(good.save("undercut", with_moved_ordinate(good, 0.5)))
    board = BoardPages(Board(cam, good.rig, tmp_path))
    with serve(board) as panel, in_browser(chromium, BoardPage) as shown:
        shown.open(panel.address)
        shown.until(lambda: "The force is that of its motion" in shown.text("contact"))
        assert shown.path("force") == shown.path("force", "ghost")


def test_a_wide_pull_moves_the_neighbouring_ordinates(page, board):
    """With a selected width, moving a handle also moves neighbouring ordinates.

    They move by a raised cosine of the cam angle. Near a dwell it is narrower, so that the joint
    stays as smooth.
    """
    page.page.locator("#width").select_option("20")
    page.page.locator(".handle").nth(7).focus()
    version, pulled = board.version, board.drawn.handles[7]
    page.press("PageUp", 2)
    page.until(lambda: board.version >= version + 2)
    page.settled()
    moved = board.ordinates - board.drawn.ordinates
    for handle in board.drawn.handles:
        away = abs(handle.angle - pulled.angle) / np.radians(20.0)
        expected = 0.05 * (1.0 + np.cos(np.pi * away)) if away < 1.0 else 0.0
        assert moved[handle.index] == pytest.approx(expected, abs=1e-12)
    assert page.page.locator("#not_made").is_hidden()
    page.press("Home")
    page.until(lambda: abs(board.ordinates - board.drawn.ordinates)[pulled.index] < 1e-15)
    page.page.locator("#reset").press("Enter")
    page.until(lambda: np.array_equal(board.ordinates, board.drawn.ordinates))

    page.page.locator("#width").select_option("40")
    page.settled()
    page.drag(1, -3.0)
    page.until(lambda: not np.array_equal(board.ordinates, board.drawn.ordinates))
    page.settled()
    moved, handles = board.ordinates - board.drawn.ordinates, board.drawn.handles[:2]
    first, second = (moved[handle.index] for handle in handles)
    part = (handles[1].left - handles[0].left) / handles[1].left
    assert first / second == pytest.approx(0.5 * (1.0 + np.cos(np.pi * part)))
    assert joints(board.law())[0].continuity == 4
    assert {j.continuity for j in joints(board.law())} == {2, 4}


def test_a_lost_connection_during_a_drag_loses_no_change(chromium, served, board):
    """Dragging continues while the connection is lost, and no change is lost.

    The older state of the server does not replace the changes.
    """
    board.update(board.drawn.ordinates.tolist(), START_RPM)
    sockets = []
    with in_browser(chromium, BoardPage) as shown:
        shown.page.route_web_socket(
            "**/changes", lambda socket: sockets.append((socket, socket.connect_to_server()))
        )
        shown.open(served.address)
        shown.settled()
        x, y = shown.grab(7)
        shown.page.mouse.move(x, y + 5.0, steps=5)
        for side in sockets.pop():
            side.close()
        shown.until(lambda: "No connection" in shown.text("status"))
        before = board.version
        shown.page.mouse.move(x, y - 15.0, steps=5)
        shown.until(lambda: sockets)
        shown.until(lambda: handle_error_mm(shown, board, 7) <= 1e-4)
        index = board.drawn.handles[7].index
        assert board.version > before
        assert board.ordinates[index] > board.drawn.ordinates[index]
        shown.page.mouse.up()
        shown.settled()


# -- cursor, opened files, links


def test_the_cam_turns_to_the_cursor_under_its_follower(page, board):
    """The cam is drawn at the angle of the cursor, with the follower at its lift.

    The displayed s, v, a, F and T are those of the library. The cursor is moved by pointing at a
    chart or by a slider.
    """
    for move in ("chart2", "force", "slider"):
        if move == "slider":
            page.page.locator("#cursor").fill("201")
        else:
            box = page.page.locator(f"#{move}").bounding_box()
            page.page.mouse.move(box["x"] + 0.3 * box["width"], box["y"] + 50)
        angle = int(page.page.locator("#cursor").input_value())
        assert angle == 201 or 60 < angle < 120
        page.until(lambda at=f"At {angle}°": page.text("at_cursor").startswith(at))
        curves = library_curves(board, board.ordinates.tolist(), START_RPM)
        s, slope, second, _, force, torque = curves[:, 2 * angle]
        omega = START_RPM * RPM
        numbers = [float(x) for x in re.findall(r"= (-?[\d.e-]+)", page.text("at_cursor"))]
        expected = [1e3 * s, omega * slope, omega**2 * second, force, torque]
        assert numbers == pytest.approx(expected, rel=6e-3)
        turned = page.page.locator("#contour > svg > g").nth(1).get_attribute("transform")
        assert float(re.match(r"rotate\((-?[\d.]+) ", turned)[1]) == pytest.approx(-angle)
        transform = page.page.locator("#contour .held").get_attribute("transform")
        unit, distance = re.search(r"scale\(([\d.]+) .*translate\(0 ([\d.]+)\)", transform).groups()
        follower = cam_rig.load_cam("poly345").follower
        assert float(distance) == pytest.approx(
            1e3 * (follower.base_radius.si + follower.roller + s)
        )
        assert float(unit) > 0.5


def test_a_saved_file_is_opened_again_in_every_page(page, board, served, chromium):
    """A saved file that is opened on one page is displayed on every page.

    A file that is not a cam file is reported.
    """
    page.drag(7, -12.0)
    page.settled()
    page.save("mine")
    page.until(lambda: "Saved: " in page.text("status"))
    drawn = board.ordinates.copy()
    page.page.locator("#reset").click()
    page.settled()
    wrong = board.out / "wrong.yaml"
    wrong.write_text("name: wrong\n")
    page.page.locator("#file").set_input_files(wrong)
    page.until(lambda: "Not opened: wrong.yaml: not a cam file" in page.text("status"))
    clear_refusals(page)
    first = board.drawn, board.file
    try:
        with in_browser(chromium, BoardPage) as other:
            other.open(served.address)
            other.settled()
            page.page.locator("#file").set_input_files(board.out / "mine.yaml")
            for board_page in (page, other):
                board_page.page.locator("#title", has_text=", drawn").wait_for()
                board_page.settled()
                assert board_page.text("class") == "Ordinates of the file's law."
        assert board.ordinates.tolist() == pytest.approx(drawn.tolist(), abs=1e-12)
    finally:
        board._draw(first[1], first[0])


def test_a_link_opens_the_same_law(page, board, served, chromium):
    """A link restores speed, base radius and ordinates of its law, and undo reverts all of them.

    A link for another cam is refused.
    """
    page.drag(9, 9.0)
    page.enter("rpm", 412)
    page.enter("base_radius", 60)
    page.until(lambda: board.base_radius_mm == 60.0)
    page.settled()
    page.page.locator("#link").click()
    page.until(lambda: "link to this law" in page.text("status"))
    drawn, link = board.ordinates.tolist(), page.page.url
    start_base = 1e3 * board.file.follower.base_radius.si
    board.update(board.drawn.ordinates.tolist(), START_RPM, start_base)
    with in_browser(chromium, BoardPage) as other:
        other.open(served.address)
        other.page.goto(link)
        other.until(lambda: board.ordinates.tolist() == drawn)
        assert board.rpm == 412.0 and board.base_radius_mm == 60.0
        other.page.locator("#undo").click()
        other.until(lambda: board.rpm == START_RPM)
        assert board.ordinates.tolist() == board.drawn.ordinates.tolist()
        assert board.base_radius_mm == start_base
        other.page.goto(link.replace("poly345", "tm21"))
        other.until(lambda: "The link is for cam tm21" in other.text("status"))


def clear_refusals(page):
    """Remove the browser's messages about refused requests from the errors of a page."""
    page.errors[:] = [error for error in page.errors if REFUSED not in error]


def test_contour_has_axis_base_circle_and_undercut(page, board):
    """The contour has the axis and the base circle. An undercut has a ring with its name.

    The second law is selected by the title of a cam, and the legend has the colour of the bars.
    """
    page.settled()
    shown = page.page
    scale = float(shown.locator("#contour .base").get_attribute("r"))
    assert shown.locator("#contour circle.zero").count() == 2 and scale > 20.0
    assert shown.locator("#contour .mark").count() == 0
    page.drag(3, -180)
    shown.locator("#contour .mark").first.wait_for()
    name = shown.locator("#contour .mark title").first.text_content()
    assert name == "Undercut: no cam has this part of the contour."
    shown.select_option("#second", label="Cycloidal")
    assert shown.locator("#second").input_value() == "cycloidal"
    page.until(lambda: shown.locator("#key li").count() == 3)  # the new legend
    colours = [
        shown.locator(where).first.evaluate("e => getComputedStyle(e).stroke")
        for where in ("#key path", "#spectrum .curve:not(.ghost):not(.second)")
    ]
    assert colours[0] == colours[1]


def test_the_first_words_are_about_the_cam(page):
    """The page starts with the title of the cam, and the first sentence states what the cam does.

    Sentences on splines are below the curves. On a telephone and in a small window title, knob, cam
    and a curve are in view.
    """
    assert page.text("title") == "Polynomial 3-4-5"
    assert page.page.title() == "Polynomial 3-4-5 – cam_rig"
    words = " ".join(page.page.locator("body").inner_text().split())
    assert words.startswith("Polynomial 3-4-5 Cam")
    chosen = "() => ['cam', 'rig'].map((id) => document.getElementById(id).selectedOptions[0].text)"
    assert page.page.evaluate(chosen) == ["Polynomial 3-4-5", "paper_table2"]
    assert "poly345" not in words.partition("Motion law")[0]
    law = page.page.locator("#law").inner_text()
    assert law.startswith("Motion law\n\nIn each turn this cam raises its follower by 50 mm.")
    box = page.page.locator("#class").bounding_box()
    assert box["y"] > page.page.locator("#chart3").bounding_box()["y"]
    page.page.evaluate("document.getElementById('expert').open = false")
    for width, height in ((390, 844), (800, 600)):
        page.page.set_viewport_size({"width": width, "height": height})
        for name in ("cam", "knob", "contour", "chart0"):
            box = page.page.locator(f"#{name}").bounding_box()
            assert box["y"] >= 0 and box["y"] + box["height"] <= height, name
