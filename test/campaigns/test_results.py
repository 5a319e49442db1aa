"""Quantiles and yields with their errors, shares of a known function."""

import math

import numpy as np
import pytest
from scipy.stats import norm

from cam_rig.campaigns.dataset import CampaignDataset
from cam_rig.campaigns.draws import rows_of, unit_points
from cam_rig.campaigns.results import (
    CampaignResults,
    InputShare,
    points_needed,
    proportion,
    quantile,
    saltelli_shares,
)
from cam_rig.campaigns.run import InThisProcess, run_campaign
from cam_rig.campaigns.sensitivities import first_orders
from cam_rig.campaigns.tables import derivative_table, quantile_table
from cam_rig.errors import ConfigError


def test_shares_of_ishigamis_function():
    """sin x₁ + 7 sin² x₂ + 0.1 x₃⁴ sin x₁ has shares in closed form."""
    rows = rows_of("shares", 2**14, [1] * 3)
    x = math.pi * (2.0 * unit_points("shares", 2, rows, 3, 0, rows) - 1.0)
    values = np.sin(x[:, 0]) + 7.0 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])
    found = saltelli_shares(values, ["a", "b", "c"], 1)
    assert [one.path for one in found] == ["a", "b", "c"]
    assert [one.first for one in found] == pytest.approx([0.3139, 0.4424, 0.0], abs=0.01)
    assert [one.total for one in found] == pytest.approx([0.5576, 0.4424, 0.2437], abs=0.01)
    assert all(0.0 <= one.first_error < 0.06 for one in found)


def test_shares_of_what_does_not_vary_are_zero():
    """No spread, no share of it."""
    found = saltelli_shares(np.full(8 * 4, 3.0), ["a", "b"], 1)
    assert [(one.first, one.total) for one in found] == [(0.0, 0.0)] * 2


@pytest.mark.parametrize("probability", [0.01, 0.5, 0.95])
def test_an_interval_holds_its_quantile(probability):
    """In 95 of 100 samples or more, within what 400 samples tell."""
    random, exact = np.random.default_rng(5), norm.ppf(probability)
    held = 0
    for _ in range(400):
        one = quantile(np.sort(random.normal(size=1000)), probability)
        assert one.low <= one.value <= one.high
        held += one.low <= exact <= one.high
    assert held / 400 > 0.95 - 3.0 * math.sqrt(0.95 * 0.05 / 400)


def test_a_small_sample_says_what_it_cannot_tell():
    """Ten points have no upper bound of their 99 % quantile, and so not itself; none nothing."""
    few = quantile(np.arange(10.0), 0.99)
    assert math.isnan(few.high) and math.isnan(few.value)
    assert math.isnan(quantile(np.zeros(0), 0.5).value)


@pytest.mark.parametrize(("probability", "needed"), [(0.01, 368), (0.05, 72), (0.5, 6)])
def test_a_quantile_is_told_from_so_many_draws_on(probability, needed):
    """The textbook's numbers: 0.99^368 < 2.5 %, so that a draw lies below it; of both ends."""
    for p in (probability, 1.0 - probability):
        assert math.isnan(quantile(np.arange(needed - 1.0), p).value)
        told = quantile(np.arange(float(needed)), p)
        assert told.low <= told.value <= told.high
        assert told.needed == needed


def test_wide_shares_say_how_many_points_would_do():
    """Half a width of 0.4 of 32 points is 0.1 of 16 times as many; narrow ones need no more."""
    wide = InputShare("a", 0.8, 0.4, 0.8, 0.3)
    assert points_needed([wide], 32) == 512
    assert points_needed([InputShare("a", 0.8, 0.09, 0.8, 0.1)], 32) == 32


@pytest.mark.long
def test_first_order_counts_covariances(study, tmp_path):
    """Of Ω ~ √(preload/mass): where both rise together it stays nearly where it is."""
    mass, preload = "rig.follower.mass", "rig.follower.preload"
    vary = {mass: {"normal": 0.02, "unit": "%"}, preload: {"normal": 0.42, "unit": "%"}}
    plan = {"kind": "sobol", "points": 64, "seed": 1}
    pairs = [{"inputs": [mass, preload], "coefficient": 0.95}]
    found = []
    for name, more in (("alone", {}), ("together", {"correlated": pairs})):
        run = results(study, tmp_path / name, vary=vary, plan=plan, measures=["jump_speed"], **more)
        (one,) = first_orders(run)
        assert one.predicted == pytest.approx(one.found, rel=0.05)
        assert derivative_table(one).notes[0].count("covariances") == len(more)
        found.append(one)
    alone, together = found
    assert together.found < 0.7 * alone.found


def test_the_interval_of_a_yield_is_clopper_and_pearsons():
    """Their textbook case; and a yield of all or nothing has an end of its own."""
    share, low, high = proportion(5, 10)
    assert (share, low, high) == pytest.approx((0.5, 0.1871, 0.8129), abs=1e-4)
    assert proportion(10, 10) == pytest.approx((1.0, 0.6915, 1.0), abs=1e-4)
    assert proportion(0, 10) == pytest.approx((0.0, 0.0, 0.3085), abs=1e-4)


def results(study, folder, **parts):
    dataset = CampaignDataset(folder, study(**parts))
    with dataset.opened(False):
        run_campaign(dataset, InThisProcess(), 1)
    return CampaignResults(dataset)


def test_yields_count_failed_points_as_lost(study, tmp_path):
    """Of four rigs one has no mass above zero, one jumps too early."""
    found = results(
        study,
        tmp_path,
        vary={"rig.follower.mass": {"values": [-1, 1, 1.3, 30], "unit": "kg"}},
        plan={"kind": "grid"},
        limits=["jump_speed_rigid>=300rpm"],
    )
    assert found.failed == 1
    (one,) = found.yields()
    assert one.share == 0.5


def test_shares_of_a_campaign(study, tmp_path):
    """Jump speed goes with 1/√mass: at 10 % against 1 % mass has nearly all of the variance."""
    mass, preload = "rig.follower.mass", "rig.follower.preload"
    spread = {mass: {"uniform": 10, "unit": "%"}, preload: {"uniform": 1, "unit": "%"}}
    found = results(study, tmp_path, vary=spread, plan={"kind": "shares", "points": 64})
    shares = {one.path: one for one in found.shares(found.campaign.measures[0])}
    assert shares[mass].total == pytest.approx(1.0, abs=0.05)
    assert shares[preload].total < 0.02


@pytest.mark.long
def test_a_quantile_is_within_its_error_of_a_ten_times_larger_run(study, tmp_path):
    """The 1 % quantile, of random draws on a Latin hypercube."""
    mass, preload = "rig.follower.mass", "rig.follower.preload"
    vary = {mass: {"normal": 5, "unit": "%"}, preload: {"normal": 5, "unit": "%"}}
    found = []
    for points in (400, 4000):
        plan = {"kind": "latin_hypercube", "points": points, "seed": points}
        one = results(study, tmp_path / str(points), vary=vary, plan=plan)
        found.append(one.quantiles(one.campaign.measures[0])[0])
    few, many = found
    assert few.probability == 0.01
    assert few.low < many.value < few.high
    assert many.high - many.low < 0.5 * (few.high - few.low)


def test_shares_need_their_plan(study, tmp_path):
    """Refused in a line for any other."""
    found = results(study, tmp_path)
    with pytest.raises(ConfigError, match="whose plan is shares"):
        found.shares(found.campaign.measures[0])


def test_tables_say_what_few_points_do_not_tell(study, tmp_path):
    """Of 8 draws the median, and of no other quantile a number."""
    found = quantile_table(results(study, tmp_path))
    texts = [row[-1] for row in found.texts]
    assert texts[2] == ""
    assert texts[0] == texts[4] == "not found"
    assert found.notes[0] == (
        "Not found: needs at least 368 draws for 1 % and 99 %, 72 draws for 5 % and 95 %."
    )
    assert [row[2] != "" for row in found.texts] == [False, False, True, False, False]
