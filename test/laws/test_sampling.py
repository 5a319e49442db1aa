"""Uniform samples of a cam equal evaluations of its law, also at high degrees."""

import math

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmark.speed import exact as exact_solution
from benchmark.speed import study as rig
from benchmark.speed.exact import polynomial, powers
from benchmark.speed.models import Case, Oscillator, output_times
from cam_rig.laws import Law
from cam_rig.laws.sampling import AT_SAMPLE, SampleRun, group_repeated_runs, sample
from cam_rig.units import TURN

EPS = float(np.finfo(float).eps)
IDENTITY, NO_OFFSET = np.eye(3), np.zeros(3)
#: Largest rounding error of a sample, in units of eps·size. Evaluating s'' from ordinates
#: multiplies rounding by the degree squared.
ERRORS = 500.0
#: Start, step and count of samples.
RUNS = (
    (0.0, 1e-3, 20_000),  # three turns, chunks
    (0.0, 8.7e-4, 1),
    (123.456, 8.7e-4, 10_000),
    (1000 * TURN + 1.0, 1e-3, 10_000),  # after a thousand turns
    (-5.0, 0.01, 2000),  # through θ = 0
    (1.0, 1e-9, 5000),  # tiny steps, one piece
    (0.3, 0.9, 300),  # a few samples per turn
    (0.0, 100.0, 500),  # many turns per step
    (0.0, TURN / 360, 720),  # samples on the joints
    (float(np.nextafter(TURN, 0.0)), 1e-3, 500),
    # turns with a whole number of samples are computed together
    *((0.0, TURN / per_turn, round(5.3 * per_turn)) for per_turn in (7200, 7200.5, 4096, 2777.7)),
)


def assert_is_the_law(law, start, step, count):
    """Check that samples equal the law.

    The tolerance is the rounding of values, and of the angle times the slope.
    """
    rows = sample(law, start, step, count, IDENTITY, NO_OFFSET)
    angle = start + step * np.arange(count)
    blur = 4.0 * EPS * (np.abs(angle).max() + TURN)
    reduced = angle - np.floor(angle / TURN) * TURN
    after = np.searchsorted(law.breaks[1:-1], reduced) + 1
    distance = np.minimum(reduced - law.breaks[after - 1], law.breaks[after] - reduced)
    inside = distance > blur + AT_SAMPLE * step  # at a joint `Law.__call__` may meet either side
    for order in range(3):
        size, slope = (np.abs(law.derivative_ordinates(k)).max() for k in (order, order + 1))
        expected, limit = law(angle[inside], order), ERRORS * EPS * size + blur * slope
        np.testing.assert_allclose(rows[order, inside], expected, rtol=0, atol=limit)


def test_samples_are_the_law(followable_laws):
    """Uniform samples of each law equal its evaluations.

    Each law has two runs, and all runs are used.
    """
    for i, law in enumerate(followable_laws.values()):
        for run in RUNS[i % 7 :: 7]:
            assert_is_the_law(law, *run)


@given(
    start=st.floats(-100.0, 1000.0),
    exponent=st.floats(-6.0, 1.0),
    count=st.integers(1, 700),
    name=st.sampled_from(["poly345", "bezier15", "tm21", "cycloidal"]),
)
def test_any_samples_are_the_law(laws, start, exponent, count, name):
    assert_is_the_law(laws[name], start, 10.0**exponent, count)


def test_samples_are_weighted_combinations_plus_offsets(followable_laws):
    """Sampled rows are the weighted combinations of s, s', s'' plus constants.

    A run in two parts equals the whole run.
    """
    weights, offsets = np.array([[1.0, -2.0, 0.5], [0.0, 0.0, 3.0]]), np.array([7.0, -1.0])
    for law in followable_laws.values():
        plain = sample(law, 0.2, 1e-3, 3000, IDENTITY, NO_OFFSET)
        expected = weights @ plain + offsets[:, None]
        mixed = sample(law, 0.2, 1e-3, 3000, weights, offsets)
        np.testing.assert_allclose(mixed, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
        second = sample(law, 0.2 + 1e-3 * 1700, 1e-3, 1300, IDENTITY, NO_OFFSET)
        sizes = np.array([np.abs(law.derivative_ordinates(k)).max() for k in range(4)])
        tolerance = 1000 * EPS * (sizes[:3] + 20.0 * sizes[1:])
        assert np.all(np.abs(plain[:, 1700:] - second) <= tolerance[:, None])
        assert sample(law, 1.0, 0.1, 0, IDENTITY, NO_OFFSET).shape == (3, 0)


def test_a_sample_at_a_joint_is_the_right_limit(laws):
    """A sample at a joint is the right limit of s'', whatever the angle's rounding."""
    law, step = laws["tm21"], TURN / 3600
    for ulps in (-4, -1, 0, 1, 4):
        for joint in law.breaks[1:-1]:
            start = joint - 1700 * step
            start += ulps * math.ulp(start)
            rows = sample(law, start, step, 2000, IDENTITY, NO_OFFSET)
            assert rows[2, 1700] == pytest.approx(law(joint + 1e-9, 2), rel=1e-6, abs=1e-9)


def test_equal_turns_are_grouped():
    """Turns are grouped only if a turn has a whole number of samples."""

    def runs(spacing, shift):
        return [SampleRun.of(i * spacing, i * spacing + 1000, i * shift, 1e-3) for i in range(4)]

    assert [len(group) for group in group_repeated_runs(runs(4096, 0.0))] == [4]
    assert [len(group) for group in group_repeated_runs(runs(4096, 1e-15))] == [4]
    assert [len(group) for group in group_repeated_runs(runs(4096, 1e-13))] == [1] * 4
    uneven = [*runs(4096, 0.0), SampleRun.of(20_000, 21_000, 0.0, 1e-3)]
    assert [len(group) for group in group_repeated_runs(uneven)] == [4, 1]


def test_samples_are_written_into_the_given_rows(laws):
    """Samples can be written into rows of a larger array, and change no other row."""
    for name in ("tm21", "bezier15"):
        for step in (8.7e-4, TURN / 7200):
            arguments = laws[name], 0.3, step, 20_000, IDENTITY, NO_OFFSET
            block = np.full((6, 20_000), 7.0)
            result = sample(*arguments, block[2:5])
            np.testing.assert_array_equal(block[2:5], sample(*arguments))
            assert np.shares_memory(result, block)
            assert (block[[0, 1, 5]] == 7.0).all()


# Laws of high degree.

U = np.linspace(0.0, 1.0, 101)
DEGREES = (15, 30, 60)


def law_of(degree):
    """Return one curve for rise, dwell and fall, similar to Bézier 15.

    It is at rest at the ends and has a lift of about 50 mm.
    """
    inner = np.random.default_rng(degree).uniform(0.2, 1.5, degree - 7)
    ordinates = 0.05 * np.concatenate([np.zeros(4), inner, np.zeros(4)])
    return Law(f"bezier{degree}", np.array([0.0, TURN]), ordinates[:, None])


@pytest.mark.parametrize("degree", DEGREES)
def test_derivatives_and_samples_are_accurate_at_high_degree(degree):
    """Derivatives and samples agree with 60 digits to 1e-13."""
    law, count = law_of(degree), 20_000
    sampled = sample(law, 0.0, TURN / count, count, IDENTITY, NO_OFFSET)[:, ::200]
    with mp.workdps(60):
        series = powers(law.ordinates[:, 0].tolist())
        for order in range(3):
            expected = np.array([float(polynomial(series, mp.mpf(float(u)))) for u in U[:-1]])
            expected, series = expected / TURN**order, [i * a for i, a in enumerate(series)][1:]
            limit = 1e-13 * np.abs(expected).max()
            for result in (law(U[:-1] * TURN, order), sampled[order]):
                np.testing.assert_allclose(result, expected, rtol=0, atol=limit)


@pytest.mark.variants(3)
@pytest.mark.parametrize("rpm", [3.0, 300.0, 3000.0])
@pytest.mark.parametrize("degree", DEGREES)
def test_residual_vibration_is_exact_at_high_degree(degree, rpm, monkeypatch):
    """Residual vibration is exact to 1e-13 at low and high speed and any degree."""
    monkeypatch.setattr(exact_solution, "DIGITS", 140)
    speed = rpm * np.pi / 30.0
    times = output_times(speed, 1, 25)
    model = Oscillator(1.3, 8.642, 4030.0, 1e5)
    case = Case("degree", "degree", law_of(degree), model, speed, 1, 1, times)
    assert rig.solve(case).error(exact_solution.solve(case)) < 1e-13
