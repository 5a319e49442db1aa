"""Bench and lab sheet in a real browser without nodes: layout and keyboard."""

import itertools

import pytest

import cam_rig
from cam_rig.panel.lab.marking import mark_sheet
from cam_rig.panel.lab.pages import LabPages
from cam_rig.panel.server import serve
from tools.docs.bench_picture import RIG_DRAWN
from tools.docs.browser import TIMEOUT_S

from ..processes import until
from .conftest import BrowserPage, in_browser, sheet_of

pytestmark = pytest.mark.slow
SIZES = [(360, 640), (768, 1024), (1000, 700), (1280, 800), (1600, 910), (2560, 1440)]
#: CSS selector of the elements that a person reads or operates.
ELEMENTS = (
    "button, input, select, output, meter, h1, h2, a, li, dt, dd, .chip, #knob, #lamp, .chart, "
    "#rig, #forecast, #jumps, #relative, .quiet"
)


class Bench(BrowserPage):
    """Page of the bench in a browser, without nodes."""

    def open_bench(self, address, language):
        """Open the page in this language."""
        chosen = f"sessionStorage.setItem('language', '{language}')"
        self.page.context.add_init_script(chosen)
        self.open(address, "/bench")
        self.until(lambda: self.text("graph") != "")
        assert self.page.evaluate("document.documentElement.lang") == language

    def boxes(self, selector=ELEMENTS):
        """Return a dict from element to its box: left, top, right and bottom, in px.

        Only visible elements are included, and none inside another element of the selector.
        """
        boxes = self.page.evaluate(
            """(things) => [...document.querySelectorAll(things)]
              .filter((one) => one.checkVisibility() && !one.closest(".unseen"))
              .filter((one) => !one.parentElement.closest(things))
              .map((one, i) => [`${one.id || one.textContent} ${i}`, one.getBoundingClientRect()])
              .filter(([, box]) => box.width && box.height)
              .map(([name, { left, top, right, bottom }]) => [name, [left, top, right, bottom]])""",
            selector,
        )
        return {name: (box[0], box[1], box[2], box[3]) for name, box in boxes}


@pytest.mark.parametrize("language", ["es", pytest.param("en", marks=pytest.mark.long)])
def test_no_element_overlaps_and_the_emergency_stop_is_visible(chromium, served, language):
    """In every window size no element of the bench overlaps another.

    The emergency stop is always visible. The heading states the model in the page's language.
    """
    with in_browser(chromium, Bench) as bench:
        bench.open_bench(served.address, language)
        for width, height in SIZES:
            bench.page.set_viewport_size({"width": width, "height": height})
            require_apart(bench, width)
            (stop,) = bench.boxes("#emergency").values()
            assert stop[1] >= 0 and stop[3] <= height
        assert bench.page.locator("#model").input_value() == "two_mass"
        model = {"en": "two elastic masses", "es": "dos masas elásticas"}[language]
        assert bench.text("title") == f"paper_table2, {model}"
        assert served.bench.live.setup.model == "two_mass"


@pytest.mark.parametrize(
    ("width", "height", "elements"),
    [(1280, 800, ("note", "knob", "turn_lift", "rig")), (390, 844, ("knob", "turn_lift"))],
)
def test_the_controls_of_a_reading_are_in_view(chromium, served, width, height, elements):
    """The knob and a curve are in view without scrolling, also on a telephone.

    On a laptop "Record this point" is in view too, with the longest texts of prediction and state.
    """
    with in_browser(chromium, Bench) as bench:
        bench.page.set_viewport_size({"width": width, "height": height})
        bench.open_bench(served.address, "es")
        bench.enter("rpm", 450)
        bench.until(lambda: "A 450 rpm el seguidor se separa" in bench.text("forecast"))
        for name in elements:
            (box,) = bench.boxes(f"#{name}").values()
            assert box[1] >= 0 and box[3] <= height, name


#: Script that draws turns with these largest forces (N). It returns the top of the axis after each.
AXIS_TOPS = """async (peaks) => {
  const { TurnCharts } = await import("/static/bench/turns.js");
  const box = document.querySelector("main").appendChild(document.createElement("div"));
  const charts = new TurnCharts(box, () => {});
  const { chart } = charts.charts.at(-1);
  const angle = Float32Array.from({ length: 36 }, (_, i) => i * Math.PI / 18);
  return peaks.map((peak) => {
    const curve = angle.map((x) => peak * Math.sin(x / 2));
    const [lift, velocity, acceleration, force, gap] = Array(5).fill(curve);
    charts.add({ angle, lift, velocity, acceleration, force, gap });
    return chart.range[1];
  });
}"""


def test_the_axes_follow_the_present_range_after_a_peak(chromium, served):
    """An axis keeps a peak for eight turns, and then has the range of the present turns.

    Turns that differ by less than 30 % do not change the axis.
    """
    with in_browser(chromium, Bench) as bench:
        bench.open_bench(served.address, "en")
        tops = bench.page.evaluate(AXIS_TOPS, [1000.0, *[100.0] * 12])
        assert tops[0] > 1000.0 and tops[:9] == [tops[0]] * 9
        assert 100.0 < tops[-1] < 120.0
        steady = bench.page.evaluate(AXIS_TOPS, [100.0, *[80.0] * 12])
        assert steady == [steady[0]] * 13


def require_apart(bench, width):
    """Check that no element overlaps another or extends beyond its column."""
    boxes = bench.boxes()
    assert len(boxes) > 25
    for (name, a), (other, b) in itertools.combinations(boxes.items(), 2):
        apart = a[2] <= b[0] + 0.5 or b[2] <= a[0] + 0.5 or a[3] <= b[1] + 0.5 or b[3] <= a[1] + 0.5
        assert apart, f"{name} overlaps {other}: {a}, {b}"
    columns = list(bench.boxes("main > section, main > div").values())
    for name, (left, top, right, bottom) in boxes.items():
        assert left >= 0 and right <= width, f"{name} sticks out of the page"
        if bottom > columns[0][1] and top >= min(column[1] for column in columns):
            is_inside = any(c[0] <= left + 0.5 and right <= c[2] + 0.5 for c in columns)
            assert is_inside, f"{name} sticks out of its column"


def test_the_rig_and_its_prediction_are_drawn_before_it_turns(chromium, served):
    """Before the cam turns, the bench displays the rig and the predicted contact.

    The prediction follows changes of speed and preload. Pointing at a curve turns the drawn cam to
    this angle.
    """
    with in_browser(chromium, Bench) as bench:
        bench.open_bench(served.address, "en")
        cam, rig = cam_rig.load_cam("poly345"), cam_rig.load_rig("paper_table2")
        jump = cam_rig.jump_speed(cam_rig.build_law(cam), rig).rpm
        bench.until(lambda: bench.page.evaluate(RIG_DRAWN))
        bench.until(lambda: "contact is kept" in bench.text("forecast"))
        assert f"{jump:.5g} rpm" in bench.text("jumps")
        assert bench.page.locator("#knob .jump").count() == 2
        assert bench.page.locator("#turn_force .expected").get_attribute("d")
        bench.enter("rpm", 450)
        bench.until(lambda: "At 450 rpm the follower leaves the cam" in bench.text("forecast"))
        bench.page.locator("#preload").fill("200")
        bench.until(lambda: "At 450 rpm contact is kept" in bench.text("forecast"))
        assert bench.page.locator("#forecast.old").count() == 0
        bench.enter("rpm", 0)
        bench.until(lambda: bench.text("status") == "Speed: is 0; allowed: 1 to 10000 rpm.")
        bench.enter("rpm", 450)
        bench.until(lambda: bench.text("status") == "")
        box = bench.page.locator("#turn_lift").bounding_box()
        bench.page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 30)
        bench.until(lambda: (bench.number("at_lift") or 0.0) > 49.0)


# -- the lab sheet

#: Script that is true if the displayed turn has the selected speed.
SHOWN = """() => JSON.parse(document.body.dataset.shown || "{}").rpm
  === Number(document.getElementById("rpm").value)"""


class LabPage(BrowserPage):
    """Page of a lab sheet that is operated by keyboard."""

    def settle(self):
        """Wait until the displayed force is that at the knob's speed."""
        self.until(lambda: self.page.evaluate(SHOWN))

    def press(self, key):
        """Press a key on the speed knob and wait for the new turn."""
        self.page.locator("#knob").press(key)
        self.settle()

    def lost(self):
        """Return True if the page displays "contact lost"."""
        return self.text("contact") == "contact lost"

    def press_until(self, key, condition):
        """Press a key on the speed knob until a condition is true."""
        until(condition, step=lambda: self.press(key), wait=TIMEOUT_S)


def test_a_reading_by_keyboard_is_within_1_rpm_of_the_true_value(chromium, tmp_path):
    """A jump speed found with the knob's keys is within 1 rpm of the true one.

    A reading while contact is kept is recorded only after a confirmation. Readings remain after a
    reload.
    """
    pages, questions, answers = (
        LabPages(sheet_of(seed="group-3"), tmp_path),
        list[str](),
        [False, True],
    )
    sheet = pages.notebook.sheet
    low, high = sheet.knob

    def answer(dialog):
        questions.append(dialog.message)
        (dialog.accept if answers.pop(0) else dialog.dismiss)()

    with serve(pages, home="/lab") as panel, in_browser(chromium, LabPage) as page:
        page.open(panel.address)
        page.settle()
        page.enter("student", "Ana")
        page.page.locator("#spring_stiffness input").first.press("ArrowDown")  # the second spring
        page.settle()
        assert not page.lost()
        before, record = page.path("force"), page.page.locator("#record")
        page.press_until("PageUp", page.lost)
        page.press_until("ArrowDown", lambda: not page.lost())
        page.press("ArrowUp")
        assert page.lost()
        assert page.path("force") != before
        record.press("Enter")
        page.until(lambda: page.text("recorded").startswith("Reading 1"))
        page.page.reload()
        page.settle()
        assert page.page.locator("#rows tr").count() == 1
        assert page.page.locator("#plot .point").count() == 1
        assert page.page.locator("#student").input_value() == "Ana"
        assert not page.page.locator("#theory").is_visible()
        (mark,) = mark_sheet(
            pages.notebook.path, 1.0, lambda _: sheet.cam, lambda _: sheet.rig
        ).marks
        assert mark.reading.setup.spring_stiffness == sheet.options["spring_stiffness"][1]
        assert 0.0 < mark.difference < 1.0

        page.page.on("dialog", answer)
        assert not page.lost()
        record.click()
        page.until(lambda: questions)
        record.click()
        page.until(lambda: len(pages.notebook.recorded.readings) == 2)
        assert all(f" {low:g} rpm" in words for words in questions)
        # Record at once: the page must check the recorded speed, not the speed of the displayed
        # turn.
        page.enter("rpm", high)
        record.click()
        page.until(lambda: len(pages.notebook.recorded.readings) == 3)
        assert len(questions) == 2
        assert [r.rpm for r in pages.notebook.recorded.readings[1:]] == [low, high]


def test_the_theory_is_displayed_on_request(chromium, tmp_path):
    """On a sheet without a hidden rig (no seed), a button shows the theoretical line.

    The page links only to pages that are served.
    """
    pages = LabPages(sheet_of("tm21"), tmp_path)
    with serve(pages, home="/lab") as panel, in_browser(chromium, LabPage) as page:
        page.open(panel.address)
        page.settle()
        line = page.page.locator("#plot .theory").first
        assert not line.get_attribute("d")
        assert not page.page.locator("#plotted").is_visible()
        page.page.locator("#plot_it").press("Enter")
        page.until(page.page.locator("#theory").is_visible)  # a hidden button gets no focus
        page.page.locator("#theory").press("Enter")
        page.until(lambda: line.get_attribute("d"))
        assert page.page.locator("#formula_jump math").is_visible()
        page.page.locator("#theory").press("Enter")
        page.until(lambda: not line.get_attribute("d"))
        links = page.page.locator("nav a:visible")
        assert [link.get_attribute("href") for link in links.all()] == ["/lab"]


@pytest.mark.parametrize("lab", ["noise", pytest.param("vibration", marks=pytest.mark.long)])
def test_readings_and_an_answer_are_recorded_by_keyboard(chromium, tmp_path, lab):
    """A reading and an answer are recorded by keyboard, in Spanish too.

    The answer has a decimal comma. The page fits windows of 400 to 1600 px.
    """
    pages = LabPages(sheet_of(seed="group-3", lab=lab), tmp_path)
    with serve(pages, home="/lab", language="es") as panel, in_browser(chromium, LabPage) as page:
        page.open(panel.address)
        page.settle()
        before = page.path("force")
        page.press("PageUp")
        page.until(lambda: page.path("force") != before)
        displayed = page.number("measured")
        page.page.locator("#record").press("Enter")
        page.until(lambda: page.page.locator("#rows tr").count() == 1)
        page.enter("answer", "251,5")
        page.until(lambda: page.page.locator("#rows tr").count() == 2)
        reading, answer = pages.notebook.recorded.readings
        assert (reading.measured, answer.answer) == (displayed, 251.5)
        assert page.text("recorded").startswith("Respuesta 2: 251,5 ")
        page.page.locator("#plot_it").press("Enter")
        page.until(lambda: page.page.locator("#plot .point").count() == 1)
        for width in (400, 1000, 1600):
            assert page.width(width) <= width
