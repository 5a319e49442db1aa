"""Intervals of 95 % of what readings tell of a contour hold the truth as often as they say."""

import numpy as np
import pytest

from cam_rig.measured.cam_fit.arcs import COORDINATES, FLANK, PRIME, Arcs
from cam_rig.measured.cam_fit.arcs_fit import fit_arcs
from cam_rig.measured.cam_fit.dwells import above_zero

from .conftest import FLAT, ROLLER, readings_of

FOLLOWERS = {"roller": (ROLLER,), "flat": (FLAT,), "both": (ROLLER, FLAT)}
SHAPES = {
    "straight": Arcs(0.03, 0.01, None, 0.012, 0.5),
    "convex": Arcs(0.03, 0.01, 0.09, 0.012, 0.5),
    "concave": Arcs(0.03, 0.01, -0.15, 0.012, 0.5),
}
CASES = [(shape, followers) for shape in SHAPES for followers in FOLLOWERS]


def curvature(radius):
    """1/radius, so that an interval over a straight flank is one stretch."""
    with np.errstate(divide="ignore"):
        return float(1.0 / np.float64(radius))


def holds(fit, arcs, index):
    """Whether the interval of a number holds the truth; None where it has none."""
    told, truth = fit.told[index], fit.best.search.form.coordinates(arcs)[index]
    if told.held:
        return None
    if index not in (PRIME, FLANK):
        return told.low <= truth <= told.high
    if told.high == np.inf and truth <= 0.0:  # a flat face: straight or concave
        return True
    return curvature(told.high) <= truth <= curvature(told.low)


def coverage(shape, followers, copies):
    """Part of noisy copies whose interval holds the truth, NaN of a number that is held."""
    arcs, kinds = SHAPES[shape], FOLLOWERS[followers]
    flats, fits = tuple(kind.flat for kind in kinds), []
    for seed in range(copies):  # every 5° with 20 µm, as the commands take them
        read = map(above_zero, readings_of(arcs, *kinds, noise=2e-5, seed=seed))
        fits.append(fit_arcs(tuple(read), flats, 0.01, 0.03))
    held = [[holds(fit, arcs, index) for index in COORDINATES] for fit in fits]
    return np.array(held, dtype=float).mean(axis=0)


@pytest.mark.long
@pytest.mark.parametrize(("shape", "followers"), CASES)
def test_200_copies(shape, followers):
    """Between 90 and 99 % of the intervals of each number: docs/accuracy.md."""
    parts = coverage(shape, followers, 200)
    cells = ("" if np.isnan(part) else f"{100.0 * part:.1f}" for part in parts)
    print(f"| {shape} | {followers} | {' | '.join(cells)} |")
    assert (np.isnan(parts) | (parts >= 0.90) & (parts <= 0.99)).all(), parts
