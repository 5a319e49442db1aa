"""Titles for names: in cells, headings, captions and notes, and nowhere that is not a name."""

import doctest

import pytest

import cam_rig.report.document
from cam_rig.report.document import called, table_called
from cam_rig.show.tables import DataTable, Head

TITLES = {"tm21": "TM21 cam", "cam_2": "Second", "level": "Level cam"}


def test_examples():
    """What the docstrings show is what comes out."""
    assert doctest.testmod(cam_rig.report.document).failed == 0


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("tm21 and cam_2.", "TM21 cam and Second."),
        ("level", "Level cam"),
        ("the level of tm21", "the level of TM21 cam"),
        ("rig tm21", "rig tm21"),
        ("cams/tm21.yaml, tm21_sweep, my-tm21", "cams/tm21.yaml, tm21_sweep, my-tm21"),
    ],
)
def test_only_names_are_replaced(text, shown):
    """A word that is also a name stands, but where it is all there is; so do files and rigs."""
    assert called(text, TITLES) == shown
    assert called(text, {}) == text


def test_a_whole_table():
    """Everything that is read; numbers and units stay."""
    table = DataTable("Of tm21", (Head("level"), Head("n", "cam_2", "g")), (("cam_2", 1.0),))
    found = table_called(table, TITLES)
    assert found.caption == "Of TM21 cam"
    assert [column.title for column in found.columns] == ["level", "n [cam_2]"]
    assert found.rows == (("Second", 1.0),)
