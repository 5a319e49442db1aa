"""Tests of the exact solution of linear systems against 50-digit arithmetic.

A system x' = A x + f(t) is driven by a polynomial of time f. Its solution over the duration of f is
called a piece.
"""

import itertools
from dataclasses import dataclass, replace

import mpmath as mp
import numpy as np
import pytest

from benchmark.speed import exact as many_digits_of
from benchmark.speed.models import CONTACT, Case, Oscillator, output_times
from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.dynamics.elastic_stem import response
from cam_rig.dynamics.free_masses import free_masses, from_inner, to_inner
from cam_rig.dynamics.linear.propagator import piece
from cam_rig.dynamics.linear.response import LinearResponse
from cam_rig.laws import bernstein
from cam_rig.units import TURN


@pytest.fixture
def exact(many_digits):
    """Function that returns a state in many digits, from the stored reference values."""

    def recall(matrix, forcing, duration, start, time):
        inputs = (matrix, forcing, duration, start, time)
        return many_digits(lambda: by_exponential(*inputs), inputs)

    return recall


def by_exponential(matrix, forcing, duration, start, time):
    """Return the exact state at a time (s), computed with 60 digits.

    It is the matrix exponential of the system with the powers tʲ/j! as additional states. `forcing`
    has the Bernstein coefficients of the drive over `duration` (s), and `start` is the state at
    time 0.
    """
    n, degree = matrix.shape[0], forcing.shape[1] - 1
    with mp.workdps(60):
        size = n + degree + 1
        augmented = mp.zeros(size)
        for i in range(n):
            for j in range(n):
                augmented[i, j] = mp.mpf(matrix[i, j])
            row = [mp.mpf(x) for x in forcing[i]]
            for j in range(degree + 1):  # f⁽ʲ⁾(0) = p!/(p−j)! Δʲ f₀ / Tʲ
                augmented[i, n + j] = mp.ff(degree, j) * row[0] / mp.mpf(duration) ** j
                row = [b - a for a, b in itertools.pairwise(row)]
        for j in range(degree):
            augmented[n + j + 1, n + j] = 1
        initial = mp.matrix([*(mp.mpf(x) for x in start), 1, *[0] * degree])
        end = mp.expm(augmented * mp.mpf(time), method="taylor") * initial
        return np.array([float(end[i]) for i in range(n)])


@pytest.mark.parametrize("degree", [0, 5, 15])
@pytest.mark.parametrize("n", [1, 2, 4])
def test_random_stable_system(exact, n, degree):
    """States of random stable linear systems are exact to 1e-11 of their maximum.

    The drive is a polynomial over a few time constants.
    """
    rng = np.random.default_rng(10 * n + degree)
    matrix = rng.normal(size=(n, n))
    matrix -= (np.linalg.eigvals(matrix).real.max() + 0.5) * np.eye(n)  # all modes decay
    forcing = rng.normal(size=(n, degree + 1))
    start, duration = rng.normal(size=n), 12.0
    part = piece(matrix, forcing, duration)
    times = np.array([0.0, 0.3, 0.7, 1.0]) * duration
    got = part.at(start, times)
    expected = np.stack([exact(matrix, forcing, duration, start, t) for t in times], axis=1)
    size = np.abs(expected).max()
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-11 * size)
    np.testing.assert_allclose(part.end(start), expected[:, -1], rtol=0, atol=1e-11 * size)


#: Cases: matrix, seed and number of coefficients of the drive, start state, and durations (s). The
#: durations are much shorter and longer than the time constant of 1 s. Other cases are an undamped
#: mode over exactly its period, modes without a spring, which drift, and a matrix with one
#: eigenvector.
SPECIAL = {
    "quick": ([[-1.0]], 5, 6, [0.7], [1e-3, 0.1, 1.0, 10.0, 1000.0]),
    "quick, degree 15": ([[-1.0]], 15, 16, [0.7], [1e-3, 0.1, 1.0, 10.0, 1000.0]),
    "resonance": ([[0.0, TURN], [-TURN, 0.0]], 3, 6, [1.0, -2.0], [1.0]),
    "drift": ([[0.0]], 8, 6, [1.0], [2.0]),
    "damped drift": ([[0.0, 1.0], [0.0, -3.0]], 8, 6, [1.0, 1.0], [2.0]),
    "critical": ([[0.0, 1.0], [-25.0, -10.0]], 9, 8, [0.3, -1.0], [0.01, 1.0, 20.0]),
}


@pytest.mark.parametrize("name", SPECIAL)
def test_special_matrices(exact, name):
    """Systems with repeated eigenvalues or without a spring are solved to 1e-12.

    The systems are linear. The end states are compared with 60-digit values, relative to their
    maximum.
    """
    matrix, seed, count, start, durations = SPECIAL[name]
    matrix, start = np.array(matrix), np.array(start)
    forcing = np.random.default_rng(seed).normal(size=(start.size, count))
    for duration in durations:
        expected = exact(matrix, forcing, duration, start, duration)
        got = piece(matrix, forcing, duration).end(start)
        np.testing.assert_allclose(got, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


# -- extreme systems: the stiffest stem without damping, critical damping, a free mass

SPEED = 300.0 * np.pi / 30.0


@dataclass(frozen=True)
class Vibration(Oscillator):
    """Reference of one mass on an elastic stem, in the coordinate of the code.

    It is eq. 5 of the paper for the vibration r = x − α s, where α s is the static part of the
    displacement x. A reference for x would not show errors of the force: rounding of the lift of
    1e-17 m is negligible in x, but the force multiplies it by the stiffness of the stem.
    """

    def phases(self):
        share = self.stem_stiffness / (self.stem_stiffness + self.spring_stiffness)
        by_law = (0, -share * self.damping / self.mass, -share, 0)
        return {CONTACT: replace(super().phases()[CONTACT], drive=(by_law,))}


def errors(reference, law, model, speed, turns=1):
    """Return the largest errors of vibration and vibration velocity against 50 digits.

    They are relative to the largest value. `reference` is the fixture `many_digits`, `model` a
    `Vibration`, and `speed` is in rad/s.
    """
    case = Case("edge", "edge", law, model, speed, turns, turns, output_times(speed, turns, 29))
    wanted = reference.solution(case, many_digits_of.solve)
    numbers = [float(x) for x in vars(model).values()]
    mass, damping, spring, stem = numbers
    follower = FollowerParameters(mass, spring, damping, 0.0, stem)
    got = response(law, follower, speed).states(np.zeros(2), 0.0, case.times)
    pairs = (got[0], wanted.displacement[0]), (got[1], wanted.velocity[0])
    return [float(np.abs(x - y).max() / np.abs(y).max()) for x, y in pairs]


@pytest.mark.variants(4)
@pytest.mark.parametrize("cam", ["poly345", "bezier15", "cycloidal", "tm21"])
@pytest.mark.parametrize("turns", [1, 20])
def test_stiffest_stem_without_damping(laws, many_digits, cam, turns):
    """With the stiffest stem and no damping the motion is exact to rounding.

    The stem has 1e10 N/m. The relative error is at most four times the rounding error of the
    vibration's phase, which is 17 500 rad per turn.
    """
    # The phase Ωt is 17 500 rad per turn. The tolerance is four times its rounding, eps Ωt, because
    # the parts of a turn are added.
    model = Vibration(1.3, 0.0, 4030.0, 1e10)
    phase = np.sqrt(1e10 / 1.3) * turns * TURN / SPEED
    limit = 4.0 * np.finfo(float).eps * phase
    assert max(errors(many_digits, laws[cam], model, SPEED, turns)) < limit


@pytest.mark.variants(7)
@pytest.mark.parametrize("off", [0.0, 1e-12, -1e-12, 1e-6, -1e-6])
@pytest.mark.parametrize("speed", [0.3, 20.0, 3000.0])
def test_a_critically_damped_stem(laws, many_digits, off, speed):
    """A vibration with critical damping, or close to it, is exact to 1e-11.

    At critical damping the two decay rates, 64 1/s, coincide.
    """
    # The reference uses eigenvectors, so its damping differs from critical by a relative 1e-22.
    with mp.workdps(60):
        damping = mp.mpf(128.0 * (1.0 + off)) * (1 + mp.mpf(10) ** -22)
    model = Vibration(1.0, damping, 96.0, 4000.0)
    assert max(errors(many_digits, laws["poly345"], model, speed)) < 1e-11


def test_critically_damped_flight():
    """A free flight of two masses with a critically damped mode is exact to 1e-12.

    The error is relative to the size of the motion. The damping is proportional to the stiffness.
    """
    m1, m2, k1, k2 = 1.0, 2.0, 3000.0, 1000.0
    squares = np.linalg.eigvals(np.array([[k1 / m1, -k1 / m1], [-k1 / m2, (k1 + k2) / m2]]))
    for square in squares:
        beta = 2.0 / float(np.sqrt(square))
        c1, c2 = beta * k1, beta * k2
        p = TwoMassParameters(m1, m2, k1, k2, c1, c2, 12.0)
        start = np.array([0.01, 0.5, 0.008, -0.2])
        times = np.array([1e-5, 1e-3, 0.02, 0.3])
        matrix = np.zeros((4, 4))
        matrix[0, 1] = matrix[2, 3] = 1.0
        matrix[1] = np.array([-k1, -c1, k1, c1]) / m1
        matrix[3] = np.array([k1, c1, -(k1 + k2), -(c1 + c2)]) / m2
        load = np.array([[0.0], [0.0], [0.0], [-12.0 / m2]])
        inner = to_inner(p, start)
        got = from_inner(p, inner[:, None] + free_masses(p).state_change(inner, times)[0])
        for i, time in enumerate(times):
            exact, scale = by_exponential(matrix, load, 1.0, start, time), [0.02, 1.0, 0.02, 1.0]
            np.testing.assert_allclose((got[:, i] - exact) / scale, 0.0, atol=1e-12)


@pytest.mark.parametrize("turns", [1, 7, 1000])
def test_a_mass_without_spring_and_damper(laws, turns):
    """A mass without spring and damper under a force K s(θ) moves as in a closed form.

    The velocity v increases by K ∮s dt per turn of duration T, and x(NT) = N x(T) + v(T) T N(N −
    1)/2 after N turns. The relative tolerance is 1e-12.
    """
    law, push = laws["poly345"], 7.0
    free = np.array([[0.0, 1.0], [0.0, 0.0]])
    drive = np.array([[0.0, 0.0, 0.0], [push, 0.0, 0.0]])
    model = LinearResponse(law, SPEED, free, drive, np.zeros(2))
    speed_gain = distance = 0.0
    for ordinates, span in zip(law.ordinates.T, law.spans / SPEED, strict=True):
        once = span * bernstein.antiderivative(ordinates)
        distance += speed_gain * span + push * span * bernstein.antiderivative(once)[-1]
        speed_gain += push * once[-1]
    period = TURN / SPEED
    x, v = model.end(np.zeros(2), 0.0, turns * period)
    assert v == pytest.approx(turns * speed_gain, rel=1e-12)
    drift = turns * distance + speed_gain * period * turns * (turns - 1) / 2
    assert x == pytest.approx(drift, rel=1e-12)
