"""Hops are the same however the run is cut, for seeded rigs of every damping."""

import itertools

import numpy as np
import pytest

from cam_rig.dynamics import MODELS, FollowerParameters, Interval, TwoMassParameters
from cam_rig.dynamics.two_mass.trajectory import Separation
from cam_rig.units import NS, RPM, TURN


def ticked(law, model, p, rpm, total, tick):
    """Events and last state of a run in ticks (ns)."""
    state, events, speed = None, [], rpm * RPM
    for a, b in itertools.pairwise([*range(0, total, tick), total]):
        interval = Interval(a, b, speed * a / NS, speed)
        state, block = MODELS[model].advance(law, p, state, interval, 1000)
        events += block.events
    return events, state


def random_rig(seed, model):
    """Parameters and rpm, over the range that a rig may have."""
    rng = np.random.default_rng(seed)
    mass, share = rng.uniform(0.5, 2.0), rng.uniform(0.2, 0.6)
    spring, preload = 10.0 ** rng.uniform(0.0, 4.0), rng.uniform(5.0, 60.0)
    restitution = float(rng.choice([0.0, 0.3, 0.5, 0.7]))
    damping, rpm = rng.uniform(0.0, 30.0), rng.uniform(250.0, 600.0)
    if model == "one_mass":
        p = FollowerParameters(mass, spring, damping, preload, 3.3e8, restitution)
    else:
        stem = 10.0 ** rng.uniform(5.0, 7.0)
        p = TwoMassParameters(
            mass * share, mass * (1.0 - share), stem, spring, rng.uniform(1.0, 200.0), damping,
            preload, restitution=restitution,
        )  # fmt: skip
    return p, rpm


def compare(law, model, seed):
    p, rpm = random_rig(seed, model)
    total = round(2.0 * TURN / (rpm * RPM) * NS)
    wanted, last = ticked(law, model, p, rpm, total, total)
    for tick in (total // 2, 50 * NS // 1000, 7 * NS // 1000, NS // 1000):
        events, state = ticked(law, model, p, rpm, total, tick)
        assert [e.kind for e in events] == [e.kind for e in wanted]
        for one, other in zip(events, wanted, strict=True):
            assert one.time == pytest.approx(other.time, abs=1e-9)
        impulses = sum(e.impulse for e in wanted)
        assert sum(e.impulse for e in events) == pytest.approx(impulses, rel=1e-9)
        assert state.in_contact == last.in_contact
    return len(wanted)


@pytest.mark.parametrize("model", ["one_mass", "two_mass"])
@pytest.mark.parametrize("cam", ["poly345", "bezier15"])
@pytest.mark.parametrize("seed", [101, 103, 113])
def test_the_number_of_hops_is_the_runs_own(laws, model, cam, seed):
    """Not that of its ticks: the same events, impulses to 1e-9. Bézier 15 is all one piece."""
    compare(laws[cam], model, seed)


@pytest.mark.long
@pytest.mark.parametrize("model", ["one_mass", "two_mass"])
@pytest.mark.parametrize("cam", ["poly345", "tm21", "bezier15"])
@pytest.mark.parametrize("seed", range(100, 140))
def test_more_hops(laws, model, cam, seed):
    """The same for more rigs and cams."""
    compare(laws[cam], model, seed)


@pytest.mark.parametrize("spring", [4030.0, 4.0, 1.0, 0.04])
def test_critical_damping_is_nothing_special(laws, spring):
    """An end mass on a closing spring damped critically hops as one damped by a hair more or less.

    Its matrix has one shape for two modes, and a weak spring would rest far away.
    """
    mass, share = 1.3, 0.3
    critical = 2.0 * np.sqrt(spring * mass)
    runs = []
    for part in (0.9999, 1.0 - 1e-9, 1.0, 1.0 + 1e-9, 1.0001):
        p = TwoMassParameters(
            mass * share, mass * (1.0 - share), 1.26e6, spring, 8.642, part * critical, 30.0,
            restitution=0.5,
        )  # fmt: skip
        found = Separation(laws["poly345"], p, 400.0 * RPM)
        found.run(TURN / found.speed * 1.5)
        runs.append(found.events)
    assert len({len(events) for events in runs}) == 1
    assert len(runs[0]) > 4
    for events in runs[1:4]:
        for one, other in zip(events, runs[2], strict=True):
            assert one.time == pytest.approx(other.time, abs=1e-6)
    for events in (runs[1], runs[3]):
        assert [e.time for e in events] == pytest.approx([e.time for e in runs[2]], abs=1e-6)


def test_a_force_that_begins_within_rounding(laws):
    """A soft stem whose force is zero to rounding where a phase begins: it is a root, or none."""
    mass, share, stem, spring = 1.3, 0.3, 37085.62382270041, 0.039389330736387895
    for critical in (spring * mass, spring * mass * 0.7, (stem + spring) * mass * 0.7):
        p = TwoMassParameters(
            mass * share, mass * (1.0 - share), stem, spring, 8.642, 2.0 * np.sqrt(critical),
            0.2726594001662999, restitution=0.5,
        )  # fmt: skip
        found = Separation(laws["poly345"], p, 158.68626222807606 * RPM)
        found.run(2.0)
        times = [event.time for event in found.events]
        assert times == sorted(times)
        assert len(times) < 200
