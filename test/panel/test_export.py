"""Static drawing board: the file that `cam-rig panel --export` writes, opened without a server."""

import math
from contextlib import contextmanager
from pathlib import Path

import pytest
from typer.testing import CliRunner

import cam_rig
from cam_rig.cli.main import app
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.jump.rigid_mass import rigid_jump_speed
from cam_rig.errors import ConfigError, OutputError
from cam_rig.panel.board.board import Board
from cam_rig.panel.export.bundle import collect_modules
from cam_rig.panel.export.page import FILE, REPLACED, export_board, page_data
from cam_rig.panel.server import STATIC
from cam_rig.units import RPM, TURN
from tools.docs.browser import TIMEOUT_S

from .conftest import BrowserPage, in_browser
from .test_page_tools import AXE, SHOW_HIDDEN, TSC, VIOLATIONS, wrong_types

pytestmark = pytest.mark.slow
#: Largest time (ms) from the start of loading to the first contour. It is 0.6 s on two busy cores.
MAX_FIRST_PICTURE_MS = 6000
#: Largest size of the file (bytes), so that it can be sent by mail.
MAX_BYTES = 700_000
#: Script that returns the time (ms) of the first contour.
FIRST_PICTURE = """() => new Promise((done) => {
  const drawn = () => document.querySelector("#contour .body") && done(performance.now());
  new MutationObserver(drawn).observe(document, { subtree: true, childList: true });
  drawn();
})"""
#: Script that returns the number of elements that need a server.
NEEDS_SERVER = "() => document.querySelectorAll('[data-server]').length"


class StaticPage(BrowserPage):
    """Page of the static board, without access to any network."""

    def __init__(self, page):
        super().__init__(page)
        page.set_default_timeout(TIMEOUT_S * 1e3)
        page.route(lambda url: not url.startswith("file:"), lambda route: route.abort())

    def open_file(self, path):
        self.page.goto(path.as_uri())
        self.ready()

    def ready(self):
        """Wait until the contour and the jump speed are displayed."""
        self.page.wait_for_selector("#contour .body", state="attached")
        self.until(lambda: self.text("jump_rigid") not in ("–", "None"))

    def choose(self, name, value):
        """Choose a cam or a rig, which reloads the page."""
        with self.page.expect_navigation():
            self.page.locator(f"#{name}").select_option(value)
        self.ready()


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """Exported file that opens with poly345 on the paper's rig."""
    cam, rig = cam_rig.load_cam("poly345"), cam_rig.load_rig("paper_table2")
    folder = tmp_path_factory.mktemp("static") / "board"
    return export_board(folder, Board(cam, rig, folder), None)


@pytest.fixture
def page(chromium, file):
    with in_browser(chromium, StaticPage, viewport={"width": 1280, "height": 900}) as shown:
        shown.open_file(file)
        yield shown


@contextmanager
def in_language(chromium, file, locale, **context):
    with in_browser(chromium, StaticPage, locale=locale, **context) as shown:
        shown.open_file(file)
        yield shown


def test_the_file_is_small_and_is_not_overwritten(file):
    """The file has less than 700 kB. A second export into the folder is refused."""
    assert file.stat().st_size < MAX_BYTES
    cam, rig = cam_rig.load_cam("tm21"), cam_rig.load_rig("tm21")
    with pytest.raises(OutputError, match="exists already, not overwriting"):
        export_board(file.parent, Board(cam, rig, file.parent), None)
    with pytest.raises(ConfigError, match="--lang: is 'fr'"):
        export_board(file.parent / "more", Board(cam, rig, file.parent), "fr")


def test_the_command_prints_the_path_and_refuses_options_of_the_server(tmp_path):
    """The command prints the path of the file and ends. Options of the server are refused."""
    done = CliRunner().invoke(app, ["panel", "bezier15", "--export", str(tmp_path)])
    assert done.exit_code == 0, done.output
    assert Path(done.stdout.splitlines()[0]) == tmp_path / FILE
    for option in ("--open", "--no-rerun", "--port=8000"):
        refused = CliRunner().invoke(app, ["panel", "--export", str(tmp_path / "more"), option])
        name = option.partition("=")[0]
        assert refused.exit_code != 0
        assert f"--export cannot be combined with {name}" in refused.output
        assert not (tmp_path / "more").exists()


def test_the_file_contains_every_module_that_it_imports():
    """Each import in the file is a module of the file. The connection is the local stand-in."""
    modules = collect_modules("board/main.js", REPLACED)
    imported = [
        line.rpartition('"')[0].rpartition('"')[2]
        for source in modules.values()
        for line in source.splitlines()
        if line.startswith("import ")
    ]
    assert set(imported) == modules.keys() - {"board/main.js"}
    assert "WebSocket" not in "".join(modules.values())
    assert "WebSocket" in (STATIC / "board/connection.js").read_text("utf-8")


@pytest.mark.skipif(not TSC.exists(), reason="no TypeScript: make check-pages")
def test_the_data_have_their_declared_type(tmp_path):
    """The data in the file have the type `StaticData` of messages.d.ts."""
    board = Board(cam_rig.load_cam("poly345"), cam_rig.load_rig("tm21"), tmp_path)
    data = page_data(board, None)
    data["cams"] = {name: data["cams"][name] for name in ("poly345", "oscillating_conjugate")}
    assert wrong_types(tmp_path, {"data": ("StaticData", data)}) == ""
    del data["first"]
    assert "'first' is missing" in wrong_types(tmp_path, {"data": ("StaticData", data)})


def test_the_first_picture_appears_at_once(chromium, file):
    """The first contour is drawn within the time limit."""
    with in_browser(chromium, StaticPage) as shown:
        shown.page.goto(file.as_uri())
        assert shown.page.evaluate(FIRST_PICTURE) < MAX_FIRST_PICTURE_MS


@pytest.mark.parametrize(("locale", "words"), [("en-GB", "Cam speed"), ("es-ES", "Velocidad")])
def test_the_page_is_in_the_language_of_the_browser(chromium, file, locale, words):
    """The page has no text without a translation. A button selects the other language."""
    with in_language(chromium, file, locale) as shown:
        body = "document.body.innerText"
        assert words in shown.page.evaluate(body) and "undefined" not in shown.page.evaluate(body)
        with shown.page.expect_navigation():
            shown.page.locator("#languages button[aria-pressed=false]").click()
        shown.ready()
        assert words not in shown.page.evaluate(body)


def test_what_needs_a_server_is_absent(page):
    """Files, bench, design and the results of two masses are not on the page."""
    assert page.page.evaluate(NEEDS_SERVER) == 0
    for name in ("save", "dxf", "on_bench", "design", "jump", "level", "residual", "checks"):
        assert page.page.locator(f"#{name}").count() == 0
    page.enter("rpm", 333)
    page.until(lambda: page.text("contact").startswith("Contact is kept"))
    assert page.text("status") == ""


def test_another_cam_and_rig_are_chosen(page):
    """A chosen cam or rig is displayed with its jump speed. A rig keeps the drawing."""
    for name in ("bezier15", "oscillating_roller", "flat"):
        page.choose("cam", name)
        cam = cam_rig.load_cam(name)
        assert page.text("title") == cam.title
        mass = FollowerParameters.from_rig(cam_rig.load_rig("paper_table2"))
        jump = rigid_jump_speed(cam_rig.build_law(cam), mass) / RPM
        assert page.number("jump_rigid") == pytest.approx(jump, rel=1e-4)
    handle = page.page.locator(".handle").nth(4)
    handle.press("ArrowUp")
    page.until(lambda: page.page.locator("#undo").is_enabled())
    value = handle.get_attribute("aria-valuenow")
    before = page.text("jump_rigid")
    page.choose("rig", "tm21")
    assert page.text("jump_rigid") != before
    assert page.page.locator(".handle").nth(4).get_attribute("aria-valuenow") == value


def test_a_second_law_and_a_link_need_no_server(page, file):
    """A second law is drawn, and a link contains the drawing."""
    page.page.locator("#second").select_option("cycloidal")
    page.until(lambda: page.path("chart0", "second"))
    assert "39.478" in page.text("second_peaks")  # the coefficient of the file's law
    page.page.locator(".handle").nth(4).press("PageUp")
    page.page.locator("#expert summary").click()
    page.page.locator("#link").click()
    page.until(lambda: "ordinates" in page.page.url)
    value = page.page.locator(".handle").nth(4).get_attribute("aria-valuenow")
    link = page.page.url
    page.page.goto("about:blank")
    page.page.evaluate("() => undefined")
    page.page.goto(file.as_uri())
    page.page.evaluate("() => sessionStorage.clear()")  # as in a new tab
    page.page.goto("about:blank")
    page.page.goto(link)
    page.ready()
    page.until(lambda: page.page.locator(".handle").nth(4).get_attribute("aria-valuenow") == value)
    page.choose("cam", "tm21")
    assert "ordinates" not in page.page.url


def test_a_dragged_handle_makes_the_contour_red(page):
    """A dragged handle changes the law. An undercut is red and named, and *Undo* removes it."""
    box = page.page.locator(".handle").nth(7).bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.page.mouse.move(x, y)
    page.page.mouse.down()
    page.page.mouse.move(x, y + 150, steps=5)
    page.page.mouse.up()
    page.until(lambda: "Undercut at" in page.text("faults"))
    assert page.page.locator("#contour .curve.bad").count() > 0
    assert page.page.locator("#not_made").is_visible()
    page.page.locator("#undo").click()
    page.until(lambda: page.text("faults") == "")
    assert page.page.locator("#contour .curve.bad").count() == 0


def test_the_scale_of_the_contour_returns_after_a_large_drag(page):
    """After a pull by ten lifts and *Undo* the contour has its first scale again."""
    scale = page.page.locator("#contour text").first
    first = scale.text_content()
    box = page.page.locator(".handle").nth(7).bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.page.mouse.move(x, y)
    page.page.mouse.down()
    page.page.mouse.move(x, y + 3000, steps=3)
    page.until(lambda: scale.text_content() != first)
    page.page.mouse.up()
    page.page.locator("#undo").click()
    page.until(lambda: scale.text_content() == first)


def test_a_speed_with_a_decimal_comma_is_read(page):
    """A decimal comma is a decimal point, and a text that is not a number is refused."""
    before = page.text("acceleration")
    page.page.fill("#rpm", "412,5")
    page.page.press("#rpm", "Enter")
    page.until(lambda: page.text("acceleration") != before)  # while the field has the focus
    page.page.press("#rpm", "Tab")
    page.until(lambda: page.page.input_value("#rpm") == "412.5")
    for refused in ("1.234,5", "1,000"):  # the second may be a thousand or one
        page.page.fill("#rpm", refused)
        page.page.press("#rpm", "Tab")
        page.until(lambda refused=refused: refused in page.text("status"))
        page.until(lambda: page.page.input_value("#rpm") == "412.5")


@pytest.mark.parametrize(
    ("cam", "rpm", "words"),
    [
        ("conjugate", "900", "guides the follower on both sides"),
        ("worked_example_constant_velocity", "900", "Turn 6 from rest"),
        ("quiet", "900", "40° to "),
    ],
)
def test_the_sentence_on_contact_agrees_with_the_results(page, cam, rpm, words):
    """A guided follower never leaves, flights exclude "kept", and ranges are separate."""
    page.choose("cam", cam)
    page.page.fill("#rpm", rpm)
    page.page.press("#rpm", "Tab")
    page.until(lambda: words in page.text("contact"))
    assert "Contact is kept" not in page.text("contact")
    if cam == "quiet":
        assert page.text("contact").split(":")[0].count(" to ") >= 2


def test_the_base_radius_changes_contour_and_faults(page):
    """A smaller base radius has an undercut, and one out of reach has the server's message."""
    page.choose("cam", "oscillating_roller")
    page.enter("base_radius", 1)
    page.until(lambda: "out of reach at the base circle" in page.text("faults"))
    page.choose("cam", "flat")
    page.enter("base_radius", 5)
    page.until(lambda: "Undercut at" in page.text("faults"))


def test_the_follower_flies_above_its_jump_speed(page):
    """Above the jump speed the page states the lift-offs and landings of the package.

    The displayed lift and force are those of the flight.
    """
    rpm, angle = 700.0, 150
    page.enter("rpm", rpm)
    page.page.locator("#cursor").fill(str(angle))
    page.until(lambda: "landing at" in page.text("contact"))
    law = cam_rig.build_law(cam_rig.load_cam("poly345"))
    motion = cam_rig.simulate(law, "paper_table2", rpm=rpm, turns=6, sample_rate=192_000)
    for event in motion.events:
        degrees = math.degrees(event.angle - 5 * TURN)
        if degrees > 0.0:
            kind = "landing" if event.kind == "landing" else "lift-off"
            assert f"{kind} at {degrees:.4g}°" in page.text("contact")
    sample = int(abs(motion.angle - 5 * TURN - math.radians(angle)).argmin())
    assert f"s = {motion.lift[sample] * 1e3:.4g} mm" in page.text("at_cursor")
    assert "F = 0 N" in page.text("at_cursor")


@pytest.mark.skipif(not AXE.exists(), reason="no axe-core: make check-pages")
@pytest.mark.parametrize(
    ("locale", "scheme"),
    [("es-ES", "dark"), pytest.param("en-GB", "light", marks=pytest.mark.long)],
)
def test_axe_finds_no_violation(chromium, file, locale, scheme):
    """axe-core finds no violation of accessibility, with hidden elements and in flight."""
    looks = {"color_scheme": scheme, "bypass_csp": True}
    with in_language(chromium, file, locale, **looks) as shown:
        shown.enter("rpm", 900)
        shown.until(lambda: "6" in shown.text("contact"))
        shown.page.evaluate(SHOW_HIDDEN)
        shown.page.evaluate(AXE.read_text(encoding="utf-8"))
        assert shown.page.evaluate(VIOLATIONS) == []
