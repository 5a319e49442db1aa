"""Tables of jump speeds as they come."""

import numpy as np
import pytest

from cam_rig.errors import ConfigError
from cam_rig.measured.rig_fit.jump_table import read_jump_table
from cam_rig.units import RPM


def read(folder, text):
    path = folder / "jumps.csv"
    path.write_text(text, encoding="utf-8")
    return read_jump_table(path)


@pytest.mark.parametrize(
    "text",
    [
        "mass_kg,spring_N/m,rpm\n0.5,4030,412.5\n1,4030,380\n",
        "Masse [g];Federrate [N/mm];Drehzahl [1/min]\n500;4,03;412,5\n1000;4,03;380\n",
        "masa (kg)\tmuelle (kN/m)\tvelocidad (rpm)\n0.5\t4.03\t412.5\n1\t4.03\t380\n",
    ],
)
def test_units_languages_and_separators(tmp_path, text):
    """The same two readings, however they are written."""
    table = read(tmp_path, text)
    assert table.columns == ("mass", "spring_stiffness")
    assert [r.speed / RPM for r in table.readings] == pytest.approx([412.5, 380.0])
    assert table.readings[0].known == pytest.approx({"mass": 0.5, "spring_stiffness": 4030.0})


def test_a_missing_unit_is_assumed_and_said(tmp_path):
    table = read(tmp_path, "preload,jump speed\n20,300\n")
    assert table.readings[0].known == {"preload": 20.0}
    assert sum("assumed" in note for note in table.notes) == 2


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("mass_kg,lift_mm\n1,2\n", "jump speed"),
        ("1,2\n3,4\n", "no heading"),
        ("mass_kg,rpm\n1,-5\n", "line 2: speed"),
        ("mass_kg,rpm\n2,300\n1,x\n", "line 3: rpm is 'x'"),
        ("rpm,drehzahl\n300,300\n", "both hold"),
    ],
)
def test_what_cannot_be_read_is_said_in_a_line(tmp_path, text, words):
    with pytest.raises(ConfigError, match=words) as error:
        read(tmp_path, text)
    assert "separator seen" in str(error.value)
    assert "\n" not in str(error.value)


def test_values_are_finite(tmp_path):
    table = read(tmp_path, "mass_kg,rpm\n0,300\n1,250\n")
    assert np.isfinite([r.speed for r in table.readings]).all()


@pytest.mark.parametrize("heading", ["spring_N/furlong", "mass_oz", "mass [stone]", "speed_deg/s"])
def test_an_unknown_unit_is_refused(tmp_path, heading):
    """Never taken for another: the units that are known are listed."""
    with pytest.raises(ConfigError, match="has no unit of a") as error:
        read(tmp_path, f"{heading},preload_N\n1,20\n")
    assert "allowed" in str(error.value)
