"""`set_identified`: numbers go into a file of a person's, and nothing else of it changes."""

import pytest

from cam_rig.errors import ConfigError
from cam_rig.paper.noise.command import set_identified
from cam_rig.schema.load import read_yaml

TEXT = """\
# A comment that stays.
radiation:
  gain: {assumed: 1.5e-4, unit: Pa*s/N}   # a guess
  corner:
    given: 20  # of a paper
    unit: Hz
    source: >
      a long
      story
    residual: 'none'
segments:
  - {law: dwell, span: {identified: 90, unit: deg, source: "old, with comma", residual: 2 dB}}
  - law: Größe
"""


def test_numbers_with_what_they_are_from(tmp_path):
    """The origin's key is changed; source and residual are replaced, or added where they lack."""
    path = tmp_path / "rig.yaml"
    path.write_text(TEXT, encoding="utf-8")
    numbers = {("radiation", "gain"): 9.8e-5, ("radiation", "corner"): 18.4}
    set_identified(path, {**numbers, ("segments", 0, "span"): 117.5}, 'a "fit"', "0.6 dB, 2 of 3")
    origin = {"source": 'a "fit"', "residual": "0.6 dB, 2 of 3"}
    read = read_yaml(path)
    assert read["radiation"]["gain"] == {"identified": 9.8e-5, "unit": "Pa*s/N", **origin}
    assert read["radiation"]["corner"] == {"identified": 18.4, "unit": "Hz", **origin}
    assert read["segments"][0]["span"] == {"identified": 117.5, "unit": "deg", **origin}
    assert read["segments"][1]["law"] == "Größe"


def test_all_else_stays_as_it_was_written(tmp_path):
    """Comments, blanks and the other lines, character by character."""
    path = tmp_path / "rig.yaml"
    path.write_text(TEXT, encoding="utf-8")
    set_identified(path, {("radiation", "gain"): 2.0}, "s", "r")
    changed = TEXT.replace("assumed: 1.5e-4", 'identified: 2.0, source: "s", residual: "r"')
    assert path.read_text(encoding="utf-8") == changed


def test_a_shipped_rig_is_as_it_was_after_its_own_numbers(tmp_path, config_dir):
    """Calibrating twice writes the same file."""
    path = tmp_path / "tm21.yaml"
    path.write_bytes((config_dir / "rigs" / "tm21.yaml").read_bytes())
    for _ in range(2):
        before = path.read_bytes()
        set_identified(path, {("radiation", "gain"): 1e-4}, "s", "r")
    assert path.read_bytes() == before
    assert read_yaml(path)["radiation"]["corner"]["identified"] == 18.42


def test_a_file_that_cannot_be_written_is_one_line(tmp_path, monkeypatch):
    """It is left as it was."""
    path = tmp_path / "rig.yaml"
    path.write_text(TEXT, encoding="utf-8")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", full)
    with pytest.raises(ConfigError, match=r"rig.yaml: cannot be written \(No space left"):
        set_identified(path, {("radiation", "gain"): 2.0}, "s", "r")
    assert path.read_text(encoding="utf-8") == TEXT
    assert [p.name for p in tmp_path.iterdir()] == ["rig.yaml"]
