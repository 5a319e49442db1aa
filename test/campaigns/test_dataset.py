"""The dataset on the disk: whole at every moment, resumed without a gap, one writer."""

import resource

import duckdb
import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from cam_rig.campaigns.dataset import CampaignDataset
from cam_rig.campaigns.point import measure_batch
from cam_rig.campaigns.run import InThisProcess, run_campaign
from cam_rig.errors import ConfigError, OutputError

MASS = {"rig.follower.mass": {"values": [-1, 1, 1.3, 2, 3], "unit": "kg"}}


@pytest.fixture
def dataset(study, tmp_path):
    return CampaignDataset(tmp_path / "rows", study(vary=MASS, plan={"kind": "grid"}))


def run(dataset, resume=False):
    """Make what is missing; what is said of damaged files."""
    with dataset.opened(resume) as damaged:
        run_campaign(dataset, InThisProcess(), 1)
    return damaged


def test_duckdb_and_pandas_read_it(dataset):
    """One row a point with inputs, measures, status, reason, seed and version; units beside."""
    run(dataset)
    pattern = f"{dataset.folder}/*.parquet"
    rows = duckdb.sql(f"select * from '{pattern}' order by point").fetchall()
    names = duckdb.sql(f"select * from '{pattern}'").columns
    assert names == [
        "point", "seed", "version", "rig_follower_mass", "jump_speed_rigid_rpm", "status", "reason",
    ]  # fmt: skip
    assert [row[0] for row in rows] == [0, 1, 2, 3, 4]
    assert [row[3] for row in rows] == [-1.0, 1.0, 1.3, 2.0, 3.0]
    assert [row[5] for row in rows] == ["failed", "ok", "ok", "ok", "ok"]
    assert rows[0][4] is None
    assert "mass" in rows[0][6]
    assert rows[1][6] is None
    frame = pd.read_parquet(dataset.folder).sort_values("point")
    assert frame.jump_speed_rigid_rpm.tolist()[1:] == [row[4] for row in rows[1:]]
    schema = pq.read_schema(next(dataset.folder.glob("*.parquet")))
    assert schema.field("rig_follower_mass").metadata[b"unit"] == b"kg"
    assert {b"study", b"fingerprint", b"cam_rig", b"numpy", b"scipy"} <= set(schema.metadata)


def test_resuming_makes_what_is_missing_and_nothing_else(dataset):
    """A hole in the middle, a damaged file and half a file of a killed writer."""
    run(dataset)
    whole = {name: dataset.column(name) for name in ("point", "jump_speed_rigid_rpm")}
    files = [path for _, _, path in dataset.batches()]
    kept = {path: path.stat().st_mtime_ns for path in files[:1]}
    files[1].unlink()
    files[-1].write_bytes(files[-1].read_bytes()[:-20])
    half = dataset.folder / ".points-0000000001-0000000002.parquet.part"
    half.write_bytes(b"PAR1")
    assert files[-1].name in run(dataset, resume=True)
    assert dataset.missing() == []
    assert not half.exists()
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    for name, column in whole.items():
        assert np.array_equal(dataset.column(name), column, equal_nan=True)


def test_rows_of_another_study_are_not_mixed(dataset, study):
    """Neither by chance nor with --resume."""
    run(dataset)
    with pytest.raises(ConfigError, match="--resume to go on"):
        run(dataset)
    other = CampaignDataset(dataset.folder, study(plan={"kind": "sobol", "points": 8, "seed": 4}))
    with pytest.raises(ConfigError, match="is of another study"):
        run(other, resume=True)


def test_a_second_writer_is_refused(dataset):
    """In a line; the first goes on."""
    with dataset.opened(False):
        with pytest.raises(OutputError, match="another campaign writes"), dataset.opened(False):
            pass
        run_campaign(dataset, InThisProcess(), 1)
    assert dataset.missing() == []


def test_a_full_disk_ends_in_one_line_and_leaves_nothing_half(dataset, tmp_path):
    """What is there stays readable, and the rest is made later."""
    campaign = dataset.campaign
    full = CampaignDataset(tmp_path / "full", campaign)
    with full.opened(False):
        full.write(measure_batch(campaign, 0, 2))
        limits = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
        try:
            with pytest.raises(OutputError, match=r"cannot be written.*what is finished stays"):
                full.write(measure_batch(campaign, 2, 5))
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    (only,) = (path.name for path in full.folder.iterdir() if path.name != ".lock")
    assert only.startswith("points-0000000000-0000000002-")
    run(full, resume=True)
    assert full.missing() == []
