"""Tests of campaign results: quantiles, yields, variance shares and derivatives.

A share is the fraction of an output's variance that an input causes (Sobol index). A yield is the
fraction of points within a limit.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

import cam_rig
from cam_rig.dynamics import TwoMassParameters
from cam_rig.errors import ConfigError
from cam_rig.studies.campaign.campaign import make_point
from cam_rig.studies.campaign.draws import rows_of, unit_points
from cam_rig.studies.campaign.results import (
    InputShare,
    points_needed,
    proportion,
    quantile,
    saltelli_shares,
)
from cam_rig.studies.campaign.sensitivities import (
    FOLLOWER,
    first_orders,
    jump_sensitivities,
    touch_of,
)

from ...figure_faults import faults

MASS, PRELOAD = "rig.follower.mass", "rig.follower.preload"


def test_shares_of_ishigamis_function():
    """The variance shares of Ishigami's function equal their closed form within 0.01.

    The function is sin x₁ + 7 sin² x₂ + 0.1 x₃⁴ sin x₁. A constant function has shares of 0.
    """
    rows = rows_of("shares", 2**14, [1] * 3)
    x = math.pi * (2.0 * unit_points("shares", 2, rows, 3, 0, rows) - 1.0)
    values = np.sin(x[:, 0]) + 7.0 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])
    shares = saltelli_shares(values, ["a", "b", "c"], 1)
    assert [share.path for share in shares] == ["a", "b", "c"]
    assert [share.first for share in shares] == pytest.approx([0.3139, 0.4424, 0.0], abs=0.01)
    assert [share.total for share in shares] == pytest.approx([0.5576, 0.4424, 0.2437], abs=0.01)
    assert all(0.0 <= share.first_error < 0.06 for share in shares)
    constant = saltelli_shares(np.full(8 * 4, 3.0), ["a", "b"], 1)
    assert [(share.first, share.total) for share in constant] == [(0.0, 0.0)] * 2


@pytest.mark.parametrize("probability", [0.01, 0.5])
def test_an_interval_contains_its_quantile(probability):
    """The 95 % interval of a quantile contains its true value in 95 % of 400 samples.

    Three standard errors of the fraction are allowed.
    """
    random, exact = np.random.default_rng(5), norm.ppf(probability)
    count = 0
    for _ in range(400):
        result = quantile(np.sort(random.normal(size=1000)), probability)
        assert result.low <= result.value <= result.high
        count += result.low <= exact <= result.high
    assert count / 400 > 0.95 - 3.0 * math.sqrt(0.95 * 0.05 / 400)


@pytest.mark.parametrize(("probability", "needed"), [(0.01, 368), (0.05, 72), (0.5, 6)])
def test_a_quantile_needs_a_least_number_of_draws(probability, needed):
    """A quantile of too few random points for a 95 % interval is NaN.

    The smallest number n satisfies (1 − p)^n < 2.5 %, for example 368 points for p = 0.01.
    """
    assert math.isnan(quantile(np.zeros(0), probability).value)
    for p in (probability, 1.0 - probability):
        assert math.isnan(quantile(np.arange(needed - 1.0), p).value)
        result = quantile(np.arange(float(needed)), p)
        assert result.low <= result.value <= result.high
        assert result.needed == needed


def test_wide_shares_report_the_points_needed():
    """For variance shares with wide intervals the points needed for ±0.1 are reported.

    The width falls with the square root of the number, so ±0.4 at 32 points needs 512 points.
    """
    wide = InputShare("a", 0.8, 0.4, 0.8, 0.3)
    assert points_needed([wide], 32) == 512
    assert points_needed([InputShare("a", 0.8, 0.09, 0.8, 0.1)], 32) == 32


@pytest.mark.long
def test_first_order_counts_covariances(results, tmp_path):
    """The spread predicted from first derivatives includes correlations of the inputs.

    Preload and mass change the jump speed in opposite directions, so it varies less if they rise
    together. The prediction agrees with the observed spread within 5 %.
    """
    vary = {MASS: {"normal": 0.02, "unit": "%"}, PRELOAD: {"normal": 0.42, "unit": "%"}}
    plan = {"kind": "sobol", "points": 64, "seed": 1}
    pairs = [{"inputs": [MASS, PRELOAD], "coefficient": 0.95}]
    orders = []
    for name, correlation in (("alone", {}), ("together", {"correlated": pairs})):
        run = results(tmp_path / name, vary=vary, plan=plan, measures=["jump_speed"], **correlation)
        (order,) = first_orders(run)
        assert order.predicted == pytest.approx(order.observed, rel=0.05)
        assert order.correlated == bool(correlation)
        orders.append(order)
    alone, together = orders
    assert together.observed < 0.7 * alone.observed


def test_the_interval_of_a_yield_is_clopper_and_pearsons():
    """The 95 % interval of a yield is the Clopper-Pearson interval of a proportion."""
    share, low, high = proportion(5, 10)
    assert (share, low, high) == pytest.approx((0.5, 0.1871, 0.8129), abs=1e-4)
    assert proportion(10, 10) == pytest.approx((1.0, 0.6915, 1.0), abs=1e-4)
    assert proportion(0, 10) == pytest.approx((0.0, 0.0, 0.3085), abs=1e-4)


def test_yields_count_failed_points_as_broken(results, tmp_path):
    """In a yield, a point that could not be computed counts as outside the limit.

    The yield is the fraction of a campaign's points within a limit.
    """
    vary, limits = {MASS: {"values": [-1, 1, 1.3, 30], "unit": "kg"}}, ["jump_speed_rigid>=300rpm"]
    found = results(tmp_path, vary=vary, plan={"kind": "grid"}, limits=limits)
    assert found.failed == 1
    (limit_yield,) = found.yields()
    assert limit_yield.share == 0.5


def test_shares_of_a_campaign(results, tmp_path):
    """A campaign's variance shares attribute the jump speed's variance to the mass.

    The mass varies by 10 % and the preload by 1 %.
    """
    spread = {MASS: {"uniform": 10, "unit": "%"}, PRELOAD: {"uniform": 1, "unit": "%"}}
    found = results(tmp_path, vary=spread, plan={"kind": "shares", "points": 64})
    shares = {share.path: share for share in found.shares(found.campaign.measures[0])}
    assert shares[MASS].total == pytest.approx(1.0, abs=0.05)
    assert shares[PRELOAD].total < 0.02


def test_tables_omit_quantiles_that_need_more_points(results, tmp_path):
    """The tables of a campaign omit quantiles for which there are too few points.

    They state the number of points needed. With 8 points only the median is given.
    """
    result = results(tmp_path)
    with pytest.raises(ConfigError, match="whose plan is shares"):
        result.shares(result.campaign.measures[0])
    found, *_ = result.to_display()
    values, draws = zip(*((row[2], row[-1]) for row in found.text_rows), strict=True)
    assert [value == "–" for value in values] == [True, True, False, True, True]
    assert draws == ("368", "72", "6", "72", "368")
    data = result.data()
    assert [row["found"] for row in data["quantiles"]] == [False, False, True, False, False]
    assert data["campaign"]["points"] == len(result.to_pandas()) == 8
    assert result.to_pandas("quantiles").needed_draws.tolist() == [368, 72, 6, 72, 368]


PAIR = [{"inputs": [MASS, PRELOAD], "coefficient": 0.5}]


def test_a_tornado_has_warnings(results, tmp_path):
    """A tornado chart warns of fewer than 60 points and of correlated inputs.

    The chart compares the tenths of the points with the lowest and the highest value of an input.
    """
    vary = {path: {"uniform": 5, "unit": "%"} for path in (MASS, PRELOAD)}
    few = ["too few points (16) for tenths: needs 60", "correlated inputs: no bar is of"]
    for points, pairs, lines in ((16, PAIR, few), (60, [], [])):
        plan = {"kind": "latin_hypercube", "points": points}
        folder = tmp_path / str(points)
        figure = results(folder, vary=vary, correlated=pairs, plan=plan).plot()
        title = figure.axes[1].get_title().replace("\n", " ")
        assert all(line in title for line in lines) and bool(title) == bool(lines)
        assert faults(figure) == []


VARY = {
    **{f"rig.follower.{name}": {"uniform": 1, "unit": "%"} for name in FOLLOWER},
    "profile.size": {"values": [1e-5], "unit": "m"},
    "profile.eccentricity.amplitude": {"values": [2e-5], "unit": "m"},
    "profile.eccentricity.phase": {"values": [0.3], "unit": "rad"},
    "profile.waviness.amplitude": {"values": [1e-6], "unit": "m"},
    "profile.waviness.wavelength": {"values": [17.7], "unit": "deg"},
    "profile.waviness.phase": {"values": [1.1], "unit": "rad"},
}
#: Steps of the central differences in SI units. Rig parameters have a relative step of 2e-4
#: instead.
STEPS = {
    "profile.size": 5e-5,
    "profile.eccentricity.amplitude": 5e-6,
    "profile.eccentricity.phase": 0.03,
    "profile.waviness.amplitude": 1e-8,
    "profile.waviness.phase": 1e-3,
}
NO_DERIVATIVE = "profile.waviness.wavelength"


def exact_speed(point, duration):
    """Return the jump speed (rad/s) from `touch_of`.

    It is more precise than `jump_speed`.
    """
    return touch_of(point.law, TwoMassParameters.from_rig(point.rig), duration).speed


@pytest.mark.parametrize(
    ("duration", "every"),
    [(1.7, 4), *(pytest.param(time, 1, marks=pytest.mark.long) for time in (1.7, None))],
)
def test_derivatives_are_the_central_differences(study, duration, every):
    """The derivatives of the jump speed by the inputs equal central differences.

    They agree within a relative 1e-6 (Richardson extrapolation). The derivative with respect to a
    wavelength is None.
    """
    campaign = study(vary=VARY, measures=["jump_speed"])
    inputs = campaign.draws.middle()
    point = make_point(campaign, inputs)
    numbers = dict(zip(VARY, inputs.tolist(), strict=True))
    sensitivities = {item.path: item for item in jump_sensitivities(point, numbers, duration)}
    assert sensitivities[NO_DERIVATIVE].derivative is None
    for i, path in list(enumerate(VARY))[::every]:
        if path == NO_DERIVATIVE:
            continue

        def difference(step, i=i):
            ends = (inputs + sign * step * np.eye(inputs.size)[i] for sign in (1.0, -1.0))
            high, low = (exact_speed(make_point(campaign, item), duration) for item in ends)
            return (high - low) / (2.0 * step)

        h = STEPS.get(path, 2e-4 * inputs[i])
        expected = (4.0 * difference(h) - difference(2.0 * h)) / 3.0
        assert sensitivities[path].derivative == pytest.approx(expected, rel=1e-6), path


def test_a_rig_without_restitution_has_the_same_derivatives(study):
    """The derivatives of the jump speed do not need a restitution.

    The follower keeps contact up to the jump speed, so no landing occurs.
    """
    campaign = study(measures=["jump_speed"])
    complete = make_point(campaign, campaign.draws.middle())
    data = complete.rig.model_dump(exclude_none=True)
    del data["follower"]["restitution"]
    incomplete = replace(complete, rig=type(complete.rig).model_validate(data))
    paths = dict.fromkeys((f"rig.follower.{name}" for name in FOLLOWER), 0.0)
    sensitivities = jump_sensitivities(complete, paths, 1.7)
    assert sensitivities == jump_sensitivities(incomplete, paths, 1.7)
    assert None not in [item.derivative for item in sensitivities]


def test_the_touch_is_at_the_lift_off():
    """`touch_of` and `jump_speed` give the same speed, angle and turn on shipped cams.

    `touch_of` finds the instant at which the contact force just reaches zero at the jump speed. The
    speeds agree within a relative 1e-5 and the angles within 1°.
    """
    rig = cam_rig.load_rig("paper_table2")
    for name in ("poly345", "bezier15", "cycloidal"):
        law = cam_rig.build_law(cam_rig.load_cam(name))
        touch = touch_of(law, TwoMassParameters.from_rig(rig), 1.7)
        jump = cam_rig.jump_speed(law, rig)
        assert touch.speed == pytest.approx(jump.speed, rel=1e-5)
        turns, angle = divmod(touch.angle, 2.0 * math.pi)
        assert math.degrees(abs(angle - jump.angle)) < 1.0
        assert turns == np.floor(jump.time * jump.speed / (2.0 * math.pi))
