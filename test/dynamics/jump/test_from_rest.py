"""Tests of runs from rest: different computations of the contact force agree.

The tests include laws whose lift has a slope at angle 0.
"""

import math
from dataclasses import fields, replace

import numpy as np
import pytest

import cam_rig
from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.jump import two_masses
from cam_rig.dynamics.jump.two_masses import find_jump_speed, force_run
from cam_rig.errors import DynamicsError
from cam_rig.units import RPM, TURN
from examples.paper.turns import Rigs, ShapeTable, turn_minima

from ...studies.design.shared import integrated
from ..helpers import turned

#: Duration of the runs, s.
RUN = 0.4


@pytest.fixture(scope="module")
def steep(laws):
    """Two laws with a slope at angle 0, s'(0) > 0 and s'(0) < 0."""
    steep_laws = [turned(laws["poly345"], np.radians(degrees)) for degrees in (90.0, 270.0)]
    assert [np.sign(law(np.zeros(1), 1)[0]) for law in steep_laws] == [1.0, -1.0]
    return steep_laws


def test_all_runs_from_rest_agree(steep, paper_rig, two_mass):
    """Four computations of the contact force of a run from rest agree.

    A simulation agrees with a numerical integration to 1e-5 of the largest force. Its smallest
    force agrees with the minimum search for one rig and that for many rigs, to 1 % and 0.1 % of the
    largest force. The force first becomes negative at the jump speed.
    """
    p = two_mass
    for law in steep:
        jump, min_force = find_jump_speed(law, p, RUN), force_run(law, p, RUN).min_output
        assert min_force(jump * (1 - 1e-4)) > 0.0 > min_force(jump * (1 + 1e-4))
        speed = 0.8 * jump
        turns = int(speed * RUN / TURN)
        motion = cam_rig.simulate(law, paper_rig, model="two_mass", rpm=speed / RPM, turns=turns)
        subset = slice(None, None, max(1, motion.time.size // 4000))
        times, force = motion.time[subset], motion.force[subset]
        assert force == pytest.approx(integrated(law, p, speed, times), abs=1e-5 * force.max())
        least = force_run(law, p, turns * TURN / speed).min_output(speed)
        assert least <= motion.force.min() <= least + 0.01 * motion.force.max()
        spans = law.spans[None]
        table = turn_minima(ShapeTable.of(law, 20_000), spans, Rigs.of(p, 1), speed, turns)
        assert table.force.min() == pytest.approx(least, abs=1e-3 * motion.force.max())


# Smallest force of each turn, computed for many rigs at once, against the model of one rig.

CAMS = ("bezier15", "poly345", "tm21", "cycloidal", "bezier_segments", "half_rises")
TURNS = 6


def random_rigs(rng, count):
    """Return random two-mass followers as arrays, with stems of 1e6 to 6e6 N/m."""
    share = rng.uniform(0.1, 0.9, count)
    mass = rng.uniform(0.5, 2.0, count)
    damping = 10.0 ** rng.uniform(-2.0, 1.3, (2, count))
    stem = 10.0 ** rng.uniform(6.0, 6.8, count)
    spring, preload = rng.uniform([2000.0, 0.0], [8000.0, 60.0], (count, 2)).T
    return Rigs(share * mass, (1.0 - share) * mass, stem, spring, *damping, preload)


@pytest.mark.variants(3)
@pytest.mark.parametrize("name", CAMS)
def test_minima_of_many_rigs_are_those_of_each_rig(laws, name):
    """The smallest contact force up to each turn, computed for five rigs in one call.

    It agrees with the computation for a single rig to 2 % or 1 N, the error of its grid of angles.
    """
    rng, law = np.random.default_rng(CAMS.index(name)), laws[name]
    rigs, rpm = random_rigs(rng, 5), float(rng.uniform(250.0, 600.0))
    spans = np.repeat(law.spans[None], 5, axis=0)
    minima = turn_minima(ShapeTable.of(law, 4000), spans, rigs, rpm * RPM, TURNS)
    min_forces = np.minimum.accumulate(minima.force, axis=1)
    for i in range(5):
        numbers = (float(getattr(rigs, f.name)[i]) for f in fields(TwoMassParameters)[:7])
        follower = TwoMassParameters(*numbers)
        for turn in (0, 1, TURNS - 1):
            run = force_run(law, follower, (turn + 1) * 60.0 / rpm * (1.0 - 1e-12))
            exact = run.min_output(rpm * RPM)
            assert min_forces[i, turn] == pytest.approx(exact, rel=0.02, abs=1.0)


# -- number of evaluations that a search for a jump speed needs

#: Limit of function evaluations of a jump speed search in these tests, lower than the default
#: limit.
MAX_TEST_EVALUATIONS = 1e6
#: Range of each parameter of a random rig, which is the range that a rig file allows.
RANGES = {
    "roller_mass": (1e-9, 1e6),
    "end_mass": (1e-9, 1e6),
    "stem_stiffness": (1e-9, 1e15),
    "spring_stiffness": (1e-9, 1e15),
    "stem_damping": (0.0, 1e9),
    "damping": (0.0, 1e9),
    "preload": (0.0, 1e9),
}


@pytest.mark.variants(3)
@pytest.mark.parametrize("stiffness", [1e9, 1e12, 1e15])
@pytest.mark.parametrize("duration", [1.7, None])
def test_a_stiffer_stem_takes_no_more_evaluations(laws, two_mass, monkeypatch, stiffness, duration):
    """With a very stiff stem the search finds the jump speed of a rigid follower.

    It needs fewer than 1e6 evaluations, and the result is within 5 rpm. At 10¹⁵ N/m the stem has
    10⁷ resonances below that speed. The search proves contact over wide ranges of the speed instead
    of evaluating each resonance.
    """
    monkeypatch.setattr(two_masses, "MAX_EVALUATIONS", MAX_TEST_EVALUATIONS)
    stiff = replace(two_mass, stem_stiffness=stiffness)
    jump_rpm = find_jump_speed(laws["poly345"], stiff, duration) / RPM
    assert jump_rpm == pytest.approx(458.67, abs=5.0)


def random_rig(two_mass, seed):
    """Return two masses with random parameters from the whole allowed range.

    Each parameter is at a limit, between the limits, or that of the identified rig.
    """
    rng = np.random.default_rng(seed)
    numbers = {}
    for name, (low, high) in RANGES.items():
        least = max(low, 1e-6 * high if low == 0.0 else low)
        between = 10.0 ** rng.uniform(math.log10(least), math.log10(high))
        numbers[name] = float(rng.choice([low, high, getattr(two_mass, name), between]))
    return replace(two_mass, **numbers)


@pytest.mark.variants(12)
@pytest.mark.parametrize("seed", range(312))
def test_any_rig_has_a_jump_speed_or_an_error(laws, two_mass, monkeypatch, seed):
    """Within 1e6 evaluations each random rig gets a jump speed or an error.

    The error states which values are allowed.
    """
    monkeypatch.setattr(two_masses, "MAX_EVALUATIONS", MAX_TEST_EVALUATIONS)
    rng = np.random.default_rng(seed)
    law = laws[str(rng.choice(["poly345", "cycloidal", "bezier15", "bezier_segments"]))]
    duration = [1.7, None][int(rng.integers(2))]
    try:
        assert find_jump_speed(law, random_rig(two_mass, seed), duration) >= 0.0
    except DynamicsError as error:
        assert "allowed" in str(error)


def test_a_search_with_too_many_evaluations_is_refused(laws, two_mass, monkeypatch):
    """A search that needs over 2000 evaluations is refused with the speed reached.

    The error also states the limit and remedies.
    """
    monkeypatch.setattr(two_masses, "MAX_EVALUATIONS", 2e3)
    with pytest.raises(
        DynamicsError, match=r"contact holds up to .* more than 2000 evaluations .*stem"
    ):
        find_jump_speed(laws["cycloidal"], two_mass, 1.7)
