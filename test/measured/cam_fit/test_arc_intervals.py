"""Intervals of 95 % of what readings tell of a contour hold the truth as often as they say."""

import numpy as np
import pytest

from cam_rig.errors import ConfigError
from cam_rig.laws.arc_law import ArcFollower
from cam_rig.measured.cam_fit.arcs import COORDINATES, FLANK, PRIME, Arcs
from cam_rig.measured.cam_fit.arcs_fit import fit_arcs
from cam_rig.measured.cam_fit.dwells import above_zero
from cam_rig.measured.cam_fit.files import arcs_cam
from cam_rig.measured.cam_fit.gauge import Readings, without_outliers

from .conftest import FLAT, ROLLER, all_around, readings_of

FINE = all_around(1000)
SMALL = ArcFollower(False, 0.002)
FOLLOWERS = {"roller": (ROLLER,), "flat": (FLAT,), "both": (ROLLER, FLAT), "small": (SMALL,)}
SHAPES = {
    "straight": Arcs(0.03, 0.01, None, 0.012, 0.5),
    "convex": Arcs(0.03, 0.01, 0.09, 0.012, 0.5),
    "concave": Arcs(0.03, 0.01, -0.15, 0.012, 0.5),
}
CASES = [(shape, followers) for shape in SHAPES for followers in ("roller", "flat", "both")]
#: Of these the usual assumption, 10 mm of roller and 30 mm of base, leaves no nose.
SHAPES |= {"sharp": Arcs(0.02, 0.012, None, 0.002, 0.5), "big": Arcs(0.06, 0.012, 0.15, 0.008, 0.5)}
NO_NOSE = [("sharp", "small"), ("big", "flat")]


def curvature(radius):
    """1/radius, so that an interval over a straight flank is one stretch."""
    with np.errstate(divide="ignore"):
        return float(1.0 / np.float64(radius))


def holds(fit, pitch, index):
    """Whether the interval of a number holds the truth; None where it has none."""
    told, truth = fit.told[index], fit.best.search.form.coordinates(pitch)[index]
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
    pitch = arcs.grown(kinds[0].roller_radius)
    held = [[holds(fit, pitch, index) for index in COORDINATES] for fit in fits]
    return np.array(held, dtype=float).mean(axis=0)


@pytest.mark.long
@pytest.mark.parametrize(("shape", "followers"), CASES)
def test_200_copies(shape, followers):
    """Between 90 and 99 % of the intervals of each number: docs/accuracy.md."""
    parts = coverage(shape, followers, 200)
    cells = ("" if np.isnan(part) else f"{100.0 * part:.1f}" for part in parts)
    print(f"| {shape} | {followers} | {' | '.join(cells)} |")
    assert (np.isnan(parts) | (parts >= 0.90) & (parts <= 0.99)).all(), parts


@pytest.mark.parametrize(("shape", "followers"), NO_NOSE)
def test_an_assumed_radius_bounds_nothing(shape, followers):
    """Where it leaves no nose another is assumed, and said; the intervals hold what lifts tell."""
    arcs, (kind,) = SHAPES[shape], FOLLOWERS[followers]
    fit = fit_arcs(readings_of(arcs, kind, noise=1e-5, seed=1), (kind.flat,), 0.01, 0.03)
    assert fit.rms < 1.5e-5
    pitch = arcs.grown(kind.roller_radius)
    assert all(holds(fit, pitch, index) is not False for index in COORDINATES)
    assert fit.arcs.nose_radius > 0.2 * fit.arcs.base_radius * kind.flat
    assert "assumed as" in fit.cannot_tell[0]
    law = arcs_cam("mine", fit, "flat" if kind.flat else "roller").law
    assert law(FINE) == pytest.approx(arcs.lifts(kind, FINE + 0.5 - np.pi), abs=5e-5)


def test_a_given_base_radius_is_judged_when_the_fit_is_done():
    """Not while a trial has a slip put back, whose contour has another prime radius."""
    angles = all_around(120)
    lifts = Arcs(0.03, 0.008, 0.12, 0.010, 0.3).lifts(ROLLER, angles)
    lifts += 2e-5 * np.random.default_rng(0).standard_normal(angles.size)
    lifts[6] -= 0.6e-3
    read = Readings("a", angles, lifts, np.arange(angles.size), 1e-7, (0.0, 2 * np.pi / 120), ())
    fit = fit_arcs((without_outliers(read),), (False,), 0.004, 0.03, "base")
    assert fit.told[PRIME].low < 0.04 < fit.told[PRIME].high
    assert fit.roller_radius == pytest.approx(fit.told[PRIME].value - 0.03, abs=1e-12)


def test_a_base_radius_that_leaves_no_roller_or_no_nose_is_refused():
    """The roller is what the base leaves of the sum, 22 mm, and smaller than the nose's, 4 mm."""
    columns = readings_of(SHAPES["sharp"], SMALL)
    for base, words in (
        (0.025, "below base and roller"),
        (0.015, r"above 18(\.0\d*)? mm, for nose"),
    ):
        with pytest.raises(ConfigError, match=words):
            fit_arcs(columns, (False,), 0.006, base, "base")


def test_readings_of_another_shape_are_not_blamed():
    """A roller's taken for a flat follower's: the shape is wrong, no reading is named."""
    columns = readings_of(Arcs(0.02, 0.012, None, 0.008, 0.5), ROLLER, noise=2e-6)
    wrong, right = (fit_arcs(columns, (flat,), 0.01, 0.03) for flat in (True, False))
    words = " ".join(wrong.conclusions())
    assert "arcs do not describe the readings" in words
    assert "look at them again" not in words
    assert "do not describe" not in " ".join(right.conclusions())


def test_a_roller_larger_than_the_nose_of_its_path_is_contradicted():
    """6 mm given, where nose and roller have 4 mm together: what is told without it is named."""
    columns = readings_of(SHAPES["sharp"], SMALL, noise=1e-5)
    wrong = fit_arcs(columns, (False,), 0.006, 0.03, "roller")
    assert wrong.roller_radius == 0.006
    (words,) = (one for one in wrong.conclusions() if "contradict the radii given" in one)
    low, high = map(float, words.split("nose and roller radius ")[1].split(" mm")[0].split(" to "))
    assert low < 4.0 < high < 4.5
