"""YAML 1.2 within limits, and the shipped files: each loads, no number is without an origin."""

import math
import warnings

from hypothesis import given, settings
from hypothesis import strategies as st
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from cam_rig.errors import ConfigError
from cam_rig.schema import Library, load_cam, load_published, load_rig, load_scene
from cam_rig.schema.load import MAX_BYTES, config_root, read_yaml
from cam_rig.schema.quantity import ORIGINS
from cam_rig.schema.yaml_text import MAX_DEPTH, MAX_DIGITS, MAX_VALUES, parse_yaml

from .conftest import refusal

CONFIG = config_root()


def test_scalars_are_those_of_yaml_1_2():
    """Neither yes nor on is a truth, no date is made, and 1e3 is a number."""
    scalars = {
        **{"1e3": 1000.0, "12e03": 12000.0, ".5": 0.5, "1.": 1.0, "1_000": 1000, "010": 10},
        **{"0o17": 15, "0x1F": 31, "0b101": 5, "-0b11": -3, "+.inf": math.inf, "TRUE": True},
        **{"~": None, "": None, "'3'": "3", "!!str 3": "3", "|\n  3": "3"},
    }
    texts = "yes no on off y tRUE 1:30 0o8 1e = 2001-01-01 2024-99-99"
    for text, value in (scalars | {word: word for word in texts.split()}).items():
        found = parse_yaml(f"a: {text}")["a"]
        assert found == value and type(found) is type(value), text
    assert math.isnan(parse_yaml(".nan"))  # a number, though no file may hold it


def test_what_is_refused():
    """One line, with the line of the file, the limit and no more of the text than that."""
    deep = "\n".join("  " * i + "a:" for i in range(40))
    bomb = "a0: &a0 [1, 1, 1]\n"
    bomb += "".join(f"a{i}: &a{i} [{f'*a{i - 1}, ' * 10}]\n" for i in range(1, 9))
    for text, words in (
        ("a: 1\nb: 2\na: 3\n", "line 3: duplicate key 'a'"),
        ("1: a\n1.0: b", "line 2: duplicate key '1.0'"),
        ("a:\n  - !foo 3", "line 2: tag '!foo' is not supported"),
        ("a: !!timestamp 2001-01-01", "line 1: tag 'tag:yaml.org,2002:timestamp' is not"),
        ("a: !!int x", "line 1: 'x' is not a number"),
        ("a: 0x_", "line 1: '0x_' is not a number"),
        ("--- 1\n--- 2\n", "expected a single document in the stream at line 1, column 5"),
        ("\na: [1\n", "while parsing a flow sequence at line 2, column 4"),
        ("a: *b", "line 1: alias *b is not supported; repeat the value"),
        ("a: &a\n  - *a", "line 2: alias *a is not supported"),
        (bomb, "line 2: alias *a0 is not supported"),
        ("[a, b]: 3", "line 1: a list or a mapping is a key; use text"),
        ("a: 1\n<<: {b: 3}", "line 2: merge key << is not supported"),
        ("\n\na: 0b" + "1" * 50_000, "line 3: number with 50002 characters; at most 300"),
        ("a: 1" + "0" * MAX_DIGITS, "line 1: number with 301 characters; at most 300"),
        ("[" * 1000, "line 1: nested too deeply; at most 32 levels"),
        (deep, "line 33: nested too deeply"),
    ):
        message = refusal(parse_yaml, text)
        assert message.startswith(f"not YAML: {words}") and len(message) < 200, message
    parse_yaml("[" * MAX_DEPTH + "]" * MAX_DEPTH)
    many = f"[{'1,' * MAX_VALUES}]"
    assert f"line 1: more than {MAX_VALUES} values" in refusal(parse_yaml, many)


def test_a_file_that_is_too_long_is_not_read(tmp_path):
    """Ten megabytes of a title, and a device without an end."""
    path = tmp_path / "long.yaml"
    path.write_text("title: '" + "word " * 2_000_000 + "'")
    assert "long.yaml: has 9.54 MiB; allowed: 1 MiB" in refusal(read_yaml, path)
    path.write_bytes(b"#" * MAX_BYTES)
    assert read_yaml(path) is None
    words = "zero: is a pipe or a device; allowed: a file"
    assert words in refusal(read_yaml, path.__class__("/dev/zero"))


def ruamel(text):
    """What the parser of the comments-keeping editor reads, or an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return repr(YAML(typ="safe", pure=True).load(text))
        except (YAMLError, ValueError, TypeError, NotImplementedError):
            return None


def test_the_shipped_files_are_what_another_parser_reads():
    """Which writes identified numbers back."""
    for path in CONFIG.rglob("*.yaml"):
        assert repr(read_yaml(path)) == ruamel(path.read_text(encoding="utf-8"))


WORDS = """1 -2 +3 1e3 1.5 .5 yes no on off true ~ null 0x1f 0o7 010 1_0 a 'a' "b" x:y http://x
#c 1:30 .inf -.INF - ? {} [] &a *a <<"""
BEGINS, ENDS = ["", "  ", "- ", "a: ", "b: ", "  c: ", "[", "{a: "], ["", "]", "}", ",", " #x"]
LINES = st.tuples(*map(st.sampled_from, (BEGINS, WORDS.split(), ENDS))).map("".join)


@given(st.lists(LINES, max_size=5).map("\n".join))
@settings(max_examples=4 * settings.default.max_examples)
def test_whatever_both_understand_both_read_alike(text):
    """A second parser of YAML 1.2 is the judge wherever neither refuses."""
    try:
        mine = repr(parse_yaml(text))
    except ConfigError:
        return
    theirs = ruamel(text)
    if theirs is not None and "[...]" not in theirs and "{...}" not in theirs:
        assert mine == theirs


LOADERS = {"cams": load_cam, "rigs": load_rig, "scenes": load_scene, "published": load_published}
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


def test_every_file_loads_under_its_own_name_and_says_where_its_numbers_come_from():
    """Given, assumed or identified; a cam's `numbers` are all of its file's, by their keys."""
    for folder, load in LOADERS.items():
        for path in sorted((CONFIG / folder).glob("*.yaml")):
            config = load(path)
            assert config.name == path.stem
            found = [] if folder == "published" else list(quantities(read_yaml(path)))
            origins = [set(ORIGINS) & set(node) for _, node in found if isinstance(node, dict)]
            assert all(len(one) == 1 for one in origins), path
            assert {key for key, node in found if not isinstance(node, dict)} <= BARE, path
            if folder == "cams":
                assert len(config.numbers()) == len(origins)
                assert {"lift", "base_radius", "segments[0].span"} <= set(config.numbers())


def test_library_prefers_the_scenes_own_folder(tmp_path):
    own = tmp_path / "cams" / "poly345.yaml"
    own.parent.mkdir()
    own.touch()
    library = Library.beside(tmp_path / "scenes" / "x.yaml")
    assert library.path("cams", "poly345") == own
    assert library.path("cams", "poly4567") == CONFIG / "cams" / "poly4567.yaml"
