"""cam-rig noise, calibrate and listen: files that programs can read, and errors in one line."""

import json
import wave
from shutil import copytree

import numpy as np
import pytest

from cam_rig.acoustics import level_db
from cam_rig.schema.load import config_root
from cam_rig.simulation.scene import load_scene

from .calls import call, done


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


def test_listen_repeats(tmp_path):
    """The background is seeded: the same file twice."""
    files = [tmp_path / name for name in ("a.wav", "b.wav")]
    for out in files:
        call("listen", "quick", "--rpm", "200", "--cam", "tm21", "--seconds", "0.5", "--out", out)
    assert files[0].read_bytes() == files[1].read_bytes()


def roles(scene):
    """What the levels of a scene are worth, by cam."""
    loaded = load_scene(scene)
    return {cam: loaded.role(cam) for cam in loaded.cams}


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
