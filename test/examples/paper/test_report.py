"""Tests of the report on the paper: every section with figures and tables."""

import re
from concurrent.futures import Future

import pytest

from examples.paper import as_cut, factorial, flywheel, readings, report, sections, shared, stem

from ...cli.test_report import numbered, sentences, too_long, untypeset

#: Names of cams and rises that are not words. The report must have their titles instead, except
#: after "rig".
NAMES = r"(?<!rig )\b(tm21|bezier\d+|poly\d+|bezier_segments|simple_harmonic)\b"

#: Replacement of a picture, which would take a second or two to draw.
PICTURE = "data:image/svg+xml;base64,AAAA"


class Here:
    """Replacement of the process pool that runs each task at once in this process."""

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def submit(self, function, *given):
        done = Future()
        done.set_result(function(*given))
        return done


@pytest.fixture
def no_faulty_figure():
    """Disable the check of figures, because the tests of the scripts check them."""


@pytest.fixture
def fewer(monkeypatch):
    """Reduce each long study of the report to a few cases without figures."""
    pictures = property(lambda content: {key: [PICTURE] * 2 for key in content.figures})
    monkeypatch.setattr("cam_rig.report.document.Content.figure_uris", pictures)
    monkeypatch.setattr("examples.paper.designs.REQUESTS", ())
    monkeypatch.setattr(stem, "STEP_RPM", 50.0)
    monkeypatch.setattr(stem, "ELEMENTS", (1.0, stem.BAR))
    monkeypatch.setattr(as_cut, "BASES", (0.065,))
    monkeypatch.setattr(as_cut, "ROLLERS", (0.02,))
    monkeypatch.setattr(flywheel, "INERTIAS", (flywheel.SHOWN, flywheel.INERTIAS[-1]))
    monkeypatch.setattr(sections, "BOUNCE_SPEEDS", 11)
    monkeypatch.setattr(readings, "SPEEDS", 32)
    monkeypatch.setattr(readings, "TURN_SAMPLES", 640)
    monkeypatch.setattr(factorial, "EVENTS", (105.0, 135.0))
    monkeypatch.setattr(factorial, "GENTLE", (110.0, 130.0))
    monkeypatch.setattr(report, "ProcessPoolExecutor", Here)


@pytest.mark.slow
@pytest.mark.usefixtures("fewer")
def test_the_page(tmp_path, capsys):
    """A page of a few cases is complete, and the title of each section is printed."""
    check_page(tmp_path, figures=18)  # without that of the best law
    printed = capsys.readouterr().out
    assert all(section.title in printed for section in sections.SECTIONS)


@pytest.mark.long
@pytest.mark.slow
def test_the_whole_page(tmp_path):
    """The report with all speeds, readings of Table 2 and laws has all 19 figures."""
    check_page(tmp_path, figures=19)


def check_page(tmp_path, figures):
    """Check a report page: sections, figures, tables 1 to 3, origins of numbers.

    `figures` is the expected number of figures. The page starts with the statements of the paper
    and the results of the rig. It loads nothing from outside, and no sentence has over 30 words.
    """
    out = tmp_path / "out" / "paper.html"
    report.main(["--out", str(out)])
    page = out.read_text(encoding="utf-8")
    pictures = re.findall(r'<img src="([^"]{,40})', page)
    assert page.count("<figure ") == figures < len(pictures)  # tall pictures are divided
    assert all(p.startswith("data:image/svg+xml;base64,") for p in pictures)
    for words in ("Table 1:", "Table 2:", "Table 3:", "Given, assumed, identified"):
        assert words in page
    plain = page.replace("&#39;", "'")
    for number in ("s 1", "s 2", "s 3.1 to 3.12", "s 4, 5, 6 and 9", "s 11", "s 12", "s 16"):
        assert re.search(rf"<b>Figure \d+, the [a-z ]+'{number}\.</b>", plain)
    assert numbered(page, "figure") == list(range(1, figures + 1))
    assert numbered(page, "table") == list(range(1, page.count("<table>") + 1))
    assert set(re.findall(r'href="#([^"]*)"', page)) <= set(re.findall(r' id="([^"]*)"', page))
    for outward in ("<script", "http://", "https://", "<link"):
        assert outward not in page
    assert too_long(page) == [] and untypeset(page) == []
    listed = page.index('<details id="numbers">')  # lists file names
    titled = re.sub('<td data-head="rig".*?</td>', "", page[:listed])
    named = [words for words in sentences(titled) if re.search(NAMES, words)]
    assert named == []
    (summary,) = re.findall(r'<section id="summary">(.*?)</section>', page, re.DOTALL)
    assert summary.count("<tr>") == 1 + 8


@pytest.mark.slow
def test_numbers_of_the_summary():
    """The results in the report's summary are those that the documentation states."""
    paper = shared.Paper(factorial.study)
    rows = {question: here for question, _, here in shared.summary_table(paper).rows}
    assert list(rows.values()) == [
        "6 at every speed compared, 5 by either measure of vibration",
        "within 0.37 % r.m.s. on 4 cams that identified the rig, 0.53 % on 1 that did not",
        "0.7 to 1.7; 0 of the printed times come out, in 6 readings",
        "within 0.28 dB r.m.s.; published curve in the 95 % band at 90 % of the speeds",
        "334.5 ± 7.2 rpm, 95 % interval 326.0 to 353.4 rpm",
        "its lift makes 97.5 % of the variation, the high dwell 0.9 %",
        "72 % to 101 %",
        "law 92 %, its class of continuity 90 %, angle 8 %",
    ]


def test_table_1():
    """Table 1 of the report has the paper's parameters and those of both rigs."""
    rows = sections.table_1(shared.Paper(factorial.study)).for_report.text_rows
    assert rows == [
        ["return spring [N/m]", "4030", "4030", "4030"],
        ["follower stem [N/m]", "3.3e8", "3.3e8", "1.26e6"],
        ["damping [N·s/m]", "8.642", "8.642", "8.642"],
        ["mass [kg]", "1.3", "1.3", "1.3"],
        ["lift [m]", "0.05", "0.05", "0.05"],
    ]


def test_another_kind_of_page(tmp_path, capsys):
    """A report file with another suffix than .html or .md is refused before the run."""
    with pytest.raises(SystemExit):
        report.main(["--out", str(tmp_path / "a.pdf")])
    assert "unknown kind of page; allowed: .html, .md" in capsys.readouterr().err
