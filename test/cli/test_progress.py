"""How far a campaign is: where there is no terminal, a line with the time left and the size."""

import pytest

from cam_rig.campaigns import command as module
from cam_rig.campaigns.campaign import campaign_from
from cam_rig.campaigns.command import CampaignProgress, in_words, sized
from cam_rig.campaigns.dataset import CampaignDataset
from cam_rig.campaigns.point import measure_batch
from cam_rig.schema.load import Library, config_root


@pytest.fixture
def dataset(tmp_path):
    study = {
        "name": "small",
        "title": "a small campaign",
        "base": {"cam": "poly345", "rig": "paper_table2"},
        "vary": {"rig.follower.preload": {"uniform": 10, "unit": "%"}},
        "plan": {"kind": "sobol", "points": 1000},
        "measures": ["jump_speed_rigid"],
    }
    return CampaignDataset(tmp_path, campaign_from(study, Library((config_root(),))))


def test_a_line_tells_rate_time_left_and_size(dataset, monkeypatch):
    """50 points in 20 s after the first batch leave 940 at 2.5 points/s, 376 s; 10 s apart."""
    now, said = [0.0], []
    monkeypatch.setattr(module.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(module, "say", said.append)
    with dataset.opened(False), CampaignProgress(dataset) as progress:
        for time, first, last in ((1.0, 0, 10), (9.0, 10, 30), (21.0, 30, 60), (30.0, 60, 80)):
            dataset.write(measure_batch(dataset.campaign, first, last))
            now[0] = time
            progress.advance(last - first)
    (line,) = said
    assert line.startswith("small: 60 of 1000 points, 2.5 points/s, 6.3 min left, ")
    assert " of about " in line


@pytest.mark.long
def test_the_size_is_that_of_the_whole(dataset):
    """Extrapolated from the first batches to within a fifth of what all the points take."""
    with dataset.opened(False):
        for first, last in ((0, 1), (1, 101), (101, 201)):
            dataset.write(measure_batch(dataset.campaign, first, last))
        _, about = dataset.size()
        for first in range(201, 1000, 100):
            dataset.write(measure_batch(dataset.campaign, first, min(first + 100, 1000)))
        whole, same = dataset.size()
    assert whole == same == sum(path.stat().st_size for path in dataset.folder.glob("*.parquet"))
    assert about == pytest.approx(whole, rel=0.2)


def test_times_and_sizes_in_words():
    """In the largest unit of which there are two."""
    assert [in_words(s) for s in (0.4, 90.0, 600.0, 7200.0, 5e6)] == [
        "0 s", "90 s", "10 min", "2 h", "58 d",
    ]  # fmt: skip
    assert sized(2.1e6, 4.1e9) == "0.0021 of about 4.1 GB"
