"""Tests of a campaign's random inputs, and of errors added to a cam profile.

The inputs of a point depend only on its index in the plan. The errors are those of manufacture.
"""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.stats import kstest, norm, qmc, spearmanr, truncnorm, uniform

from cam_rig.errors import ConfigError
from cam_rig.schema.load import config_root, load_cam, load_rig
from cam_rig.studies.campaign.draws import grid_indices, rows_of, unit_points
from cam_rig.studies.campaign.inputs import ProfileErrors, paths_of, with_numbers
from cam_rig.units import TURN

KINDS = ("latin_hypercube", "sobol", "shares")


@pytest.mark.parametrize("kind", KINDS)
def test_a_point_is_the_same_in_any_batch(kind):
    """A campaign's inputs at a point do not depend on the batch of the point.

    A point is one simulation of the campaign. The inputs lie strictly inside the unit cube and
    change with the seed.
    """
    first, second = (unit_points(kind, seed, 64, 2, 0, 64) for seed in (1, 2))
    assert not (first == second).any()
    total = rows_of(kind, 64, [1] * 3)
    whole = unit_points(kind, 7, total, 3, 0, total)
    assert whole.shape == (total, 3)
    assert 0.0 < whole.min() < whole.max() < 1.0
    edges = [0, 1, 2, 17, 40, total - 1, total]
    parts = [unit_points(kind, 7, total, 3, a, b) for a, b in pairwise(edges)]
    assert np.array_equal(np.concatenate(parts), whole)


def test_a_latin_hypercube_meets_each_stratum_once():
    """In each dimension of a Latin hypercube every stratum has exactly one point.

    The order of the strata differs between dimensions.
    """
    for total in (1, 2, 3, 5, 64, 100, 1021):
        points = unit_points("latin_hypercube", 5, total, 3, 0, total)
        for column in points.T:
            assert sorted(np.floor(column * total).astype(int).tolist()) == list(range(total))
        if total > 5:
            assert not np.array_equal(np.argsort(points[:, 0]), np.argsort(points[:, 1]))


def test_the_sobol_sequence_is_scipys():
    """The Sobol points of a campaign are scipy's, moved to the middle of their cell.

    A cell is an interval of 2^-30.
    """
    ours = unit_points("sobol", 9, 128, 4, 0, 128)
    theirs = qmc.Sobol(4, scramble=True, rng=9).random_base2(7)
    assert np.abs(ours - theirs).max() < 2.0**-30
    assert qmc.discrepancy(ours) == pytest.approx(qmc.discrepancy(theirs), rel=1e-6)


def test_shares_are_saltellis_rows():
    """The plan `shares` has the points of Saltelli's scheme for sensitivity indices.

    Each block has d + 2 points for d inputs: a, then a with the i-th number of b for each input i,
    then b.
    """
    rows = unit_points("shares", 1, 8 * 5, 3, 0, 8 * 5).reshape(8, 5, 3)
    a, b = rows[:, 0], rows[:, -1]
    assert not (a == b).any()
    for axis in range(3):
        mixed = a.copy()
        mixed[:, axis] = b[:, axis]
        assert np.array_equal(rows[:, 1 + axis], mixed)


def test_a_grid_has_every_combination_once():
    """A grid of a campaign has every combination of the listed values once.

    The last input varies fastest.
    """
    indices = grid_indices([2, 3, 4], 0, 24)
    assert len({tuple(row) for row in indices.tolist()}) == 24
    assert indices[:5].tolist() == [[0, 0, 0], [0, 0, 1], [0, 0, 2], [0, 0, 3], [0, 1, 0]]
    assert np.array_equal(grid_indices([2, 3, 4], 7, 11), indices[7:11])
    assert rows_of("grid", None, [2, 3, 4]) == 24


PRELOAD, MASS = "rig.follower.preload", "rig.follower.mass"


def column(study, variation, path=PRELOAD, points=4096):
    plan = {"kind": "sobol", "points": points}
    return study(vary={path: variation}, plan=plan).draws.rows(0, points)[:, 0]


DISTRIBUTIONS = (
    ({"normal": 10, "unit": "%"}, norm(30.6, 3.06)),
    ({"normal": 2, "unit": "N"}, norm(30.6, 2.0)),
    ({"normal": 2, "mean": 25, "unit": "N"}, norm(25.0, 2.0)),
    ({"normal": 2, "within": 3, "unit": "N"}, truncnorm(-1.5, 1.5, 30.6, 2.0)),
    ({"uniform": 10, "unit": "%"}, uniform(0.9 * 30.6, 0.2 * 30.6)),
    ({"range": [20, 60], "unit": "N"}, uniform(20.0, 40.0)),
    ({"range": [-50, 100], "unit": "%"}, uniform(15.3, 45.9)),
)


def test_numbers_follow_their_distribution(study):
    """The drawn inputs of a campaign follow the requested distributions.

    The Kolmogorov-Smirnov distance of 4096 Sobol points is below 1e-3, less than random points
    reach.
    """
    for variation, expected in DISTRIBUTIONS:
        drawn = column(study, variation)
        assert kstest(drawn, expected.cdf).statistic < 1e-3
        assert drawn.mean() == pytest.approx(expected.mean(), rel=1e-3)


def test_a_list_is_drawn_evenly_and_a_unit_is_taken_to_si(study):
    """Each value of a list is drawn equally often (200 ± 2 of 1000), in SI units."""
    drawn = column(study, {"values": [1, 2, 4, 8, 16], "unit": "N"}, points=1000)
    numbers, counts = np.unique(drawn, return_counts=True)
    assert numbers.tolist() == [1.0, 2.0, 4.0, 8.0, 16.0]
    assert np.abs(counts - 200).max() <= 2
    grams = column(study, {"values": [1300], "unit": "g"}, MASS, 2)
    assert grams.tolist() == [1.3, 1.3]


def test_zero_spread_is_the_base_exactly(study):
    """An input with a spread of zero has exactly the number of the base files."""
    for variation in ({"normal": 0, "unit": "%"}, {"uniform": 0, "unit": "N"}):
        assert set(column(study, variation, points=64).tolist()) == {30.6}


def test_correlated_inputs_keep_their_distributions(study):
    """Correlated inputs keep their distributions and have the given correlation.

    Spearman's coefficient is that of a Gaussian copula within 0.005. The drawn values do not depend
    on the batch.
    """
    vary = {PRELOAD: {"uniform": 10, "unit": "%"}, MASS: {"normal": 2, "unit": "%"}}
    pair = {"inputs": [PRELOAD, MASS], "coefficient": 0.8}
    plan = {"kind": "sobol", "points": 4096}
    draws = study(vary=vary, correlated=[pair], plan=plan).draws
    rows = draws.rows(0, 4096)
    expected = 6.0 / np.pi * np.arcsin(0.4)  # Spearman's coefficient of a Gaussian copula
    assert spearmanr(rows).statistic == pytest.approx(expected, abs=0.005)
    assert kstest(rows[:, 1], norm(1.3, 0.026).cdf).statistic < 4e-3
    assert np.array_equal(np.concatenate([draws.rows(0, 7), draws.rows(7, 40)]), rows[:40])


def test_contradicting_correlations_are_refused(study):
    """Correlations of inputs whose matrix is not positive definite are refused.

    They contradict each other.
    """
    paths = [PRELOAD, MASS, "rig.follower.spring_stiffness"]
    pairs = [
        {"inputs": [paths[i], paths[j]], "coefficient": r}
        for i, j, r in ((0, 1, 0.9), (1, 2, 0.9), (0, 2, -0.9))
    ]
    vary = {path: {"uniform": 1, "unit": "%"} for path in paths}
    with pytest.raises(ConfigError, match="must be positive definite"):
        study(vary=vary, correlated=pairs).draws


@pytest.mark.parametrize("folder", ["cams", "rigs"])
def test_every_number_of_a_shipped_file_can_be_set(folder):
    """Each number of a shipped cam or rig file can be set by its path.

    Setting a number to its own value changes it by rounding only, and no other number.
    """
    load = {"cams": load_cam, "rigs": load_rig}[folder]
    for path in sorted((config_root() / folder).glob("*.yaml")):
        config = load(path)
        numbers = {
            key: value for key, (value, _) in paths_of({"x": config}).items() if key[0] == "x"
        }
        for key, value in list(numbers.items())[:40]:
            copy = with_numbers(config, {key.removeprefix("x."): value})
            numbers_read = {key: value for key, (value, _) in paths_of({"x": copy}).items()}
            assert numbers_read[key] == pytest.approx(value, rel=1e-15)
            assert {k: v for k, v in numbers_read.items() if k[0] == "x"} == numbers | {
                key: numbers_read[key]
            }


ANGLES = np.linspace(0.0, TURN, 20011)[:-1]


@pytest.mark.parametrize("degrees", [3.0, 7.77, 100.0, 360.0])
def test_a_wave_is_within_the_documented_bounds(law, degrees):
    """A cam law with added waviness equals law plus sine within the documented bounds.

    The bounds are fractions of the wave's amplitude: 4.5e-7 for the lift and 3.9e-5 k² for its
    second derivative, with k waves per turn. Near the end of the turn, where the wave is closed,
    the bound is five times as large.
    """
    errors = ProfileErrors(waviness=1e-4, wavelength=math.radians(degrees), waviness_phase=0.4)
    wavy = errors.add_to(law)
    k = 360.0 / degrees
    inner = TURN - (2.0 + 1.0 / 12.0) * math.radians(degrees) > ANGLES
    for order, bound in ((0, 4.5e-7), (2, 3.9e-5 * k**2)):
        gap = np.abs(wavy(ANGLES, order) - law(ANGLES, order) - errors.at(ANGLES)[order]) / 1e-4
        assert gap.max() <= 5.0 * bound + 1e-8 * k**order
        if inner.any():
            assert gap[inner].max() <= 1.02 * bound + 1e-8 * k**order
            exact = -(k**2) * np.sin(k * ANGLES + 0.4) if order else np.sin(k * ANGLES + 0.4)
            assert np.abs(errors.at(ANGLES)[order] / 1e-4 - exact)[inner].max() < 1e-9 * k**2


@pytest.mark.parametrize("degrees", [3.0, 33.3, 250.0])
def test_a_wave_closes_without_a_step(law, degrees):
    """A wave whose length does not divide 360° is blended at the end of the turn.

    The wave is an error of the cam's profile. The lift and its first two derivatives have no step
    there beyond rounding, and the wave does not exceed its amplitude.
    """
    errors = ProfileErrors(waviness=1e-5, wavelength=math.radians(degrees), waviness_phase=1.0)
    wavy = errors.add_to(law)
    k = 360.0 / degrees
    assert wavy.velocity_jumps == {}
    assert np.abs(wavy.jumps(0)).max() < 1e-15
    assert np.abs(wavy.jumps(2)).max() < 1e-6 * 1e-5 * k**2 + np.abs(law.jumps(2)).max() + 1e-11
    assert np.abs(errors.at(ANGLES)[0]).max() <= 1e-5 * (1.0 + 1e-12)


def test_size_and_eccentricity_are_added(law):
    """Errors of size and eccentricity are added to a cam's law.

    The size is a constant, which is added exactly. The eccentricity is one sine per turn. Errors of
    zero do not change the law.
    """
    errors = ProfileErrors(size=2e-5, eccentricity=3e-5, eccentricity_phase=0.7)
    sum_ = errors.add_to(law)(ANGLES)
    expected = law(ANGLES) + 2e-5 + 3e-5 * np.sin(ANGLES + 0.7)
    assert np.abs(sum_ - expected).max() < 1e-6 * 3e-5
    sized = ProfileErrors(size=2e-5).add_to(law)
    assert np.abs(sized(ANGLES) - law(ANGLES) - 2e-5).max() < 1e-16
    assert np.array_equal(ProfileErrors().add_to(law).ordinates, law.ordinates)
