"""cam-rig panel --mark: how far each reading is from the truth, and what is no sheet."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

import cam_rig
from cam_rig.cli.main import app
from cam_rig.panel.lab.sheet_file import Notebook, read_sheet, to_text

from .conftest import sheet_of


def written(folder: Path, seed: str | None, off: float = 0.0, rig: str = "paper_table2") -> Path:
    """A sheet of three readings, so far (relative) off the truth."""
    sheet = sheet_of(rig, seed)
    book = Notebook(sheet, folder)
    book.name("Ana")
    for setup in sheet.setups[:3]:
        book.record(vars(setup) | {"rpm": sheet.jump_rpm(setup) * (1.0 + off)})
    assert book.path is not None
    return book.path


def mark(*arguments: object) -> tuple[int, str, str]:
    """Exit code, stdout and stderr."""
    found = CliRunner().invoke(app, ["panel", "--mark", *map(str, arguments)])
    return found.exit_code, found.stdout, found.stderr


def test_marks_are_the_difference_to_find_jump(tmp_path: Path) -> None:
    """Of the hidden rig with a seed, of the rig's own numbers without; 2 % off is not within 1."""
    right, wrong = written(tmp_path, "alpha"), written(tmp_path, None, off=0.02)
    code, out, err = mark(right, wrong, "--json", "-")
    assert code == 0
    found = json.loads(out)
    assert [found[str(p)]["within"] for p in (right, wrong)] == [3, 0]
    assert "Ana: 3 of 3 within 1 %" in err
    assert "0 of 3 within 1 %; mean +2.00 %" in err
    own = cam_rig.load_rig("paper_table2").with_follower(spring_stiffness=3020.0)
    law = cam_rig.build_law(cam_rig.load_cam("poly345"))
    first = found[str(wrong)]["readings"][0]
    assert first["true_rpm"] == pytest.approx(
        cam_rig.jump_speed(law, own, duration=None).rpm, abs=0.01
    )
    assert first["difference_percent"] == pytest.approx(2.0, abs=0.01)
    assert mark(wrong, "--tolerance", 2.5)[2].count("3 of 3 within 2.5 %") == 1


def test_the_table_is_written_as_csv(tmp_path: Path) -> None:
    """A row a reading, with units."""
    target = tmp_path / "marks.csv"
    assert mark(written(tmp_path, "alpha"), "--csv", target)[0] == 0
    lines = target.read_text("utf-8").splitlines()
    assert lines[1].startswith("reading,spring [N/m],added mass [kg],preload [N],read [rpm],true")
    assert len(lines) == 5


def test_a_spreadsheet_may_have_saved_it(tmp_path: Path) -> None:
    """Commas after the head's lines, a byte order mark, quotation marks, empty lines."""
    path = written(tmp_path, "alpha")
    before = read_sheet(path)
    text = path.read_text("utf-8")
    lines = [f'"{line}",,,,' if line.startswith("#") else line for line in text.splitlines()]
    path.write_bytes(("\ufeff" + "\r\n".join([*lines, ",,,,", ""])).encode("utf-8"))
    assert read_sheet(path) == before


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("# cam_rig lab sheet: jump\n", "", "no lab sheet; allowed: a file that cam-rig panel"),
        ("sheet: jump", "sheet: fly", "is 'fly'; allowed: jump"),
        ("cam: poly345", "cam: ../../x", "cam is '../../x'; allowed: a name"),
        ("cam: poly345", "cam: nothing", "no such file"),
        ("seed: alpha", "seed: a b", "--seed: is 'a b'; allowed"),
        ("speed_rpm", "speed", "the columns are others; allowed: reading, spring_N_m"),
        ("3020.0,0.0", "3020.0,abc", "added_mass_kg is 'abc'; allowed: a number"),
        ("3020.0,0.0", "3020.0,nan", "added_mass_kg is 'nan'; allowed: a number"),
        ("3020.0,0.0", "999,0.0", "999 N/m, 0 kg, 30.6 N is no set-up of this sheet; allowed"),
        ("3020.0,0.0", "3020.0", "has 4 cells; allowed: 5"),
    ],
)
def test_a_damaged_sheet_is_one_line(tmp_path: Path, old: str, new: str, words: str) -> None:
    """With file, place, value and what is allowed."""
    path = written(tmp_path, "alpha")
    text = path.read_text("utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), "utf-8")
    code, _, err = mark(path)
    assert code == 2
    assert words in err
    assert str(path) in err or "no such file" in words
    assert err.count("\n") == 1


def test_another_cam_or_rig_is_one_line(tmp_path: Path) -> None:
    """What is named must be what is on the sheet; what is not a file is named too."""
    path = written(tmp_path, None, rig="tm21")
    assert mark(path)[0] == 0
    assert mark("poly345", path, "--rig", "tm21")[0] == 0
    for arguments, words in (
        (("cycloidal", path), "is of cam 'poly345', marked with 'cycloidal'"),
        ((path, "--rig", "paper_table2"), "is of rig 'tm21', marked with 'paper_table2'"),
        ((tmp_path / "none.csv",), "No such file"),
        ((), "no sheet is named"),
        ((path, "--seed", "x"), "--seed"),
        ((path, "--lab", "jump"), "--mark serves no page"),
    ):
        code, _, err = mark(*arguments)
        assert code == 2
        assert words in err
        assert err.count("\n") == 1


def test_a_sheet_without_readings_is_none_to_mark(tmp_path: Path) -> None:
    """And one with binary in it is no sheet."""
    path = written(tmp_path, None)
    path.write_text(to_text(replace(read_sheet(path), readings=())), "utf-8")
    assert "has 0 readings; allowed: 1 to 1000" in mark(path)[2]
    path.write_bytes(b"\xff\xfe\x00")
    assert "is no text in UTF-8" in mark(path)[2]
