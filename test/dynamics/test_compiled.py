"""Plain Python and the compiled search give the same bits."""

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from cam_rig.dynamics import MODELS, FollowerParameters, Interval, two_mass
from cam_rig.dynamics.events import search as compiled
from cam_rig.dynamics.events.runs import run_events
from cam_rig.dynamics.events.search import ALWAYS, PLAIN, VARIABLE, form_of
from cam_rig.dynamics.free_masses import TwoMassParameters, free_masses
from cam_rig.dynamics.jump.jump_speed import rigid_jump
from cam_rig.dynamics.jump.search import force_run
from cam_rig.dynamics.turn_map import StroboscopicMap
from cam_rig.dynamics.two_mass import Separation, first_lift_off
from cam_rig.laws import Law, rows
from cam_rig.units import NS, RPM, TURN

from .helpers import ONE, TWO


def bumpy(rng):
    """A cubic law of random pieces, C¹, whose velocity may jump at one joint."""
    count = int(rng.integers(2, 30))
    breaks = np.array([0.0, *np.sort(rng.uniform(0.1, TURN - 0.1, count - 1)), TURN])
    points = 0.01 * rng.standard_normal(count)
    ends, third = np.roll(points, -1), np.zeros(count)
    law = np.stack([points, points + third, ends, ends])
    if rng.uniform() < 0.3:
        law[1, 0] += 0.005
    return Law("bumpy", breaks, law)


def random_runs(laws, seed):
    """A law, both models' numbers, and an interval, at any speed, steady or on a ramp."""
    rng = np.random.default_rng(seed)
    names = ["poly345", "tm21", "bezier15", "cycloidal"]
    law = bumpy(rng) if seed % 3 == 0 else laws[names[int(rng.integers(len(names)))]]
    rate = math.sqrt(4030.0 / 1.3)
    damping = [0.0, 8.642, 2.0 * 1.3 * rate, 1e4][int(rng.integers(4))]
    restitution = [0.0, 0.5, 0.9][int(rng.integers(3))]
    one = replace(ONE, damping=damping, restitution=restitution)
    stem = [1.26e6, 3.3e8, 8000.0][int(rng.integers(3))]
    two = replace(
        TWO, stem_stiffness=stem, stem_damping=damping, damping=damping, restitution=restitution
    )
    rpm = 10.0 ** rng.uniform(-1.0, 4.3) if seed % 4 == 0 else rng.uniform(300.0, 800.0)
    speed, angle = rpm * RPM, float(rng.uniform(0.0, 1e5 * TURN))
    acceleration = float(rng.uniform(0.0, 0.2)) * speed**2 if seed % 5 == 0 else 0.0
    length = round(0.7 * TURN / speed * NS)
    return law, one, two, Interval(0, length, angle, speed, acceleration)


@pytest.mark.variants(4)
@pytest.mark.parametrize("seed", range(24))
def test_the_bits_are_the_same(laws, monkeypatch, seed):
    """Events, samples and the state at the end of both models."""
    law, one, two, interval = random_runs(laws, seed)
    for model, p in (("one_mass", one), ("two_mass", two)):
        found = []
        for form in (PLAIN, ALWAYS):
            monkeypatch.setenv(VARIABLE, form)
            found.append(MODELS[model].advance(law, p, None, interval, 1000))
        (end, block), (other_end, other_block) = found
        assert block.events == other_block.events
        assert end == other_end
        assert np.array_equal(block.rows, other_block.rows)


def test_masses_too_much_alike(laws, monkeypatch):
    """Where the motions have no pairs it goes by the exponential: the same bits, the same times."""
    p, found = replace(TWO, restitution=0.5), []
    unpaired = replace(free_masses(p), pairs=None)
    for system, form in ((free_masses(p), PLAIN), (unpaired, PLAIN), (unpaired, ALWAYS)):
        monkeypatch.setenv(VARIABLE, form)
        monkeypatch.setattr(two_mass, "free_masses", lambda _, system=system: system)
        course = Separation(laws["poly345"], p, 450.0 * RPM)
        course.run(0.2)
        found.append(course.events)
    paired, plain, whole = found
    assert plain == whole
    assert len(plain) > 4
    times = [[event.time for event in events] for events in (paired, plain)]
    assert times[0] == pytest.approx(times[1], abs=1e-12)


@pytest.mark.parametrize("kind", [int, np.float32, Fraction])
def test_a_number_of_any_kind(laws, monkeypatch, kind):
    """Whole numbers and fractions: the same bits as floats, and nothing is compiled once more."""
    monkeypatch.setenv(VARIABLE, ALWAYS)
    law, found = laws["poly345"], []
    for number in (float, kind):
        one = FollowerParameters(*map(number, (2, 4096, 8, 16, 2**28, 0)))
        two = TwoMassParameters(*map(number, (1, 1, 2**20, 4096, 2, 8, 16, 0)))
        assert all(type(value) is float for p in (one, two) for value in vars(p).values())
        speed, angle, limit = map(number, (64, 1, 1))
        interval = Interval(0, NS // 4, angle, speed)
        _, block = MODELS["one_mass"].advance(law, one, None, interval, 1000)
        course = Separation(law, two, speed, angle)
        course.run(limit)
        turns = [StroboscopicMap(law, p, speed).run(3).states.tolist() for p in (one, two)]
        loss = first_lift_off(law, two, speed, np.zeros(2), limit)
        least = force_run(law, two, 0.1).lowest(speed)
        found.append((block.events, course.events, turns, loss, least, rigid_jump(law, one)))
    assert found[0] == found[1]
    assert len(course.events) > 4
    assert len(compiled._compiled(run_events).signatures) == 1


def test_a_loss_of_contact_alone(laws, monkeypatch):
    """As the jump speed's search asks for it; with the same bits."""
    found = []
    for form in (PLAIN, ALWAYS):
        monkeypatch.setenv(VARIABLE, form)
        found.append(first_lift_off(laws["poly345"], TWO, 450.0 * RPM, np.zeros(2), 1.0))
    assert found[0] == found[1] is not None


def test_binomials_beyond_the_table():
    """A law of a high degree goes by a recurrence."""
    for degree in (3, len(rows.PASCAL) - 1, len(rows.PASCAL), len(rows.PASCAL) + 9):
        assert rows.binomials(degree)[2] == math.comb(degree, 2)


def test_plain_python_until_it_pays(monkeypatch):
    """A first event imports nothing; a long search is compiled, if numba is there."""
    monkeypatch.delenv(VARIABLE, raising=False)
    monkeypatch.setattr(compiled.SPENT, "seconds", 0.0)
    assert form_of(run_events).func is compiled._timed
    compiled.expect_many()
    assert form_of(run_events) is compiled._compiled(run_events)
    monkeypatch.setattr(compiled, "find_spec", lambda _: None)
    assert form_of(run_events).func is compiled._timed
