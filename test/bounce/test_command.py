"""cam-rig bounce: tables, files, refusals in a line."""

import csv
import io
import json
from functools import partial

import pytest

from ..cli.conftest import call as run

call = partial(run, "bounce")
SHORT = ("--turns", "20", "--settle", "60", "--restitution", "0.7")


def test_rows_by_speed():
    """CSV and JSON have what the table shows."""
    result = call("tm21", "--rpm", "310,390,450", "--jobs", "1", *SHORT, "--csv", "-")
    assert result.exit_code == 0, result.stderr
    rows = list(csv.DictReader(io.StringIO(result.stdout)))
    assert [row["motion"] for row in rows] == ["in contact", "periodic", "periodic"]
    assert [row["exponent"] == "" for row in rows] == [True, True, False]
    assert float(rows[2]["exponent"]) == pytest.approx(-0.32, abs=0.01)


def test_from_above_and_followed():
    """Speeds from the fastest down, the branches they are on, and where these change."""
    words = ("--rpm", "414:450:4", "--from", "above", "--follow", *SHORT, "--json", "-")
    result = call("tm21", *words)
    assert result.exit_code == 0, result.stderr
    found = json.loads(result.stdout)
    assert [row["rpm"] for row in found["speeds"]] == list(range(414, 451, 4))
    folds = [one["rpm"] for one in found["bifurcations"] if one["kind"] == "fold"]
    assert min(abs(rpm - 418.8029) for rpm in folds) < 1e-3
    assert any(not one["stable"] for one in found["orbits"])


def test_over_another_number_and_kept(tmp_path):
    """A row a mass, in the folder too; and of two masses."""
    words = ("--rpm", "450", "--over", "mass", "--range", "1:1.4:0.2", "--out", str(tmp_path))
    result = call("tm21", *words, "--jobs", "1", *SHORT, "--csv", "-")
    assert result.exit_code == 0, result.stderr
    rows = list(csv.DictReader(io.StringIO(result.stdout)))
    assert [float(row["mass"]) for row in rows] == pytest.approx([1.0, 1.2, 1.4])
    assert list(tmp_path.glob("*.parquet"))
    words = ("--rig", "paper_table2", "--model", "two_mass", "--rpm", "400", "--csv", "-")
    result = call("poly345", *words, *SHORT)
    assert result.exit_code == 0, result.stderr
    (row,) = csv.DictReader(io.StringIO(result.stdout))
    assert float(row["exponent"]) == pytest.approx(float(row["exponent_2"]), rel=1e-6)


def test_many_speeds_are_shown_where_they_change():
    """Of fifty on the cam the first and the last; all are in the data."""
    result = call("tm21", "--rpm", "200:249:1", "--from", "below", *SHORT)
    assert result.exit_code == 0, result.stderr
    shown = result.stdout + result.stderr
    assert shown.count("in contact ") == 2
    assert "50 speeds; here those at which the motion changes." in " ".join(shown.split())


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("nothing",), "nothing"),
        (("tm21", "--rpm", "0"), "--rpm 0: allowed"),
        (("tm21", "--basins", "--rpm", "420,430"), "--basins: of 2 speeds; allowed: one"),
        (("tm21", "--restitution", "1"), "restitution is 1.0; allowed"),
        (("worked_example_constant_velocity",), "jump speed of 0 rpm"),
        (("conjugate",), "conjugate"),
        (("tm21", "--over", "mass"), "rpm: are 121 speeds over mass; allowed: one speed"),
        (("tm21", "--rpm", "400", "--over", "mass", "--range", "x"), "--range x: allowed: 0.5, or"),
        (
            ("tm21", "--rpm", "400", "--model", "two_mass"),
            "roller_share: is missing; needed by two",
        ),
        (("tm21", "--rpm", "400", "--model", "two_mass", "--basins"), "--basins: are of one mass"),
        (("tm21", "--rpm", "400", "--resume"), "resume: without a folder; allowed: with out"),
    ],
)
def test_refusals(words, told):
    """One line that names what is wrong."""
    result = call(*words)
    assert result.exit_code != 0
    assert told in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
