"""Tests of the stored references: current parameters, repeatable, consistent."""

from dataclasses import replace

import mpmath as mp
import numpy as np
import pytest

from benchmark.speed import exact
from benchmark.speed import study as stored
from benchmark.speed.exact import DIGITS, exact_pieces, flow
from benchmark.speed.models import LANDING, LIFT_OFF, TwoMasses
from cam_rig.errors import CamRigError
from cam_rig.laws import Law


@pytest.mark.parametrize(("name", "turns"), [("elastic_stem", 1), ("two_mass_soft", 1)])
def test_a_reference_is_what_50_digits_give(cases, name, turns):
    """A stored reference equals a new computation of its first turn with 50 digits.

    The error is below 1e-15, so that all digits of a float agree, and the events are equal.
    """
    case = cases[name].first_turns(turns)
    again, kept = exact.solve(case), stored.read_reference(case)
    assert again.error(kept) < 1e-15
    assert again.events == kept.events


def test_the_torsional_reference_is_repeatable(cases):
    """A new computation of half a turn equals the stored torsional reference to 1e-15.

    Within the half turn the cam passes joints of the motion law, where two polynomial pieces meet.
    The twist of the shaft shifts their times.
    """
    case = cases["torsional"]
    short = replace(case, times=case.times[:25])
    kept = stored.read_reference(short)
    again = exact.solve_twist(short)
    assert again.error(kept) < 1e-15


def test_the_torsional_reference_solves_the_equation(cases):
    """The stored torsional reference satisfies eq. 10 of the paper.

    The derivatives are central differences of the twist. The remainder is below 1e-5 of the torque
    of the contact force, the error of the differences.
    """
    case = cases["torsional"]
    step, at = 2e-6, 0.028
    near = replace(case, times=at + step * np.arange(-1.0, 2.0))
    found = exact.solve_twist(near)
    (before, twist, after), rate = found.displacement[0], found.velocity[0, 1]
    acceleration = (after - 2.0 * twist + before) / step**2
    p, turning = case.model, case.speed + rate
    s, s1, s2 = (float(case.law(case.speed * at + twist, order)) for order in range(3))
    assert s1 > 1e-3
    force = p.mass * (s2 * turning**2 + s1 * acceleration) + p.damping * s1 * turning
    force += p.stiffness * s + p.preload
    balance = p.inertia * acceleration + p.shaft_stiffness * twist + force * s1
    assert abs(balance) < 1e-5 * abs(force * s1)


@pytest.mark.parametrize(
    "name", ["two_mass_soft", "two_mass_stem", "one_mass_arc", "ball_on_table"]
)
def test_the_follower_flies_in_every_case_of_separation(cases, name):
    """The events of each case with flights start with a lift-off and include landings.

    They are in the order of time.
    """
    events = stored.read_reference(cases[name]).events
    kinds, times = zip(*events, strict=True)
    assert kinds[0] == LIFT_OFF
    assert LANDING in kinds
    assert list(times) == sorted(times)


def test_a_reference_for_other_numbers_is_refused(cases):
    """A stored reference is refused if the cam speed of its case has changed."""
    other = replace(cases["resonance"], speed=cases["resonance"].speed * 1.001)
    with pytest.raises(CamRigError, match=r"made for other numbers.*make_reference"):
        stored.read_reference(other)


# -- closed form of one phase of the reference


@pytest.mark.parametrize("spring_damping", [0.0, 89.37064464606817, 1e3])
def test_a_phase_starts_at_its_state_and_satisfies_its_equation(spring_damping):
    """The exact motion in contact or flight satisfies its differential equation.

    The motion starts at the given state (to 1e-50). The acceleration, a centred difference over
    ±1e-20 s, agrees with the right side of the equation to 30 digits. The three dampings give
    complex pairs of eigenvalues, real eigenvalues, and eigenvalues whose imaginary part is only
    rounding.
    """
    law = Law(
        "one", [0.0, 2.0, 6.283185307179586], [[0.0, 0.01], [0.0, 0.01], [0.01, 0.0], [0.01, 0.0]]
    )
    model = TwoMasses(
        0.2668876, 0.0824588, 18605.758128384656, 1876.5254484237591, 0.0, spring_damping, 15.1
    )
    with mp.workdps(DIGITS):
        piece = exact_pieces(law, 100.0)[0]
        phases = model.typed(mp.mpf).phases()
        for name, start in (("contact", [4e-4, -0.1]), ("flight", [0.0, 4e-4, 0.0, -0.1])):
            phase, begin, step = phases[name], mp.mpf("0.001"), mp.mpf("1e-20")
            run = flow(phase, piece, begin, [mp.mpf(x) for x in start])
            state = run.state(begin)
            assert max(abs(a - b) for a, b in zip(state, start, strict=True)) < 1e-50
            motion, half = piece.motion(begin), len(start) // 2
            before, after = run.state(begin - step), run.state(begin + step)
            for i in range(half):
                pull = zip(phase.rows[i], state, strict=True)
                drive = zip(phase.drive[i], motion, strict=True)
                wanted = sum(a * b for a, b in pull) + sum(a * b for a, b in drive)
                rate = (after[half + i] - before[half + i]) / (2 * step)
                assert abs(rate - wanted) <= mp.mpf(10) ** -30 * (1 + abs(wanted))
