"""Distributions and tornado: what few points or correlated inputs do not tell stands over it."""

import pytest

from cam_rig.campaigns.campaign import campaign_from
from cam_rig.campaigns.dataset import CampaignDataset
from cam_rig.campaigns.figures import distributions
from cam_rig.campaigns.results import CampaignResults
from cam_rig.campaigns.run import InThisProcess, run_campaign
from cam_rig.schema.load import Library, config_root

from ..figure_faults import faults

MASS, PRELOAD = "rig.follower.mass", "rig.follower.preload"
PAIR = [{"inputs": [MASS, PRELOAD], "coefficient": 0.5}]


@pytest.mark.variants(2)
@pytest.mark.parametrize(
    ("points", "pairs", "lines"),
    [
        (16, PAIR, ["too few points (16) for tenths: needs 60", "correlated inputs: no bar is of"]),
        (59, [], ["too few points (59) for tenths: needs 60"]),
        (60, [], []),
    ],
)
def test_a_tornado_says_what_it_does_not_tell(tmp_path, points, pairs, lines):
    """A tenth of 60 points has the six that the interval of a median takes."""
    study = {
        "name": "small",
        "title": "a small campaign",
        "base": {"cam": "poly345", "rig": "paper_table2"},
        "vary": {path: {"uniform": 5, "unit": "%"} for path in (MASS, PRELOAD)},
        "correlated": pairs,
        "plan": {"kind": "latin_hypercube", "points": points},
        "measures": ["jump_speed_rigid"],
    }
    dataset = CampaignDataset(tmp_path, campaign_from(study, Library((config_root(),))))
    with dataset.opened(False):
        run_campaign(dataset, InThisProcess(), 1)
    figure = distributions(CampaignResults(dataset))
    title = figure.axes[1].get_title().replace("\n", " ")
    assert [line in title for line in lines] == [True] * len(lines)
    assert bool(title) == bool(lines)
    assert faults(figure) == []
