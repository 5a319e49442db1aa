"""YAML 1.2 within limits, and the shipped files: each loads, and no number is without an origin."""

import math
import warnings
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from cam_rig.errors import ConfigError
from cam_rig.schema import CamConfig, Library, load_cam, load_published, load_rig, load_scene
from cam_rig.schema.load import MAX_BYTES, config_root, read_yaml
from cam_rig.schema.quantity import ORIGINS
from cam_rig.schema.yaml_text import MAX_DEPTH, MAX_DIGITS, MAX_VALUES, parse_yaml


def test_scalars_are_those_of_yaml_1_2():
    """Neither yes nor on is a truth, no date is made, and 1e3 is a number."""
    for text, value in [
        ("1e3", 1000.0),
        ("12e03", 12000.0),
        (".5", 0.5),
        ("1.", 1.0),
        ("1_000", 1000),
        ("010", 10),
        ("0o17", 15),
        ("0x1F", 31),
        ("0b101", 5),
        ("-0b11", -3),
        ("+.inf", math.inf),
        ("~", None),
        ("", None),
        ("TRUE", True),
        *(
            (word, word)
            for word in ("yes", "no", "on", "off", "y", "tRUE", "1:30", "0o8", "1e", "=")
        ),
        ("2001-01-01", "2001-01-01"),
        ("'3'", "3"),
        ("!!str 3", "3"),
        ("|\n  3", "3"),
    ]:
        found = parse_yaml(f"a: {text}")["a"]
        assert found == value and type(found) is type(value)


def test_nothing_is_a_number_that_is_none():
    assert math.isnan(parse_yaml(".nan"))


def test_what_is_refused():
    for text, words in [
        ("a: 1\nb: 2\na: 3\n", "not YAML: line 3: the key 'a' is there twice"),
        ("1: a\n1.0: b", "not YAML: line 2: the key '1.0' is there twice"),
        ("a:\n  - !foo 3", "not YAML: line 2: the tag '!foo' does not fit"),
        ("a: !!int x", "not YAML: line 1: the tag 'tag:yaml.org,2002:int' does not fit"),
        ("--- 1\n--- 2\n", "not YAML: line 2: a second document begins; allowed: one"),
        ("\na: [1\n", "not YAML: while parsing a flow sequence at line 2, column 4"),
        ("a: *b", r"not YAML: line 1: \*b is not there, or not at its end"),
        ("a: &a\n  - *a", r"not YAML: line 2: \*a is not there, or not at its end"),
        ("[a, b]: 3", "not YAML: line 1: a list or a mapping is a key; allowed: a text"),
        ("a: 1\n<<: 3", "not YAML: line 2: << merges mappings alone"),
        ("\n\na: 0b" + "1" * 50_000, "a number in line 3 has 50002 characters; allowed: 300"),
        ("a: 1" + "0" * MAX_DIGITS, "a number in line 1 has 301 characters; allowed: 300"),
        ("[" * 1000, "is nested too deeply, in line 1; allowed: 32 levels"),
        ("\n".join("  " * i + "a:" for i in range(40)), "is nested too deeply, in line 33"),
    ]:
        with pytest.raises(ConfigError, match=f"^{words}") as caught:
            parse_yaml(text)
        assert "\n" not in str(caught.value) and len(str(caught.value)) < 200


def test_aliases_and_merges():
    text = "a: &a {x: 1, y: 2}\nb: *a\nc: {<<: *a, y: 3}\nd: {<<: [{p: 1}, {p: 2, q: 3}]}"
    a = {"x": 1, "y": 2}
    assert parse_yaml(text) == {"a": a, "b": a, "c": {"x": 1, "y": 3}, "d": {"p": 1, "q": 3}}


def test_aliases_count():
    bomb = "a0: &a0 [1, 1, 1]\n"
    bomb += "".join(f"a{i}: &a{i} [{f'*a{i - 1}, ' * 10}]\n" for i in range(1, 9))
    with pytest.raises(ConfigError, match=f"line 7: has more than {MAX_VALUES} values"):
        parse_yaml(bomb)
    chain = "b0: &b0 [1]\n" + "".join(f"b{i}: &b{i} [*b{i - 1}]\n" for i in range(1, 5000))
    with pytest.raises(ConfigError, match="nested too deeply, in line 32"):
        parse_yaml(chain)


def test_as_deep_as_is_allowed():
    parse_yaml("[" * MAX_DEPTH + "]" * MAX_DEPTH)
    with pytest.raises(ConfigError, match="nested too deeply"):
        parse_yaml("[" * (MAX_DEPTH + 1) + "]" * (MAX_DEPTH + 1))


def test_a_file_that_is_too_long_is_not_read(tmp_path):
    path = tmp_path / "long.yaml"
    path.write_text("title: '" + "word " * 2_000_000 + "'")
    with pytest.raises(ConfigError, match=r"long\.yaml: has 9\.54 MiB; allowed: 1 MiB"):
        read_yaml(path)
    path.write_bytes(b"#" * MAX_BYTES)
    assert read_yaml(path) is None
    with pytest.raises(ConfigError, match="zero: is a pipe or a device; allowed: a file"):
        read_yaml(path.__class__("/dev/zero"))


def ruamel(text):
    """What the parser of the comments-keeping editor reads, or an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return repr(YAML(typ="safe", pure=True).load(text))
        except (YAMLError, ValueError, TypeError, NotImplementedError):
            return None


def test_the_shipped_files_are_what_they_were():
    for path in config_root().rglob("*.yaml"):
        assert repr(read_yaml(path)) == ruamel(path.read_text(encoding="utf-8"))


WORDS = """1 -2 +3 1e3 1.5 .5 yes no on off true ~ null 0x1f 0o7 010 1_0 a 'a' "b" x:y http://x
#c 1:30 .inf -.INF - ? {} [] &a *a <<"""
SCALARS = st.sampled_from(WORDS.split())
TEXTS = st.lists(
    st.tuples(st.sampled_from(["", "  ", "- ", "a: ", "b: ", "  c: ", "[", "{a: "]), SCALARS,
              st.sampled_from(["", "]", "}", ",", " #x"])).map("".join),
    max_size=5,
).map("\n".join)  # fmt: skip


@given(TEXTS)
@settings(max_examples=300, derandomize=True, deadline=None)
def test_whoever_both_understand_both_read_alike(text):
    """A second parser of YAML 1.2 is the judge wherever neither refuses."""
    theirs = ruamel(text)
    try:
        mine = repr(parse_yaml(text))
    except ConfigError:
        return
    if theirs is not None and "[...]" not in theirs and "{...}" not in theirs:
        assert mine == theirs


CONFIG = Path(__file__).parents[2] / "config"
LOADERS = {"cams": load_cam, "rigs": load_rig, "scenes": load_scene, "published": load_published}
FILES = [path for folder in LOADERS for path in sorted((CONFIG / folder).glob("*.yaml"))]
#: Counts, degrees and fractions of the lift: choices of form, which have no unit and no origin.
BARE = {"to", "degree", "order", "points_per_turn", "ticks_per_turn", "seed"}


def quantities(node, key=""):
    """Every mapping with a unit, and every number that stands alone, with its key."""
    if isinstance(node, dict) and "unit" in node:
        yield key, node
    elif isinstance(node, dict):
        for name, child in node.items():
            yield from quantities(child, name)
    elif isinstance(node, list):
        for child in node:
            yield from quantities(child, key)
    elif isinstance(node, int | float):
        yield key, node


def test_loads_under_its_own_name():
    for path in FILES:
        assert LOADERS[path.parent.name](path).name == path.stem


def test_each_number_has_an_origin():
    for path in [path for path in FILES if path.parent.name != "published"]:
        found = list(quantities(YAML(typ="safe").load(path.read_text(encoding="utf-8"))))
        assert found
        for key, node in found:
            if isinstance(node, dict):
                assert len(set(ORIGINS) & set(node)) == 1, key
            else:
                assert key in BARE, f"{key} is a bare number"


def test_cam_lists_all_its_numbers(cams):
    for name, cam in cams.items():
        raw = YAML(typ="safe").load((CONFIG / "cams" / f"{name}.yaml").read_text(encoding="utf-8"))
        with_unit = [node for _, node in quantities(raw) if isinstance(node, dict)]
        assert len(cam.numbers()) == len(with_unit)
        assert {"lift", "base_radius", "segments[0].span"} <= set(cam.numbers())


def test_library_prefers_the_scenes_own_folder(tmp_path):
    own = tmp_path / "cams" / "poly345.yaml"
    own.parent.mkdir()
    own.touch()
    library = Library.beside(tmp_path / "scenes" / "x.yaml")
    assert library.path("cams", "poly345") == own
    assert library.path("cams", "poly4567") == CONFIG / "cams" / "poly4567.yaml"


def test_published_levels_cross_where_the_paper_says():
    """With the misprint of eq. 20 corrected, Bézier 15 and TM21 are equally loud at 335 rpm."""
    published = load_published(CONFIG / "published" / "tm21_noise.yaml")
    one, two = published.crossover.between
    rpm = published.crossover.rpm
    assert rpm == 335
    assert abs(published.level(one, rpm) - published.level(two, rpm)) < 0.05  # dB: printed digits


def test_a_copied_cam_is_the_same(cams):
    for cam in cams.values():
        assert CamConfig.model_validate(cam.model_dump(exclude_none=True)) == cam
