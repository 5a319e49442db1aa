"""Commands noise, listen and vibration: JSON, pictures and sound files."""

import json
import wave

import numpy as np
import pytest

from cam_rig.acoustics import level_db

from .conftest import done


def test_noise_json_and_plot(sweep, tmp_path):
    """`noise` writes JSON without NaN and a PNG, and prints tables of 80 columns."""
    result = done("noise", sweep, "--json", tmp_path / "a.json", "--plot", tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    text = (tmp_path / "a.json").read_text()
    assert "NaN" not in text
    data = json.loads(text)
    assert len(data["levels"]) == 3 * 3 * 9
    assert "…" not in result.stderr
    assert max(map(len, result.stderr.splitlines())) <= 80
    points = data["methods"][0]["named_points"]
    assert f" {points:.1f} " in " ".join(result.stderr.split())


def test_listen_writes_a_sound_file(tmp_path):
    """`listen` writes a 16-bit sound file at 48 kHz with the level in its JSON.

    Its peak agrees with the JSON, too. A second call writes the same file.
    """
    out = tmp_path / "new" / "cam.wav"
    arguments = ("--cam", "tm21", "--rpm", "300", "--seconds", "1", "--json", "-")
    result = done("listen", "quick", *arguments, "--out", out)
    data = json.loads(result.stdout)
    sound = data["sound"]
    levels = {row["quantity"]: row["level"] for row in data["levels"]}
    with wave.open(str(out)) as file:
        assert (file.getframerate(), file.getsampwidth(), file.getnchannels()) == (48_000, 2, 1)
        samples = np.frombuffer(file.readframes(file.getnframes()), dtype="<i2")
    assert samples.size == 48_000
    pressure = samples * sound["full_scale"] / 32767
    assert np.abs(pressure).max() == pytest.approx(sound["peak"], rel=1e-3)
    level = float(level_db(np.sqrt(np.mean(pressure**2))))
    assert level == pytest.approx(levels["LZeq"], abs=0.01)
    assert not sound["overload"]
    done("listen", "quick", *arguments, "--out", tmp_path / "again.wav")
    assert (tmp_path / "again.wav").read_bytes() == out.read_bytes()  # the background has a seed


def test_loss_of_contact_is_marked():
    """`vibration` marks a cam that loses contact below a speed, in table and JSON."""
    speeds = ("--rpm", 300, "--rpm", 450, "--rpm", 450)
    result = done("vibration", "poly345", "bezier15", *speeds, "--json", "-")
    data = json.loads(result.stdout)
    by = {(row["cam"], row["rpm"]): row for row in data["vibration"]}
    lost = {key: row["contact_lost"] for key, row in by.items()}
    assert [key for key in lost if lost[key]] == [("poly345", 450)] and len(lost) == 4
    assert by["poly345", 300]["contact_lost_rpm"] == pytest.approx(413.44, abs=0.01)
    assert "poly345 †" in result.stderr and "bezier15 * †" not in result.stderr
    assert "contact is lost at 1 of 2 speeds" in result.stderr
    assert not by["bezier15", 300]["low_dwell"]
