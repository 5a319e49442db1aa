"""Tests of `cam-rig bounce`: tables, stored rows, resumption and error messages.

The command computes a bounce map, the motion of a follower at each speed of a sweep.
"""

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
SHORT = ("--turns", "20", "--transient-turns", "60", "--restitution", "0.7")


def rows_of(*words):
    """Run `cam-rig bounce` with these arguments and return the rows of its CSV table."""
    return list(csv.DictReader(io.StringIO(done(*words, *SHORT, "--csv", "-").stdout)))


def test_rows_from_above_with_branches():
    """The options --from above and --continuation report motions and bifurcations.

    There is a row for each speed. The fold of the TM21's cam is at 418.8029 rpm within 1e-3 rpm,
    and some motions are unstable.
    """
    found = data_of("tm21", "--rpm", "414:450:4", "--from", "above", "--continuation", *SHORT)
    assert [row["rpm"] for row in found["speeds"]] == list(range(414, 451, 4))
    folds = [one["rpm"] for one in found["bifurcations"] if one["kind"] == "fold"]
    assert min(abs(rpm - 418.8029) for rpm in folds) < 1e-3
    assert any(not one["stable"] for one in found["orbits"])


def test_a_sweep_over_mass_is_stored(tmp_path):
    """A sweep over the mass prints one row per value and stores the rows in --out.

    For two masses in contact the printed Lyapunov exponent equals the column `exponent_2`.
    """
    words = ("--rpm", "450", "--parameter", "mass", "--values", "1:1.4:0.2", "--out", str(tmp_path))
    rows = rows_of("tm21", *words, "--jobs", "1")
    assert [float(row["mass"]) for row in rows] == pytest.approx([1.0, 1.2, 1.4])
    assert list(tmp_path.glob("*.parquet"))
    words = ("--rig", "paper_table2", "--model", "two_mass", "--rpm", "400")
    (row,) = rows_of("poly345", *words)
    assert float(row["lyapunov_exponent"]) == pytest.approx(float(row["exponent_2"]), rel=1e-6)


def test_a_long_table_shows_only_changes():
    """The table of fifty speeds without lift-off prints only the first and the last.

    A note states that the table contains only the speeds at which the motion changes.
    """
    result = done("tm21", "--rpm", "200:249:1", "--from", "below", *SHORT)
    shown = result.stdout + result.stderr
    assert shown.count("in contact ") == 2
    assert "50 speeds; the table contains those at which" in " ".join(shown.split())


# -- stored rows: equal to computed rows, also after an interruption; rows of other inputs are
# refused


pq = pytest.importorskip("pyarrow.parquet")

HOW = {"restitution": 0.7, "turns": 20, "transient_turns": 60}
RPM = [310.0, 390.0, 420.0, 450.0]


@pytest.fixture
def tm21(laws, rig):
    """Law of the cam TM21, and the shipped rig."""
    return laws["tm21"], rig


def test_stored_rows_equal_computed_rows(tm21, tmp_path):
    """Stored rows of a bounce map equal those kept in memory, in all digits.

    A bounce map has the motion of the follower at each speed. This applies also after a resume. The
    Parquet files have the column names and units of the table.
    """
    rows = cam_rig.bounce_map(*tm21, rpm=RPM, out=tmp_path, **HOW)
    assert rows.data() == cam_rig.bounce_map(*tm21, rpm=RPM, **HOW).data()
    again = cam_rig.bounce_map(*tm21, rpm=RPM, out=tmp_path, resume=True, **HOW)
    assert again.data() == rows.data()
    assert again.rows[0].lyapunov_exponent == -np.inf
    table = pq.read_table(sorted(tmp_path.glob("*.parquet"))[0])
    units = {c.key: c.si_unit for c in rows.columns["speeds"]}
    assert {key: table.schema.field(key).metadata[b"unit"].decode() for key in units} == units


def test_rows_of_two_masses_are_stored(law, paper_rig, tmp_path):
    """A stored bounce map of two masses equals the computed map in all digits.

    It has four state numbers per turn: gap, stretch of the stem, and their rates.
    """
    how = {
        "model": "two_mass",
        "restitution": 0.5,
        "turns": 20,
        "transient_turns": 40,
        "rpm": [400, 580],
    }
    rows = cam_rig.bounce_map(law, paper_rig, out=tmp_path, **how)
    assert rows.data() == cam_rig.bounce_map(law, paper_rig, **how).data()
    assert rows.rows[1].states.shape == (20, 4)


def test_resume_computes_only_missing_rows(tm21, tmp_path, monkeypatch):
    """After an interruption, `resume=True` computes only rows that are not stored.

    The complete bounce map equals that of an uninterrupted computation.
    """
    compute, computed, speeds = module.compute_batch, list[int](), np.linspace(310.0, 460.0, 9)

    def counted(study, first, last):
        if len(computed) >= limit:
            raise KeyboardInterrupt
        computed.extend(range(first, last))
        return compute(study, first, last)

    limit = 6
    monkeypatch.setattr(module, "compute_batch", counted)
    with pytest.raises(KeyboardInterrupt):
        cam_rig.bounce_map(*tm21, rpm=speeds, out=tmp_path, **HOW)
    stored = pq.read_table(tmp_path).column("point").to_pylist()
    assert 1 <= len(stored) < 9
    computed.clear()
    limit = 9
    found = cam_rig.bounce_map(*tm21, rpm=speeds, out=tmp_path, resume=True, **HOW)
    assert sorted(stored + computed) == list(range(9))
    assert found.data() == cam_rig.bounce_map(*tm21, rpm=speeds, **HOW).data()


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({}, "allowed: resume to continue"),
        ({"resume": True, "restitution": 0.6}, r"restitution is 0\.6, was 0\.7"),
        ({"resume": True, "law": "poly345"}, "law is poly345"),
        ({"start": "below"}, "out cannot be combined with start below"),
        ({"resume": True, "out": None}, "resume requires a folder"),
    ],
)
def test_invalid_stored_maps_are_refused(laws, rig, tmp_path, how, words):
    """A folder with the bounce map of another study is refused with the changed input.

    The folder `out` is refused for `start="below"`, where each row needs the previous row. `resume`
    is refused without a folder.
    """
    how = {"law": "tm21", "rpm": RPM[:2], "out": tmp_path} | HOW | how
    cam_rig.bounce_map(laws["tm21"], rig, rpm=RPM[:2], out=tmp_path, **HOW)
    with pytest.raises(ConfigError, match=words):
        cam_rig.bounce_map(laws[how.pop("law")], rig, **how)
