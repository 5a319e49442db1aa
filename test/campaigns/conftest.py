"""Studies made on the spot."""

import pytest

from cam_rig.campaigns.campaign import campaign_from
from cam_rig.schema.load import Library, config_root


@pytest.fixture(scope="session")
def study():
    """A campaign of 3-4-5 on the paper's rig, with other parts where they are given."""

    def made(**parts):
        data = {
            "name": "small",
            "title": "a small campaign",
            "base": {"cam": "poly345", "rig": "paper_table2"},
            "vary": {"rig.follower.preload": {"uniform": 10, "unit": "%"}},
            "plan": {"kind": "sobol", "points": 8, "seed": 3},
            "measures": ["jump_speed_rigid"],
        }
        return campaign_from(data | parts, Library((config_root(),)))

    return made
