"""Laws through points: smoothing splines, exact dwells, scatter of readings."""

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.optimize import least_squares

from cam_rig.dynamics.vibration import low_dwell
from cam_rig.errors import LawError
from cam_rig.laws import Law, build_law, spline
from cam_rig.laws.bernstein import join_pieces, rotate_to_zero
from cam_rig.laws.law import MAX_CONTINUITY, continuity
from cam_rig.laws.segments import smooth_table
from cam_rig.units import TURN, rms

FINE = np.linspace(0.0, TURN, 1000, endpoint=False)


def turn(count):
    return np.linspace(0.0, TURN, count, endpoint=False)


def noise(count, scale=1.0, seed=0):
    return np.random.default_rng(seed).normal(scale=scale, size=count)


def law_of(smoothed):
    breaks, columns = smoothed.pieces
    return Law("table", np.array(breaks), join_pieces(columns))


def wave(angle):
    """Return a smooth periodic lift of 10 mm."""
    return 0.005 * (1.0 - np.cos(angle)) + 0.0004 * np.sin(3.0 * angle)


def test_zero_tolerance_goes_through_every_point():
    """With tolerance 0 a closed quintic passes through every point.

    Between the points its error is of order h⁶.
    """
    for start in (0.0, 0.02):
        angles = start + turn(72)
        smoothed = spline.smooth(angles, wave(angles), 0.0)
        assert smoothed.largest < 1e-16
        law = law_of(smoothed)
        assert np.abs(law(FINE) - wave(FINE)).max() < 3.0**6 * (TURN / 72) ** 6 * 0.0004
        assert continuity(law) == MAX_CONTINUITY
    angles = np.linspace(0.0, TURN, 73)
    lifts = wave(angles)
    lifts[-1] += 2e-7
    assert float(law_of(spline.smooth(angles, lifts, 0.0))(0.0)) == pytest.approx(1e-7, abs=1e-16)


def test_shipped_table_follows_its_points(cams, laws):
    """The r.m.s. distance of the shipped law from its points is its tolerance.

    No point is farther than four tolerances. Another lift than that of the points is refused.
    """
    cam = cams["measured"]
    segment = cam.segments[0]
    smoothed, tolerance = smooth_table(segment, cam), segment.tolerance.si
    assert tolerance * 0.99 <= smoothed.rms <= 1.001 * tolerance
    assert smoothed.largest < 4.0 * tolerance
    errors = laws["measured"](np.array(segment.file.angles)) - segment.file.lifts
    assert rms(errors) == pytest.approx(smoothed.rms, rel=1e-9)
    wrong = cam.model_copy(update={"lift": cam.lift.model_copy(update={"assumed": 12})})
    with pytest.raises(LawError, match=r"lift is 12 mm, the points of measured.csv rise by 10"):
        build_law(wrong)


def test_pieces_are_rotated_to_zero():
    """Pieces that start at any angle become pieces that start at 0.

    A piece that contains 0 is split, unless 0 is a breakpoint.
    """
    column = np.array([0.0, 1.0, 4.0, 9.0])
    breaks, columns = rotate_to_zero(([-1.0, 2.0, TURN - 1.0], [column, column[::-1]]), TURN)
    assert breaks == pytest.approx([0.0, 2.0, TURN - 1.0, TURN])
    cut = join_pieces(columns)
    assert cut[-1, -1] == pytest.approx(cut[0, 0], rel=1e-15)
    column = np.array([0.0, 1.0])
    breaks, columns = rotate_to_zero(([-2.0, 0.0, TURN - 2.0], [column, column[::-1]]), TURN)
    assert breaks == pytest.approx([0.0, TURN - 2.0, TURN])
    assert len(columns) == 2
    angles = 0.013 + turn(40)
    law = law_of(spline.smooth(angles, wave(angles), 1e-6))
    for order in range(5):
        assert abs(law.jumps(order)[0]) < 1e-8 * np.abs(law.derivative_ordinates(order)).max()


# Dwells: exact, joined with C2, without noise.

DWELLS = [
    spline.Rest(np.radians(160), np.radians(40), 0.012),
    spline.Rest(np.radians(320), np.radians(80), 0.0),
]


def readings(laws, count, scale, seed=0):
    """Return readings of the shipped cam `flat`.

    It is cycloidal over 120°, with dwells of 40° and 80°.
    """
    return turn(count), laws["flat"](turn(count)) + noise(count, scale, seed)


def test_dwells_are_exact_and_joined_at_c2(laws):
    """A smoothed law is constant in the dwells and C2 at their ends."""
    for count in (36, 72, 360):
        for scale in (2e-6, 2e-5):
            law = law_of(spline.smooth(*readings(laws, count, scale), 1.2 * scale, DWELLS))
            for dwell in DWELLS:
                start, stop = dwell.start + 1e-9, dwell.start + dwell.span - 1e-9
                inside = np.linspace(start, stop, 50) % TURN
                assert np.ptp(law(inside)) < 1e-16
                assert law(inside, 2).max() == pytest.approx(0.0, abs=1e-14)
            for order in range(3):
                limit = 1e-9 * np.abs(law.derivative_ordinates(order)).max()
                assert np.abs(law.jumps(order)).max() < limit


def test_the_distance_is_the_tolerance(laws):
    """Between dwells the r.m.s. distance of the law is the tolerance.

    It is corrected for the ordinates that the dwells fix.
    """
    angles, lifts = readings(laws, 360, 5e-6)
    smoothed = spline.smooth(angles, lifts, 6e-6, DWELLS)
    errors = np.abs(law_of(smoothed)(angles) - lifts)
    in_dwell = np.any([(angles - d.start) % TURN <= d.span for d in DWELLS], axis=0)
    event = (angles > np.radians(200.1)) & (angles < DWELLS[1].start - 1e-9)
    bound = 6e-6 * np.sqrt(1.0 + 2.0 * spline.FIXED_ORDINATES / np.count_nonzero(event))
    assert rms(errors[event]) == pytest.approx(bound, rel=1e-6)
    assert smoothed.rms == pytest.approx(rms(errors), rel=1e-9)
    assert smoothed.largest == pytest.approx(errors.max(), rel=1e-9)
    assert rms(errors[in_dwell]) < 6e-6


def test_ordinates_are_those_of_scipys_least_squares(laws):
    """Without smoothing the ordinates are those of scipy's least squares."""
    angles, lifts = readings(laws, 180, 2e-6)
    start, end = DWELLS[0].start + DWELLS[0].span, DWELLS[1].start
    inside = (angles > start) & (angles < end)
    x, y = angles[inside], lifts[inside]
    inner = np.linspace(start, end, spline.INTERVAL_COUNTS[4] + 1)[1:-1]
    knots = np.concatenate([[start] * (spline.DEGREE + 1), inner, [end] * (spline.DEGREE + 1)])

    def errors(free):
        ordinates = np.concatenate(
            [[0.012] * spline.FIXED_ORDINATES, free, [0.0] * spline.FIXED_ORDINATES]
        )
        return BSpline(knots, ordinates, spline.DEGREE)(x) - y

    first = np.linspace(0.012, 0.0, knots.size - spline.DEGREE - 1 - 2 * spline.FIXED_ORDINATES)
    fitted = least_squares(errors, first, xtol=1e-15, ftol=1e-15)
    # a tolerance that these intervals just reach, and fewer do not
    bound = rms(fitted.fun) * (1.0 + 1e-9) / np.sqrt(1.0 + 2.0 * spline.FIXED_ORDINATES / x.size)
    ours = spline._fit_event(x, y, (start, end), (0.012, 0.0), bound)
    assert ours.c[spline.FIXED_ORDINATES : -spline.FIXED_ORDINATES] == pytest.approx(
        fitted.x, abs=1e-8
    )


def test_gaps_in_readings_are_allowed(laws):
    """A law can be fitted to readings of the events alone.

    An event without readings is the 3-4-5 polynomial.
    """
    angles, lifts = readings(laws, 360, 2e-6)
    read = (angles > np.radians(35)) & (angles < np.radians(325))
    law = law_of(spline.smooth(angles[read], lifts[read], 2.2e-6, DWELLS))
    assert np.abs(law(FINE) - laws["flat"](FINE)).max() < 5e-6
    dwell = low_dwell(law_of(spline.smooth(angles, lifts, 2.2e-6, DWELLS[1:])))
    assert dwell.dwell
    assert np.degrees([dwell.start, dwell.span]) == pytest.approx([320.0, 80.0])
    dwells = [spline.Rest(0.0, 2.0, 0.0), spline.Rest(3.0, 2.0, 0.01)]
    angles = np.concatenate([np.linspace(0.1, 1.9, 8), np.linspace(3.1, 4.9, 8)])
    law = law_of(spline.smooth(angles, np.where(angles < 2.5, 0.0, 0.01), 1e-6, dwells))
    u = np.linspace(0.01, 0.99, 9)
    assert law(2.0 + u) == pytest.approx(0.01 * (10 * u**3 - 15 * u**4 + 6 * u**5), abs=1e-15)


def test_a_tolerance_that_no_spline_reaches_is_refused():
    """A tolerance that no spline reaches is refused.

    The readings are 0.01° and 1 mm apart, for equal intervals.
    """
    dwells = [spline.Rest(0.0, 2.0, 0.0), spline.Rest(4.0, 2.0, 0.0)]
    angles = np.array([0.5, 1.0, 1.5, 3.0, 3.0002, 3.0004, 3.0006, 4.5, 5.0, 5.5])
    lifts = np.array([0.0, 0.0, 0.0, 0.001, 0.002, 0.0, 0.001, 0.0, 0.0, 0.0])
    message = r"no spline comes within 1e-05 mm r\.m\.s\. of the 4 points"
    with pytest.raises(LawError, match=message):
        spline.smooth(angles, lifts, 1e-8, dwells)


# Scatter of readings: its accuracy, and the limit that it sets to tolerances.


@pytest.mark.parametrize("count", [72, 360, 2000])
def test_the_scatter_of_noise_is_its_standard_deviation(count):
    """The estimated scatter of noise is its standard deviation.

    Over 60 seeds the mean is within three standard errors, and the spread is that of
    scatter_error.
    """
    scatters = [spline.scatter(turn(count), noise(count, seed=seed)) for seed in range(60)]
    error = spline.scatter_error(count)
    assert np.mean(scatters) == pytest.approx(1.0, abs=3.0 * error / np.sqrt(60) + 0.03)
    assert np.std(scatters) == pytest.approx(error, rel=0.35)


def test_the_shape_of_a_cam_is_not_scatter(laws):
    """The shape of a law does not count as scatter.

    Noise of 2 µm is estimated on laws of all kinds. A polynomial of degree 5 has no scatter.
    """
    for name in ("poly345", "cycloidal", "arcs_convex", "bezier15", "tm21"):
        for count in (180, 360):
            angles = 0.01 + np.linspace(0.0, 6.27, count, endpoint=False)
            scatter = spline.scatter(angles, laws[name](angles) + noise(count, 2e-6, count))
            assert abs(scatter - 2e-6) < 3.0 * spline.scatter_error(count) * 2e-6
    angles = np.sort(np.random.default_rng(4).uniform(0.0, 6.0, 40))
    lifts = np.polynomial.Polynomial([1.0, -2.0, 0.3, 0.7, -0.1, 0.02])(angles)
    assert spline.scatter(angles, lifts) < 1e-9


def test_scatter_ignores_constant_readings_and_outliers():
    """Constant readings, seven readings and outliers do not add scatter."""
    assert spline.scatter(turn(100), np.zeros(100)) == 0.0
    assert spline.scatter(np.arange(7.0) / 2.0, np.arange(7.0) ** 7) == 0.0
    lifts = noise(360, 2e-6, 1)
    before = spline.scatter(turn(360), lifts)
    lifts[100] += 4e-4
    assert spline.scatter(turn(360), lifts) == pytest.approx(before, rel=0.05)


def test_a_tolerance_below_the_scatter_is_refused(cams, laws):
    """A tolerance below the scatter of the readings is refused with both.

    The limit depends on the number of readings, and is 0.4 of the scatter for 27.
    """
    angles = turn(360)
    lifts = laws["cycloidal"](angles) + noise(360, 2e-6, 2)
    message = r"tolerance is 0\.0005 mm, the points scatter by 0\.002.* mm, so the spline would"
    with pytest.raises(LawError, match=message):
        spline.require_above_scatter(angles, lifts, 0.5e-6)
    spline.require_above_scatter(angles, lifts, 0.0)
    min_tolerance = spline.min_tolerance(spline.scatter(angles, lifts), 360)
    spline.require_above_scatter(angles, lifts, min_tolerance)
    assert spline.min_tolerance(1.0, 27) == 0.4
    assert spline.min_tolerance(1.0, 10**8) == pytest.approx(
        1.0, abs=spline.MAX_ERRORS_BELOW * 2e-4
    )
    table = cams["measured"].segments[0]
    points = table.file.model_copy(update={"angles": tuple(angles), "lifts": tuple(lifts)})
    tolerance = table.tolerance.model_copy(update={"assumed": 0.0005})
    segment = table.model_copy(update={"file": points, "tolerance": tolerance})
    lift = cams["measured"].lift.model_copy(update={"assumed": 50})
    cam = cams["measured"].model_copy(update={"segments": [segment], "lift": lift})
    with pytest.raises(LawError, match=r"measured\.csv: tolerance is 0\.0005 mm"):
        build_law(cam)
