"""Lab sheets for students: hidden rig, observations, data of a page, and marks.

A seed changes the numbers of the rig within tolerances that the students do not know. They measure
its jump speed or another quantity, which is then marked.
"""

import csv
import json
import re
from dataclasses import replace

import numpy as np
import pytest

import cam_rig
from cam_rig.dynamics.jump.any_follower import follower_of
from cam_rig.dynamics.jump.rigid_mass import rigid_min_force
from cam_rig.errors import ConfigError
from cam_rig.panel.lab.labs import LABS, TOLERANCES, TURN_POINTS, lab_sheet
from cam_rig.panel.lab.pages import LabPages
from cam_rig.panel.lab.recorded import Notebook, read_sheet, to_text
from cam_rig.panel.lab.sheet import LabSetup, hidden_factor
from cam_rig.units import RPM

from ..cli.conftest import call
from ..viewer.asking import ask
from .conftest import ANSWERS, filled, served_lab, sheet_of

# -- the hidden rig: equal on every machine, within its tolerances

#: Expected factor 1 + 0.04 (2 x/(2^64 - 1) - 1) for the mass with the seed "alpha". x is the
#: integer of the first eight bytes of the SHA-256 of four words, one per line.
ALPHA_MASS = 1.0175396720583243


def test_a_seed_gives_the_same_rig_on_every_machine():
    """A seed gives the hidden factor and jump speed that another machine computed."""
    assert hidden_factor("jump", "alpha", "mass 0", 0.04) == pytest.approx(ALPHA_MASS, rel=1e-15)
    sheet = sheet_of(seed="alpha")
    assert sheet.true(LabSetup(4030.0, 0.0, 30.6)) == pytest.approx(408.900, abs=0.01)


def test_every_hidden_factor_is_uniform_within_its_tolerance():
    """Hidden factors of 2000 seeds are uniform within the tolerance.

    They reach 98 % of both limits, and their mean is 1 within 5 standard errors.
    """
    for kind, tolerance in TOLERANCES.items():
        factors = np.array([hidden_factor("jump", f"n{i}", kind, tolerance) for i in range(2000)])
        assert np.abs(factors - 1.0).max() <= tolerance and factors.max() > 1.0 + 0.98 * tolerance
        assert factors.min() < 1.0 - 0.98 * tolerance
        # The standard error of the mean is tolerance / sqrt(3 n).
        assert abs(factors.mean() - 1.0) < 5.0 * tolerance / np.sqrt(3.0 * factors.size)


def test_a_spring_is_the_same_in_every_set_up_and_two_springs_differ():
    """A spring has the same hidden factor in every set-up, and two springs differ.

    Without a seed the numbers are those of the set-up.
    """
    sheet = sheet_of()

    def factor(setup):
        hidden_stiffness = sheet.true_rig(setup, "alpha").follower.spring_stiffness.si
        return hidden_stiffness / setup.spring_stiffness

    first = factor(LabSetup(4030.0, 0.0, 30.6))
    assert factor(LabSetup(4030.0, 1.0, 61.2)) == first
    assert factor(LabSetup(3020.0, 0.0, 30.6)) != first
    follower = sheet.true_rig(LabSetup(4030.0, 0.5, 30.6), None).follower
    assert (follower.mass.si, follower.preload.si) == (1.8, 30.6)


def test_a_seed_cam_or_rig_without_a_sheet_is_refused(tmp_path):
    """A seed that is not a name is refused.

    So is a cam or rig on which the lab's quantity cannot be measured.
    """
    for seed in ("", "a b", "../x", "é", "x" * 41):
        with pytest.raises(ConfigError, match=r"--seed: is .*; allowed: a name"):
            sheet_of(seed=seed)
    poly345, bezier15, arcs, conjugate = map(
        cam_rig.load_cam, ("poly345", "bezier15", "arcs_convex", "conjugate")
    )
    rig = cam_rig.load_rig("tm21")
    for lab, cams, lab_rig, message in (
        (
            "jmp",
            [poly345],
            rig,
            r"is 'jmp'; allowed: jump, vibration, noise \(did you mean 'jump'\?\)",
        ),
        ("jump", [poly345], rig.with_follower(preload=0.0), "preload of 0 N"),
        ("jump", [poly345, bezier15], rig, "allowed in lab 'jump': one"),
        ("vibration", [poly345], rig, r"periods of the stem .* allowed: 60"),
        ("noise", [poly345, bezier15], rig, r"the same cam is louder from \d+ to \d+ rpm"),
        ("noise", [arcs], rig, "allowed in lab 'noise': two different cams"),
        *((lab, [conjugate], rig, "only a closing spring") for lab in LABS),
    ):
        with pytest.raises(ConfigError, match=message):
            LabPages(lab_sheet(lab, cams, lab_rig), tmp_path)


def test_the_line_of_theory_is_the_jump_speed_of_a_rigid_follower():
    """The theoretical line n² = (k s + preload) / (m |s''|) is the rigid jump speed.

    Damping is neglected.
    """
    rig = cam_rig.load_rig("tm21").with_follower(damping=0.0)
    sheet = lab_sheet("jump", [cam_rig.load_cam("poly345")], rig)
    setup = LabSetup(rig.follower.spring_stiffness.si, 0.0, rig.follower.preload.si)
    speed = np.sqrt(sheet.load(setup) / abs(sheet.critical[1]))
    assert speed * 30.0 / np.pi == pytest.approx(cam_rig.jump_speed(sheet.law, rig).rpm, rel=1e-4)


# -- the observation agrees with the true answer

#: Relative difference from the true speed at which contact is checked: 0.008 rpm at 400 rpm.
SPEED_RTOL = 2e-5


@pytest.mark.variants(2)
@pytest.mark.parametrize("seed", [None, "Z9", "group-3", "alpha"])
@pytest.mark.parametrize("rig", ["paper_table2", "tm21"])
def test_contact_is_lost_exactly_above_the_true_speed(rig, seed):
    """A turn just below the true jump speed keeps contact, one above it loses it."""
    sheet = sheet_of(rig, seed)
    for setup in sheet.setups[::3]:
        jump = sheet.true(setup)
        assert not sheet.turn(setup, jump * (1.0 - SPEED_RTOL), 1).contact_lost, setup
        assert sheet.turn(setup, jump * (1.0 + SPEED_RTOL), 1).contact_lost, setup


def test_a_turn_in_contact_is_the_kinetostatic_force_of_one_mass():
    """The displayed force of one mass is m s'' Ω² + c s' Ω + k s + preload.

    It agrees within the resolution of the simulated sensor, 0.1 N.
    """
    sheet = sheet_of("tm21")
    rpm = 300.0
    follower, speed = follower_of(sheet.true_rig(sheet.setups[0], None)), rpm * RPM
    motion = np.array(
        [sheet.law.at(a) for a in np.arange(TURN_POINTS) * (2.0 * np.pi / TURN_POINTS)]
    ).T
    force = (
        follower.spring_stiffness * motion[0]
        + follower.damping * motion[1] * speed
        + follower.mass * motion[2] * speed**2
        + follower.preload
    )
    turn = sheet.turn(sheet.setups[0], rpm, 1)
    # 0.05 N of rounding, and a straight line between two samples at 16 kHz.
    assert np.abs(turn.curve - force).max() < 0.1
    min_force = rigid_min_force(sheet.law, follower, np.array([speed]))[0]
    assert turn.curve.min() == pytest.approx(min_force, abs=0.15)


# -- the page receives observations, but no number of the hidden rig


@pytest.fixture(scope="module")
def hidden(tmp_path_factory):
    """Client of a served sheet with a hidden rig (seed)."""
    with served_lab(sheet_of(seed="group-3"), tmp_path_factory.mktemp("lab")) as lab:
        yield lab


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """Client of a served sheet without a seed, so with the rig's own numbers."""
    with served_lab(sheet_of("tm21"), tmp_path_factory.mktemp("lab")) as lab:
        yield lab


def numbers(value):
    """Return all numbers in JSON data, those in texts included."""
    if isinstance(value, dict):
        return [n for item in value.values() for n in numbers(item)]
    if isinstance(value, list):
        return [n for item in value for n in numbers(item)]
    if isinstance(value, str):
        return [float(n) for n in re.findall(r"\d+\.?\d*(?:e[+-]?\d+)?", value)]
    return [float(value)] if isinstance(value, int | float) and not isinstance(value, bool) else []


def test_no_response_contains_a_hidden_number(hidden):
    """No response to a page contains a number within 1e-4 of a hidden number.

    Otherwise students could read the answer. The force is rounded to the sensor's resolution.
    """
    sheet = hidden.pages.notebook.sheet
    secret = set()
    for setup in sheet.setups:
        true = sheet.true_rig(setup, sheet.seed).follower
        kinds = ("mass", "spring_stiffness", "preload", "damping", "stem_damping")
        secret |= {getattr(true, kind).si for kind in kinds} | {sheet.true(setup)}
    received = []
    for i in range(len(sheet.setups)):
        status, turn = hidden.send("/lab/turn", hidden.request_data(i, 300.0) | {"sound": True})
        assert status == 200
        keys = {"contact_lost", "was_lost", "curve", "measured", "lift", "gap", "sound", "rate"}
        assert set(turn) == keys
        assert all(abs(force * 10.0 - round(force * 10.0)) < 1e-9 for force in turn["curve"])
        received += numbers(turn["rate"])
        received += numbers(hidden.send("/lab/record", hidden.request_data(i, 300.0))[1])
    for path in ("/lab/sheet", "/lab/readings.csv", "/lab"):
        received += numbers(hidden.get(path).decode())
    received += numbers(hidden.send("/lab/student", {"student": "Ana"})[1])
    revealed = [(n, s) for n in received for s in secret if abs(n - s) <= 1e-4 * s]
    assert len(received) > 100 and len(secret) > 20
    assert revealed == []


@pytest.mark.parametrize("rpm", [300.0, 480.0])
def test_the_picture_shows_the_lift_of_the_turn(plain, rpm):
    """Lift and gap of the picture are those of the follower: on the cam, or above it in flight."""
    sheet = plain.pages.notebook.sheet
    _, turn = plain.send("/lab/turn", plain.request_data(0, rpm))
    lift, gap, force = (np.array(turn[name]) for name in ("lift", "gap", "curve"))
    angle = np.arange(lift.size) * (2.0 * np.pi / lift.size)
    assert lift == pytest.approx(1e3 * sheet.law(angle) + 1e-3 * gap, abs=0.05)
    assert (gap.max() > 100.0) == turn["contact_lost"] and (gap[force > 1.0] < 50.0).all()


def test_theory_is_available_only_without_a_seed(hidden, plain):
    """The theory is refused on a sheet with a seed, whose hidden rig differs from it.

    Without a seed its slope gives the true speeds up to damping (10 %).
    """
    status, _, body = ask(hidden.address, "/lab/theory", Cookie=hidden.cookie)
    assert status == 409 and "without a seed" in json.loads(body)["message"]
    sheet = plain.pages.notebook.sheet
    theory = json.loads(plain.get("/lab/theory"))
    (line,) = theory["curves"]
    slope = 1000.0 * line[-1] / (theory["step"] * (len(line) - 1))
    for setup in sheet.setups:  # damping and angle lower it
        assert 0.9 < sheet.true(setup) ** 2 / (slope * sheet.load(setup)) < 1.0


def test_the_lamp_lights_above_the_jump_speed_and_stays_on(hidden):
    """The "contact lost" lamp is on at every speed above the jump speed.

    It stays on between two resonances, where contact is regained, because contact was lost on the
    way up.
    """
    sheet, regained = hidden.pages.notebook.sheet, 0
    for i, setup in enumerate(sheet.setups):
        jump = sheet.true(setup)
        for rpm in (round(jump - 0.02, 2), round(jump + 0.02, 2), jump + 8.0, jump + 24.0):
            _, turn = hidden.send("/lab/turn", hidden.request_data(i, rpm))
            assert (turn["contact_lost"] or turn["was_lost"]) is (rpm > jump)
            regained += turn["was_lost"] and not turn["contact_lost"]
        if regained and i > 4:
            break
    assert regained > 0


def test_every_reading_is_written_at_once_and_no_file_is_overwritten(tmp_path):
    """A reading is in the sheet's file as soon as its request is answered.

    The next panel with the same sheet writes another file.
    """
    for number, name in ((1, "lab_jump_tm21.csv"), (2, "lab_jump_tm21_2.csv")):
        with served_lab(sheet_of("tm21"), tmp_path) as lab:
            assert not (tmp_path / name).exists()
            for i in range(1, 4):
                assert lab.send("/lab/record", lab.request_data(i, 300.0 + number))[0] == 200
                assert len(read_sheet(tmp_path / name).readings) == i
            assert lab.send("/lab/student", {"student": 'Ñ, "x'})[0] == 200
            assert lab.home == "/lab"
            assert lab.get("/lab/readings.csv") == (tmp_path / name).read_bytes()
            data = json.loads(lab.get("/lab/sheet"))  # the data of a reload
            assert [r["rpm"] for r in data["readings"]] == [300.0 + number] * 3
            assert data["file"] == str(tmp_path / name)
        stored = read_sheet(tmp_path / name)
        assert stored.student.startswith("Ñ")
        assert stored.readings == lab.pages.notebook.recorded.readings
    assert len(list(tmp_path.iterdir())) == 2


def test_invalid_data_and_an_unwritable_folder_are_refused_and_not_recorded(plain, tmp_path):
    """Invalid data of a page are refused with the wrong value, and not recorded.

    A reading that cannot be written to the file is not recorded either.
    """
    for change, text in (
        ({"rpm": "fast"}, "rpm: is 'fast'; allowed: "),
        ({"rpm": 1e9}, "rpm: is '1000000000.0'; allowed: "),
        ({"rpm": None}, "rpm"),
        ({"rpm": True}, "rpm"),
        ({"spring_stiffness": 4029}, "spring_stiffness: is '4029'; allowed: 3020, 4030, 6040"),
        ({"added_mass": [0]}, "added_mass"),
        ({"preload": {}}, "preload"),
    ):
        for path in ("/lab/turn", "/lab/record"):
            status, body = plain.send(path, plain.request_data(0, 300.0) | change)
            assert status == 409 and text in body["message"]
    for student in (None, 7, "a\nb", "x" * 81):
        assert plain.send("/lab/student", {"student": student})[0] == 409
    assert plain.pages.notebook.recorded.readings == ()
    (tmp_path / "out").write_text("a file")
    book = Notebook(sheet_of("tm21"), tmp_path / "out")
    with pytest.raises(cam_rig.CamRigError, match="allowed: a folder"):
        book.record(plain.request_data(0, 300.0))
    assert book.recorded.readings == ()


# -- cam-rig mark: difference of each answer, and files that are not sheets -----------


def mark(*arguments):
    """Return exit code, stdout and stderr of `cam-rig mark`."""
    result = call("mark", *arguments)
    return result.exit_code, result.stdout, result.stderr


def error(text, *arguments):
    """Check that `cam-rig mark` refuses its arguments in one line, and return the line."""
    code, _, err = mark(*arguments)
    assert (code, err.count("\n"), text in err) == (2, 1, True), err
    return err


def test_marks_are_the_difference_to_find_jump(tmp_path):
    """A mark is the relative difference of an answer from the exact jump speed.

    JSON, CSV and text contain the answers of sheets with and without a seed.
    """
    right = filled(sheet_of(seed="alpha"), tmp_path)
    wrong, target = filled(sheet_of(), tmp_path, off=0.02), tmp_path / "marks.csv"
    picture = tmp_path / "class.png"
    code, out, err = mark(right, wrong, "--json", "-", "--csv", target, "--plot", picture)
    assert code == 0
    assert picture.stat().st_size > 5000
    result = json.loads(out)
    sheets = {row["file"]: row["within"] for row in result["sheets"]}
    assert [sheets[str(p)] for p in (right, wrong)] == [ANSWERS, 0]
    assert "Ana: 4 of 4 within 1 %" in err and "0 of 4 within 1 %; mean +2.00 %" in err
    rig = cam_rig.load_rig("paper_table2").with_follower(spring_stiffness=3020.0)
    law = cam_rig.build_law(cam_rig.load_cam("poly345"))
    first = next(row for row in result["answers"] if row["file"] == str(wrong))
    true = cam_rig.jump_speed(law, rig, duration=None).rpm
    assert first["true"] == pytest.approx(true, abs=0.01)
    assert first["difference"] == pytest.approx(0.02, abs=1e-4)
    assert mark(wrong, "--tolerance", 2.5)[2].count("4 of 4 within 2.5 %") == 1
    lines = target.read_text("utf-8").splitlines()
    assert lines[0].startswith(
        "file,reading,question,spring_stiffness,added_mass,preload,answer,true,unit,"
    )
    assert len(lines) == 1 + 2 * ANSWERS
    assert target.with_suffix(".sheets.csv").read_text("utf-8").count("\n") == 3


def test_a_sheet_that_a_spreadsheet_saved_is_read(tmp_path):
    """A sheet that was saved by a spreadsheet is read like the original.

    Added commas, a byte order mark, quotation marks and empty lines are ignored.
    """
    path = filled(sheet_of(seed="alpha"), tmp_path)
    before = read_sheet(path)
    text = path.read_text("utf-8")
    lines = [f'"{line}",,,,' if line.startswith("#") else line for line in text.splitlines()]
    path.write_bytes(("\ufeff" + "\r\n".join([*lines, ",,,,", ""])).encode("utf-8"))
    assert read_sheet(path) == before


DAMAGED = (
    ("# cam_rig lab sheet: jump\n", "", "not a lab sheet; allowed: a file that cam-rig lab"),
    ("sheet: jump", "sheet: fly", "is 'fly'; allowed: jump, vibration"),
    ("cam: poly345", "cam: ../../x", "cam is '../../x'; allowed: a name"),
    ("cam: poly345", "cam: nothing", "no such file"),
    ("seed: alpha", "seed: a b", "--seed: is 'a b'; allowed"),
    ("speed_rpm", "speed", "the columns differ; allowed: reading, spring_N_m"),
    ("3020.0,0.0", "3020.0,abc", "added_mass_kg is 'abc'; allowed: a number"),
    ("3020.0,0.0", "3020.0,nan", "added_mass_kg is 'nan'; allowed: a number"),
    ("3020.0,0.0", "999,0.0", "999 N/m, 0 kg, 30.6 N is not a set-up of this sheet; allowed"),
    ("3020.0,0.0", "3020.0", "has 4 cells; allowed: 5"),
    ("3020.0,0.0", "3" * 131_073, "characters; allowed: 10000"),
    ("# title: ", "# title: " + "x" * 131_073, "characters; allowed: 10000"),
)


def test_a_damaged_sheet_is_refused_in_one_line(tmp_path):
    """A damaged sheet, or one without readings, is refused with file, fault and rule."""
    path = filled(sheet_of(seed="alpha"), tmp_path)
    text = path.read_text("utf-8")
    for old, new, message in DAMAGED:
        assert old in text
        path.write_text(text.replace(old, new, 1), "utf-8")
        assert str(path) in error(message, path) or "no such file" in message
    path.write_text(text, "utf-8")
    path.write_text(to_text(replace(read_sheet(path), readings=())), "utf-8")
    error("has 0 readings; allowed: 1 to 1000", path)
    path.write_bytes(b"\xff\xfe\x00")
    error("is not UTF-8 text", path)


def test_no_name_becomes_a_formula_or_a_terminal_command(tmp_path):
    """Names of students are escaped in the sheet, in the CSV and on a terminal.

    A spreadsheet would run a name that starts with = or @ as a formula.
    """
    sheet = read_sheet(filled(sheet_of(seed="alpha"), tmp_path))
    path, target = tmp_path / "hostile.csv", tmp_path / "marks.csv"
    name, title = "=1+1, =2+2\x1b[31m", "@SUM(1), =3+3"
    path.write_text(to_text(replace(sheet, student=name, title=title)), "utf-8")
    again = read_sheet(path)
    assert (again.student, again.title) == (name, title)
    cells = [cell for row in csv.reader(path.open(encoding="utf-8")) for cell in row]
    assert not [cell for cell in cells if cell.strip().startswith(("=", "@"))]
    code, _, err = mark(path, "--csv", target)
    assert code == 0 and "\x1b" not in err and r"=2+2\x1b[31m: 4 of 4" in err
    (row,) = csv.DictReader(target.with_suffix(".sheets.csv").open(encoding="utf-8"))
    assert row["student"] == f"'{name}"


def test_another_cam_or_rig_is_refused_in_one_line(tmp_path):
    """`cam-rig mark` refuses a cam or rig that is not that of the sheet, in one line.

    It also refuses a missing file.
    """
    path = filled(sheet_of("tm21"), tmp_path)
    assert mark(path)[0] == 0
    assert mark(path, "--cam", "poly345", "--rig", "tm21")[0] == 0
    for arguments, text in (
        ((path, "--cam", "cycloidal"), "the sheet names cam 'poly345', not 'cycloidal'"),
        ((path, "--rig", "paper_table2"), "the sheet names rig 'tm21', not 'paper_table2'"),
        ((tmp_path / "none.csv",), "No such file"),
    ):
        error(text, *arguments)
