"""What the page is told: what a student may see, and nothing of the hidden rig's numbers."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from cam_rig.panel.lab.pages import LabPages
from cam_rig.panel.lab.sheet_file import read_sheet
from cam_rig.panel.server import STATIC, serve

from .conftest import ServedLab, sheet_of

#: A number this near (relative) to a true one would give it away.
NEAR = 1e-4


def numbers(value: object) -> list[float]:
    """All numbers of plain data, also those in its texts."""
    if isinstance(value, dict):
        return [n for item in value.values() for n in numbers(item)]
    if isinstance(value, list):
        return [n for item in value for n in numbers(item)]
    if isinstance(value, str):
        return [float(n) for n in re.findall(r"\d+\.?\d*(?:e[+-]?\d+)?", value)]
    return [float(value)] if isinstance(value, int | float) and not isinstance(value, bool) else []


def test_nothing_of_the_hidden_rig_is_in_any_answer(hidden: ServedLab) -> None:
    """Neither its numbers nor its jump speeds; the force, rounded as a sensor's, is observed."""
    sheet = hidden.pages.notebook.sheet
    secret = set()
    for setup in sheet.setups:
        true = sheet.true_rig(setup).follower
        kinds = ("mass", "spring_stiffness", "preload", "damping", "stem_damping")
        secret |= {getattr(true, kind).si for kind in kinds} | {sheet.jump_rpm(setup)}
    said = []
    for rpm in (200.0, 400.0):
        for i in range(len(sheet.setups)):
            status, turn = hidden.post("/lab/turn", hidden.asked(i, rpm) | {"sound": True})
            assert status == 200
            assert set(turn) == {"contact_lost", "was_lost", "force", "sound", "rate"}
            assert all(abs(force * 10.0 - round(force * 10.0)) < 1e-9 for force in turn["force"])
            said += numbers(turn["rate"])
            said += numbers(hidden.post("/lab/record", hidden.asked(i, rpm))[1])
    for path in ("/lab/sheet", "/lab/theory", "/lab/readings.csv", "/lab"):
        said += numbers(hidden.get(path)[1])
    said += numbers(hidden.post("/lab/student", {"student": "Ana"})[1])
    found = [(n, s) for n in said for s in secret if abs(n - s) <= NEAR * s]
    assert len(said) > 100
    assert len(secret) > 20
    assert found == []


def test_the_theory_is_shown_without_a_seed_alone(hidden: ServedLab, plain: ServedLab) -> None:
    """With one it would be another rig's."""
    status, body = hidden.get("/lab/theory")
    assert status == 409
    assert "without a seed" in json.loads(body)["words"]
    sheet = plain.pages.notebook.sheet
    slope = json.loads(plain.get("/lab/theory")[1])["slope"]
    for setup in sheet.setups:  # the rigid follower's line, which damping and angle lie below
        assert 0.9 < sheet.jump_rpm(setup) ** 2 / (slope * sheet.load(setup)) < 1.0


def test_the_lamp_goes_on_above_the_jump_and_stays_on(hidden: ServedLab) -> None:
    """Also between two resonances, where contact holds again: the way up has passed the first."""
    sheet = hidden.pages.notebook.sheet
    again = 0
    for i, setup in enumerate(sheet.setups):
        jump = sheet.jump_rpm(setup)
        for rpm in (
            round(jump - 0.02, 2),
            round(jump + 0.02, 2),
            *(jump + 8.0 * k for k in (1, 3)),
        ):
            _, turn = hidden.post("/lab/turn", hidden.asked(i, rpm))
            assert (turn["contact_lost"] or turn["was_lost"]) is (rpm > jump)
            again += turn["was_lost"] and not turn["contact_lost"]
    assert again > 0


def test_the_address_leads_to_the_sheet(plain: ServedLab) -> None:
    """And its page needs nothing from another host."""
    assert plain.home == "/lab"
    status, page = plain.get("/lab")
    assert status == 200
    assert "http" not in page
    assert set(re.findall(r'(?:src|href)="([^"]+)"', page)) - {"data:,"} <= {
        "/",
        "/bench",
        "/lab",
        "/lab/readings.csv",
        "/static/common/style.css",
        "/static/bench/bench.css",
        "/static/lab/lab.css",
        "/static/lab/main.js",
    }


def test_every_reading_is_in_the_file_at_once_and_no_other_is_overwritten(tmp_path: Path) -> None:
    """A panel that is killed loses nothing; the next one, of the same name, takes another file."""
    for number, name in ((1, "lab_jump_paper_table2.csv"), (2, "lab_jump_paper_table2_2.csv")):
        pages = LabPages(sheet_of(), tmp_path)
        with serve(pages) as served:
            lab = ServedLab(pages, served.address)
            assert not (tmp_path / name).exists()
            for i in range(1, 4):
                assert lab.post("/lab/record", lab.asked(i, 300.0 + number))[0] == 200
                assert len(read_sheet(tmp_path / name).readings) == i
            assert lab.post("/lab/student", {"student": 'Ñ, "x'})[0] == 200
            assert lab.get("/lab/readings.csv")[1] == (tmp_path / name).read_text("utf-8")
            shown = json.loads(lab.get("/lab/sheet")[1])  # what a reload shows
            assert [r["rpm"] for r in shown["readings"]] == [300.0 + number] * 3
            assert shown["file"] == str(tmp_path / name)
        found = read_sheet(tmp_path / name)
        assert found.student.startswith("Ñ")
        assert found.readings == pages.notebook.recorded.readings
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"rpm": "fast"}, "rpm: is 'fast'; allowed: "),
        ({"rpm": 1e9}, "rpm: is '1000000000.0'; allowed: "),
        ({"rpm": None}, "rpm"),
        ({"rpm": True}, "rpm"),
        ({"spring_stiffness": 4029}, "spring_stiffness: is '4029'; allowed: 3020, 4030, 6040"),
        ({"added_mass": [0]}, "added_mass"),
        ({"preload": {}}, "preload"),
    ],
)
def test_nonsense_is_refused_in_words_and_not_recorded(
    plain: ServedLab, change: dict, words: str
) -> None:
    """By the name of what is wrong."""
    for path in ("/lab/turn", "/lab/record"):
        status, body = plain.post(path, plain.asked(0, 300.0) | change)
        assert status == 409
        assert words in body["words"]
    assert plain.pages.notebook.recorded.readings == ()
    for student in (None, 7, "a\nb", "x" * 81):
        assert plain.post("/lab/student", {"student": student})[0] == 409


def test_a_reading_that_cannot_be_written_is_not_taken(tmp_path: Path) -> None:
    """The page says so; what is shown is what is kept."""
    (tmp_path / "out").write_text("a file")
    pages = LabPages(sheet_of("tm21"), tmp_path / "out")
    with serve(pages) as served:
        lab = ServedLab(pages, served.address)
        status, body = lab.post("/lab/record", lab.asked(0, 300.0))
    assert status == 409
    assert "allowed: a folder" in body["words"]
    assert pages.notebook.recorded.readings == ()


def test_the_page_has_every_text_it_asks_for() -> None:
    """A key without words would end the page's script."""
    words = json.loads((STATIC / "texts" / "en.json").read_text("utf-8"))
    texts = "".join(p.read_text("utf-8") for p in (STATIC / "lab").iterdir())
    keys = set(re.findall(r'data-text="(\w+)"', texts)) | set(re.findall(r'text\("(\w+)"', texts))
    assert len(keys) > 20
    assert keys <= set(words)
