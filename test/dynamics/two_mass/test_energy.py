"""Energy of the two masses: what the cam puts in is stored, burnt in two dampers, or lost.

Gauss-Legendre with 16 nodes on pieces of two radians of the fastest mode, cut at every joint and
every event, is exact to rounding: the account closes to 1e-14 where every event is one.
"""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.two_mass.model import _phase_states
from cam_rig.dynamics.two_mass.trajectory import Separation
from cam_rig.units import TURN

SOFT = TwoMassParameters(0.52, 0.78, 1.26e6, 4030.0, 8.642, 8.642, 30.6)
STEM = TwoMassParameters(0.52, 0.78, 3.3e8, 4030.0, 8.642, 8.642, 12.753)
HARDEST = replace(STEM, stem_stiffness=1e10, stem_damping=0.0, damping=0.0)
NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)

PLASTIC = {"soft": SOFT, "stem": STEM}
PLASTIC |= {"undamped stem": replace(STEM, stem_damping=0.0, damping=0.0), "hardest": HARDEST}
LIVELY = {
    "soft, e=0.5": replace(SOFT, restitution=0.5),
    "stem, e=0.5": replace(STEM, restitution=0.5),
}
LIVELY |= {"soft, e=0.9": replace(SOFT, restitution=0.9)}


def stored(p, state):
    """Kinetic energy of both masses, of both springs, and of the loads, J."""
    z, v, y, w = state[:4]
    kinetic = 0.5 * p.roller_mass * v**2 + 0.5 * p.end_mass * w**2
    springs = 0.5 * p.stem_stiffness * (z - y) ** 2 + 0.5 * p.spring_stiffness * y**2
    return kinetic + springs + p.preload * y


def smooth_stretches(found):
    """Phase, times and weights of stretches without a joint or an event inside."""
    joints = (found.law.breaks[:-1] + TURN * np.arange(4)[:, None]).ravel() / found.speed
    for phase in found.phases:
        inside = joints[(joints > phase.begin) & (joints < phase.end)]
        for a, b in itertools.pairwise([phase.begin, *inside, phase.end]):
            count = 2 + int((b - a) * found.parameters.fastest_rate / 2.0)
            edges = np.linspace(a, b, count + 1)
            half = 0.5 * np.diff(edges)[:, None]
            times = edges[:-1, None] + half * (NODES + 1.0)
            yield phase, times.ravel(), (half * WEIGHTS).ravel()


def account(found):
    """Work of the cam, energy that went to and fro through the contact, and energy burnt, J."""
    p, work, flowed, burnt = found.parameters, 0.0, 0.0, 0.0
    for phase, times, weights in smooth_stretches(found):
        state = _phase_states(found, phase, times)
        work += weights @ (state[4] * state[1])
        flowed += weights @ np.abs(state[4] * state[1])
        burnt += weights @ (p.stem_damping * (state[1] - state[3]) ** 2 + p.damping * state[3] ** 2)
    for event in found.events:  # an impulse works at the velocity of the cam
        by_impulse = event.impulse * float(found.cam(np.array([event.time]))[1, 0])
        work, flowed = work + by_impulse, flowed + abs(by_impulse)
    return work, flowed, burnt


def missing(law, p, rpm, turns):
    """What the account of a run does not explain, relative to ∫|F ṡ| dt; and the run."""
    speed = rpm * np.pi / 30.0
    found = Separation(law, p, speed)
    found.run(turns * TURN / speed)
    work, flowed, burnt = account(found)
    first, last = found.phases[0], found.phases[-1]
    begun = stored(p, _phase_states(found, first, np.array([first.begin])))[0]
    ended = stored(p, _phase_states(found, last, np.array([last.end])))[0]
    lost = sum(event.energy_lost for event in found.events)
    return abs(work - burnt - lost - (ended - begun)) / flowed, found


@pytest.mark.parametrize("parameters", PLASTIC.values(), ids=PLASTIC.keys())
@pytest.mark.parametrize(("rpm", "turns"), [(450.0, 2.3), (600.0, 1.0), (600.0, 2.3)])
def test_plastic(laws, parameters, rpm, turns):
    """The roller's relative kinetic energy is gone with each landing, nothing else: to 1e-12."""
    gap, found = missing(laws["poly345"], parameters, rpm, turns)
    assert len(found.events) >= 4
    assert gap < 1e-12


@pytest.mark.parametrize(
    ("name", "rpm"),
    [
        *[(name, 450.0) for name in LIVELY],
        ("soft, e=0.9", 600.0),
        ("soft, e=0.5", 600.0),
        ("stem, e=0.5", 600.0),
    ],
)
def test_lively(laws, name, rpm):
    """With restitution each landing loses (1 − e²) of it, bounce after bounce: to 1e-10."""
    gap, found = missing(laws["poly345"], LIVELY[name], rpm, 1.0)
    assert len(found.events) > 4
    assert gap < 1e-10


def test_an_arc_cam(laws):
    """Forces that jump at joints, and a roller that leaves at one."""
    gap, found = missing(laws["tm21"], STEM, 450.0, 1.3)
    assert len(found.events) > 4
    assert gap < 1e-12
