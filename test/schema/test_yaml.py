"""The YAML parser with its limits, and the shipped files."""

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

from .conftest import catch_error

CONFIG = config_root()


def test_scalars_are_those_of_yaml_1_2():
    """Scalars are those of YAML 1.2: yes, on and dates are texts, 1e3 is a number."""
    scalars = {
        **{"1e3": 1000.0, "12e03": 12000.0, ".5": 0.5, "1.": 1.0, "1_000": 1000, "010": 10},
        **{"0o17": 15, "0x1F": 31, "0b101": 5, "-0b11": -3, "+.inf": math.inf, "TRUE": True},
        **{"~": None, "": None, "'3'": "3", "!!str 3": "3", "|\n  3": "3"},
    }
    texts = "yes no on off y tRUE 1:30 0o8 1e = 2001-01-01 2024-99-99"
    for text, value in (scalars | {word: word for word in texts.split()}).items():
        parsed = parse_yaml(f"a: {text}")["a"]
        assert parsed == value and type(parsed) is type(value), text
    assert math.isnan(parse_yaml(".nan"))  # quantities must be finite


def test_unsupported_yaml_raises_an_error_of_one_line():
    """Unsupported YAML raises one short line with the line number and the limit."""
    deep = "\n".join("  " * i + "a:" for i in range(40))
    bomb = "a0: &a0 [1, 1, 1]\n"
    bomb += "".join(f"a{i}: &a{i} [{f'*a{i - 1}, ' * 10}]\n" for i in range(1, 9))
    for text, expected in (
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
        message = catch_error(parse_yaml, text)
        assert message.startswith(f"not YAML: {expected}") and len(message) < 200, message
    parse_yaml("[" * MAX_DEPTH + "]" * MAX_DEPTH)
    many = f"[{'1,' * MAX_VALUES}]"
    assert f"line 1: more than {MAX_VALUES} values" in catch_error(parse_yaml, many)


def test_a_file_that_is_too_long_is_not_read(tmp_path):
    """A file above 1 MiB, or a device, is refused without reading it."""
    path = tmp_path / "long.yaml"
    path.write_text("title: '" + "word " * 2_000_000 + "'")
    assert "long.yaml: has 9.54 MiB; allowed: 1 MiB" in catch_error(read_yaml, path)
    path.write_bytes(b"#" * MAX_BYTES)
    assert read_yaml(path) is None
    expected = "zero: is a pipe or a device; allowed: a file"
    assert expected in catch_error(read_yaml, path.__class__("/dev/zero"))


def read_with_ruamel(text):
    """Return the value that ruamel.yaml reads as text, or None for an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return repr(YAML(typ="safe", pure=True).load(text))
        except (YAMLError, ValueError, TypeError, NotImplementedError):
            return None


def test_ruamel_reads_the_same_values_from_the_shipped_files():
    """`read_yaml` and ruamel.yaml read the same values from each shipped file."""
    for path in CONFIG.rglob("*.yaml"):
        assert repr(read_yaml(path)) == read_with_ruamel(path.read_text(encoding="utf-8"))


#: Values and signs of YAML.
VALUES = """1 -2 +3 1e3 1.5 .5 yes no on off true ~ null 0x1f 0o7 010 1_0 a 'a' "b" x:y http://x
#c 1:30 .inf -.INF - ? {} [] &a *a <<"""
#: Text before a value of a line.
STARTS = ["", "  ", "- ", "a: ", "b: ", "  c: ", "[", "{a: "]
#: Text after a value of a line.
ENDS = ["", "]", "}", ",", " #x"]
LINES = st.tuples(*map(st.sampled_from, (STARTS, VALUES.split(), ENDS))).map("".join)


@given(st.lists(LINES, max_size=5).map("\n".join))
@settings(max_examples=4 * settings.default.max_examples)
def test_ruamel_reads_the_same_values_from_random_texts(text):
    """`parse_yaml` and ruamel.yaml agree on random texts that both accept."""
    try:
        actual = repr(parse_yaml(text))
    except ConfigError:
        return
    expected = read_with_ruamel(text)
    if expected is not None and "[...]" not in expected and "{...}" not in expected:
        assert actual == expected


LOADERS = {"cams": load_cam, "rigs": load_rig, "scenes": load_scene, "published": load_published}
#: Keys of plain numbers without unit and origin: counts, degrees, fractions of the lift.
BARE = {"to", "degree", "order", "samples_per_turn", "ticks_per_turn", "seed"}


def quantities(node, key=""):
    """Yield key and value of every mapping with a unit, and of every plain number."""
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


def test_shipped_files_have_their_names_and_every_number_an_origin():
    """Each shipped file has its name as key, and each of its numbers has one origin.

    `CamConfig.numbers` contains all numbers of a cam file, by their paths.
    """
    for folder, load in LOADERS.items():
        for path in sorted((CONFIG / folder).glob("*.yaml")):
            config = load(path)
            assert config.name == path.stem
            numbers = [] if folder == "published" else list(quantities(read_yaml(path)))
            origins = [set(ORIGINS) & set(node) for _, node in numbers if isinstance(node, dict)]
            assert all(len(names) == 1 for names in origins), path
            assert {key for key, node in numbers if not isinstance(node, dict)} <= BARE, path
            if folder == "cams":
                assert len(config.numbers()) == len(origins)
                assert {"lift", "base_radius", "segments[0].span"} <= set(config.numbers())


def test_library_prefers_the_folder_of_the_scene(tmp_path):
    """A name is found next to the scene first, and then among the shipped files."""
    local = tmp_path / "cams" / "poly345.yaml"
    local.parent.mkdir()
    local.touch()
    library = Library.for_scene(tmp_path / "scenes" / "x.yaml")
    assert library.path("cams", "poly345") == local
    assert library.path("cams", "poly4567") == CONFIG / "cams" / "poly4567.yaml"
