"""From the unit cube to numbers: distributions, correlations, zero spread."""

import numpy as np
import pytest
from scipy.stats import kstest, norm, spearmanr, truncnorm, uniform

from cam_rig.campaigns.inputs import paths_of, with_numbers
from cam_rig.errors import ConfigError
from cam_rig.schema.load import config_root, load_cam, load_rig

PRELOAD, MASS = "rig.follower.preload", "rig.follower.mass"


def column(study, variation, path=PRELOAD, points=4096):
    plan = {"kind": "sobol", "points": points}
    return study(vary={path: variation}, plan=plan).draws.rows(0, points)[:, 0]


@pytest.mark.parametrize(
    ("variation", "expected"),
    [
        ({"normal": 10, "unit": "%"}, norm(30.6, 3.06)),
        ({"normal": 2, "unit": "N"}, norm(30.6, 2.0)),
        ({"normal": 2, "mean": 25, "unit": "N"}, norm(25.0, 2.0)),
        ({"normal": 2, "within": 3, "unit": "N"}, truncnorm(-1.5, 1.5, 30.6, 2.0)),
        ({"uniform": 10, "unit": "%"}, uniform(0.9 * 30.6, 0.2 * 30.6)),
        ({"range": [20, 60], "unit": "N"}, uniform(20.0, 40.0)),
        ({"range": [-50, 100], "unit": "%"}, uniform(15.3, 45.9)),
    ],
)
def test_numbers_are_of_their_distribution(study, variation, expected):
    """Sobol's points are far more even than random ones: the distance is 1 of their number."""
    drawn = column(study, variation)
    assert kstest(drawn, expected.cdf).statistic < 1e-3
    assert drawn.mean() == pytest.approx(expected.mean(), rel=1e-3)


def test_a_list_is_drawn_evenly_and_a_unit_is_taken_to_si(study):
    """Of five values each takes a fifth; percents count from the base's number."""
    drawn = column(study, {"values": [1, 2, 4, 8, 16], "unit": "N"}, points=1000)
    found, counts = np.unique(drawn, return_counts=True)
    assert found.tolist() == [1.0, 2.0, 4.0, 8.0, 16.0]
    assert np.abs(counts - 200).max() <= 2
    grams = column(study, {"values": [1300], "unit": "g"}, MASS, 2)
    assert grams.tolist() == [1.3, 1.3]


@pytest.mark.parametrize("variation", [{"normal": 0, "unit": "%"}, {"uniform": 0, "unit": "N"}])
def test_zero_spread_is_the_base_exactly(study, variation):
    """Every point is the base's number, bit for bit."""
    assert set(column(study, variation, points=64).tolist()) == {30.6}


def test_correlated_inputs_keep_their_distributions(study):
    """The normal numbers behind them have the coefficient; rows are the same in any batch."""
    vary = {PRELOAD: {"uniform": 10, "unit": "%"}, MASS: {"normal": 2, "unit": "%"}}
    pair = {"inputs": [PRELOAD, MASS], "coefficient": 0.8}
    plan = {"kind": "sobol", "points": 4096}
    draws = study(vary=vary, correlated=[pair], plan=plan).draws
    rows = draws.rows(0, 4096)
    expected = 6.0 / np.pi * np.arcsin(0.4)  # Spearman's, of a Gaussian copula
    assert spearmanr(rows).statistic == pytest.approx(expected, abs=0.005)
    assert kstest(rows[:, 1], norm(1.3, 0.026).cdf).statistic < 4e-3
    assert np.array_equal(np.concatenate([draws.rows(0, 7), draws.rows(7, 40)]), rows[:40])


def test_correlations_that_no_numbers_have_are_refused(study):
    """Three pairs that contradict each other."""
    paths = [PRELOAD, MASS, "rig.follower.spring_stiffness"]
    pairs = [
        {"inputs": [paths[i], paths[j]], "coefficient": r}
        for i, j, r in ((0, 1, 0.9), (1, 2, 0.9), (0, 2, -0.9))
    ]
    vary = {path: {"uniform": 1, "unit": "%"} for path in paths}
    with pytest.raises(ConfigError, match="no numbers have these correlations"):
        study(vary=vary, correlated=pairs).draws


@pytest.mark.parametrize("folder", ["cams", "rigs"])
def test_every_number_of_a_shipped_file_can_be_put_back(folder):
    """By its path; another value arrives where it was put, and nowhere else."""
    load = {"cams": load_cam, "rigs": load_rig}[folder]
    for path in sorted((config_root() / folder).glob("*.yaml")):
        config = load(path)
        known = {key: value for key, (value, _) in paths_of({"x": config}).items() if key[0] == "x"}
        for key, value in list(known.items())[:40]:
            same = with_numbers(config, {key.removeprefix("x."): value})
            again = {key: value for key, (value, _) in paths_of({"x": same}).items()}
            assert again[key] == pytest.approx(value, rel=1e-15)
            assert {k: v for k, v in again.items() if k[0] == "x" and k != key} == {
                k: v for k, v in known.items() if k != key
            }
