"""Every kind of lab: its steps lead to the true answer. A class loses no reading.

The labs measure the jump speed, the stem's vibration, or the noise of two cams.
"""

import gc
import json
import subprocess
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from http.client import HTTPException

import numpy as np
import pytest

import cam_rig
from cam_rig.errors import ConfigError, OutputError
from cam_rig.panel.lab.command import ClassRoom, mark_sheets
from cam_rig.panel.lab.labs import LABS, SCATTER_DB
from cam_rig.panel.lab.recorded import Notebook, read_sheet
from cam_rig.panel.lab.sheet import CURVE_POINTS
from cam_rig.panel.server import serve

from ..processes import WAIT_S
from ..viewer.asking import Visitor
from .conftest import ANSWERS, filled, served_lab, sheet_of, start_panel

SEEDS = [None, "group-3", "Z9"]
pytestmark = pytest.mark.variants(2)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("lab", LABS)
def test_answers_are_correct_within_the_tolerance_only(lab, seed, tmp_path):
    """An answer is correct only within the tolerance of the lab or of the option."""
    sheet = sheet_of(seed=seed, lab=lab)
    for off, right in ((0.0, 1), (0.1, 0), (-0.1, 0), (0.0099 * sheet.default_tolerance, 1)):
        (marked,) = mark_sheets([filled(sheet, tmp_path, off)], [], None, None).sheets
        assert len(marked.marks) == min(ANSWERS, len(sheet.answerable_setups))
        assert marked.correct_count == right * len(marked.marks)
    (wide,) = mark_sheets([filled(sheet, tmp_path, 0.1)], [], None, 12.0).sheets
    assert wide.correct_count == len(wide.marks)


def test_the_figure_of_a_class_has_every_sheet_and_answer(tmp_path):
    """The figure of a class has one row per sheet and one point per answer.

    The rows are ordered by their largest difference, sheets without answers last. Points beyond the
    tolerance are filled.
    """
    for lab in LABS:
        sheet = sheet_of(lab=lab)
        sheets = [filled(sheet, tmp_path, off, f"off {off:g}") for off in (0.2, 0.0)]
        if LABS[lab].answer:
            book = Notebook(sheet_of(lab=lab), tmp_path)
            book.set_student({"student": "none"})
            book.record(vars(book.sheet.setups[0]) | {"rpm": book.sheet.knob[0] + 1.0})
            sheets.append(book.path)
        result = mark_sheets(sheets, [], None, None)
        above, below = result.plot().axes
        names = [tick.get_text() for tick in above.get_yticklabels()]
        assert names == ["off 0", "off 0.2", "none"][: len(sheets)]
        answers = sum(len(sheet.marks) for sheet in result.sheets)
        points = [(line.get_ydata()[0], line.get_markerfacecolor()) for line in above.lines]
        assert len(points) == answers
        assert all((colour != "none") == (row == 1) for row, colour in points)
        assert sum(bar.get_height() for bar in below.containers[0]) == answers
        assert LABS[lab].question in below.get_xlabel()
        assert ("no answer" in result.summary()[-1]) is bool(LABS[lab].answer)


# -- vibration: its amplitude peaks at a whole number of periods per turn


@pytest.mark.variants(1)
@pytest.mark.parametrize("seed", [*SEEDS, "x1", "x2"])
@pytest.mark.parametrize("cam", ["poly345", "bezier15"])
def test_the_peaks_of_residual_vibration_give_the_frequency(cam, seed):
    """Readings every 0.5 rpm determine the natural frequency of the stem to 0.5 %.

    Counting the waves in a turn gives an approximate number of periods, and the speeds of the peaks
    the exact number.
    """
    sheet = sheet_of(seed=seed, cam=cam, lab="vibration")
    for setup in sheet.setups:
        top = min(sheet.knob[1], sheet.contact_lost_rpm[setup])
        rpm = np.arange(0.8 * top, top, 0.5)
        amplitudes = np.array([sheet.turn(setup, n, 1).measured for n in rpm])
        inside = (amplitudes[1:-1] > amplitudes[:-2]) & (amplitudes[1:-1] > amplitudes[2:])
        peaks, high = rpm[1:-1][inside], amplitudes[1:-1][inside]
        highest = peaks[np.argmax(high)]
        curve = sheet.turn(setup, highest, 1).curve
        counted = int(((curve > np.roll(curve, 1)) & (curve >= np.roll(curve, -1))).sum())

        def off(waves, highest=highest, peaks=peaks):
            others = waves * highest / peaks
            return np.abs(others - np.round(others)).max()

        waves = min(range(counted - 2, counted + 3), key=off)
        assert highest * waves / 60.0 == pytest.approx(sheet.true(setup), rel=0.005)


def test_no_reading_is_recorded_without_contact(tmp_path):
    """In the vibration lab, a reading at a speed without contact is refused."""
    sheet = sheet_of(lab="vibration")
    heavy = sheet.setups[-1]
    rpm = 1.01 * sheet.contact_lost_rpm[heavy]
    turn = sheet.turn(heavy, rpm, 1)
    assert turn.contact_lost and turn.measured is None
    with pytest.raises(cam_rig.CamRigError, match=r"contact is lost at .* rpm; allowed: below"):
        Notebook(sheet, tmp_path).record(vars(heavy) | {"rpm": rpm})


# -- noise: the crossing of two cams' levels, from readings with scatter


@pytest.mark.parametrize("seed", [*SEEDS, "x1", "x2"])
@pytest.mark.parametrize("rig", ["tm21", "paper_table2"])
def test_the_readings_give_the_crossing_of_two_cams(rig, seed):
    """Lines through the readings of two cams cross at the true speed.

    Below the crossing the same cam is louder at all speeds, so there is a single answer.
    """
    sheet = sheet_of(rig, seed, lab="noise")
    true = sheet.true(sheet.answerable_setups[0])
    below = np.linspace(sheet.knob[0], 0.999 * true, 25)
    first, second = (sheet.level(cam, below, seed) for cam in sheet.cams)
    assert len(set(np.sign(second - first))) == 1
    levels = [float(sheet.level(cam, np.array([true]), seed)[0]) for cam in sheet.cams]
    assert levels[0] == pytest.approx(levels[1], abs=0.01)
    near = np.linspace(0.94 * true, 1.06 * true, 24)
    lines = []
    for setup in sheet.setups:
        readings = [sheet.turn(setup, n, i).measured for i, n in enumerate(near.tolist())]
        lines.append(np.polynomial.Polynomial.fit(near, readings, 1).convert().coef)
    constant, slope = lines[0] - lines[1]
    assert -constant / slope == pytest.approx(true, rel=0.01 * sheet.default_tolerance)


def test_readings_scatter_normally_and_reproducibly():
    """Readings of a level scatter about the true level with the stated deviation.

    The scatter depends on the number of the reading, so that a repeated reading is equal.
    """
    sheet = sheet_of("tm21", lab="noise")
    setup, rpm = sheet.setups[0], 250.0
    true = float(sheet.level(setup.cam, np.array([rpm]), None)[0])
    off = np.array([sheet.turn(setup, rpm, i).measured for i in range(200)]) - true
    assert abs(off.mean()) < 4.0 * SCATTER_DB / np.sqrt(off.size)
    # With 200 values the standard deviation has an error of 5 %. Rounding to 0.1 dB adds 0.5 %.
    assert off.std() == pytest.approx(SCATTER_DB, rel=0.2)
    assert sheet.turn(setup, rpm, 7).measured == sheet.turn(setup, rpm, 7).measured


# -- refused values, and the data that a page receives


@pytest.mark.parametrize("lab", ["vibration", "noise"])
def test_a_page_sends_an_answer_and_receives_no_true_number(lab, tmp_path):
    """An answer with a decimal comma is recorded, and invalid answers are refused.

    No response contains a true answer. The theory is served only on a sheet without a seed.
    """
    sheet = sheet_of(seed="group-3", lab=lab)
    setup = vars(sheet.setups[0])
    with served_lab(sheet, tmp_path) as lab_page:
        ask = lab_page.send
        status, page = ask("/lab/answer", setup | {"answer": "250,5"})
        assert (status, page["readings"][-1]["answer"]) == (200, 250.5)
        for answer in ("", "x", "-3", "0", None, True, [1], "1.234,5"):
            assert ask("/lab/answer", setup | {"answer": answer})[0] == 409
        received = lab_page.get("/lab/sheet").decode()
        received += json.dumps(ask("/lab/record", setup | {"rpm": 240.0}))
        assert not ask("/lab/turn", setup | {"rpm": 240.0})[1]["was_lost"]
        for answerable in sheet.answerable_setups:
            assert f"{sheet.true(answerable):.2f}"[:-1] not in received
    assert read_sheet(tmp_path / f"lab_{lab}_group-3.csv").readings[0].answer == 250.5
    with served_lab(sheet_of(lab=lab), tmp_path) as lab_page:
        theory = json.loads(lab_page.get("/lab/theory"))["curves"]
        assert len(theory) == len(sheet.options[sheet.marker])
        assert 0.5 * CURVE_POINTS < max(map(len, theory)) <= CURVE_POINTS
        assert all(np.isfinite(curve).all() for curve in theory)


# -- a class on one server: each group has a hidden rig, a page and a file

#: Number of readings that a page records unless its server is killed before.
READINGS_PER_GROUP = 10


@contextmanager
def class_server(out, groups):
    """Run `cam-rig lab jump` for all groups, and yield each group's address."""
    seeds = [word for group in groups for word in ("--seed", group)]
    with start_panel(out, *seeds, command=("lab", "jump"), stderr=subprocess.DEVNULL) as process:
        lines = [process.stdout.readline().strip() for _ in groups]
        try:
            yield process, dict(line.split(": ", 1) for line in lines)
        finally:
            process.kill()


def page_of(addresses, group):
    """Return a group's client and the sheet that its page displays."""
    page = Visitor(addresses[group])
    return page, json.loads(page.get(f"/lab/{group}/sheet"))


def record_until_killed(addresses, group, on_recorded):
    """Record readings of a group until its server is killed.

    Returns the confirmed speeds (rpm), and the speed whose request was not answered, or None.
    `on_recorded` is called after each reading.
    """
    (page, sheet), confirmed = page_of(addresses, group), []
    setup = {name: values[0] for name, values in sheet["options"].items()}
    for rpm in range(400, 400 + READINGS_PER_GROUP):
        try:
            status, _, _ = page.post(f"/lab/{group}/record", json.dumps(setup | {"rpm": rpm}))
        except (OSError, HTTPException):  # the server was killed
            return confirmed, rpm
        assert status == 200
        confirmed.append(rpm)
        on_recorded()
    return confirmed, None


@pytest.mark.slow
@pytest.mark.parametrize("many", [6, pytest.param(30, marks=pytest.mark.long)])
def test_simultaneous_groups_lose_no_reading_if_the_server_is_killed(many, tmp_path):
    """After the server is killed, each group's file has every confirmed reading.

    A restarted server continues the files.
    """
    groups = [f"group-{number}" for number in range(many)]
    with class_server(tmp_path, groups) as (server, addresses), ThreadPoolExecutor(many) as pool:
        count = iter(range(many * READINGS_PER_GROUP))

        def count_reading():
            if next(count) == 3 * many:
                server.kill()

        pages = [
            (pool.submit(record_until_killed, addresses, group, count_reading), group)
            for group in groups
        ]
        results = {group: page.result(WAIT_S) for page, group in pages}
    assert any(rpm is not None for _, rpm in results.values())
    with class_server(tmp_path, groups) as (_, addresses):
        for group, (confirmed, pending) in results.items():
            recorded = [row["rpm"] for row in page_of(addresses, group)[1]["readings"]]
            assert recorded[: len(confirmed)] == confirmed
            assert recorded[len(confirmed) :] in ([], [pending])
    files = [path for path in tmp_path.glob("lab_*.csv") if path.stat().st_size]
    assert {read_sheet(path).seed for path in files} == {g for g in groups if results[g][0]}
    marks = mark_sheets(files[:2], [], None, None)
    assert len(marks.tables()) > 0


def test_each_group_has_a_separate_rig_and_page(tmp_path):
    """Each of several seeds has a page at its own path. A single seed is at /lab.

    A repeated seed is refused. The file of a single seed is continued.
    """
    cams, rig = sheet_of().cams.values(), sheet_of().rig
    room = ClassRoom("jump", ("one", "two"), None)
    pages = room.pages([*cams], rig, tmp_path)
    assert list(pages) == ["/lab/one", "/lab/two"]
    single = ClassRoom("jump", ("one",), None)
    (page,) = single.pages([*cams], rig, tmp_path / "single").values()
    setup = vars(page.notebook.sheet.setups[0])
    page.notebook.record(setup | {"rpm": 300.0})
    before = page.notebook.recorded
    del page
    gc.collect()  # the server has ended: the lock of its file is released
    pages_again = single.pages([*cams], rig, tmp_path / "single")
    assert list(pages_again) == ["/lab"] and pages_again["/lab"].notebook.recorded == before
    with serve(*pages.values(), home="/lab/one") as served:
        one, two = (Visitor(served.access.address(path)) for path in pages)
        assert (one.home, two.home) == ("/lab/one", "/lab/two")
        assert json.loads(two.get("/lab/two/sheet"))["seed"] == "two"
    with pytest.raises(ConfigError, match="one is repeated"):
        ClassRoom("jump", ("one", "one"), None).pages([*cams], rig, tmp_path / "other")


def test_a_sheet_of_another_rig_is_not_continued(tmp_path):
    """A sheet file is not continued if it is of another rig, or in use by a panel."""
    sheet = sheet_of("tm21", seed="one")
    book = Notebook(sheet, tmp_path)
    book.record(vars(sheet.setups[0]) | {"rpm": 300.0})
    again = Notebook(sheet, tmp_path, resumes=True)
    assert again.recorded == read_sheet(book.path)
    with pytest.raises(OutputError, match="another panel writes it; end that panel"):
        Notebook(sheet, tmp_path, resumes=True)
    del again
    with pytest.raises(ConfigError, match="rig is tm21; allowed: paper_table2"):
        Notebook(sheet_of(seed="one"), tmp_path, resumes=True)


def test_an_address_of_this_machine_accepts_only_its_name():
    """With `--host` a panel is served at this address of the machine.

    The address of another machine is refused.
    """
    address = "127.0.0.2"  # a second loopback address
    with serve(home="/lab", host=address) as served:
        assert served.access.netloc == f"{address}:{served.access.port}"
        assert Visitor(served.address).home == "/lab"
    message = r"--host must be an address of this machine, got '203\.0\.113\.1'"
    with pytest.raises(ConfigError, match=message), serve(host="203.0.113.1"):
        pass
