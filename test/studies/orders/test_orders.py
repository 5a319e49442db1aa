"""Orders (multiples of the cam's rotation frequency) of force and sound.

The tests cover the command `cam-rig orders`, the Fourier integrals and the order spectra.
"""

import csv
import dataclasses
import io
import math
from functools import partial

import mpmath
import numpy as np
import pytest

import cam_rig
from benchmark.speed.exact import powers
from cam_rig.acoustics import RadiationParameters, SoundSource, level_db
from cam_rig.acoustics.pressure import mean_square_rate
from cam_rig.dynamics import MODELS, FollowerParameters, TwoMassParameters
from cam_rig.errors import ConfigError, DynamicsError
from cam_rig.laws import Law
from cam_rig.simulation.inputs import parse_speeds
from cam_rig.simulation.simulate import simulate_ticks
from cam_rig.studies.orders.spectrum import (
    force_orders,
    order_spectrum,
    polynomial_integral,
    pulse_integral,
    vibration_integral,
)
from cam_rig.studies.orders.steady_force import BUILDERS, steady_force
from cam_rig.units import RPM, TURN

from ...cli.conftest import data_of, done


def test_a_cam_at_one_speed():
    """`cam-rig orders` prints the orders of a cam at one speed as CSV.

    Rise and fall of the 3-4-5 cam are equal, so the even orders are zero within rounding.
    """
    result = done("orders", "poly345", "--rpm", "400", "--orders", "12", "--csv", "-")
    rows = list(csv.DictReader(io.StringIO(result.stdout)))
    assert [float(row["order"]) for row in rows] == list(range(1, 13))
    amplitudes = [float(row["force_amplitude"]) for row in rows]
    assert max(amplitudes[1::2]) < 1e-10
    assert min(amplitudes[::2]) > 1.0
    assert float(rows[2]["frequency"]) == pytest.approx(20.0)
    assert "Phase: force = mean" in result.stderr


def test_a_scene_over_speed(tmp_path):
    """`cam-rig orders` of a scene uses its cams, rig, model and speeds.

    The phases of the orders relate to the cam angle, so that the orders add up to the force at θ =
    0, which is the preload.
    """
    found = data_of("orders", "quick", "--orders", "20", "--plot", tmp_path / "a.png")
    speeds = {(row["cam"], row["rpm"]): row for row in found["speeds"]}
    assert list(speeds) == [(c, r) for c in ("tm21", "bezier15") for r in (200, 300, 350, 400)]
    assert (speeds["bezier15", 200]["period"], speeds["bezier15", 200]["settled"]) == (1, True)
    at_rest = speeds["bezier15", 200]["mean_force"] + sum(
        row["force_amplitude"] * math.cos(row["force_phase"])
        for row in found["orders"]
        if (row["cam"], row["rpm"]) == ("bezier15", 200)
    )
    assert at_rest == pytest.approx(12.753, abs=0.5)  # the preload at zero lift


def test_speeds_are_parsed():
    """The text of --rpm is one speed, several, or a range with a step.

    Other texts are refused.
    """
    assert parse_speeds("300") == [300.0]
    assert parse_speeds("300,200") == [200.0, 300.0]
    assert parse_speeds("0.1:0.4:0.1") == pytest.approx([0.1, 0.2, 0.3, 0.4])
    for wrong in ("", "a", "1:2", "1:2:0", "2:1:1", "1:1e9:1", "nan", "-3", "1e6"):
        with pytest.raises(ConfigError, match=r"--rpm .*allowed: 300"):
            parse_speeds(wrong)


# -- Fourier integrals against 50 digits, at every phase and damping


PHASES = np.array([0.0, 1e-9, 0.3, 2.0, 7.0, 31.0, 400.0, 1e4])


def by_digits(coefficients, phase):
    """Return ∫₀¹ Σ aᵢ uⁱ e^{−iφu} du in 60 digits, with the phase φ.

    It is integrated by parts, or by a series for a small phase.
    """
    with mpmath.workdps(60):
        if phase < 1.0:
            terms = range(60)
            return sum(
                a * (-1j * mpmath.mpf(phase)) ** k / mpmath.factorial(k) / (i + k + 1)
                for i, a in enumerate(coefficients)
                for k in terms
            )
        total, derivative, w = mpmath.mpc(0), list(coefficients), mpmath.mpc(0, phase)
        for k in range(len(coefficients)):
            at_one = mpmath.fsum(derivative)
            total += (derivative[0] - at_one * mpmath.exp(-w)) / w ** (k + 1)
            derivative = [i * a for i, a in enumerate(derivative)][1:] or [mpmath.mpf(0)]
        return total


@pytest.mark.parametrize("degree", [0, 1, 3, 5, 7, 15, 30])
def test_a_polynomial_at_any_phase(degree):
    """The Fourier integral of a polynomial is exact to rounding at any phase."""
    ordinates = np.random.default_rng(degree).uniform(-1.0, 1.0, degree + 1)
    with mpmath.workdps(60):
        coefficients = powers(ordinates.tolist())
    exact = [complex(by_digits(coefficients, float(phase))) for phase in PHASES]
    assert np.abs(polynomial_integral(ordinates, PHASES) - exact).max() < 3e-15


@pytest.mark.parametrize("ratio", [0.0, 1e-6, 0.02, 0.7, 0.9999999, 1.0, 1.5, 40.0])
def test_a_vibration_at_any_damping(ratio):
    """The Fourier integral of a free vibration agrees with 50 digits at any damping.

    The cases include an undamped vibration in resonance, and critical and higher damping.
    """
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
            both = mpmath.zeros(4)  # the integral is a block of one exponential
            both[:2, :2], both[:2, 2:] = shifted * length, mpmath.eye(2) * length
            integral = mpmath.expm(both)[:2, 2:] * mpmath.matrix(start.tolist())
            exact = complex((mpmath.matrix(row.tolist()).T * integral)[0])
            assert abs(value - exact) < 2e-14 * scale, (ratio, rate)


def test_half_a_sine_of_unit_area():
    """The Fourier integral of a half sine of unit area agrees with a quadrature.

    It is 1 at φ = 0 and π/4 at φ = π.
    """
    phase = np.array([0.0, 1e-7, 1.0, np.pi - 1e-9, np.pi, np.pi + 1e-5, 20.0])
    with mpmath.workdps(30):
        half = mpmath.pi / 2

        def pulse(u, p):
            return half * mpmath.sin(mpmath.pi * u) * mpmath.expj(-float(p) * u)

        parts = mpmath.linspace(0, 1, 5)
        exact = [complex(mpmath.quad(partial(pulse, p=p), parts)) for p in phase]
    np.testing.assert_allclose(pulse_integral(phase), exact, rtol=0, atol=1e-15)
    assert abs(pulse_integral(np.array([np.pi]))[0]) == pytest.approx(np.pi / 4, abs=1e-15)


# -- orders of force and sound against the equations of the models, energy, and an FFT


PAPER = cam_rig.load_rig("paper_table2")


def random_law(seed, name="random"):
    """Return a smooth law of three Bézier segments, continuous up to s'''."""
    random = np.random.default_rng(seed)
    breaks = np.array([0.0, *np.sort(random.uniform(0.8, TURN - 0.8, 2)), TURN])
    places = random.uniform(0.0, 0.02, 3)
    ordinates = np.array([[places[i]] * 4 + [places[(i + 1) % 3]] * 4 for i in range(3)]).T
    return Law(name, breaks, ordinates)


def random_rig(seed):
    random = np.random.default_rng(100 + seed)
    return PAPER.with_follower(
        mass=float(random.uniform(0.5, 2.0)),
        damping=float(random.uniform(0.5, 60.0)),
        preload=float(random.uniform(3000.0, 4000.0)),  # contact is never lost
        stem_damping=float(random.uniform(1.0, 20.0)),
    )


def force_by_transfer(model, rig, lift, p, preload):
    """Return an order F_n = Z(p) s_n of the force from the lift's order s_n.

    An order is a harmonic of the cam speed, and p is inω. The dynamic stiffness Z follows from the
    equations of docs/theory.md.
    """
    f = FollowerParameters.from_rig(rig)
    if model in ("kinetostatic", "one_mass"):
        force = (f.mass * p**2 + f.damping * p + f.spring_stiffness) * lift
    elif model == "elastic_stem":
        stem, both = f.stem_stiffness, f.spring_stiffness + f.stem_stiffness
        force = stem * lift * (1.0 - stem / (f.mass * p**2 + f.damping * p + both))
    else:
        t = TwoMassParameters.from_rig(rig)
        end = t.end_mass * p**2 + (t.stem_damping + t.damping) * p
        away = lift * (1.0 - (t.stem_damping * p + t.stem_stiffness) / (end + t.stiffness))
        force = t.roller_mass * p**2 * lift + (t.stem_damping * p + t.stem_stiffness) * away
        preload *= t.share
    return force + preload * (p == 0.0)


@pytest.mark.parametrize("model", ["kinetostatic", "one_mass", "elastic_stem", "two_mass"])
@pytest.mark.parametrize("seed", range(3))
def test_in_contact_an_order_is_the_lifts_times_the_stiffness(model, seed):
    """In contact an order of the force is the lift's times the dynamic stiffness.

    An order is a harmonic of the cam speed. The tolerance is 2e-12 of the largest order plus the
    amplified rounding of the lift's order.
    """
    law, rig, speed = random_law(seed), random_rig(seed), (150.0 + 60.0 * seed) * RPM
    found = order_spectrum(law, model, rig, speed, 60)
    assert found.steady.settled
    assert (found.steady.turns, found.steady.landings) == (1, ())
    preload = FollowerParameters.from_rig(rig).preload
    lift = np.zeros(found.orders.size, dtype=complex)  # computed from the ordinates
    for low, span, column in zip(law.breaks[:-1], law.spans, law.ordinates.T, strict=True):
        integral = polynomial_integral(column, found.orders * span)
        lift += span / TURN * np.exp(-1j * found.orders * low) * integral
    wanted = force_by_transfer(model, rig, lift, 1j * found.orders * speed, preload)
    # The stiffness multiplies the rounding error of the lift's order.
    rounding = 1e-15 * np.abs(wanted / lift)
    assert (np.abs(found.force - wanted) < 2e-12 * found.amplitude.max() + rounding).all()


@pytest.mark.parametrize("cam", ["poly345", "bezier15", "b_spline"])
def test_all_orders_together_have_the_energy_of_the_turn(cam, laws, rig, follower):
    """The mean squares of all orders add up to that of the sound (Parseval's theorem).

    An order is a harmonic of the cam speed. The levels agree within 2e-6 dB.
    """
    law, speed, radiation = laws[cam], 300 * RPM, RadiationParameters.from_rig(rig)
    found = order_spectrum(law, "kinetostatic", rig, speed, 2000)
    exact = radiation.gain**2 * mean_square_rate(law, follower, radiation.corner_rate, speed)
    assert found.total_db == pytest.approx(float(level_db(exact**0.5)), abs=2e-6)


@pytest.mark.parametrize(
    ("cam", "model", "rpm", "away"),
    [
        ("bezier15", "one_mass", 400, 1e-14),
        ("poly345", "elastic_stem", 420, 1e-14),
        ("poly345", "one_mass", 400, 1e-8),
        ("poly345", "one_mass", 520, 2e-4),
        ("tm21", "one_mass", 380, 2e-4),
        ("poly345", "two_mass", 480, 2e-4),
    ],
)
def test_an_fft_agrees_with_the_orders(cam, model, rpm, away, laws, rig):
    """An FFT of the sampled force agrees with the orders up to its sampling error.

    An order is a harmonic of the cam speed. The error is rounding for a smooth force, and one
    sample at a jump of the force.
    """
    own = PAPER if model in ("elastic_stem", "two_mass") else rig
    steady = steady_force(laws[cam], model, own, rpm * RPM)
    assert steady.settled
    bare = dataclasses.replace(steady, landings=())
    orders = np.arange(40 * steady.turns)
    exact = force_orders(bare, orders * rpm * RPM / steady.turns, 1e-4)
    peak = np.abs(exact).max()
    differences = []
    for count in (2**14, 2**17):  # both sides' mean at a jump
        samples = steady.at(np.arange(count) * (steady.duration / count))
        differences.append(np.abs(np.fft.fft(samples)[: orders.size] / count - exact).max() / peak)
    assert differences[0] < 10.0 * away
    assert differences[1] < max(0.5 * differences[0], 1e-13)


def test_the_orders_agree_with_the_microphone(make_loaded_scene):
    """The level of all orders up to 60 kHz equals that of the simulated microphone.

    An order is a harmonic of the cam speed. The motion has one landing per turn. The tolerance is
    0.02 dB.
    """
    loaded = make_loaded_scene(cams=["tm21"], speeds=[350, 400], turns=3, sample_rate=192_000)
    silent = dataclasses.replace(loaded.radiation, background=-200.0)
    source = SoundSource(silent, 192_000, least_rate=192_000)
    heard = {}
    for tick in simulate_ticks(loaded):
        pressure = source.pressure(tick.force, tick.impulse, tick.start.speed)
        heard[tick.start.speed] = float(level_db(np.sqrt(np.mean(pressure**2))))
    for speed, level in heard.items():
        found = order_spectrum(loaded.laws["tm21"], "one_mass", loaded.rig, speed, 9000)
        assert len(found.steady.landings) == 1
        assert found.total_db == pytest.approx(level, abs=0.02)


def test_a_force_with_a_period_of_two_turns_has_half_orders(laws):
    """A force that repeats every two turns has orders 0.5, 1, 1.5 and so on.

    An order is a frequency as a multiple of the cam's.
    """
    found = order_spectrum(laws["bezier15"], "two_mass", PAPER, 600 * RPM, 20)
    assert found.steady.turns == 2
    assert found.orders[:4].tolist() == [0.0, 0.5, 1.0, 1.5]
    assert found.frequency[2] == pytest.approx(10.0)
    times = np.linspace(0.0, 0.1, 50)
    np.testing.assert_allclose(found.steady.at(times), found.steady.at(times + 0.2), atol=1e-6)


def test_a_smoother_cam_sounds_at_fewer_orders(laws, rig):
    """A smoother law has 99 % of its sound power in fewer orders.

    An order is a harmonic of the cam speed. A jump of the force, as on the TM21's cam, excites all
    orders.
    """
    highest = {}
    for cam in ("tm21", "poly345", "bezier15"):
        found = order_spectrum(laws[cam], "one_mass", rig, 300 * RPM, 100)
        highest[cam] = found.order_within(0.99)
        few = found.up_to(20)
        assert few.orders[-1] == 20
        assert few.level.tolist() == found.level[:21].tolist()
        assert found.level[found.loudest] == found.level[1:].max()
        whole = found.order_within(1.0 - 1e-15)
        assert highest[cam] <= whole <= 100
    assert highest["tm21"] > highest["poly345"] > highest["bezier15"]


def test_models_without_a_closed_form_are_refused(laws):
    """Orders of the torsional model, or of a law with velocity jumps, are refused."""
    with pytest.raises(ConfigError, match=r"a force in closed form: .* got torsional"):
        steady_force(laws["poly345"], "torsional", PAPER, 10.0)
    with pytest.raises(DynamicsError, match="velocity jumps"):
        steady_force(laws["worked_example_constant_velocity"], "kinetostatic", PAPER, 10.0)
    assert MODELS.keys() - BUILDERS.keys() == {"torsional"}
