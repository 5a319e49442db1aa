"""Terminal output: tables fit the width, and words are not broken."""

import re
from collections import Counter

import numpy as np
import pytest
from rich.console import Console

from cam_rig.errors import CamRigError
from cam_rig.show import terminal as console
from cam_rig.show.command import LOG_PERIOD_S
from cam_rig.show.tables import DataTable, Header
from cam_rig.viewer.command import delay_report
from cam_rig.viewer.page import PageTime

TABLE = DataTable(
    "A caption [of] a table",
    (Header("structure, weighting"), Header("difference to published", "dB", ".2f")),
    (("double low-pass, C", 0.7312), ("[bold]name", None)),
    ("A note.",),
)


@pytest.fixture
def printed(monkeypatch, capsys):
    """Function that prints tables at a terminal width and returns the lines."""

    def lines(width, *tables):
        monkeypatch.setattr(console, "console", Console(stderr=True, width=width))
        console.show(*tables)
        return capsys.readouterr().err.splitlines()

    return lines


@pytest.mark.parametrize("width", [120, 80, 34])
def test_words_are_not_broken(printed, width):
    """Cells and headings of a table wrap only between words at any width.

    No text is cut, and brackets are not interpreted as markup.
    """
    lines = printed(width, TABLE)
    assert max(map(len, lines)) <= width
    words = " ".join(lines).split()
    for word in ("[of]", "structure,", "weighting", "difference", "published", "dB", "low-pass,"):
        assert word in words
    assert {"0.73", "[bold]name", "A", "note."} <= set(words)


def test_cell_that_does_not_fit_is_wrapped(printed):
    """A cell that does not fit the width is wrapped and not cut.

    The headings of other columns are not broken.
    """
    assert any("double low-pass, C" in line for line in printed(80, TABLE))
    lines = printed(12, TABLE)
    assert "…" not in "".join(lines) and max(map(len, lines)) <= 12
    columns = (Header("file"), Header("displacement", "mm", ".1f"))
    lines = printed(40, DataTable("", columns, (("/a" * 60, 1.0),)))
    assert max(map(len, lines)) <= 40
    assert {"file", "displacement", "mm"} <= {word for line in lines for word in line.split()}


WORDS = ["contact", "force", "displacement", "peak-to-peak", "at", "m/rad²", "poly345", "12.345"]


@pytest.mark.variants(8)
@pytest.mark.parametrize("seed", range(20))
def test_wide_table_is_split_into_parts(printed, seed):
    """A table that is too wide is split into parts that repeat its first column.

    No word is broken or lost.
    """
    rng = np.random.default_rng(seed)
    count, height = int(rng.integers(5, 31)), int(rng.integers(1, 6))

    def words(end):
        return " ".join(rng.choice(WORDS, int(rng.integers(1, end))))

    columns = [Header(f"{words(4)} c{i}", "mm" * (i % 2)) for i in range(1, count)]
    rows = [(f"r{k}", *(f"{words(3)} {k}:{i}" for i in range(1, count))) for k in range(height)]
    lines = printed(80, DataTable("A", (Header("key"), *columns), tuple(rows), ("N.",)))
    assert max(map(len, lines)) <= 80
    counts = Counter(word for line in lines for word in line.split())
    parts = counts["key"]
    assert parts > 1 or count < 12
    assert [counts[f"r{k}"] for k in range(height)] == [parts] * height
    assert all(counts[f"c{i}"] == 1 for i in range(1, count))
    assert all(counts[f"{k}:{i}"] == 1 for k in range(height) for i in range(1, count))
    assert set(counts) - {*WORDS, "A", "N.", "key", "mm"} == {
        word for word in counts if re.fullmatch(r"─+|[cr]\d+|\d+:\d+", word)
    }
    assert (counts["A"], counts["N."]) == (1, 1)


def test_messages_are_printed_unchanged(capsys, monkeypatch):
    """A message is printed without wrapping, and its brackets are not markup."""
    monkeypatch.setattr(console, "console", Console(stderr=True, width=20))
    console.say("force [N], a line of more than twenty characters", "second")
    assert capsys.readouterr().err == ("force [N], a line of more than twenty characters\nsecond\n")


def test_delay_of_the_viewer_page_is_logged(capsys):
    """The delay of the viewer page is displayed, and logged once per period.

    A last line has the largest delay.
    """
    wall = [0.0]
    page = PageTime(lambda: wall[0])
    with pytest.raises(CamRigError), delay_report(page, lambda: wall[0]) as delayed:
        assert delayed(1.0, "tm21") == "tm21"
        wall[0] = 1.5
        page.take("ns=900000000")
        assert delayed(2.0, "tm21") == "tm21, viewer 1.5 s behind"
        wall[0] = LOG_PERIOD_S
        page.take("ns=2000000000")
        assert "viewer" in delayed(3.0, "tm21 [at] 200 rpm")
        raise CamRigError("it was interrupted")
    lines = capsys.readouterr().err.splitlines()
    assert lines[0].startswith("tm21 [at] 200 rpm, viewer ")
    assert float(lines[-1].removeprefix("viewer at most ").removesuffix(" s behind")) >= 1.5
    assert len(lines) == 2


def test_no_delay_is_logged_without_a_viewer_page(capsys):
    """Without a viewer page the text of the progress is unchanged.

    No line follows at the end.
    """
    with delay_report(None) as delayed:
        assert delayed(1.0, "tm21") == "tm21"
    assert capsys.readouterr().err == ""
