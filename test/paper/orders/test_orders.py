"""cam-rig orders: of a cam and of a scene, tables, CSV, JSON, a plot, refusals in a line."""

import csv
import io
import json
import math
from functools import partial

import mpmath
import numpy as np
import pytest

from cam_rig.errors import ConfigError
from cam_rig.paper.orders.spectrum import polynomial_integral, pulse_integral, vibration_integral
from cam_rig.simulation.asked import speeds_in

from ...cli.conftest import call as run

call = partial(run, "orders")


def test_a_cam_at_one_speed():
    """3-4-5 up and down alike: its even orders are rounding; the CSV has what the table shows."""
    result = call("poly345", "--rpm", "400", "--orders", "12", "--csv", "-")
    assert result.exit_code == 0, result.stderr
    rows = list(csv.DictReader(io.StringIO(result.stdout)))
    assert [float(row["order"]) for row in rows] == list(range(1, 13))
    amplitudes = [float(row["force_amplitude"]) for row in rows]
    assert max(amplitudes[1::2]) < 1e-10
    assert min(amplitudes[::2]) > 1.0
    assert float(rows[2]["frequency"]) == pytest.approx(20.0)
    assert "Phase: force = mean" in result.stderr


def test_a_scene_over_speed(tmp_path):
    """Its cams, rig, model and speeds; the phase is of the force over θ."""
    result = call("quick", "--orders", "20", "--json", "-", "--plot", tmp_path / "a.png")
    assert result.exit_code == 0, result.stderr
    found = json.loads(result.stdout)
    speeds = {(row["cam"], row["rpm"]): row for row in found["speeds"]}
    assert list(speeds) == [(c, r) for c in ("tm21", "bezier15") for r in (200, 300, 350, 400)]
    assert (speeds["bezier15", 200]["period"], speeds["bezier15", 200]["settled"]) == (1, True)
    at_rest = speeds["bezier15", 200]["mean_force"] + sum(
        row["force_amplitude"] * math.cos(row["force_phase"])
        for row in found["orders"]
        if (row["cam"], row["rpm"]) == ("bezier15", 200)
    )
    assert at_rest == pytest.approx(12.753, abs=0.5)  # the preload, where the lift is zero


def test_another_rig_and_model():
    """A cam, or a cam of a scene, on a rig that is named; the model by the field's name."""
    of_cam = call("poly345", "--rig", "paper_table2", "--model", "two_mass", "--rpm", "390,400")
    assert of_cam.exit_code == 0, of_cam.stderr
    words = ["--cam", "poly345", "--rpm", "400", "--rig", "paper_table2", "--json", "-"]
    of_scene = json.loads(call("tm21_sweep", *words).stdout)
    assert of_scene["run"] == {"rig": "paper_table2", "model": "one_mass"}


def test_speeds_as_words():
    """One, some, or from and to by a step."""
    assert speeds_in("300") == [300.0]
    assert speeds_in("300,200") == [200.0, 300.0]
    assert speeds_in("0.1:0.4:0.1") == pytest.approx([0.1, 0.2, 0.3, 0.4])
    for wrong in ("", "a", "1:2", "1:2:0", "2:1:1", "1:1e9:1", "nan", "-3", "1e6"):
        with pytest.raises(ConfigError, match=r"--rpm .*allowed: 300"):
            speeds_in(wrong)


# -- the Fourier integrals against 50 digits, at every phase; resonance and critical damping too


PHASES = np.array([0.0, 1e-9, 0.3, 2.0, 7.0, 31.0, 400.0, 1e4])


def by_digits(powers, phase):
    """∫₀¹ Σ aᵢ uⁱ e^{−iφu} du by parts, or by its series for a small phase, in 60 digits."""
    with mpmath.workdps(60):
        if phase < 1.0:
            terms = range(60)
            return sum(
                a * (-1j * mpmath.mpf(phase)) ** k / mpmath.factorial(k) / (i + k + 1)
                for i, a in enumerate(powers)
                for k in terms
            )
        total, derivative, w = mpmath.mpc(0), list(powers), mpmath.mpc(0, phase)
        for k in range(len(powers)):
            at_one = mpmath.fsum(derivative)
            total += (derivative[0] - at_one * mpmath.exp(-w)) / w ** (k + 1)
            derivative = [i * a for i, a in enumerate(derivative)][1:] or [mpmath.mpf(0)]
        return total


@pytest.mark.parametrize("degree", [0, 1, 3, 5, 7, 15, 30])
def test_a_polynomial_at_any_phase(degree):
    """To some units in the last place of its largest ordinate, small phases and large ones."""
    ordinates = np.random.default_rng(degree).uniform(-1.0, 1.0, degree + 1)
    with mpmath.workdps(60):
        powers = [mpmath.mpf(0)] * (degree + 1)
        for j, b in enumerate(ordinates):
            for k in range(degree - j + 1):
                powers[j + k] += (
                    mpmath.mpf(float(b))
                    * mpmath.binomial(degree, j)
                    * mpmath.binomial(degree - j, k)
                    * (-1) ** k
                )
    exact = [complex(by_digits(powers, float(phase))) for phase in PHASES]
    assert np.abs(polynomial_integral(ordinates, PHASES) - exact).max() < 3e-15


@pytest.mark.parametrize("ratio", [0.0, 1e-6, 0.02, 0.7, 0.9999999, 1.0, 1.5, 40.0])
def test_a_vibration_at_any_damping(ratio):
    """Undamped in resonance, critical, creeping: ∫ c e^{At} z e^{−iΩt} dt in 50 digits."""
    own, length = 300.0, 0.05
    matrix = np.array([[0.0, 1.0], [-(own**2), -2.0 * ratio * own]])
    row, start = np.array([3.0, 0.02]), np.array([1.0, -150.0])
    rates = np.array([0.0, 12.0, 299.9, 300.0, 301.0, 4000.0])
    found = vibration_integral(matrix, row, start, length, rates)
    scale = length * 5.0
    with mpmath.workdps(50):
        for rate, value in zip(rates, found, strict=True):
            shift = mpmath.mpc(0, float(rate))
            shifted = mpmath.matrix(matrix.tolist()) - shift * mpmath.eye(2)
            both = mpmath.zeros(4)  # the integral stands in the corner of one exponential
            both[:2, :2], both[:2, 2:] = shifted * length, mpmath.eye(2) * length
            integral = mpmath.expm(both)[:2, 2:] * mpmath.matrix(start.tolist())
            exact = complex((mpmath.matrix(row.tolist()).T * integral)[0])
            assert abs(value - exact) < 2e-14 * scale, (ratio, rate)


def test_half_a_sine_of_unit_area():
    """1 at φ = 0; π/4 in size at φ = π, where its formula is 0/0; else by quadrature."""
    phase = np.array([0.0, 1e-7, 1.0, np.pi - 1e-9, np.pi, np.pi + 1e-5, 20.0])
    with mpmath.workdps(30):
        exact = [
            complex(
                mpmath.quad(
                    lambda u, p=p: (
                        mpmath.pi / 2 * mpmath.sin(mpmath.pi * u) * mpmath.expj(-float(p) * u)
                    ),
                    mpmath.linspace(0, 1, 5),
                )
            )
            for p in phase
        ]
    np.testing.assert_allclose(pulse_integral(phase), exact, rtol=0, atol=1e-15)
    assert abs(pulse_integral(np.array([np.pi]))[0]) == pytest.approx(np.pi / 4, abs=1e-15)
