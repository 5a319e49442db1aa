"""Uniform sampling of a turning cam is evaluation of its law, sample by sample."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cam_rig.laws import bernstein
from cam_rig.laws.sampling import AT_SAMPLE, ChunkSeries, SampleRun, chunk_powers, repeated, sample
from cam_rig.units import TURN

EPS = np.finfo(float).eps
IDENTITY = np.eye(3)
NO_OFFSET = np.zeros(3)
#: Rounding errors a sample may have, in units of eps·size. Evaluating s'' from ordinates costs
#: the degree squared.
ERRORS = 500.0


def assert_is_the_law(law, start, step, count):
    """Samples equal the law's, but for rounding of values and of angle times slope."""
    rows = sample(law, start, step, count, IDENTITY, NO_OFFSET)
    angle = start + step * np.arange(count)
    reached = np.abs(angle).max() + TURN
    blur = 4.0 * EPS * reached
    reduced = angle - np.floor(angle / TURN) * TURN
    away = np.abs(reduced[:, None] - law.breaks[None, :]).min(axis=1)
    at_joint = away <= blur + AT_SAMPLE * step
    for order in range(3):
        size, slope = (np.abs(law.derivative_ordinates(k)).max() for k in (order, order + 1))
        inside = ~at_joint  # there `Law.__call__` may meet either side
        np.testing.assert_allclose(
            rows[order, inside],
            law(angle[inside], order),
            rtol=0,
            atol=ERRORS * EPS * size + blur * slope,
        )


@pytest.mark.variants(20)
@pytest.mark.parametrize(
    ("start", "step", "count"),
    [
        (0.0, 1e-3, 20_000),  # three turns, chunks
        (0.0, 8.7e-4, 1),
        (123.456, 8.7e-4, 10_000),
        (1000 * TURN + 1.0, 1e-3, 10_000),  # a thousand turns on
        (-5.0, 0.01, 2000),  # through θ = 0
        (1.0, 1e-9, 5000),  # tiny steps, one piece
        (0.3, 0.9, 300),  # a few samples a turn
        (0.0, 100.0, 500),  # many turns a step
        (0.0, TURN / 360, 720),  # samples on the joints
        (np.nextafter(TURN, 0.0), 1e-3, 500),
    ],
)
def test_samples_are_the_law(law, start, step, count):
    """Starts, steps and lengths of every kind, each sample against Law.__call__."""
    assert_is_the_law(law, start, step, count)


@given(
    start=st.floats(-100.0, 1000.0),
    exponent=st.floats(-6.0, 1.0),
    count=st.integers(1, 700),
    name=st.sampled_from(["poly345", "bezier15", "tm21", "cycloidal"]),
)
def test_any_samples_are_the_law(laws, start, exponent, count, name):
    """The same for starts and steps drawn at random."""
    assert_is_the_law(laws[name], start, 10.0**exponent, count)


def test_weights_and_offsets(law):
    """Rows are the asked combinations of s, s', s'' plus constants."""
    weights = np.array([[1.0, -2.0, 0.5], [0.0, 0.0, 3.0]])
    offsets = np.array([7.0, -1.0])
    plain = sample(law, 0.2, 1e-3, 3000, IDENTITY, NO_OFFSET)
    mixed = sample(law, 0.2, 1e-3, 3000, weights, offsets)
    expected = weights @ plain + offsets[:, None]
    np.testing.assert_allclose(mixed, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_no_samples(law):
    """Asking for none gives none."""
    assert sample(law, 1.0, 0.1, 0, IDENTITY, NO_OFFSET).shape == (3, 0)


@pytest.mark.parametrize("away", [-4, -1, 0, 1, 4])
def test_a_sample_at_a_joint_is_what_begins_there(laws, away):
    """Rounding of the first angle does not choose the side: s'' is the right limit.

    Else a force that steps there would be the one before or the one after, as it happens.
    """
    law, step = laws["tm21"], TURN / 3600
    for joint in law.breaks[1:-1]:
        start = joint - 1700 * step
        start += away * math.ulp(start)
        rows = sample(law, start, step, 2000, IDENTITY, NO_OFFSET)
        assert rows[2, 1700] == pytest.approx(law(joint + 1e-9, 2), rel=1e-6, abs=1e-9)


def test_parts_join(law):
    """A run taken in two parts is the run taken at once, to rounding."""
    whole = sample(law, 0.1, 2e-3, 5000, IDENTITY, NO_OFFSET)
    second = sample(law, 0.1 + 2e-3 * 1700, 2e-3, 3300, IDENTITY, NO_OFFSET)
    sizes = np.array([np.abs(law.derivative_ordinates(k)).max() for k in range(4)])
    tolerance = 1000 * EPS * (sizes[:3] + 20.0 * sizes[1:])
    assert np.all(np.abs(whole[:, 1700:] - second) <= tolerance[:, None])


@pytest.mark.variants(20)
@pytest.mark.parametrize("per_turn", [7200, 7200.5, 4096, 2777.7])
def test_many_turns_are_the_law(law, per_turn):
    """Turns of a whole number of samples are made together; each is the law all the same."""
    assert_is_the_law(law, 0.0, TURN / per_turn, round(5.3 * per_turn))


def test_turns_alike_are_found(law):
    """Where a turn is a whole number of samples its turns are one, else they are not."""
    width = TURN / 4096 / law.spans[0]

    def runs(apart, away):
        return [SampleRun.of(i * apart, i * apart + 1000, i * away, width) for i in range(4)]

    assert [len(train) for train in repeated(runs(4096, 0.0))] == [4]
    assert [len(train) for train in repeated(runs(4096, 1e-15))] == [4]
    assert [len(train) for train in repeated(runs(4096, 1e-13))] == [1] * 4
    uneven = [*runs(4096, 0.0), SampleRun.of(20_000, 21_000, 0.0, width)]
    assert [len(train) for train in repeated(uneven)] == [4, 1]


@pytest.mark.variants(20)
@pytest.mark.parametrize("step", [8.7e-4, TURN / 7200])
def test_samples_go_where_they_are_asked(law, step):
    """Rows of a larger block get what a new array would; its other rows stay as they are."""
    block = np.full((6, 20_000), 7.0)
    found = sample(law, 0.3, step, 20_000, IDENTITY, NO_OFFSET, block[2:5])
    np.testing.assert_array_equal(block[2:5], sample(law, 0.3, step, 20_000, IDENTITY, NO_OFFSET))
    assert np.shares_memory(found, block)
    assert (block[[0, 1, 5]] == 7.0).all()


def test_powers_left_out_change_no_digit(law):
    """The series in a chunk, cut where the rest is rounding, against Taylor's whole one."""
    width = 1.0 / 9000.0
    taylor = law.taylor[:1]
    series = ChunkSeries.of(taylor, width, 256)
    whole = taylor * (0.5 * width * 255) ** np.arange(law.degree + 1.0)
    at = bernstein.basis(law.degree, np.linspace(0.0, 1.0, 50))
    expected = np.matmul(at, whole) @ chunk_powers(law.degree, 256)
    found = np.matmul(at, series.table) @ series.powers
    np.testing.assert_allclose(found, expected, rtol=0, atol=2 * EPS * np.abs(expected).max())
    if law.degree > 12:
        assert series.table.shape[2] < law.degree + 1
