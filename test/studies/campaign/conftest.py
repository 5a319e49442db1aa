"""Fixtures for tests of campaigns: small studies and their results.

A campaign computes measures, such as the jump speed, at many points of varied inputs.
"""

import pytest

from cam_rig.datasets.batches import SerialExecutor, compute_missing
from cam_rig.schema.load import Library, config_root
from cam_rig.studies.campaign.campaign import batch_task, campaign_from, measure_batch
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
    """Function that returns a small campaign on the 3-4-5 cam.

    A campaign is a batch of simulations with varied inputs. Keyword arguments replace entries of
    SMALL, for example `plan` or `vary`.
    """
    return lambda **parts: campaign_from(SMALL | parts, Library((config_root(),)))


@pytest.fixture(scope="session")
def measured(study):
    """Function that computes measures at all points of a small campaign.

    It returns (campaign, rows). Without `vary` there is one point with the nominal preload.
    """

    def measure(*measures, vary=None, **parts):
        vary = vary or {"rig.follower.preload": {"values": [30.6], "unit": "N"}}
        campaign = study(vary=vary, measures=list(measures), plan={"kind": "grid"}, **parts)
        return campaign, measure_batch(campaign, 0, campaign.total)

    return measure


def run(dataset, resume=False):
    """Compute the missing points of a campaign, and return a warning of damaged files."""
    with dataset.open(resume) as damaged:
        compute_missing(dataset, batch_task, SerialExecutor(), 1)
    return damaged


@pytest.fixture(scope="session")
def results(study):
    """Function that computes a campaign in a folder and returns its `CampaignResult`."""

    def compute(folder, **parts):
        dataset = CampaignDataset(folder, study(**parts))
        run(dataset)
        return CampaignResult(dataset)

    return compute
