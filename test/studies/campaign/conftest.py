"""Studies made on the spot, and what comes of them."""

import pytest

from cam_rig.datasets.batches import InThisProcess, compute_missing
from cam_rig.schema.load import Library, config_root
from cam_rig.studies.campaign.campaign import campaign_from, measure_batch
from cam_rig.studies.campaign.dataset import CampaignDataset
from cam_rig.studies.campaign.results import CampaignResult

SMALL = {
    "name": "small",
    "title": "a small campaign",
    "base": {"cam": "poly345", "rig": "paper_table2"},
    "vary": {"rig.follower.preload": {"uniform": 10, "unit": "%"}},
    "plan": {"kind": "sobol", "points": 8, "seed": 3},
    "measures": ["jump_speed_rigid"],
}


@pytest.fixture(scope="session")
def study():
    """A campaign of 3-4-5 on the paper's rig, with other parts where they are given."""

    return lambda **parts: campaign_from(SMALL | parts, Library((config_root(),)))


@pytest.fixture(scope="session")
def measured(study):
    """All points of a grid, by default of one: the campaign and its rows."""

    def made(*measures, vary=None, **parts):
        vary = vary or {"rig.follower.preload": {"values": [30.6], "unit": "N"}}
        campaign = study(vary=vary, measures=list(measures), plan={"kind": "grid"}, **parts)
        return campaign, measure_batch(campaign, 0, campaign.total)

    return made


def run(dataset, resume=False):
    """Make what is missing in this process; what is said of damaged files."""
    with dataset.opened(resume) as damaged:
        compute_missing(dataset, measure_batch, InThisProcess(), 1)
    return damaged


@pytest.fixture(scope="session")
def results(study):
    """The result of a campaign, made in this process."""

    def made(folder, **parts):
        dataset = CampaignDataset(folder, study(**parts))
        run(dataset)
        return CampaignResult(dataset)

    return made
