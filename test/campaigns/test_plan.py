"""Points of a plan from their index alone: the same in any batches, and what each plan promises."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.stats import qmc

from cam_rig.campaigns.draws import grid_places, rows_of, unit_points

KINDS = ("latin_hypercube", "sobol", "shares")


@pytest.mark.parametrize("kind", KINDS)
def test_a_point_is_the_same_in_any_batch(kind):
    """Bit for bit, and inside of the open unit cube."""
    total = rows_of(kind, 64, [1] * 3)
    whole = unit_points(kind, 7, total, 3, 0, total)
    assert whole.shape == (total, 3)
    assert 0.0 < whole.min() < whole.max() < 1.0
    edges = [0, 1, 2, 17, 40, total - 1, total]
    parts = [unit_points(kind, 7, total, 3, a, b) for a, b in pairwise(edges)]
    assert np.array_equal(np.concatenate(parts), whole)


@pytest.mark.parametrize("kind", KINDS)
def test_another_seed_has_other_points(kind):
    """And no number of the first stays."""
    one, other = (unit_points(kind, seed, 64, 2, 0, 64) for seed in (1, 2))
    assert not (one == other).any()


@pytest.mark.parametrize("total", [1, 2, 3, 5, 64, 100, 1021])
def test_a_latin_hypercube_meets_each_stratum_once(total):
    """In every dimension; and two dimensions are not the same order."""
    points = unit_points("latin_hypercube", 5, total, 3, 0, total)
    for column in points.T:
        assert sorted(np.floor(column * total).astype(int).tolist()) == list(range(total))
    if total > 5:
        assert not np.array_equal(np.argsort(points[:, 0]), np.argsort(points[:, 1]))


def test_a_latin_hypercube_is_as_even_as_scipys():
    """Its dimensions are as good as independent: correlations as small as random ones."""
    points = unit_points("latin_hypercube", 11, 4096, 6, 0, 4096)
    off = np.corrcoef(points.T)[~np.eye(6, dtype=bool)]
    assert np.abs(off).max() < 4.0 / np.sqrt(4096)


def test_the_sobol_sequence_is_scipys():
    """Scrambled by the seed, each coordinate moved to the middle of its last interval."""
    ours = unit_points("sobol", 9, 128, 4, 0, 128)
    theirs = qmc.Sobol(4, scramble=True, rng=9).random_base2(7)
    assert np.abs(ours - theirs).max() < 2.0**-30
    assert qmc.discrepancy(ours) == pytest.approx(qmc.discrepancy(theirs), rel=1e-6)


def test_shares_are_saltellis_rows():
    """Each block: a, then a with one number of b, d times, then b."""
    rows = unit_points("shares", 1, 8 * 5, 3, 0, 8 * 5).reshape(8, 5, 3)
    a, b = rows[:, 0], rows[:, -1]
    assert not (a == b).any()
    for axis in range(3):
        mixed = a.copy()
        mixed[:, axis] = b[:, axis]
        assert np.array_equal(rows[:, 1 + axis], mixed)


def test_a_grid_has_every_combination_once():
    """The last input fastest."""
    places = grid_places([2, 3, 4], 0, 24)
    assert len({tuple(row) for row in places.tolist()}) == 24
    assert places[:5].tolist() == [[0, 0, 0], [0, 0, 1], [0, 0, 2], [0, 0, 3], [0, 1, 0]]
    assert np.array_equal(grid_places([2, 3, 4], 7, 11), places[7:11])
    assert rows_of("grid", None, [2, 3, 4]) == 24
