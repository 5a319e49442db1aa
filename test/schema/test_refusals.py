"""Errors of config files: one line with key, value and allowed values."""

import re

import pytest

from cam_rig.schema import load_cam

from .conftest import catch_error


def assert_matches(message, expected):
    """Check that a message starts with the expected text, in which … matches any text."""
    assert re.match(".*".join(map(re.escape, expected.split("…"))), message), (expected, message)


def rows(table):
    """Return the cells of each line of a table."""
    return [line.split(" | ") for line in table.strip().splitlines()]


def test_files_that_are_not_a_mapping(load_text):
    keys = "a mapping with the keys name, title, follower, shaft, "
    for text, expected in (
        ("", f"contains nothing; allowed: {keys}"),
        ("# only a comment\n", "contains nothing"),
        ("- 1\n- 2\n", "contains a list; allowed: a mapping"),
        ("just words", "contains text; allowed: a mapping"),
        ("3", "contains a int; allowed: a mapping"),
        ("[" * 5000, "not YAML: line 1: nested too deeply"),
        (b"\xff\xfe\x00\x01", "cannot be read ("),
    ):
        assert_matches(load_text("rig", text), expected)
    twice = "a: 1\na: 2\n"  # one of the values would be lost
    broken = ("a: [1", "a: 1\n b: 2\n", twice, "a: 'unfinished", "a: \x00", "\ta: 1")
    for text in (*broken, "--- 1\n--- 2\n", "a: !!python/object:os.system x"):
        message = load_text("rig", text)
        assert_matches(message, "not YAML: ")
        assert "line" in message or "position" in message


def test_missing_files(tmp_path):
    (tmp_path / "poly345.yaml").touch()
    known = r"there are: poly345$"
    for name, expected in (
        ("poly34.yaml", rf"poly34\.yaml: no such file \(did you mean 'poly345'\?\); {known}"),
        ("tm21.yaml", rf"tm21\.yaml: no such file; {known}"),
        ("nowhere/poly345.yaml", "no such file$"),
        ("", "is a folder; allowed: a YAML file"),
    ):
        assert re.search(expected, catch_error(load_cam, tmp_path / name))


def test_missing_and_unknown_keys(load_text, load_edited):
    """A missing or unknown key of a file is named in an error of one line.

    The error of an empty mapping names up to four required keys.
    """
    for kind in ("cam", "rig", "scene", "published"):
        message = load_text(kind, "{}")
        assert_matches(message, "name: missing; it is required")
        others = message.split("(also wrong: ")[1].removesuffix(")").split(" and ")[0].split(", ")
        assert len(others) == (2 if kind == "rig" else 3) and "name" not in others
    for kind in ("cam", "rig", "scene"):
        message = load_edited(kind, "title:", "titel: x\ntitle:")
        assert_matches(message, "titel: unknown key, value 'x' (did you mean 'title'?); allowed: ")
    for kind, key, wrong in (
        ("rig", "title", "titel"),
        ("rig", "mass", "mas"),
        ("scene", "model", "modell"),
    ):
        assert f"did you mean {key!r}?" in load_edited(kind, f"{key}:", f"{wrong}:")


# Cases of wrong values: the key, the wrong value, the message.

RIG = """
title | [a, b] | title: is …allowed: a valid string
mass | {given: -1.5, unit: kg} | follower.mass: is -1.5 kg; allowed: greater than 0 kg
mass | {given: .nan, unit: kg} | follower.mass: is nan; allowed: finite numbers
mass | {given: 1, unit: lb} | follower.mass: has unit 'lb', not a mass; allowed: kg, g
mass | {given: [1, 2], unit: kg} | follower.mass: is [1.0, 2.0]; allowed: one number
mass | {given: 1, assumed: 2, unit: kg} | follower.mass: has given and assumed; allowed: exactly one
mass | {unit: kg} | follower.mass: has none; allowed: exactly one of given, assumed, identified
mass | 1.3 | follower.mass: is 1.3; allowed: …
mass |  | follower.mass: is None; allowed: …
mass | {given: '1.3', unit: kg} | follower.mass.given: …allowed: …
mass | {given: 1,3, unit: kg} | follower.mass: the key 3 is not a text; a number has a decimal point
mass | {given: '1,3', unit: kg} | follower.mass.given: is '1,3'; …; a number has a decimal point
mass | {given: true, unit: kg} | follower.mass.given: …allowed: …
mass | {given: 1.3} | follower.mass.unit: missing; it is required
mass | {givn: 1.3, unit: kg} | follower.mass.givn: unknown key, value 1.3 (did you mean 'given'?)
mass | {given: 1e-30, unit: kg} | follower.mass: is 1e-30 kg; allowed: at least 1e-09 kg
stem_stiffness | {given: -3.3e8, unit: N/m} | follower.stem_stiffness: is -3.3e+08 N/m; allowed: gr
damping | {given: -1, unit: N*s/m} | follower.damping: is -1 N*s/m; allowed: at least 0
preload | 15 N | follower.preload: is '15 N'; allowed: a number by its origin, with its unit, as {
restitution | {given: 1, unit: "1"} | follower.restitution: is 1; allowed: at most 0.999
restitution | {given: -0.1, unit: "1"} | follower.restitution: is -0.1; allowed: at least 0
corner_frequency | {given: -17, unit: Hz} | radiation.corner_frequency: is -17 Hz; allowed: g
background | {given: 73, unit: Hz} | radiation.background: has unit 'Hz', not a level; allowed: dB
"""
SCENE = """
cams | [poly345, tm21, poly345] | …names a cam twice; allowed: each once
cams | tm21 | cams: is 'tm21'; allowed: a valid list
cams | [] | cams: is []
cams | [../tm21] | cams[0]: is '../tm21'
model | three_mass | model: is 'three_mass' (did you mean 'two_mass'?); allowed: 'kinetostatic', …
sample_rate | {given: 99, unit: Hz} | sample_rate: is 99 Hz; allowed: at least 100 Hz
sample_rate | {given: 2000, unit: kHz} | sample_rate: is 2000 kHz; allowed: at most
sample_rate | {given: 440.5, unit: Hz} | sample_rate: is 440.5 Hz; allowed: a whole
turns | {given: 2.5, unit: turns} | …turns: is 2.5 turns; allowed: a whole number
turns | {given: 0, unit: turns} | schedule.turns: is 0 turns; allowed: at least 1
transient_turns | {given: 1000, unit: turns} | …transient_turns: is 1000 turns; allowed: less
ticks_per_turn | 0 | schedule.ticks_per_turn: is 0; allowed: greater than or equal to 1
samples_per_turn | 0 | samples_per_turn: is 0; allowed: greater than or equal to 1
samples_per_turn | 3601 | samples_per_turn: is 3601; allowed: less than or equal
given | [-200, 210] | schedule.speeds: is -200 rpm; allowed: at least 0.01 rpm
given | [.nan, 210] | schedule.speeds: …allowed: finite numbers
unit | Hz | schedule.speeds: has unit 'Hz', not a speed; allowed: rad/s, rpm
"""
PUBLISHED = """
range_rpm | [200] | range_rpm[1]: missing
tm21 | [.nan, 1, 1, 1] | regression_db.tm21[0]: is nan; allowed: a finite number
crossover | {between: [bezier, tm21], rpm: 335} | …bezier…
"""


@pytest.mark.parametrize("kind", ["rig", "scene", "published"])
def test_wrong_values(load_edited, kind):
    """A number of a wrong dimension or beyond its limits is refused with its key."""
    for key, value, expected in rows(globals()[kind.upper()]):
        line = f"{key}: " + value.replace("\\n", "\n")
        assert_matches(load_edited(kind, rf"(?m)^( *){key}:.*$", line), expected)


def test_ticks_and_ramps_need_two_samples(config_dir, load_text):
    """A scene whose ticks or ramps have less than two samples is refused.

    The error has the allowed sample rate. A tick without samples would have no level.
    """
    text = (config_dir / "scenes" / "tm21_sweep.yaml").read_text(encoding="utf-8")
    slow = re.sub(r"sample_rate:.*", "sample_rate: {given: 8, unit: kHz}", text)
    message = load_text("scene", re.sub(r"ticks_per_turn:.*", "ticks_per_turn: 1000", slow))
    assert_matches(message, "sample_rate: 8000 Hz gives 1.2 samples per tick at the highest speed")
    assert message.endswith("allowed: at least 2, so 13334 Hz, or ticks_per_turn up to 600")
    ramp = '  ramp: {assumed: 0.1, unit: ms, source: "a test"}\n  ticks_per_turn:'
    message = load_text("scene", text.replace("  ticks_per_turn:", ramp))
    assert_matches(message, "schedule.ramp: 0.0001 s has 1.2 samples at 12000 Hz; allowed: at le")


#: Cases of wrong cams: text in the shipped file, its replacement, the message.
CAM = """
117.5, | 100, | segments: spans sum to 342.5°; allowed: 360°
117.5, | 0, | segments[1].span: is 0 deg; allowed: …
117.5, | 361, | segments[1].span: …at most 360 deg
117.5, unit: deg | 117.5, unit: mm | segments[1].span: …allowed: rad, deg, turn
to: 1, | to: 2, | segments[1].to: is 2; allowed: less than or equal to 1
to: 1, | to: .nan, | segments[1].to: is nan; allowed: a finite number
to: 1, |  | segments[1].to: missing; it is required
to: 1, | to: 1, too: 2, | segments[1].too: …did you mean 'to'?
law: poly345, to: 1 | law: poly346, to: 1 | segments[1].law: is 'poly346' (did you mean 'poly345'?)
law: poly345, to: 1 | to: 1 | segments[1].law: …allowed: …
type: roller | type: wheel | follower.type: is 'wheel'; allowed: 'point', 'roller'
  type: roller |   # type: | follower.type: missing; allowed: one of conjugate, …
type: roller | type: point | follower.roller_radius: unknown key, value a mapping
  roller_radius: |   # roller_radius: | follower.roller_radius: missing; it is requ
  roller_radius: |   roller_radios: | follower.roller_radios: …mean 'roller_radius'?
assumed: 10, | assumed: 0, | follower.roller_radius: is 0 mm; allowed: greater than 0 mm
type: roller | type: oscillating_roller | follower.pivot_distance: missing
name: poly345 | name: Poly 345 | name: is 'Poly 345'; allowed: lower case letters, digits and _
name: poly345 | name: guide | name: is 'guide', another frame of the rig
lift: {given: 0.05 | lift: {given: -0.05 | lift: is -0.05 m; allowed: greater than
segments:(?s:.*) |  | segments: missing
segments:(?s:.*) | segments: [] | segments: is []; allowed: at least 1
segments:(?s:.*) | segments: [{law: dwell}] | segments[0].span: …
"""


def test_wrong_cams(load_edited):
    """A wrong value in a cam file is refused with key, value and allowed values.

    The error of an unknown law lists the existing laws.
    """
    for old, new, expected in rows(CAM):
        assert_matches(load_edited("cam", old.replace("{", r"\{"), new), expected)
    message = load_edited("cam", "poly345, to", "poly346, to")
    for law in ("dwell", "poly345", "poly4567", "cycloidal", "bezier", "tangent_arcs"):
        assert f"'{law}'" in message


# Segments that do not describe a curve. The message contains the number and the allowed values.

HEAD = """
name: wrong
title: wrong
lift: {assumed: 10, unit: mm}
follower: {type: point, base_radius: {assumed: 25, unit: mm}}
segments: [{law: LAW}]
"""


def ratio(*numbers):
    return f"{{assumed: {list(numbers)}, unit: '1'}}"


def spline(degree, knots, ordinates):
    return f"b_spline, degree: {degree}, knots: {ratio(*knots)}, ordinates: {ratio(*ordinates)}"


def polynomial(at, order, value, unit="deg"):
    at = f"{{assumed: {at}, unit: {unit}}}"
    return f"polynomial, at: {at}, order: {order}, value: {ratio(*value)}"


def radii(flank, more=""):
    return f"arcs_by_radii, flank: {flank}, nose_radius: {{assumed: 9, unit: mm}}{more}"


def arcs(*parts):
    return f"arcs_by_centres, arcs: [{', '.join(parts)}]"


SEGMENTS = (
    (spline(3, [0, 0, 0, 1, 1, 1], [0, 1, 0]), "ordinates: are 3; allowed for degree 3: 4 to"),
    (spline(3, [0, 0, 0, 0, 1, 1, 1, 1], [0, 1, 1, 0]), "knots: are 8; allowed for 4 ordinates"),
    (spline(2, [0, 0, 1, 0.5, 2, 2], [0, 0, 1, 0, 0]), "knot 4 is 0.5 after 1; allowed: rising"),
    (spline(2, [0, 0.5, 1, 1], [0, 1, 0]), "knots: 0 occurs 1 times; allowed: 2 times"),
    (spline(2, [0, 0, 1, 1, 1, 2, 2], [0] * 6), "1 occurs 3 times; allowed: at most 2 times"),
    (spline(0, [0, 1], [0, 1]), "degree: is 0; allowed: greater than or equal to 1"),
    (spline("two", [0, 1], [0, 1]), "degree: is 'two'"),
    (polynomial([0, 360], [0, 0], [0]), "are 2, 2 and 1 numbers; allowed: one of each"),
    (polynomial([0, 361], [0, 0], [0, 0]), "at: is 361 deg; allowed: at most 360 deg"),
    (polynomial([0, 0], [0, 0], [0, 1]), "at: has 0 deg of order 0 twice; allowed: once"),
    (polynomial([0, 360], [0, 2], [0, 1]), "order: is 2; allowed: at most 1, the degree"),
    (polynomial([0, 360], [0, -1], [0, 1]), "order[1]: is -1; allowed: greater than or equal to 0"),
    (polynomial([0, 1], [0, 0], [0, 1], "mm"), "at: has unit 'mm', not an angle; allowed: rad"),
    (polynomial(list(range(22)), [0] * 22, [0] * 22), "22 conditions; allowed: 1 to 21"),
    (f"trigonometric, mean: {ratio(0)[:-1]}}}", "mean: is [0.0]; allowed: one number"),
    (
        f"trigonometric, mean: {{assumed: 0, unit: '1'}}, sine: {ratio(*[0] * 51)}",
        "sine: has 51 numbers; allowed: 1 to 50",
    ),
    (radii("convex"), "flank: convex needs flank_radius"),
    (radii("straight", ", flank_radius: {assumed: 9, unit: mm}"), "straight has no flank_radius"),
    (radii("round"), "flank: is 'round'; allowed: 'convex', 'straight' or 'concave'"),
    (arcs("{}"), "arcs: is [{}]; allowed: at least 2"),
    (arcs("{}", "{x: {assumed: 1, unit: mm}}"), "arcs[1]: has x; allowed: radius, x and y, or rad"),
    (arcs("{}", "{radius: {assumed: 0, unit: mm}}"), "arcs[1]: radius: is 0; allowed: positive (c"),
    ("table, file: 3, tolerance: {assumed: 0, unit: mm}, source: x", "file: is 3"),
)


def test_wrong_segments(load_text):
    for segment, expected in SEGMENTS:
        whole = f"{segment}, span: {{assumed: 360, unit: deg}}"
        assert_matches(load_text("cam", HEAD.replace("LAW", whole)), f"segments[0]…{expected}")
    half = "trigonometric, span: {assumed: 180, unit: deg}, mean: {assumed: 0, unit: '1'}"
    message = load_text("cam", HEAD.replace("LAW", half))
    assert_matches(message, "segments[0]…span: is 180°; allowed: 360°, this law is a whole turn")
