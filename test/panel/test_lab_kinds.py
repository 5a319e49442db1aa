"""Every lab: a student who follows its steps is right, by any seed; a class loses no reading."""

import json
import subprocess
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from http.client import HTTPException

import numpy as np
import pytest

import cam_rig
from cam_rig.errors import ConfigError, OutputError
from cam_rig.panel.command import ClassRoom, mark_sheets
from cam_rig.panel.lab.labs import LABS, SCATTER_DB
from cam_rig.panel.lab.recorded import Notebook, parse_number, read_sheet
from cam_rig.panel.lab.sheet import CURVE_POINTS
from cam_rig.panel.server import serve

from ..processes import WAIT_S
from ..viewer.asking import Visitor
from .conftest import ANSWERS, begin_panel, filled, served_lab, sheet_of

SEEDS = [None, "group-3", "Z9"]
pytestmark = pytest.mark.variants(2)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("lab", LABS)
def test_true_answers_are_right_and_those_ten_percent_off_wrong(lab, seed, tmp_path):
    """Within what the lab says; beside the tolerance it is wrong, within it right."""
    sheet = sheet_of(seed=seed, lab=lab)
    for off, right in ((0.0, 1), (0.1, 0), (-0.1, 0), (0.0099 * sheet.default_tolerance, 1)):
        (marked,) = mark_sheets([filled(sheet, tmp_path, off)], [], None, None).sheets
        assert len(marked.marks) == min(ANSWERS, len(sheet.answerable_setups))
        assert marked.correct_count == right * len(marked.marks)
    (wide,) = mark_sheets([filled(sheet, tmp_path, 0.1)], [], None, 12.0).sheets
    assert wide.correct_count == len(wide.marks)


def test_the_class_of_each_lab_is_drawn(tmp_path):
    """A row a sheet, the farthest last, one without an answer after it; a point an answer, full
    where it is beyond the tolerance."""
    for lab in LABS:
        sheet = sheet_of(lab=lab)
        sheets = [filled(sheet, tmp_path, off, f"off {off:g}") for off in (0.2, 0.0)]
        if LABS[lab].answer:
            book = Notebook(sheet_of(lab=lab), tmp_path)
            book.set_student("none")
            book.record(vars(book.sheet.setups[0]) | {"rpm": book.sheet.knob[0] + 1.0})
            sheets.append(book.path)
        found = mark_sheets(sheets, [], None, None)
        above, below = found.plot().axes
        names = [tick.get_text() for tick in above.get_yticklabels()]
        assert names == ["off 0", "off 0.2", "none"][: len(sheets)]
        answers = sum(len(sheet.marks) for sheet in found.sheets)
        points = [(line.get_ydata()[0], line.get_markerfacecolor()) for line in above.lines]
        assert len(points) == answers
        assert all((colour != "none") == (row == 1) for row, colour in points)
        assert sum(bar.get_height() for bar in below.containers[0]) == answers
        assert LABS[lab].question in below.get_xlabel()
        assert ("no answer" in found.summary()[-1]) is bool(LABS[lab].answer)


# -- vibration: peaks where a whole number of vibrations fills a turn -------------------------


@pytest.mark.variants(1)
@pytest.mark.parametrize("seed", [*SEEDS, "x1", "x2"])
@pytest.mark.parametrize("cam", ["poly345", "bezier15"])
def test_the_peaks_of_residual_vibration_tell_the_frequency(cam, seed):
    """To half a rpm; the waves of a turn say roughly which, the others exactly: f to 0.5 %."""
    sheet = sheet_of(seed=seed, cam=cam, lab="vibration")
    for setup in sheet.setups:
        top = min(sheet.knob[1], sheet.contact_lost_rpm[setup])
        rpm = np.arange(0.8 * top, top, 0.5)
        seen = np.array([sheet.turn(setup, n, 1).measured for n in rpm])
        inside = (seen[1:-1] > seen[:-2]) & (seen[1:-1] > seen[2:])
        peaks, high = rpm[1:-1][inside], seen[1:-1][inside]
        highest = peaks[np.argmax(high)]
        curve = sheet.turn(setup, highest, 1).curve
        counted = int(((curve > np.roll(curve, 1)) & (curve >= np.roll(curve, -1))).sum())

        def off(waves, highest=highest, peaks=peaks):
            others = waves * highest / peaks
            return np.abs(others - np.round(others)).max()

        waves = min(range(counted - 2, counted + 3), key=off)
        assert highest * waves / 60.0 == pytest.approx(sheet.true(setup), rel=0.005)


def test_where_contact_is_lost_nothing_is_measured(tmp_path):
    """The lamp says so, and no reading is taken."""
    sheet = sheet_of(lab="vibration")
    heavy = sheet.setups[-1]
    rpm = 1.01 * sheet.contact_lost_rpm[heavy]
    turn = sheet.turn(heavy, rpm, 1)
    assert turn.contact_lost and turn.measured is None
    with pytest.raises(cam_rig.CamRigError, match=r"contact is lost at .* rpm; allowed: below"):
        Notebook(sheet, tmp_path).record(vars(heavy) | {"rpm": rpm})


# -- noise: the crossing of two cams, by readings that scatter --------------------------------


@pytest.mark.parametrize("seed", [*SEEDS, "x1", "x2"])
@pytest.mark.parametrize("rig", ["tm21", "paper_table2"])
def test_the_readings_tell_where_two_cams_are_equally_loud(rig, seed):
    """A line through each cam's readings near the crossing; below it the same is the louder."""
    sheet = sheet_of(rig, seed, lab="noise")
    true = sheet.true(sheet.answerable_setups[0])
    below = np.linspace(sheet.knob[0], 0.999 * true, 25)
    one, two = (sheet.level(cam, below, seed) for cam in sheet.cams)
    assert len(set(np.sign(two - one))) == 1
    at = [float(sheet.level(cam, np.array([true]), seed)[0]) for cam in sheet.cams]
    assert at[0] == pytest.approx(at[1], abs=0.01)
    near = np.linspace(0.94 * true, 1.06 * true, 24)
    lines = []
    for setup in sheet.setups:
        read = [sheet.turn(setup, n, i).measured for i, n in enumerate(near.tolist())]
        lines.append(np.polynomial.Polynomial.fit(near, read, 1).convert().coef)
    constant, slope = lines[0] - lines[1]
    assert -constant / slope == pytest.approx(true, rel=0.01 * sheet.default_tolerance)


def test_readings_scatter_as_is_said_and_the_next_one_is_what_is_seen():
    """Normal about the true level; by their number, so that to look again changes nothing."""
    sheet = sheet_of("tm21", lab="noise")
    setup, rpm = sheet.setups[0], 250.0
    true = float(sheet.level(setup.cam, np.array([rpm]), None)[0])
    off = np.array([sheet.turn(setup, rpm, i).measured for i in range(200)]) - true
    assert abs(off.mean()) < 4.0 * SCATTER_DB / np.sqrt(off.size)
    # 200 values: the standard deviation's own is 5 %; rounding to 0.1 dB adds 0.5 %
    assert off.std() == pytest.approx(SCATTER_DB, rel=0.2)
    assert sheet.turn(setup, rpm, 7).measured == sheet.turn(setup, rpm, 7).measured


# -- what is refused, and what a page is told -------------------------------------------------


@pytest.mark.parametrize(
    ("words", "number"),
    [("157,3", 157.3), ("157.3", 157.3), (" 1e2 ", 100.0), ("1.234,5", None), ("nan", None)],
)
def test_a_number_has_a_point_or_a_comma(words, number):
    """Of a Spanish keyboard too; what could be read in two ways is none."""
    assert parse_number(words) == number


@pytest.mark.parametrize("lab", ["vibration", "noise"])
def test_a_page_answers_with_a_comma_and_is_told_nothing_of_the_true_numbers(lab, tmp_path):
    """Nor what is asked for; theory is of the sheet's own numbers, and without a seed alone."""
    sheet = sheet_of(seed="group-3", lab=lab)
    setup = vars(sheet.setups[0])
    with served_lab(sheet, tmp_path) as lab_page:
        ask = lab_page.send
        status, page = ask("/lab/answer", setup | {"answer": "250,5"})
        assert (status, page["readings"][-1]["answer"]) == (200, 250.5)
        for answer in ("", "x", "-3", "0", None, True, [1], "1.234,5"):
            assert ask("/lab/answer", setup | {"answer": answer})[0] == 409
        said = lab_page.get("/lab/sheet").decode()
        said += json.dumps(ask("/lab/record", setup | {"rpm": 240.0}))
        assert not ask("/lab/turn", setup | {"rpm": 240.0})[1]["was_lost"]
        for asked in sheet.answerable_setups:
            assert f"{sheet.true(asked):.2f}"[:-1] not in said
    assert read_sheet(tmp_path / f"lab_{lab}_group-3.csv").readings[0].answer == 250.5
    with served_lab(sheet_of(lab=lab), tmp_path) as lab_page:
        theory = json.loads(lab_page.get("/lab/theory"))["curves"]
        assert len(theory) == len(sheet.options[sheet.marker])
        assert 0.5 * CURVE_POINTS < max(map(len, theory)) <= CURVE_POINTS
        assert all(np.isfinite(curve).all() for curve in theory)


# -- a class at one server: a hidden rig, a page and a file for each group, and none is lost -----

#: Readings that a page records until its server is killed.
EACH = 10


@contextmanager
def class_server(out, groups):
    """`cam-rig panel --lab jump` for all groups as a process, and the address of each group."""
    seeds = [word for group in groups for word in ("--seed", group)]
    with begin_panel(out, "--lab", "jump", *seeds, stderr=subprocess.DEVNULL) as process:
        lines = [process.stdout.readline().strip() for _ in groups]
        try:
            yield process, dict(line.split(": ", 1) for line in lines)
        finally:
            process.kill()


def page_of(addresses, group):
    """A browser of a group's, led to its page, and the sheet that it is shown."""
    page = Visitor(addresses[group])
    return page, json.loads(page.get(f"/lab/{group}/sheet"))


def record_until_killed(addresses, group, recorded_one):
    """Speeds whose recording a page was told of, with what it had on its way in the end."""
    (page, sheet), told = page_of(addresses, group), []
    setup = {name: values[0] for name, values in sheet["options"].items()}
    for rpm in range(400, 400 + EACH):
        try:
            status, _, _ = page.post(f"/lab/{group}/record", json.dumps(setup | {"rpm": rpm}))
        except (OSError, HTTPException):  # the server is no more, or ended within its answer
            return told, rpm
        assert status == 200
        told.append(rpm)
        recorded_one()
    return told, None


@pytest.mark.slow
@pytest.mark.parametrize("many", [6, pytest.param(30, marks=pytest.mark.long)])
def test_groups_at_once_lose_nothing_when_the_server_is_killed(many, tmp_path):
    """What a page was told is in its group's file; started again, the server goes on with it."""
    groups = [f"group-{number}" for number in range(many)]
    with class_server(tmp_path, groups) as (server, places), ThreadPoolExecutor(many) as pool:
        count = iter(range(many * EACH))

        def one():
            if next(count) == 3 * many:
                server.kill()

        pages = [(pool.submit(record_until_killed, places, group, one), group) for group in groups]
        told = {group: page.result(WAIT_S) for page, group in pages}
    assert any(rpm is not None for _, rpm in told.values())
    with class_server(tmp_path, groups) as (_, places):
        for group, (speeds, waiting) in told.items():
            found = [row["rpm"] for row in page_of(places, group)[1]["readings"]]
            assert found[: len(speeds)] == speeds
            assert found[len(speeds) :] in ([], [waiting])
    files = [path for path in tmp_path.glob("lab_*.csv") if path.stat().st_size]
    assert {read_sheet(path).seed for path in files} == {g for g in groups if told[g][0]}
    marks = mark_sheets(files[:2], [], None, None)
    assert len(marks.tables()) > 0


def test_each_group_has_a_rig_and_a_page_of_its_own(tmp_path):
    """One seed is a sheet at /lab, several are a page each; a name stands for one group."""
    cams, rig = sheet_of().cams.values(), sheet_of().rig
    room = ClassRoom("jump", ("one", "two"), None)
    pages = room.pages([*cams], rig, tmp_path)
    assert list(pages) == ["/lab/one", "/lab/two"]
    assert list(ClassRoom("jump", ("one",), None).pages([*cams], rig, tmp_path)) == ["/lab"]
    with serve(*pages.values(), home="/lab/one") as served:
        one, two = (Visitor(served.access.address(place)) for place in pages)
        assert (one.home, two.home) == ("/lab/one", "/lab/two")
        assert json.loads(two.get("/lab/two/sheet"))["seed"] == "two"
    with pytest.raises(ConfigError, match="one is repeated"):
        ClassRoom("jump", ("one", "one"), None).pages([*cams], rig, tmp_path / "other")


def test_a_sheet_of_something_else_is_not_gone_on_with(tmp_path):
    """A file of another rig stays as it is."""
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


def test_an_address_of_this_machine_answers_to_its_name_alone():
    """``--host`` is the only name that a browser may ask by; another machine's is refused."""
    own = "127.0.0.2"  # every machine's, as 127.0.0.1 is, and not that one
    with serve(home="/lab", host=own) as served:
        assert served.access.netloc == f"{own}:{served.access.port}"
        assert Visitor(served.address).home == "/lab"
    words = r"--host: is '203\.0\.113\.1' .*an address of this machine"
    with pytest.raises(ConfigError, match=words), serve(host="203.0.113.1"):
        pass
