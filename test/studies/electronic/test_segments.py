"""Fewest segments: against equal spacing and a dynamic programme on a fine grid."""

import numpy as np
import pytest

import cam_rig
from cam_rig.errors import ConfigError
from cam_rig.studies.electronic.segmentation import Tolerances, feasibility, fewest_segments

from .test_errors import SMOOTH, random_law

TOLERANCES = Tolerances(1e-6, 0.005)
#: Number of intervals of the grid of the dynamic programme.
GRID = 96


def programmed_count(are_feasible):
    """Return the fewest segments with breaks on a grid, by dynamic programming."""
    grid = np.linspace(0.0, 1.0, GRID + 1)
    first, last = np.triu_indices(GRID + 1, 1)
    feasible = np.zeros((GRID + 1, GRID + 1), dtype=bool)
    for start in range(0, first.size, 4000):
        block = slice(start, start + 4000)
        feasible[first[block], last[block]] = are_feasible(grid[first[block]], grid[last[block]])
    fewest = [0]
    for stop in range(1, GRID + 1):
        starts = np.flatnonzero(feasible[:stop, stop])
        fewest.append(min((fewest[s] + 1 for s in starts.tolist()), default=10**6))
    return fewest[-1]


def equal_count(are_feasible):
    """Return the fewest equal segments."""
    for count in range(1, 500):
        edges = np.linspace(0.0, 1.0, count + 1)
        if are_feasible(edges[:-1], edges[1:]).all():
            return count
    raise AssertionError


@pytest.mark.parametrize("name", SMOOTH)
def test_never_more_segments_than_equal_spacing(name):
    """Each piece of a shipped cam has at most as many segments as equal spacing needs."""
    law = cam_rig.build_law(name)
    for piece in range(min(law.spans.size, 8)):
        test = feasibility(law, piece, TOLERANCES)
        breaks = fewest_segments(test)
        assert breaks[0] == 0.0 and breaks[-1] == 1.0
        assert test(np.array(breaks[:-1]), np.array(breaks[1:])).all()
        assert len(breaks) - 1 <= equal_count(test)


@pytest.mark.parametrize("name", ["bezier15", "cycloidal", "half_rises", "trigonometric", 3, 5])
def test_no_more_segments_than_a_dynamic_programme(name):
    """No piece has more segments than the optimum on a fine grid."""
    law = random_law(name) if isinstance(name, int) else cam_rig.build_law(name)
    for piece in range(min(law.spans.size, 3)):
        test = feasibility(law, piece, TOLERANCES)
        assert len(fewest_segments(test)) - 1 <= programmed_count(test)


def test_errors_that_no_segment_keeps_are_refused():
    """An error below rounding is refused, instead of a search without end."""
    with pytest.raises(ConfigError, match="allowed: larger errors"):
        fewest_segments(lambda starts, stops: stops - starts < 1e-9)
