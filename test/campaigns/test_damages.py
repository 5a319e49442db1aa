"""Files of a campaign that are not as they were written: no number of theirs is told."""

import random
import shutil

import numpy as np
import pytest

import cam_rig
from cam_rig.campaigns.dataset import CampaignDataset
from cam_rig.campaigns.point import measure_batch
from cam_rig.campaigns.run import InThisProcess, run_campaign
from cam_rig.errors import ConfigError, OutputError

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
    draw = random.Random(seed)
    shutil.copytree(whole.folder, folder)
    dataset = CampaignDataset(folder, whole.campaign)
    damage = draw.choice(DAMAGES)
    damage([path for _, _, path in dataset.batches()], draw)
    with pytest.raises(OutputError, match=r"is not as it was written.*--resume"):
        numbers(dataset)
    with dataset.opened(True) as damaged:
        assert "their points are made again" in damaged, damage
        run_campaign(dataset, InThisProcess(), 1)
    assert dataset.missing() == []
    assert numbers(dataset) == numbers(whole)
    shutil.rmtree(folder)


@pytest.mark.variants(5)
@pytest.mark.parametrize("seed", range(30))
def test_no_damage_is_a_wrong_number(whole, tmp_path, seed):
    """Flipped bits, zeros, cuts and exchanged files are named, and their points made again."""
    require_told_and_mended(whole, tmp_path / "damaged", seed)


@pytest.mark.long
def test_no_damage_of_a_thousand_is_a_wrong_number(whole, tmp_path):
    """The same a thousand times."""
    for seed in range(1000, 2000):
        require_told_and_mended(whole, tmp_path / "damaged", seed)


def test_a_dataset_copied_half_is_made_whole(whole, tmp_path):
    """Some files are not there, one is there in part; what is there whole is not made again."""
    files = [path for _, _, path in whole.batches()]
    for path in files[:2]:
        shutil.copy(path, tmp_path)
    (tmp_path / files[2].name).write_bytes(files[2].read_bytes()[:5000])
    made = {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    dataset = CampaignDataset(tmp_path, whole.campaign)
    with dataset.opened(True) as damaged:
        run_campaign(dataset, InThisProcess(), 1)
    assert files[2].name in damaged
    assert files[1].name not in damaged
    assert numbers(dataset) == numbers(whole)
    for path in files[:2]:
        copied = tmp_path / path.name
        assert copied.stat().st_mtime_ns == made[copied]


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
