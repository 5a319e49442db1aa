"""Tables as data: each heading beside its cells, numbers as they are shown, CSV with all digits."""

import math

import pytest

from cam_rig.show import tables
from cam_rig.show.tables import DataTable, Head, called, counted, number, tabulate

FIELDS = (
    (Head("cam"), lambda row: row[0]),
    (Head("speed", "rpm", ".1f", "none"), lambda row: row[1]),
    (Head("twist", "°", ".4f"), lambda row: None),
)
ROWS = (("a", 413.4426), ("b", None))


def test_words_and_numbers():
    """As few characters as needed; typeset a true minus and raised powers; counts in the plural."""
    values = (1.26e6, 3.3e8, 0.05, 4030.0, 9.8599e-5)
    assert [*map(number, values)] == ["1.26e6", "3.3e8", "0.05", "4030", "9.8599e-5"]
    shown = "−0.25 to 3.3·10⁸, 10⁻⁹ on bezier-15"
    assert tables.typeset("-0.25 to 3.3e8, 1e-09 on bezier-15") == shown
    assert [counted(n, "point") for n in (1, 64)] == ["1 point", "64 points"]
    assert counted(2, "process") == "2 processes"


def test_markdown():
    """A name, the caption, numbers to the right; no blank line at the end."""
    table = DataTable("Speeds", (Head("cam"), Head("n", "rpm", "d")), (("a", 9),))
    expected = "**Table 3. Speeds**\n\n| cam | n [rpm] |\n| --- | ---: |\n| a | 9 |"
    assert tables.to_markdown(table, "Table 3. ") == expected


@pytest.mark.parametrize(
    ("value", "shown", "printed"),
    [
        (413.4426, ".2f", "413.4"),
        (-99.996, ".2f", "−100.0"),
        (0.00123456, ".5f", "0.00123"),
        (123456.7, ".1f", "123500"),
        (12345.0, ".6g", "12345"),
        (-3.3e8, ".4g", "−3.3·10⁸"),
        (1e-9, ".3g", "10⁻⁹"),
        (math.inf, ".2f", "inf"),
    ],
)
def test_a_page_has_four_digits_and_is_typeset(value, shown, printed):
    """What was found, in decimals, has four digits at most; what was set has all of its own."""
    assert Head("a", "", shown).printed(value) == printed


def test_cells_are_shown_by_their_column():
    """Digits and the word for nothing are the column's; a column of nothing is left out."""
    table = tabulate("Speeds", ROWS, FIELDS, "A note.", "")
    assert [column.title for column in table.columns] == ["cam", "speed [rpm]"]
    assert table.texts == [["a", "413.4"], ["b", "none"]]
    assert table.rows == ROWS
    assert table.notes == ("A note.",)


def test_a_table_without_rows():
    """Nothing to show is an empty table, not an error."""
    assert tabulate("None", [], FIELDS) == DataTable("None", (), ())


#: What cams are called.
TITLES = {"tm21": "TM21 cam", "cam_2": "Second", "level": "Level cam"}


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


def test_a_whole_table_by_titles():
    """Everything that is read; numbers, units and rigs stay."""
    heads = Head("level"), Head("rig"), Head("n", "cam_2", "g")
    found = DataTable("Of tm21", heads, (("cam_2", "tm21", 1.0),)).called(TITLES)
    assert found.caption == "Of TM21 cam"
    assert [column.title for column in found.columns] == ["level", "rig", "n [cam_2]"]
    assert found.rows == (("Second", "tm21", 1.0),)
