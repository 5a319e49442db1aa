"""cam-rig bounce: tables, files, refusals in a line."""

import csv
import io
from functools import partial

import numpy as np
import pytest

import cam_rig
from cam_rig.errors import ConfigError
from cam_rig.studies.bounce import rows as module

from ...cli import conftest as cli

done, data_of = (partial(one, "bounce") for one in (cli.done, cli.data_of))
SHORT = ("--turns", "20", "--settle", "60", "--restitution", "0.7")


def rows_of(*words):
    """The rows of the table as CSV."""
    return list(csv.DictReader(io.StringIO(done(*words, *SHORT, "--csv", "-").stdout)))


def test_rows_by_speed():
    """CSV has what the table shows."""
    rows = rows_of("tm21", "--rpm", "310,390,450", "--jobs", "1")
    assert [row["motion"] for row in rows] == ["in contact", "periodic", "periodic"]
    assert [row["exponent"] == "" for row in rows] == [True, True, False]
    assert float(rows[2]["exponent"]) == pytest.approx(-0.32, abs=0.01)


def test_from_above_and_followed():
    """Speeds from the fastest down, the branches they are on, and where these change."""
    found = data_of("tm21", "--rpm", "414:450:4", "--from", "above", "--follow", *SHORT)
    assert [row["rpm"] for row in found["speeds"]] == list(range(414, 451, 4))
    folds = [one["rpm"] for one in found["bifurcations"] if one["kind"] == "fold"]
    assert min(abs(rpm - 418.8029) for rpm in folds) < 1e-3
    assert any(not one["stable"] for one in found["orbits"])


def test_over_another_number_and_kept(tmp_path):
    """A row a mass, in the folder too; and of two masses."""
    words = ("--rpm", "450", "--over", "mass", "--range", "1:1.4:0.2", "--out", str(tmp_path))
    rows = rows_of("tm21", *words, "--jobs", "1")
    assert [float(row["mass"]) for row in rows] == pytest.approx([1.0, 1.2, 1.4])
    assert list(tmp_path.glob("*.parquet"))
    words = ("--rig", "paper_table2", "--model", "two_mass", "--rpm", "400")
    (row,) = rows_of("poly345", *words)
    assert float(row["exponent"]) == pytest.approx(float(row["exponent_2"]), rel=1e-6)


def test_many_speeds_are_shown_where_they_change():
    """Of fifty on the cam the first and the last; all are in the data."""
    result = done("tm21", "--rpm", "200:249:1", "--from", "below", *SHORT)
    shown = result.stdout + result.stderr
    assert shown.count("in contact ") == 2
    assert "50 speeds; here those at which the motion changes." in " ".join(shown.split())


# -- a bounce map whose rows are kept: the same, whatever ends it; other rows are refused


pq = pytest.importorskip("pyarrow.parquet")

HOW = {"restitution": 0.7, "turns": 20, "settle": 60}
RPM = [310.0, 390.0, 420.0, 450.0]


@pytest.fixture
def tm21(laws, rig):
    return laws["tm21"], rig


def test_rows_are_those_that_are_not_kept(tm21, tmp_path):
    """Kept rows are equal to the last digit, resumed too, under the table's names and units."""
    rows = cam_rig.bounce_map(*tm21, rpm=RPM, out=tmp_path, **HOW)
    assert rows.data() == cam_rig.bounce_map(*tm21, rpm=RPM, **HOW).data()
    again = cam_rig.bounce_map(*tm21, rpm=RPM, out=tmp_path, resume=True, **HOW)
    assert again.data() == rows.data()
    assert again.rows[0].exponent == -np.inf
    table = pq.read_table(sorted(tmp_path.glob("*.parquet"))[0])
    units = {c.key: c.si_unit for c in rows.columns["speeds"]}
    assert {key: table.schema.field(key).metadata[b"unit"].decode() for key in units} == units


def test_two_masses_are_kept(law, paper_rig, tmp_path):
    """Four exponents and four numbers per turn."""
    how = {"model": "two_mass", "restitution": 0.5, "turns": 20, "settle": 40, "rpm": [400, 580]}
    rows = cam_rig.bounce_map(law, paper_rig, out=tmp_path, **how)
    assert rows.data() == cam_rig.bounce_map(law, paper_rig, **how).data()
    assert rows.rows[1].states.shape == (20, 4)


def test_it_goes_on_where_it_was_ended(tm21, tmp_path, monkeypatch):
    """Rows that are there are not turned again, and all others are."""
    turned, made, speeds = module.turned, list[int](), np.linspace(310.0, 460.0, 9)

    def counted(study, first, last):
        if len(made) >= most:
            raise KeyboardInterrupt
        made.extend(range(first, last))
        return turned(study, first, last)

    most = 6
    monkeypatch.setattr(module, "turned", counted)
    with pytest.raises(KeyboardInterrupt):
        cam_rig.bounce_map(*tm21, rpm=speeds, out=tmp_path, **HOW)
    there = pq.read_table(tmp_path).column("point").to_pylist()
    assert 1 <= len(there) < 9
    made.clear()
    most = 9
    found = cam_rig.bounce_map(*tm21, rpm=speeds, out=tmp_path, resume=True, **HOW)
    assert sorted(there + made) == list(range(9))
    assert found.data() == cam_rig.bounce_map(*tm21, rpm=speeds, **HOW).data()


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({}, "allowed: resume to continue"),
        ({"resume": True, "restitution": 0.6}, r"restitution is 0\.6, was 0\.7"),
        ({"resume": True, "law": "poly345"}, "law is poly345"),
        ({"start": "below"}, "out: keeps rows that begin on the cam, not below"),
        ({"resume": True, "out": None}, "resume: without a folder"),
    ],
)
def test_what_is_refused(laws, rig, tmp_path, how, words):
    """A folder with other rows, by what differs; rows that are a chain; nothing to resume."""
    how = {"law": "tm21", "rpm": RPM[:2], "out": tmp_path} | HOW | how
    cam_rig.bounce_map(laws["tm21"], rig, rpm=RPM[:2], out=tmp_path, **HOW)
    with pytest.raises(ConfigError, match=words):
        cam_rig.bounce_map(laws[how.pop("law")], rig, **how)
