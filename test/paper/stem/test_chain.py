"""A stem of n masses: two masses, closed forms, and the bar that is its limit."""

import math
from dataclasses import replace

import numpy as np
import pytest

from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.linear.sampling import sample
from cam_rig.dynamics.two_mass.masses import contact_response, force_output
from cam_rig.paper.stem.chain import BAR, Stem, stem_turn
from cam_rig.units import RPM, TURN

from .solver import chain_response, exact

SPEED = 300.0 * RPM


@pytest.fixture(scope="module")
def follower(table2):
    """The follower of Table 2."""
    return TwoMassParameters.from_rig(table2)


def some_follower(seed):
    """A damped follower by chance, as stiff as its speeds can be resolved."""
    rng = np.random.default_rng(seed)
    return TwoMassParameters(
        *rng.uniform(0.2, 1.5, 2), 10.0 ** rng.uniform(5.5, 7.0), rng.uniform(1e3, 1e4),
        *rng.uniform(2.0, 30.0, 2), rng.uniform(10.0, 50.0),
    )  # fmt: skip


def test_masses_and_static_stiffness_are_kept(follower):
    """However many masses: their sum, and what a slow lift meets."""
    for elements in (1.0, 2.0, 7.0, BAR):
        stem = Stem(follower, elements)
        total = stem.foot_mass + stem.mass + stem.head_mass
        assert total == pytest.approx(follower.roller_mass + follower.end_mass)
        force, head = stem.transfer(np.array([1e-4j]))
        assert abs(force[0]) == pytest.approx(follower.share * follower.spring_stiffness, rel=1e-6)
        assert abs(head[0]) == pytest.approx(follower.share, rel=1e-6)


@pytest.mark.variants(8)
@pytest.mark.parametrize("seed", range(3))
def test_one_element_is_the_two_mass_follower(law, seed):
    """The same contact force, to rounding, on rigs by chance."""
    p = some_follower(seed)
    model = contact_response(law, p, SPEED)
    step = TURN / SPEED / 500
    two = sample(model, model.periodic(), 0.0, 0.0, step, 500, force_output(p))[0]
    np.testing.assert_allclose(exact(law, Stem(p, 1.0), SPEED, 500)[0], two, rtol=0, atol=1e-9)


@pytest.mark.parametrize("elements", [1.0, 2.0, 5.0])
def test_natural_frequencies_are_those_of_the_matrix(laws, follower, elements):
    """Without damping the chain's matrix has them as its imaginary eigenvalues."""
    undamped = Stem(replace(follower, stem_damping=0.0, damping=0.0), elements)
    model = chain_response(laws["poly345"], undamped, SPEED)[0]
    rates = np.sort(np.abs(np.linalg.eigvals(model.matrix).imag))[::2]
    np.testing.assert_allclose(undamped.natural_frequencies(9), rates, rtol=1e-9)


def test_a_fixed_free_bar(follower):
    """Neither head nor spring: (i + ½) π √(k/m); the chain's √(4 n² k/m) sin((i + ½) π/2n)."""
    free = replace(follower, roller_mass=0.65, end_mass=0.65, spring_stiffness=1e-9)
    rate, mode = math.sqrt(free.stem_stiffness / 1.3), np.arange(4) + 0.5
    bar = Stem(free, BAR).natural_frequencies(4)
    np.testing.assert_allclose(bar, mode * math.pi * rate, rtol=1e-12)
    chain = Stem(free, 12.0).natural_frequencies(4)
    np.testing.assert_allclose(chain, 24.0 * rate * np.sin(mode * math.pi / 24.0), rtol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_masses_tend_to_the_bar_as_one_over_n_squared(seed):
    """Frequencies and transfers alike: twice the masses, a quarter of the error."""
    p, rates = some_follower(seed), 1j * np.array([300.0, 900.0, 2500.0])
    limit, bar = Stem(p, BAR).natural_frequencies(3), Stem(p, BAR).transfer(rates)
    errors = []
    for n in (32.0, 64.0):
        chain = Stem(p, n)
        found = chain.natural_frequencies(3)
        away = [np.abs(a - b) for a, b in zip(chain.transfer(rates), bar, strict=True)]
        errors.append(np.concatenate([np.abs(found - limit), *away]))
    np.testing.assert_allclose(errors[0] / errors[1], 4.0, rtol=0.02)
    assert (errors[1][:3] / limit < 0.01).all()


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("elements", [1.0, 3.0, 8.0])
def test_the_series_is_the_exact_solver(laws, seed, elements):
    """Two ways to one turn: harmonic by harmonic, and piece by piece in closed form."""
    law, stem = laws[("poly4567", "bezier15")[seed % 2]], Stem(some_follower(seed), elements)
    turn = stem_turn(law, stem, SPEED)
    force, head = exact(law, stem, SPEED, turn.angle.size)
    p = stem.follower
    head += p.preload / p.stiffness - p.share * law(turn.angle)
    np.testing.assert_allclose(turn.force, force, rtol=0, atol=1e-5 * np.abs(force).max())
    np.testing.assert_allclose(turn.head, head, rtol=0, atol=1e-6 * np.abs(head).max())


def test_a_bar_transmits_no_faster_than_sound(follower):
    """A short pulse on the foot comes to the head after √(m/k), and not before."""
    stem = Stem(replace(follower, stem_damping=0.0), BAR)
    travel, period = math.sqrt(stem.mass / follower.stem_stiffness), 0.05
    count, decay = 2**13, 200.0  # off the imaginary axis, so that one period is not the next
    rates = decay + 1j * TURN / period * np.arange(count + 1)
    times = np.arange(2 * count) * period / (2 * count)
    pulse = np.exp(-((times - 3e-4) ** 2) / 2.0 / (5e-5) ** 2)
    spectrum = np.fft.rfft(pulse * np.exp(-decay * times)) * stem.transfer(rates)[1]
    head = np.fft.irfft(spectrum) * np.exp(decay * times)
    early = times < travel
    assert np.abs(head[early]).max() < 1e-3 * np.abs(head).max()
    arrives = times[np.argmax(np.abs(head[times < 2.0 * travel]) > 0.1 * np.abs(head).max())]
    assert travel < arrives < 1.5 * travel
