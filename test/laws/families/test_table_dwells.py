"""A law from measured points with dwells: exact where it rests, C2 where it leaves, no noise."""

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.optimize import least_squares

from cam_rig.dynamics.vibration import low_dwell
from cam_rig.errors import LawError
from cam_rig.laws import Law
from cam_rig.laws.bernstein import joined
from cam_rig.laws.spline import DEGREE, HELD, INTERVALS, Rest, _event, smooth
from cam_rig.units import TURN

DWELLS = [Rest(np.radians(160), np.radians(40), 0.012), Rest(np.radians(320), np.radians(80), 0.0)]


def readings(laws, count, noise, seed=0):
    """Of the shipped cam `flat`: cycloidal over 120°, dwells of 40° and 80°."""
    angles = np.linspace(0.0, TURN, count, endpoint=False)
    scatter = np.random.default_rng(seed).normal(scale=noise, size=count)
    return angles, laws["flat"](angles) + scatter


def law_of(found):
    breaks, columns = found.pieces
    return Law("table", np.array(breaks), joined(columns))


@pytest.mark.parametrize("count", [36, 72, 360])
@pytest.mark.parametrize("noise", [2e-6, 2e-5])
def test_dwells_are_exact_and_joined_at_c2(laws, count, noise):
    """s is the level to rounding inside; s, s' and s'' do not jump anywhere."""
    law = law_of(smooth(*readings(laws, count, noise), 1.2 * noise, DWELLS))
    for dwell in DWELLS:
        inside = np.linspace(dwell.start + 1e-9, dwell.start + dwell.span - 1e-9, 50) % TURN
        assert np.ptp(law(inside)) < 1e-16
        assert law(inside, 2).max() == pytest.approx(0.0, abs=1e-14)
    for order in range(3):
        assert np.abs(law.jumps(order)).max() < 1e-9 * np.abs(law.derivative_ordinates(order)).max()


@pytest.mark.parametrize("seed", range(5))
def test_the_acceleration_comes_back(laws, seed):
    """360 readings with 2 µm: s'' within 1 % r.m.s. of its peak, better than without dwells."""
    angles, lifts = readings(laws, 360, 2e-6, seed)
    fine = np.linspace(0.0, TURN, 2000, endpoint=False)
    true = laws["flat"](fine, 2)
    with_dwells, without = (
        np.sqrt(np.mean((law_of(smooth(angles, lifts, 2.2e-6, d))(fine, 2) - true) ** 2))
        for d in (DWELLS, [])
    )
    assert with_dwells < 0.01 * np.abs(true).max()
    assert with_dwells < 0.5 * without


def test_the_distance_is_the_tolerance(laws):
    """Between dwells, the ordinates that they hold allowed for; nowhere more than that."""
    angles, lifts = readings(laws, 360, 5e-6)
    found = smooth(angles, lifts, 6e-6, DWELLS)
    away = np.abs(law_of(found)(angles) - lifts)
    rests = np.any([(angles - d.start) % TURN <= d.span for d in DWELLS], axis=0)
    event = (angles > DWELLS[0].start + DWELLS[0].span) & (angles < DWELLS[1].start - 1e-9)
    event &= angles > np.radians(200.1)
    bound = 6e-6 * np.sqrt(1.0 + 2.0 * HELD / np.count_nonzero(event))
    assert np.sqrt(np.mean(away[event] ** 2)) == pytest.approx(bound, rel=1e-6)
    assert found.rms == pytest.approx(np.sqrt(np.mean(away**2)), rel=1e-9)
    assert found.largest == pytest.approx(away.max(), rel=1e-9)
    assert np.sqrt(np.mean(away[rests] ** 2)) < 6e-6


def test_it_is_the_same_as_scipys_least_squares(laws):
    """Where no smoothing is left to do: scipy's optimum of the same likelihood, same ordinates."""
    angles, lifts = readings(laws, 180, 2e-6)
    begin, end = DWELLS[0].start + DWELLS[0].span, DWELLS[1].start
    inside = (angles > begin) & (angles < end)
    x, y = angles[inside], lifts[inside]
    fitted = _fit(x, y, begin, end, INTERVALS[4])
    rms = np.sqrt(np.mean(fitted.fun**2))
    # a tolerance that these intervals reach by a hair and no fewer do
    bound = rms * (1.0 + 1e-9) / np.sqrt(1.0 + 2.0 * HELD / x.size)
    ours = _event(x, y, (begin, end), (0.012, 0.0), bound)
    assert ours.c.size == fitted.x.size + 2 * HELD
    assert ours.c[HELD:-HELD] == pytest.approx(fitted.x, abs=1e-8)


def _fit(x, y, begin, end, count):
    inner = np.linspace(begin, end, count + 1)[1:-1]
    knots = np.concatenate([[begin] * (DEGREE + 1), inner, [end] * (DEGREE + 1)])
    size = knots.size - DEGREE - 1

    def away(free):
        ordinates = np.concatenate([[0.012] * HELD, free, [0.0] * HELD])
        return BSpline(knots, ordinates, DEGREE)(x) - y

    return least_squares(away, np.linspace(0.012, 0.0, size - 2 * HELD), xtol=1e-15, ftol=1e-15)


def test_a_gap_in_a_dwell_is_a_dwell(laws):
    """Readings over the event alone, as of a gauge that is not read on the base circle."""
    angles, lifts = readings(laws, 360, 2e-6)
    read = (angles > np.radians(35)) & (angles < np.radians(325))
    law = law_of(smooth(angles[read], lifts[read], 2.2e-6, DWELLS))
    fine = np.linspace(0.0, TURN, 1000)
    assert np.abs(law(fine) - laws["flat"](fine)).max() < 5e-6


def test_an_event_without_readings_is_a_quintic():
    """Six ordinates are all held: the 3-4-5 polynomial from level to level."""
    rests = [Rest(0.0, 2.0, 0.0), Rest(3.0, 2.0, 0.01)]
    angles = np.concatenate([np.linspace(0.1, 1.9, 8), np.linspace(3.1, 4.9, 8)])
    law = law_of(smooth(angles, np.where(angles < 2.5, 0.0, 0.01), 1e-6, rests))
    u = np.linspace(0.01, 0.99, 9)
    assert law(2.0 + u) == pytest.approx(0.01 * (10 * u**3 - 15 * u**4 + 6 * u**5), abs=1e-15)


def test_one_dwell_begins_and_ends_the_event(laws):
    """With one dwell the spline goes round to it again; vibration reads its residual there."""
    angles, lifts = readings(laws, 360, 2e-6)
    law = law_of(smooth(angles, lifts, 2.2e-6, DWELLS[1:]))
    dwell = low_dwell(law)
    assert dwell.dwell
    assert np.degrees([dwell.start, dwell.span]) == pytest.approx([320.0, 80.0])


def test_a_tolerance_that_no_spline_reaches():
    """Two readings of one place, a hundredth of a degree and 1 mm apart: no even knots do both."""
    rests = [Rest(0.0, 2.0, 0.0), Rest(4.0, 2.0, 0.0)]
    angles = np.array([0.5, 1.0, 1.5, 3.0, 3.0002, 3.0004, 3.0006, 4.5, 5.0, 5.5])
    lifts = np.array([0.0, 0.0, 0.0, 0.001, 0.002, 0.0, 0.001, 0.0, 0.0, 0.0])
    with pytest.raises(
        LawError, match=r"no spline comes within 1e-05 mm r\.m\.s\. of the 4 points"
    ):
        smooth(angles, lifts, 1e-8, rests)
