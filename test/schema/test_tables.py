"""Tables of numbers: points of a cam, lifts of a gauge, jump speeds."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cam_rig.errors import ConfigError
from cam_rig.schema import load_cam
from cam_rig.schema.instrument_table import MAX_COLUMNS, MAX_LINES
from cam_rig.schema.segment_base import read_points
from cam_rig.studies.fit_cam.gauge_table import TableOptions, read_gauge_table
from cam_rig.studies.fit_rig.jumps.table import read_jump_table
from cam_rig.units import RPM

from .conftest import catch_error

ROWS = [f"{a},{5.0 - 5.0 * math.cos(math.radians(a)):.4f}" for a in range(0, 360, 15)]
DWELL = (
    "{{start: {{assumed: {}, unit: deg}}, span: {{assumed: {}, unit: deg}}, "
    "level: {{assumed: 0, unit: mm}}}}"
)


def table(rows=ROWS, header="angle_deg,lift_mm"):
    """Return the text of a table of points."""
    return "\n".join([header, *rows]) + "\n"


@pytest.fixture
def load(config_dir, tmp_path):
    """Function that returns the segment of the shipped measured cam with other points.

    The dwells are pairs of start and span in deg.
    """

    def write(text, tolerance="0.003", dwells=()):
        cam = (config_dir / "cams" / "measured.yaml").read_text(encoding="utf-8")
        cam = cam.replace("assumed: 0.003", f"assumed: {tolerance}").rstrip()
        if dwells:
            cam += f"\n    dwells: [{', '.join(DWELL.format(*dwell) for dwell in dwells)}]"
        (tmp_path / "measured.yaml").write_text(f"{cam}\n", encoding="utf-8")
        if text is not None:
            data = text if isinstance(text, bytes) else text.encode()
            (tmp_path / "measured.csv").write_bytes(data)
        return load_cam(tmp_path / "measured.yaml").segments[0]

    return write


def test_forms_of_files_of_points(load, tmp_path):
    """Files of points are read in each allowed form.

    Columns may be in any order, with comments, with or without 360°, with BOM and any line
    ends.
    """
    path = tmp_path / "points.csv"
    path.write_text("# gauge 3\n\n lift_in , note, angle_turn\n1,top,0.5\n0.5,,0.75\n")
    angles, lifts = read_points(path)
    assert angles == pytest.approx([math.pi, 1.5 * math.pi])
    assert lifts == pytest.approx([0.0254, 0.0127])
    assert len(load(table()).file.angles) == 24
    assert len(load(table([*ROWS, "360,0.0"])).file.angles) == 25
    load(("\ufeff" + table()).replace("\n", "\r\n"))
    assert load(table(), tolerance="0").tolerance.si == 0.0


def test_wrong_points_raise_an_error_of_one_line(load, tmp_path):
    """Invalid points of a cam raise one line with file, value and allowed values."""
    for text, expected in (
        (None, "measured.csv: no such file"),
        ("", "measured.csv: is empty; allowed: a heading and up to 100000 lines of points"),
        (b"\xff\xfe\x00", "measured.csv: columns are \ufffd; allowed: one of angle_rad"),
        (table(header="angle,lift"), "columns are angle, lift; allowed: one of angle_rad, angle_d"),
        (table(header="angle_deg,lift_kg"), "allowed: one of lift_m, lift_cm, lift_mm, lift_um, l"),
        (table(header="a" * 100_000), "aaa...; allowed: one of angle_rad"),
        (table(ROWS[:8]), "has 8 points; allowed: 12 to 7200"),
        (table(["0,nan", *ROWS[1:]]), "line 2: lift_mm is 'nan'; allowed: a finite number"),
        (table(["0," + "1" * 140_000, *ROWS[1:]]), "line 2: cannot be read (field larger than"),
        (table(["0," + "a" * 100_000, *ROWS[1:]]), "aaa...; allowed: a finite number"),
        (table() + "\n" * 2**21, "has 2 MiB; allowed: 2 MiB"),
        (table([*ROWS[:5], ROWS[4], *ROWS[5:]]), "point 6 is at 60° after 60°; allowed: rising"),
        (table([ROWS[1], ROWS[0], *ROWS[2:]]), "point 2 is at 0° after 15°; allowed: rising"),
        (table([*ROWS, "375,0"]), "angles are 0° to 375°; allowed: 0° to 360°"),
        (table(ROWS[:14]), "has no point for 165° after 195°; allowed: gaps of at most 45°"),
        (table([*ROWS, "360,0.5"]), "does not close, the lift at 360° is 0.0005 m above"),
        (table([f"{15 * i},3" for i in range(24)]), "all lifts are 0.003 m; allowed: a lift"),
    ):
        message = catch_error(load, text)
        assert message.startswith(f"{tmp_path / 'measured.yaml'}: segments[0]")
        assert expected in message and len(message) < 500
    (tmp_path / "measured.csv").rename(tmp_path / "mesured.csv")
    assert "there are: mesured.csv" in catch_error(load, None)
    expected = "tolerance: is 0.01 m; allowed: at most 0.0005 m, 0.05"
    assert expected in catch_error(load, table(), "10")


def test_points_are_in_the_folder_of_the_cam(load_edited):
    """The file of points must be next to the cam's file, so a path is refused.

    Both files are copied together, as to a bag.
    """
    for name in ("../points.csv", "/etc/points.csv", "points.txt", "points"):
        message = load_edited("table", "measured.csv", name)
        assert message.startswith("segments[0].file: is ")
        assert "allowed: the name of a .csv file next to the cam's file" in message


def test_dwells_of_a_measured_cam(load):
    """Stated dwells of a measured cam may contain a gap in the points.

    Dwells that overlap, or have no event between them, are refused.
    """
    gap = table([*ROWS[:8], *ROWS[13:]])
    assert load(gap, dwells=[(100, 120)]).dwells[0].span.si > 2.0
    load(table(ROWS[4:19]), dwells=[(270, 150)])
    assert "has no point for 90° after 105°" in catch_error(load, gap, "0.003", [(110, 100)])
    for dwells, tolerance, expected in (
        ([(100, 50)], "0", "tolerance: is 0; allowed with dwells: greater than 0"),
        ([(100, 50), (150.5, 20)], "0.003", "dwells[0]: ends at 150°, the next starts at 150.5°"),
        ([(200, 50), (100, 20)], "0.003", "dwells[0]: ends at 250°, the next starts at 100°"),
        ([(100, 20), (300, 170)], "0.003", "dwells[1]: ends at 470°, the next starts at 460°"),
        ([(100, 360)], "0.003", "dwells[0]: ends at 460°, the next starts at 460°"),
        ([(-1, 20)], "0.003", "dwells[0].start: is -1 deg; allowed: at least 0 deg"),
    ):
        assert expected in catch_error(load, table(), tolerance, dwells)


ANGLES, LIFTS = [0.0, 10.0, 20.0], [0.0, 0.25, 1.5]  # deg, mm


@pytest.fixture
def read(tmp_path):
    """Function that reads a text as a table of a gauge."""

    def read_text(text, column=None):
        path = tmp_path / "lifts.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_gauge_table(path, TableOptions(column))

    return read_text


def assert_has_readings(readings):
    """Check that a table contains `ANGLES` and `LIFTS`."""
    assert readings.angles == pytest.approx([math.radians(a) for a in ANGLES])
    assert readings.columns[0].lifts == pytest.approx([1e-3 * s for s in LIFTS])


def test_forms_of_one_table(read):
    """A table of a gauge is read in each of its usual forms.

    They differ in separator, decimal mark, encoding, quotes, order, titles and comments.
    """
    comma, semicolon = "angle_deg,lift_mm\n0,0\n10,0.25\n20,1.5\n", "0;0\n10;0,25\n20;1,5\n"
    for text in (
        comma,
        comma.replace("\n", "\r\n"),
        "\ufeff" + comma,
        f"angle_deg;lift_mm\n{semicolon}",
        f"angle_deg\tlift_mm\n{semicolon}".replace(";", "\t"),
        f"angle_deg lift_mm\n{semicolon}".replace(";", " "),
        f"angle_deg;lift_mm\n{semicolon}".encode("utf-16"),
        f"sep=;\nangle_deg;lift_mm\n{semicolon}",
        f"Angle;Lift\ndeg;mm\n{semicolon}",
        'angle_deg,lift_mm\n"0","0"\n"10","0,25"\n"20","1,5"\n',
        "lift_mm,note,angle_deg\n0,base,0\n0.25,,10\n1.5,rising,20\n",
        "# gauge 3\nMeasured on Monday\n\nangle_deg,lift_mm\n0,0\n# again:\n10,0.25\n20,1.5\n",
        "angle_deg,lift_mm\n0°,0\n10°,2.5e-1\n20°,+1.5\n",
    ):
        assert_has_readings(read(text))
    # the lifts have two decimals of a mm
    assert read(comma).columns[0].resolution == pytest.approx(1e-5)


def test_headings_in_several_languages(read):
    """Headings in several languages are read, in UTF-8 and in the encoding of Windows.

    The latter lacks Greek letters.
    """
    for angle, lift in (
        ("Cam angle [deg]", "Displacement [mm]"),
        ("θ / °", "s / mm"),
        ("Ángulo de leva (grados)", "Elevación (mm)"),
        ("angulo", "Alzada mm"),
        ("Nockenwinkel in Grad", "Hub in mm"),
        ("Drehwinkel (°)", "Stößelweg [mm]"),
        ("Angle de came (degrés)", "Levée (mm)"),
        ("Angolo (gradi)", "Alzata (mm)"),
        ("Ângulo (graus)", "Deslocamento mm"),
        ("cam_angle_deg", "gauge reading mm"),
        ("angle_deg", "lift\x07 of\x1f A mm"),
    ):
        for encoding in ("utf-8", "cp1252"):
            text = f"{angle};{lift}\n0;0\n10;0,25\n20;1,5\n"
            assert_has_readings(read(text.encode(encoding, "replace")))
    assert read("angle_deg;lift\x07 of\x1f A mm\n0;0\n").columns[0].name == "lift of A mm"


def test_missing_units_are_assumed_and_reported(read):
    """Missing units are assumed to be deg and mm, which notes report.

    Angles up to one turn in rad are taken as rad.
    """
    readings = read("0 0\n90 0.25\n180 1.5\n270 0\n355 0\n")
    assert "no unit of angle in 'column 1': deg assumed" in readings.notes
    assert "no unit of length in 'column 2': mm assumed" in readings.notes
    assert readings.notes[0] == "5 lines read, separator space, decimal point"
    assert read("theta,s\n0,0\n3,1\n6.2,0\n").angles[1] == 3.0
    assert not any("assumed" in note for note in read("angle_deg,lift_mm\n0,0\n1,1\n").notes)


def test_a_table_with_several_columns_of_lifts(read):
    """All columns of lifts are read, or only the requested one.

    Texts in other columns are ignored.
    """
    two = "angle_deg,lift_a_mm,lift_b_mm\n0,0,0.0\n10,1,2\n"
    readings = read(two)
    assert [column.name for column in readings.columns] == ["lift_a_mm", "lift_b_mm"]
    assert readings.columns[1].lifts == pytest.approx([0.0, 0.002])
    assert "has no column 'c'; allowed: 'lift_a_mm', 'lift_b_mm'" in catch_error(read, two, "c")
    text = "angle_deg;lift_a_mm;lift_b_mm;note\n0;0.0;n/a;x\n10;1.5;3,2;\n"
    readings = read(text, "lift_a_mm")
    assert [column.name for column in readings.columns] == ["lift_a_mm"]
    assert readings.columns[0].lifts == pytest.approx([0.0, 0.0015])
    assert "lift_b_mm is 'n/a'; allowed: a number" in catch_error(read, text, "lift_b_mm")


def test_an_empty_cell_is_a_missing_reading_of_its_column(read):
    """An empty cell is a missing reading of its column, and a note counts them.

    An empty angle next to a lift is refused.
    """
    readings = read("angle_deg,lift_a_mm,lift_b_mm\n0,,0.0\n10,1,2\n20,,\n,,\n30,2,3\n")
    assert [math.degrees(angle) for angle in readings.angles] == pytest.approx([0, 10, 20, 30])
    empty = [[math.isnan(lift) for lift in column.lifts] for column in readings.columns]
    assert empty == [[True, False, True, False], [False, False, True, False]]
    assert "2 empty cells in 'lift_a_mm': no reading" in readings.notes
    assert "1 empty cell in 'lift_b_mm': no reading" in readings.notes
    gap = "angle_deg,lift_mm\n0,0\n,1\n10,2\n"
    assert "line 3: angle_deg is empty next to a lift" in catch_error(read, gap)


def test_wrong_tables_raise_an_error_of_one_line(read):
    """A wrong table raises one line with file, line, value and allowed values.

    It also has the detected separator.
    """
    comma = "allowed: a number, so correct the line or put # before it (separator seen: comma)"
    four = "winkel,hub\n0,0,0,0\n10,0,0,25\n"
    for text, expected in (
        ("", "lifts.csv: is empty; allowed: a heading and up to"),
        ("hello\nworld\n", "line 2: 'world' has no two numbers; allowed: lines of cam angle and"),
        ("angle,lift\n0°,0 mm\n5°,1 mm\n", "line 2: '0° | 0 mm' has no two numbers; allowed: "),
        ("a,lift mm\n0°00',0\n2°30',1\n", "of numbers only: units belong in the heading"),
        ("angle,lift\n0,0\n5,x\n", f"line 3: lift is 'x'; {comma}"),
        ("angle;lift\n0;0\n5;nan\n", "line 3: lift is 'nan'; allowed: a number"),
        ("angle;lift\n0;0\n5;1.234,5\n", "line 3: lift is '1.234,5'; allowed: a number"),
        ("angle;lift\n0;0\n5\n", "line 3: has 1 cells under 2 columns (separator seen: semicolon)"),
        (four, "line 2: has 4 cells under 2 columns (separator seen"),
        (four, "; or tab between them where the comma is the decimal"),
        ("angle;lift\n0;0,5\n5;1.5\n", "line 3: '1.5' has a decimal point, '0,5' in line 2 a"),
        ("angle_rad,angle_deg\n1,2\n", "2 of them are angles; allowed: one, such as angle_deg"),
        ("lift_mm,force_N\n1,2\n", "columns are 'lift_mm, force_N', allowed: one of an angle"),
    ):
        message = catch_error(read, text)
        assert expected in message
        assert message.startswith("lifts.csv: ") and len(message) < 300


def test_numbers_of_lines_are_not_angles(read):
    """A column that may be line numbers is refused as angle if it leaves a gap.

    With a heading of an angle it is accepted.
    """
    lines = "".join(f"{i},{i % 7}.5\n" for i in range(1, 271))
    for heading in ("Nr,lift mm\n", "Index,lift mm\n", ""):
        message = catch_error(read, heading + lines)
        assert "goes from 1 to 270, which as deg would leave 91 deg without readings" in message
        assert read(f"{heading}{lines}271,0.5\n").angles[-1] == pytest.approx(math.radians(271))
    assert read(f"angle,lift mm\n{lines}").angles[0] == pytest.approx(math.radians(1))


@pytest.mark.parametrize(
    ("heading", "last", "factor"),
    [
        ("phase [0..1]", 0.99, 360.0),
        ("phase", 0.99, 360.0),
        ("phase", 359.0, 1.0),
        ("phase %", 99.17, 3.6),
    ],
)
def test_phases(read, heading, last, factor):
    """A phase without a unit is a fraction if it ends near 1, and deg above 250.

    Other ranges are refused.
    """
    text = "{},lift mm\n0,0.0\n{},1.5\n"
    assert math.degrees(read(text.format(heading, last)).angles[1]) == pytest.approx(factor * last)
    for other in (0.5, 99.17, 180.0):
        assert f"'phase' has no unit of angle and goes from 0 to {other:g}" in catch_error(
            read, text.format("phase", other)
        )


def test_only_a_neutral_heading_is_assumed_to_be_the_lift(read):
    """A column with a neutral heading is taken as the lift.

    A heading with a unit or foreign quantity that would be lost is refused.
    """
    assert read("deg,Messuhr\n0,0.5\n9,1.5\n").columns[0].lifts[1] == pytest.approx(1.5e-3)
    for heading in ("Durchmesser (in)", "Diameter mm", "Dial indicator 0.001", "Force [N]"):
        for column in (None, heading):
            message = catch_error(read, f"deg,{heading}\n0,0.5\n9,1.5\n", column)
            assert f"the heading '{heading}' is unclear, because" in message


@pytest.mark.parametrize("mark", [",", "."])
def test_separators_of_thousands_are_refused(read, mark):
    """A cell that could have a separator of thousands is refused with its line.

    Columns in which each number has decimals are read.
    """
    cells = ["0", "84", "486", "1,084", "1,486"]
    text = "Angle;Hub um\n" + "".join(f"{10 * i};{cell}\n" for i, cell in enumerate(cells))
    message = catch_error(read, text.replace(",", mark))
    assert f"line 5: '1{mark}084' next to '84' in the same column could be a number" in message
    assert "allowed: numbers without a separator of thousands, or all with decimals" in message
    for other in ("1,08", "0,084", "1,0845"):  # a decimal mark in any other cell
        assert read(text.replace("1,486", other).replace(",", mark)).columns[0].lifts[3] > 0.0
    assert read("deg,um\n0,1.084\n5,2.486\n10,3\n").columns[0].lifts[0] > 0.0


def test_files_that_cannot_be_read(read, tmp_path):
    """A file that is missing, too long or too wide is refused with the limit.

    The error of a missing file lists the existing files.
    """
    (tmp_path / "lift.csv").write_text("")
    message = catch_error(read_gauge_table, tmp_path / "lifts.csv")
    assert message.endswith("no such file; there are: lift.csv")
    assert "cannot be read" in catch_error(read_gauge_table, tmp_path)
    assert "allowed: 2 MiB" in catch_error(read, b"0 0\n" * 2**20)
    assert f"has {MAX_LINES + 1} lines" in catch_error(read, b"0 0\n" * (MAX_LINES + 1))
    wide = b",".join([b"0"] * (MAX_COLUMNS + 1)) + b"\n"
    assert f"line 1: has {MAX_COLUMNS + 1} columns" in catch_error(read, wide)


SIGNS = "0123456789.,;\t -e\n\r°\"'#mangle_deglift\u2028\x07"


@given(st.one_of(st.binary(max_size=400), st.text(alphabet=SIGNS, max_size=300)))
def test_any_bytes_are_read_or_raise_an_error_of_one_line(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "any.csv"
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    try:
        readings = read_gauge_table(path)
    except ConfigError as error:
        assert len(str(error).splitlines()) == 1
    else:
        assert len(readings.angles) == len(readings.lines) == len(readings.columns[0].lifts)


@pytest.fixture
def read_jumps(tmp_path):
    """Function that reads a text as a table of jump speeds."""

    def read_text(text):
        path = tmp_path / "jumps.csv"
        path.write_text(text, encoding="utf-8")
        return read_jump_table(path)

    return read_text


def test_jump_speeds_in_units_and_languages(read_jumps):
    """Tables of jump speeds in several units and languages give the same readings.

    A missing unit is assumed and reported.
    """
    for text in (
        "mass_kg,spring_N/m,rpm\n0.5,4030,412.5\n1,4030,380\n",
        "Masse [g];Federrate [N/mm];Drehzahl [1/min]\n500;4,03;412,5\n1000;4,03;380\n",
        "masa (kg)\tmuelle (kN/m)\tvelocidad (rpm)\n0.5\t4.03\t412.5\n1\t4.03\t380\n",
    ):
        jumps = read_jumps(text)
        assert jumps.columns == ("mass", "spring_stiffness")
        assert [r.speed / RPM for r in jumps.readings] == pytest.approx([412.5, 380.0])
        assert jumps.readings[0].setup == pytest.approx({"mass": 0.5, "spring_stiffness": 4030.0})
    jumps = read_jumps("preload,jump speed\n20,300\n")
    assert jumps.readings[0].setup == {"preload": 20.0}
    assert sum("assumed" in note for note in jumps.notes) == 2
    jumps = read_jumps("mass_kg,rpm\n0,300\n1,250\n")
    assert np.isfinite([r.speed for r in jumps.readings]).all()


def test_wrong_jump_speeds_raise_an_error_of_one_line(read_jumps):
    """A wrong table of jump speeds raises one line with the reason.

    The error of an unknown unit lists the known units.
    """
    for text, expected in (
        ("mass_kg,lift_mm\n1,2\n", "jump speed"),
        ("1,2\n3,4\n", "must have a heading"),
        ("mass_kg,rpm\n1,-5\n", "line 2: the speed must be above 0"),
        ("mass_kg,rpm\n2,300\n1,x\n", "line 3: rpm is 'x'"),
        ("rpm,drehzahl\n300,300\n", "are both the speed; remove one"),
    ):
        message = catch_error(read_jumps, text)
        assert expected in message and "separator seen" in message
    for name in ("spring_N/furlong", "mass_oz", "mass [stone]", "speed_deg/s"):
        message = catch_error(read_jumps, f"{name},preload_N\n1,20\n")
        assert "is unclear, because" in message and "allowed" in message


@pytest.mark.parametrize(("first", "is_noted"), [(332, True), (0, False)])
def test_degrees_above_one_turn_may_be_of_the_crank(tmp_path, first, is_noted):
    """Degrees above one turn are taken as of the cam, with a note on crank degrees."""
    path = tmp_path / "event.csv"
    rows = [f"{first + 4 * i},{max(0, 8 - abs(i - 34) / 4)}" for i in range(70)]
    path.write_text("\n".join(["deg,Lift mm", *rows]))
    notes = read_gauge_table(path, TableOptions()).notes
    assert any("--angle crank halves it" in note for note in notes) == is_noted


def test_minutes_of_arc_in_their_own_column_are_refused(read):
    """A column of minutes of arc next to one of degrees is refused."""
    message = catch_error(read, "deg,min,Lift mm\n0,0,0.0\n2,30,1.5\n")
    assert "'min' next to 'deg' looks like minutes of arc" in message


def test_a_second_heading_with_another_unit_is_refused(read):
    """A second heading in a table is skipped if it is identical, else refused."""
    text = "deg,Lift mm\n0,0.0\n9,1.5\ndeg,Lift {}\n18,2.5\n"
    assert len(read(text.format("mm")).angles) == 3
    assert "line 4: a second heading with another unit" in catch_error(read, text.format("in"))


@pytest.mark.parametrize("line", ["Base circle dia 50 mm", "# Base radius: 25", "base Ø50"])
def test_stated_dimensions(read, line):
    """Radii in the titles of a table are read. A diameter is halved.

    A number without a unit is in the unit of the lifts.
    """
    table = read(f"{line}\n# roller diameter = 16 mm\ndeg,Lift mm\n0,0.0\n9,1.5\n")
    assert table.stated["base radius"][0] == pytest.approx(0.025)
    assert table.stated["roller radius"][0] == pytest.approx(0.008)
