"""Tests of the stroboscopic map: a follower's state from one turn to the next.

The map agrees with the models, and its derivative contracts as damping and landings require.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from cam_rig.dynamics import Interval, TwoMassParameters
from cam_rig.dynamics.events.backend import COMPILED, PLAIN, VARIABLE
from cam_rig.dynamics.events.trajectory import EndlessEventsError
from cam_rig.dynamics.events.turns import TURN_RESULT
from cam_rig.dynamics.one_mass import OneMassTrajectory
from cam_rig.dynamics.turn_map import StroboscopicMap
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law
from cam_rig.units import NS, RPM, TURN

from .helpers import ONE, noisy
from .test_compiled import bumpy


def random_map(laws, seed, fastest=900.0):
    """Return a random stroboscopic map of one mass, and the random generator.

    Law and cam speed are random, too. The map gives the state after a turn. `fastest` is the
    highest speed in rpm.
    """
    rng = np.random.default_rng(seed)
    names = ["poly345", "tm21", "bezier15", "cycloidal", "flat"]
    law = laws[names[int(rng.integers(len(names)))]]
    if seed % 4 == 1:
        law = bumpy(rng)
    elif seed % 8 == 3:
        law = noisy(lambda angle: 0.003 * (1.0 - np.cos(angle)), 1440, 2e-7, rng)
    p = replace(
        ONE,
        damping=[0.0, 8.642, 200.0][int(rng.integers(3))],
        preload=[0.0, 12.753, 80.0][int(rng.integers(3))],
        restitution=[0.0, 0.3, 0.7, 0.95][int(rng.integers(4))],
    )
    return StroboscopicMap(law, p, float(rng.uniform(200.0, fastest)) * RPM), rng


def random_two(laws, seed):
    """Return a random stroboscopic map of two masses, and the random generator.

    Law and cam speed are random, too. The map gives the state after a turn.
    """
    rng = np.random.default_rng(seed)
    names = ["poly345", "tm21", "bezier15", "cycloidal", "flat"]
    p = TwoMassParameters(
        roller_mass=float(rng.uniform(0.2, 1.0)),
        end_mass=float(rng.uniform(0.2, 1.0)),
        stem_stiffness=float(10.0 ** rng.uniform(3.7, 8.5)),
        spring_stiffness=4030.0,
        stem_damping=float(rng.choice([0.0, 8.642, 60.0])),
        damping=float(rng.choice([0.0, 8.642])),
        preload=float(rng.choice([0.0, 12.753, 80.0])),
        restitution=float(rng.choice([0.0, 0.3, 0.7, 0.95])),
    )
    law = laws[names[int(rng.integers(len(names)))]]
    return StroboscopicMap(law, p, float(rng.uniform(250.0, 900.0)) * RPM), rng


@pytest.mark.variants(12)
@pytest.mark.parametrize("seed", range(200))
def test_a_turn_has_the_landings_of_the_model(laws, seed):
    """A turn of the stroboscopic map has the landings of the simulated one-mass model.

    Their number and the speed of the fastest landing (relative tolerance 1e-9) are compared.
    """
    turn_map, _ = random_map(laws, seed)
    p, end = turn_map.parameters, turn_map.duration
    interval = Interval(0, round(end * NS), 0.0, turn_map.speed)
    trajectory = OneMassTrajectory(turn_map.law, p, interval)
    trajectory.run(None)
    landings = [e for e in trajectory.events if e.kind == "landing"]
    run = turn_map.run(1)
    # The interval has whole nanoseconds and may be slightly shorter or longer than the turn.
    at_end = [e for e in landings if e.time > end - 2e-9]
    assert abs(run.landings[0] - len(landings)) <= len(at_end)
    if not at_end and landings:
        hit = max(landings, key=lambda e: e.impulse)
        lost = 2.0 * hit.energy_lost / hit.impulse  # (1 − e) v, with the impulse m (1 + e) v
        max_speed = 0.5 * (hit.impulse / p.mass + lost)
        assert run.max_landing_speeds[0] == pytest.approx(max_speed, rel=1e-9)


@pytest.mark.variants(28)
@pytest.mark.parametrize("seed", range(175))
@pytest.mark.parametrize(("draw", "turns"), [(random_map, 30), (random_two, 12)])
def test_volumes_shrink_by_dampers_and_restitution(laws, seed, draw, turns):
    """The growth rates of a turn add up to the contraction by dampers and landings.

    A rate is the logarithm of the factor by which a small change of the state grows. Without
    contact the sum is 2 n ln r − (sum of c/m) T, with n landings, the restitution r and the turn T.
    After contact the state of one mass does not depend on its start. For two masses two rates are
    then −∞. If they are on the cam throughout, the other two add up to −(c₁ + c₂) T/m₂.
    """
    turn_map, rng = draw(laws, seed)
    p, time = turn_map.parameters, turn_map.duration
    run = turn_map.run(turns, (float(rng.uniform(0.0, 0.02)), float(rng.uniform(-0.5, 0.5))))
    free = (run.contact_times == 0.0) & (np.array([1.0, *run.is_flying[:-1]]) > 0.0)
    logarithm = math.log(p.restitution) if p.restitution > 0.0 else -math.inf
    landed = np.array([2.0 * n * logarithm if n else 0.0 for n in run.landings])
    if draw is random_map:
        decay = p.damping / p.mass
        assert np.all(run.growth[~free] == -math.inf)
        assert np.all(run.derivatives[~free] == 0.0)
    else:
        contact_decay = (p.stem_damping + p.damping) / p.end_mass
        decay = p.stem_damping / p.roller_mass + contact_decay
        assert np.all(run.growth[~free, 2:] == -math.inf)
        in_contact = np.isclose(run.contact_times, time, rtol=1e-12) & (run.landings == 0.0)
        sums = run.growth[in_contact, :2].sum(axis=1)
        np.testing.assert_allclose(sums, -contact_decay * time, rtol=1e-9, atol=1e-9)
        for derivative in run.derivatives[~free]:
            sizes = np.linalg.svd(derivative * turn_map.scale / turn_map.scale[:, None])[1]
            assert sizes[2] < 1e-9 * max(1.0, sizes[0])  # rank 2
    expected = landed - decay * time
    np.testing.assert_allclose(run.growth.sum(axis=1)[free], expected[free], rtol=1e-9, atol=1e-9)


@pytest.mark.variants(14)
@pytest.mark.parametrize("seed", range(80))
@pytest.mark.parametrize(
    ("draw", "rtol", "atol"), [(random_map, 1e-13, 0.0), (random_two, 1e-9, 1e-12)]
)
def test_the_bits_are_those_of_plain_python(laws, monkeypatch, seed, draw, rtol, atol):
    """Plain Python and compiled code give equal states of the stroboscopic map.

    They are equal bit by bit. The logarithms of the growth agree to rounding.
    """
    runs = []
    for form in (PLAIN, COMPILED):
        monkeypatch.setenv(VARIABLE, form)
        runs.append(draw(laws, seed)[0].run(4))
    np.testing.assert_array_equal(runs[0].states, runs[1].states)
    for name in TURN_RESULT.names:
        plain, compiled = (run.records[name].astype(float) for run in runs)
        np.testing.assert_allclose(plain, compiled, rtol=rtol, atol=atol)


@pytest.mark.variants(20)
@pytest.mark.parametrize("seed", range(80))
@pytest.mark.parametrize(("draw", "limit"), [(random_map, 1e-10), (random_two, 1e-9)])
def test_single_turns_equal_a_run(laws, seed, draw, limit):
    """Turns computed one by one, each from the previous end, equal one run.

    The relative error is at most 1e-10, or 1e-9 for two masses, times 1 + the growth of small
    changes in the turn.
    """
    turn_map, _ = draw(laws, seed)
    if turn_map.law.spans.size > 1000:
        pytest.skip("hundreds of bounces on a noisy cam enlarge rounding errors to 1e100")
    run, scale = turn_map.run(6), turn_map.scale
    for before, after in zip(run.states, run.states[1:], strict=False):
        single = turn_map.run(1, tuple(before))
        error = np.abs((single.states[0] - after) / scale).max()
        growth = np.abs(single.derivatives[0] * scale / scale[:, None]).max()
        assert error < limit * (1.0 + growth)


@pytest.mark.variants(8)
@pytest.mark.parametrize("seed", range(60))
def test_derivatives_are_differences(laws, seed):
    """The derivatives of the stroboscopic map equal numerical differences, to 1e-5.

    The differences are of fourth order.
    """
    turn_map, _ = random_map(laws, seed)
    start = turn_map.run(10).states[-1]
    if not start.any() or turn_map.law.spans.size > 1000:
        pytest.skip("derivatives on the cam are zero; on a noisy cam landings change their piece")
    derivative = turn_map.run(1, tuple(start)).derivatives[0]
    scale = turn_map.scale
    errors = []
    for step in (1e-5, 1e-6, 1e-7):
        columns = []
        for unit in np.diag(step * scale):
            ends = [turn_map.run(1, tuple(start + k * unit)).states[0] for k in (-2, -1, 1, 2)]
            columns.append(np.dot([1.0, -8.0, 8.0, -1.0], ends) / (12.0 * unit.sum()))
        differences = np.stack(columns, axis=1) * scale / scale[:, None]
        expected = derivative * scale / scale[:, None]
        errors.append(np.abs(differences - expected).max() / max(1.0, np.abs(expected).max()))
    assert min(errors) < 1e-5


def test_a_period_on_the_cam_has_no_memory(laws):
    """After a time of contact the motion is equal in all bits for every start state.

    Seven runs of 60 turns on the TM21 cam end in the same state.
    """
    turn_map = StroboscopicMap(laws["tm21"], replace(ONE, restitution=0.7), 370.0 * RPM)
    ends = {tuple(turn_map.run(60, (0.01 * i, 0.1 * i)).states[-1]) for i in range(6)}
    assert ends == {tuple(turn_map.run(60).states[-1])}


def test_a_follower_that_never_lands():
    """A follower without preload and with almost no spring never lands."""
    p = replace(ONE, spring_stiffness=1e-15, preload=0.0, damping=0.0, restitution=0.5)
    law = Law("disc", np.array([0.0, TURN]), np.zeros((2, 1)))
    run = StroboscopicMap(law, p, 400.0 * RPM).run(50, (0.0, 1.0))
    assert not run.landings.any()
    np.testing.assert_allclose(run.states[-1], [50 * 0.15, 1.0], rtol=1e-12)
    np.testing.assert_allclose(run.derivative(), [[1.0, 50 * 0.15], [0.0, 1.0]], atol=1e-12)


def test_invalid_arguments(laws):
    """A start below the cam, or a cam speed of 0, is an error of the turn map.

    The map gives the state after a turn.
    """
    turn_map = StroboscopicMap(laws["poly345"], ONE, 40.0)
    with pytest.raises(DynamicsError, match=r"gap is -0\.001; allowed"):
        turn_map.run(1, (-1e-3, 0.0))
    with pytest.raises(DynamicsError, match=r"speed is 0\.0 rad/s"):
        StroboscopicMap(laws["poly345"], ONE, 0.0)


def test_endless_bounces_are_an_error(laws, monkeypatch):
    """More landings per turn than the limit raise an error."""
    monkeypatch.setattr(OneMassTrajectory, "max_events", 50)
    p = replace(ONE, restitution=0.9)
    with pytest.raises(EndlessEventsError, match="more than 50 landings in a turn at"):
        StroboscopicMap(laws["tm21"], p, 350.0 * RPM).run(3)


@pytest.mark.long
@pytest.mark.slow
def test_a_million_turns(laws):
    """In a million turns the motion becomes periodic, and repeats to 1e-15 at the end.

    The case is the TM21 cam with one mass at 500 rpm. The last 1000 turns are compared.
    """
    run = StroboscopicMap(laws["tm21"], replace(ONE, restitution=0.7), 500.0 * RPM).run(1_000_000)
    assert np.ptp(run.states[-1000:], axis=0).max() < 1e-15
