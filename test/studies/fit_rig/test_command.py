"""Command `cam-rig fit rig`: estimates in tables and files."""

import json
import re
from itertools import product

import pytest
import yaml

import cam_rig
from cam_rig.studies.fit_rig.estimate import ParameterEstimate, RigParameters
from cam_rig.studies.fit_rig.rig_file import build_rig_text

from ...cli.conftest import call, done

SURE = ParameterEstimate("preload", 14.947876, 0.0323, "identified")
UNSURE = ParameterEstimate("damping", 8.6234, 3.1, "identified")
OPEN = ParameterEstimate("restitution", 0.04123, 0.03, "identified")
UNIDENTIFIED = ParameterEstimate.unidentified("stem_stiffness", "a rigid stem explains it", 1e7)


def table(*numbers):
    return RigParameters(None, "one_mass", numbers, None).number_tables("rig", ())[0]


def test_a_number_has_the_digits_of_its_error():
    """A fitted value is printed up to the second digit of its standard error.

    A parameter that is not identified has no value in the table, and null in JSON.
    """
    numbers = table(SURE, UNSURE, OPEN, UNIDENTIFIED)
    rows = {row[0]: row for row in numbers.to_display()[0].rows}
    assert rows["preload"][1:3] == ("14.948", "0.032")
    assert rows["damping"][1:3] == ("8.6", "3.1")
    assert table(UNIDENTIFIED).to_display()[0].rows == (
        ("stem_stiffness", "N/m", "not identified"),
    )
    assert numbers.rows()[-1]["value"] is None


@pytest.mark.parametrize(("found", "words"), [(UNSURE, "uncertain"), (OPEN, "may be 0")])
def test_a_wide_error_has_a_warning(found, words):
    """Table, rig file and JSON warn of a fitted value with a large error.

    It is large if it is a third of the value, or if the interval includes 0.
    """
    (row,) = table(found).to_display()[0].rows
    assert re.match(rf"identified; {words}: with 95 % it is", row[-1])
    assert words in found.text
    assert words in table(found).rows()[0]["caution"]
    assert SURE.caution == ""


def test_a_rig_file_has_the_digits_of_the_error(rig):
    """The rig file states a fitted preload as 14.948 ± 0.032 N.

    The digits are those of the standard error. Parameters that are not identified are taken from
    the base rig as assumed.
    """
    text, _ = build_rig_text(
        "bench", [SURE, UNIDENTIFIED], rig, "cam-rig fit rig a.csv", "1 rpm a reading"
    )
    follower = yaml.safe_load(text)["follower"]
    assert follower["preload"]["identified"] == 14.948
    assert "14.948 ± 0.032 N" in follower["preload"]["residual"]
    assert "assumed" in follower["stem_stiffness"]


# -- the command `cam-rig fit rig`

RPM = (336.8, 449.8, 622.6, 284.0, 385.7, 529.5, 257.2, 342.6, 469.7)
ROWS = zip(product((0, 0.5, 1), (2, 4.03, 8)), RPM, strict=True)
TABLE = "mass_kg,spring_N/mm,rpm\n" + "".join(f"{m},{k},{rpm}\n" for (m, k), rpm in ROWS)


@pytest.fixture
def jumps(tmp_path):
    """Path of a file with a table of measured jump speeds."""
    path = tmp_path / "jumps.csv"
    path.write_text(TABLE, encoding="utf-8")
    return path


def test_a_table_becomes_a_rig_that_loads(tmp_path, jumps):
    """`cam-rig fit rig` writes a rig file that can be loaded, a figure and JSON.

    In the rig file fitted parameters are `identified`, those of --fix `given`, and others
    `assumed`.
    """
    out = tmp_path / "bench.yaml"
    files = "--out", out, "--plot", tmp_path / "j.png", "--json", tmp_path / "j.json"
    done("fit", "rig", jumps, "poly345", "--fix", "damping=8.6", *files)
    rig = cam_rig.load_rig(out)
    assert rig.follower.mass.origin == "identified"
    assert rig.follower.mass.si == pytest.approx(1.3, abs=0.05)
    assert rig.follower.damping.origin == "given"
    assert rig.follower.spring_stiffness.origin == "assumed"
    data = json.loads((tmp_path / "j.json").read_text(encoding="utf-8"))
    numbers = {row["number"]: row for row in data["numbers"]}
    assert numbers["restitution"]["value"] is None
    assert numbers["mass"]["standard_error"] == pytest.approx(0.0098, rel=0.01)
    assert data["correlation"][0] == {"number": "mass", "other": "mass", "correlation": 1.0}
    assert [row["read_rpm"] for row in data["jump_speeds"]][:2] == pytest.approx([336.8, 449.8])
    assert "Identified: mass 1.3" in data["fit"]["conclusions"][0]
    assert (tmp_path / "j.png").stat().st_size > 10_000


def test_an_empty_speed_is_no_reading(tmp_path, jumps):
    """In a table of jump speeds a line without a speed is skipped.

    A line without a mass is an error.
    """
    jumps.write_text(TABLE.replace(",469.7", ","), encoding="utf-8")
    result = done("fit", "rig", jumps, "poly345", "--fix", "damping=8.6")
    assert "1 empty cell of the speed: no reading in 10" in " ".join(result.output.split())
    for row, words in ((",8,469.7", "the mass is empty"), ("1,8", "has 2 cells")):
        jumps.write_text(TABLE.replace("1,8,469.7", row), encoding="utf-8")
        result = call("fit", "rig", jumps, "poly345")
        assert result.exit_code == 2, result.output
        assert f"line 10: {words}" in result.output
