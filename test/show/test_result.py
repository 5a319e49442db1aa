"""Tests of results: display tables, JSON, CSV and data frames from one definition.

A result lists its columns once, and all outputs are made from this list.
"""

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import pytest
import typer
from typer.testing import CliRunner

from cam_rig.errors import ConfigError
from cam_rig.show import tables
from cam_rig.show.command import command
from cam_rig.show.result import Column, Footnote, Progress, Result
from cam_rig.show.tables import DataTable, Header, format_number, pluralize, relabel, tabulate


@dataclass(frozen=True)
class Row:
    cam: str
    rpm: float
    lift: float
    left: bool = False


@dataclass(frozen=True, repr=False)
class Lifts(Result):
    schema = "lifts.1"
    columns: ClassVar = {
        "lifts": (
            Column("cam"),
            Column("rpm", "rpm", "g"),
            Column("lift", "mm", ".1f"),
            Column("left", hidden=True),
        ),
        "rig": (Column("mass", "g", ".0f", of=lambda mass: mass),),
    }
    rows: tuple[Row, ...]

    def tables(self):
        note = Footnote("Has left.", lambda row: row.left, "†")
        lifts = self.table("lifts", "At {rpm:g} rpm", self.rows, note, group_by="rpm")
        return [lifts, self.table("rig", "The rig", [1.5], single=True, hidden=True)]


RESULT = Lifts((Row("a", 300.0, 0.05), Row("b", 200.0, math.nan), Row("b", 300.0, 0.04, True)))


def test_tables_have_display_units_and_data_si_units():
    """Displayed tables have display units and footnotes. Data are in SI.

    There is a table for each speed. NaN is null in JSON.
    """
    slow, fast = RESULT.to_display({"a": "Cam A"})
    assert (slow.caption, fast.caption) == ("At 200 rpm", "At 300 rpm")
    assert fast.text_rows == [["Cam A", "50.0"], ["b †", "40.0"]]
    assert [column.title for column in fast.columns] == ["cam", "lift [mm]"]
    assert (slow.notes, fast.notes) == ((), ("† Has left.",))
    data = RESULT.data()
    assert data["schema"] == "lifts.1"
    assert data["rig"] == {"mass": 1.5}
    assert data["lifts"][1] == {"cam": "b", "rpm": 200.0, "lift": None, "left": False}
    assert json.loads(RESULT.to_json()) == data


def test_csv_and_pandas_contain_the_keys():
    """CSV and data frames of a result have the keys of its JSON, and all digits."""
    assert RESULT.tables()[0].to_csv().splitlines()[:2] == [
        "cam,rpm,lift,left",
        "a,300.0,0.05,False",
    ]
    frame = pytest.importorskip("pandas").DataFrame(RESULT.data()["lifts"])
    assert RESULT.to_pandas().equals(frame) and RESULT.to_pandas("rig").mass.tolist() == [1.5]
    assert repr(RESULT) == "Lifts(lifts: 3 rows, rig: 1 rows)"
    assert "<td>b †</td>" in RESULT._repr_html_()


def test_a_column_follows_a_path():
    """The path of a column, attributes and indices, selects its value in a row.

    If a part of the path is None, the value is None.
    """
    values = [Column("a", of=path).value([1j, (None, 2.0)]) for path in ("0.imag", "1.1", "1.0.x")]
    assert values == [1.0, 2.0, None]


def run_command(tmp_path, *arguments):
    """Make a command of a function that returns a result, and run it with arguments."""
    app = typer.Typer()

    @app.command()
    @command("json", "csv")
    def lifts(min_lift: float = 0.0, *, csv: Path | None, progress: Progress) -> Lifts:
        """List lifts above the minimum."""
        if csv is not None and csv.suffix == ".txt":
            raise ConfigError(f"--csv {csv.name}: is not a table")
        if min_lift < 0.0:
            raise ConfigError(f"--min-lift: is {min_lift:g}; allowed: 0 or more")
        return Lifts(tuple(row for row in progress.track(RESULT.rows) if row.lift > min_lift))

    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def test_a_function_that_returns_a_result_is_a_command(tmp_path):
    """A function that returns a result object becomes a command with JSON and CSV.

    Tables are printed to stderr, and data to files or stdout. Output paths are checked before the
    computation.
    """
    table = tmp_path / "lifts.csv"
    done = run_command(tmp_path, "--min-lift", 0.045, "--json", "-", "--csv", table)
    assert done.exit_code == 0
    assert [row["cam"] for row in json.loads(done.stdout)["lifts"]] == ["a"]
    assert "At 300 rpm" in done.stderr and table.read_text().splitlines()[1] == "a,300.0,0.05,False"
    assert (tmp_path / "lifts.rig.csv").read_text() == "mass\n1.5\n"
    wrong = run_command(tmp_path, "--min-lift", -1)
    message = "cam-rig: --min-lift: is -1; allowed: 0 or more\n"
    assert (wrong.exit_code, wrong.stderr) == (2, message)
    assert "is a folder" in run_command(tmp_path, "--min-lift", -1, "--json", tmp_path).stderr
    rejected = run_command(tmp_path, "--csv", tmp_path / "a.txt")
    assert rejected.stderr == "cam-rig: --csv a.txt: is not a table\n"
    assert not (tmp_path / "a.txt").exists()
    assert run_command(tmp_path, "--plot", "a.png").exit_code == 2


# -- display tables: headings, cells, number formats


FIELDS = (
    (Header("cam"), lambda row: row[0]),
    (Header("speed", "rpm", ".1f", "none"), lambda row: row[1]),
    (Header("twist", "°", ".4f"), lambda row: None),
)
ROWS = (("a", 413.4426), ("b", None))


def test_numbers_are_formatted_and_typeset():
    """Numbers have their shortest form, with typeset minus signs and exponents.

    The plural of a word agrees with its number.
    """
    values = (1.26e6, 3.3e8, 0.05, 4030.0, 9.8599e-5)
    assert [*map(format_number, values)] == ["1.26e6", "3.3e8", "0.05", "4030", "9.8599e-5"]
    expected = "−0.25 to 3.3·10⁸, 10⁻⁹ on bezier-15"
    assert tables.typeset("-0.25 to 3.3e8, 1e-09 on bezier-15") == expected
    assert [pluralize(n, "point") for n in (1, 64)] == ["1 point", "64 points"]
    assert pluralize(2, "process") == "2 processes"


def test_a_table_is_written_as_markdown():
    """A table in Markdown has name and caption in bold, and numbers aligned right."""
    table = DataTable("Speeds", (Header("cam"), Header("n", "rpm", "d")), (("a", 9),))
    expected = "**Table 3. Speeds**\n\n| cam | n [rpm] |\n| --- | ---: |\n| a | 9 |"
    assert tables.to_markdown(table, "Table 3. ") == expected


@pytest.mark.parametrize(
    ("value", "number_format", "printed"),
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
def test_decimals_are_limited_to_four_digits_on_a_page(value, number_format, printed):
    """In a report a number with decimals is limited to four digits.

    Formats by significant digits, such as .6g, keep their digits.
    """
    assert Header("a", "", number_format).typeset(value) == printed


def test_cells_are_formatted_by_their_header():
    """The header of a column sets its title, number format and text without a value.

    Columns without any value are dropped.
    """
    table = tabulate("Speeds", ROWS, FIELDS, "A note.", "")
    assert [column.title for column in table.columns] == ["cam", "speed [rpm]"]
    assert table.text_rows == [["a", "413.4"], ["b", "none"]]
    assert table.rows == ROWS
    assert table.notes == ("A note.",)


def test_a_table_without_rows_is_empty():
    """A table without rows has no columns and no notes, and is not an error."""
    assert tabulate("None", [], FIELDS) == DataTable("None", (), ())


#: Display names of cams in the tests of `relabel`, by name.
TITLES = {"tm21": "TM21 cam", "cam_2": "Second", "level": "Level cam"}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("tm21 and cam_2.", "TM21 cam and Second."),
        ("level", "Level cam"),
        ("the level of tm21", "the level of TM21 cam"),
        ("rig tm21", "rig tm21"),
        ("cams/tm21.yaml, tm21_sweep, my-tm21", "cams/tm21.yaml, tm21_sweep, my-tm21"),
    ],
)
def test_only_names_are_replaced(text, expected):
    """`relabel` replaces names of cams in a text, but not words, rigs and paths.

    A name that may be a word is replaced only if it is the whole text.
    """
    assert relabel(text, TITLES) == expected and relabel(text, {}) == text


def test_a_table_is_relabelled():
    """Caption, headings, cells and notes of a table get the labels of the cams.

    Numbers, units and names of rigs do not change.
    """
    heads = Header("level"), Header("rig"), Header("n", "cam_2", "g")
    table = DataTable("Lift of tm21", heads, (("cam_2", "tm21", 1.0),)).relabel(TITLES)
    assert table.caption == "Lift of TM21 cam"
    assert [column.title for column in table.columns] == ["level", "rig", "n [cam_2]"]
    assert table.rows == (("Second", "tm21", 1.0),)
