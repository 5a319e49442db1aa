"""Tables on a terminal: as wide as it is at most, words whole as long as they fit."""

import pytest
from rich.console import Console

from cam_rig.cli.common import console
from cam_rig.tables import Column, DataTable

TABLE = DataTable(
    "A caption [of] a table",
    (Column("structure, weighting"), Column("difference to published", "dB", ".2f")),
    (("double low-pass, C", 0.7312), ("[bold]name", None)),
    ("A note.",),
)


@pytest.fixture
def printed(monkeypatch, capsys):
    """What a terminal of some columns shows."""

    def lines(width, *tables):
        monkeypatch.setattr(console, "console", Console(stderr=True, width=width))
        console.show(*tables)
        return capsys.readouterr().err.splitlines()

    return lines


@pytest.mark.parametrize("width", [120, 80, 34])
def test_words_stay_whole(printed, width):
    """Cells fold between words, headings too; nothing is cut, and brackets are no markup."""
    lines = printed(width, TABLE)
    assert max(map(len, lines)) <= width
    words = " ".join(lines).split()
    for word in ("[of]", "structure,", "weighting", "difference", "published", "dB", "low-pass,"):
        assert word in words
    assert {"0.73", "[bold]name", "A", "note."} <= set(words)


def test_a_cell_is_whole_where_there_is_room(printed):
    """The columns share what is left over."""
    assert any("double low-pass, C" in line for line in printed(80, TABLE))


def test_too_narrow_a_terminal_still_shows_all(printed):
    """Words are folded rather than cut off."""
    lines = printed(12, TABLE)
    assert "…" not in "".join(lines)
    assert max(map(len, lines)) <= 12


def test_lines_are_said_as_they_are(capsys, monkeypatch):
    """Brackets of units are no markup, and long lines are the terminal's to fold."""
    monkeypatch.setattr(console, "console", Console(stderr=True, width=20))
    console.say("force [N], a line of more than twenty characters", "second")
    assert capsys.readouterr().err == ("force [N], a line of more than twenty characters\nsecond\n")
