"""Files that are no config at all: missing, empty, broken, of another shape."""

import pytest

from cam_rig.errors import ConfigError
from cam_rig.schema import load_cam, load_rig
from cam_rig.schema.load import config_root


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "",
            "holds nothing; allowed: a mapping with the keys name, title, follower, shaft, ",
        ),
        ("# only a comment\n", "holds nothing"),
        ("- 1\n- 2\n", "holds a list; allowed: a mapping"),
        ("just words", "holds text; allowed: a mapping"),
        ("3", "holds a int; allowed: a mapping"),
    ],
)
def test_not_a_mapping(error_of, text, words):
    """What the file holds is named, and the keys it should hold."""
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
    """The parser's words, with the line, in one line."""
    message = error_of("rig", text)
    assert message.startswith("not YAML: ")
    assert "line" in message or "position" in message


def test_nested_without_end(error_of):
    """The parser gives up; the user gets a line all the same."""
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
    """The files there are, are named, and first the one whose name is nearly it."""
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
    """A folder cannot be read as a file."""
    with pytest.raises(ConfigError, match="is a folder; allowed: a YAML file"):
        load_cam(tmp_path)


@pytest.mark.parametrize("kind", ["cam", "rig", "scene", "published"])
def test_every_key_missing(error_of, kind):
    """An empty mapping lacks its first key, and the line names the next three it must have."""
    message = error_of(kind, "{}")
    assert message.startswith("name: missing; it is required")
    others = message.split("(also wrong: ")[1].removesuffix(")").split(" and ")[0].split(", ")
    assert len(others) == (2 if kind == "rig" else 3) and "name" not in others


@pytest.mark.parametrize("kind", ["cam", "rig", "scene"])
def test_unknown_key(refuse, kind):
    """A key that does not exist is named, with the one that was meant."""
    message = refuse(kind, "title:", "titel: x\ntitle:")
    assert message.startswith("titel: unknown key, value 'x' (did you mean 'title'?); allowed: ")
    assert "\n" not in message


@pytest.mark.parametrize(
    ("kind", "key", "wrong"),
    [("rig", "title", "titel"), ("rig", "mass", "mas"), ("scene", "model", "modell")],
)
def test_misspelt_required_key(refuse, kind, key, wrong):
    """A misspelt required key is missing and unknown at once: the line shows the misspelling."""
    message = refuse(kind, f"{key}:", f"{wrong}:")
    assert f"did you mean {key!r}?" in message


@pytest.mark.parametrize("title", ["[a, b]", "3", "", "{a: 1}"])
def test_title_must_be_text(refuse, title):
    """A list, a number or nothing for a text is refused, with key and value."""
    message = refuse("rig", "title: TM21 with the paper's follower", f"title: {title}")
    assert message.startswith("title: is ")
    assert "allowed: a valid string" in message
