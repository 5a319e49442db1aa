"""CSV files of measured points: what is read, and what each kind of wrong file is told."""

import math

import pytest

from cam_rig.errors import ConfigError
from cam_rig.schema import load_cam
from cam_rig.schema.segment_base import read_points

ROWS = [f"{a},{5.0 - 5.0 * math.cos(math.radians(a)):.4f}" for a in range(0, 360, 15)]


@pytest.fixture
def load(config_dir, tmp_path):
    """The shipped table cam with another CSV beside it; its error, or the cam."""

    def write(text, tolerance="0.003"):
        cam = (config_dir / "cams" / "measured.yaml").read_text(encoding="utf-8")
        path = tmp_path / "measured.yaml"
        path.write_text(cam.replace("assumed: 0.003", f"assumed: {tolerance}"), encoding="utf-8")
        if text is not None:
            data = text if isinstance(text, bytes) else text.encode()
            (tmp_path / "measured.csv").write_bytes(data)
        return load_cam(path)

    return write


def table(rows=ROWS, header="angle_deg,lift_mm"):
    return "\n".join([header, *rows]) + "\n"


def test_points_are_read_in_their_units(tmp_path):
    """Angles in rad and lifts in m, columns in any order, comments and other columns aside."""
    path = tmp_path / "points.csv"
    path.write_text("# gauge 3\n\n lift_in , note, angle_turn\n1,top,0.5\n0.5,,0.75\n")
    angles, lifts = read_points(path)
    assert angles == pytest.approx([math.pi, 1.5 * math.pi])
    assert lifts == pytest.approx([0.0254, 0.0127])


def test_a_table_that_closes_is_taken(load):
    """With or without a last point at 360° that repeats the first."""
    assert len(load(table()).segments[0].file.angles) == 24
    assert len(load(table([*ROWS, "360,0.0"])).segments[0].file.angles) == 25


def test_a_windows_file_is_read(load):
    """A byte order mark and CRLF are no obstacle."""
    load(("\ufeff" + table()).replace("\n", "\r\n"))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, "measured.csv: no such file beside the cam's file"),
        ("", "measured.csv: is empty; allowed: a header line, then points"),
        ("# only a comment\n", "measured.csv: is empty"),
        (b"\xff\xfe\x00", "measured.csv: cannot be read"),
        (
            table(header="angle,lift"),
            "columns are angle, lift; allowed: one of angle_rad, angle_deg",
        ),
        (
            table(header="angle_deg,lift_kg"),
            "allowed: one of lift_m, lift_cm, lift_mm, lift_um, lift_in",
        ),
        (table(header="angle_deg,angle_rad"), "allowed: one of angle_rad"),
        (table(ROWS[:8]), "has 8 points; allowed: 12 to 7200"),
        (table(["0,nan", *ROWS[1:]]), "line 2: lift_mm is 'nan'; allowed: a finite number"),
        (table(["0,inf", *ROWS[1:]]), "line 2: lift_mm is 'inf'"),
        (table(["0," + "1" * 140_000, *ROWS[1:]]), "line 2: cannot be read (field larger than"),
        (table(["0," + "a" * 100_000, *ROWS[1:]]), "aaa...; allowed: a finite number"),
        (table(header="a" * 100_000), "aaa...; allowed: one of angle_rad"),
        (table() + "\n" * 2**21, "has 2 MiB; allowed: 2 MiB"),
        (table(["0,up", *ROWS[1:]]), "line 2: lift_mm is 'up'"),
        (table(["0", *ROWS[1:]]), "line 2: lift_mm is ''"),
        (table([*ROWS[:5], ROWS[4], *ROWS[5:]]), "point 6 is at 60° after 60°; allowed: rising"),
        (table([ROWS[1], ROWS[0], *ROWS[2:]]), "point 2 is at 0° after 15°; allowed: rising"),
        (table([*ROWS, "375,0"]), "angles are 0° to 375°; allowed: 0° to 360°"),
        (table(["-15,0", *ROWS]), "angles are -15° to 345°"),
        (table(ROWS[:14]), "has no point for 165° after 195°; allowed: gaps of at most 45°"),
        (table([*ROWS[:8], *ROWS[12:]]), "has no point for 75° after 105°"),
        (table([*ROWS, "360,0.5"]), "does not close, the lift at 360° is 0.0005 m above"),
        (table([f"{15 * i},3" for i in range(24)]), "all lifts are 0.003 m; allowed: a lift"),
    ],
)
def test_wrong_points_are_refused(load, tmp_path, text, words):
    """One line that names the cam's file, the points' file, the value and what is allowed."""
    with pytest.raises(ConfigError) as caught:
        load(text)
    message = str(caught.value)
    assert message.startswith(f"{tmp_path / 'measured.yaml'}: segments[0]")
    assert words in message
    assert "\n" not in message
    assert len(message) < 500


def test_a_missing_file_names_those_that_are_there(load, tmp_path):
    """A name misspelt is easily found."""
    (tmp_path / "mesured.csv").write_text(table())
    with pytest.raises(ConfigError, match=r"there are: mesured.csv"):
        load(None)


@pytest.mark.parametrize("name", ["../points.csv", "/etc/points.csv", "points.txt", "points"])
def test_points_lie_beside_the_cam(config_dir, error_of, name):
    """A name, no path: the cam and its points travel together, into a bag too."""
    text = (config_dir / "cams" / "measured.yaml").read_text(encoding="utf-8")
    message = error_of("cam", text.replace("measured.csv", name))
    assert message.startswith("segments[0].file: is ")
    assert "allowed: the name of a .csv file beside the cam's file" in message


def test_a_tolerance_that_loses_the_cam(load):
    """With the lift itself as tolerance a disc would do."""
    with pytest.raises(ConfigError, match=r"tolerance: is 0.01 m; allowed: at most 0.0005 m, 0.05"):
        load(table(), tolerance="10")


def test_a_tolerance_below_what_a_spline_reaches(load):
    """0 goes through every point: there is always a way."""
    assert load(table(), tolerance="0").segments[0].tolerance.si == 0.0


DWELL = (
    "{{start: {{assumed: {}, unit: deg}}, span: {{assumed: {}, unit: deg}}, "
    "level: {{assumed: 0, unit: mm}}}}"
)


@pytest.fixture
def with_dwells(load, tmp_path, config_dir):
    """The shipped table cam with a CSV and dwells (start and span in deg) of its own."""

    def write(dwells, rows=ROWS, tolerance="0.003"):
        text = (config_dir / "cams" / "measured.yaml").read_text(encoding="utf-8")
        listed = ", ".join(DWELL.format(*dwell) for dwell in dwells)
        path = tmp_path / "measured.yaml"
        text = text.replace("assumed: 0.003", f"assumed: {tolerance}")
        path.write_text(f"{text.rstrip()}\n    dwells: [{listed}]\n", encoding="utf-8")
        (tmp_path / "measured.csv").write_text(table(rows), encoding="utf-8")
        return load_cam(path)

    return write


def test_a_dwell_needs_no_points(with_dwells):
    """A gap of 90°, and one across the turn's end, are allowed inside of a dwell."""
    assert with_dwells([(100, 120)], [*ROWS[:8], *ROWS[13:]]).segments[0].dwells[0].span.si > 2.0
    with_dwells([(270, 150)], ROWS[4:19])
    with pytest.raises(ConfigError, match=r"has no point for 90° after 105°"):
        with_dwells([(110, 100)], [*ROWS[:8], *ROWS[13:]])


@pytest.mark.parametrize(
    ("dwells", "tolerance", "words"),
    [
        ([(100, 50)], "0", "tolerance: is 0; allowed beside dwells: greater than 0"),
        ([(100, 50), (150.5, 20)], "0.003", "dwells[0]: ends at 150°, the next begins at 150.5°"),
        ([(200, 50), (100, 20)], "0.003", "dwells[0]: ends at 250°, the next begins at 100°"),
        ([(100, 20), (300, 170)], "0.003", "dwells[1]: ends at 470°, the next begins at 460°"),
        ([(100, 360)], "0.003", "dwells[0]: ends at 460°, the next begins at 460°"),
        ([(-1, 20)], "0.003", "dwells[0].start: is -1 deg; allowed: at least 0 deg"),
    ],
)
def test_wrong_dwells_are_refused(with_dwells, dwells, tolerance, words):
    """Dwells follow one another with an event between each two, around the turn."""
    with pytest.raises(ConfigError) as caught:
        with_dwells(dwells, tolerance=tolerance)
    assert words in str(caught.value)
