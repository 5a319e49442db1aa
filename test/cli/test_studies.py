"""cam-rig noise, calibrate and listen: files that programs can read, and errors in one line."""

import json
import math
import wave
from pathlib import Path
from shutil import copy, copytree

import numpy as np
import pytest

from cam_rig.acoustics import level_db
from cam_rig.errors import ConfigError
from cam_rig.schema.load import config_root, read_yaml
from cam_rig.simulation.scene import load_scene
from cam_rig.studies.noise.command import set_identified

from .conftest import call, done


@pytest.mark.usefixtures("one_study")
def test_noise_json_and_plot(sweep, tmp_path):
    """Every part is in the JSON, no NaN; the plot is a picture; tables are whole at 80 columns."""
    result = done("noise", sweep, "--json", tmp_path / "a.json", "--plot", tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    text = (tmp_path / "a.json").read_text()
    assert "NaN" not in text
    data = json.loads(text)
    names = ["two constants", "two constants, arc cam refitted", "by substitution"]
    assert [method["calibration"] for method in data["methods"]] == names
    assert data["study"]["best_calibration"] in names
    cams = ["tm21", "poly345", "bezier15"]
    assert [(row["calibration"], row["cam"]) for row in data["curves"]] == [
        (name, cam) for name in names for cam in cams
    ]
    assert len(data["levels"]) == 3 * 3 * 9
    for row in data["levels"]:
        assert row["expected_low"] < row["expected_high"]
    assert {row["left_out"] for row in data["left_out"]} == set(cams)
    rigs = ["two constants, arc cam refitted", "paper_table2, rigid stem", "paper_table2"]
    assert list(dict.fromkeys(row["rig"] for row in data["one_rig"])) == rigs
    assert "…" not in result.stderr
    assert max(map(len, result.stderr.splitlines())) <= 80
    said = " ".join(result.stderr.split())
    for word in ("identified", "calibrated", "predicted", "standard", "deviation"):
        assert word in said
    points = data["methods"][0]["named_points"]
    assert f" {points:.1f} " in said


def test_listen_writes_a_sound_file(tmp_path):
    """48 kHz, 16 bit, whole turns; full scale and peak as told; the level is in the samples."""
    out = tmp_path / "new" / "cam.wav"
    arguments = ("--cam", "tm21", "--rpm", "300", "--seconds", "1", "--json", "-")
    result = done("listen", "quick", *arguments, "--out", out)
    data = json.loads(result.stdout)
    told = data["sound"]
    levels = {row["quantity"]: row["level"] for row in data["levels"]}
    with wave.open(str(out)) as file:
        assert (file.getframerate(), file.getsampwidth(), file.getnchannels()) == (48_000, 2, 1)
        samples = np.frombuffer(file.readframes(file.getnframes()), dtype="<i2")
    assert samples.size == 48_000
    pressure = samples * told["full_scale"] / 32767
    assert np.abs(pressure).max() == pytest.approx(told["peak"], rel=1e-3)
    level = float(level_db(np.sqrt(np.mean(pressure**2))))
    assert level == pytest.approx(levels["LZeq"], abs=0.01)
    assert not told["overload"]
    done("listen", "quick", *arguments, "--out", tmp_path / "again.wav")
    assert (tmp_path / "again.wav").read_bytes() == out.read_bytes()  # the background is seeded


def roles(scene):
    """What the levels of a scene are worth, by cam."""
    loaded = load_scene(scene)
    return {cam: loaded.level_origin(cam) for cam in loaded.cams}


@pytest.mark.long
def test_a_calibration_holds_for_its_follower(tmp_path):
    """Another mass makes levels relative; a calibration ends that, until the next mass."""
    copytree(config_root(), tmp_path / "own")
    scene, rig = (tmp_path / "own" / f for f in ("scenes/tm21_sweep.yaml", "rigs/tm21.yaml"))
    rig.write_text(rig.read_text(encoding="utf-8").replace("given: 1.3,", "given: 1.2,"))
    assert set(roles(scene).values()) == {"relative"}
    done("calibrate", scene)
    assert "one_mass, mass 1.2 kg, spring_stiffness 4030 N/m" in rig.read_text(encoding="utf-8")
    found = roles(scene)
    assert (found["poly345"], found["bezier15"]) == ("calibrated", "predicted")
    rig.write_text(rig.read_text(encoding="utf-8").replace("given: 1.2,", "given: 1.1,"))
    assert set(roles(scene).values()) == {"relative"}


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


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "rig.yaml"
    path.write_text(TEXT, encoding="utf-8")
    return path


def test_numbers_with_what_they_are_from(path):
    """The origin's key is changed; source and residual are replaced, or added where they lack."""
    numbers = {("radiation", "gain"): 9.8e-5, ("radiation", "corner"): 18.4}
    set_identified(path, {**numbers, ("segments", 0, "span"): 117.5}, 'a "fit"', "0.6 dB, 2 of 3")
    origin = {"source": 'a "fit"', "residual": "0.6 dB, 2 of 3"}
    read = read_yaml(path)
    assert read["radiation"]["gain"] == {"identified": 9.8e-5, "unit": "Pa*s/N", **origin}
    assert read["radiation"]["corner"] == {"identified": 18.4, "unit": "Hz", **origin}
    assert read["segments"][0]["span"] == {"identified": 117.5, "unit": "deg", **origin}
    assert read["segments"][1]["law"] == "Größe"


def test_all_else_stays_as_it_was_written(path):
    """Comments, blanks and the other lines, character by character."""
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


def test_a_file_that_cannot_be_written_is_one_line(path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", full)
    with pytest.raises(ConfigError, match=r"rig.yaml: cannot be written \(No space left"):
        set_identified(path, {("radiation", "gain"): 2.0}, "s", "r")
    assert path.read_text(encoding="utf-8") == TEXT
    assert [p.name for p in path.parent.iterdir()] == ["rig.yaml"]


@pytest.fixture
def small(sweep, tmp_path):
    """The shipped study with two laws and two angles."""
    return Path(copy(sweep.parents[1] / "factorials" / "continuity.yaml", tmp_path))


def test_json_and_plot(small):
    """Values, shares that add up, and the conclusions; a picture, and the tables as CSV."""
    plot, csv = small.parent / "a.png", small.parent / "a.csv"
    result = done("factorial", small, "--jobs", 1, "--json", "-", "--plot", plot, "--csv", csv)
    data = json.loads(result.stdout)
    rows = {(one["design"], one["effect"], one["in_contact"]): one for one in data["variance"]}
    designs = {"same angles", "same acceleration"}  # all are C2 and above
    assert {design for design, _, _ in rows} == designs
    for one in rows.values():
        assert one["law"] + one["angle"] + one["interaction"] == pytest.approx(1.0)
    residual = rows["same acceleration", "residual", False]
    assert (residual["cells_without_contact"], residual["fastest"]) == (1, pytest.approx(400.0))
    cells = [one for one in data["cells"] if one["design"] == "same acceleration"]
    assert [one["law"] for one in cells if one["jump"] < residual["fastest"]] == ["poly345"]
    assert len(data["cells"]) == 8
    assert "lose contact below 400 rpm" in " ".join(result.stderr.split())
    assert data["conclusions"]["advantage"] == "slopes"
    assert len(data["cams"]) == 5
    assert [round(math.degrees(one["span"])) for one in data["compressed"]] == [300]
    about = {key: 0.0 for key in rows}
    for one in data["effects"]:
        about[one["design"], one["effect"], one["in_contact"]] += one["above_mean"]
    assert max(map(abs, about.values())) < 1e-9
    assert plot.read_bytes().startswith(b"\x89PNG")
    assert csv.read_text(encoding="utf-8").startswith(
        "design,effect,in_contact,laws,angles,law,between_classes"
    )


@pytest.mark.parametrize(
    ("key", "old", "new", "words"),
    [
        ("rises", "poly4567]", "constant_velocity]", "is 'constant_velocity', whose velocity"),
        ("reference", "reference: poly345", "reference: bezier4_start", "is 'bezier4_start'"),
        ("residual", "390, 400]", "390, 4000]", "speed is 4000 rpm; allowed: 1 to 3139 rpm"),
        ("noise_in_contact", "assumed: 200", "assumed: 0.001", "allowed: at least 1 rpm"),
    ],
)
def test_a_study_that_cannot_be_run(small, key, old, new, words):
    """A rise that throws the follower off, a speed that means nothing: file or study, and key."""
    text = small.read_text(encoding="utf-8")
    assert old in text
    small.write_text(text.replace(old, new), encoding="utf-8")
    result = call("factorial", small)
    assert result.exit_code == 2
    assert "continuity" in result.stderr
    assert key in result.stderr
    assert words in result.stderr


def test_an_unknown_rig(small):
    small.write_text(small.read_text(encoding="utf-8").replace("tm21", "no_such_rig"))
    result = call("factorial", small, "--json", small.parent / "a.json")
    assert result.exit_code == 2
    assert "no_such_rig.yaml: no such file" in result.stderr
    assert [p.name for p in small.parent.iterdir()] == ["continuity.yaml"]


def test_json_of_vibration(tmp_path):
    """A list over the speeds for each measure of each cam, and the paper's words."""
    words = ("--rpm", 250, "--rpm", 300, "--json", "-", "--plot", tmp_path / "a.png")
    result = done("vibration", "poly345", "bezier15", *words)
    data = json.loads(result.stdout)
    by = {(row["cam"], row["rpm"]): row for row in data["vibration"]}
    assert list(by) == [(cam, rpm) for cam in ("poly345", "bezier15") for rpm in (250, 300)]
    assert not by["bezier15", 300]["low_dwell"]
    verdicts = [claim["verdict"] for claim in data["claims"] if claim["measure"] != "peak to peak"]
    assert verdicts == ["agrees"] * 3
    assert "read within 31.25° of the lowest lift" in " ".join(result.stderr.split())


def test_cams_that_are_left_are_marked():
    """Of two cams one is left below 450 rpm: marked in the table, told in JSON, not asked of."""
    speeds = ("--rpm", 300, "--rpm", 450, "--rpm", 450)
    result = done("vibration", "poly345", "bezier15", *speeds, "--json", "-")
    data = json.loads(result.stdout)
    by = {(row["cam"], row["rpm"]): row for row in data["vibration"]}
    lost = {key: row["contact_lost"] for key, row in by.items()}
    assert [key for key in lost if lost[key]] == [("poly345", 450)]
    assert len(lost) == 4
    assert by["poly345", 300]["contact_lost_rpm"] == pytest.approx(413.44, abs=0.01)
    assert "poly345 †" in result.stderr
    assert "bezier15 * †" not in result.stderr
    assert "contact is lost at 1 of 2 speeds" in result.stderr
    verdicts = {c["measure"]: c["verdict"] for c in data["claims"] if c["source"] == "fig. 5"}
    assert verdicts == {"residual amplitude": "agrees", "peak to peak": "disagrees"}
