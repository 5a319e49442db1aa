"""The campaign of the bench: its peer finds the same speeds, and may be missing."""

import sys

import pytest

from benchmark.speed import campaign
from benchmark.speed.campaign import (
    BATCH,
    STUDY,
    CampaignRate,
    bisected,
    campaign_rate,
    campaign_records,
    leaves,
)
from benchmark.speed.cases import rad_per_s
from cam_rig.campaigns.campaign import campaign_from, make_point, measure_batch
from cam_rig.dynamics import TwoMassParameters
from cam_rig.schema.load import Library, config_root


def test_the_peer_loses_contact_where_the_campaign_says():
    """CVODE's contact force of 1.7 s from rest has a root from 1e-4 above the jump speed on."""
    found = campaign_from({**STUDY, "plan": {"kind": "sobol", "points": 2}}, library())
    rows = measure_batch(found, 0, 1)
    p = TwoMassParameters.from_rig(make_point(found, rows.inputs[0]).rig)
    speed = rad_per_s(float(rows.measures[0, 0]))
    assert not leaves(p, found.law, speed * (1.0 - 1e-4))
    assert leaves(p, found.law, speed * (1.0 + 1e-4))


def library():
    return Library((config_root(),))


def test_the_peer_halves_down_to_the_speed(monkeypatch):
    """A loss of contact from 300.1 rpm on, from a bracket about 300."""
    monkeypatch.setattr(campaign, "leaves", lambda _p, _law, speed: speed > rad_per_s(300.1))
    assert bisected(None, None, 300.0) == pytest.approx(300.1, abs=0.05)


def test_without_joblib_the_campaign_stands_alone(monkeypatch):
    """With the line that says what is missing, and the remedy."""
    monkeypatch.setitem(sys.modules, "joblib", None)
    found = campaign_rate(2, True)
    assert (found.processes, found.points, found.ratio) == (1, BATCH, None)
    assert found.points_per_s > 0.0
    (note,) = campaign_records(found).notes
    assert "joblib" in note and "pip install" in note


def test_the_table_has_the_ratio():
    """Of 25 points a second to 0.25: a hundred times as long."""
    (table,) = campaign_records(CampaignRate(2, 100, 25.0, 2, 0.25, 0.016)).to_show()
    assert [row[-1] for row in table.texts] == ["1", "100"]
    assert "0.016 rpm" in table.notes[0]
