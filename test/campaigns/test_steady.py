"""A campaign's forces are those of the settled follower, each by its name's own definition."""

import numpy as np
import pytest

import cam_rig
from cam_rig.campaigns.campaign import campaign_from
from cam_rig.campaigns.dataset import CampaignDataset
from cam_rig.campaigns.measures import scene_at
from cam_rig.campaigns.point import make_point, measure_batch
from cam_rig.campaigns.results import CampaignResults
from cam_rig.campaigns.run import InThisProcess, run_campaign
from cam_rig.campaigns.steady import MOST_TURNS, SETTLED, steady_row
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.vibration import residual_vibration
from cam_rig.errors import ConfigError
from cam_rig.law_design.terms import parse_limit
from cam_rig.schema.load import Library, config_root
from cam_rig.units import RPM

PRELOAD = {"rig.follower.preload": {"values": [30.6], "unit": "N"}}


def measured(study, *measures, vary=PRELOAD, **parts):
    campaign = study(vary=vary, measures=list(measures), plan={"kind": "grid"}, **parts)
    return campaign, measure_batch(campaign, 0, campaign.total)


def forces_of(study, model, rpm, **base):
    base = {"cam": "poly345", "rig": "paper_table2", "model": model} | base
    names = [f"{name}_contact_force@{rpm}rpm" for name in ("least", "peak")]
    return measured(study, *names, base=base)[1]


@pytest.mark.variants(2)
@pytest.mark.parametrize("model", ["two_mass", "elastic_stem"])
@pytest.mark.parametrize("cam", ["poly345", "cycloidal", "bezier15"])
def test_forces_in_contact_are_of_the_steady_state(study, model, cam):
    """To 1e-6 of those of a long run, and between its samples too."""
    found = forces_of(study, model, 290, cam=cam).measures[0]
    law, rig = cam_rig.build_law(cam_rig.load_cam(cam)), cam_rig.load_rig("paper_table2")
    motion = cam_rig.simulate(law, rig, model=model, rpm=290, turns=40, sample_rate=1_000_000)
    force = motion.force[motion.time > 38 * 60 / 290]
    assert found == pytest.approx([force.min(), force.max()], abs=1e-5 * force.max())
    assert found[0] <= force.min() * (1.0 + 1e-6)
    assert found[1] >= force.max() * (1.0 - 1e-6)


@pytest.mark.parametrize("model", ["kinetostatic", "one_mass", "two_mass", "elastic_stem"])
def test_forces_do_not_depend_on_the_turns_of_the_scene(study, model):
    """Of two turns or ten: a settled follower does the same in each of them."""
    campaign, _ = measured(study, "peak_contact_force@300rpm", base={
        "cam": "poly345", "rig": "paper_table2", "model": model})  # fmt: skip
    point = make_point(campaign, np.array([30.6]))
    rows = []
    for turns in (2.0, 10.0):
        program = point.scene.program.model_copy(
            update={"turns": point.scene.program.turns.model_copy(update={"assumed": turns})}
        )
        scene = scene_at(point.scene.model_copy(update={"program": program}), 300 * RPM)
        row, settled = steady_row(point.law, point.rig, scene, 300 * RPM)
        assert settled
        rows.append([row.force_peak, row.force_least, row.torque_peak, row.level_db])
    assert rows[0] == pytest.approx(rows[1], rel=SETTLED)


def test_a_follower_that_lifts_off_is_settled_or_said_not_to_be(study):
    """Above the jump speed its flights repeat turn by turn; where not, the row says it."""
    _, rows = measured(study, "lift_offs@450rpm", "peak_contact_force@450rpm")
    assert rows.status == ["ok"]
    assert rows.measures[0, 0] > 0.0
    stiff = {"rig.follower.restitution": {"values": [0.9], "unit": "1"}}
    _, rows = measured(study, "peak_contact_force@900rpm", vary=stiff)
    assert rows.status == ["unsettled"]
    assert f"not settled to 1e-06 in {MOST_TURNS} turns" in rows.reasons[0]
    assert np.isfinite(rows.measures).all()


def test_what_does_not_settle_is_told_with_the_tables(study, tmp_path):
    """How many points, and of which turns their numbers are."""
    stiff = {"rig.follower.restitution": {"values": [0.0, 0.9], "unit": "1"}}
    campaign = study(vary=stiff, measures=["peak_contact_force@900rpm"], plan={"kind": "grid"})
    dataset = CampaignDataset(tmp_path / "rows", campaign)
    with dataset.opened(False):
        run_campaign(dataset, InThisProcess(), 1)
    results = CampaignResults(dataset)
    assert results.failed == 0
    assert "of 2 points" in results.unsettled
    assert f"in {MOST_TURNS} turns" in results.unsettled


def test_one_rigid_mass_is_the_same_by_either_name(study):
    """The scene's model one_mass gives what the names of one rigid mass do, and two masses not."""
    names = [f"{n}_contact_force{r}@300rpm" for r in ("", "_rigid") for n in ("peak", "least")]
    base = {"cam": "poly345", "rig": "paper_table2"}
    _, rigid = measured(study, *names, base=base | {"model": "one_mass"})
    assert rigid.measures[0, :2] == pytest.approx(rigid.measures[0, 2:], rel=1e-9)
    _, two = measured(study, *names, base=base | {"model": "two_mass"})
    assert two.measures[0, 2:] == pytest.approx(rigid.measures[0, 2:], rel=1e-12)
    assert two.measures[0, 0] > 1.02 * two.measures[0, 2]
    assert two.measures[0, 1] < 0.8 * two.measures[0, 3]


def test_titles_say_the_model(study):
    """A number of a run is nothing without it."""
    for model, words in {"two_mass": "of two masses", "one_mass": "of one rigid mass"}.items():
        base = {"cam": "poly345", "rig": "paper_table2", "model": model}
        campaign, _ = measured(study, "peak_contact_force@300rpm", base=base)
        assert words in campaign.measures[0].term.words


@pytest.mark.parametrize(
    ("goal", "limit"),
    [
        ("peak_acceleration", "peak_contact_force_rigid@450rpm<=252N"),
        ("peak_contact_force_rigid@300rpm", "least_contact_force_rigid@400rpm>=14N"),
        ("peak_acceleration", "jump_speed_rigid>=455rpm"),
    ],
)
def test_a_limit_kept_in_a_design_is_kept_in_a_campaign(tmp_path, goal, limit):
    """The same name is the same number of the same cam, to 1e-9."""
    rig = cam_rig.load_rig("paper_table2")
    start = cam_rig.load_cam("poly345")
    found = cam_rig.design(start, rig, minimise=goal, limits=[limit], pieces=4)
    path = tmp_path / "cams" / "designed_here.yaml"
    path.parent.mkdir()
    path.write_text(found.text, encoding="utf-8")
    names = list(dict.fromkeys(text.partition("<")[0].partition(">")[0] for text in (limit, goal)))
    shared = [name for name in names if "acceleration" not in name]
    campaign = campaign_from(
        {
            "name": "check", "title": "check",
            "base": {"cam": str(path), "rig": "paper_table2"},
            "vary": PRELOAD, "plan": {"kind": "grid"},
            "measures": shared, "limits": [limit],
        },
        Library((tmp_path, config_root())),
    )  # fmt: skip
    rows = measure_batch(campaign, 0, 1)
    for column, name in enumerate(shared):
        told = next(one for one in found.measures if one.term.key == name)
        factor = campaign.measures[column].factor
        assert rows.measures[0, column] * factor == pytest.approx(told.result, rel=1e-9), name
    asked = parse_limit(limit)
    sign = 1.0 if asked.sense == "<=" else -1.0
    value = rows.measures[0, 0] * campaign.measures[0].factor
    assert sign * value <= sign * asked.value * (1.0 + sign * 1e-9)


@pytest.mark.parametrize(
    ("measure", "instead"),
    [("residual_vibration@300rpm", "residual_vibration_steady"), ("jump_sped", "jump_speed")],
)
def test_a_name_with_another_meaning_is_refused_with_its_own(study, measure, instead):
    """What a design calls residual vibration one event leaves; a campaign's is the steady state."""
    with pytest.raises(ConfigError, match=f"did you mean '{instead}'"):
        measured(study, measure)


def test_steady_vibration_is_that_of_the_whole_turn(study):
    """What the events leave meets what is left of the turns before: not what one event leaves."""
    _, rows = measured(study, "residual_vibration_steady@300rpm")
    cam, rig = cam_rig.load_cam("poly345"), cam_rig.load_rig("paper_table2")
    law = cam_rig.build_law(cam)
    one = cam_rig.design(cam, rig, minimise="residual_vibration@300rpm", pieces=4)
    steady = residual_vibration(law, FollowerParameters.from_rig(rig), np.array([300.0 * RPM]))
    assert rows.measures[0, 0] == pytest.approx(steady[0], rel=1e-12)
    assert rows.measures[0, 0] > 2.0 * one.goal.start
