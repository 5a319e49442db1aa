"""The stored references: made for these numbers, repeatable, and consistent with physics."""

from dataclasses import replace

import numpy as np
import pytest

from benchmark.speed import exact
from benchmark.speed import exact as exact_twist
from benchmark.speed import study as stored
from benchmark.speed.models import LANDING, LIFT_OFF
from cam_rig.errors import CamRigError


@pytest.mark.parametrize(("name", "turns"), [("elastic_stem", 1), ("two_mass_soft", 1)])
def test_a_reference_is_what_50_digits_give(cases, name, turns):
    """Recomputed over the first turn, it agrees to the last digit of a double."""
    case = cases[name].first_turns(turns)
    again, kept = exact.solve(case), stored.read(case)
    assert again.error(kept) < 1e-15
    assert again.events == kept.events


def test_the_torsional_reference_is_repeatable(cases):
    """Half a turn of it, with joints of the law and twisted passages."""
    case = cases["torsional"]
    short = replace(case, times=case.times[:25])
    kept = stored.read(short)
    again = exact_twist.solve_twist(short)
    assert again.error(kept) < 1e-15


def test_the_torsional_reference_solves_the_equation(cases):
    """Central differences of the Taylor solution satisfy eq. 10 with the law at the twist."""
    case = cases["torsional"]
    step, at = 2e-6, 0.028
    near = replace(case, times=at + step * np.arange(-1.0, 2.0))
    found = exact_twist.solve_twist(near)
    (before, twist, after), rate = found.displacement[0], found.velocity[0, 1]
    acceleration = (after - 2.0 * twist + before) / step**2
    p, turning = case.model, case.speed + rate
    s, s1, s2 = (float(case.law(case.speed * at + twist, order)) for order in range(3))
    assert s1 > 1e-3
    force = p.mass * (s2 * turning**2 + s1 * acceleration) + p.damping * s1 * turning
    force += p.stiffness * s + p.preload
    balance = p.inertia * acceleration + p.shaft_stiffness * twist + force * s1
    assert abs(balance) < 1e-5 * abs(force * s1)


@pytest.mark.parametrize("name", ["two_mass_soft", "two_mass_stem", "one_mass_arc"])
def test_the_follower_flies_in_every_case_of_separation(cases, name):
    """Events begin with a lift-off, come in order, and landings are among them."""
    events = stored.read(cases[name]).events
    kinds, times = zip(*events, strict=True)
    assert kinds[0] == LIFT_OFF
    assert LANDING in kinds
    assert list(times) == sorted(times)


def test_a_reference_for_other_numbers_is_refused(cases):
    """A changed cam or speed must not be measured against an old reference."""
    other = replace(cases["resonance"], speed=cases["resonance"].speed * 1.001)
    with pytest.raises(CamRigError, match=r"made for other numbers.*make_reference"):
        stored.read(other)
