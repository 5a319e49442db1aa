"""Scatter of readings: found within its error, blind to smooth laws, and a limit to tolerances."""

import numpy as np
import pytest

from cam_rig.errors import LawError
from cam_rig.laws import build_law
from cam_rig.laws.spline import SURE, least_tolerance, require_above_scatter, scatter, scatter_error
from cam_rig.units import TURN


@pytest.mark.parametrize("count", [72, 360, 2000])
def test_scatter_of_noise_is_its_standard_deviation(count):
    """Over 60 seeds: the mean within 3 of its errors, the spread is what scatter_error says."""
    angles = np.linspace(0.0, TURN, count, endpoint=False)
    found = [scatter(angles, np.random.default_rng(seed).normal(size=count)) for seed in range(60)]
    assert np.mean(found) == pytest.approx(1.0, abs=3.0 * scatter_error(count) / np.sqrt(60) + 0.03)
    assert np.std(found) == pytest.approx(scatter_error(count), rel=0.35)


def test_a_polynomial_of_degree_5_has_no_scatter():
    """Divided differences of order 6 vanish on it, at uneven angles too."""
    angles = np.sort(np.random.default_rng(4).uniform(0.0, 6.0, 40))
    lifts = np.polynomial.Polynomial([1.0, -2.0, 0.3, 0.7, -0.1, 0.02])(angles)
    assert scatter(angles, lifts) < 1e-9


@pytest.mark.parametrize("name", ["poly345", "cycloidal", "arcs_convex", "bezier15", "tm21"])
@pytest.mark.parametrize("count", [180, 360])
def test_the_cams_own_shape_is_no_scatter(laws, name, count):
    """2 µm of noise are found as such on laws of all kinds, those with jumps of s'' too."""
    angles = 0.01 + np.linspace(0.0, 6.27, count, endpoint=False)
    noise = np.random.default_rng(count).normal(scale=2e-6, size=count)
    found = scatter(angles, laws[name](angles) + noise)
    assert abs(found - 2e-6) < 3.0 * scatter_error(count) * 2e-6


def test_a_slip_does_not_move_it():
    """One reading off by 0.4 mm among 2 µm: the median stays."""
    angles = np.linspace(0.0, TURN, 360, endpoint=False)
    lifts = np.random.default_rng(1).normal(scale=2e-6, size=360)
    before = scatter(angles, lifts)
    lifts[100] += 4e-4
    assert scatter(angles, lifts) == pytest.approx(before, rel=0.05)


def test_equal_readings_tell_nothing():
    """A gauge that rests on one division scatters by less than it shows."""
    angles = np.linspace(0.0, TURN, 100, endpoint=False)
    assert scatter(angles, np.zeros(100)) == 0.0


def test_too_few_readings_tell_nothing():
    """Seven readings make one difference: no scatter is told from it."""
    assert scatter(np.arange(7.0) / 2.0, np.arange(7.0) ** 7) == 0.0


def test_a_tolerance_below_the_scatter_is_refused(cams, laws):
    """0.5 µm asked of readings with 2 µm: refused with both numbers; 0, and enough, are taken."""
    angles = np.linspace(0.0, TURN, 360, endpoint=False)
    lifts = laws["cycloidal"](angles) + np.random.default_rng(2).normal(scale=2e-6, size=360)
    message = r"tolerance is 0\.0005 mm, the points scatter by 0\.002.* mm, so the spline would"
    with pytest.raises(LawError, match=message):
        require_above_scatter(angles, lifts, 0.5e-6)
    require_above_scatter(angles, lifts, 0.0)
    require_above_scatter(angles, lifts, least_tolerance(scatter(angles, lifts), 360))
    table = cams["measured"].segments[0]
    points = table.file.model_copy(update={"angles": tuple(angles), "lifts": tuple(lifts)})
    tolerance = table.tolerance.model_copy(update={"assumed": 0.0005})
    segment = table.model_copy(update={"file": points, "tolerance": tolerance})
    lift = cams["measured"].lift.model_copy(update={"assumed": 50})
    cam = cams["measured"].model_copy(update={"segments": [segment], "lift": lift})
    with pytest.raises(LawError, match=r"measured\.csv: tolerance is 0\.0005 mm"):
        build_law(cam)


def test_few_readings_forgive_more():
    """The limit follows the standard error: 0.4 of it for 27 readings, all for very many."""
    assert least_tolerance(1.0, 27) == 0.4
    assert least_tolerance(1.0, 10**8) == pytest.approx(1.0, abs=SURE * 2e-4)
