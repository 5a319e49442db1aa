"""Files that are wrong in one place: one line that names key, value and what is allowed."""

import re

import pytest
from ruamel.yaml import YAML

from cam_rig.errors import ConfigError
from cam_rig.paper.factorial.study import load_factorial
from cam_rig.schema import load_cam, load_rig
from cam_rig.schema.load import config_root


def test_not_a_mapping(error_of):
    for text, words in [
        (
            "",
            "holds nothing; allowed: a mapping with the keys name, title, follower, shaft, ",
        ),
        ("# only a comment\n", "holds nothing"),
        ("- 1\n- 2\n", "holds a list; allowed: a mapping"),
        ("just words", "holds text; allowed: a mapping"),
        ("3", "holds a int; allowed: a mapping"),
    ]:
        assert error_of("rig", text).startswith(words)


@pytest.mark.parametrize(
    "text",
    [
        "a: [1",
        "a: 1\n b: 2\n",
        "a: 1\na: 2\n",  # a key twice: one of them would be lost
        "a: 'unfinished",
        "a: \x00",
        "--- 1\n--- 2\n",
        "a: !!python/object:os.system x",
        "\ta: 1",
    ],
)
def test_broken_yaml(error_of, text):
    message = error_of("rig", text)
    assert message.startswith("not YAML: ")
    assert "line" in message or "position" in message


def test_nested_without_end(error_of):
    assert error_of("rig", "[" * 5000).startswith("is nested too deeply")


def test_not_text(error_of):
    """A file that is not UTF-8 cannot be read, and says so."""
    assert error_of("rig", b"\xff\xfe\x00\x01").startswith("cannot be read (")


def test_a_date_is_a_text(tmp_path):
    """YAML 1.2 knows no dates, not even those that there are."""
    path = tmp_path / "rig.yaml"
    text = (config_root() / "rigs" / "tm21.yaml").read_text(encoding="utf-8")
    for title in ("2024-99-99", "2001-01-01"):
        path.write_text(text.replace("title:", f"title: {title} #"), encoding="utf-8")
        assert load_rig(path).title == title


def test_missing_file(tmp_path):
    (tmp_path / "poly345.yaml").touch()
    words = r"poly34\.yaml: no such file \(did you mean 'poly345'\?\); there are: poly345$"
    with pytest.raises(ConfigError, match=words) as e:
        load_cam(tmp_path / "poly34.yaml")
    with pytest.raises(ConfigError, match=r"tm21\.yaml: no such file; there are: poly345$"):
        load_cam(tmp_path / "tm21.yaml")
    assert e.value.exit_code == 2
    with pytest.raises(ConfigError, match=r"no such file$"):
        load_cam(tmp_path / "nowhere" / "poly345.yaml")


def test_folder_for_a_file(tmp_path):
    with pytest.raises(ConfigError, match="is a folder; allowed: a YAML file"):
        load_cam(tmp_path)


@pytest.mark.parametrize("kind", ["cam", "rig", "scene", "published"])
def test_every_key_missing(error_of, kind):
    message = error_of(kind, "{}")
    assert message.startswith("name: missing; it is required")
    others = message.split("(also wrong: ")[1].removesuffix(")").split(" and ")[0].split(", ")
    assert len(others) == (2 if kind == "rig" else 3) and "name" not in others


@pytest.mark.parametrize("kind", ["cam", "rig", "scene"])
def test_unknown_key(refuse, kind):
    message = refuse(kind, "title:", "titel: x\ntitle:")
    assert message.startswith("titel: unknown key, value 'x' (did you mean 'title'?); allowed: ")
    assert "\n" not in message


@pytest.mark.parametrize(
    ("kind", "key", "wrong"),
    [("rig", "title", "titel"), ("rig", "mass", "mas"), ("scene", "model", "modell")],
)
def test_misspelt_required_key(refuse, kind, key, wrong):
    message = refuse(kind, f"{key}:", f"{wrong}:")
    assert f"did you mean {key!r}?" in message


@pytest.mark.parametrize("title", ["[a, b]", "3", "", "{a: 1}"])
def test_title_must_be_text(refuse, title):
    message = refuse("rig", "title: TM21 with the paper's follower", f"title: {title}")
    assert message.startswith("title: is ")
    assert "allowed: a valid string" in message


MASS = re.compile(r"  mass: \{.*\}")


@pytest.fixture
def mass_error(config_dir, error_of):
    """The error of the rig file with another value for the follower's mass."""

    def load(value: str) -> str:
        text = (config_dir / "rigs" / "tm21.yaml").read_text(encoding="utf-8")
        wrong, count = MASS.subn(f"  mass: {value}", text, count=1)
        assert count == 1
        return error_of("rig", wrong)

    return load


def test_wrong_quantity(mass_error):
    for value, shown, allowed in [
        ("{given: -1.5, unit: kg}", "is -1.5 kg", "greater than 0 kg"),
        ("{given: 0, unit: kg}", "is 0 kg", "greater than 0 kg"),
        ("{given: .nan, unit: kg}", "is nan", "finite numbers"),
        ("{given: .inf, unit: kg}", "is inf", "finite numbers"),
        ("{given: 1e999, unit: kg}", "is inf", "finite numbers"),
        ("{given: 1, unit: lb}", "has unit 'lb', not a mass", "kg, g"),
        ("{given: 1, unit: mm}", "has unit 'mm', not a mass", "kg, g"),
        ("{given: [1, 2], unit: kg}", "is [1.0, 2.0]", "one number"),
        ("{given: [], unit: kg}", "is []", "one number"),
        ("{given: 1, assumed: 2, unit: kg}", "given and assumed", "exactly one of"),
        ("{unit: kg}", "has none", "exactly one of given, assumed, identified"),
        ("1.3", "is 1.3", ""),
        ("heavy", "is 'heavy'", ""),
        ("", "is None", ""),
        ("[1.3]", "is [1.3]", ""),
    ]:
        message = mass_error(value)
        assert message.startswith("follower.mass: ")
        assert shown in message
        assert f"allowed: {allowed}" in message


def test_not_a_number(mass_error):
    for value in ["abc", "{a: 1}", "[a]", "'1.3'", "true"]:
        message = mass_error(f"{{given: {value}, unit: kg}}")
        assert "follower.mass.given" in message
        assert "allowed: " in message


def test_key_has_no_names_of_python_types(mass_error):
    assert mass_error("{given: abc, unit: kg}").startswith("follower.mass.given: ")


def test_missing_unit(mass_error):
    assert mass_error("{given: 1.3}") == "follower.mass.unit: missing; it is required"


def test_unknown_key_of_a_quantity(mass_error):
    message = mass_error("{givn: 1.3, unit: kg}")
    assert message.startswith("follower.mass.givn: unknown key, value 1.3")
    assert "did you mean 'given'?" in message
    assert "allowed: assumed, given, identified" in message


def test_limits_of_the_rig(config_dir, error_of):
    for key, value, words in [
        (
            "stem_stiffness",
            "{given: -3.3e8, unit: N/m}",
            "is -3.3e+08 N/m; allowed: greater than 0",
        ),
        ("mass", "{given: 1e-30, unit: kg}", "is 1e-30 kg; allowed: at least 1e-09 kg"),
        ("stem_stiffness", "{given: 1e-30, unit: N/m}", "is 1e-30 N/m; allowed: at least 1e-09"),
        ("spring_stiffness", "{given: 0, unit: N/m}", "is 0 N/m; allowed: greater than 0 N/m"),
        ("damping", "{given: -1, unit: N*s/m}", "is -1 N*s/m; allowed: at least 0"),
        ("preload", "{given: -1, unit: N}", "is -1 N; allowed: at least 0"),
        ("restitution", '{given: 1, unit: "1"}', "is 1; allowed: at most 0.999"),
        ("restitution", '{given: -0.1, unit: "1"}', "is -0.1; allowed: at least 0"),
        ("gain", "{given: 0, unit: Pa*s/N}", "is 0 Pa*s/N; allowed: greater than 0"),
        ("corner", "{given: -17, unit: Hz}", "is -17 Hz; allowed: greater than 0"),
        ("background", "{given: 73, unit: Hz}", "has unit 'Hz', not a level; allowed: dB"),
        ("background_at", "{given: 0, unit: rpm}", "is 0 rpm; allowed: greater than 0"),
    ]:
        text = (config_dir / "rigs" / "tm21.yaml").read_text(encoding="utf-8")
        wrong, count = re.subn(rf"  {key}: \{{.*\}}", f"  {key}: {value}", text, count=1)
        assert count == 1
        message = error_of("rig", wrong)
        assert f".{key}: " in message
        assert words in message


RISE = "{law: poly345, to: 1,"
SPAN = "span: {identified: 117.5, unit: deg"


def test_wrong_cam(refuse):
    for old, new, key, words in [
        (
            SPAN,
            "span: {identified: 100, unit: deg",
            "segments",
            "spans sum to 342.5°; allowed: 360°",
        ),
        (SPAN, "span: {identified: 120, unit: deg", "segments", "too much by 2.5°"),
        (SPAN, "span: {identified: -117.5, unit: deg", "segments[1].span", "greater than 0 deg"),
        (SPAN, "span: {identified: 0, unit: deg", "segments[1].span", "is 0 deg; allowed: "),
        (SPAN, "span: {identified: 361, unit: deg", "segments[1].span", "at most 360 deg"),
        (SPAN, "span: {identified: .nan, unit: deg", "segments[1].span", "is nan; allowed: finite"),
        (SPAN, "span: {identified: 117.5, unit: mm", "segments[1].span", "allowed: rad, deg, turn"),
        (RISE, "{law: poly345, to: 2,", "segments[1].to", "is 2; allowed: less than or equal to 1"),
        (RISE, "{law: poly345, to: .nan,", "segments[1].to", "is nan; allowed: a finite number"),
        (RISE, "{law: poly345, to: up,", "segments[1].to", "is 'up'; allowed: a valid number"),
        (RISE, "{law: poly345,", "segments[1].to", "missing; it is required"),
        (RISE, "{law: poly345, to: 1, too: 2,", "segments[1].too", "did you mean 'to'?"),
        (RISE, "{law: poly346, to: 1,", "segments[1].law", "(did you mean 'poly345'?); allowed"),
        ("type: roller", "type: wheel", "follower.type", "is 'wheel'; allowed: 'point', 'roller'"),
        ("  type: roller", "  # type:", "follower.type", "missing; allowed: one of conjugate, "),
        ("type: roller", "type: point", "follower.roller_radius", "unknown key, value a mapping"),
        ("type: roller", "type: flat", "follower.roller_radius", "base_radius, eccentricity, "),
        ("  roller_radius:", "  # roller_radius:", "follower.roller_radius", "missing; it is requ"),
        ("  roller_radius:", "  roller_radios:", "follower.roller_radios", "mean 'roller_radius'?"),
        (
            "  roller_radius: {assumed: 10,",
            "  roller_radius: {assumed: 0,",
            "follower.roller_radius",
            "is 0 mm; allowed: greater than 0 mm",
        ),
        ("type: roller", "type: oscillating_roller", "follower.pivot_distance", "missing"),
        ("name: poly345", "name: Poly 345", "name", "is 'Poly 345'"),
        ("name: poly345", "name: guide", "name", "is 'guide', another frame of the rig"),
        ("lift: {given: 0.05", "lift: {given: -0.05", "lift", "is -0.05 m; allowed: greater than"),
    ]:
        message = refuse("cam", old, new)
        assert message.startswith(f"{key}: ")
        assert words in message


def test_unknown_law_lists_the_laws(refuse):
    message = refuse("cam", RISE, "{law: poly346, to: 1,")
    for law in ("dwell", "poly345", "poly4567", "cycloidal", "bezier", "tangent_arcs"):
        assert f"'{law}'" in message


def test_wrong_segments(config_dir, error_of):
    for segments, key in [
        ("", "segments"),
        ("segments: []", "segments"),
        ("segments: 3", "segments"),
        ("segments: [3]", "segments[0]"),
        ("segments: [{law: dwell}]", "segments[0].span"),
    ]:
        text = (config_dir / "cams" / "poly345.yaml").read_text(encoding="utf-8")
        assert error_of("cam", text.split("segments:")[0] + segments).startswith(f"{key}: ")


def test_always_says_what_is_allowed(refuse):
    for old, new in [
        (RISE, "{to: 1,"),
        ("name: poly345", "name: Poly 345"),
        ("segments:", "segments: []\nx:"),
    ]:
        assert "allowed: " in refuse("cam", old, new)


HEAD = """
name: wrong
title: wrong
lift: {assumed: 10, unit: mm}
follower: {type: point, base_radius: {assumed: 25, unit: mm}}
segments:
"""
TURN = "span: {assumed: 360, unit: deg}"


def ratio(*numbers):
    return f"{{assumed: {list(numbers)}, unit: '1'}}"


def spline(degree, knots, ordinates):
    shape = f"degree: {degree}, knots: {ratio(*knots)}, ordinates: {ratio(*ordinates)}"
    return f"- {{law: b_spline, {TURN}, {shape}}}"


def polynomial(at, order, value, unit="deg"):
    shape = f"at: {{assumed: {at}, unit: {unit}}}, order: {order}, value: {ratio(*value)}"
    return f"- {{law: polynomial, {TURN}, {shape}}}"


CASES = [
    (spline(3, [0, 0, 0, 1, 1, 1], [0, 1, 0]), "ordinates: are 3; allowed for degree 3: 4 to"),
    (spline(3, [0, 0, 0, 0, 1, 1, 1, 1], [0, 1, 1, 0]), "knots: are 8; allowed for 4 ordinates"),
    (spline(2, [0, 0, 1, 0.5, 2, 2], [0, 0, 1, 0, 0]), "knot 4 is 0.5 after 1; allowed: rising"),
    (spline(2, [0, 0.5, 1, 1], [0, 1, 0]), "knots: 0 stands 1 times; allowed: 2 times"),
    (spline(2, [0, 0, 1, 1, 1, 2, 2], [0] * 6), "1 stands 3 times; allowed: at most 2 times"),
    (spline(0, [0, 1], [0, 1]), "degree: is 0; allowed: greater than or equal to 1"),
    (spline("two", [0, 1], [0, 1]), "degree: is 'two'"),
    (polynomial([0, 360], [0, 0], [0]), "are 2, 2 and 1 numbers; allowed: one of each"),
    (polynomial([0, 361], [0, 0], [0, 0]), "at: is 361 deg; allowed: at most 360 deg"),
    (polynomial([0, 0], [0, 0], [0, 1]), "at: has 0 deg of order 0 twice; allowed: once"),
    (polynomial([0, 360], [0, 2], [0, 1]), "order: is 2; allowed: at most 1, the degree"),
    (polynomial([0, 360], [0, -1], [0, 1]), "order[1]: is -1; allowed: greater than or equal to 0"),
    (polynomial([0, 1], [0, 0], [0, 1], "mm"), "at: has unit 'mm', not an angle; allowed: rad"),
    (polynomial(list(range(22)), [0] * 22, [0] * 22), "22 conditions; allowed: 1 to 21"),
    ("- {law: trigonometric, span: {assumed: 180, unit: deg}, mean: {assumed: 0, unit: '1'}}",
     "span: is 180°; allowed: 360°, this law is a whole turn"),
    (f"- {{law: trigonometric, {TURN}, mean: {{assumed: 0, unit: '1'}}, sine: {ratio(*[0] * 51)}}}",
     "sine: are 51; allowed: at most 50"),
    (f"- {{law: arcs_by_radii, {TURN}, flank: convex, nose_radius: {{assumed: 9, unit: mm}}}}",
     "flank: convex needs flank_radius"),
    (f"- {{law: arcs_by_radii, {TURN}, flank: straight, nose_radius: {{assumed: 9, unit: mm}},"
     " flank_radius: {assumed: 9, unit: mm}}", "flank: straight has no flank_radius"),
    (f"- {{law: arcs_by_radii, {TURN}, flank: round, nose_radius: {{assumed: 9, unit: mm}}}}",
     "flank: is 'round'; allowed: 'convex', 'straight' or 'concave'"),
    (f"- {{law: arcs_by_centres, {TURN}, arcs: [{{}}]}}", "arcs: is [{}]; allowed: at least 2"),
    (f"- {{law: arcs_by_centres, {TURN}, arcs: [{{}}, {{x: {{assumed: 1, unit: mm}}}}]}}",
     "segments[0].arcs[1]: has x; allowed: radius, x and y, or radius alone, or nothing"),
    (f"- {{law: arcs_by_centres, {TURN}, arcs: [{{}}, {{radius: {{assumed: 0, unit: mm}}}}]}}",
     "arcs[1]: radius: is 0; allowed: positive (convex) or negative (concave)"),
    (f"- {{law: table, {TURN}, file: 3, tolerance: {{assumed: 0, unit: mm}}, source: x}}",
     "segments[0].file: is 3"),
]  # fmt: skip


def test_wrong_segment(error_of):
    for segment, words in CASES:
        message = error_of("cam", HEAD + segment)
        assert message.startswith("segments[0]")
        assert words in message
        assert "allowed" in message or "needs" in message or "has no" in message


@pytest.fixture
def scene_error(config_dir, error_of):
    """The error of the scene with another value for one key."""

    def load(key: str, value: str) -> str:
        text = (config_dir / "scenes" / "tm21_sweep.yaml").read_text(encoding="utf-8")
        wrong, count = re.subn(rf"(?m)^( *){key}:.*$", rf"\g<1>{key}: {value}", text, count=1)
        assert count == 1
        return error_of("scene", wrong)

    return load


def test_wrong_scene(scene_error):
    for key, value, words in [
        ("cams", "[poly345, tm21, poly345]", "names a cam twice; allowed: each once"),
        ("cams", "tm21", "cams: is 'tm21'; allowed: a valid list"),
        ("cams", "[]", "cams: is []"),
        ("cams", "[../tm21]", "cams[0]: is '../tm21'"),
        (
            "model",
            "three_mass",
            "model: is 'three_mass' (did you mean 'two_mass'?); allowed: 'kinetostatic', ",
        ),
        ("sample_rate", "{given: 99, unit: Hz}", "sample_rate: is 99 Hz; allowed: at least 100 Hz"),
        ("sample_rate", "{given: 2, unit: MHz}", "sample_rate: has unit 'MHz'"),
        ("sample_rate", "{given: 2000, unit: kHz}", "sample_rate: is 2000 kHz; allowed: at most"),
        ("sample_rate", "{given: 440.5, unit: Hz}", "sample_rate: is 440.5 Hz; allowed: a whole"),
        ("turns", "{given: 2.5, unit: turns}", "turns: is 2.5 turns; allowed: a whole number"),
        ("turns", "{given: 0, unit: turns}", "program.turns: is 0 turns; allowed: at least 1"),
        (
            "settle_turns",
            "{given: 1000, unit: turns}",
            "settle_turns: is 1000 turns; allowed: less",
        ),
        ("settle_turns", "{given: -1, unit: turns}", "is -1 turns; allowed: at least 0"),
        (
            "ticks_per_turn",
            "0",
            "program.ticks_per_turn: is 0; allowed: greater than or equal to 1",
        ),
        ("ticks_per_turn", "1.5", "program.ticks_per_turn: is 1.5; allowed: a valid integer"),
        ("points_per_turn", "0", "points_per_turn: is 0; allowed: greater than or equal to 1"),
        (
            "points_per_turn",
            "3601",
            "points_per_turn: is 3601; allowed: less than or equal",
        ),
        ("points_per_turn", "7.5", "points_per_turn: is 7.5; allowed: a valid integer"),
        ("ticks_per_turn", "many", "program.ticks_per_turn: is 'many'; allowed: a valid integer"),
    ]:
        assert words in scene_error(key, value)


def test_wrong_speeds(refuse):
    for old, new, words in [
        ("200, 210", "-200, 210", "program.speeds: is -200 rpm; allowed: at least 0.01 rpm"),
        ("200, 210", "0, 210", "program.speeds: is 0 rpm; allowed: at least 0.01 rpm"),
        ("200, 210", ".nan, 210", "allowed: finite numbers"),
        ("200, 210", ".inf, 210", "allowed: finite numbers"),
        (
            "unit: rpm",
            "unit: Hz",
            "program.speeds: has unit 'Hz', not a speed; allowed: rad/s, rpm",
        ),
    ]:
        assert words in refuse("scene", old, new)


def test_sample_rate_too_low_for_a_tick(config_dir, error_of):
    text = (config_dir / "scenes" / "tm21_sweep.yaml").read_text(encoding="utf-8")
    text = re.sub(r"sample_rate:.*", "sample_rate: {given: 8, unit: kHz}", text)
    text = re.sub(r"ticks_per_turn:.*", "ticks_per_turn: 1000", text)
    message = error_of("scene", text)
    assert message.startswith("sample_rate: 8000 Hz gives 1.2 samples a tick at the highest speed")
    assert message.endswith("allowed: at least 2, so 13334 Hz, or ticks_per_turn up to 600")


def test_ramp_too_short_for_a_sample(config_dir, error_of):
    text = (config_dir / "scenes" / "tm21_sweep.yaml").read_text(encoding="utf-8")
    ramp = '  ramp: {assumed: 0.1, unit: ms, source: "a test"}\n  ticks_per_turn:'
    message = error_of("scene", text.replace("  ticks_per_turn:", ramp))
    assert message.startswith("program.ramp: 0.0001 s has 1.2 samples at 12000 Hz; allowed: at le")


def test_wrong_published(refuse):
    for old, new, words in [
        ("range_rpm: [200, 400]", "range_rpm: [200]", "range_rpm[1]: missing"),
        ("range_rpm: [200, 400]", "range_rpm: [200, .inf]", "range_rpm[1]: is inf; allowed: a fin"),
        ("0.41488", ".nan", "regression_db.tm21[0]: is nan; allowed: a finite number"),
        ("0.41488", "low", "regression_db.tm21[0]: is 'low'; allowed: a valid number"),
    ]:
        assert words in refuse("published", old, new)


def test_crossover_is_between_published_cams(refuse):
    assert "bezier" in refuse("published", "between: [bezier15,", "between: [bezier,")


SHIPPED = config_root() / "factorials" / "continuity.yaml"


@pytest.fixture
def changed(tmp_path):
    """Write the shipped study with changes."""

    def write(**changes):
        data = YAML(typ="safe").load(SHIPPED.read_text(encoding="utf-8")) | changes
        path = tmp_path / "continuity.yaml"
        with path.open("w", encoding="utf-8") as file:
            YAML(typ="safe").dump(data, file)
        return path

    return write


def test_shipped():
    config = load_factorial(SHIPPED)
    assert config.name == SHIPPED.stem
    data = YAML(typ="safe").load(SHIPPED.read_text(encoding="utf-8"))
    numbers = [value for value in data.values() if isinstance(value, dict)]
    assert len(numbers) == 9
    assert all({"given", "assumed"} & set(number) for number in numbers)


def test_refused(changed):
    for changes, words in [
        ({"events": {"assumed": [90], "unit": "deg"}}, r"events: are \[90\.0\]; allowed: at least"),
        ({"gentle": {"assumed": [90, 90], "unit": "deg"}}, "gentle: are .* each once"),
        ({"events": {"assumed": [90, 190], "unit": "deg"}}, "events: is 190 deg; allowed: at most"),
        ({"rises": ["poly345", "poly345"]}, "names a law twice"),
        ({"rises": ["poly345", "dwell"]}, r"rises\[1\]: is 'dwell'"),
        ({"squeezed": {"assumed": [400], "unit": "deg"}}, "allowed: at most 360 deg"),
        ({"speeds": 1}, "unknown key"),
    ]:
        with pytest.raises(ConfigError, match=words):
            load_factorial(changed(**changes))
