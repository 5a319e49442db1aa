"""The dataset on the disk: whole at every moment, one writer, and no number of a damaged file."""

import random
import resource
import shutil

import duckdb
import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

import cam_rig
from cam_rig.campaigns.campaign import measure_batch
from cam_rig.campaigns.dataset import CampaignDataset
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


def test_a_second_writer_is_refused(dataset):
    """In a line; the first goes on."""
    with dataset.opened(False):
        with pytest.raises(OutputError, match="another run writes"), dataset.opened(False):
            pass
        run_campaign(dataset, InThisProcess(), 1)
    assert dataset.missing() == []


def test_a_full_disk_ends_in_one_line_and_leaves_nothing_half(dataset, tmp_path, monkeypatch):
    """What is there stays readable, and the rest is made later."""
    campaign = dataset.campaign
    full = CampaignDataset(tmp_path / "full", campaign)
    with full.opened(False):
        full.write(measure_batch(campaign, 0, 2))
        limits = resource.getrlimit(resource.RLIMIT_FSIZE)
        monkeypatch.setattr("sys.dont_write_bytecode", True)  # else half of a module's stays
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


#: Batches of the campaign that is damaged, by their last points.
BATCHES = (1, 4, 9, 16)


@pytest.fixture(scope="module")
def whole(study, tmp_path_factory):
    """A finished dataset of some files, with failed points among them."""
    campaign = study(
        vary={"rig.follower.mass": {"normal": 60, "unit": "%"}},
        plan={"kind": "sobol", "points": BATCHES[-1], "seed": 5},
    )
    dataset = CampaignDataset(tmp_path_factory.mktemp("whole"), campaign)
    with dataset.opened(False):
        for first, last in zip((0, *BATCHES), BATCHES, strict=False):
            dataset.write(measure_batch(campaign, first, last))
    return dataset


def numbers(dataset):
    """All that a dataset says, but for its files."""
    columns = {name: dataset.column(name).tolist() for name in dataset.schema.names}
    return repr((columns, dataset.reasons()))


def flip(files, draw):
    """One bit, anywhere in a file."""
    path = draw.choice(files)
    data = bytearray(path.read_bytes())
    data[draw.randrange(len(data))] ^= 1 << draw.randrange(8)
    path.write_bytes(data)


def cut(files, draw):
    """The end of a file is missing, or all of it."""
    path = draw.choice(files)
    data = path.read_bytes()
    path.write_bytes(data[: draw.randrange(len(data))])


def swap(files, draw):
    """Two files under each other's names."""
    one, other = draw.sample(files, 2)
    aside = one.with_name("aside")
    one.rename(aside)
    other.rename(one)
    aside.rename(other)


def zero(files, draw):
    """A block of zeros, as a disk may give back after a power cut."""
    path = draw.choice(files)
    data = bytearray(path.read_bytes())
    at = draw.randrange(len(data) - 64)
    data[at : at + 64] = bytes(64) if any(data[at : at + 64]) else b"\1" * 64
    path.write_bytes(data)


def as_another(files, draw):
    """A file in the place of another, its own place empty; the digest in its name goes along."""
    one, other = draw.sample(files, 2)
    one.replace(other.with_name(other.name[:29] + one.name[29:]))
    other.unlink()


DAMAGES = (flip, cut, swap, zero, as_another)


def require_told_and_mended(whole, folder, seed):
    """Reading a damaged dataset is refused in a line; resuming it gives the same numbers."""
    draw, damage = random.Random(seed), DAMAGES[seed % len(DAMAGES)]
    shutil.copytree(whole.folder, folder)
    dataset = CampaignDataset(folder, whole.campaign)
    damage([path for _, _, path in dataset.batches()], draw)
    with pytest.raises(OutputError, match=r"is not as it was written.*--resume"):
        numbers(dataset)
    with dataset.opened(True) as damaged:
        assert "their points are made again" in damaged, damage
        run_campaign(dataset, InThisProcess(), 1)
    assert dataset.missing() == []
    assert numbers(dataset) == numbers(whole)
    shutil.rmtree(folder)
    return damage


@pytest.mark.parametrize("seeds", [range(5), pytest.param(range(1000), marks=pytest.mark.long)])
def test_no_damage_is_a_wrong_number(whole, tmp_path, seeds):
    """Flipped bits, zeros, cuts and exchanged files are named, and their points made again.

    Of the first draws each damage is one.
    """
    damages = [require_told_and_mended(whole, tmp_path / "damaged", seed) for seed in seeds]
    assert set(damages) == set(DAMAGES)


def test_points_that_two_files_have_count_once(whole, tmp_path):
    """As where parts of two runs of one study are put into one folder."""
    shutil.copytree(whole.folder, tmp_path / "both")
    dataset = CampaignDataset(tmp_path / "both", whole.campaign)
    dataset.write(measure_batch(whole.campaign, 3, 6))
    with dataset.opened(True) as damaged:
        run_campaign(dataset, InThisProcess(), 1)
    assert "with another file's points" in damaged
    assert np.array_equal(dataset.column("point"), np.arange(BATCHES[-1]))


def test_a_file_without_a_digest_is_refused(whole, tmp_path):
    """As an earlier version wrote it: whether its rows are whole cannot be told."""
    shutil.copytree(whole.folder, tmp_path / "old")
    dataset = CampaignDataset(tmp_path / "old", whole.campaign)
    first = dataset.batches()[0][2]
    first.rename(first.with_name("points-0000000000-0000000001.parquet"))
    with pytest.raises(ConfigError, match="has no digest in its name"), dataset.opened(True):
        pass


def test_a_damaged_file_of_another_study_is_left_alone(whole, study, tmp_path):
    """What is refused is not touched."""
    shutil.copytree(whole.folder, tmp_path / "theirs")
    theirs = tmp_path / "theirs"
    flip([path for _, _, path in CampaignDataset(theirs, whole.campaign).batches()][:1],
         random.Random(1))  # fmt: skip
    before = sorted(path.name for path in theirs.iterdir())
    other = CampaignDataset(theirs, study(plan={"kind": "sobol", "points": 8, "seed": 9}))
    with pytest.raises(ConfigError, match="is of another study"), other.opened(True):
        pass
    assert sorted(path.name for path in theirs.iterdir()) == before


def test_python_warns_of_what_is_made_again(whole, tmp_path):
    """In the line of the command; the rows are then as they were."""
    shutil.copytree(whole.folder, tmp_path / "rows")
    dataset = CampaignDataset(tmp_path / "rows", whole.campaign)
    cut([dataset.batches()[1][2]], random.Random(2))
    study = whole.campaign.config.model_dump(exclude_none=True)
    with pytest.warns(UserWarning, match="1 file not as written.*points are made again"):
        found = cam_rig.campaign(study, tmp_path / "rows", resume=True)
    assert numbers(found.dataset) == numbers(whole)
    assert found.to_pandas().point.tolist() == list(range(BATCHES[-1]))
