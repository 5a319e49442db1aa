"""Tables of gauge readings: whatever separates, marks decimals or heads the columns is read."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cam_rig.errors import ConfigError
from cam_rig.measured.cam_fit.gauge import read_gauge_table
from cam_rig.measured.instrument_table import MAX_LINES, heading

ANGLES, LIFTS = [0.0, 10.0, 20.0], [0.0, 0.25, 1.5]  # deg, mm


@pytest.fixture
def read(tmp_path):
    """The table of a text, or its error."""

    def load(text, column=None):
        path = tmp_path / "lifts.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_gauge_table(path, column)

    return load


def holds_the_readings(table):
    assert table.angles == pytest.approx([math.radians(a) for a in ANGLES])
    assert table.columns[0].lifts == pytest.approx([1e-3 * s for s in LIFTS])


@pytest.mark.parametrize(
    "text",
    [
        "angle_deg,lift_mm\n0,0\n10,0.25\n20,1.5\n",
        "angle_deg;lift_mm\n0;0\n10;0,25\n20;1,5\n",
        "angle_deg\tlift_mm\n0\t0\n10\t0,25\n20\t1,5\n",
        "angle_deg lift_mm\n0 0\n10 0,25\n20 1,5\n",
        "angle_deg,lift_mm\n0,0\n10,0.25\n20,1.5\n".replace("\n", "\r\n"),
        "\ufeffangle_deg,lift_mm\n0,0\n10,0.25\n20,1.5\n",
        "angle_deg;lift_mm\n0;0\n10;0,25\n20;1,5\n".encode("utf-16"),
        "sep=;\nangle_deg;lift_mm\n0;0\n10;0,25\n20;1,5\n",
        'angle_deg,lift_mm\n"0","0"\n"10","0,25"\n"20","1,5"\n',
        "lift_mm,note,angle_deg\n0,base,0\n0.25,,10\n1.5,rising,20\n",
        "# gauge 3\nMeasured on Monday\n\nangle_deg,lift_mm\n0,0\n# again:\n10,0.25\n20,1.5\n",
        "Angle;Lift\ndeg;mm\n0;0\n10;0,25\n20;1,5\n",
        "angle_deg,lift_mm\n0°,0\n10°,2.5e-1\n20°,+1.5\n",
    ],
)
def test_forms_of_one_table(read, text):
    """Separator, decimal mark, BOM, encoding, quotes, order, titles, comments: one table."""
    holds_the_readings(read(text))


@pytest.mark.parametrize(
    ("angle", "lift"),
    [
        ("Cam angle [deg]", "Displacement [mm]"),
        ("θ / °", "s / mm"),
        ("Ángulo de leva (grados)", "Elevación (mm)"),
        ("angulo", "Alzada mm"),
        ("Nockenwinkel in Grad", "Hub in mm"),
        ("Drehwinkel (°)", "Stößelweg [mm]"),
        ("Angle de came (degrés)", "Levée (mm)"),
        ("Angolo (gradi)", "Alzata (mm)"),
        ("Ângulo (graus)", "Deslocamento mm"),
        ("crank_angle_deg", "gauge reading mm"),
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "cp1252"])
def test_headings_in_several_languages(read, angle, lift, encoding):
    """Accents and capitals do not matter, nor what Windows programs write, without Greek."""
    text = f"{angle};{lift}\n0;0\n10;0,25\n20;1,5\n"
    holds_the_readings(read(text.encode(encoding, "replace")))


@pytest.mark.parametrize(
    ("unit", "factor"),
    [
        *((unit, 0.0254) for unit in ("in", "inches", "pulgadas", "Zoll", "pouces", '"')),
        *(("mm", 1e-3), ("cm", 1e-2), ("m", 1.0), ("µm", 1e-6), ("um", 1e-6), ("thou", 2.54e-5)),
    ],
)
def test_units_of_length(unit, factor):
    """The last word that is a unit counts: "lift in mm" is in mm."""
    assert heading(f"lift ({unit})").factor == factor
    assert heading("lift in mm").factor == 1e-3


@pytest.mark.parametrize(
    ("unit", "factor"),
    [
        *(("deg", math.pi / 180), ("rad", 1.0), ("turn", 2 * math.pi), ("vueltas", 2 * math.pi)),
        *(("°", math.pi / 180), ("gon", math.pi / 200), ("Grad", math.pi / 180)),
    ],
)
def test_units_of_angle(unit, factor):
    """German Grad is a degree; what is a 400th of a turn is called gon."""
    assert heading(f"angle [{unit}]").factor == pytest.approx(factor)


def test_what_is_not_said_is_assumed_and_said(read):
    """No headings, or none with units: deg and mm, each with a sentence; few rad are rad."""
    table = read("0 0\n10 0.25\n20 1.5\n355 0\n")
    assert "no unit of angle in 'column 1': deg assumed" in table.notes
    assert "no unit of length in 'column 2': mm assumed" in table.notes
    assert table.notes[0] == "4 lines read, separator space, decimal point"
    assert read("theta,s\n0,0\n3,1\n6.2,0\n").angles[1] == 3.0
    assert not any("assumed" in note for note in read("angle_deg,lift_mm\n0,0\n1,1\n").notes)


def test_all_columns_of_lifts_are_read(read):
    """Two followers in one table; which is meant is asked for, or all are taken."""
    table = read("angle_deg,lift_a_mm,lift_b_mm\n0,0,0.0\n10,1,2\n")
    assert [column.name for column in table.columns] == ["lift_a_mm", "lift_b_mm"]
    assert table.columns[1].lifts == pytest.approx([0.0, 0.002])
    with pytest.raises(ConfigError, match=r"has 2 columns of lifts; allowed: one, so name it with"):
        table.only_column()
    with pytest.raises(ConfigError, match=r"has no column 'c'; allowed: 'lift_a_mm', 'lift_b_mm'"):
        read("angle_deg,lift_a_mm,lift_b_mm\n0,0,0.0\n10,1,2\n", "c")


def test_an_empty_cell_is_no_reading(read):
    """Of its column alone, first rows and last; how many there are is said."""
    table = read("angle_deg,lift_a_mm,lift_b_mm\n0,,0.0\n10,1,2\n20,,\n,,\n30,2,3\n")
    assert [math.degrees(angle) for angle in table.angles] == pytest.approx([0, 10, 20, 30])
    assert [math.isnan(lift) for lift in table.columns[0].lifts] == [True, False, True, False]
    assert [math.isnan(lift) for lift in table.columns[1].lifts] == [False, False, True, False]
    assert "2 empty cells in 'lift_a_mm': no reading" in table.notes
    assert "1 empty cell in 'lift_b_mm': no reading" in table.notes
    with pytest.raises(ConfigError, match=r"line 3: angle_deg is empty beside a lift"):
        read("angle_deg,lift_mm\n0,0\n,1\n10,2\n")


def test_a_column_that_is_not_asked_for_may_hold_anything(read):
    """Words, decimal commas, nothing: only the angle and the column named are read."""
    text = "angle_deg;lift_a_mm;lift_b_mm;note\n0;0.0;n/a;x\n10;1.5;3,2;\n"
    table = read(text, "lift_a_mm")
    assert [column.name for column in table.columns] == ["lift_a_mm"]
    assert table.columns[0].lifts == pytest.approx([0.0, 0.0015])
    with pytest.raises(ConfigError, match=r"lift_b_mm is 'n/a'; allowed: a number"):
        read(text, "lift_b_mm")


def test_a_heading_is_one_printable_line(read):
    """What ends a line or rings a bell in a heading does neither in a cam's file."""
    assert read("angle_deg;lift\x07 of\x1f A mm\n0;0\n").columns[0].name == "lift of A mm"


def test_resolution_is_the_last_digit_written(read):
    """0.25 and 1.5 mm are written to 0.01 mm."""
    assert read("angle_deg,lift_mm\n0,0\n10,0.25\n20,1.5\n").columns[0].resolution == (
        pytest.approx(1e-5)
    )


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "lifts.csv: is empty; allowed: a heading and up to"),
        ("# nothing\n", "lifts.csv: is empty"),
        ("hello\nworld\n", "line 2: 'world' has no two numbers; allowed: lines of cam angle and"),
        (
            "angle,lift\n0,0\n5,x\n",
            "line 3: lift is 'x'; allowed: a number, so correct the line or put # before it "
            "(separator seen: comma)",
        ),
        ("angle;lift\n0;0\n5;nan\n", "line 3: lift is 'nan'; allowed: a number"),
        ("angle;lift\n0;0\n5;1.234,5\n", "line 3: lift is '1.234,5'; allowed: a number"),
        ("angle;lift\n0;0\n5\n", "line 3: has 1 cells under 2 columns (separator seen: semicolon)"),
        ("winkel,hub\n0,0,0,0\n10,0,0,25\n", "line 2: has 4 cells under 2 columns (separator seen"),
        (
            "winkel,hub\n0,0,0,0\n10,0,0,25\n",
            "; or tab between them where the comma is the decimal",
        ),
        ("angle;lift\n0;0,5\n5;1.5\n", "line 3: '1.5' has a decimal point, '0,5' in line 2 a"),
        ("angle_rad,angle_deg\n1,2\n", "2 of them are angles; allowed: one, such as angle_deg"),
        ("lift_mm,force_N\n1,2\n", "columns are 'lift_mm, force_N', allowed: one of an angle"),
        ("angle|lift\n1|2\n", "line 2: '1|2' has no two numbers"),
    ],
)
def test_what_cannot_be_read_is_said_in_one_line(read, text, words):
    """File, line, value, what is allowed, and which separator was seen."""
    with pytest.raises(ConfigError) as caught:
        read(text)
    message = str(caught.value)
    assert words in message
    assert message.startswith("lifts.csv: ")
    assert "\n" not in message
    assert len(message) < 300


def test_files_that_are_none(read, tmp_path):
    """Missing, a folder, too long: named, with those that are there."""
    (tmp_path / "lift.csv").write_text("")
    with pytest.raises(ConfigError, match=r"no such file; there are: lift\.csv"):
        read_gauge_table(tmp_path / "lifts.csv")
    with pytest.raises(ConfigError, match="cannot be read"):
        read_gauge_table(tmp_path)
    with pytest.raises(ConfigError, match="allowed: 2 MiB"):
        read(b"0 0\n" * 2**20)
    with pytest.raises(ConfigError, match=f"has {MAX_LINES + 1} lines"):
        read(b"0 0\n" * (MAX_LINES + 1))


@given(
    st.one_of(
        st.binary(max_size=400),
        st.text(alphabet="0123456789.,;\t -e\n\r°\"'#mangle_deglift\u2028\x07", max_size=300),
    )
)
def test_any_bytes_are_read_or_refused_in_one_line(tmp_path_factory, data):
    """What is no table is a ConfigError of one line, never another error."""
    path = tmp_path_factory.getbasetemp() / "any.csv"
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    try:
        table = read_gauge_table(path)
    except ConfigError as error:
        assert len(str(error).splitlines()) == 1
    else:
        assert len(table.angles) == len(table.lines) == len(table.columns[0].lifts)
