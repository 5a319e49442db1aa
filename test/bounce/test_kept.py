"""A bounce map whose rows are kept: the same, whatever ends it; other rows are refused."""

import numpy as np
import pytest

import cam_rig
from cam_rig.bounce import kept
from cam_rig.errors import ConfigError

pq = pytest.importorskip("pyarrow.parquet")

HOW = {"restitution": 0.7, "turns": 20, "settle": 60}
RPM = [310.0, 390.0, 420.0, 450.0]


@pytest.fixture(scope="module")
def tm21():
    return cam_rig.build_law(cam_rig.load_cam("tm21")), cam_rig.load_rig("tm21")


def test_rows_are_those_that_are_not_kept(tm21, tmp_path):
    """Number for number, on the cam, at rest, irregular and periodic; each turn too."""
    found = cam_rig.bounce_map(*tm21, rpm=RPM, out=tmp_path / "rows", **HOW)
    assert found.data() == cam_rig.bounce_map(*tm21, rpm=RPM, **HOW).data()
    again = cam_rig.bounce_map(*tm21, rpm=RPM, out=tmp_path / "rows", resume=True, **HOW)
    assert again.data() == found.data()


def test_columns_are_those_of_the_table(tm21, tmp_path):
    """By name and unit, −∞ as it is; a reader needs nothing of the package."""
    found = cam_rig.bounce_map(*tm21, rpm=RPM, out=tmp_path, **HOW)
    table = pq.read_table(sorted(tmp_path.glob("*.parquet"))[0])
    columns = {c.key: c.si for c in found.columns["speeds"]}
    assert set(columns) <= set(table.column_names)
    assert {key: table.schema.field(key).metadata[b"unit"].decode() for key in columns} == columns
    whole = cam_rig.bounce_map(*tm21, rpm=RPM, out=tmp_path, resume=True, **HOW)
    assert whole.rows[0].exponent == -np.inf


def test_two_masses_are_kept(tmp_path):
    """Four exponents and four numbers a turn."""
    law, rig = cam_rig.build_law(cam_rig.load_cam("poly345")), cam_rig.load_rig("paper_table2")
    how = {"model": "two_mass", "restitution": 0.5, "turns": 20, "settle": 40, "rpm": [400, 580]}
    found = cam_rig.bounce_map(law, rig, out=tmp_path, **how)
    assert found.data() == cam_rig.bounce_map(law, rig, **how).data()
    assert found.rows[1].states.shape == (20, 4)


def test_it_goes_on_where_it_was_ended(tm21, tmp_path, monkeypatch):
    """Rows that are there are not turned again, and all others are."""
    turned, made, speeds = kept.turned, list[int](), np.linspace(310.0, 460.0, 9)

    def ended(study, first, last):
        if len(made) >= 6:
            raise KeyboardInterrupt
        made.extend(range(first, last))
        return turned(study, first, last)

    monkeypatch.setattr(kept, "turned", ended)
    with pytest.raises(KeyboardInterrupt):
        cam_rig.bounce_map(*tm21, rpm=speeds, out=tmp_path, **HOW)
    there = pq.read_table(tmp_path).column("point").to_pylist()
    assert 1 <= len(there) < 9
    made.clear()

    def counted(study, first, last):
        made.extend(range(first, last))
        return turned(study, first, last)

    monkeypatch.setattr(kept, "turned", counted)
    found = cam_rig.bounce_map(*tm21, rpm=speeds, out=tmp_path, resume=True, **HOW)
    assert sorted(there + made) == list(range(9))
    assert found.data() == cam_rig.bounce_map(*tm21, rpm=speeds, **HOW).data()


def test_what_is_refused(tm21, tmp_path):
    """A folder of other rows by what differs; rows that are a chain; nothing to resume."""
    cam_rig.bounce_map(*tm21, rpm=RPM[:2], out=tmp_path, **HOW)
    with pytest.raises(ConfigError, match="allowed: resume to go on"):
        cam_rig.bounce_map(*tm21, rpm=RPM[:2], out=tmp_path, **HOW)
    with pytest.raises(ConfigError, match=r"restitution is 0\.6, was 0\.7"):
        changed = {**HOW, "restitution": 0.6}
        cam_rig.bounce_map(*tm21, rpm=RPM[:2], out=tmp_path, resume=True, **changed)
    with pytest.raises(ConfigError, match="law is poly345"):
        law = cam_rig.build_law(cam_rig.load_cam("poly345"))
        cam_rig.bounce_map(law, tm21[1], rpm=RPM[:2], out=tmp_path, resume=True, **HOW)
    with pytest.raises(ConfigError, match="out: keeps rows that begin on the cam, not below"):
        cam_rig.bounce_map(*tm21, rpm=RPM, out=tmp_path, start="below", **HOW)
    with pytest.raises(ConfigError, match="resume: without a folder"):
        cam_rig.bounce_map(*tm21, rpm=RPM, resume=True, **HOW)
