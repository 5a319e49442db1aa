"""Tests of a campaign's files: readable at any time, one writer, damage detected.

A campaign is a batch of simulations with varied inputs, one row per point.
"""

import os
import random
import resource
import shutil
import signal
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import duckdb
import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from distributed import Client, LocalCluster

import cam_rig
from cam_rig.datasets.batches import BATCH_S, BatchSizes, SerialExecutor, compute_missing
from cam_rig.datasets.point_files import Batch
from cam_rig.errors import ConfigError, OutputError, RunError
from cam_rig.show.result import Progress
from cam_rig.studies.campaign.campaign import batch_task, measure_batch
from cam_rig.studies.campaign.dataset import CampaignDataset

from .conftest import run

MASS = {"rig.follower.mass": {"values": [-1, 1, 1.3, 2, 3], "unit": "kg"}}


@pytest.fixture
def dataset(study, tmp_path):
    """Small campaign over the mass, without computed points."""
    return CampaignDataset(tmp_path / "rows", study(vary=MASS, plan={"kind": "grid"}))


def test_duckdb_and_pandas_read_it(dataset):
    """The libraries duckdb and pandas read a campaign as one row per point.

    A failed point has status, reason and an empty measure. The schema of the Parquet files has the
    units and the versions.
    """
    run(dataset)
    pattern = f"{dataset.folder}/*.parquet"
    rows = duckdb.sql(f"select * from '{pattern}' order by point").fetchall()
    names = duckdb.sql(f"select * from '{pattern}'").columns
    inputs, measures = ["rig_follower_mass"], ["jump_speed_rigid_rpm"]
    assert names == ["point", "seed", "version", *inputs, *measures, "status", "reason"]
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


def test_resume_computes_only_missing_points(dataset):
    """A resume computes only the points of missing, damaged and incomplete files.

    Intact files are not written again, and the data equal those of the first run.
    """
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


def test_a_second_writer_is_refused(dataset):
    """Opening a dataset for writing while another writer is active raises an error.

    The first writer continues.
    """
    with dataset.open(False):
        with pytest.raises(OutputError, match="another run writes"), dataset.open(False):
            pass
        compute_missing(dataset, batch_task, SerialExecutor(), 1)
    assert dataset.missing() == []


def test_a_full_disk_leaves_only_complete_files(dataset, tmp_path, monkeypatch):
    """If a write fails as on a full disk, only complete files remain.

    A limit of 1000 bytes per file simulates the full disk. A later resume adds the missing points.
    """
    campaign = dataset.campaign
    full = CampaignDataset(tmp_path / "full", campaign)
    with full.open(False):
        full.write(measure_batch(campaign, 0, 2))
        limits = resource.getrlimit(resource.RLIMIT_FSIZE)
        monkeypatch.setattr("sys.dont_write_bytecode", True)  # else it writes cut .pyc files
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
        try:
            with pytest.raises(OutputError, match=r"cannot be written.*finished batches are kept"):
                full.write(measure_batch(campaign, 2, 5))
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    (only,) = (path.name for path in full.folder.iterdir() if path.name != ".lock")
    assert only.startswith("points-0000000000-0000000002-")
    run(full, resume=True)
    assert full.missing() == []


#: Number of points up to the end of each batch file of the dataset that the tests damage.
BATCHES = (1, 4, 9, 16)


@pytest.fixture(scope="module")
def whole(study, tmp_path_factory):
    """Complete campaign of four files, in which some points have failed."""
    plan = {"kind": "sobol", "points": BATCHES[-1], "seed": 5}
    campaign = study(vary={"rig.follower.mass": {"normal": 60, "unit": "%"}}, plan=plan)
    dataset = CampaignDataset(tmp_path_factory.mktemp("whole"), campaign)
    with dataset.open(False):
        for first, last in zip((0, *BATCHES), BATCHES, strict=False):
            dataset.write(measure_batch(campaign, first, last))
    return dataset


def copied(whole, folder):
    """Copy a dataset to another folder and return the copy."""
    shutil.copytree(whole.folder, folder)
    return CampaignDataset(folder, whole.campaign)


def numbers(dataset):
    """Return all columns and failure reasons of a dataset as one text, for comparison."""
    columns = {name: dataset.column(name).tolist() for name in dataset.schema.names}
    return repr((columns, dataset.reasons()))


def flip(files, draw):
    """Flip one random bit in a random file."""
    path = draw.choice(files)
    data = bytearray(path.read_bytes())
    data[draw.randrange(len(data))] ^= 1 << draw.randrange(8)
    path.write_bytes(data)


def cut(files, draw):
    """Truncate a random file at a random length."""
    path = draw.choice(files)
    data = path.read_bytes()
    path.write_bytes(data[: draw.randrange(len(data))])


def swap(files, draw):
    """Exchange the names of two files."""
    first, second = draw.sample(files, 2)
    temporary = first.with_name("aside")
    first.rename(temporary)
    second.rename(first)
    temporary.rename(second)


def zero(files, draw):
    """Overwrite 64 bytes of a file with zeros, as after a power failure."""
    path = draw.choice(files)
    data = bytearray(path.read_bytes())
    offset = draw.randrange(len(data) - 64)
    data[offset : offset + 64] = bytes(64) if any(data[offset : offset + 64]) else b"\1" * 64
    path.write_bytes(data)


def as_another(files, draw):
    """Rename a file to the point range of another file, which it replaces.

    The checksum in the name stays that of the content.
    """
    first, second = draw.sample(files, 2)
    first.replace(second.with_name(second.name[:29] + first.name[29:]))
    second.unlink()


DAMAGES = (flip, cut, swap, zero, as_another)


@pytest.mark.parametrize("seeds", [range(5), pytest.param(range(1000), marks=pytest.mark.long)])
def test_damaged_files_are_reported_and_computed_again(whole, tmp_path, seeds):
    """Each kind of damage is reported, and a resume computes the points again.

    The first five seeds cover all five kinds. The repaired dataset equals the original.
    """
    for seed in seeds:
        dataset, damage = copied(whole, tmp_path / str(seed)), DAMAGES[seed % len(DAMAGES)]
        damage([path for _, _, path in dataset.batches()], random.Random(seed))
        with pytest.raises(OutputError, match=r"is not as it was written.*--resume"):
            numbers(dataset)
        assert "their points are made again" in run(dataset, resume=True), damage
        assert dataset.missing() == []
        assert numbers(dataset) == numbers(whole)


def test_points_in_two_files_are_counted_once(whole, tmp_path):
    """If two files contain the same points, a resume reports it and keeps each once."""
    dataset = copied(whole, tmp_path / "both")
    dataset.write(measure_batch(whole.campaign, 3, 6))
    assert "with another file's points" in run(dataset, resume=True)
    assert np.array_equal(dataset.column("point"), np.arange(BATCHES[-1]))


def test_a_file_without_a_digest_is_refused(whole, tmp_path):
    """A file from an earlier version, which has no checksum in its name, is refused."""
    dataset = copied(whole, tmp_path / "old")
    first = dataset.batches()[0][2]
    first.rename(first.with_name("points-0000000000-0000000001.parquet"))
    with pytest.raises(ConfigError, match="has no digest in its name"), dataset.open(True):
        pass


def test_a_folder_of_another_study_is_not_changed(whole, study, tmp_path):
    """Opening the folder of another study raises an error and changes no file.

    This applies also if one of the files is damaged.
    """
    theirs = copied(whole, tmp_path / "theirs")
    flip([theirs.batches()[0][2]], random.Random(1))
    before = sorted(path.name for path in theirs.folder.iterdir())
    other = CampaignDataset(theirs.folder, study(plan={"kind": "sobol", "points": 8, "seed": 9}))
    with pytest.raises(ConfigError, match="is of another study"), other.open(True):
        pass
    assert sorted(path.name for path in theirs.folder.iterdir()) == before


def test_python_warns_of_damaged_files(whole, tmp_path):
    """`cam_rig.campaign` with `resume` warns of damaged files and recomputes them."""
    dataset = copied(whole, tmp_path / "rows")
    cut([dataset.batches()[1][2]], random.Random(2))
    study = whole.campaign.config.model_dump(exclude_none=True)
    with pytest.warns(UserWarning, match="1 file not as written.*points are made again"):
        found = cam_rig.campaign(study, tmp_path / "rows", resume=True)
    assert numbers(found.dataset) == numbers(whole)
    assert found.to_pandas().point.tolist() == list(range(BATCHES[-1]))


# -- rows do not depend on the executor: no pool, a killed pool, a Dask cluster that loses a worker

PARTS = {
    "vary": {
        "rig.follower.preload": {"uniform": 10, "unit": "%"},
        "rig.follower.mass": {"normal": 60, "unit": "%"},
    },
    "correlated": [{"inputs": ["rig.follower.preload", "rig.follower.mass"], "coefficient": 0.5}],
    "plan": {"kind": "sobol", "points": 16, "seed": 2},
    "measures": ["jump_speed", "jump_speed_rigid"],
}


class Killing(Progress):
    """Progress callback that kills a process as soon as the first points are written.

    `process` is a function that returns the id of the process to kill.
    """

    def __init__(self, process):
        self.process, self.killed = process, None

    def advance(self, steps=1):
        if self.killed is None:
            self.killed = self.process()
            os.kill(self.killed, signal.SIGKILL)


@pytest.fixture(scope="module")
def alone(study, tmp_path_factory):
    """Campaign computed in this process without a pool, one batch after another."""
    dataset = CampaignDataset(tmp_path_factory.mktemp("alone"), study(**PARTS))
    run(dataset)
    return dataset


def test_a_point_is_the_same_after_any_other(alone):
    """The result of a point does not depend on the points computed before it.

    Points computed alone in descending order have the same digits.
    """
    campaign = alone.campaign
    expected = alone.column("jump_speed_rpm")
    for point in (15, 11, 5):
        rows = measure_batch(campaign, point, point + 1)
        assert repr(rows.measures[0, 0]) == repr(np.float64(expected[point]))


@pytest.mark.long
def test_a_cluster_that_loses_a_worker_makes_the_same_rows(alone, tmp_path):
    """A Dask cluster that loses a worker still computes each point of a campaign once.

    The rows have the digits of a run in one process.
    """
    dataset = CampaignDataset(tmp_path, alone.campaign)
    with (
        LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address="127.0.0.1:0"
        ) as cluster,
        Client(cluster) as client,
        dataset.open(False),
    ):
        killing = Killing(lambda: next(iter(client.run(os.getpid).values())))
        compute_missing(dataset, batch_task, client.get_executor(pure=False), 2, killing)
    assert killing.killed
    assert sum(last - first for first, last, _ in dataset.batches()) == 16
    assert numbers(alone) == numbers(dataset)


def test_a_killed_process_ends_the_run_and_resume_completes_it(alone, tmp_path):
    """If a worker process is killed, RunError is raised and written batches are kept.

    A resume completes the campaign with the same digits.
    """
    dataset = CampaignDataset(tmp_path, alone.campaign)
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        killing = Killing(lambda: next(iter(pool._processes)))
        with dataset.open(False), pytest.raises(RunError, match="finished batches are kept"):
            compute_missing(dataset, batch_task, pool, 1, killing)
    assert dataset.missing() != []
    run(dataset, resume=True)
    assert dataset.missing() == []
    assert numbers(alone) == numbers(dataset)


def test_the_size_of_batches_follows_their_duration():
    """The size of the next batch of points is chosen so that it takes BATCH_S seconds.

    It grows at most four-fold per step. A point that takes longer than BATCH_S is a separate batch,
    unless a plan of 1e8 points would need too many files. Then the batches grow in spite of it.
    """

    def after(seconds, count, total=10**4, workers=2):
        sizes = BatchSizes(total, workers)
        sizes.take(Batch(0, count, seconds))
        return sizes.next

    assert (BatchSizes(10**6, 2).next, BatchSizes(10**6, 1000).in_flight) == (1, 64)
    assert after(BATCH_S * 100 / 50, 100) == 50
    assert after(1e-6, 100) == 400
    assert after(10.0 * BATCH_S, 1) == 1
    assert after(10.0 * BATCH_S, 1, total=10**8) == 4
    assert after(BATCH_S * 100 / 50, 100, total=10**7, workers=1000) == 400
