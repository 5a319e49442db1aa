"""Orders of force and sound against the models' own equations, energy, and the FFT."""

import dataclasses

import numpy as np
import pytest

import cam_rig
from cam_rig.acoustics import RadiationParameters, SoundSource, level_db
from cam_rig.acoustics.pressure import mean_square_rate
from cam_rig.dynamics import MODELS, FollowerParameters, TwoMassParameters
from cam_rig.errors import ConfigError, DynamicsError
from cam_rig.laws import Law
from cam_rig.paper.orders import steady_force as steady_force_module
from cam_rig.paper.orders.spectrum import force_orders, order_spectrum, polynomial_integral
from cam_rig.paper.orders.steady_force import steady_force
from cam_rig.simulation.simulate import turned_ticks
from cam_rig.units import RPM, TURN

PAPER = cam_rig.load_rig("paper_table2")


def random_law(seed):
    """A smooth law of three pieces, C3 at each joint as half the ordinates are the neighbour's."""
    random = np.random.default_rng(seed)
    breaks = np.array([0.0, *np.sort(random.uniform(0.8, TURN - 0.8, 2)), TURN])
    places = random.uniform(0.0, 0.02, 3)
    ordinates = np.array([[places[i]] * 4 + [places[(i + 1) % 3]] * 4 for i in range(3)]).T
    return Law(f"random{seed}", breaks, ordinates)


def random_rig(seed):
    random = np.random.default_rng(100 + seed)
    return PAPER.with_follower(
        mass=float(random.uniform(0.5, 2.0)),
        damping=float(random.uniform(0.5, 60.0)),
        preload=float(random.uniform(3000.0, 4000.0)),  # no loss of contact
        stem_damping=float(random.uniform(1.0, 20.0)),
    )


def lift_orders(law, orders):
    """c_n of the lift, from its own ordinates."""
    total = np.zeros(orders.size, dtype=complex)
    for low, span, column in zip(law.breaks[:-1], law.spans, law.ordinates.T, strict=True):
        total += span * np.exp(-1j * orders * low) * polynomial_integral(column, orders * span)
    return total / TURN


def force_by_transfer(model, rig, lift, p, preload):
    """F_n = Z(p) s_n at p = inω, by the equations of docs/theory.md."""
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
    """Models are linear: an order of the force is the lift's times the dynamic stiffness."""
    law, rig, speed = random_law(seed), random_rig(seed), (150.0 + 60.0 * seed) * RPM
    found = order_spectrum(law, model, rig, speed, 60)
    assert found.steady.settled
    assert (found.steady.turns, found.steady.landings) == (1, ())
    preload = FollowerParameters.from_rig(rig).preload
    lift = lift_orders(law, found.orders)
    wanted = force_by_transfer(model, rig, lift, 1j * found.orders * speed, preload)
    # s_n is known to its rounding, which the stiffness multiplies
    rounding = 1e-15 * np.abs(wanted / lift)
    assert (np.abs(found.force - wanted) < 2e-12 * found.amplitude.max() + rounding).all()


@pytest.mark.parametrize("cam", ["poly345", "bezier15", "b_spline"])
def test_all_orders_together_have_the_energy_of_the_turn(cam):
    """Parseval: their mean squares sum to that of the sound, which another way finds."""
    law, rig, speed = cam_rig.build_law(cam_rig.load_cam(cam)), cam_rig.load_rig("tm21"), 300 * RPM
    radiation = RadiationParameters.from_rig(rig)
    found = order_spectrum(law, "kinetostatic", rig, speed, 2000)
    follower = FollowerParameters.from_rig(rig)
    exact = radiation.gain**2 * mean_square_rate(law, follower, radiation.corner_rate, speed)
    assert found.total_db == pytest.approx(float(level_db(exact**0.5)), abs=2e-6)


def sampled(steady, count):
    """The FFT of the force over its turns, with the mean of both sides where it jumps."""
    times = np.arange(count) * (steady.duration / count)
    return np.fft.fft(steady.at(times)) / count


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
def test_an_fft_comes_to_the_same(cam, model, rpm, away):
    """To rounding, or to one sample over a jump; twice the samples, half as far: the FFT is off."""
    law = cam_rig.build_law(cam_rig.load_cam(cam))
    rig = PAPER if model in ("elastic_stem", "two_mass") else cam_rig.load_rig("tm21")
    steady = steady_force(law, model, rig, rpm * RPM)
    assert steady.settled
    bare = dataclasses.replace(steady, landings=())
    orders = np.arange(40 * steady.turns)
    exact = force_orders(bare, orders * rpm * RPM / steady.turns, 1e-4)
    peak = np.abs(exact).max()
    differences = [
        np.abs(sampled(steady, n)[: orders.size] - exact).max() / peak for n in (2**14, 2**17)
    ]
    assert differences[0] < 10.0 * away
    assert differences[1] < max(0.5 * differences[0], 1e-13)


@pytest.mark.parametrize(("cam", "rpm"), [("poly345", 520), ("tm21", 400), ("bezier15", 600)])
def test_landings_keep_the_balance_of_momentum(cam, rpm):
    """Over a turn with flights the mean of force and landings is preload + k ȳ."""
    law, rig = cam_rig.build_law(cam_rig.load_cam(cam)), cam_rig.load_rig("tm21")
    found = order_spectrum(law, "one_mass", rig, rpm * RPM, 3)
    assert found.steady.landings
    motion = cam_rig.simulate(law, rig, rpm=rpm, turns=6, sample_rate=200_000)
    turn = round(200_000 * 60 / rpm)
    p = FollowerParameters.from_rig(rig)
    place = motion.lift[-turn * found.steady.turns :].mean()
    assert found.amplitude[0] == pytest.approx(p.preload + p.spring_stiffness * place, rel=1e-5)


def test_the_orders_are_what_the_microphone_hears(make_loaded_scene):
    """With landings, up to 60 kHz: the mean square of the sound's samples over a settled turn."""
    loaded = make_loaded_scene(cams=["tm21"], speeds=[350, 400], turns=3, sample_rate=192_000)
    silent = dataclasses.replace(loaded.radiation, background=-200.0)
    source = SoundSource(silent, 192_000, least_rate=192_000)
    heard = {}
    for tick in turned_ticks(loaded):
        pressure = source.pressure(tick.force, tick.impulse, tick.start.speed)
        heard[tick.start.speed] = float(level_db(np.sqrt(np.mean(pressure**2))))
    for speed, level in heard.items():
        found = order_spectrum(loaded.laws["tm21"], "one_mass", loaded.rig, speed, 9000)
        assert len(found.steady.landings) == 1
        assert found.total_db == pytest.approx(level, abs=0.02)


def test_a_force_that_comes_back_after_two_turns_has_halves_of_orders():
    """And its even places are the orders of the cam."""
    law = cam_rig.build_law(cam_rig.load_cam("bezier15"))
    found = order_spectrum(law, "two_mass", PAPER, 600 * RPM, 20)
    assert found.steady.turns == 2
    assert found.orders[:4].tolist() == [0.0, 0.5, 1.0, 1.5]
    assert found.frequency[2] == pytest.approx(10.0)
    times = np.linspace(0.0, 0.1, 50)
    np.testing.assert_allclose(found.steady.at(times), found.steady.at(times + 0.2), atol=1e-6)


def test_a_smoother_cam_sounds_at_fewer_orders():
    """99 % of the sound's power: a step of force reaches farthest, one of jerk less, none least."""
    rig, highest = cam_rig.load_rig("tm21"), {}
    for cam in ("tm21", "poly345", "bezier15"):
        law = cam_rig.build_law(cam_rig.load_cam(cam))
        found = order_spectrum(law, "one_mass", rig, 300 * RPM, 100)
        highest[cam] = found.order_within(0.99)
        few = found.up_to(20)
        assert few.orders[-1] == 20
        assert few.level.tolist() == found.level[:21].tolist()
        assert found.level[found.loudest] == found.level[1:].max()
        whole = found.order_within(1.0 - 1e-15)
        assert highest[cam] <= whole <= 100
    assert highest["tm21"] > highest["poly345"] > highest["bezier15"]


def test_what_has_no_closed_form_is_refused():
    """The torsional model; and a law whose velocity jumps, in a model that cannot."""
    law = cam_rig.build_law(cam_rig.load_cam("poly345"))
    with pytest.raises(ConfigError, match="model torsional: its force is no closed form"):
        steady_force(law, "torsional", PAPER, 10.0)
    jumping = cam_rig.build_law(cam_rig.load_cam("worked_example_constant_velocity"))
    with pytest.raises(DynamicsError, match="velocity jumps"):
        steady_force(jumping, "kinetostatic", PAPER, 10.0)
    assert MODELS.keys() - steady_force_module.steady_force.__globals__["BUILDERS"].keys() == {
        "torsional"
    }
