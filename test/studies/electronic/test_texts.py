"""Texts of controllers: round trips, exported tables, and errors with file and line."""

import math
import re
from itertools import pairwise
from typing import get_args

import numpy as np
import pytest

import cam_rig
from cam_rig.errors import CamRigError, ConfigError
from cam_rig.studies.electronic import names
from cam_rig.studies.electronic.building import Target, controller_cam
from cam_rig.studies.electronic.controller import Boundary, ControllerCam, ControllerSegment
from cam_rig.studies.electronic.controller import SegmentKind as Kind
from cam_rig.studies.electronic.csv_text import read_segments, read_table, write_table
from cam_rig.studies.electronic.difference import difference_bounds
from cam_rig.studies.electronic.structured_text import identifier, literal, read_text, write_text
from cam_rig.studies.electronic.study import write_controller
from cam_rig.studies.electronic.tables import Interpolation, Rounding, sample_table, table_law

from ...conftest import dwell, rise
from .exact import points_of, segments_of
from .test_errors import CAMS


def written_again(text, target):
    """Return the text that is written from the cam that was read from a text."""
    read = read_segments if target is Target.VDI2143 else read_text
    arguments = () if target is Target.VDI2143 else (target,)
    return write_controller(read("a", text, *arguments), target)


@pytest.mark.parametrize("name", CAMS)
def test_a_text_that_is_read_is_written_again_unchanged(name):
    """Written, read and written again, each text of a shipped cam has the same bytes."""
    for target in Target:
        if name == "worked_example_constant_velocity" and not target.has_lines:
            continue
        text = cam_rig.electronic(name, target.value).text
        assert written_again(text, target) == text
    for rounding in ("lreal", "real", "dint"):
        table = cam_rig.electronic(name, "table", points=64, rounding=rounding).text
        assert write_table(read_table("a", table)) == table


@pytest.mark.parametrize("target", ["codesys", "twincat", "twincat_mc3"])
def test_texts_follow_the_grammar(target):
    """An independent parser reads each array, with the declared number of points."""
    for name in ("tm21", "poly4567", "designed"):
        text = cam_rig.electronic(name, target).text
        points, rows, _ = points_of(text, target)
        declared = re.search(r"ARRAY\[(\d)\.\.(\d+)\]", text)
        assert len(rows) == int(declared[2]) - int(declared[1]) + 1
        assert points[0][0] == 0 and points[-1][0] == 360
        assert points[0][1:] == points[-1][1:]


def test_a_builder_text_follows_the_grammar():
    """An independent parser reads the calls of CamBuilder, whose segments join."""
    segments = segments_of(cam_rig.electronic("arcs_convex", "codesys_builder").text)
    for (_, _, before), (_, after, _) in pairwise(segments):
        assert before[:3] == after[:3]
    assert any(a[2][3] != b[1][3] for a, b in pairwise(segments))


def test_identifiers_and_literals():
    """Names become identifiers of the language, and numbers real literals."""
    names = ["Leva Ñandú 2", "3 4 5", "a__b", "凸輪", "x-y", "Real"]
    assert [identifier(name) for name in names] == [
        "Leva_Nandu_2",
        "cam_3_4_5",
        "a_b",
        "cam",
        "x_y",
        "cam_Real",
    ]
    assert [literal(x) for x in (0.0, -0.0, 5.0, 1e-9, -2.5e20)] == [
        *("0.0", "0.0", "5.0", "1.0E-09", "-2.5E+20"),
    ]
    cam = cam_rig.load_cam("poly345").replace(title="Leva *) Ñ (* 1\n2")
    text = cam_rig.electronic(cam, "twincat").text
    points_of(text, "twincat")
    assert written_again(text, Target.TWINCAT) == text


def test_a_short_dwell_and_a_period_with_a_rounded_end(make_cam):
    """A dwell of 0.1° is one segment, and the ends of the period have equal numbers."""
    cam = make_cam(rise(179.9, 1), dwell(0.1), rise(179.9, 0), dwell(0.1))
    law = cam_rig.build_law(cam)
    ordinates = law.ordinates.copy()
    ordinates[-1, -1] = np.nextafter(ordinates[0, 0], 1.0)
    for other in (law, cam_rig.Law("ulp", law.breaks, ordinates)):
        made = controller_cam(cam, other, Target.CODESYS)
        ends = made.segments[0].left, made.segments[-1].right
        assert ends[0][1:] == ends[1][1:]
        spans = [s.right.x - s.left.x for s in made.segments]
        assert spans[-1] == pytest.approx(0.1)
        assert difference_bounds(other, made.law).lift < 2e-8


def test_corners_of_constant_velocity():
    """A line with corners is refused for smooth targets, and passes with a warning otherwise."""
    name = "worked_example_constant_velocity"
    for target in ("codesys", "vdi2143"):
        with pytest.raises(ConfigError, match="velocity jumps at 0°, 90°, 180°, 270°, which"):
            cam_rig.electronic(name, target)
    result = cam_rig.electronic(name, "twincat")
    assert result.text.count("MOTIONFUNCTYPE_POLYNOM1") == 5
    assert result.summary()[0].startswith("warning: the velocity jumps at 0°")
    assert result.rows[1].bounds.lift < 1e-15


@pytest.mark.parametrize(
    "form",
    [
        "cam = c\npoints = 9\nmaster_deg;slave_mm\n{rows};",
        "# export\n// of a controller\n9\nX Y\n{rows} ",
        "Increments/mm = x\n{rows},",
        "{commas};",
        "MasterPeriod: 1\nincrements_per_mm = 1000\n{phase}\t",
        "{increments};",
        "{shifted};",
        "{radians};",
    ],
)
def test_tables_as_controllers_export_them(form):
    """Keys, comments, a count, separators, units and shifts give the same motion."""
    separator, form = form[-1], form[:-1]
    x, y = np.arange(9) * 45.0, np.round(10.0 - 10.0 * np.cos(np.radians(np.arange(9) * 45.0)), 6)
    y[-1] = y[0]
    form = form.replace("Increments/mm = x\n", "")

    def rows(master, slave, comma=False):
        text = "\n".join(f"{a!r}{separator}{b!r}" for a, b in zip(master, slave, strict=True))
        return text.replace(".", ",") if comma else text

    order = [*range(2, 9), 1, 2]
    texts = {
        "rows": rows(x.tolist(), y.tolist()),
        "commas": rows(x.tolist(), y.tolist(), comma=True),
        "phase": rows((x / 360.0).tolist(), (y * 1000.0).tolist()),
        "increments": rows((x * 1000.0).tolist(), y.tolist()),
        "shifted": rows((x + 90.0).tolist(), y[order].tolist()),
        "radians": rows(np.radians(x).tolist(), y.tolist()),
    }
    table = read_table("a.csv", form.format(**texts))
    angles = np.linspace(0.0, 6.2, 50)
    for kind in Interpolation:
        exact = table_law(read_table("b.csv", rows(x.tolist(), y.tolist())), kind)
        assert np.allclose(table_law(table, kind)(angles), exact(angles), atol=1e-12)


def test_an_index_table_is_followed_by_its_mirror_image():
    """A slave that does not return moves back in the second half of the turn."""
    x = np.linspace(0.0, 360.0, 37)
    y = 60.0 * (x / 360.0 - np.sin(np.radians(x)) / (2.0 * np.pi))
    text = "\n".join(f"{a};{b}" for a, b in zip(x, y, strict=True))
    table = read_table("index.csv", text)
    law = table_law(table, Interpolation.SPLINE)
    assert float(law(np.pi)) == pytest.approx(0.06) and float(law(0.0)) == 0.0
    assert float(law(np.pi / 2.0)) == pytest.approx(0.03, abs=1e-5)
    assert "half the master's speed" in table.notes[-1]


def test_rounding_of_tables():
    """REAL over 360 000 increments and DINT are read as they are rounded."""
    law = cam_rig.build_law("poly345")
    for rounding, step in ((Rounding.REAL, 2e-6), (Rounding.DINT, 0.5e-3)):
        table = sample_table(law, 256, rounding)
        exact = sample_table(law, 256)
        assert 0.0 < np.abs(table.y - exact.y).max() <= step
    x = (exact.x * 1000.0).astype(np.float32)
    text = "\n".join(f"{a!r};{b!r}" for a, b in zip(x.tolist(), exact.y.tolist(), strict=True))
    for kind in Interpolation:
        made = table_law(read_table("r.csv", text), kind)
        assert np.abs(made(exact.x[:-1] * np.pi / 180.0) * 1e3 - exact.y[:-1]).max() < 1e-4
    with pytest.raises(ConfigError, match="increments must be above 0 and fit in a DINT"):
        cam_rig.electronic("poly345", "table", points=64, rounding="dint", increments=1e12)


GOOD = """(* made for a test *)
VAR_GLOBAL
    cam_points : ARRAY[0..2] OF SMC_CAMXYVA := [
        (dX := 0, dY := 0.0, dV := 0.0, dA := 0.0),
        (dA := 0.0, DV := 0.0, dY := LREAL#1_0.0, dX := 180.0), // top
        (dX := 360.0, dY := 0.0)
    ];
END_VAR
"""
#: Change of the good text, and the error with its line.
BAD_TEXTS = [
    (("dY := 0.0, dV := 0.0, dA := 0.0),\n        (dA", "dY := 0,0, dV := 0.0),\n        (dA"), 4),
    (("dX := 180.0", "dX := 380.0"), 6),
    (("        (dX := 360.0, dY := 0.0)\n", ""), 3),
    (("(dX := 360.0, dY := 0.0)", "(dX := 354.375, dY := 0.0)"), 8),
    (("dX := 360.0, dY := 0.0", "dX := 360.0, dY := NaN"), 6),
    (("dX := 360.0, dY := 0.0", "dX := 360.0, dY := 1.0"), 8),
    (("dX := 360.0, dY := 0.0", "dX := 360.0"), 6),
    (("(dX := 360.0, dY := 0.0)", "dX := 360.0"), 6),
    (("SMC_CAMXYVA", "MC_MotionFunctionPoint"), 1),
    (("SMC_CAMXYVA", "SMC_OTHER"), 1),
    ((" := [", ";"), 3),
    (("dX := 360.0, ", "dX := 360.0, PointType := MOTIONPOINTTYPE_IGNORE, "), 6),
    (("dX := 360.0, dY := 0.0", "dX := 360.0, dYY := 0.0"), 6),
    (("dX := 360.0, dY := 0.0", "dX := 360.0, dY := 0.0, dY := 0.0"), 6),
]


def test_a_text_of_another_hand_is_read():
    """Other spaces, cases, comments, orders and literals are read."""
    cam = read_text("good.st", GOOD, Target.CODESYS)
    assert cam.name == "cam" and cam.notes == ("made for a test",)
    assert cam.law.lift == pytest.approx(0.01)


@pytest.mark.parametrize(("change", "line"), BAD_TEXTS)
def test_bad_texts_are_refused_with_file_and_line(change, line, tmp_path):
    """A bad text is one error line with the name of the file and the line."""
    text = GOOD.replace(*change)
    assert text != GOOD
    path = tmp_path / "bad.st"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(CamRigError, match=rf"^bad\.st: line {line}: ") as caught:
        cam_rig.read_electronic(path, "codesys")
    assert "\n" not in str(caught.value)


TABLE_ROWS = [f"{45 * k};{k % 8}" for k in range(9)]
BAD_TABLES = [
    ({5: "225;x"}, 6),
    ({5: "225;nan"}, 6),
    ({5: "90;5"}, 6),
    ({8: "354.375;0"}, 9),
    ({0: "count = 3\n0;0"}, None),
    ({0: "12\n0;0"}, 1),
    ({4: "180;1;2"}, 5),
    ({k: "" for k in range(3)}, 4),
    ({0: "period = -1\n0;0"}, 1),
]


@pytest.mark.parametrize(("changes", "line"), BAD_TABLES)
def test_bad_tables_are_refused_with_file_and_line(changes, line, tmp_path):
    """A bad table is one error line with the name of the file and the line."""
    rows = [changes.get(k, row) for k, row in enumerate(TABLE_ROWS)]
    path = tmp_path / "bad.csv"
    path.write_text("\n".join(rows), encoding="utf-8")
    if line is None:
        assert cam_rig.read_electronic(path, "table").segments == 8
        return
    with pytest.raises(CamRigError, match=rf"^bad\.csv: line {line}: "):
        cam_rig.read_electronic(path, "table")


def table_text(count, row):
    """Return a table with one row per index from 0 to `count` - 1, from `row(k)`."""
    return "\n".join(row(k) for k in range(count))


def rise_and_fall(k, count):
    """Return the lift (mm) of row k of a table with `count` rows that closes."""
    return 10.0 - 10.0 * math.cos(2.0 * math.pi * k / (count - 1))


#: Ambiguous tables, and words of the message.
AMBIGUOUS = [
    (table_text(1000, lambda k: f"{360 * k};{rise_and_fall(k, 1001):.4f}"), "closing point, or a"),
    (
        table_text(101, lambda k: f"{3.6 * k:.1f},{rise_and_fall(k, 101):.3f}".replace(".", ",")),
        "separate the columns by a semicolon",
    ),
    (
        table_text(361, lambda k: f"{k};{k}.0;{rise_and_fall(k, 361):.4f}"),
        "the first column counts the rows",
    ),
    (
        table_text(361, lambda k: f"{k};{rise_and_fall(k, 361) + k / 360.0:.4f}"),
        "the slave ends 1 from its start",
    ),
]


@pytest.mark.parametrize(("text", "words"), AMBIGUOUS)
def test_ambiguous_tables_are_refused(text, words, tmp_path):
    """A table whose columns, turn or closure are doubtful is refused instead of being guessed."""
    path = tmp_path / "table.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(CamRigError, match=words):
        cam_rig.read_electronic(path, "table")


def test_a_table_that_its_digits_leave_open_is_closed(tmp_path):
    """A last point that differs by 1 µm is moved to the first, with a note."""
    text = table_text(361, lambda k: f"{k};{rise_and_fall(k, 361) + 0.001 * (k == 360):.4f}")
    path = tmp_path / "table.csv"
    path.write_text(text, encoding="utf-8")
    result = cam_rig.read_electronic(path, "table")
    assert result.law.lift == pytest.approx(0.02, rel=1e-4)
    assert any("was moved by 0.001 to close the turn" in note for note in result.notes)


def test_other_bad_files(tmp_path):
    """A missing file, bytes, and a CSV of another form are refused in one line."""
    with pytest.raises(ConfigError, match=r"none\.st: cannot be read"):
        cam_rig.read_electronic(tmp_path / "none.st", "codesys")
    path = tmp_path / "a.csv"
    path.write_bytes(b"0;0\n\xff\xfe")
    with pytest.raises(ConfigError, match="line 2: not UTF-8"):
        cam_rig.read_electronic(path, "table")
    path.write_text("\n".join(TABLE_ROWS), encoding="utf-8")
    with pytest.raises(ConfigError, match="line 1: no heading master_start_deg"):
        cam_rig.read_electronic(path, "vdi2143")
    path.write_text("\n".join(f"{45 * k};1" for k in range(9)), encoding="utf-8")
    with pytest.raises(ConfigError, match="the slave does not move"):
        cam_rig.read_electronic(path, "table")


def test_segments_of_the_builder_with_implicit_boundaries():
    """BoundImplicit is the right boundary before it, as in the vendor's example."""
    text = (
        "PROGRAM p\ncamBuilder : SMCB.CamBuilder;\n"
        "b.Append(\n SMCB.Poly5(SMCB.BoundImplicit(), SMCB.Bound(120, 120, 1)));\n"
        "b.Append(SMCB.Line(SMCB.BoundImplicit(), SMCB.Bound(240.0, 0.0)));\n"
        "b.Append(SMCB.Poly5(SMCB.BoundImplicit(), SMCB.Bound(360, 0)));\n"
    )
    cam = read_text("b.st", text, Target.CODESYS_BUILDER)
    assert [s.kind for s in cam.segments] == [Kind.POLY5, Kind.LINE, Kind.POLY5]
    assert cam.segments[1].left == Boundary(120.0, 120.0, 1.0)
    assert cam.law.lift == pytest.approx(0.12, rel=0.2)
    for old, new in (("Line", "Spline7"), ("240.0, 0.0", "100.0, 0.0"), ("240.0,", "2;4,")):
        with pytest.raises(ConfigError, match=r"b\.st: line 5: "):
            read_text("b.st", text.replace(old, new), Target.CODESYS_BUILDER)


def test_a_text_that_starts_at_another_master_position():
    """Segments whose master does not start at 0 are moved to the turn from 0."""
    points = [Boundary(90.0, 1.0), Boundary(200.0, 5.0), Boundary(450.0, 1.0)]
    pairs = pairwise(points)
    segments = [ControllerSegment(Kind.POLY5, *pair) for pair in pairs]
    cam = ControllerCam("shifted", tuple(segments))
    law = read_text("s.st", write_text(cam, Target.CODESYS), Target.CODESYS).law
    assert law(np.radians([90.0, 200.0])).tolist() == pytest.approx([0.001, 0.005])


def test_function_types_of_twincat_by_value():
    """A FunctionType is read by name, by value, and as the polynomial between points at rest."""
    text = cam_rig.electronic("poly4567", "twincat").text
    for changes in (
        {"MOTIONFUNCTYPE_POLYNOM5_MM": "15", "MOTIONFUNCTYPE_POLYNOM7_MM": "24"},
        {"POLYNOM5_MM": "POLYNOM5", "POLYNOM7_MM": "POLYNOM7"},
    ):
        changed = text
        for old, new in changes.items():
            changed = changed.replace(old, new)
        assert written_again(changed, Target.TWINCAT) == text != changed


#: Texts that replace or enter parts of a damaged text.
DAMAGE = ["(", "]", ":=", ",", ";", "1e999", "-1", "NaN", "1e308", "\n", "(*", "é", "\0", "", "360"]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("target", [*(target.value for target in Target), "table"])
@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(s, marks=pytest.mark.long) for s in range(1, 9))]
)
def test_damaged_texts_raise_only_errors_of_cam_rig(target, seed, tmp_path):
    """A text with random damage is read, or refused in one line, without a warning."""
    rng, path = np.random.default_rng(seed), tmp_path / "damaged.txt"
    points = 16 if target == "table" else None
    text = cam_rig.electronic("tm21", target, points=points).text
    for _ in range(40):
        damaged = text
        for _ in range(int(rng.integers(1, 4))):
            start = int(rng.integers(len(damaged)))
            stop = start + int(rng.integers(12))
            damaged = damaged[:start] + DAMAGE[rng.integers(len(DAMAGE))] + damaged[stop:]
        path.write_text(damaged, encoding="utf-8")
        try:
            cam_rig.read_electronic(path, target)
        except CamRigError as error:
            assert "\n" not in str(error)


def test_names_of_the_options_are_those_of_the_forms():
    """The names that the function accepts are those of targets, interpolations and roundings."""
    for options, kinds in (
        (names.TargetName, [*Target, "table"]),
        (names.InterpolationName, Interpolation),
        (names.RoundingName, Rounding),
    ):
        assert list(get_args(options)) == [getattr(kind, "value", kind) for kind in kinds]
